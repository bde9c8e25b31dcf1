"""Texts of unknown origin: encoding, lines, order of names; writing of tables and JSON."""

from __future__ import annotations

import csv
import json
import math
import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

from isomatch._core.errors import FormatError
from isomatch._core.files import open_file, read_bytes, write_text

BYTE_ORDER_MARKS = {  # encodings of texts by the bytes with which such texts begin
    b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16",
}  # fmt: skip
_EXAMINED_BYTES = 1000  # bytes at the start of a text without a mark that show whether it is UTF-16; chosen
# the start of a cell that a spreadsheet program would take for a formula, escaped by apostrophes or not
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def text_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Read the lines of a text with their numbers from 1, without outer blanks and # comments."""
    for number, line in enumerate(StringIO(read_text(path), newline=None), start=1):
        text = re.split(r"(?:^|(?<=\s))#", line, maxsplit=1)[0].strip()
        if text:
            yield number, text


def read_text(path: Path) -> str:
    """Read a text file, see `decode_text`."""
    return decode_text(read_bytes(path))


def read_toml(path: Path, max_bytes: int) -> dict[str, Any]:
    """Read a TOML file of settings; `FormatError` if it is larger than ``max_bytes``, or not TOML."""
    with open_file(path) as file:
        text = file.read(max_bytes + 1)
    if len(text) > max_bytes:
        problem = f"more than {max_bytes} bytes are not settings"
        raise FormatError(f"{path}: {problem}; give a TOML file of settings")
    try:
        return tomllib.loads(decode_text(text))
    # the text is no TOML, is nested too deeply, or has numbers with too many digits
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: not a TOML file ({error}); correct it or write it again") from None


def decode_text(text: bytes) -> str:
    """Decode a text by `encoding_of`, without a byte order mark."""
    marked = text.startswith((*BYTE_ORDER_MARKS,))
    return text.decode((not marked and wide_encoding(text)) or encoding_of(text), errors="replace")


def wide_encoding(text: bytes) -> str | None:
    """Find UTF-16 without a byte order mark: every second byte of European letters is 0."""
    head = text[:_EXAMINED_BYTES]
    for i, encoding in enumerate(("utf-16-be", "utf-16-le")):
        high, low = head[i::2], head[1 - i :: 2]
        if 2 * high.count(0) > len(high) and not low.count(0):
            return encoding
    return None


def encoding_of(text: bytes) -> str:
    """Find an encoding that reads a text and writes it back unchanged: UTF-8, UTF-16, cp1252, latin-1."""
    for mark, encoding in BYTE_ORDER_MARKS.items():
        if text.startswith(mark):
            return encoding
    # Encodings in the order of trial. Texts with one of the five bytes that cp1252 lacks are read as latin-1.
    for encoding in ("utf-8", "cp1252"):
        with suppress(UnicodeDecodeError):
            text.decode(encoding)
            return encoding
    return "latin-1"


def natural_order(name: str) -> list[tuple[str, int]]:
    """Return a sort key by which frame2 comes before frame10, in any case."""
    parts = re.split(r"([0-9]+)", name.casefold())
    numbers = [*map(int, parts[1::2]), -1]
    return [*zip(parts[::2], numbers), (name, -1)]  # if names differ only in case, the name itself decides


def is_whole_number(word: str) -> bool:
    """Whether a word is an integer of at most 18 ASCII digits; `int` also takes 1_0 and other digits."""
    return re.fullmatch(r"[+-]?[0-9]{1,18}", word) is not None


def table_text(rows: Iterable[Iterable[object]], separator: str = ",", line_end: str = "\n") -> str:
    """Write rows as text, with an apostrophe before cells that a spreadsheet would run as a formula."""
    text = StringIO(newline="")
    writer = csv.writer(text, delimiter=separator, lineterminator=line_end)
    writer.writerows([_escape(cell) for cell in row] for row in rows)
    return text.getvalue()


def _escape(cell: object) -> object:
    if not (isinstance(cell, str) and _FORMULA.match(cell)):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def unescape(cell: str) -> str:
    """Remove the apostrophe that `table_text` writes."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def write_csv(path: Path, rows: Iterable[Mapping[str, object]], columns: Collection[str]) -> None:
    """Write some columns of a table with a header, see `replaced`."""
    cells = ([row.get(column, "") for column in columns] for row in rows)
    write_text(path, table_text([columns, *cells], line_end="\r\n"))


def json_text(value: Any, *, ascii_only: bool = False) -> str:
    """Format plain values as JSON, with null for numbers that are not finite."""
    return json.dumps(without_nonfinite(value), indent=2, ensure_ascii=ascii_only, allow_nan=False) + "\n"


def without_nonfinite(value: Any) -> Any:
    """Replace numbers that are not finite by None in plain values."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: without_nonfinite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nonfinite(item) for item in value]
    return value
