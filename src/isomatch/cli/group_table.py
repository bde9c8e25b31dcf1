"""Tables of the groups of shapes, as spreadsheets write them."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from unicodedata import normalize

from isomatch import assets
from isomatch.errors import FormatError
from isomatch.storage.files import opened
from isomatch.storage.texts import Rows, decoded, separated


def read_groups(path: Path, names: Collection[str], left_out: Collection[str] = ()) -> dict[str, str]:
    """Read the group of each shape; shapes whose cell is empty have none.

    Parameters
    ----------
    path : Path
        A table with the columns ``name`` and ``group``, among others, or of these two without a header. Cells are
        separated by commas, semicolons or tabs. A name may be that of the file, with its folder and suffix. A line that
        begins with ``#`` is a comment, unless a shape has that name.
    names : collection of str
        Names of the shapes.
    left_out : collection of str
        Reasons why other shapes were left out, which begin with their names; their rows are passed over.

    Raises
    ------
    FormatError
        If it is no such table, names another shape, or gives one two groups.
    """
    known = {normalize("NFC", name): name for name in names}
    labels: dict[str, str] = {}
    columns: tuple[int, int] | None = None
    for number, row in _rows(path):
        where, shown = f"{path}:{number}", ",".join(row)[:80]
        if row[0].startswith("#") and normalize("NFC", row[0]) not in known:
            continue
        if columns is None:
            lower = [cell.lower() for cell in row]
            is_header = "name" in lower and "group" in lower
            columns = (lower.index("name"), lower.index("group")) if is_header else (0, 1)
            if is_header:
                continue
            if len(row) < 2 or any(row[2:]):
                raise FormatError(
                    f"{where}: {shown!r} is not a shape and its group; write name,group, or a header with these columns"
                )
        if len(row) <= max(columns):
            raise FormatError(f"{where}: {shown!r} is not a shape and its group; write name,group")
        name, group = (row[column] for column in columns)
        shape = known.get(normalize("NFC", name)) or known.get(normalize("NFC", _stem(name)))
        if shape is None and any(
            reason.startswith(f"{each}: ") for reason in left_out for each in (name, _stem(name))
        ):
            continue
        if shape is None:
            raise FormatError(f"{where}: no shape is named {name!r}; shapes are named like their files")
        if labels.setdefault(shape, group) != group:
            raise FormatError(
                f"{where}: {name!r} is in group {group!r} and in {labels[shape]!r}; give each shape one group"
            )
    return {name: group for name, group in labels.items() if group}


def _rows(path: Path) -> Rows:
    with opened(path) as file:
        rows, _ = separated(decoded(file.read()), str(path))
    return [(number, row) for number, row in rows if any(row)]


def _stem(name: str) -> str:
    """Name of a shape from that of its file."""
    last = name.replace("\\", "/").rpartition("/")[2]
    suffix = Path(last).suffix
    return last.removesuffix(suffix) if suffix.lower() in assets.FORMATS else last
