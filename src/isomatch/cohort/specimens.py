"""The shapes of a folder that is studied, in one topology: their groups, which of them seem wrong, and notes."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple
from unicodedata import normalize

from isomatch._core.errors import FormatError
from isomatch._core.files import opened
from isomatch._core.texts import decoded, read_csv, separated
from isomatch.cohort import shape_statistics
from isomatch.cohort.map_file import require_unchanged
from isomatch.cohort.plan import Layout
from isomatch.cohort.shape_statistics import CorrespondedShapes, Doubt
from isomatch.io import FORMATS

TRUSTED = {"CONVERGED", "PARTIAL"}  # outcomes of maps that are not in doubt


class Specimens(NamedTuple):
    """The shapes of a folder, and what is known of them."""

    shapes: CorrespondedShapes
    labels: dict[str, str]  # group of each shape that has one
    doubts: list[Doubt]
    notes: list[str]

    @property
    def warnings(self) -> list[str]:
        """The doubts in words."""
        return [f"{' and '.join(doubt.names)} {doubt.reason}" for doubt in self.doubts]


def read_specimens(folder: Path, groups: Path | None) -> Specimens:
    """Read the shapes of a folder of meshes or of a collection, or one mesh, with their groups."""
    require_unchanged(Layout(folder), ["corresponded"])
    shapes = shape_statistics.read_shapes([folder] if folder.is_file() else folder)
    labels = read_groups(groups, shapes.names, shapes.left_out) if groups else {}
    doubts = shape_statistics.doubtful_shapes(shapes)
    notes = [f"left out: {reason}" for reason in shapes.left_out]
    for own in (folder / structure for structure in shapes.structures or ("",)):
        told = _doubts(own / "pairs.csv", shapes.names) + _reflected(own / "shapes.csv", shapes.names)
        notes += [f"{own.name}: {note}" if shapes.structures else note for note in told]
    return Specimens(shapes, labels, list(doubts), notes)


def _doubts(pairs: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection rest on a map that may be wrong."""
    if not pairs.is_file():
        return []
    outcomes: dict[str, set[str]] = {name: set() for name in names}
    for row in read_csv(pairs):
        for end in ("source", "target"):
            outcomes.get(row.get(end) or "", set()).add(row.get("outcome") or "FAILED")
    doubtful = {name: ", ".join(sorted(own)) for name, own in outcomes.items() if own and not own & TRUSTED}
    return [f"{name} may be matched wrongly: {doubts}" for name, doubts in doubtful.items()]


def _reflected(table: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection are mirror images of those in their files."""
    lines = read_csv(table) if table.is_file() else []
    turned = [name for line in lines if line.get("reflected") and (name := line.get("name")) in names]
    return [f"mirror images of the surfaces in their files: {', '.join(turned)}"] if turned else []


def read_groups(path: Path, names: Collection[str], left_out: Collection[str] = ()) -> dict[str, str]:
    """Read the group of each shape from a table, as spreadsheets write them; shapes whose cell is empty have none."""
    # Columns name and group, among others, or these two without a header; names may be those of files. A line that begins
    # with # is a comment, unless a shape has that name. Rows of shapes that were left out, with reasons, are passed over.
    names_of = {normalize("NFC", name): name for name in names}
    labels: dict[str, str] = {}
    columns: tuple[int, int] | None = None
    with opened(path) as file:
        rows, _ = separated(decoded(file.read()), str(path))
    for number, row in rows:
        if not any(row):
            continue
        where, shown = f"{path}:{number}", ",".join(row)[:80]
        if row[0].startswith("#") and normalize("NFC", row[0]) not in names_of:
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
        shape = names_of.get(normalize("NFC", name)) or names_of.get(normalize("NFC", _stem(name)))
        if shape is None:
            if any(reason.startswith(f"{each}: ") for reason in left_out for each in (name, _stem(name))):
                continue
            raise FormatError(f"{where}: no shape is named {name!r}; shapes are named like their files")
        if labels.setdefault(shape, group) != group:
            raise FormatError(
                f"{where}: {name!r} is in group {group!r} and in {labels[shape]!r}; give each shape one group"
            )
    return {name: group for name, group in labels.items() if group}


def _stem(name: str) -> str:
    """Name of a shape from that of its file."""
    last = name.replace("\\", "/").rpartition("/")[2]
    suffix = Path(last).suffix
    return last.removesuffix(suffix) if suffix.lower() in FORMATS else last
