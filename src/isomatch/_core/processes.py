"""Worker processes, with few threads, which end with the process that started them."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread, current_thread, main_thread
from typing import Any

from threadpoolctl import ThreadpoolController

from isomatch._core.files import changing


@contextmanager
def worker_processes(
    count: int, initializer: Callable[..., Any] | None = None, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes, which are killed if an exception ends the block."""
    context = _Spawning()
    with ProcessPoolExecutor(count, context, initializer, arguments) as pool:
        try:
            yield pool
        except BaseException:  # not only errors: Ctrl-C, too
            pool.shutdown(wait=False, cancel_futures=True)
            context.kill()
            raise
        if any(process.exitcode for process in context.started):
            context.kill()  # or a pool that breaks while a worker starts would wait for ever


class _Worker(SpawnProcess):
    """A process whose start a signal does not interrupt, so that it is known and killed."""

    def start(self) -> None:
        with changing:
            super().start()


class _Spawning(SpawnContext):
    """Starts processes and records them."""

    def __init__(self) -> None:
        self.started: list[SpawnProcess] = []

    def kill(self) -> None:
        """Kill the processes that still run."""
        for process in self.started:
            if process.is_alive():
                process.kill()

    def Process(self, *arguments: Any, **options: Any) -> SpawnProcess:  # type: ignore[override]
        self.started.append(_Worker(*arguments, **options))
        return self.started[-1]


@cache
def begin_worker(threads: int) -> None:
    """Make this process a worker, once, with some threads for loops and one for linear algebra."""
    if parent_process() is not None:
        Thread(target=_end_with_parent, daemon=True).start()
        if current_thread() is main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches workers too, but the parent decides
    os.environ["ISOMATCH_NUM_THREADS"] = str(threads)
    ThreadpoolController().limit(limits=1)


def _end_with_parent() -> None:
    """End this process when its parent ends, even if the parent is killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
