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
from isomatch._core.tables import NO_NUMBER, table_of
from isomatch._core.texts import read_text
from isomatch.landmarks.landmark_files import NOWHERE, MarkedPoint, marked_points

SPECIMEN = ("specimen", "individual", "subject", "shape")  # columns of long tables
LANDMARK = ("landmark", "point", "label", "name")
SEVERAL = ".tps", ".nts", ".dta", ".txt", ".csv", ".tsv"  # files of any number of specimens


class Read(NamedTuple):
    """What a file says of one specimen."""

    name: str
    points: list[MarkedPoint]
    dim: int
    links: tuple[tuple[int, int], ...] = ()  # of a wireframe


def specimen_points(path: Path) -> tuple[list[MarkedPoint], int]:
    """Read the points of one specimen, and how many coordinates they have."""
    found = list(specimens_in(path))
    if len(found) > 1:
        told = f"has the landmarks of {len(found)} specimens, {', '.join(each.name for each in found)[:80]}"
        raise FormatError(f"{path}: {told}; give a file of one")
    return (found[0].points, found[0].dim) if found else ([], 3)


def specimens_in(path: Path) -> Iterator[Read]:
    """Read the specimens of a file, by its suffix."""
    suffix, name = path.suffix.lower(), legible(path.name).split(".")[0]
    text = read_text(path) if suffix in SEVERAL else ""
    if suffix == ".tps":
        yield from _tps(text, path)
    elif suffix in (".nts", ".dta"):
        yield from _ntsys(text, path)
    elif re.match(r"\s*\[", text):
        yield from _morphologika(text, path)
    elif suffix in SEVERAL and (table := _table(text, path)):
        yield from table
    else:
        yield Read(name, marked_points(path), 3)


def _point(
    cells: Sequence[str], where: str, name: str = "", curve: str = "", scale: float = 1.0
) -> MarkedPoint:
    """Make a point of cells with numbers, or of words that say that it has no place."""
    if all(cell.lower() in NO_NUMBER for cell in cells):
        return MarkedPoint(name, (), where, curve=curve)
    try:
        at = tuple(float(cell) for cell in cells)
    except ValueError:
        at = ()
    if len(at) not in (2, 3) or not np.isfinite(at).all():
        raise FormatError(
            f"{where}: {' '.join(cells)[:80]!r} is no position; write 2 or 3 numbers, or NA for none"
        )
    at = () if all(abs(x) == NOWHERE for x in at) else tuple(x * scale for x in at)
    return MarkedPoint(name, at, where, curve=curve)


def _tps(text: str, path: Path) -> Iterator[Read]:
    """Read specimens of TPS: LM= or LM3= and points, CURVES= with POINTS= of each, ID=, IMAGE=, SCALE=."""
    blocks: list[list[tuple[int, str]]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if re.match(r"\s*LM3?\s*=", line, re.IGNORECASE):
            blocks.append([])
        if blocks and line.strip():
            blocks[-1].append((number, line.strip()))
    told = [
        {
            key.strip().upper(): value.strip()
            for _, line in block
            for key, eq, value in [line.partition("=")]
            if eq
        }
        for block in blocks
    ]
    ids = [each.get("ID", "") for each in told]
    images = [re.sub(r"\.\w{3,4}$", "", re.split(r"[\\/]", each.get("IMAGE", ""))[-1]) for each in told]
    named = ids if len(set(ids)) == len(ids) or len(set(images)) < len(ids) else images
    for i, (block, keys) in enumerate(zip(blocks, told)):
        try:
            scale = float(keys.get("SCALE", "1").replace(",", "."))
        except ValueError:
            raise FormatError(
                f"{path}:{block[0][0]}: SCALE={keys['SCALE']!r} is no number; correct it"
            ) from None
        points, wanted, kind, n_curves = list[MarkedPoint](), 0, "", 0
        for number, line in block:
            key, eq, value = (part.strip().upper() for part in line.partition("="))
            if eq:
                if key in ("LM", "LM3", "POINTS", "CURVES", "OUTLINES"):
                    if not value.isdecimal():
                        raise FormatError(
                            f"{path}:{number}: {line[:80]!r} gives no count; write {key}=NUMBER"
                        )
                    kind = "" if key.startswith("LM") else kind if key == "POINTS" else key
                    wanted += 0 if key in ("CURVES", "OUTLINES") or kind == "OUTLINES" else int(value)
                    n_curves += key == "POINTS" and kind == "CURVES"
            elif kind != "OUTLINES":
                curve = f"curve {n_curves}" if kind else ""
                points.append(_point(line.split(), f"{path}:{number}", curve=curve, scale=scale))
        if len(points) != wanted:
            problem = f"the specimen that begins here has {len(points)} points, and says {wanted}"
            raise FormatError(f"{path}:{block[0][0]}: {problem}; correct its counts or its points")
        yield Read(named[i] or images[i] or str(i + 1), points, _dim(points, 3 if "LM3" in keys else 2, path))


def _dim(points: Sequence[MarkedPoint], usual: int, path: Path) -> int:
    lengths = {len(point.at) for point in points if point.at}
    if len(lengths) > 1:
        where = next(point.where for point in points if len(point.at) == min(lengths))
        raise FormatError(f"{where}: has 2 coordinates, other points of the specimen have 3; correct it")
    return lengths.pop() if lengths else usual


def _ntsys(text: str, path: Path) -> Iterator[Read]:
    """Read a matrix of NTSYS: a line ``1 n p×k 0 DIM=k``, or ``1 p k …`` of one specimen, labels, and the numbers."""
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
    if len(cells) != sum(n_labels) + rows * columns and n_labels[0]:  # labels with blanks, one on a line
        labels, rest = lines[1 : rows + 1], [cell for line in lines[rows + 1 :] for cell in line.split()]
        cells = [*labels, *rest]
    if len(cells) != sum(n_labels) + rows * columns or columns % dim:
        told = f"{len(cells)} cells after its first line, which says {rows} × {columns} numbers in {dim} dimensions"
        raise FormatError(f"{path}: {told}; correct it")
    labels, numbers = cells[: n_labels[0]], cells[sum(n_labels) :]
    numbers = ["NA" if cell == missing or _is_code(cell, missing) else cell for cell in numbers]
    single = columns == dim
    names = [legible(path.stem)] if single else labels or [str(i + 1) for i in range(rows)]
    marks = labels if single else [""] * (columns // dim)
    marks = marks or [""] * rows
    width = len(numbers) // len(names)
    for i, name in enumerate(names):
        own = numbers[i * width : (i + 1) * width]
        points = [
            _point(["NA"] * dim if "NA" in at else at, f"{path}: landmark {j + 1} of {name}", marks[j])
            for j in range(width // dim)
            if (at := own[j * dim : (j + 1) * dim])
        ]
        yield Read(name, points, dim)


def _is_code(cell: str, missing: str) -> bool:
    try:
        return float(cell) == float(missing)
    except ValueError:
        return False


def _morphologika(text: str, path: Path) -> Iterator[Read]:
    """Read specimens of morphologika: sections in brackets, of which names, rawpoints and wireframe are used."""
    sections: dict[str, list[str]] = {}
    own: list[str] = []
    for line in map(str.strip, text.splitlines()):
        if head := re.fullmatch(r"\[([^]]*)\]", line):
            own = sections.setdefault(head[1].strip().lower().replace(" ", ""), [])
        elif line and line[0] not in "'\"":
            own.append(line)
    try:
        n, p, dim = (int(sections[each][0]) for each in ("individuals", "landmarks", "dimensions"))
        rows = sections["rawpoints"]
        links = [tuple(int(cell) - 1 for cell in line.split()) for line in sections.get("wireframe", [])]
    except (KeyError, IndexError, ValueError):
        lack = "[individuals], [landmarks], [dimensions] and [rawpoints]"
        raise FormatError(f"{path}: lacks one of {lack}, which a file of morphologika has; add it") from None
    names = sections.get("names") or [str(i + 1) for i in range(n)]
    if len(rows) != n * p or len(names) != n:
        told = f"{len(names)} names and {len(rows)} points, for {n} individuals of {p} landmarks"
        raise FormatError(f"{path}: has {told}; correct it")
    pairs = tuple((link[0], link[1]) for link in links if len(link) == 2 and {*link} <= {*range(p)})
    for i, name in enumerate(names):
        where = f"{path}: landmark {{}} of {name}"
        own_rows = rows[i * p : (i + 1) * p]
        points = [_point(line.split(), where.format(j + 1)) for j, line in enumerate(own_rows)]
        yield Read(name, points, _dim(points, dim, path), pairs)


def rows_of(text: str, path: Path) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """Split a table into its header and its rows, with where each is; numbers have points for decimals."""
    table = table_of(text, str(path)).titled(always=True)
    rows = []
    for row in table.filled:
        numbers = [table.number(cell) for cell in row.cells]
        cells = [
            cell if x is None or x != x else cell.replace(",", ".") for cell, x in zip(row.cells, numbers)
        ]
        rows.append((f"{path}:{row.line}", cells))
    return [*table.titles], rows


def _table(text: str, path: Path) -> list[Read]:
    """Read specimens of a table, in rows or with a row for each landmark; none if it has no names of specimens."""
    head, rows = rows_of(text, path)
    lower = [cell.lower() for cell in head]
    specimen = next((lower.index(each) for each in SPECIMEN if each in lower), None)
    if {"x", "y"} <= {*lower}:
        if specimen is None:
            return []
        axes = [lower.index(axis) for axis in "xyz" if axis in lower]
        label = next(
            (lower.index(each) for each in LANDMARK if each in lower and lower.index(each) != specimen), None
        )
        of: dict[str, list[MarkedPoint]] = {}
        for where, row in rows:
            cells = [*row, *[""] * (len(head) - len(row))]
            name = "" if label is None else cells[label]
            of.setdefault(cells[specimen], []).append(_point([cells[i] for i in axes], where, name))
        return [Read(name, points, len(axes)) for name, points in of.items()]
    after, before = r"(?P<of>.+?)[ ._-]?(?P<axis>[xyz])", r"(?P<axis>[xyz])[ ._-]?(?P<of>.+)"
    parts = max(
        ([re.fullmatch(form, c, re.IGNORECASE) for c in head] for form in (after, before)),
        key=lambda found: sum(map(bool, found)),
    )
    places: dict[str, dict[str, int]] = {}
    for column, part in enumerate(parts):
        if part:
            places.setdefault(part["of"], {})[part["axis"].lower()] = column
    places = {name: own for name, own in places.items() if len(own) > 1}
    dim = max((len(own) for own in places.values()), default=0)
    if not places:
        return []
    if bad := [name for name, own in places.items() if [*"xyz"[:dim]] != sorted(own)]:
        raise FormatError(
            f"{path}: the landmark {bad[0]!r} lacks the column of a coordinate; write {bad[0]}_X, …"
        )
    specimen = specimen or 0
    found = []
    for where, row in rows:
        cells = [*row, *[""] * (len(head) - len(row))]
        points = [
            _point([cells[own[axis]] for axis in "xyz"[:dim]], where, name) for name, own in places.items()
        ]
        found.append(Read(cells[specimen], points, dim))
    return found


def landmark_numbers(path: Path, columns: Sequence[str], m: int) -> IntArray:
    """Read rows of landmarks, counted from 1 in tables, from 0 here."""
    head, rows = rows_of(read_text(path), path)
    lower = [cell.lower() for cell in head]
    at = [lower.index(each) for each in columns] if {*columns} <= {*lower} else range(-len(columns), 0)
    try:
        numbers = np.array([[int(row[i]) - 1 for i in at] for _, row in rows], dtype=np.int64)
    except (ValueError, IndexError):
        numbers = np.array([[-1]])
    if numbers.size and not ((numbers >= 0) & (numbers < m)).all():
        raise FormatError(
            f"{path}: give numbers of landmarks from 1 to {m} in the columns {', '.join(columns)}"
        )
    return numbers.reshape(-1, len(columns))
