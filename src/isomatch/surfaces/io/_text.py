"""Lines of a text file with their line numbers, and the numbers that they contain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from isomatch._arrays import AnyArray, FloatArray, IntArray
from isomatch.errors import FormatError

EXPORT_AGAIN = "correct the line or export the file again"


@dataclass(frozen=True)
class TextLines:
    """Some lines of a file, without comments and blank lines.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    rows : list of str
        The text of the lines.
    numbers : list of int
        The 1-based number of each line in the file.
    before : int
        Number of the line before the first of these lines.
    """

    name: str
    rows: list[str]
    numbers: list[int]
    before: int = 0

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, part: slice) -> TextLines:
        before = self.numbers[part.start - 1] if part.start and self.numbers else self.before
        return TextLines(self.name, self.rows[part], self.numbers[part], before)

    def fail(self, row: int, expected: str, remedy: str = EXPORT_AGAIN) -> NoReturn:
        """Raise a `FormatError` that quotes one row; a row past the end means that the file is too short."""
        if 0 <= row < len(self):
            found = self.rows[row].strip()
            found = repr(found if len(found) <= 40 else found[:40] + "…")
            raise FormatError(
                f"{self.name}:{self.numbers[row]}: expected {expected}, found {found}; {remedy}"
            )
        last = self.numbers[-1] if self.numbers else max(self.before, 1)
        raise FormatError(
            f"{self.name}:{last}: expected {expected}, found the end of the file; "
            "it is cut short, copy or export it again"
        )

    def starting_with(self, keyword: str) -> TextLines:
        """Return the lines whose first word is the keyword, without this word."""
        heads = (keyword + " ", keyword + "\t")
        kept = [i for i, row in enumerate(self.rows) if row.startswith(heads) or row == keyword]
        skip = len(keyword)
        return TextLines(
            self.name, [self.rows[i][skip:].strip() for i in kept], [self.numbers[i] for i in kept]
        )

    def parse(self) -> NumberRows:
        """Parse every row as blank-separated numbers."""
        if not self.rows:
            return NumberRows(self, np.zeros(0), np.zeros(0, dtype=np.int64))
        if not all(self.rows):  # loadtxt would skip the empty ones
            return self._parse_row_by_row()
        try:
            table = np.loadtxt(self.rows, dtype=np.float64, comments=None, ndmin=2)
        except ValueError:  # rows of different lengths, or not numbers
            return self._parse_row_by_row()
        return NumberRows(self, table.ravel(), np.full(len(self), table.shape[1], dtype=np.int64))

    def _parse_row_by_row(self) -> NumberRows:
        values: list[float] = []
        counts = np.zeros(len(self), dtype=np.int64)
        for i, row in enumerate(self.rows):
            words = row.split()
            counts[i] = len(words)
            try:
                values.extend(map(float, words))
            except ValueError:
                self.fail(i, "numbers")
        return NumberRows(self, np.array(values, dtype=np.float64), counts)


@dataclass(frozen=True)
class NumberRows:
    """The numbers on some lines, concatenated, and the number of them on each line."""

    lines: TextLines
    values: FloatArray
    counts: IntArray

    @property
    def starts(self) -> IntArray:
        """(rows,) position of the first value of each row."""
        starts: IntArray = np.cumsum(self.counts) - self.counts
        return starts

    def leading(self, width: int, expected: str) -> FloatArray:
        """Return the first ``width`` numbers of each row, (rows, width); a shorter row raises `FormatError`."""
        self.require(self.counts >= width, expected)
        table: FloatArray = self.values[self.starts[:, None] + np.arange(width)]
        return table

    def require(self, good: AnyArray, expected: str) -> None:
        """Raise a `FormatError` for the first row that is not good."""
        if not good.all():
            self.lines.fail(int(np.argmin(good)), expected)

    def whole(self, positions: IntArray, expected: str) -> IntArray:
        """Return the values at some positions as integers; another value raises a `FormatError` for its row."""
        values = self.values[positions]
        good = np.isfinite(values)
        good[good] = (values[good] == np.rint(values[good])) & (np.abs(values[good]) < 2**53)
        if not good.all():
            row = np.searchsorted(self.starts, positions[np.argmin(good)], side="right") - 1
            self.lines.fail(int(row), expected)
        return values.astype(np.int64)


def read_lines(name: str, data: bytes, before: int = 0) -> TextLines:
    """Split the bytes of a file into lines, without ``#`` comments and blank lines.

    ``before`` is the number of lines that precede these bytes in the file. Bytes that are not ASCII are accepted,
    because comments may have any encoding, and so is every kind of line end.
    """
    text = data.removeprefix(b"\xef\xbb\xbf").decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    rows = text.split("\n")
    if "#" in text:
        rows = [row.partition("#")[0] for row in rows]
    kept = [i for i, row in enumerate(rows) if row and not row.isspace()]
    return TextLines(name, [rows[i] for i in kept], [before + i + 1 for i in kept], before)


def format_rows(template: str, table: AnyArray) -> bytes:
    """Write each row of a table with a ``%`` template; a float written with ``%r`` is read back unchanged."""
    return (template * len(table) % tuple(table.ravel().tolist())).encode("ascii")
