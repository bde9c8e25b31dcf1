"""Locks of the operating system on files, which are released when the process that holds one ends, however it ends."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from isomatch.runtime.interruption import stop_if_abandoned

try:
    from fcntl import LOCK_EX, LOCK_NB, flock

    def _lock(file: BinaryIO) -> None:
        flock(file, LOCK_EX | LOCK_NB)
except ImportError:  # Windows
    from msvcrt import LK_NBLCK, locking  # type: ignore[attr-defined]

    def _lock(file: BinaryIO) -> None:
        locking(file.fileno(), LK_NBLCK, 1)


_HELD = (
    errno.EACCES,
    errno.EAGAIN,
    errno.EDEADLK,
)  # what the systems say of a lock that another process holds
POLL = 0.02  # seconds between two attempts: little beside what is worth a lock


def locked(path: Path, unable: Callable[[OSError], None]) -> BinaryIO | None:
    """Create and lock a file that no other process holds and that has not been removed meanwhile; None if one does.

    Where the file system knows no locks, ``unable`` is told why, and the file is returned without one.
    """
    while True:
        file = path.open("ab")
        try:
            _lock(file)
        except OSError as error:
            if error.errno in _HELD:
                file.close()
                return None
            unable(error)
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        file.close()


def unlocked(file: BinaryIO, path: Path) -> None:
    """Remove a file that `locked` returned, and let others have it."""
    try:
        path.unlink(missing_ok=True)  # before the lock is released, so that it is ours
    except PermissionError:  # Windows does not remove open files
        file.close()
        with suppress(PermissionError):
            path.unlink(missing_ok=True)
    file.close()


class Turn:
    """The turn to do what several processes would all do: one has it, others may wait for it.

    It is a matter of economy alone. Where no file can be locked, every process has its turn at once.
    """

    def __init__(self, path: Path):
        self.path = path
        self._file: BinaryIO | None = None

    def take(self, patience: float = 0.0) -> bool:
        """Wait at most so many seconds, and tell whether no other process has the turn."""
        self.end()
        until = time.monotonic() + patience
        while True:
            try:
                self._file = locked(self.path, lambda error: None)
            except OSError:
                return True
            if self._file or time.monotonic() >= until:
                return self._file is not None
            stop_if_abandoned()
            time.sleep(POLL)

    def end(self) -> None:
        """Let the next one have it."""
        file, self._file = self._file, None
        if file:
            with suppress(OSError):
                unlocked(file, self.path)
