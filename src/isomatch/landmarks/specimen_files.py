"""Files with the landmarks of several specimens: TPS, NTSYS, morphologika and tables."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError
from isomatch._core.files import legible
from isomatch._core.tables import NO_NUMBER, Row, Table, parse_table, read_table
from isomatch._core.texts import read_text
from isomatch.landmarks.landmark_files import NO_PLACE, MarkedPoint, marked_points

SPECIMEN_TITLES = ("specimen", "individual", "subject", "shape")  # titles of the column that names specimens
LANDMARK_TITLES = ("landmark", "point", "label", "name")  # titles of the column that names landmarks
SUFFIXES_OF_MANY = ".tps", ".nts", ".dta", ".txt", ".csv", ".tsv"  # suffixes of files of specimens


class Specimen(NamedTuple):
    """The landmarks of one specimen in a file."""

    name: str
    points: list[MarkedPoint]
    dim: int
    links: tuple[tuple[int, int], ...] = ()  # pairs of points in a wireframe


def specimen_points(path: Path) -> tuple[list[MarkedPoint], int]:
    """Read the points of one specimen, and how many coordinates they have."""
    specimens = list(specimens_in(path))
    if len(specimens) > 1:
        names = ", ".join(specimen.name for specimen in specimens)[:80]
        message = f"{path}: has the landmarks of {len(specimens)} specimens, {names}; give a file of one"
        raise FormatError(message)
    return (specimens[0].points, specimens[0].dim) if specimens else ([], 3)


def specimens_in(path: Path) -> Iterator[Specimen]:
    """Read the specimens of a file, by its suffix."""
    suffix, name = path.suffix.lower(), legible(path.name).split(".")[0]
    text = read_text(path) if suffix in SUFFIXES_OF_MANY else ""
    if suffix == ".tps":
        yield from _tps(text, path)
    elif suffix in (".nts", ".dta"):
        yield from _ntsys(text, path)
    elif re.match(r"\s*\[", text):
        yield from _morphologika(text, path)
    elif suffix in SUFFIXES_OF_MANY and (table := _table(text, path)):
        yield from table
    else:
        yield Specimen(name, marked_points(path), 3)


def _point(
    cells: Sequence[str], where: str, name: str = "", curve: str = "", scale: float = 1.0
) -> MarkedPoint:
    """Make a point of cells with numbers, or with words for a point without a place."""
    if all(cell.lower() in NO_NUMBER for cell in cells):
        return MarkedPoint(name, (), where, curve=curve)
    try:
        at = tuple(float(cell) for cell in cells)
    except ValueError:
        at = ()
    if len(at) not in (2, 3) or not np.isfinite(at).all():
        message = f"{where}: {' '.join(cells)[:80]!r} is no position; write 2 or 3 numbers, or NA for none"
        raise FormatError(message)
    at = () if all(abs(x) == NO_PLACE for x in at) else tuple(x * scale for x in at)
    return MarkedPoint(name, at, where, curve=curve)


def _tps(text: str, path: Path) -> Iterator[Specimen]:
    """Read specimens of TPS: LM= or LM3= and points, CURVES= with POINTS= of each, ID=, IMAGE=, SCALE=."""
    blocks: list[list[tuple[int, str]]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if re.match(r"\s*LM3?\s*=", line, re.IGNORECASE):
            blocks.append([])
        if blocks and line.strip():
            blocks[-1].append((number, line.strip()))
    values = list[dict[str, str]]()
    for block in blocks:
        parts = (line.partition("=") for _, line in block)
        values.append({key.strip().upper(): value.strip() for key, eq, value in parts if eq})
    ids = [keys.get("ID", "") for keys in values]
    images = [re.sub(r"\.\w{3,4}$", "", re.split(r"[\\/]", keys.get("IMAGE", ""))[-1]) for keys in values]
    names = ids if len(set(ids)) == len(ids) or len(set(images)) < len(ids) else images
    for i, (block, keys) in enumerate(zip(blocks, values)):
        try:
            scale = float(keys.get("SCALE", "1").replace(",", "."))
        except ValueError:
            message = f"{path}:{block[0][0]}: SCALE={keys['SCALE']!r} is no number; correct it"
            raise FormatError(message) from None
        points, n_points, kind, n_curves = list[MarkedPoint](), 0, "", 0
        for number, line in block:
            key, eq, value = (part.strip().upper() for part in line.partition("="))
            if eq:
                if key in ("LM", "LM3", "POINTS", "CURVES", "OUTLINES"):
                    if not value.isdecimal():
                        message = f"{path}:{number}: {line[:80]!r} gives no count; write {key}=NUMBER"
                        raise FormatError(message)
                    kind = "" if key.startswith("LM") else kind if key == "POINTS" else key
                    n_points += 0 if key in ("CURVES", "OUTLINES") or kind == "OUTLINES" else int(value)
                    n_curves += key == "POINTS" and kind == "CURVES"
            elif kind != "OUTLINES":
                curve = f"curve {n_curves}" if kind else ""
                points.append(_point(line.split(), f"{path}:{number}", curve=curve, scale=scale))
        if len(points) != n_points:
            problem = f"the specimen that begins here has {len(points)} points, and says {n_points}"
            raise FormatError(f"{path}:{block[0][0]}: {problem}; correct its counts or its points")
        name = names[i] or images[i] or str(i + 1)
        yield Specimen(name, points, _dim(points, 3 if "LM3" in keys else 2, path))


def _dim(points: Sequence[MarkedPoint], usual: int, path: Path) -> int:
    lengths = {len(point.at) for point in points if point.at}
    if len(lengths) > 1:
        where = next(point.where for point in points if len(point.at) == min(lengths))
        raise FormatError(f"{where}: has 2 coordinates, other points of the specimen have 3; correct it")
    return lengths.pop() if lengths else usual


def _ntsys(text: str, path: Path) -> Iterator[Specimen]:
    """Read a matrix of NTSYS: a line ``1 n p×k 0 DIM=k``, or ``1 p k …`` for one specimen; labels; numbers."""
    lines = [line.strip() for line in text.splitlines()]
    lines = [line for line in lines if line and line[0] not in "\"'"]
    head = re.fullmatch(
        r"1\s+(\d+)\s*(L?)B?E?\s+(\d+)\s*(L?)B?E?\s+([01])(?:\s+(\S+))??\s+DIM\s*=\s*([23])",
        lines[0] if lines else "",
        re.IGNORECASE,
    )
    if not head:
        raise FormatError(f"{path}: does not begin with a line of NTSYS, such as 1 20L 36 0 DIM=3; add it")
    rows, columns, dim, missing = int(head[1]), int(head[3]), int(head[7]), head[6] or "NA"
    n_labels = bool(head[2]) * rows, bool(head[4]) * columns
    cells = [cell for line in lines[1:] for cell in line.split()]
    if len(cells) != sum(n_labels) + rows * columns and n_labels[0]:  # a label with blanks has its own line
        labels, rest = lines[1 : rows + 1], [cell for line in lines[rows + 1 :] for cell in line.split()]
        cells = [*labels, *rest]
    if len(cells) != sum(n_labels) + rows * columns or columns % dim:
        size = f"{rows} × {columns} numbers in {dim} dimensions"
        raise FormatError(f"{path}: {len(cells)} cells after its first line, which says {size}; correct it")
    labels, numbers = cells[: n_labels[0]], cells[sum(n_labels) :]
    numbers = ["NA" if cell == missing or _is_code(cell, missing) else cell for cell in numbers]
    single = columns == dim
    names = [legible(path.stem)] if single else labels or [str(i + 1) for i in range(rows)]
    marks = labels if single else [""] * (columns // dim)
    marks = marks or [""] * rows
    width = len(numbers) // len(names)
    for i, name in enumerate(names):
        points = []
        for j, first in enumerate(range(i * width, (i + 1) * width, dim)):
            place = numbers[first : first + dim]
            where = f"{path}: landmark {j + 1} of {name}"
            points.append(_point(["NA"] * dim if "NA" in place else place, where, marks[j]))
        yield Specimen(name, points, dim)


def _is_code(cell: str, missing: str) -> bool:
    try:
        return float(cell) == float(missing)
    except ValueError:
        return False


def _morphologika(text: str, path: Path) -> Iterator[Specimen]:
    """Read specimens of morphologika from its sections in brackets: names, rawpoints and wireframe."""
    sections: dict[str, list[str]] = {}
    section: list[str] = []
    for line in map(str.strip, text.splitlines()):
        if head := re.fullmatch(r"\[([^]]*)\]", line):
            section = sections.setdefault(head[1].strip().lower().replace(" ", ""), [])
        elif line and line[0] not in "'\"":
            section.append(line)
    try:
        n, p, dim = (int(sections[title][0]) for title in ("individuals", "landmarks", "dimensions"))
        rows = sections["rawpoints"]
        links = [tuple(int(cell) - 1 for cell in line.split()) for line in sections.get("wireframe", [])]
    except (KeyError, IndexError, ValueError):
        needed = "[individuals], [landmarks], [dimensions] and [rawpoints]"
        message = f"{path}: lacks one of {needed}, which a file of morphologika has; add it"
        raise FormatError(message) from None
    names = sections.get("names") or [str(i + 1) for i in range(n)]
    if len(rows) != n * p or len(names) != n:
        counts = f"{len(names)} names and {len(rows)} points, for {n} individuals of {p} landmarks"
        raise FormatError(f"{path}: has {counts}; correct it")
    pairs = tuple((link[0], link[1]) for link in links if len(link) == 2 and {*link} <= {*range(p)})
    for i, name in enumerate(names):
        points = [
            _point(line.split(), f"{path}: landmark {j} of {name}")
            for j, line in enumerate(rows[i * p : (i + 1) * p], start=1)
        ]
        yield Specimen(name, points, _dim(points, dim, path), pairs)


def _table(text: str, path: Path) -> list[Specimen]:
    """Read specimens from a table, in rows or with a row for each landmark; [] if specimens have no names."""
    table = parse_table(text, str(path)).titled(always=True)
    specimen, label = table.column(*SPECIMEN_TITLES), table.column(*LANDMARK_TITLES)
    axes = [column for axis in "xyz" if (column := table.column(axis)) is not None]
    if None not in (table.column("x"), table.column("y")):
        if specimen is None:
            return []
        points_of: dict[str, list[MarkedPoint]] = {}
        for row in table.filled:
            name = "" if label is None else row.cell(label)
            points_of.setdefault(row.cell(specimen), []).append(_point_in(table, row, axes, name))
        return [Specimen(name, points, len(axes)) for name, points in points_of.items()]
    after, before = r"(?P<name>.+?)[ ._-]?(?P<axis>[xyz])", r"(?P<axis>[xyz])[ ._-]?(?P<name>.+)"
    matches = max(
        ([re.fullmatch(form, title, re.IGNORECASE) for title in table.titles] for form in (after, before)),
        key=lambda found: sum(map(bool, found)),
    )
    columns_of: dict[str, dict[str, int]] = {}
    for column, match in enumerate(matches):
        if match:
            columns_of.setdefault(match["name"], {})[match["axis"].lower()] = column
    columns_of = {name: columns for name, columns in columns_of.items() if len(columns) > 1}
    axes_used = [*"xyz"[: max(map(len, columns_of.values()), default=0)]]
    if bad := [name for name, columns in columns_of.items() if axes_used != sorted(columns)]:
        message = f"{path}: the landmark {bad[0]!r} lacks the column of a coordinate; write {bad[0]}_X, …"
        raise FormatError(message)
    if not columns_of:
        return []
    specimens = []
    for row in table.filled:
        points = [
            _point_in(table, row, [columns[axis] for axis in axes_used], name)
            for name, columns in columns_of.items()
        ]
        specimens.append(Specimen(row.cell(specimen or 0), points, len(axes_used)))
    return specimens


def _point_in(table: Table, row: Row, columns: Sequence[int], name: str) -> MarkedPoint:
    """Make a point of some cells of a row."""
    cells = [table.plain_number(row.cell(i)) or row.cell(i) for i in columns]
    return _point(cells, f"{table.name}:{row.line}", name)


def landmark_numbers(path: Path, columns: Sequence[str], m: int) -> IntArray:
    """Read numbers of landmarks, from 1 in tables, from 0 in the result."""
    table = read_table(path).titled(always=True)
    named = [column for title in columns if (column := table.column(title)) is not None]
    places = named if len(named) == len(columns) else range(-len(columns), 0)
    try:
        numbers = np.array([[int(row.cells[i]) - 1 for i in places] for row in table.filled], dtype=np.int64)
    except (ValueError, IndexError):
        numbers = np.array([[-1]])
    if numbers.size and not ((numbers >= 0) & (numbers < m)).all():
        message = f"{path}: give numbers of landmarks from 1 to {m} in the columns {', '.join(columns)}"
        raise FormatError(message)
    return numbers.reshape(-1, len(columns))
