"""Cells of a text, as spreadsheets and other programs separate them."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable
from io import StringIO

from isomatch.errors import FormatError

SEPARATORS = ";\t,"
"""What stands between cells; the comma last, as it may be that of decimals."""
Rows = list[tuple[int, list[str]]]
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
"""How texts begin that a spreadsheet takes for a formula, and these when they are escaped."""


def joined(rows: Iterable[Iterable[object]], separator: str = ",", line_end: str = "\n") -> str:
    r"""Write rows as a text; an apostrophe stands before texts that a spreadsheet would run as a formula.

    Examples
    --------
    >>> joined([["name", "depth"], ["=1+1", -0.5], ["-a", "-2"]])
    "name,depth\n'=1+1,-0.5\n'-a,-2\n"
    """
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
    """Return a text without the apostrophe that `joined` puts before it.

    Examples
    --------
    >>> unescaped("'=1+1"), unescaped("'tis")
    ('=1+1', "'tis")
    """
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def separated(text: str, name: str, separators: Iterable[str] = SEPARATORS) -> tuple[Rows, str]:
    r"""Split the lines of a text by the separator that gives most rows of one length, of at least two cells.

    A first line ``sep=;``, for a spreadsheet program, says which it is.

    Returns
    -------
    rows : list of (int, list of str)
        Number of the line, and its cells without outer blanks, of each row.
    separator : str
        What stands between the cells.

    Raises
    ------
    FormatError
        If it is no table; the message begins with ``name``.

    Examples
    --------
    >>> separated("depth;width\n1,5;0,25\n", "a.csv")
    ([(1, ['depth', 'width']), (2, ['1,5', '0,25'])], ';')
    """

    def split(separator: str) -> Rows:
        reader = csv.reader(StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
        try:
            return [(reader.line_num, [unescaped(cell.strip()) for cell in row]) for row in reader if row]
        except csv.Error as error:
            message = f"{name}:{reader.line_num}: not a table ({error}); write cells separated by commas"
            raise FormatError(message) from None

    if text[:4].lower() == "sep=" and text[4:5] in tuple(SEPARATORS):
        return split(text[4])[1:], text[4]
    return max(((split(each), each) for each in separators), key=lambda found: _rows_alike(found[0]))


def _rows_alike(rows: Rows) -> int:
    return max(Counter(len(row) for _, row in rows if len(row) > 1).values(), default=0)
