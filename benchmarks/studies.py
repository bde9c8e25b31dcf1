"""What the studies of this folder share: constants changed for a while, and pairs matched in parallel."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from isomatch import Correspondence
from isomatch.datasets.benchmarks import BenchmarkPair, benchmark_set
from isomatch.evaluation import counted, geodesic_errors

T = TypeVar("T")
R = TypeVar("R")


@contextmanager
def changed(module: ModuleType, **values: Any) -> Iterator[None]:
    """Give constants of a module other values."""
    usual = {name: getattr(module, name) for name in values}
    try:
        for name, value in values.items():
            setattr(module, name, value)
        yield
    finally:
        for name, value in usual.items():
            setattr(module, name, value)


def in_parallel(function: Callable[[T], R], jobs: Iterable[T]) -> Iterator[R]:
    """Give each job to a process of its own thread; results in order."""
    with ProcessPoolExecutor(mp_context=get_context("spawn"), initializer=_one_thread) as pool:
        yield from pool.map(function, jobs)


def _one_thread() -> None:
    os.environ["ISOMATCH_NUM_THREADS"] = "1"


def mean_error(pair: BenchmarkPair, found: Correspondence, either_side: bool = False) -> float:
    """Mean geodesic error × 100 / √(target area) on 400 truth points; of truth and mirrored truth the better one."""
    truths = [pair.truth] if pair.mirrored is None or not either_side else [pair.truth, pair.mirrored]
    errors = [geodesic_errors(pair.target, found, truth, 400) for truth in truths]
    return float(100 * min(counted(each).mean() for each in errors))


def drawn(data: str, counts: dict[str, int], seed: int) -> list[tuple[str, str, tuple[str, str]]]:
    """Folder, set and names of pairs drawn from some sets."""
    return [
        (data, name, pair)
        for name, count in counts.items()
        for pair in benchmark_set(name, data).chosen(count, seed).pairs
    ]


def asked_for(description: str | None, file: str) -> argparse.Namespace:
    """Read ``--data`` and ``-o`` from the command line, and make the folder that the file is written to."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--data", required=True, help="folder of the benchmark sets")
    parser.add_argument("-o", "--output", type=Path, required=True, help=f"folder for {file}")
    asked = parser.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    return asked
