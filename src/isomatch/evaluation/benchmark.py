"""Run methods over a benchmark set: in parallel, resumable, one row for each pair, whatever happens to it."""

from __future__ import annotations

import csv
import json
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from isomatch._threads import n_threads
from isomatch.baselines import pyfm_zoomout
from isomatch.datasets import BenchmarkPair
from isomatch.datasets.benchmarks import benchmark_set
from isomatch.errors import SettingError
from isomatch.evaluation.princeton import THRESHOLDS, cumulative_curve, geodesic_errors
from isomatch.maps import Correspondence
from isomatch.matching import match
from isomatch.surfaces import Mesh

FAILURE = 10.0  # mean error × 100 above which a pair counts as failed
COLUMNS = (
    "set", "pair", "method", "n_source", "n_target", "error", "median", "p95", "direct", "mirrored",
    "unmatched", "within_05", "within_10", "within_25", "seconds", "outcome", "problem",
)  # fmt: skip

Method = Callable[[Mesh, Mesh], tuple[Correspondence, dict[str, Any]]]


def _isomatch(source: Mesh, target: Mesh) -> tuple[Correspondence, dict[str, Any]]:
    result = match(source, target)
    return result.map, result.to_dict()


def _pyfm(source: Mesh, target: Mesh) -> tuple[Correspondence, dict[str, Any]]:
    return pyfm_zoomout(source, target), {}


METHODS: dict[str, Method] = {"isomatch": _isomatch, "pyfm": _pyfm}


@dataclass(frozen=True)
class BenchmarkRun:
    """What to run.

    Parameters
    ----------
    set_name : str
        Name of the set, see `benchmark_set`.
    methods : tuple of str
        Keys of ``METHODS``.
    folder : str, optional
        Where the sets lie.
    n_pairs : int, optional
        Pairs to draw; all by default.
    n_points : int
        Truth points judged for each pair.
    seed : int
        Seeds both draws.
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
        unknown = sorted(set(self.methods) - set(METHODS))
        if unknown:
            raise SettingError(f"unknown method {', '.join(unknown)}; known are {', '.join(METHODS)}")
        for name, least in (("n_pairs", 1), ("n_points", 1), ("seed", 0), ("jobs", 1)):
            value = getattr(self, name)
            if value is not None and value < least:
                raise SettingError(f"{name} = {value} is not at least {least}")


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
        if "problem" not in row and (row["points"], row["seed"]) == (run.n_points, run.seed)
    }
    pairs = benchmark_set(run.set_name, run.folder).chosen(run.n_pairs, run.seed).pairs
    todo = [
        (method, pair)
        for method in run.methods
        for pair in pairs
        if (run.set_name, "-".join(pair), method) not in done
    ]
    jobs = run.jobs or n_threads()
    with ledger.open("a", encoding="utf-8") as file:
        for row in _rows(run, todo, jobs):
            file.write(json.dumps(row, allow_nan=False) + "\n")
            file.flush()
            yield row


def _rows(run: BenchmarkRun, todo: list[tuple[str, tuple[str, str]]], jobs: int) -> Iterator[dict[str, Any]]:
    if jobs == 1:
        yield from (_row(run, method, pair) for method, pair in todo)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_one_thread) as pool:
        for future in as_completed([pool.submit(_row, run, method, pair) for method, pair in todo]):
            yield future.result()


def _one_thread() -> None:
    """Give a worker one thread, in our loops and in every linear algebra library."""
    os.environ["ISOMATCH_NUM_THREADS"] = "1"
    ThreadpoolController().limit(limits=1)


def _row(run: BenchmarkRun, method: str, names: tuple[str, str]) -> dict[str, Any]:
    """Match one pair with one method and judge the map; any problem becomes part of the row."""
    row: dict[str, Any] = {"set": run.set_name, "pair": "-".join(names), "method": method}
    row |= {"points": run.n_points, "seed": run.seed}
    try:
        pair = benchmark_set(run.set_name, run.folder).load(*names)
        started = time.perf_counter()
        found, details = METHODS[method](pair.source, pair.target)
        row |= {"seconds": time.perf_counter() - started, "outcome": details.get("outcome", "")}
        row |= {"n_source": pair.source.n_vertices, "n_target": pair.target.n_vertices, "details": details}
        row |= _judged(run, pair, found)
    except Exception as problem:  # a benchmark reports what any method does; nothing is hidden
        row["problem"] = f"{type(problem).__name__}: {problem}"
    return row


def _judged(run: BenchmarkRun, pair: BenchmarkPair, found: Correspondence) -> dict[str, Any]:
    """Errors × 100, an unmatched vertex counting as √area.

    Where the source is truly symmetric, one decision is taken for the pair between direct and mirrored truth.
    """
    judged = [pair.truth] if pair.mirrored is None else [pair.truth, pair.mirrored]
    raw = [geodesic_errors(pair.target, found, truth, run.n_points, run.seed) for truth in judged]
    sides = [np.where(np.isfinite(errors), errors, 1.0) for errors in raw]
    errors = min(sides, key=np.mean)
    return {
        "error": float(100 * errors.mean()),
        "median": float(100 * np.median(errors)),
        "p95": float(100 * np.quantile(errors, 0.95)),
        "direct": float(100 * sides[0].mean()),
        "mirrored": float(100 * sides[1].mean()) if len(sides) > 1 else None,
        "unmatched": float((~np.isfinite(raw[0])).mean()),
        **{f"within_{int(100 * t):02d}": float((errors <= t).mean()) for t in (0.05, 0.10, 0.25)},
        "curve": [round(float(value), 4) for value in cumulative_curve(errors)],
    }


def read_rows(out: str | Path) -> list[dict[str, Any]]:
    """Give the rows of a run so far: for each set, pair and method the last one."""
    ledger = Path(out) / "rows.jsonl"
    if not ledger.exists():
        return []
    rows = [json.loads(line) for line in ledger.read_text(encoding="utf-8").splitlines() if line.strip()]
    return list({(row["set"], row["pair"], row["method"]): row for row in rows}.values())


def summaries(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean, median, worst, failures and seconds for each set and method, in order of appearance."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["set"], row["method"]), []).append(row)
    table = []
    for (name, method), members in groups.items():
        good = [row for row in members if "problem" not in row]
        errors = np.array([row["error"] for row in good])
        table.append(
            {
                "set": name,
                "method": method,
                "pairs": len(members),
                "mean": float(errors.mean()) if len(good) else None,
                "median": float(np.median(errors)) if len(good) else None,
                "max": float(errors.max()) if len(good) else None,
                "failures": int((errors > FAILURE).sum()),
                "problems": len(members) - len(good),
                "seconds": float(np.mean([row["seconds"] for row in good])) if good else None,
            }
        )
    return table


def write_tables(out: str | Path) -> list[dict[str, Any]]:
    """Write ``pairs.csv``, ``summary.csv`` and the curves ``curves.png`` and ``.svg``; return the summary."""
    out = Path(out)
    rows = sorted(read_rows(out), key=lambda row: (row["set"], row["method"], row["pair"]))
    table = summaries(rows)
    _write_csv(out / "pairs.csv", rows, COLUMNS)
    if table:
        _write_csv(out / "summary.csv", table, tuple(table[0]))
        _draw_curves(rows, out)
    return table


def _write_csv(path: Path, rows: list[dict[str, Any]], columns: tuple[str, ...]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(
            {key: round(value, 4) if isinstance(value, float) else value for key, value in row.items()}
            for row in rows
        )


def _draw_curves(rows: list[dict[str, Any]], out: Path) -> None:
    from matplotlib.figure import Figure

    curves: dict[str, list[list[float]]] = {}
    for row in rows:
        if "curve" in row:
            curves.setdefault(f"{row['set']}, {row['method']}", []).append(row["curve"])
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot(
        xlabel="geodesic error / √(target area)", ylabel="correspondences, %", xlim=(0, 0.25), ylim=(0, 101)
    )
    for (label, members), style in zip(curves.items(), ("-", "--", "-.", ":") * len(curves)):
        axes.plot(THRESHOLDS, 100 * np.mean(members, axis=0), style, label=f"{label} ({len(members)} pairs)")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    for suffix in ("png", "svg"):
        figure.savefig(out / f"curves.{suffix}", dpi=150)
