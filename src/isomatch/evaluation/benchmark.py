"""Run methods over a benchmark set: in parallel, resumable, one row for each pair, whatever happens to it."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import lru_cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from threadpoolctl import ThreadpoolController

from isomatch._arrays import IntArray
from isomatch._memory import memory_budget
from isomatch._settings import require_least
from isomatch._threads import n_threads, serial_blas
from isomatch.correspondence import Correspondence
from isomatch.datasets import example_pair
from isomatch.datasets.benchmarks import benchmark_set
from isomatch.evaluation.bijectivity import coverage
from isomatch.evaluation.distortion import metric_distortion
from isomatch.evaluation.methods import CONTINUATIONS, METHODS, Method, Surface, parts_of, true_landmarks
from isomatch.evaluation.princeton import SHARES, area_under_curve, counted, cumulative_curve, sided_errors
from isomatch.evaluation.remembering import RememberingEngine
from isomatch.evaluation.smoothness import dirichlet_energy
from isomatch.geodesics import distance_engine
from isomatch.matching import Config, match, prepare_pair

Job: TypeAlias = tuple[tuple[str, str], str]  # names of the pair, method to start with

DISTORTION_ROWS = 100  # points whose distances to 1000 others tell the distortion of a pair


@dataclass(frozen=True)
class BenchmarkRun:
    """What to run.

    Parameters
    ----------
    set_name : str
        Name of the set, see `benchmark_set`.
    methods : tuple of str
        Keys of ``METHODS``; with "+" and a key of ``CONTINUATIONS``, what starts from their map: "sgmds_5pt+gdd".
    folder : str, optional
        Where the sets lie.
    n_pairs : int, optional
        Pairs to draw; all by default.
    n_points : int
        Truth points judged for each pair.
    seed : int
        Seeds the draws of pairs, of truth points and of true landmarks.
    jobs : int, optional
        Pairs at once, each on one thread; by default one for each processor. With ``jobs=1`` a pair has all threads.
    """

    set_name: str
    methods: tuple[str, ...] = ("isomatch",)
    folder: str | None = None
    n_pairs: int | None = None
    n_points: int = 1000
    seed: int = 0
    jobs: int | None = None

    def __post_init__(self) -> None:
        for name in self.methods:
            parts_of(name)
        require_least(self, n_pairs=1, n_points=1, seed=0, jobs=1)


def run_benchmark(run: BenchmarkRun, out: str | Path) -> Iterator[dict[str, Any]]:
    """Run every method on every pair and yield the rows as they come.

    Rows are appended to ``out/rows.jsonl`` at once; pairs already there are not run again, so an interrupted run goes
    on where it stopped. A pair that fails is a row that names the problem.
    """
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    ledger = out / "rows.jsonl"
    done = {
        (row["set"], row["pair"], row["method"])
        for row in read_rows(out)
        if "either" in row and (row["points"], row["seed"]) == (run.n_points, run.seed)
    }
    pairs = benchmark_set(run.set_name, run.folder).chosen(run.n_pairs, run.seed).pairs
    todo: dict[Job, list[str]] = {}  # what starts from one map is one job
    for pair in pairs:
        for method in run.methods:
            base, ending = parts_of(method)
            if (run.set_name, "-".join(pair), method) not in done:
                endings = todo.setdefault((pair, base), [])
                if ending and not endings and (run.set_name, "-".join(pair), base) not in done:
                    endings.append("")  # is computed anyway, and shows what was gained
                if ending not in endings:
                    endings.append(ending)
    with ledger.open("a", encoding="utf-8") as file:
        for row in _rows(run, todo, run.jobs or n_threads()):
            file.write(json.dumps(row, allow_nan=False) + "\n")
            file.flush()
            yield row


def _rows(run: BenchmarkRun, todo: dict[Job, list[str]], jobs: int) -> Iterator[dict[str, Any]]:
    if jobs == 1:
        worker = _Worker(run)
        for job, endings in todo.items():
            yield from worker.rows(*job, endings)
        return
    with ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=_begin, initargs=(run,)
    ) as pool:
        for future in as_completed([pool.submit(_work, *job, endings) for job, endings in todo.items()]):
            yield from future.result()


_worker: _Worker  # of this process, see `_begin`


def _begin(run: BenchmarkRun) -> None:
    """Start a worker process: one thread, in our loops and in every linear algebra library; all loops loaded."""
    global _worker
    os.environ["ISOMATCH_NUM_THREADS"] = "1"
    ThreadpoolController().limit(limits=1)
    source, target = example_pair()
    match(source.mesh, target.mesh)
    _worker = _Worker(run)


def _work(names: tuple[str, str], base: str, endings: list[str]) -> list[dict[str, Any]]:
    return _worker.rows(names, base, endings)


class _Subject:
    """A pair, and what the methods of a run need of it again and again."""

    def __init__(self, run: BenchmarkRun, names: tuple[str, str]) -> None:
        self.pair = benchmark_set(run.set_name, run.folder).load(*names)
        limit = memory_budget() / (4 * (run.jobs or n_threads()))
        source, target = (
            RememberingEngine(distance_engine(mesh), limit) for mesh in (self.pair.source, self.pair.target)
        )
        self.engines = source, target
        self.landmarks = lru_cache(lambda count: true_landmarks(self.pair, count, run.seed, self.engines))
        self.prepared = lru_cache(self._prepared)

    def _prepared(self, config: Config | None) -> tuple[Surface, Surface, float]:
        """Give shapes prepared with settings, or the meshes themselves, and the seconds it took."""
        if config is None:
            return self.pair.source, self.pair.target, 0.0
        started = time.perf_counter()
        with serial_blas():
            both = prepare_pair(self.pair.source, self.pair.target, config, 0)
        return both.source, both.target, time.perf_counter() - started


class _Worker:
    """Runs jobs; keeps the last pair, because the jobs of a pair follow one another."""

    def __init__(self, run: BenchmarkRun) -> None:
        self._run = run
        self._subject = lru_cache(maxsize=1)(partial(_Subject, run))

    def rows(self, names: tuple[str, str], base: str, endings: list[str]) -> list[dict[str, Any]]:
        """Match one pair with one method, and continue from its map; any problem becomes part of a row.

        Each row counts the seconds of every preparation it needs once, though the prepared shapes serve other rows too.
        """
        run, method = self._run, METHODS[base]
        known = {"set": run.set_name, "pair": "-".join(names), "points": run.n_points, "seed": run.seed}
        rows = [known | {"method": f"{base}+{ending}" if ending else base} for ending in endings]
        try:
            subject = self._subject(names)
            given = {"landmarks": subject.landmarks(method.n_landmarks)} if method.n_landmarks else {}
            start, details, seconds = _timed(subject, method, given)
        except Exception as problem:  # a benchmark reports what any method does; nothing is hidden
            return [row | {"problem": _problem(problem)} for row in rows]
        sizes = {"n_source": subject.pair.source.n_vertices, "n_target": subject.pair.target.n_vertices}
        for row, ending in zip(rows, endings):
            row |= sizes
            try:
                found, told, preparations, further = start, details, {method.preparation}, 0.0
                if ending:
                    following = CONTINUATIONS[ending]
                    found, told, further = _timed(subject, following, {"initial_map": start.vertices})
                    preparations.add(following.preparation)
                row["seconds"] = seconds + further + sum(subject.prepared(c)[2] for c in preparations)
                row |= {"outcome": told.get("outcome", ""), "details": told} | _judged(run, subject, found)
            except Exception as problem:
                row["problem"] = _problem(problem)
        return rows


def _timed(
    subject: _Subject, method: Method, given: dict[str, IntArray]
) -> tuple[Correspondence, dict[str, Any], float]:
    """Map, what the method tells, and its seconds without preparation."""
    source, target, _ = subject.prepared(method.preparation)
    started = time.perf_counter()
    found, told = method(source, target, given)
    return found, told, time.perf_counter() - started


def _problem(problem: Exception) -> str:
    return f"{type(problem).__name__}: {problem}"


def _judged(run: BenchmarkRun, subject: _Subject, found: Correspondence) -> dict[str, Any]:
    """Errors × 100, an unmatched vertex counting as √area, and the cheap ones of the other measures.

    Where the shapes are truly symmetric, one decision is taken for the pair between direct and mirrored truth.
    """
    pair, engines = subject.pair, subject.engines
    sides = sided_errors(pair.target, found, pair.truth, pair.mirrored, run.n_points, run.seed, engines[1])
    either = counted(sides.better)
    errors = either if pair.symmetric else counted(sides.direct)
    distortion = metric_distortion(
        pair.source, pair.target, found, pair.truth, n_rows=DISTORTION_ROWS, seed=run.seed, engines=engines
    )
    numbers = {
        "error": 100 * errors.mean(),
        "median": 100 * np.median(errors),
        "p95": 100 * np.quantile(errors, 0.95),
        "direct": 100 * counted(sides.direct).mean(),
        "mirrored": np.nan if sides.mirrored is None else 100 * counted(sides.mirrored).mean(),
        "either": 100 * either.mean(),
        "unmatched": np.isinf(sides.direct).mean(),
        "auc": area_under_curve(errors),
        **{f"within_{100 * t:02.0f}": share for t, share in zip(SHARES, cumulative_curve(errors, SHARES))},
        "distortion_l2": distortion.l2,
        "distortion_l2_truth": distortion.truth.l2 if distortion.truth else np.nan,
        "coverage": coverage(pair.target, found),
        "smoothness": dirichlet_energy(pair.source, pair.target, found),
    }
    told = {name: float(number) if np.isfinite(number) else None for name, number in numbers.items()}
    curves = {"curve": counted(sides.direct), "curve_either": either}
    return told | {
        name: [round(float(value), 4) for value in cumulative_curve(values)]
        for name, values in curves.items()
    }


def read_rows(out: str | Path) -> list[dict[str, Any]]:
    """Give the rows of a run so far: for each set, pair and method the last one."""
    ledger = Path(out) / "rows.jsonl"
    if not ledger.exists():
        return []
    rows = [json.loads(line) for line in ledger.read_text(encoding="utf-8").splitlines() if line.strip()]
    return list({(row["set"], row["pair"], row["method"]): row for row in rows}.values())
