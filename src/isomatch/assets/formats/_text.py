"""Lines of a text file with their line numbers, and the numbers that they contain."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from isomatch.assets.formats._scan import POWERS, count_plain_lines, field_of_words, normalise, parse, select
from isomatch.assets.polygons import spans
from isomatch.errors import FormatError
from isomatch.values.arrays import AnyArray, BoolArray, FloatArray, IntArray, read_only
from isomatch.values.cached import cached_property

EXPORT_AGAIN = "correct the line or export the file again"

LONGEST_HEAD = 2**16
"""Bytes at the start of a file that may have comments without all of it being searched for them."""

_WORD = re.compile(rb"[^ \n]*")
_COPIED = np.array([32 if chr(c).isspace() and c not in b"\r\n" else c for c in range(256)], np.uint8)
"""What is copied of each byte: a space of every kind of blank but a line end."""
_LOWER = _COPIED[list(bytes(range(256)).lower())]


@dataclass(frozen=True)
class TextLines:
    """Some lines of a file, without comments, blank lines and leading blanks.

    They are one array of bytes, because an object for each line would take many times the memory of the file.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    data : (bytes,) array of uint8
        Read-only. The lines, each closed by a newline; the only other blanks are spaces.
    numbers : (rows,) array of int
        The 1-based number of each line in the file.
    before : int
        Number of the line before the first of these lines.
    """

    name: str
    data: AnyArray
    numbers: IntArray
    before: int = 0

    def __len__(self) -> int:
        return len(self.numbers)

    @cached_property
    def ends(self) -> IntArray:
        """(rows,) position of the newline of each line."""
        return np.flatnonzero(self.data == ord("\n"))

    def row(self, i: int) -> str:
        """Return the text of one line."""
        return self.data[self._start(i) : self.ends[i]].tobytes().decode("latin-1")

    def _start(self, i: int) -> int:
        return int(self.ends[i - 1]) + 1 if i else 0

    def __getitem__(self, part: slice) -> TextLines:
        first, stop, _ = part.indices(len(self))
        before = int(self.numbers[first - 1]) if first and len(self) else self.before
        data = self.data[self._start(first) : self.ends[stop - 1] + 1] if first < stop else self.data[:0]
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

    def starting_with(self, keyword: str, textured: bool = False) -> TextLines:
        """Return the lines whose first word is the keyword, without this word.

        If they are ``textured``, only the first number of ``v/vt/vn`` is kept; a word in another form is left as it is.
        """
        chosen, numbers = np.zeros(len(self.data), dtype=np.uint8), np.zeros(len(self), dtype=np.int64)
        sizes = select(self.data, octets_of(keyword.encode()), textured, self.numbers, chosen, numbers)
        return TextLines(self.name, *_cut(chosen, numbers, sizes))

    def fields(self, which: int) -> TextLines:
        """Return the same lines with one field of each ``v/vt/vn`` instead of the word, and 0 where it is missing."""
        data = np.zeros(2 * len(self.data) + 1, dtype=np.uint8)
        size = field_of_words(self.data, which, data)
        data.resize(size, refcheck=False)
        return TextLines(self.name, read_only(data), self.numbers)

    def parse(self) -> NumberRows:
        """Parse every row as blank-separated numbers."""
        at = np.zeros(3, dtype=np.int64)
        values, counts = np.zeros(len(self.data) // 2), np.zeros(len(self), dtype=np.int64)
        while not parse(self.data, POWERS, at, values, counts):
            start, count, row = at.tolist()
            found = _WORD.match(self.data.data, start)
            word = found[0] if found else b""
            try:
                if b"_" in word:  # which Python allows in a number, other readers do not
                    raise ValueError
                values[count] = float(word.decode("latin-1"))
            except ValueError:
                self.fail(row, "numbers")
            counts[row] += 1
            at[:] = start + len(word), count + 1, row
        values.resize(counts.sum(), refcheck=False)
        return NumberRows(self, values, counts)


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


def read_lines(
    name: str, data: bytes, before: int = 0, continued: bool = False, lower: bool = False
) -> TextLines:
    r"""Split the bytes of a file into lines, without ``#`` comments and blank lines.

    Bytes that are not ASCII are accepted, because comments may have any encoding, and so is every kind of line end.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    data : bytes
        Its asset, or the rest of them.
    before : int
        Number of lines that precede these bytes in the file.
    continued : bool
        Whether a line that ends in ``\`` goes on in the next.
    lower : bool
        Whether capital letters become small.

    Notes
    -----
    Linear in the number of bytes, in time and memory, whatever they are. Comments are removed after lines are joined.
    """
    octets = octets_of(data.removeprefix(b"\xef\xbb\xbf"))
    head = data.find(b"\n", data.rfind(b"#", 0, LONGEST_HEAD)) + 1 if data[:1] == b"#" else 0
    if b"\\" in data[:head] or b"\r" in data[:head]:
        head = 0
    n_lines = -1 if lower else count_plain_lines(octets[head:])
    if n_lines >= 0 and head:
        first = read_lines(name, data[:head], before, continued)
        n_head = data.count(b"\n", 0, head)
        rest = read_lines(name, data[head:], before + n_head, continued)
        joined = np.concatenate([first.data, rest.data]), np.concatenate([first.numbers, rest.numbers])
        return TextLines(name, read_only(joined[0]), joined[1], before)
    if n_lines >= 0:
        return TextLines(name, octets, np.arange(before + 1, before + n_lines + 1), before)
    lines = np.zeros(len(octets) + 2, dtype=np.uint8)
    numbers = np.zeros(len(lines) // 2, dtype=np.int64)  # a line that is kept has a byte and a newline
    sizes = normalise(octets, _LOWER if lower else _COPIED, continued, lines, numbers, before + 1)
    return TextLines(name, *_cut(lines, numbers, sizes), before)


def format_rows(template: str, table: AnyArray) -> bytes:
    """Write each row of a table with a ``%`` template; a float written with ``%r`` is read back unchanged."""
    return (template * len(table) % tuple(table.ravel().tolist())).encode("ascii")


def numbered(values: AnyArray, template: str = "%d") -> AnyArray:
    """Write each number as a word, an array of objects."""
    return np.array((f"{template} " * len(values) % tuple(values.tolist())).split(), dtype=object)


def interleaved_lines(parts: list[tuple[IntArray, AnyArray]], n_rows: int) -> bytes:
    """Write lines of words: of each part as many for each line as its counts say."""
    once = np.ones(n_rows, dtype=np.int64)
    words = interleaved([*parts, (once, np.full(n_rows, "\n", dtype=object))], n_rows, object)
    return " ".join(words).replace("\n ", "\n").replace(" \n", "\n").encode()


def interleaved(parts: list[tuple[IntArray, AnyArray]], n_rows: int, kind: type) -> AnyArray:
    """Join columns row by row: of each part as many entries for each row as its counts say."""
    lengths = sum((counts for counts, _ in parts), np.zeros(n_rows, dtype=np.int64))
    joined: AnyArray = np.zeros(int(lengths.sum()), kind)
    start = np.cumsum(lengths) - lengths
    for counts, entries in parts:
        joined[spans(start, counts)] = entries
        start = start + counts
    return joined


def octets_of(data: bytes) -> AnyArray:
    """View bytes as an array that cannot be written to."""
    return np.frombuffer(data, np.uint8)


def _cut(lines: AnyArray, numbers: IntArray, sizes: tuple[int, int]) -> tuple[AnyArray, IntArray]:
    """Free what was not needed of new arrays."""
    lines.resize(sizes[0], refcheck=False)
    numbers.resize(sizes[1], refcheck=False)
    return read_only(lines), numbers
