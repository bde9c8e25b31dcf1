"""What the studies of this folder share: constants changed for a while, and pairs matched in parallel."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from types import ModuleType
from typing import Any, TypeVar

import numpy as np

from isomatch import Correspondence
from isomatch.datasets.benchmarks import BenchmarkPair
from isomatch.evaluation import geodesic_errors

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
    return float(100 * min(np.where(np.isfinite(each), each, 1.0).mean() for each in errors))
