"""Texts of unknown origin: their encoding and lines; names in their order; tables and JSON as they are written."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

from isomatch._core.files import contents, write_text

# encodings by the bytes that a text begins with
MARKS = {
    b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16",
}  # fmt: skip
_HEAD = 1000  # bytes by which an encoding without a mark is found
_FORMULA = re.compile(r"'*[=+\-@\t\r]")  # how a formula of a spreadsheet begins, also when it is escaped


def text_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Read the lines of a text with their numbers from 1, without outer blanks and what follows a # before a word."""
    for number, line in enumerate(StringIO(read_text(path), newline=None), start=1):
        text = re.split(r"(?:^|(?<=\s))#", line, maxsplit=1)[0].strip()
        if text:
            yield number, text


def read_text(path: Path) -> str:
    """Read a text file, see `decoded`."""
    return decoded(contents(path))


def decoded(text: bytes) -> str:
    """Read a text in the encoding that is found by `encoding_of`, without the mark that it may begin with."""
    for i, encoding in enumerate(("utf-16-be", "utf-16-le")):  # of letters of Europe every second byte is 0
        if text.startswith((*MARKS,)):
            break
        if 2 * text[i:_HEAD:2].count(0) > len(text[i:_HEAD:2]) and not text[1 - i : _HEAD : 2].count(0):
            return text.decode(encoding, errors="replace")
    return text.decode(encoding_of(text), errors="replace")


def encoding_of(text: bytes) -> str:
    """Return an encoding in which a text can be read, and written again as it was: UTF-8 or UTF-16 if it is that."""
    for mark, encoding in MARKS.items():
        if text.startswith(mark):
            return encoding
    for encoding in ("utf-8", "cp1252"):  # the second, of Windows, has no letter for five of the bytes
        with suppress(UnicodeDecodeError):
            text.decode(encoding)
            return encoding
    return "latin-1"


def natural_order(name: str) -> list[tuple[str, int]]:
    """Return a key by which names sort as people count: frame2 before frame10, whatever the case."""
    parts = re.split(r"([0-9]+)", name.casefold())
    numbers = [*map(int, parts[1::2]), -1]
    return [*zip(parts[::2], numbers), (name, -1)]  # names that differ in case alone keep one order


def is_whole_number(word: str) -> bool:
    """Whether a word is an integer of at most 18 ASCII digits; `int` also takes 1_0 and other digits."""
    return re.fullmatch(r"[+-]?[0-9]{1,18}", word) is not None


def joined(rows: Iterable[Iterable[object]], separator: str = ",", line_end: str = "\n") -> str:
    """Write rows as a text; an apostrophe stands before texts that a spreadsheet would run as a formula."""
    text = StringIO(newline="")
    writer = csv.writer(text, delimiter=separator, lineterminator=line_end)
    writer.writerows([_escaped(cell) for cell in row] for row in rows)
    return text.getvalue()


def _escaped(cell: object) -> object:
    if not (isinstance(cell, str) and _FORMULA.match(cell)):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def unescaped(cell: str) -> str:
    """Return a text without the apostrophe that `joined` puts before it."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def write_csv(path: Path, rows: Iterable[Mapping[str, object]], columns: Collection[str]) -> None:
    """Write a table with a line of names, see `replaced`; values of other columns are left out."""
    cells = ([row.get(column, "") for column in columns] for row in rows)
    write_text(path, joined([columns, *cells], line_end="\r\n"))


def json_text(value: Any, *, ascii_only: bool = False) -> str:
    """Format plain values as JSON. Numbers that are not finite become null, because JSON does not have them."""
    return json.dumps(finite(value), indent=2, ensure_ascii=ascii_only, allow_nan=False) + "\n"


def finite(value: Any) -> Any:
    """Return plain values with None for numbers that are not finite."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value
