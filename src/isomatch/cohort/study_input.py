"""The input of a study of shapes: meshes or landmarks, a table of subjects, and doubts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from unicodedata import normalize

import numpy as np

from isomatch._core.errors import FormatError, InputError
from isomatch._core.skipped import noted
from isomatch._core.tables import NO_TEXT, read_table
from isomatch.cohort import shape_statistics
from isomatch.cohort.map_file import require_unchanged
from isomatch.cohort.plan import Layout
from isomatch.cohort.shape_statistics import CORRESPONDED, CorrespondedShapes, Criterion, Doubt, Slid
from isomatch.io import FORMATS, meshes_among
from isomatch.landmarks import Curve, is_of_landmarks, read_landmark_pairs, read_specimens

TRUSTED_OUTCOMES = {"CONVERGED", "PARTIAL"}  # outcomes, as named in pairs.csv, of maps not in doubt
Table = dict[str, dict[str, str]]  # cells of each shape by column; "" where there is no value


class Study(NamedTuple):
    """Shapes of a source, the table of their subjects, doubts, and notes."""

    shapes: CorrespondedShapes
    table: Table
    doubts: list[Doubt]
    notes: list[str]
    slid: Sequence[Slid] = ()

    @property
    def groups(self) -> dict[str, str]:
        """The group of each shape that has one."""
        return {name: group for name, cells in self.table.items() if (group := cells.get("group", ""))}


def is_landmark_study(source: Path) -> bool:
    """Tell whether a source has landmarks: a file, or a folder of such files without meshes."""
    if not source.is_dir():
        has_meshes = source.suffix.lower() in FORMATS
    else:
        is_collection = (source / CORRESPONDED).is_dir() or Layout(source).plan.exists()
        has_meshes = is_collection or bool(meshes_among(source.iterdir()))
    return not has_meshes and is_of_landmarks(source)


def read_study(
    source: Path,
    table: Path | None,
    columns: Sequence[str] = ("group",),
    *,
    wireframe: Path | None = None,
    slide: Criterion | None = None,
) -> Study:
    """Read a mesh, a folder of meshes or of a collection, or landmarks, with a table of subjects."""
    slid = list[Slid]()
    if is_landmark_study(source):
        shapes, slid = _read_landmarks(source, wireframe, slide)
    elif (slide or wireframe) and source.exists():
        raise InputError(f"{source}: has meshes; --slide and --wireframe are for files of landmarks")
    else:
        require_unchanged(Layout(source), ["corresponded"])
        shapes = shape_statistics.read_shapes([source] if source.is_file() else source)
    cells = read_shape_cells(table, shapes.names, shapes.left_out, columns) if table else {}
    doubts = shape_statistics.doubtful_shapes(shapes)
    notes = [noted(f"left out: {reason}") for reason in shapes.left_out]
    for folder in (source / structure for structure in shapes.structures or ("",)):
        of_maps = _doubts(folder / "pairs.csv", shapes.names)
        of_maps += _tell_reflected(folder / "shapes.csv", shapes.names)
        notes += [f"{folder.name}: {note}" if shapes.structures else note for note in of_maps]
    return Study(shapes, cells, list(doubts), notes, slid)


def _read_landmarks(
    source: Path, wireframe: Path | None, slide: Criterion | None
) -> tuple[CorrespondedShapes, list[Slid]]:
    """Read landmarks as shapes, slide semilandmarks, and join landmarks by the wireframe."""
    specimens, slid = read_specimens(source), list[Slid]()
    first = next(iter(specimens.values()))
    if slide:
        if not any(len(curve.rows) > 2 for curve in first.curves) and not first.patch:
            remedy = f"give a table {source.stem}_sliders.csv or {source.stem}_surfaces.csv beside it"
            raise InputError(f"{source}: has no curves nor points of a surface that could slide; {remedy}")
        given = np.array([specimen.positions for specimen in specimens.values()])
        found = shape_statistics.slid_semilandmarks(given, None, first.curves, first.patch, criterion=slide)
        slid = found.of_each([*specimens], given)
        specimens = {n: replace(specimens[n], positions=at) for n, at in zip(specimens, found.positions)}
    if wireframe:
        links = tuple(Curve("", pair) for pair in read_landmark_pairs(wireframe, first.names))
        specimens = {name: replace(specimen, curves=links) for name, specimen in specimens.items()}
    return CorrespondedShapes.of_landmarks(specimens), slid


def doubts_in_words(doubts: Iterable[Doubt]) -> list[str]:
    """Put doubts in words."""
    return [f"{' and '.join(doubt.names)} {doubt.reason}" for doubt in doubts]


def _doubts(pairs: Path, names: tuple[str, ...]) -> list[str]:
    """List the shapes of a collection whose maps may all be wrong."""
    outcomes: dict[str, set[str]] = {name: set() for name in names}
    for row in read_table(pairs).records() if pairs.is_file() else ():
        for end in ("source", "target"):
            outcomes.get(row.get(end) or "", set()).add(row.get("outcome") or "FAILED")
    doubtful = [(name, found) for name, found in outcomes.items() if found and not found & TRUSTED_OUTCOMES]
    return [f"{name} may be matched wrongly: {', '.join(sorted(found))}" for name, found in doubtful]


def _tell_reflected(table: Path, names: tuple[str, ...]) -> list[str]:
    """Tell which shapes of a collection are mirror images of the surfaces in their files."""
    lines = read_table(table).records() if table.is_file() else []
    named = ", ".join(line["name"] for line in lines if line.get("reflected") and line.get("name") in names)
    return [f"mirror images of the surfaces in their files: {named}"] if named else []


def read_shape_cells(
    path: Path, names: Iterable[str], left_out: Sequence[str] = (), columns: Sequence[str] = ("group",)
) -> Table:
    """Read a table of shapes, as spreadsheets write it: cells by column."""
    # The table has a column name and the given ones, among others; or name and group without a header. Names
    # may be file names, or the row names of R. Rows of shapes that were left out are skipped.
    names_of = {normalize("NFC", name): name for name in names}
    spared = [name for name in (*names_of, *names_of.values()) if name.startswith("#")]
    untitled = read_table(path, spared)
    titled = untitled.titled({"name", *columns})
    lower = [title.lower() if title.lower() in ("name", "group") else title for title in titled.titles]
    if "name" not in lower and lower[:1] == [""]:
        lower[0] = "name"
    has_titles = {"name", *columns} <= {*lower}
    if not has_titles and columns != ("group",):
        problem = f"has no columns {','.join(['name', *columns])} but {', '.join(lower)[:80]!r}"
        raise FormatError(f"{path}: {problem}; name them in the first line")
    head, rows = (lower, titled) if has_titles else (["name", "group"], untitled)
    found: Table = {}
    for row in rows.filled:
        if len(row.cells) < len(head) or any(row.cells[len(head) :]):
            remedy = f"write {','.join(head)}, or a header with these columns"
            rows.refuse(row, f"is not a shape and its {' and '.join(columns)}; {remedy}")
        cells = {column: "" if cell.lower() in NO_TEXT else cell for column, cell in zip(head, row.cells)}
        name, where = row.cells[head.index("name")], f"{path}:{row.line}"
        shape = names_of.get(normalize("NFC", name)) or names_of.get(normalize("NFC", _stem(name)))
        if shape is None:
            if any(reason.startswith((f"{name}: ", f"{_stem(name)}: ")) for reason in left_out):
                continue
            raise FormatError(f"{where}: no shape is named {name!r}; shapes are named like their files")
        for column, cell in cells.items():
            if column != "name" and found.setdefault(shape, cells)[column] != cell:
                problem = f"{name!r} is in {column} {cell!r} and in {found[shape][column]!r}"
                raise FormatError(f"{where}: {problem}; give each shape one {column}")
    return found


def _stem(name: str) -> str:
    """Return the name of a shape, given a file name."""
    last = name.replace("\\", "/").rpartition("/")[2]
    suffix = Path(last).suffix
    is_known = suffix.lower() in (*FORMATS, ".fcsv", ".json", ".pts", ".pp", ".tps")
    return last.removesuffix(suffix) if is_known else last
