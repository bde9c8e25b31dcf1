"""Lines of a text file with their line numbers, and the numbers in them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.texts import BYTE_ORDER_MARKS, decode_text, wide_encoding
from isomatch.io.asset import Frame
from isomatch.io.formats._reading import unexpected
from isomatch.io.polygons import spans

EXPORT_AGAIN = "correct the line or export the file again"  # the remedy in messages

SPACE, NEWLINE, BACKSLASH, SLASH, COMMA, POINT = b" \n\\/,."  # ASCII codes of these characters
_EXAMINED_BYTES = 2**16  # bytes at the start of a file in which comments are searched for axes; chosen
_BLANKS_TO_SPACES = bytes.maketrans(b"\t\v\f", b"   ")  # turns tabs and form feeds into spaces
_WORD = re.compile(rb"[^ \n]+")  # matches what is between blanks or ends of lines
# They match the bytes that are split into words at once: up to 16,384, chosen to save memory, and on to the
# end of the word, or of the line.
_PIECE = re.compile(rb"(?s).{1,16384}[^ \n]*")
_PIECE_OF_LINES = re.compile(rb"(?s).{1,16384}[^\n]*\n?")


@dataclass(frozen=True)
class TextLines:
    """Some lines of a file, without comments, blank lines and leading blanks."""

    name: str
    data: AnyArray  # bytes of the lines; each line ends with a newline, and tabs are spaces
    numbers: IntArray  # (rows,) the number of each line in the file, from 1
    before: int = 0  # number of lines of the file before the first line here

    def __len__(self) -> int:
        return len(self.numbers)

    @cached_property
    def ends(self) -> IntArray:
        """(rows,) position of the newline of each line."""
        return np.flatnonzero(self.data == NEWLINE)

    def row(self, i: int) -> str:
        """Return the text of one line."""
        return self[i : i + 1].data[:-1].tobytes().decode("latin-1")

    def __getitem__(self, part: slice) -> TextLines:
        first, stop, _ = part.indices(len(self))
        before = int(self.numbers[first - 1]) if first and len(self) else self.before
        start = self.ends[first - 1] + 1 if first else 0
        data = self.data[start : self.ends[stop - 1] + 1] if first < stop else self.data[:0]
        return TextLines(self.name, data, self.numbers[part], before)

    @property
    def texts(self) -> list[bytes]:
        """Each line as bytes, without outer blanks."""
        return [text.strip() for text in self.data.tobytes().split(b"\n")[: len(self)]]

    def fail(self, row: int, expected: str, remedy: str = EXPORT_AGAIN) -> NoReturn:
        """Raise a `FormatError` that quotes a row; past the end, it says that the file is too short."""
        if 0 <= row < len(self):
            number, text = self.numbers[row], self.row(row).strip()
            quoted = repr(text if len(text) <= 40 else text[:40] + "…")
        else:
            number = self.numbers[-1] if len(self) else max(self.before, 1)
            quoted, remedy = "the end of the file", "it is cut short, copy or export it again"
        raise unexpected(f"{self.name}:{number}", expected, quoted, remedy)

    def starting_with(self, keyword: str) -> TextLines:
        """Select the lines that begin with a keyword, without this word."""
        lengths = np.diff(self.ends, prepend=-1)
        starts = self.ends + 1 - lengths
        chosen = _is_blank(self.data.take(starts + len(keyword), mode="clip"))
        for i, octet in enumerate(keyword.encode()):
            chosen &= self.data.take(starts + i, mode="clip") == octet
        kept = np.repeat(chosen, lengths)
        for i in range(len(keyword)):
            kept[starts[chosen] + i] = False
        return TextLines(self.name, self.data[kept], self.numbers[chosen])

    def fields(self, which: int) -> TextLines:
        """Replace each word ``v/vt/vn`` by one of its fields, 0 if that is missing."""
        if which == 0 and not (self.data == SLASH).any():
            return self
        field = re.compile(rb"(?:[^ \n/]*/){%d}([^ \n/]*)[^ \n]*" % which)
        padded = (re.sub(rb"(?<=[^ \n])(?=[ \n]|\Z)", b"/0/0", piece) for piece in _pieces(self.data))
        data = b"".join(field.sub(rb"\1", re.sub(rb"/(?=/)", b"/0", piece)) for piece in padded)
        return TextLines(self.name, np.frombuffer(data, np.uint8), self.numbers)

    def parse(self) -> NumberRows:
        """Parse the rows as numbers between blanks, with decimal commas if no number has a point."""
        blank = _is_blank(self.data)
        word_ends = np.flatnonzero(blank[1:] > blank[:-1])
        counts = np.diff(np.searchsorted(word_ends, self.ends), prepend=0)
        values = np.zeros(len(word_ends))
        n_read = first = 0
        for piece in _pieces(self.data):
            n_read += len(piece)
            stop = int(np.searchsorted(word_ends, n_read))
            numbers = _plain_numbers(piece, stop - first)
            if numbers is None:
                rows = np.searchsorted(np.cumsum(counts), np.arange(first, stop), side="right").tolist()
                numbers = np.array([self._number(*pair) for pair in zip(_WORD.findall(piece), rows)])
            values[first:stop] = numbers
            first = stop
        return NumberRows(self, values, counts)

    def _number(self, word: bytes, row: int) -> float:
        text = word.replace(b",", b".", 1) if self._has_decimal_commas else word
        if b"_" not in word:  # Python allows underscores in numbers, other readers do not
            with suppress(ValueError):
                return float(text.decode("latin-1"))
        self.fail(row, "numbers")

    @cached_property
    def _has_decimal_commas(self) -> bool:
        return bool((self.data == COMMA).any() and not (self.data == POINT).any())


@dataclass(frozen=True)
class NumberRows:
    """The numbers on some lines, concatenated, and their count on each line."""

    lines: TextLines
    values: FloatArray
    counts: IntArray

    @property
    def starts(self) -> IntArray:
        """(rows,) position of the first value of each row."""
        return np.cumsum(self.counts) - self.counts

    def leading(self, width: int, expected: str) -> FloatArray:
        """Return the first numbers of each row, (rows, width); a shorter row raises `FormatError`."""
        self.require(self.counts >= width, expected)
        if len(self.counts) and (self.counts == self.counts[0]).all():
            return self.values.reshape(len(self.counts), -1)[:, :width]
        return np.asarray(self.values[self.starts[:, None] + np.arange(width)])

    def columns(self, first: int | IntArray, width: int) -> FloatArray:
        """Return numbers of each row from a column on, (rows, width), with nan beyond its end."""
        table = np.full((len(self.counts), max(width, 0)), np.nan)
        for i in range(width):
            has_number = self.counts > first + i
            table[has_number, i] = self.values[(self.starts + first + i)[has_number]]
        return table

    def require(self, good: AnyArray, expected: str) -> None:
        """Raise a `FormatError` for the first row that is not good."""
        if not good.all():
            self.lines.fail(int(np.argmin(good)), expected)

    def whole(self, positions: IntArray | None, expected: str) -> IntArray:
        """Return the values at some positions, by default all, as integers; `FormatError` for others."""
        values = self.values if positions is None else self.values[positions]
        good = is_whole(values)
        if not good.all():
            bad = np.argmin(good) if positions is None else positions[np.argmin(good)]
            self.lines.fail(int(np.searchsorted(self.starts, bad, side="right")) - 1, expected)
        return values.astype(np.int64)


def is_whole(values: AnyArray) -> BoolArray:
    """Test which values are integers that a float holds exactly."""
    return np.asarray((np.abs(values) < 2**53) & (values == np.rint(values)))  # False for inf and nan


def are_bytes(values: AnyArray) -> bool:
    """Whether numbers can be bytes of colours: integers from 0 to 255, some of them above 1."""
    return bool(
        (values == np.rint(values)).all() and values.min(initial=0) >= 0 and 1 < values.max(initial=0) <= 255
    )


def bytes_or_floats(colours: FloatArray) -> AnyArray:
    """Convert colours to bytes if they are integers and some are above 1; nan is no colour."""
    colours, largest = colours.copy(), np.fmax.reduce(colours[:, :3], axis=None, initial=0)
    full = 255.0 if largest > 1 else 1.0
    if colours.shape[1] == 4:
        if np.fmax.reduce(colours[:, 3], initial=0) <= 1:
            colours[:, 3] *= full
        colours[np.isnan(colours[:, 3]) & ~np.isnan(colours[:, 0]), 3] = full
    if full > 1 and is_whole(colours).all() and (colours >= 0).all() and (colours <= 255).all():
        return colours.astype(np.uint8)
    return colours


def is_count(word: str) -> bool:
    """Whether a word is a count that fits 64 bits."""
    return word.isdecimal() and len(word) < 19


def read_lines(
    name: str, data: bytes, before: int = 0, continued: bool = False, named: tuple[str, ...] = ()
) -> TextLines:
    """Split the bytes of a file, after ``before`` lines, into lines, without ``#`` comments and blank lines."""
    # A comment begins at the start of a line or after a blank. With ``continued``, a backslash at the end of
    # a line continues it in the next one. After a keyword in ``named``, the rest of the line is a name, in
    # which # is a letter.
    if data.startswith(tuple(BYTE_ORDER_MARKS)) or wide_encoding(data):
        data = decode_text(data).encode()
    text = data.translate(_BLANKS_TO_SPACES).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not text.endswith(b"\n"):
        text += b"\n"
    if continued and text.endswith(b"\\\n"):  # the last line goes on, but there is no next one
        text += b"\n"
    numbers = np.arange(before + 1, before + 1 + text.count(b"\n"))
    if continued and b"\\\n" in text:
        octets = np.frombuffer(text, np.uint8)
        goes_on = octets[np.flatnonzero(octets == NEWLINE) - 1] == BACKSLASH
        numbers = numbers[~np.append(False, goes_on[:-1])]
        text = text.replace(b"\\\n", b"  ")
    if b"#" in text or b"\n " in text or text[:1] == b" ":
        pattern, kept = rb"^ *#[^\n]*|^ +|(?<= )#[^\n]*", b""
        if named:
            pattern, kept = rb"^ *((?:%s) [^\n]*)|%s" % ("|".join(named).encode(), pattern), rb"\1"
        left_out = re.compile(b"(?m)" + pattern)
        text = b"".join(left_out.sub(kept, piece[0]) for piece in _PIECE_OF_LINES.finditer(text))
    octets = np.frombuffer(text, np.uint8)
    if b"\n\n" in text or text[:1] == b"\n":
        ends = octets == NEWLINE
        blank = np.append(True, ends[:-1])
        octets, numbers = octets[~(ends & blank)], numbers[~blank[ends]]
    return TextLines(name, octets, numbers, before)


def frame_in_comments(data: bytes) -> Frame | None:
    """Make the frame of comments at the beginning of a text, if they define one."""
    lines = decode_text(data[:_EXAMINED_BYTES]).splitlines() if b"#" in data[:_EXAMINED_BYTES] else []
    return Frame.of_lines(*(line.lstrip("# \t") for line in lines if line.lstrip().startswith("#")))


def frame_comments(frame: Frame | None) -> str:
    """Write the lines of a frame as comments."""
    return "".join(f"# {line}\n" for line in (frame.lines if frame else ()))


def format_rows(template: str, table: AnyArray) -> bytes:
    """Write the rows of a table with a ``%`` template; floats written with ``%r`` are read back unchanged."""
    return (template * len(table) % tuple(table.ravel().tolist())).encode("ascii")


def words_of_numbers(values: AnyArray, template: str = "%d") -> AnyArray:
    """Format each number as a word, in an array of objects."""
    return np.array((f"{template} " * len(values) % tuple(values.tolist())).split(), dtype=object)


def interleave_lines(parts: list[tuple[IntArray, AnyArray]], n_rows: int, encoding: str = "utf-8") -> bytes:
    """Write lines of words; each part gives a number of words to each line."""
    once = np.ones(n_rows, dtype=np.int64)
    words = interleave([*parts, (once, np.full(n_rows, "\n", dtype=object))], n_rows, object)
    return " ".join(words).replace("\n ", "\n").replace(" \n", "\n").encode(encoding, "backslashreplace")


def interleave(parts: list[tuple[IntArray, AnyArray]], n_rows: int, kind: type) -> AnyArray:
    """Join parts row by row; each part gives a number of entries to each row."""
    lengths = sum((counts for counts, _ in parts), np.zeros(n_rows, dtype=np.int64))
    joined: AnyArray = np.zeros(int(lengths.sum()), kind)
    start = np.cumsum(lengths) - lengths
    for counts, entries in parts:
        joined[spans(start, counts)] = entries
        start = start + counts
    return joined


def _is_blank(octets: AnyArray) -> BoolArray:
    return np.asarray((octets == SPACE) | (octets == NEWLINE))


def _pieces(octets: AnyArray) -> Iterator[bytes]:
    """Cut bytes into pieces between words."""
    return (piece[0] for piece in _PIECE.finditer(octets.data))


def _plain_numbers(text: bytes, n_words: int) -> FloatArray | None:
    """Parse words with numpy; None if one of them is no number."""
    if b"(" in text:  # numpy reads nan(1) as a number
        return None
    # Integers are much faster to read, but have no −0.
    for kind in (np.float64,) if b"." in text or b"-0" in text else (np.int64, np.float64):
        # A word is added at the end, to see whether numpy read all words: old versions only warn of bad ones.
        with suppress(ValueError), warnings.catch_warnings(action="ignore"):
            numbers = np.fromstring(text + b" 0", kind, sep=" ")[:-1]
            if len(numbers) == n_words and (kind is np.float64 or (np.abs(numbers) < 2**53).all()):
                return numbers.astype(np.float64)
    return None
