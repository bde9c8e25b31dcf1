"""Lines of a text file with their line numbers, and the numbers that they contain."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO, TextIOWrapper
from typing import NoReturn

import numpy as np

from isomatch._arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch.errors import FormatError

EXPORT_AGAIN = "correct the line or export the file again"

_BLANKS = bytes(10 if c == 13 else 32 if c != 10 and chr(c).isspace() else c for c in range(256))
"""Table that turns every kind of blank into a space, and the end of line of old Macintosh files into a newline."""

_LINE_END = re.compile(rb"(?<!\\)\n")
BLOCK = 2**16
"""Bytes that are split into lines at a time."""
LONG_ROW = 100
"""Numbers on a line from which they are parsed one by one, because `numpy.loadtxt` needs much memory for a line."""


@dataclass(frozen=True)
class TextLines:
    """Some lines of a file, without comments, blank lines and leading blanks.

    They are one string of bytes, because an object for each line would take many times the memory of the file.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    data : bytes
        The lines, each closed by a newline; the only other blanks are spaces.
    numbers : (rows,) array of int
        The 1-based number of each line in the file.
    before : int
        Number of the line before the first of these lines.
    """

    name: str
    data: bytes
    numbers: IntArray
    before: int = 0

    def __len__(self) -> int:
        return len(self.numbers)

    @cached_property
    def ends(self) -> IntArray:
        """(rows,) position of the newline of each line."""
        return np.flatnonzero(_octets(self.data) == ord("\n"))

    @property
    def starts(self) -> IntArray:
        """(rows,) position of the first byte of each line."""
        return _after(self.ends)

    def row(self, i: int) -> str:
        """Return the text of one line."""
        return self.data[self._start(i) : self.ends[i]].decode("latin-1")

    def _start(self, i: int) -> int:
        return int(self.ends[i - 1]) + 1 if i else 0

    def __getitem__(self, part: slice) -> TextLines:
        first, stop, _ = part.indices(len(self))
        before = int(self.numbers[first - 1]) if first and len(self) else self.before
        data = self.data[self._start(first) : self.ends[stop - 1] + 1] if first < stop else b""
        return TextLines(self.name, data, self.numbers[part], before)

    def fail(self, row: int, expected: str, remedy: str = EXPORT_AGAIN) -> NoReturn:
        """Raise a `FormatError` that quotes one row; a row past the end means that the file is too short."""
        if 0 <= row < len(self):
            found = self.row(row).strip()
            found = repr(found if len(found) <= 40 else found[:40] + "…")
            raise FormatError(
                f"{self.name}:{self.numbers[row]}: expected {expected}, found {found}; {remedy}"
            )
        last = self.numbers[-1] if len(self) else max(self.before, 1)
        raise FormatError(
            f"{self.name}:{last}: expected {expected}, found the end of the file; "
            "it is cut short, copy or export it again"
        )

    def starting_with(self, keyword: str) -> TextLines:
        """Return the lines whose first word is the keyword, without this word."""
        octets, after = _octets(self.data), self.starts
        rows = np.arange(len(self))
        for letter in keyword.encode():
            rows = rows[octets[after[rows]] == letter]
            after += 1
        rows = rows[_is_blank(octets[after[rows]])]
        data = octets[_inside(len(octets), after[rows], self.ends[rows] + 1)].tobytes()
        return TextLines(self.name, data, self.numbers[rows])

    def parse(self) -> NumberRows:
        """Parse every row as blank-separated numbers."""
        counts = self._word_counts()
        if not counts.any():
            return NumberRows(self, np.zeros(0), counts)
        regular = counts[0] < LONG_ROW and (counts == counts[0]).all()
        data = self.data if regular else self.data.replace(b" ", b"\n")
        try:
            values = np.loadtxt(TextIOWrapper(BytesIO(data), "latin-1", newline="\n"), comments=None)
        except ValueError:
            self._refuse_first_word()
        return NumberRows(self, values.ravel(), counts)

    def _word_counts(self) -> IntArray:
        words = _word_starts(_octets(self.data))
        return np.diff(np.searchsorted(words, self.starts), append=len(words))

    def _refuse_first_word(self) -> NoReturn:
        """Raise a `FormatError` for the first row with a word that is not a number."""
        for i in range(len(self)):
            row = self.row(i)
            try:
                if "_" in row:  # which Python allows in a number, other readers do not
                    raise ValueError
                for word in row.split():
                    float(word)
            except ValueError:
                self.fail(i, "numbers")
        self.fail(0, "numbers")


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
        if len(self.counts) and (self.counts == self.counts[0]).all():
            return self.values.reshape(len(self.counts), -1)[:, :width]
        table: FloatArray = self.values[self.starts[:, None] + np.arange(width)]
        return table

    def require(self, good: AnyArray, expected: str) -> None:
        """Raise a `FormatError` for the first row that is not good."""
        if not good.all():
            self.lines.fail(int(np.argmin(good)), expected)

    def whole(self, positions: IntArray | None, expected: str) -> IntArray:
        """Return the values at some positions, by default all, as integers.

        Another value raises a `FormatError` for its row.
        """
        values = self.values if positions is None else self.values[positions]
        good = is_whole(values)
        if not good.all():
            bad = np.argmin(good) if positions is None else positions[np.argmin(good)]
            self.lines.fail(int(np.searchsorted(self.starts, bad, side="right")) - 1, expected)
        return values.astype(np.int64)


def is_whole(values: AnyArray) -> BoolArray:
    """Which values are integers that a float holds exactly."""
    whole: BoolArray = (np.abs(values) < 2**53) & (values == np.rint(values))  # false for inf and nan
    return whole


def is_count(word: str) -> bool:
    """Whether a word is a number of lines or rows that fits 64 bits."""
    return word.isdecimal() and len(word) < 19


def read_lines(name: str, data: bytes, before: int = 0, continued: bool = False) -> TextLines:
    r"""Split the bytes of a file into lines, without ``#`` comments and blank lines.

    Bytes that are not ASCII are accepted, because comments may have any encoding, and so is every kind of line end.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    data : bytes
        Its contents, or the rest of them.
    before : int
        Number of lines that precede these bytes in the file.
    continued : bool
        Whether a line that ends in ``\`` goes on in the next.

    Notes
    -----
    Linear in the number of bytes, in time and memory, whatever they are. Comments are removed after lines are joined.
    """
    text = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").translate(_BLANKS)
    text += b"\n\n"  # so that the last line is closed, and not continued
    parts, numbers = [b""], [np.zeros(0, dtype=np.int64)]
    first = before + 1
    for block in blocks(text, _LINE_END if continued else b"\n"):
        part, kept, n_lines = _without_blanks(block, continued)
        parts.append(part)
        numbers.append(first + kept)
        first += n_lines
    return TextLines(name, b"".join(parts), np.concatenate(numbers), before)


def blocks(text: bytes, end: bytes | re.Pattern[bytes]) -> Iterator[bytes]:
    """Cut a text after an ``end`` every 64 KiB or more, so that what is made of each byte takes little memory."""
    closing = re.compile(re.escape(end)) if isinstance(end, bytes) else end
    start = 0
    while start < len(text):
        found = closing.search(text, start + BLOCK)
        stop = found.end() if found else len(text)
        yield text[start:stop]
        start = stop


def _without_blanks(block: bytes, continued: bool) -> tuple[bytes, IntArray, int]:
    """Remove comments, blank lines and leading blanks; return the rest, the number of each line and how many there were.

    Lines are counted from 0.
    """
    ends = np.flatnonzero(_octets(block) == ord("\n"))
    n_lines = len(ends)
    numbers = np.arange(n_lines)
    if continued and b"\\\n" in block:
        goes_on = _octets(block)[ends - 1] == ord("\\")
        numbers = np.flatnonzero(np.concatenate([[True], ~goes_on[:-1]]))
        block = block.replace(b"\\\n", b"  ")
    if b"#" in block:
        block = re.sub(rb"#[^\n]*", b"", block)
    octets = _octets(block)
    ends = np.flatnonzero(octets == ord("\n"))
    words = np.append(_word_starts(octets), len(octets))
    begins = words[np.searchsorted(words, _after(ends))]  # of a blank line, beyond its end
    full = begins < ends
    lines = octets[_inside(len(octets), begins[full], ends[full] + 1)].tobytes()
    return lines, numbers[full], n_lines


def format_rows(template: str, table: AnyArray) -> bytes:
    """Write each row of a table with a ``%`` template; a float written with ``%r`` is read back unchanged."""
    return (template * len(table) % tuple(table.ravel().tolist())).encode("ascii")


def _octets(data: bytes) -> AnyArray:
    return np.frombuffer(data, np.uint8)


def _after(ends: IntArray) -> IntArray:
    """Position of the first byte of each line, given those of the newlines."""
    return np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends


def _word_starts(octets: AnyArray) -> IntArray:
    """Positions at which words begin."""
    blank = _is_blank(octets)
    return np.flatnonzero(np.concatenate([~blank[:1], blank[:-1] & ~blank[1:]]))


def _is_blank(octets: AnyArray) -> BoolArray:
    blank: BoolArray = (octets == ord(" ")) | (octets == ord("\n"))
    return blank


def _inside(n: int, begins: IntArray, stops: IntArray) -> BoolArray:
    """Which of n positions lie in one of some disjoint ranges."""
    edges = np.zeros(n + 1, dtype=np.int8)
    edges[begins] = 1
    edges[stops] -= 1
    inside: BoolArray = np.cumsum(edges[:-1], dtype=np.int8).view(np.bool_)
    return inside
