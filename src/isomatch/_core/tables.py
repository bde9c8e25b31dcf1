"""The one reader of tables in texts of any origin: of spreadsheets, csv, pandas, R, scanners, and by hand."""

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
from isomatch._core.files import contents
from isomatch._core.texts import decoded, unescaped

NO_TEXT = {"", "na", "n/a", "#n/a", "<na>", "nan", "."}  # cells without a value, where a text is expected
NO_NUMBER = NO_TEXT | {"none", "null", "-", "–", "−", "--", "?"}  # the same, where a number is
BLANKS = " "  # one or more blanks or tabs that separate cells
_SEPARATORS = ";\t,"  # the comma last, as it may be that of decimals
_NONE = "\x1f"  # separates nothing
_FEW = 3  # numbers that may be 1, 2, 3 by chance
_HEAD = 1000  # rows by which the separator is chosen
_PLAIN = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?"
_NUMBER = re.compile(rf"{_PLAIN}|[+-]?(?:inf|infinity|nan)", re.ASCII | re.IGNORECASE)
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d{1,4})?", re.ASCII)
_WITH_POINT = re.compile(r"[+-]?(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d{1,4})?", re.ASCII)
_WORDS = re.compile(r'"((?:[^"]|"")*)"(?!\S)|(\S+)')
_COMMENT = re.compile(r"\s*(?://|[#%](?=\s|$))")
_MARK = re.compile(r"\s*(?:#|//)\s*")
_NUMBERS = re.compile(r"[-+0-9.,;\seE]+")  # after which # begins a comment
logger = logging.getLogger(__name__)


class Row(NamedTuple):
    """The cells of a line, none of an empty one, with its number from 1 and its text."""

    line: int
    cells: list[str]
    text: str


@dataclass(frozen=True)
class Table:
    """Rows of cells, and the names of the columns if a line tells them."""

    name: str  # of the file, for messages
    rows: list[Row]  # empty lines between others are rows without cells
    separator: str
    has_decimal_commas: bool
    titles: tuple[str, ...] = ()
    titles_line: int = 0  # that tells the names of the columns
    told: tuple[str, ...] = ()  # cells of the comment before the first row, which may name the columns
    n_after: int = 0  # empty lines at the end

    @property
    def filled(self) -> list[Row]:
        """The rows that have a cell which is not empty."""
        return [row for row in self.rows if any(row.cells)]

    @property
    def width(self) -> int:
        """The number of columns."""
        return len(self.titles) or max((len(row.cells) for row in self.rows), default=0)

    def refuse(self, row: Row, why: str) -> NoReturn:
        """Raise a `FormatError` that quotes a row."""
        raise FormatError(f"{self.name}:{row.line}: {row.text.strip()[:80]!r} {why}")

    def column(self, *names: str) -> int | None:
        """Return the column that has the first of some names, in any case; None if there is none."""
        lower = [title.lower() for title in self.titles]
        return next((lower.index(name) for name in names if name in lower), None)

    def titled(
        self, known: Collection[str] = (), always: bool = False, n_rows: Collection[int] = ()
    ) -> Table:
        """Take the first row for the names of the columns, if it is, by names that are known or by what follows it.

        Rows that have one cell more than it begin with the names that R gives them. ``n_rows`` are the numbers of rows
        that there may be without it.
        """
        rows = [*dropwhile(lambda row: not row.cells, self.rows)]
        if not rows:
            return self
        first, *others = rows
        cells = [_MARK.sub("", first.cells[0], count=1), *first.cells[1:]]
        if not (always or self._are_known(cells, known) or self._is_header(first.cells, others, n_rows)):
            return replace(self, titles=self.told if self._are_known(self.told, known) else ())
        longer = [row for row in others if any(row.cells[len(cells) :])]
        if (
            longer
            and longer == [row for row in others if any(row.cells)]
            and _are_row_names(longer, len(cells))
        ):
            cells = ["", *cells]
        return replace(self, rows=others, titles=(*cells,), titles_line=first.line)

    def _are_known(self, cells: Sequence[str], known: Collection[str]) -> bool:
        return any(cell.lower() in known for cell in cells) and not any(map(self.is_number, cells))

    def _is_header(self, first: Sequence[str], others: list[Row], n_rows: Collection[int]) -> bool:
        filled = [row for row in others if row.cells]
        is_counted = [*first] == [*map(str, range(len(first)))] or [*first] == [
            "",
            *map(str, range(len(first) - 1)),
        ]
        if any(self.is_number(cell) for cell in first):  # pandas calls columns without a name 0, 1, 2
            n, more = len(others), len(others) + 1
            return is_counted and bool(filled) and (first[0] == "" or (n in n_rows and more not in n_rows))
        if all(cell.lower() in NO_NUMBER for cell in first):
            return False
        if first[0] == "" and len(first) > 1:
            return True
        columns = [*zip_longest(*(row.cells for row in filled[:_HEAD]), fillvalue="")]
        numbers = [[self.number(cell) for cell in column] for column in columns]
        if any(None not in each and not np.isnan(np.array(each, dtype=float)).all() for each in numbers):
            return True
        for lengths in (range(len(others), len(others) + self.n_after + 1), [sum(map(bool, filled))]):
            if any(n in n_rows for n in lengths) != any(n + 1 in n_rows for n in lengths):
                return any(n in n_rows for n in lengths)
        if any(re.match(r"[-+.]?\d", cell) for cell in first):
            return False
        return bool(filled) and not any(row.cells == [*first] for row in filled)

    def without_row_names(self) -> Table:
        """Leave out a first column without a name that counts the rows, which is said; `FormatError` if it does not."""
        if not self.titles or self.titles[0] or len(self.titles) == 1:
            return self
        names = [self.whole(row.cells[0]) for row in self.filled]
        start = names[0] if names else 0
        if start not in (0, 1) or names != [*range(start, start + len(names))]:
            raise FormatError(
                f"{self.name}: the first column does not count the rows; leave it out, or sort the rows"
            )
        logger.warning("%s: the first column counts the rows from %d, and is left out", self.name, start)
        rows = [row._replace(cells=row.cells[1:]) for row in self.rows]
        return replace(self, rows=rows, titles=self.titles[1:])

    def records(
        self, required: Collection[str], optional: Collection[str], remedy: str
    ) -> list[dict[str, str]]:
        """Return the cells of each row by the names of the columns; those asked for may be in any case."""
        table, asked = self.titled(always=True), {*required, *optional}
        titles = [title.lower() if title.lower() in asked else title for title in table.titles]
        told = ", ".join(table.titles)[:80]
        if lacking := [name for name in required if name not in titles]:
            raise FormatError(f"{self.name}: has no column {', '.join(lacking)!r} but {told!r}; {remedy}")
        if twice := [name for name in asked if titles.count(name) > 1]:
            raise FormatError(f"{self.name}: has several columns {twice[0]!r}; rename or remove one")
        found = []
        for row in table.filled:
            if any(row.cells[len(titles) :]):
                table.refuse(
                    row,
                    f"has more cells than the columns {told!r}; put quotes around a cell with a separator",
                )
            record = dict(zip(titles, [*row.cells, *[""] * len(titles)]))
            if empty := [name for name in required if not record[name]]:
                table.refuse(row, f"has nothing in the column {empty[0]!r}; write it, or remove the line")
            found.append(record)
        return found

    def require_width(self) -> None:
        """Raise a `FormatError` for the first row that has not as many cells as the names, or as the first."""
        width = len(self.titles) or next((len(row.cells) for row in self.rows if row.cells), 0)
        for row in self.filled:
            if len(row.cells) < width or any(row.cells[width:]):
                self.refuse(
                    row, f"has {len(row.cells)} cells and others {width}; correct the line or export it again"
                )

    def require_one_reading(self) -> None:
        """Raise a `FormatError` if commas may be those of decimals or separate numbers, or blanks be within texts."""
        rows = self.filled
        if not rows:
            return
        if self.separator == BLANKS and not any('"' in row.text for row in rows):
            kinds = [
                all(self.number(cell) is not None for cell in column)
                for column in zip(*(r.cells for r in rows))
            ]
            if not (any(kinds) if self.titles else all(kinds)):
                self.refuse(rows[0], "is one text with blanks, or several; put quotes around texts")
        # 1,5 2,7 3,5 below one name can be the rows that R counts; 4,5 4,7 below none one column
        parts = [re.fullmatch(r"([+-]?\d+),(\d+)", ",".join(row.cells), re.ASCII) for row in rows]
        if self.separator not in (",", _NONE) or not all(parts):
            return
        counts = [int(part[1]) for part in parts if part]
        is_counted = counts in ([*range(len(counts))], [*range(1, len(counts) + 1)])
        if (len(self.titles) == 1 and is_counted and len(counts) > _FEW) or not (self.titles or is_counted):
            self.refuse(
                rows[0],
                "is one number with a decimal comma, or two; write decimal points, or name the columns",
            )

    def is_number(self, cell: str) -> bool:
        """Whether a cell is a number."""
        return self._plain(cell) is not None

    def number(self, cell: str) -> float | None:
        """Return the number of a cell, nan of one without a value; None if it is neither."""
        plain = self._plain(cell)
        return float(plain) if plain is not None else np.nan if cell.lower() in NO_NUMBER else None

    def _plain(self, cell: str) -> str | None:
        text = cell.replace("−", "-")
        if self.has_decimal_commas and _WITH_COMMA.fullmatch(text):
            text = text.replace(",", ".")
        return text if _NUMBER.fullmatch(text) else None

    def whole(self, cell: str) -> int | None:
        """Return the integer of a cell, which may be written as a float; None if it is none."""
        plain = self._plain(cell)
        if plain is not None and re.fullmatch(r"[+-]?\d{1,18}", plain):
            return int(plain)
        number = np.nan if plain is None else float(plain)
        return int(number) if abs(number) < 2**53 and number == int(number) else None

    def numbers(self, i: int) -> FloatArray:
        """Return a column of numbers, nan where it has no value; `FormatError` names a row with another cell."""
        with suppress(ValueError, IndexError):  # which is fast
            cells = [row.cells[i] for row in self.rows]
            if _NUMBERS.fullmatch(" ".join(cells)):
                return np.array([*map(float, cells)])
        found = np.full(len(self.rows), np.nan)
        for k, row in enumerate(self.rows):
            cell = row.cells[i] if i < len(row.cells) else ""
            number = self.number(cell)
            if number is None:
                self.refuse(
                    row, f"has {cell[:40]!r} among numbers; write a number, or NA where there is none"
                )
            found[k] = number
        return found


def read_table(path: Path, spared: Collection[str] = ()) -> Table:
    """Read the table of a file, see `table_of`."""
    return table_of(decoded(contents(path)), str(path), spared)


def read_integers(path: Path, width: int, wanted: str) -> IntArray:
    """Read (rows, width) integers; `FormatError` for a row that is none, which quotes it and says what is wanted."""
    table = read_table(path).titled()
    if len(table.titles) == width + 1:
        table = table.without_row_names()
    found = []
    # one number stands for its place, which an empty line would shift
    for row in table.filled if width > 1 else dropwhile(lambda row: not row.cells, table.rows):
        numbers = [table.whole(cell) for cell in row.cells]
        whole = [number for number in numbers if number is not None]
        if len(whole) != width or len(numbers) != width:
            table.refuse(row, wanted)
        found.append(whole)
    return np.array(found, dtype=np.int64).reshape(-1, width)


def read_csv(
    path: Path,
    required: Collection[str] = (),
    optional: Collection[str] = (),
    remedy: str = "name the columns in the first line",
) -> list[dict[str, str]]:
    """Read a table whose first line names the columns, see `Table.records`."""
    return read_table(path).records(required, optional, remedy)


def table_of(text: str, name: str, spared: Collection[str] = ()) -> Table:
    """Read the cells of each line of a text: separated by semicolons, tabs, commas or blanks, in quotes or not.

    The separator is that which gives rows of one length. Lines of comments are left out; ``spared`` first cells begin
    with # and are none. `FormatError` if it is no text, or commas may be those of decimals or between numbers.
    """
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise FormatError(
            f"{name}:{line}: has bytes of zero and is no text; export it again as text in UTF-8"
        )
    lines = [*enumerate(re.split(r"\r*\n" if "\n" in text else r"\r", text), start=1)]
    told = ""
    if lines and lines[0][1][:4].lower() == "sep=":  # of a spreadsheet program
        told, lines = lines[0][1][4:5], lines[1:]
    kept = [(number, _untailed(line)) for number, line in lines if not _is_comment(line, spared)]
    n_lines = len(kept)
    while kept and not kept[-1][1].strip(" "):
        kept.pop()
    n_after = max(n_lines - len(kept) - 1, 0)
    if {*map(_is_of_numbers, (line for _, line in kept[:_HEAD] if line.strip()))} == {",", BLANKS}:  # by hand
        kept = [(number, line.replace(",", " ")) for number, line in kept]
    separator = told if told and told in _SEPARATORS else _separator_of(kept, name)
    rows = _without_marked(rows_of(kept, separator, name), spared)
    cells = [cell for row in rows for cell in row.cells if "," in cell or "." in cell]
    has_commas = any(map(_WITH_COMMA.fullmatch, cells)) and not any(map(_WITH_POINT.fullmatch, cells))
    first = next((row.line for row in rows if row.cells), 0)
    before = [_MARK.sub("", line) for number, line in lines if number < first and _MARK.match(line)][-1:]
    width = len(rows[0].cells) if rows else 0
    split = [
        rows_of([(0, line)], each, name, False)[0].cells for line in before for each in (separator, BLANKS)
    ]
    titles = next((cells for cells in split if len(cells) == width), [])
    return Table(name, rows, separator, has_commas and separator != ",", told=(*titles,), n_after=n_after)


def _is_comment(line: str, spared: Collection[str]) -> bool:
    return _COMMENT.match(line) is not None and not line.startswith(tuple(spared))


def _is_of_numbers(line: str) -> str:
    """Return what separates the numbers of a line, commas or blanks alone; nothing of another line."""
    kinds = ((",", r"\s*,\s*"), (BLANKS, r"\s+"))
    return next((mark for mark, gap in kinds if re.fullmatch(rf"\s*{_PLAIN}(?:{gap}{_PLAIN})+\s*", line)), "")


def _untailed(line: str) -> str:
    """Return a line without a comment after numbers."""
    numbers = re.split(r" [#%]", line, maxsplit=1)[0] if "#" in line or "%" in line else line
    return numbers if _NUMBERS.fullmatch(numbers) else line


def _without_marked(rows: list[Row], spared: Collection[str]) -> list[Row]:
    """Leave out rows that begin with # as no others do, among numbers or of another length."""
    filled = [row for row in rows if row.cells]
    marked = [row for row in filled if row.cells[0].startswith("#") and row.cells[0] not in spared]
    plain = [row for row in filled if not row.cells[0].startswith("#")]
    if not marked or not plain:
        return rows
    width = Counter(len(row.cells) for row in plain).most_common(1)[0][0]
    numeric = all(_NUMBER.fullmatch(row.cells[0]) for row in plain[:_HEAD])
    gone = {row.line for row in marked if numeric or len(row.cells) != width}
    return [row for row in rows if row.line not in gone]


def _are_row_names(rows: list[Row], width: int) -> bool:
    """Whether rows that are longer by one than the names of the columns begin with names of rows, as R writes them."""
    names = [row.cells[0] for row in rows]
    is_counted = names == [str(i) for i in range(1, len(names) + 1)]
    is_told = is_counted or all(row.text.lstrip().startswith('"') for row in rows)
    return is_told and len({*names}) == len(names) and all(len(row.cells) == width + 1 for row in rows)


def rows_of(lines: Iterable[tuple[int, str]], separator: str, name: str, strict: bool = True) -> list[Row]:
    """Split lines, with their numbers, into cells."""
    lines = [*lines]
    if separator == BLANKS:
        return [Row(number, _words(line), line) for number, line in lines]
    rows, last = list[Row](), 0
    reader = csv.reader(
        (f"{line}\n" for _, line in lines), delimiter=separator, skipinitialspace=True, strict=strict
    )
    try:
        for row in reader:
            number, text = lines[last]
            last = reader.line_num
            cells = [unescaped(cell.strip()) for cell in row]
            rows.append(Row(number, cells if any(cells) or len(cells) > 1 or '"' in text else [], text))
    except csv.Error as error:
        number = lines[min(reader.line_num, len(lines)) - 1][0]
        raise FormatError(
            f"{name}:{number}: not a table ({error}); write cells separated by commas"
        ) from None
    return rows


def _words(line: str) -> list[str]:
    return [
        unescaped(word[1].replace('""', '"') if word[1] is not None else word[2])
        for word in _WORDS.finditer(line)
    ]


def _separator_of(lines: list[tuple[int, str]], name: str) -> str:
    # a tab after an apostrophe is one that was escaped
    head = [(number, line.replace("'\t", "'")) for number, line in lines if line.strip()][:_HEAD]
    split: dict[str, list[Row]] = {each: rows_of(head, each, name, False) for each in (*_SEPARATORS, BLANKS)}
    fitting = [each for each, rows in split.items() if _is_even(rows, each)]
    words = split[BLANKS]
    if BLANKS in fitting and not {";", "\t"} & {*fitting}:
        plain = (word[2] for _, line in head for word in _WORDS.finditer(line))  # not in quotes
        commas = [word for word in plain if word and "," in word]
        if all(map(_WITH_COMMA.fullmatch, commas)) or "," not in fitting:
            return BLANKS
    if "\t" in fitting and BLANKS in fitting and ";" not in fitting:
        columns = zip(*(row.cells for row in split["\t"]))
        if any(not any(column) for column in columns):  # several tabs are one
            return BLANKS
    if fitting and fitting[0] != ",":
        return fitting[0]
    if fitting:
        return "," if not _may_be_decimals(split[","], name) else _NONE
    # rows of several lengths: names of several columns in the first row, or what most rows have
    several = [each for each in _SEPARATORS if head and len(split[each][0].cells) > 1]
    n_alike = {each: max(Counter(len(row.cells) for row in split[each]).values()) for each in several}
    if not several and words and all(_NUMBER.fullmatch(cell) for cell in words[0].cells):
        return BLANKS
    return str(max(several, key=lambda each: n_alike[each], default=_NONE))


def _is_even(rows: list[Row], separator: str) -> bool:
    """Whether all rows have as many cells, two or more, but for empty ones at their ends and the names of R."""
    lengths = [len(row.cells) for row in rows]
    most = Counter(lengths[1:] or lengths).most_common(1)
    width = most[0][0] if most else 0
    full = [len([*dropwhile(lambda cell: not cell, reversed(row.cells))]) for row in rows]
    is_short = bool(rows) and len(rows) > 1 and lengths[0] == width - 1
    if is_short and lengths[0] == 1 and separator in (",", BLANKS):
        is_short = all(row.text.lstrip().startswith('"') for row in rows[1:])
    others = rows[1:] if is_short else rows
    return width > 1 and all(
        len(row.cells) == width or n <= width < len(row.cells) for row, n in zip(others, full[-len(others) :])
    )


def _may_be_decimals(rows: list[Row], name: str) -> bool:
    """Whether commas between whole numbers are those of decimals in one column; `FormatError` if in several."""
    first = rows[0].cells
    if '"' in rows[0].text or not all(re.fullmatch(r"[+-]?\d+", cell, re.ASCII) for cell in first):
        return False
    signs = [cell for row in rows for cell in row.cells[::2] if re.fullmatch(r"-0+", cell)]
    zeros = [cell for row in rows for cell in row.cells[1::2] if re.fullmatch(r"0\d+", cell, re.ASCII)]
    if not (signs or zeros):
        return False
    if len(first) == 2:
        return True
    raise FormatError(
        f"{name}:{rows[0].line}: {rows[0].text[:80]!r} has commas between numbers and perhaps in them; "
        "separate the cells by semicolons"
    )
