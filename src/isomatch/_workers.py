"""Worker processes: few threads each, and an end when the process that started them ends."""

from __future__ import annotations

import os
from functools import cache
from multiprocessing import parent_process
from threading import Thread

from threadpoolctl import ThreadpoolController


@cache
def begin_worker(threads: int) -> None:
    """Make this process a worker, once: so many threads in our loops, one in linear algebra."""
    os.environ["ISOMATCH_NUM_THREADS"] = str(threads)
    ThreadpoolController().limit(limits=1)
    if parent_process() is not None:
        Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process with the one that started it, which cannot see to it if it is killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
