"""Threads: calls that can be abandoned, and independent items in parallel, with results in order."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import copy_context
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Lock, Thread, local
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import OpenBLASController, ThreadpoolController

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import SettingError
from isomatch._core.memory import ROOT, group_limits, slurm

ROWS_PER_BLOCK = 1280  # rows of a matrix product in a thread's block; chosen: 5000 vertices make 4 blocks
POLL_SECONDS = 0.2  # seconds between two looks for Ctrl-C, which does not end a wait on Windows; chosen

T = TypeVar("T")
R = TypeVar("R")


def n_threads() -> int:
    """Return the number of threads to use: ``ISOMATCH_NUM_THREADS``, or `processors` without it."""
    wanted = os.environ.get("ISOMATCH_NUM_THREADS", "")
    if wanted:
        if not re.fullmatch("0*[1-9][0-9]{0,5}", wanted):
            raise SettingError(f"ISOMATCH_NUM_THREADS = {wanted!r} is not a positive number of threads")
        return int(wanted)
    return processors()


def processors(root: Path = ROOT) -> int:
    """Return the number of processors that affinity, control groups and SLURM leave to this process, at least 1."""
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    limits = [words for words in group_limits("cpu.max", root) if words[0].isdecimal()]
    shares = [int(quota) / int(period) for quota, period in limits]
    return math.ceil(min([allowed, slurm("SLURM_CPUS_PER_TASK") or allowed, *shares]))


class Abandoned(BaseException):
    """Ends a thread whose result nobody waits for, and is caught there."""


class Call:
    """A running call, on one thread or several."""

    def __init__(self) -> None:
        self.abandoned = False
        self.messages: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()

    def thread(self, function: Callable[[], Any]) -> Thread:
        """Make a thread that works for this call; it keeps no process alive."""

        def work() -> None:
            _here.call = self
            function()

        return Thread(target=copy_context().run, args=(work,), daemon=True)


_here = local()  # for each thread, the call that it works for


def current_call() -> Call | None:
    """Return the background call that this thread works for, if any."""
    return getattr(_here, "call", None)


def stop_if_abandoned() -> None:
    """End this thread if nobody waits for it; called where a computation can stop."""
    call = current_call()
    if call is not None and call.abandoned:
        raise Abandoned


def in_background(function: Callable[[], R]) -> R:
    """Call a function on another thread and wait for its result, so that Ctrl-C takes effect at once."""
    # If an exception, such as Ctrl-C, ends the wait, the function goes on until its next `stop_if_abandoned`.
    if current_call() is not None:
        return function()
    call, results, errors = Call(), [], []

    def work() -> None:
        try:
            results.append(function())
        except BaseException as error:
            errors.append(error)
        finally:
            call.messages.put(None)

    thread = call.thread(work)
    try:
        thread.start()
        while message := _next(call):
            message()
        thread.join()  # at its end, the thread releases what it holds
    except BaseException:
        call.abandoned = True
        raise
    if errors:
        raise errors.pop()
    return results.pop()


def _next(call: Call) -> Callable[[], Any] | None:
    while True:
        try:
            return call.messages.get(timeout=POLL_SECONDS)
        except Empty:
            continue


def tell(listener: Callable[..., Any], *values: Any) -> None:
    """Call a function of the user on the thread that waits for this call; its errors abandon the call."""
    stop_if_abandoned()
    call = current_call()
    if call is None:
        listener(*values)
    else:
        call.messages.put(partial(listener, *values))


def parallel_rows(function: Callable[[int], None], count: int) -> None:
    """Call a function with each row number below ``count``; each of T threads takes every T-th row."""
    threads = max(1, min(n_threads(), count))

    def rows(first: int) -> None:
        for row in range(first, count, threads):
            function(row)

    parallel_map(rows, range(threads))


def parallel_map(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Apply a function to every item on several threads; return the results in the order of the items."""
    # The function should release the interpreter lock. Items must not share anything that is written, so that
    # results do not depend on the number of threads. A call within another runs in the thread of its item.
    todo = list(items)
    workers = min(n_threads(), len(todo))
    if workers <= 1 or getattr(_inside, "item", False):
        return [_apply(function, item) for item in todo]
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
                results[i] = _apply(function, todo[i])
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


def _apply(function: Callable[[T], R], item: T) -> R:
    stop_if_abandoned()
    return function(item)


_inside = local()  # for each thread, whether it applies a function to an item of `parallel_map`


def row_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Multiply matrices (n, k) @ (k, m) by fixed blocks of rows, in the precision of ``a``."""
    product = np.empty((len(a), b.shape[1]), a.dtype)
    factor = np.ascontiguousarray(b, dtype=a.dtype)

    def block(first: int) -> None:
        rows = slice(first, first + ROWS_PER_BLOCK)
        np.matmul(a[rows], factor, out=product[rows])

    parallel_map(block, range(0, len(a), ROWS_PER_BLOCK))
    return product


class _Limit:
    """The limit that `serial_blas` sets."""

    lock = Lock()
    depth = 0
    controller: ThreadpoolController | None = None
    limiter: Any = None


@contextmanager
def serial_blas() -> Iterator[None]:
    """Let BLAS use one thread in a block: results do not depend on their number, and pools do not stall."""
    # Several threads may be in this block: the first limits BLAS to one thread, the last lifts the limit.
    with _Limit.lock:
        if _Limit.controller is None:
            import scipy.linalg  # noqa: F401 - the controller sees only libraries that are loaded

            _Limit.controller = ThreadpoolController()
        _Limit.depth += 1
        if _Limit.depth == 1:
            with _any_thread_may_limit():
                _Limit.limiter = _Limit.controller.limit(limits=1, user_api="blas")
    try:
        yield
    finally:
        with _Limit.lock:
            _Limit.depth -= 1
            if _Limit.depth == 0:
                with _any_thread_may_limit():
                    _Limit.limiter.restore_original_limits()


@contextmanager
def _any_thread_may_limit() -> Iterator[None]:
    """Let any thread limit OpenBLAS; threadpoolctl 3.8 ignores all but the first."""
    release = getattr(OpenBLASController, "clear_controlling_thread", lambda force: None)
    release(force=True)
    yield
    release(force=True)
