"""Files are opened with a named error, and replaced only once the new contents are complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO

from isomatch.errors import FormatError, MissingFileError


def opened(path: Path) -> BinaryIO:
    """Open a file to read its bytes.

    Raises
    ------
    MissingFileError
        If there is none.
    FormatError
        If it cannot be opened, such as a folder, a pipe, a device or a file of another user.
    """
    try:
        if not S_ISREG(path.stat().st_mode):  # a pipe could block, a device never end
            raise FormatError(
                f"{path}: cannot be opened (not a regular file); write its contents to a file first"
            )
        return path.open("rb")
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; check the name and the folder") from None
    except OSError as error:
        raise FormatError(f"{path}: cannot be opened ({error.strerror}); give a readable file") from None


@contextmanager
def replaced(path: Path) -> Iterator[BinaryIO]:
    """Open a new file beside an earlier one, which it replaces when the block ends without an error."""
    final = path.resolve()  # a link keeps pointing at the file it names
    unfinished = final.with_name(f".{final.name}.{os.getpid()}.unfinished")
    try:
        with unfinished.open("wb") as file:
            yield file
        unfinished.replace(final)
    finally:
        unfinished.unlink(missing_ok=True)
