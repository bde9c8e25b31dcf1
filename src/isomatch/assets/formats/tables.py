"""Tables of values on points: NumPy arrays, and text of columns between commas, semicolons, tabs or blanks."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from io import BytesIO
from itertools import dropwhile
from pathlib import Path

import numpy as np

from isomatch.assets.attribute import Attribute, guessed_kind, told_apart
from isomatch.assets.formats._reading import reading
from isomatch.assets.formats._text import number_of
from isomatch.errors import FormatError
from isomatch.storage.texts import SEPARATORS, decoded, encoding_of, joined, separated
from isomatch.values.arrays import AnyArray

_INDEX_NAMES = ("", "index", "vertex", "vertex_index", "point", "node", "unnamed: 0")
_BLANK = {"", "nan", "na", "n/a", "#n/a", "none", "null"}


def read_array(data: bytes, name: str) -> tuple[Attribute, ...]:
    """Read a ``.npy`` file of one row, number or text for each point."""
    with reading(name, "a .npy file of numbers or texts, without pickled objects"):
        values = np.load(BytesIO(data), allow_pickle=False)
    if not isinstance(values, np.ndarray) or values.ndim not in (1, 2) or values.dtype.kind not in "fiubUS":
        raise FormatError(
            f"{name}: expected an array (n,) or (n, k) of numbers or texts, one row for each point"
        )
    values = np.char.decode(values, encoding_of(values.tobytes())) if values.dtype.kind == "S" else values
    values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
    title = Path(name).stem
    return (Attribute(title, "point", guessed_kind(title, values), values),)


def write_array(attributes: Sequence[Attribute]) -> bytes:
    """Write the values of one attribute as a ``.npy`` file."""
    file = BytesIO()
    (attribute,) = attributes
    np.save(file, attribute.values if attribute.kind == "label" else attribute.plain, allow_pickle=False)
    return file.getvalue()


def read_table(data: bytes, name: str, n_rows: Sequence[int] = ()) -> tuple[Attribute, ...]:
    """Read columns of a text; those without a header are named by the file.

    A first line of names is told by the number of rows, if that is known, or by numbers that follow it. A column named
    vertex, index or nothing that has different whole numbers says which point a row is of.
    """
    rows, may_have_commas = _rows(decoded(data), name)
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        found = "rows of different lengths" if rows else "nothing"
        raise FormatError(
            f"{name}: expected columns of one row for each point, found {found}; export it again"
        )
    has_header = _has_header(rows, n_rows, may_have_commas)
    titles = rows.pop(0) if has_header else []
    stem = Path(name).stem
    columns = [_column(list(cells), may_have_commas) for cells in zip(*rows)]
    titles = titles or ([stem] if len(columns) == 1 else [f"{stem}_{i}" for i in range(len(columns))])
    index = None
    first = columns[0]
    is_index = first.dtype.kind == "i" and first.min(initial=0) >= 0 and len(np.unique(first)) == len(first)
    if len(columns) > 1 and has_header and titles[0].lower() in _INDEX_NAMES and is_index:
        index, columns, titles = columns[0], columns[1:], titles[1:]
    made = [
        Attribute(title or f"{stem}_{i}", "point", guessed_kind(title, column), column)
        for i, (title, column) in enumerate(zip(titles, columns))
    ]
    if index is not None:
        total = int(index.max(initial=-1)) + 1
        n = next((n for n in n_rows if n >= total), total)
        made = [each.spread(index, n) for each in made]
    return told_apart(made)


def write_table(attributes: Sequence[Attribute], mark: str = ",") -> bytes:
    """Write a line of names, and a row for each point, with a mark between the columns."""
    names, columns = [], []
    for attribute in attributes:
        values = attribute.values if attribute.kind == "label" else attribute.plain
        table = values.reshape(len(values), -1)
        single = table.shape[1] == 1
        names += [attribute.name if single else f"{attribute.name}_{i}" for i in range(table.shape[1])]
        columns += [column.tolist() for column in table.T]
    return joined([names, *zip(*columns)], mark).encode(errors="backslashreplace")


def _rows(text: str, name: str) -> tuple[list[list[str]], bool]:
    """Split lines at a mark of the first one, or at blanks; say whether numbers may have decimal commas."""
    lines = [line for line in text.splitlines() if line.strip()]
    lines = list(dropwhile(lambda line: line.strip() == "#" or line.startswith("# "), lines))
    marks = [each for each in SEPARATORS if lines and each in lines[0]]
    if marks:
        rows, mark = separated("\n".join(lines), name, marks)
        return [row for _, row in rows], mark != ","
    words = [line.split() for line in lines]
    is_table = all(len(row) == len(words[0]) for row in words)
    return words if is_table else [[line.strip()] for line in lines], True


def _has_header(rows: list[list[str]], n_rows: Collection[int], may_have_commas: bool) -> bool:
    def is_number(cell: str) -> bool:
        with suppress(ValueError):
            number_of(cell, may_have_commas)
            return True
        return False

    first, *others = rows
    if any(map(is_number, first)):
        return False
    if len(first) > 1 and first[0].lower() in _INDEX_NAMES:
        return True
    if (len(rows) in n_rows) != (len(rows) - 1 in n_rows):
        return len(rows) not in n_rows
    return bool(others) and (any(map(is_number, others[0])) or not any(row == first for row in others))


def _column(cells: list[str], may_have_commas: bool) -> AnyArray:
    """Return whole numbers, numbers with nan for blanks, or texts; commas are decimal if there are no points."""
    if any("_" in cell for cell in cells):
        return np.array(cells)
    with suppress(ValueError, OverflowError):
        return np.array([int(cell) for cell in cells], dtype=np.int64)
    has_commas = may_have_commas and not any("." in cell for cell in cells)
    with suppress(ValueError):
        return np.array([np.nan if cell.lower() in _BLANK else number_of(cell, has_commas) for cell in cells])
    return np.array(cells)
