"""The number of threads, and how they are used: independent items run in parallel, results keep their order."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from threading import Lock, local
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import OpenBLASController, ThreadpoolController

from isomatch.errors import SettingError
from isomatch.runtime.interruption import current_call, in_background, stop_if_abandoned
from isomatch.runtime.limits import processors
from isomatch.values.arrays import FloatArray

ROWS = 1280  # of a block of a product: the 5000 vertices that are matched by default make four

T = TypeVar("T")
R = TypeVar("R")


def n_threads() -> int:
    """Return the number of threads to use.

    This is ``ISOMATCH_NUM_THREADS`` if it is set, and otherwise the number of processors that this process may use,
    see `isomatch.runtime.limits`.
    """
    wanted = os.environ.get("ISOMATCH_NUM_THREADS", "")
    if wanted:
        if not re.fullmatch("0*[1-9][0-9]{0,5}", wanted):
            raise SettingError(f"ISOMATCH_NUM_THREADS = {wanted!r} is not a positive number of threads")
        return int(wanted)
    return processors()


def parallel_rows(function: Callable[[int], None], count: int) -> None:
    """Call a function with each row number below ``count``; of T threads, thread t takes rows t, t + T, t + 2 T, ….

    For many short calls, each of which writes to arrays of its own row.
    """
    threads = max(1, min(n_threads(), count))

    def rows(first: int) -> None:
        for row in range(first, count, threads):
            function(row)

    parallel_map(rows, range(threads))


def parallel_map(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Apply a function to every item, on several threads, and return the results in the order of the items.

    The function should release the interpreter lock. Items must not share anything that is written, so that the
    results do not depend on the number of threads. A call from within an item runs in the thread of that item. An
    error of an item is that of the first one that fails. An interruption goes through at once.
    """
    todo = list(items)
    workers = min(n_threads(), len(todo))
    if workers <= 1 or getattr(_inside, "item", False):
        return [_applied(function, item) for item in todo]
    call = current_call()
    if call is None:
        return in_background(lambda: parallel_map(function, todo))
    results: dict[int, R] = {}
    errors: dict[int, BaseException] = {}
    numbers, taking = iter(range(len(todo))), Lock()

    def work() -> None:
        _inside.item = True
        while not errors:
            with taking:
                i = next(numbers, None)
            if i is None:
                return
            try:
                results[i] = _applied(function, todo[i])
            except BaseException as error:
                errors[i] = error

    threads = [call.thread(work) for _ in range(workers)]
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    except BaseException:
        call.abandoned = True
        raise
    if errors:
        raise errors[min(errors)]
    return [results[i] for i in range(len(todo))]


def _applied(function: Callable[[T], R], item: T) -> R:
    stop_if_abandoned()
    return function(item)


_inside = local()


def row_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Matrix product (n, k) (k, m) by blocks of rows, on several threads; in single precision if ``a`` is.

    The blocks are fixed, so that the result does not depend on the number of threads.
    """
    product = np.empty((len(a), b.shape[1]), a.dtype)
    factor = np.ascontiguousarray(b, dtype=a.dtype)

    def block(first: int) -> None:
        rows = slice(first, first + ROWS)
        np.matmul(a[rows], factor, out=product[rows])

    parallel_map(block, range(0, len(a), ROWS))
    return product


class _SerialBlas:
    """A context that several threads may be in at once: the first one limits BLAS, the last one lifts the limit."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._depth = 0
        self._controller: ThreadpoolController | None = None
        self._limiter: Any = None

    @contextmanager
    def __call__(self) -> Iterator[None]:
        with self._lock:
            if self._controller is None:
                import scipy.linalg  # noqa: F401 - the controller sees only libraries that are loaded

                self._controller = ThreadpoolController()
            self._depth += 1
            if self._depth == 1:
                with _any_thread_may_limit():
                    self._limiter = self._controller.limit(limits=1, user_api="blas")
        try:
            yield
        finally:
            with self._lock:
                self._depth -= 1
                if self._depth == 0:
                    with _any_thread_may_limit():
                        self._limiter.restore_original_limits()


@contextmanager
def _any_thread_may_limit() -> Iterator[None]:
    """Limit OpenBLAS also where another thread did: threadpoolctl 3.8 lets the first one only, and ignores others."""
    release = getattr(OpenBLASController, "clear_controlling_thread", lambda force: None)
    release(force=True)
    yield
    release(force=True)


serial_blas = _SerialBlas()
"""Context in which matrix products use one thread, so that `parallel_map` can use all of them for its items.

The results then do not depend on the number of threads, and nested thread pools do not stall one another.
"""
