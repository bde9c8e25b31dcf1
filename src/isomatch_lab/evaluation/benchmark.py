"""Run methods over a benchmark set: in parallel, resumable, with one row for each pair and method, failed or not."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import as_completed
from functools import lru_cache, partial
from pathlib import Path
from typing import TypeAlias

from isomatch._core.files import made_folder
from isomatch._core.processes import begin_worker, worker_processes
from isomatch._core.threads import n_threads
from isomatch.datasets import example_pair
from isomatch.matching import match
from isomatch_lab.evaluation.benchmark_run import BenchmarkRun, PairNames
from isomatch_lab.evaluation.ledger import Row, appending, identity_of, read_rows
from isomatch_lab.evaluation.methods import CONTINUATIONS
from isomatch_lab.evaluation.subject import Subject

Job: TypeAlias = tuple[PairNames, str]  # a pair, and the method to start with


def run_benchmark(run: BenchmarkRun, out: str | Path) -> Iterator[Row]:
    """Run every method on every pair and yield each new row as soon as it is measured.

    Rows are appended to ``out/rows.jsonl`` at once. A pair that fails gives a row that names the problem. Complete rows
    of the same version and settings that are already there are not computed again, so that an interrupted run continues
    where it stopped. `benchmark` runs it and makes the tables, in one call.
    """
    out = Path(out)
    done = {identity_of(row) for row in read_rows(out) if run.is_complete(row)}
    jobs: dict[Job, list[str]] = {}  # one job computes a map and all its continuations
    for pair in run.chosen_pairs():
        for method in run.names:
            base, _, ending = method.partition("+")
            if identity_of(run.identity(pair, method)) not in done:
                endings = jobs.setdefault((pair, base), [])
                if ending and not endings and identity_of(run.identity(pair, base)) not in done:
                    endings.append("")  # the map to start from is computed anyway; its row shows the gain
                if ending not in endings:
                    endings.append(ending)
    with made_folder(out), appending(out) as append:
        for row in _new_rows(run, jobs):
            append(row)
            yield row


def rows_of(run: BenchmarkRun, out: str | Path) -> list[Row]:
    """Read the rows of a folder that belong to a run: its pairs and methods, by this version with these settings."""
    rows = {identity_of(row): row for row in read_rows(out)}
    wanted = [identity_of(run.identity(pair, method)) for pair in run.chosen_pairs() for method in run.names]
    return [rows[identity] for identity in wanted if identity in rows]


def _new_rows(run: BenchmarkRun, jobs: dict[Job, list[str]]) -> Iterator[Row]:
    at_once = 1 if run.in_this_process else run.jobs or n_threads()
    if at_once == 1:
        worker = _Worker(run)
        for job, endings in jobs.items():
            yield from worker.rows(*job, endings)
        return
    with worker_processes(at_once, _begin, (run,)) as pool:
        for future in as_completed([pool.submit(_work, *job, endings) for job, endings in jobs.items()]):
            yield from future.result()


_worker: _Worker  # the worker of this process, see `_begin`


def _begin(run: BenchmarkRun) -> None:
    """Start a worker process: one thread in our loops and in linear algebra, and every compiled loop loaded if needed."""
    global _worker
    begin_worker(1)
    if run.needs_our_loops:
        source, target = example_pair()
        match(source.mesh, target.mesh)
    _worker = _Worker(run)


def _work(names: PairNames, base: str, endings: list[str]) -> list[Row]:
    return _worker.rows(names, base, endings)


class _Worker:
    """Runs jobs; keeps the last pair, because the jobs of a pair follow one another."""

    def __init__(self, run: BenchmarkRun) -> None:
        self._run = run
        self._subject = lru_cache(maxsize=1)(partial(Subject, run))

    def rows(self, names: PairNames, base: str, endings: list[str]) -> list[Row]:
        """Match a pair with one method and continue from its map; a problem becomes part of the row."""
        rows = [self._run.identity(names, f"{base}+{ending}" if ending else base) for ending in endings]
        directions = (False, True) if self._run.cycles else (False,)  # also target → source to measure cycles
        try:
            subject = self._subject(names)
            starts = [subject.match(self._run.method(base), backwards=backwards) for backwards in directions]
        except (Exception, SystemExit) as problem:  # every failure of a method is reported; nothing is hidden
            return [row | _problem(problem) for row in rows]
        for row, ending in zip(rows, endings):
            try:
                answers = starts
                if ending:
                    continuation = CONTINUATIONS[ending]
                    answers = [
                        subject.match(continuation, start, backwards)
                        for start, backwards in zip(starts, directions)
                    ]
                row |= subject.measures(*answers)
            except (Exception, SystemExit) as problem:
                row |= _problem(problem)
        return rows


def _problem(problem: Exception | SystemExit) -> Row:
    """Describe a problem, with the notes attached to it."""
    text = f"the method called exit({problem})" if isinstance(problem, SystemExit) else problem
    parts = [f"{type(problem).__name__}: {text}", *getattr(problem, "__notes__", [])]
    return {"problem": " ".join(parts)}
