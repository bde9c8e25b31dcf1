"""Files are opened with a named error, and replaced only once the new contents are complete."""

from __future__ import annotations

import os
import re
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO, TextIOWrapper
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO, NoReturn

import numpy as np

from isomatch._arrays import IntArray
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


def text_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Read the lines of a UTF-8 text with their numbers from 1, without ``#`` comments, blank lines and outer blanks."""
    with opened(path) as file:
        data = BytesIO(file.read())
    for number, line in enumerate(TextIOWrapper(data, "utf-8-sig", errors="replace"), start=1):
        text = line.partition("#")[0].strip()
        if text:
            yield number, text


def read_integers(path: Path, width: int, refuse: Callable[[int, str], NoReturn]) -> IntArray:
    """Read a text of ``width`` integers on each line, separated by a comma or blanks, (rows, width).

    ``refuse`` raises the error about a line, given its number and text, that holds anything else.
    """
    found = array("q")
    for number, line in text_lines(path):
        words = line.replace(",", " ").split()
        if len(words) != width or not all(map(is_whole_number, words)):
            refuse(number, line)
        found.extend(map(int, words))
    return np.array(found, dtype=np.int64).reshape(-1, width)


def is_whole_number(word: str) -> bool:
    """Whether a word is an integer of at most 18 ASCII digits; `int` also takes 1_0 and other digits."""
    return re.fullmatch(r"[+-]?[0-9]{1,18}", word) is not None


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
