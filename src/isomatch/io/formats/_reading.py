"""Named errors for readers of other packages, limits of memory, and temporary files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from isomatch._core.errors import FormatError, IsomatchError, MemoryBudgetError
from isomatch._core.files import read_bytes, writing
from isomatch._core.memory import room_for


@contextmanager
def reading(name: str, what: str) -> Iterator[None]:
    """Name the file in any error of the block; readers of other packages raise all kinds."""
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except IsomatchError as error:
        if type(error) is FormatError and not str(error).startswith(name):
            raise FormatError(f"{name}: {error}") from None
        raise
    except MemoryError:
        needed = "reading needs more memory than there is"
        raise MemoryBudgetError(f"{name}: {needed}; close other programs") from None
    except Exception as error:
        lines = str(error).splitlines()
        raise damaged(name, what, ": ".join([type(error).__name__, *lines[:1]])) from None


def damaged(name: str, what: str, reason: str) -> FormatError:
    """Make the error for damaged contents of a file."""
    return unexpected(name, what, f"damaged contents ({reason})", "copy or export it again")


def unexpected(place: str, expected: str, content: str, remedy: str) -> FormatError:
    """Make the error for unexpected content at a place in a file."""
    return FormatError(f"{place}: expected {expected}, found {content}; {remedy}")


@dataclass
class Room:
    """The memory that the contents of a file may take, counted before it is allocated."""

    size: int
    """Bytes of the file."""
    taken: int = 0  # bytes of memory that the contents have taken so far

    def take(self, n_bytes: int, what: str) -> None:
        """Raise `FormatError` if less memory is left."""
        self.taken += n_bytes
        if n_bytes < 0 or self.taken > room_for(self.size):
            raise FormatError(
                f"{what} claims or repeats more than the {self.size} bytes of the file tell; export it again"
            )


@contextmanager
def on_disk(data: bytes, suffix: str) -> Iterator[Path]:
    """Keep bytes in a file while the block runs, for readers that need one."""
    with TemporaryDirectory(prefix="isomatch-") as folder:
        path = Path(folder) / f"file{suffix}"
        with writing(path):
            path.write_bytes(data)
        yield path


def content_beside(
    name: str, folder: Path, read: Callable[[Path], bytes | None] = read_bytes
) -> bytes | None:
    """Read a file in the folder or below it, as no other may be copied; None if there is none."""
    plain = name.replace("\\", "/")
    # If the name is a path on its author's machine, a file with the last part of the name is sought here.
    for candidate in (plain, PurePosixPath(plain).name):
        with suppress(FormatError, OSError, ValueError):  # the name may be too long, or have a zero byte
            path = (folder / candidate).resolve()
            if candidate and path.is_relative_to(folder.resolve()) and path.is_file():
                return read(path)
    return None
