"""The one reader of tables in text files: of spreadsheets, csv, pandas, R, scanners, and by hand."""

from __future__ import annotations

import csv
import logging
import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import dropwhile, zip_longest
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import FormatError
from isomatch._core.files import read_bytes
from isomatch._core.texts import decode_text, unescape

NO_TEXT = {"", "na", "n/a", "#n/a", "<na>", "nan", "."}  # cells, in lower case, for "no value" in a text
# cells, in lower case, that mean "no value" in a column of numbers
NO_NUMBER = NO_TEXT | {"none", "null", "-", "–", "−", "--", "?"}
BLANKS = " "  # the separator that stands for one or more blanks or tabs
_SEPARATORS = ";\t,"  # separators in the order of trial; the comma is last, as it may be a decimal comma
_NO_SEPARATOR = "\x1f"  # the separator of a table with one column; no text contains it
# rows; a column 1, 2, 3, … of more rows than this numbers the rows, a shorter one might hold values; chosen
_MAX_ROWS_COUNTED_BY_CHANCE = 3
_MAX_ROWS_EXAMINED = 1000  # number of first rows from which separator and header are inferred; chosen
# A decimal number. Each text of digits matches in one way only: two ways would take 2ⁿ steps for n digits.
_DECIMAL = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,4})?"
_NUMBER = re.compile(rf"{_DECIMAL}|[+-]?(?:inf|infinity|nan)", re.ASCII | re.IGNORECASE)  # also inf or nan
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d{1,4})?", re.ASCII)  # number with a comma, such as 1,5
# a number with a decimal point, such as 1.5
_WITH_POINT = re.compile(r"[+-]?(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d{1,4})?", re.ASCII)
_WORD = re.compile(r'"((?:[^"]|"")*)"(?!\S)|(\S+)')  # a word in quotes, or up to a blank
_COMMENT = re.compile(r"\s*(?://|[#%](?=\s|$))")  # the start of a comment
_COMMENT_MARK = re.compile(r"\s*(?:#|//)\s*")  # what precedes the text of a comment
_NUMBERS = re.compile(r"[-+0-9.,;\seE]+")  # only characters of numbers and separators
logger = logging.getLogger(__name__)


class Row(NamedTuple):
    """The cells of a line, none if it is empty, with its number from 1 and its text."""

    line: int
    cells: list[str]
    text: str

    def cell(self, column: int) -> str:
        """Return a cell, which is empty beyond the end of the row."""
        return self.cells[column] if column < len(self.cells) else ""


@dataclass(frozen=True)
class Table:
    """Rows of cells, and the names of the columns if a line gives them."""

    name: str  # name of the file, for messages
    rows: list[Row]  # empty lines between others are rows without cells
    separator: str
    has_decimal_commas: bool
    titles: tuple[str, ...] = ()
    titles_line: int = 0  # number of the line with the names of the columns
    comment_titles: tuple[str, ...] = ()  # cells of the comment before the first row
    n_empty_after: int = 0  # number of empty lines at the end

    @property
    def filled(self) -> list[Row]:
        """The rows with at least one cell that is not empty."""
        return [row for row in self.rows if any(row.cells)]

    @property
    def width(self) -> int:
        """The number of columns."""
        return len(self.titles) or max((len(row.cells) for row in self.rows), default=0)

    def refuse(self, row: Row, why: str) -> NoReturn:
        """Raise a `FormatError` that quotes a row."""
        raise FormatError(f"{self.name}:{row.line}: {row.text.strip()[:80]!r} {why}")

    def column(self, *names: str) -> int | None:
        """Return the column with the first of some names, in any case; None if there is none."""
        lower = [title.lower() for title in self.titles]
        return next((lower.index(name) for name in names if name in lower), None)

    def titled(
        self, known: Collection[str] = (), always: bool = False, n_rows: Collection[int] = ()
    ) -> Table:
        """Take the first row as the names of the columns if it looks like a header.

        It does if it has a ``known`` name or differs from the rows below. Rows with one cell more
        begin with the row names of R. ``n_rows`` are the numbers of rows that are possible.
        """
        rows = [*dropwhile(lambda row: not row.cells, self.rows)]
        if not rows:
            return self
        first, *data_rows = rows
        titles = [_COMMENT_MARK.sub("", first.cells[0], count=1), *first.cells[1:]]
        if not (always or self._are_known(titles, known) or self._is_header(first.cells, data_rows, n_rows)):
            has_comment = self._are_known(self.comment_titles, known)
            return replace(self, titles=self.comment_titles if has_comment else ())
        filled = [row for row in data_rows if any(row.cells)]
        if filled and all(map(any, (row.cells[len(titles) :] for row in filled))):
            titles = ["", *titles] if _are_row_names(filled, len(titles)) else titles
        return replace(self, rows=data_rows, titles=(*titles,), titles_line=first.line)

    def _are_known(self, cells: Sequence[str], known: Collection[str]) -> bool:
        return any(cell.lower() in known for cell in cells) and not any(map(self.is_number, cells))

    def _is_header(self, first: list[str], data_rows: list[Row], n_rows: Collection[int]) -> bool:
        filled = [row for row in data_rows if row.cells]
        if any(map(self.is_number, first)):  # pandas writes the titles 0, 1, 2, … for columns without a name
            counts = [*map(str, range(len(first)))]
            n = len(data_rows)
            is_counted = first in (counts, ["", *counts[:-1]])
            return is_counted and bool(filled) and (first[0] == "" or (n in n_rows and n + 1 not in n_rows))
        if all(cell.lower() in NO_NUMBER for cell in first):
            return False
        if first[0] == "" and len(first) > 1:
            return True
        columns = zip_longest(*(row.cells for row in filled[:_MAX_ROWS_EXAMINED]), fillvalue="")
        for column in columns:
            numbers = [self.number(cell) for cell in column]
            if None not in numbers and not np.isnan(np.array(numbers, dtype=float)).all():
                return True
        all_rows = range(len(data_rows), len(data_rows) + self.n_empty_after + 1)
        for lengths in (all_rows, [len(filled)]):
            is_possible = any(n in n_rows for n in lengths)
            if is_possible != any(n + 1 in n_rows for n in lengths):
                return is_possible
        if any(re.match(r"[-+.]?\d", cell) for cell in first):
            return False
        return bool(filled) and not any(row.cells == first for row in filled)

    def without_row_names(self) -> Table:
        """Leave out a first column without a name, which has to count the rows, and log that."""
        if not self.titles or self.titles[0] or len(self.titles) == 1:
            return self
        counts = [self.integer(row.cells[0]) for row in self.filled]
        start = counts[0] if counts else 0
        if start not in (0, 1) or counts != [*range(start, start + len(counts))]:
            raise FormatError(
                f"{self.name}: the first column does not count the rows; leave it out, or sort the rows"
            )
        logger.warning("%s: the first column counts the rows from %d, and is left out", self.name, start)
        rows = [row._replace(cells=row.cells[1:]) for row in self.rows]
        return replace(self, rows=rows, titles=self.titles[1:])

    def records(
        self,
        required: Collection[str] = (),
        optional: Collection[str] = (),
        remedy: str = "name the columns in the first line",
    ) -> list[dict[str, str]]:
        """Return the cells of each row by the names of the columns, which the first row gives.

        The names of required and optional columns may be in any case.
        """
        table, wanted = self.titled(always=True), {*required, *optional}
        titles = [title.lower() if title.lower() in wanted else title for title in table.titles]
        header = ", ".join(table.titles)[:80]
        if lacking := [name for name in required if name not in titles]:
            raise FormatError(f"{self.name}: has no column {', '.join(lacking)!r} but {header!r}; {remedy}")
        if twice := [name for name in wanted if titles.count(name) > 1]:
            raise FormatError(f"{self.name}: has several columns {twice[0]!r}; rename or remove one")
        records = []
        for row in table.filled:
            if any(row.cells[len(titles) :]):
                quotes = "put quotes around a cell with a separator"
                table.refuse(row, f"has more cells than the columns {header!r}; {quotes}")
            record = {title: row.cell(i) for i, title in enumerate(titles)}
            if empty := [name for name in required if not record[name]]:
                table.refuse(row, f"has nothing in the column {empty[0]!r}; write it, or remove the line")
            records.append(record)
        return records

    def require_width(self) -> None:
        """Raise a `FormatError` for the first row with fewer or more cells than there are columns."""
        width = len(self.titles) or next((len(row.cells) for row in self.rows if row.cells), 0)
        for row in self.filled:
            if len(row.cells) < width or any(row.cells[width:]):
                remedy = "correct the line or export it again"
                self.refuse(row, f"has {len(row.cells)} cells and others {width}; {remedy}")

    def require_one_reading(self) -> None:
        """Raise a `FormatError` if a comma or a blank may separate cells or be part of one."""
        rows = self.filled
        if not rows:
            return
        if self.separator == BLANKS and not any('"' in row.text for row in rows):
            columns = zip(*(row.cells for row in rows))
            are_numbers = [all(self.number(cell) is not None for cell in column) for column in columns]
            if not (any(are_numbers) if self.titles else all(are_numbers)):
                self.refuse(rows[0], "is one text with blanks, or several; put quotes around texts")
        # With one title, the cells 1,5 2,7 3,5 may be row numbers and values, as R writes them; without a
        # title, 4,5 4,7 are decimal numbers.
        parts = [re.fullmatch(r"([+-]?\d+),(\d+)", ",".join(row.cells), re.ASCII) for row in rows]
        if self.separator not in (",", _NO_SEPARATOR) or not all(parts):
            return
        counts = [int(part[1]) for part in parts if part]
        is_counted = counts in ([*range(len(counts))], [*range(1, len(counts) + 1)])
        is_long = len(counts) > _MAX_ROWS_COUNTED_BY_CHANCE
        if (len(self.titles) == 1 and is_counted and is_long) or not (self.titles or is_counted):
            remedy = "write decimal points, or name the columns"
            self.refuse(rows[0], f"is one number with a decimal comma, or two; {remedy}")

    def is_number(self, cell: str) -> bool:
        """Whether a cell is a number."""
        return self.plain_number(cell) is not None

    def number(self, cell: str) -> float | None:
        """Return the number in a cell, nan for no value, None for anything else."""
        plain = self.plain_number(cell)
        return float(plain) if plain is not None else np.nan if cell.lower() in NO_NUMBER else None

    def plain_number(self, cell: str) -> str | None:
        """Return the number in a cell as a text with a decimal point and a plain minus sign."""
        text = cell.replace("−", "-")
        if self.has_decimal_commas and _WITH_COMMA.fullmatch(text):
            text = text.replace(",", ".")
        return text if _NUMBER.fullmatch(text) else None

    def integer(self, cell: str) -> int | None:
        """Return the integer in a cell, which may be written as a float, None for anything else."""
        plain = self.plain_number(cell)
        if plain is not None and re.fullmatch(r"[+-]?\d{1,18}", plain):
            return int(plain)
        number = np.nan if plain is None else float(plain)
        return int(number) if abs(number) < 2**53 and number == int(number) else None

    def numbers(self, column: int) -> FloatArray:
        """Return a column of numbers, nan for no value; `FormatError` quotes a row with anything else."""
        # a fast way for plain numbers; other columns are read cell by cell below
        with suppress(ValueError, IndexError):
            cells = [row.cells[column] for row in self.rows]
            if _NUMBERS.fullmatch(" ".join(cells)):
                return np.array([*map(float, cells)])
        values = np.full(len(self.rows), np.nan)
        for k, row in enumerate(self.rows):
            cell = row.cell(column)
            number = self.number(cell)
            if number is None:
                remedy = "write a number, or NA where there is none"
                self.refuse(row, f"has {cell[:40]!r} among numbers; {remedy}")
            values[k] = number
        return values


def read_table(path: Path, not_comments: Collection[str] = ()) -> Table:
    """Read the table of a file, see `parse_table`."""
    return parse_table(decode_text(read_bytes(path)), str(path), not_comments)


def read_integers(path: Path, width: int, wanted: str) -> IntArray:
    """Read (rows, width) integers; `FormatError` quotes any other row and says what is wanted."""
    table = read_table(path).titled()
    if len(table.titles) == width + 1:
        table = table.without_row_names()
    # In a table of one column, the place of a number is its line, so empty lines count.
    rows = table.filled if width > 1 else dropwhile(lambda row: not row.cells, table.rows)
    integers = []
    for row in rows:
        values = [number for cell in row.cells if (number := table.integer(cell)) is not None]
        if not len(values) == len(row.cells) == width:
            table.refuse(row, wanted)
        integers.append(values)
    return np.array(integers, dtype=np.int64).reshape(-1, width)


def parse_table(text: str, name: str, not_comments: Collection[str] = ()) -> Table:
    """Split a text into rows and cells at semicolons, tabs, commas or blanks, with or without quotes.

    The separator is the one that gives rows of one length. Lines of comments are left out, except
    those that begin with one of ``not_comments``. `FormatError` if it is no text, or if commas may
    be decimal commas or stand between numbers.
    """
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise FormatError(
            f"{name}:{line}: has bytes of zero and is no text; export it again as text in UTF-8"
        )
    lines = [*enumerate(re.split(r"\r*\n" if "\n" in text else r"\r", text), start=1)]
    declared = ""
    if lines and lines[0][1][:4].lower() == "sep=":  # A spreadsheet program declares its separator.
        declared, lines = lines[0][1][4:5], lines[1:]
    kept = [(number, _without_comment(line)) for number, line in lines if not _is_comment(line, not_comments)]
    n_lines = len(kept)
    while kept and not kept[-1][1].strip(" "):
        kept.pop()
    n_empty_after = max(n_lines - len(kept) - 1, 0)
    head = (line for _, line in kept[:_MAX_ROWS_EXAMINED] if line.strip())
    # some lines separate numbers by commas and the others by blanks, as if written by hand
    if {*map(_number_separator, head)} == {",", BLANKS}:
        kept = [(number, line.replace(",", " ")) for number, line in kept]
    separator = declared if declared and declared in _SEPARATORS else _find_separator(kept, name)
    rows = _without_comment_rows(split_rows(kept, separator, name), not_comments)
    cells = [cell for row in rows for cell in row.cells if "," in cell or "." in cell]
    has_commas = any(map(_WITH_COMMA.fullmatch, cells)) and not any(map(_WITH_POINT.fullmatch, cells))
    first = next((row.line for row in rows if row.cells), 0)
    before = [line for number, line in lines if number < first and _COMMENT_MARK.match(line)]
    width = next((len(row.cells) for row in rows if row.cells), 0)
    last = [(0, _COMMENT_MARK.sub("", line)) for line in before[-1:]]
    headers = (row for mark in (separator, BLANKS) for row in split_rows(last, mark, name, False))
    titles = next((row.cells for row in headers if len(row.cells) == width), [])
    is_comma = has_commas and separator != ","
    return Table(name, rows, separator, is_comma, (), 0, (*titles,), n_empty_after)


def _is_comment(line: str, not_comments: Collection[str]) -> bool:
    return _COMMENT.match(line) is not None and not line.startswith(tuple(not_comments))


def _number_separator(line: str) -> str:
    """Return the comma or blank that separates the numbers of a line; nothing for any other line."""
    gaps = ((",", r"\s*,\s*"), (BLANKS, r"\s+"))
    fits = (mark for mark, gap in gaps if re.fullmatch(rf"\s*{_DECIMAL}(?:{gap}{_DECIMAL})+\s*", line))
    return next(fits, "")


def _without_comment(line: str) -> str:
    """Remove a comment after numbers from a line."""
    numbers = re.split(r" [#%]", line, maxsplit=1)[0] if "#" in line or "%" in line else line
    return numbers if _NUMBERS.fullmatch(numbers) else line


def _without_comment_rows(rows: list[Row], not_comments: Collection[str]) -> list[Row]:
    """Leave out rows that begin with # if other rows are of numbers or have another length."""
    filled = [row for row in rows if row.cells]
    marked = [row for row in filled if row.cells[0].startswith("#") and row.cells[0] not in not_comments]
    plain = [row for row in filled if not row.cells[0].startswith("#")]
    if not marked or not plain:
        return rows
    width = Counter(len(row.cells) for row in plain).most_common(1)[0][0]
    are_numbers = all(_NUMBER.fullmatch(row.cells[0]) for row in plain[:_MAX_ROWS_EXAMINED])
    comments = {row.line for row in marked if are_numbers or len(row.cells) != width}
    return [row for row in rows if row.line not in comments]


def _are_row_names(rows: list[Row], width: int) -> bool:
    """Whether rows with one cell more than there are titles begin with row names, as R writes them."""
    names = [row.cells[0] for row in rows]
    is_counted = names == [str(i) for i in range(1, len(names) + 1)]
    is_quoted = all(row.text.lstrip().startswith('"') for row in rows)
    is_unique = len({*names}) == len(names)
    return (is_counted or is_quoted) and is_unique and all(len(row.cells) == width + 1 for row in rows)


def split_rows(lines: Iterable[tuple[int, str]], separator: str, name: str, strict: bool = True) -> list[Row]:
    """Split numbered lines into cells."""
    lines = [*lines]
    if separator == BLANKS:
        return [Row(number, _split_words(line), line) for number, line in lines]
    rows, last = list[Row](), 0
    texts = (f"{line}\n" for _, line in lines)
    reader = csv.reader(texts, delimiter=separator, skipinitialspace=True, strict=strict)
    try:
        for row in reader:
            number, text = lines[last]
            last = reader.line_num
            cells = [unescape(cell.strip()) for cell in row]
            rows.append(Row(number, cells if any(cells) or len(cells) > 1 or '"' in text else [], text))
    except csv.Error as error:
        number = lines[min(reader.line_num, len(lines)) - 1][0]
        raise FormatError(
            f"{name}:{number}: not a table ({error}); write cells separated by commas"
        ) from None
    return rows


def _split_words(line: str) -> list[str]:
    words = _WORD.finditer(line)
    return [unescape(word[2] if word[1] is None else word[1].replace('""', '"')) for word in words]


def _find_separator(lines: list[tuple[int, str]], name: str) -> str:
    # An apostrophe before a tab is an escape for spreadsheets; such a tab separates no cells.
    head = [(number, line.replace("'\t", "'")) for number, line in lines if line.strip()]
    head = head[:_MAX_ROWS_EXAMINED]
    marks: tuple[str, ...] = (*_SEPARATORS, BLANKS)
    split = {mark: split_rows(head, mark, name, strict=False) for mark in marks}
    fitting = [mark for mark, rows in split.items() if _have_one_length(rows, mark)]
    words = split[BLANKS]
    if BLANKS in fitting and not {";", "\t"} & {*fitting}:
        unquoted = (word[2] for _, line in head for word in _WORD.finditer(line))
        with_commas = [word for word in unquoted if word and "," in word]
        if all(map(_WITH_COMMA.fullmatch, with_commas)) or "," not in fitting:
            return BLANKS
    if "\t" in fitting and BLANKS in fitting and ";" not in fitting:
        columns = zip(*(row.cells for row in split["\t"]))
        # if a column is empty in all rows, several tabs together are one separator
        if any(not any(column) for column in columns):
            return BLANKS
    if fitting and fitting[0] != ",":
        return fitting[0]
    if fitting:
        return "," if not _may_be_decimals(split[","], name) else _NO_SEPARATOR
    # No separator makes all rows equally long. Of those in the first row, the one is taken that makes most
    # rows equally long.
    several = [mark for mark in _SEPARATORS if head and len(split[mark][0].cells) > 1]
    n_alike = {mark: max(Counter(len(row.cells) for row in split[mark]).values()) for mark in several}
    if not several and words and all(map(_NUMBER.fullmatch, words[0].cells)):
        return BLANKS
    return max(several, key=lambda mark: n_alike[mark], default=_NO_SEPARATOR)


def _have_one_length(rows: list[Row], separator: str) -> bool:
    """Whether all rows have the same number of cells, at least two.

    Empty cells at the ends do not count, and the header may lack the title of the row names of R.
    """
    lengths = [len(row.cells) for row in rows]
    most = Counter(lengths[1:] or lengths).most_common(1)
    width = most[0][0] if most else 0
    is_short = len(rows) > 1 and lengths[0] == width - 1
    if is_short and lengths[0] == 1 and separator in (",", BLANKS):
        is_short = all(row.text.lstrip().startswith('"') for row in rows[1:])
    full = rows[1:] if is_short else rows
    return width > 1 and all(len(row.cells) >= width and not any(row.cells[width:]) for row in full)


def _may_be_decimals(rows: list[Row], name: str) -> bool:
    """Whether commas between whole numbers are decimal commas of one column; `FormatError` for several."""
    first = rows[0].cells
    if '"' in rows[0].text or not all(re.fullmatch(r"[+-]?\d+", cell, re.ASCII) for cell in first):
        return False
    has_signs = any(re.fullmatch(r"-0+", cell) for row in rows for cell in row.cells[::2])
    has_zeros = any(re.fullmatch(r"0\d+", cell, re.ASCII) for row in rows for cell in row.cells[1::2])
    if not (has_signs or has_zeros):
        return False
    if len(first) == 2:
        return True
    raise FormatError(
        f"{name}:{rows[0].line}: {rows[0].text[:80]!r} has commas between numbers and perhaps in them; "
        "separate the cells by semicolons"
    )
