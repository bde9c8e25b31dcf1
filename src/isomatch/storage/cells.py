"""Cells of a text, as spreadsheets and other programs separate them."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable
from io import StringIO

from isomatch.errors import FormatError

SEPARATORS = ";\t,"
"""What stands between cells; the comma last, as it may be that of decimals."""
Rows = list[tuple[int, list[str]]]


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
            return [(reader.line_num, [cell.strip() for cell in row]) for row in reader if row]
        except csv.Error as error:
            message = f"{name}:{reader.line_num}: not a table ({error}); write cells separated by commas"
            raise FormatError(message) from None

    if text[:4].lower() == "sep=" and text[4:5] in tuple(SEPARATORS):
        return split(text[4])[1:], text[4]
    return max(((split(each), each) for each in separators), key=lambda found: _rows_alike(found[0]))


def _rows_alike(rows: Rows) -> int:
    return max(Counter(len(row) for _, row in rows if len(row) > 1).values(), default=0)
