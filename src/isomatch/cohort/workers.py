"""The workers that do the steps of a study, and the listener that hears of them."""

from __future__ import annotations

import logging
import math
import os
import platform
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import takewhile
from typing import Any, Generic, Literal, NamedTuple, TypeAlias, TypeVar

from isomatch._core.errors import InputError, UnwritableFileError
from isomatch._core.files import is_of_one_file, legible
from isomatch._core.first_use import package
from isomatch._core.processes import begin_worker, worker_processes
from isomatch._core.skipped import tell_skipped
from isomatch._core.stage_timer import Progress, with_two_arguments
from isomatch._core.threads import n_threads

TASKS_PER_WORKER = 2  # unfinished tasks sent for each worker; chosen: no worker waits for its next one
COUNT_INTERVAL = 2.0  # seconds between two counts of the workers of a cluster; chosen
S = TypeVar("S")
T = TypeVar("T")
# message if all tasks of an executor are cancelled
WORKERS_LOST = "the workers gave up their tasks, as when a cluster's scheduler ends; run again to continue"
Warn: TypeAlias = Callable[[str], Any]
"""Called with a sentence about shapes or maps to look at; by default it is logged."""
logger = logging.getLogger("isomatch.cohort")


@dataclass(frozen=True)
class Task:
    """A function to be called for some items of a collection."""

    items: tuple[Any, ...]
    function: Callable[[Any], Any]
    lost: int = 0  # times that a worker died while this task was running


class Attempt(NamedTuple, Generic[T]):
    """The result of a job for an item, or its error, when it ended, and its seconds."""

    result: T | None
    error: str
    time: float
    seconds: float | None = None

    @property
    def state(self) -> Literal["done", "failed"]:
        """How it ended."""
        return "failed" if self.error else "done"


def try_job(work: Callable[[S], T], item: S) -> Attempt[T]:
    """Do a job for an item; a failure is an attempt with its reason, unless the disk is full."""
    start = time.perf_counter()
    try:
        return Attempt(work(item), "", time.time(), time.perf_counter() - start)
    except Exception as error:  # any error becomes a row with its reason, so that no item ends a run
        if isinstance(error, UnwritableFileError) and not is_of_one_file(error):
            raise
        reason = legible(f"{type(error).__name__}: {error}")  # it might name illegible files
        return Attempt(None, reason, time.time(), time.perf_counter() - start)


class Workers(ExitStack):
    """Workers that tasks are sent to, for a block.

    ``open`` makes an executor, also after one has broken; ``count`` tells the number of workers,
    which may change; each that is another process uses ``threads``.
    """

    def __init__(
        self, open: Callable[[], AbstractContextManager[Executor]], count: Callable[[], int], threads: int = 1
    ) -> None:
        super().__init__()
        self._open, self.count, self._threads = open, count, threads
        self._executor: Executor | None = None
        self.end = math.inf  # time, in seconds since the epoch, after which nothing new is begun

    def is_late(self) -> bool:
        """Whether nothing new is to be begun."""
        return time.time() > self.end

    def completed(self, tasks: Iterable[Task]) -> Iterator[tuple[Any, Attempt[Any]]]:
        """Yield each item with its attempt, in the order of completion; begin none once it is late.

        A task whose worker dies is done again item by item. An item during which a worker dies
        again is done when nothing else is running; if the worker dies then, the item has failed.
        """
        waiting, suspects = deque(tasks), deque[Task]()
        while (waiting or suspects) and not self.is_late():
            if self._executor is None:
                self._executor = self.enter_context(self._open())
            for task, outcome in self._until_broken(self._executor, waiting, suspects):
                if not isinstance(outcome, Exception):
                    yield from zip(task.items, outcome)
                    continue
                for item in task.items:
                    if task.lost == 2:
                        death = "three workers died of it, killed or out of memory"
                        error = f"{death} ({type(outcome).__name__}: {outcome})"
                        yield item, Attempt(None, error, time.time())
                    else:
                        part = replace(task, items=(item,), lost=task.lost + 1)
                        (suspects if task.lost else waiting).append(part)

    def _renew(self) -> None:
        self.close()
        self._executor = self.enter_context(self._open())
        try:
            self._executor.submit(_here).result()
        except BrokenExecutor as error:
            remedy = "in a script, begin under if __name__ == '__main__'; of an executor that has broken, give a new one"
            raise InputError(f"workers end as soon as they begin ({error}); {remedy}") from None

    def _until_broken(
        self, executor: Executor, waiting: deque[Task], suspects: deque[Task]
    ) -> Iterator[tuple[Task, Any]]:
        """Yield tasks with attempts or an error, until all are done or the executor broke."""
        running = dict[Future[Any], Task]()
        broken = False
        while True:
            room = TASKS_PER_WORKER * self.count()
            while not broken and not self.is_late():
                queue = waiting if waiting and len(running) < room else suspects if not running else None
                if not queue:
                    break
                try:
                    work = partial(_attempts, queue[0], self._threads, _here(), self.end)
                    running[executor.submit(work)] = queue[0]
                except BrokenExecutor:  # a worker died while it ran no task, so no task is to blame
                    broken = True
                else:
                    queue.popleft()
            if not running:
                if broken:
                    self._renew()
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                try:  # a failed item gives an attempt, so an error here is the death of a worker
                    error = future.exception()
                except CancelledError:
                    raise InputError(WORKERS_LOST) from None
                if isinstance(error, UnwritableFileError):
                    raise error from None
                broken = broken or isinstance(error, BrokenExecutor)
                yield running.pop(future), error or future.result()


def _attempts(task: Task, threads: int, sender: tuple[str, int], end: float) -> list[Attempt[Any]]:
    if _here() != sender:
        begin_worker(threads)
    in_time = takewhile(lambda item: time.time() <= end, task.items)
    return [try_job(task.function, item) for item in in_time]


def _here() -> tuple[str, int]:
    return platform.node(), os.getpid()


@contextmanager
def workers_of(
    executor: str | Executor | Workers = "local", jobs: int | None = None, time_limit: float | None = None
) -> Iterator[Workers]:
    """Open the workers of a block, see `Collection.run`; given workers stay open after it."""
    opened = nullcontext(executor) if isinstance(executor, Workers) else _open_workers(executor, jobs)
    with opened as workers:
        before, limit = workers.end, math.inf if time_limit is None else time.time() + time_limit
        workers.end = min(before, limit)
        try:
            yield workers
        finally:
            workers.end = before


@contextmanager
def _open_workers(executor: str | Executor, jobs: int | None) -> Iterator[Workers]:
    if jobs is not None and jobs < 1:
        raise InputError(f"{jobs} jobs cannot run at once; give a number from 1")
    count = jobs or n_threads()
    if not isinstance(executor, str):
        opened = nullcontext(executor)
        yield Workers(lambda: opened, lambda: count)
        return
    kind, _, address = executor.partition(":")
    if kind == "local" and not address:
        threads = max(1, n_threads() // count)
        with Workers(partial(worker_processes, count), lambda: count, threads) as workers:
            yield workers
    elif kind == "dask" and address:
        with _dask_client(address) as client:
            at_once = (lambda: jobs) if jobs else _n_threads_of(client)
            with Workers(partial(_dask_executor, client), at_once) as workers:
                yield workers
    else:
        known = "'local' or 'dask:ADDRESS', such as dask:tcp://host:8786"
        raise InputError(f"executor {executor!r} is not known; give {known}")


def _dask_client(address: str) -> Any:
    distributed = package("distributed", "cluster", "a Dask cluster")
    try:
        return distributed.Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{address}: no Dask scheduler answers ({error}); check the address") from error


def _n_threads_of(client: Any) -> Callable[[], int]:
    """Return a function that counts the threads of a cluster, whose workers come and go."""

    @lru_cache(maxsize=1)
    def count(_: float) -> int:
        try:
            return sum(client.nthreads().values()) or 1  # 1 until the first worker of the cluster has come
        except OSError:
            raise InputError(WORKERS_LOST) from None

    return lambda: count(time.monotonic() // COUNT_INTERVAL)


@contextmanager
def _dask_executor(client: Any) -> Iterator[Executor]:
    executor = client.get_executor(pure=False)
    try:
        yield executor
    finally:
        executor.shutdown(wait=False)


@dataclass(frozen=True)
class Listener:
    """The functions that a long step calls with a step and the share done, and with warnings."""

    tell: Callable[[str, float], Any]
    warn: Warn

    @classmethod
    def of(cls, progress: Progress | None, warn: Warn | None) -> Listener:
        """Take the functions of a user; without ``warn``, warnings are logged."""
        tell = with_two_arguments(progress) if progress else lambda step, share: None
        return cls(tell, lambda message: tell_skipped(message, warn or logger.warning))

    def part(self, first: float, last: float) -> Listener:
        """Return the listener of a part of the work, from one share of the whole to another."""
        return replace(self, tell=lambda step, share: self.tell(step, first + (last - first) * share))
