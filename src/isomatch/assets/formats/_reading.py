"""Errors of files whose readers do not name them, and files for readers of other packages."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from isomatch.errors import FormatError, IsomatchError
from isomatch.storage.files import writing


@contextmanager
def reading(name: str, what: str) -> Iterator[None]:
    """Name the file in whatever error its contents raise: a reader of another package has no list of them."""
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except (IsomatchError, MemoryError):
        raise
    except Exception as error:
        lines = str(error).splitlines()
        reason = f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
        raise FormatError(
            f"{name}: expected {what}, found damaged contents ({reason}); copy or export it again"
        ) from None


@contextmanager
def on_disk(data: bytes, suffix: str) -> Iterator[Path]:
    """Keep bytes in a file while the block runs, for readers that take nothing else."""
    with TemporaryDirectory(prefix="isomatch-") as folder:
        path = Path(folder) / f"file{suffix}"
        with writing(path):
            path.write_bytes(data)
        yield path
