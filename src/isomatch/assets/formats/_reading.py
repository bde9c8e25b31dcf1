"""Errors of files whose readers do not name them, and files for readers of other packages."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from isomatch.errors import FormatError, IsomatchError
from isomatch.storage.files import writing

_MOST_TIMES = 20  # the size of a file, which SECURITY.md promises
_ANY_SIZE = 2**26  # bytes, which are no harm


@contextmanager
def reading(name: str, what: str) -> Iterator[None]:
    """Name the file in whatever error its contents raise: a reader of another package has no list of them."""
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except IsomatchError:
        raise
    except Exception as error:
        lines = str(error).splitlines()
        raise damaged(
            name, what, f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
        ) from None


def damaged(name: str, what: str, reason: str) -> FormatError:
    """Make the error of a file whose contents do not fit together."""
    return FormatError(f"{name}: expected {what}, found damaged contents ({reason}); copy or export it again")


def room_for(size: int) -> int:
    """Return how many bytes of memory a file of a size may claim beside itself."""
    return _MOST_TIMES * size + _ANY_SIZE


@contextmanager
def on_disk(data: bytes, suffix: str) -> Iterator[Path]:
    """Keep bytes in a file while the block runs, for readers that take nothing else."""
    with TemporaryDirectory(prefix="isomatch-") as folder:
        path = Path(folder) / f"file{suffix}"
        with writing(path):
            path.write_bytes(data)
        yield path
