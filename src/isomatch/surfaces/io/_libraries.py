"""Formats that other packages read: the package, its errors, and files for those that read nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from isomatch.errors import FormatError, IsomatchError, MissingDependencyError


def package(module: str, extra: str, what: str) -> Any:
    """Import a module of an optional package.

    Raises
    ------
    MissingDependencyError
        If the package is not installed; the message names the extra.
    """
    try:
        return import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        raise MissingDependencyError(
            f"{what} needs the package {name}; pip install 'isomatch[{extra}]'"
        ) from None


@contextmanager
def reading(name: str, what: str) -> Iterator[None]:
    """Name the file in whatever error its contents raise: a reader of another package has no list of them."""
    try:
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
        path.write_bytes(data)
        yield path
