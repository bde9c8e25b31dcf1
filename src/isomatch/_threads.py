"""How many threads to use, and the one way to use them: independent items, results in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock, local
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

from isomatch.errors import SettingError

T = TypeVar("T")
R = TypeVar("R")


def n_threads() -> int:
    """Threads to use: ``ISOMATCH_NUM_THREADS`` if set, otherwise the processors this process may run on."""
    wanted = os.environ.get("ISOMATCH_NUM_THREADS", "")
    if wanted:
        if not wanted.isdigit() or int(wanted) < 1:
            raise SettingError(f"ISOMATCH_NUM_THREADS = {wanted!r} is not a positive number of threads")
        return int(wanted)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def parallel_map(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Apply a function that releases the interpreter lock to every item; the order of results is kept.

    Results do not depend on the number of threads, because items share nothing. Called from within an item, it
    runs in that item's thread.
    """
    todo = list(items)
    workers = min(n_threads(), len(todo))
    if workers <= 1 or getattr(_inside, "item", False):
        return [function(item) for item in todo]

    def apply(item: T) -> R:
        _inside.item = True
        try:
            return function(item)
        finally:
            _inside.item = False

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(apply, todo))


_inside = local()


class _SerialBlas:
    """Re-entrant: the first thread in limits BLAS to one thread, the last one out restores it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._depth = 0
        self._controller: ThreadpoolController | None = None
        self._limiter: Any = None

    @contextmanager
    def __call__(self) -> Iterator[None]:
        with self._lock:
            if self._controller is None:
                self._controller = ThreadpoolController()
            self._depth += 1
            if self._depth == 1:
                self._limiter = self._controller.limit(limits=1, user_api="blas")
        try:
            yield
        finally:
            with self._lock:
                self._depth -= 1
                if self._depth == 0:
                    self._limiter.restore_original_limits()


serial_blas = _SerialBlas()
"""Context in which matrix products use one thread, so that threads can be given to independent items instead.

It makes results independent of the number of threads, and avoids the stalls of nested thread pools.
"""
