"""Files of points that were marked on shapes: text, 3D Slicer and MeshLab; and where on a surface the points are."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import FormatError, LandmarkError
from isomatch._core.files import contents
from isomatch._core.tables import NO_NUMBER, NO_TEXT, Row, Table, read_table, rows_of
from isomatch._core.texts import is_whole_number, read_text
from isomatch.io import TURN, Axes, Frame

PAIRS = "write two 0-based vertex indices, of the source and of the target, or their positions x y z x y z"
POINTS = "write a 0-based vertex index or a position x y z, after a name if there is a header"
AXES = "x", "y", "z"
NAMES, VERTICES = ("name", "label", "id", "landmark"), ("vertex", "index")
CURVES = "Curve", "ClosedCurve"  # of 3D Slicer
NOWHERE = 9999.0  # or −9999, in all three coordinates of a point without a position, as of programs for morphometrics

logger = logging.getLogger(__name__)

OFF, FAR_OFF = 0.02, 0.1  # √area: a point farther from the surface is reported, and refused
# times the mean distance: points in RAS that are so much nearer than in LPS are taken to be in RAS
CLEARLY = 0.5


@dataclass(frozen=True)
class MarkedPoint:
    """One marked point: a vertex index, a position, or neither, where it was named but not placed."""

    name: str
    at: tuple[float, ...]  # positions of 3D Slicer are in LPS
    where: str  # in which file
    axes: Axes | None = None  # that a file of 3D Slicer says
    curve: str = ""  # points of one follow each other along it
    closed: bool = False
    unit: str = ""  # that a file of 3D Slicer says


def marked_pairs(path: Path) -> list[tuple[MarkedPoint, MarkedPoint]]:
    """Read pairs of points, of the source and of the target."""
    if _reader(path):
        raise FormatError(
            f"{path}: has the points of one shape only; give the file of the target's points too"
        )
    table = read_table(path).titled({"source", "target", "source_x"})
    columns = _pair_columns(table) if table.titles else None
    pairs = []
    for row in table.filled:
        half, odd = divmod(len(row.cells), 2)
        if columns is None and (odd or half not in (1, 3)):
            table.refuse(row, f"is not a landmark; {PAIRS}")
        chosen = columns or [list(range(half)), list(range(half, 2 * half))]
        a, b = (_place_in(table, row, side, PAIRS) for side in chosen)
        where = f"{path}:{row.line}"
        pairs.append((MarkedPoint("", a, where), MarkedPoint("", b, where)))
    return pairs


def _pair_columns(table: Table) -> list[list[int]]:
    axes = [[f"{side}_{axis}" for axis in AXES] for side in ("source", "target")]
    for named in ([["source"], ["target"]], axes):
        found = [[table.column(name) for name in names] for names in named]
        if all(i is not None for columns in found for i in columns):
            return [[i for i in columns if i is not None] for columns in found]
    raise FormatError(
        f"{table.name}:{table.titles_line}: the header {', '.join(table.titles)[:80]!r} has neither the columns source, "
        "target nor source_x, source_y, source_z, target_x, target_y, target_z"
    )


def marked_points(path: Path) -> list[MarkedPoint]:
    """Read points that were marked on one shape, in order; those without a position too."""
    reader = _reader(path)
    return reader(path) if reader else _text_points(path)


def _reader(path: Path) -> Callable[[Path], list[MarkedPoint]] | None:
    readers = {".json": _slicer_markups, ".fcsv": _slicer_fiducials, ".pp": _meshlab_points}
    readers |= {".pts": _editor_points, ".label": _freesurfer_label}
    return readers.get(path.suffix.lower())


def _text_points(path: Path) -> list[MarkedPoint]:
    table = read_table(path).titled({*AXES, *VERTICES})
    at = [i for axis in AXES if (i := table.column(axis)) is not None]
    vertex = table.column(*VERTICES)
    place = at if len(at) == len(AXES) else [] if vertex is None else [vertex]
    if table.titles and not place:
        told = ", ".join(table.titles)[:80]
        raise FormatError(f"{path}:{table.titles_line}: the header {told!r} has neither x, y, z nor vertex")
    columns = {each: i for each in ("curve", "closed") if (i := table.column(each)) is not None}
    name = table.column(*NAMES, *[""] * (table.titles[:1] == ("",)))
    columns |= {} if name is None else {"name": name}
    points = []
    for row in table.filled:
        chosen = place or list(range(len(row.cells)))
        if len(chosen) not in (1, 3):
            table.refuse(row, f"is not a point; {POINTS}")
        texts = {each: row.cells[i] for each, i in columns.items() if i < len(row.cells)}
        closed = texts.get("closed", "").lower() in ("1", "true", "yes")
        curve = "" if texts.get("curve", "").lower() in NO_TEXT else texts["curve"]
        placed = _place_in(table, row, chosen, POINTS, may_miss=True)
        points.append(
            MarkedPoint(texts.get("name", ""), placed, f"{path}:{row.line}", curve=curve, closed=closed)
        )
    return points


def _place_in(
    table: Table, row: Row, columns: list[int], remedy: str, may_miss: bool = False
) -> tuple[float, ...]:
    """Return the place that some cells of a row tell, see `_place`."""
    cells = [row.cells[i] if i < len(row.cells) else "?" * (not may_miss) for i in columns]
    plain = [_plain_number(table, cell, is_vertex=len(columns) == 1) for cell in cells]
    return _place(plain, [*range(len(plain))], f"{table.name}:{row.line}", row.text.strip(), remedy, may_miss)


def _plain_number(table: Table, cell: str, is_vertex: bool) -> str:
    """Return a number with a decimal point, and a whole one, of a vertex, without; other texts as they are."""
    number = table.whole(cell) if is_vertex else table.number(cell)
    return cell if number is None or not np.isfinite(number) else repr(number)


def _slicer_markups(path: Path) -> list[MarkedPoint]:
    text = contents(path)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}:{getattr(error, 'lineno', 1)}: is not JSON ({error})") from None
    points: list[MarkedPoint] = []
    try:
        for number, markup in enumerate(content["markups"], start=1):
            axes = _axes(markup.get("coordinateSystem", "LPS"))
            unit = str(markup.get("coordinateUnits") or "")
            kind = markup.get("type")
            curve = str(markup.get("name") or f"curve {number}") if kind in CURVES else ""
            if any(point.curve == curve for point in points if curve):
                curve = f"{curve} {number}"
            for i, point in enumerate(markup["controlPoints"], start=1):
                is_placed = point.get("positionStatus", "defined") == "defined"
                at = _in_lps(point["position"], axes) if is_placed else ()
                label, where = str(point.get("label", "")), f"{path}: point {i}"
                points.append(MarkedPoint(label, at, where, axes, curve, kind == CURVES[1], unit))
    except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
        raise FormatError(
            f"{path}: is no list of markups of 3D Slicer, with positions of three numbers ({error!r})"
        ) from None
    return points


def _slicer_fiducials(path: Path) -> list[MarkedPoint]:
    columns, said, points = ["id", "x", "y", "z"], "RAS", []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        where = f"{path}:{number}"
        if line.startswith("#"):
            key, _, value = line[1:].partition("=")
            if key.strip() == "CoordinateSystem":
                said = value.strip()
            elif key.strip() == "columns":
                columns = [each.strip() for each in value.split(",")]
            continue
        if not line.strip():
            continue
        row = dict(
            zip(columns, [cell for each in rows_of([(number, line)], ",", str(path)) for cell in each.cells])
        )
        try:
            axes = _axes(said)
            cells = [row[axis].strip().lower() for axis in AXES]
            at = _in_lps([None if cell in NO_NUMBER else float(cell) for cell in cells], axes)
        except (KeyError, ValueError):
            raise FormatError(
                f"{where}: {line[:80]!r} has no position in its columns {', '.join(columns)[:80]}"
            ) from None
        points.append(MarkedPoint(row.get("label") or row.get("id", ""), at, where, axes))
    return points


def _axes(said: Any) -> Axes:
    if str(said) not in ("LPS", "RAS", "0", "1"):
        raise ValueError(f"coordinate system {said!r} is neither LPS nor RAS")
    return "RAS" if str(said) in ("RAS", "0") else "LPS"


def _in_lps(position: Any, axes: Axes) -> tuple[float, ...]:
    at = np.array([np.nan if each is None else float(each) for each in position])
    if at.shape != (3,) or np.isinf(at).any():
        raise ValueError("a position has three finite numbers")
    if np.isnan(at).any() or (np.abs(at) == NOWHERE).all():
        return ()
    return tuple((TURN * at if axes == "RAS" else at).tolist())


def _meshlab_points(path: Path) -> list[MarkedPoint]:
    text = contents(path)
    try:
        root = ElementTree.fromstring(re.sub(rb"<!DOCTYPE[^>]*>", b"", text))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        line = getattr(error, "position", (1, 0))[0]
        raise FormatError(f"{path}:{line}: is not XML ({error})") from None
    points = []
    for i, point in enumerate(root.iter("point"), start=1):
        where = f"{path}: point {i}"
        cells = [point.get(axis, "") for axis in AXES]
        is_placed = point.get("active", "1") != "0"
        line = " ".join(cells)
        at = _place(cells, [0, 1, 2], where, line, "write x, y, z", may_miss=True) if is_placed else ()
        points.append(MarkedPoint(point.get("name", ""), at, where))
    return points


def _editor_points(path: Path) -> list[MarkedPoint]:
    """Read a file of Landmark Editor: a version, the number of points, and a name and a position on each line."""
    points = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        cells, where = line.split(), f"{path}:{number}"
        if cells and cells[0].lower() != "version" and len(cells) > 1:
            if len(cells) < 4:
                raise FormatError(f"{where}: {line[:80]!r} is not a name and a position; write name x y z")
            at = _place(cells[-3:], [0, 1, 2], where, line, "write name x y z", may_miss=True)
            points.append(MarkedPoint(" ".join(cells[:-3]), at, where))
    return points


def _freesurfer_label(path: Path) -> list[MarkedPoint]:
    """Read a label of FreeSurfer: a vertex on each line, or −1 and a position, after a comment and their number."""
    points = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        cells, where = line.split(), f"{path}:{number}"
        if number > 1 and len(cells) > 1 and not line.startswith("#"):
            columns = [1, 2, 3] if cells[0] == "-1" else [0]
            at = _place(cells, columns, where, line, "write vertex x y z value")
            points.append(MarkedPoint("", at, where))
    return points


def _place(
    cells: list[str], columns: list[int], where: str, line: str, remedy: str, may_miss: bool = False
) -> tuple[float, ...]:
    """Return the vertex index, or the position, in some cells; nothing of a point without a place, if it ``may_miss``."""
    chosen = [cells[column] if column < len(cells) else "" for column in columns]
    if may_miss and max(columns) < len(cells) and all(cell.lower() in NO_NUMBER for cell in chosen):
        return ()
    numbers: list[float] = []
    for cell in chosen:
        number = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?"
        if not (is_whole_number(cell) if len(chosen) == 1 else re.fullmatch(number, cell, re.ASCII)):
            raise FormatError(f"{where}: {line[:80]!r} is not a landmark; {remedy}")
        numbers.append(int(cell) if len(chosen) == 1 else float(cell))
    if not np.isfinite(numbers).all():
        raise FormatError(f"{where}: {line[:80]!r} is not finite; {remedy}")
    is_missing = may_miss and len(numbers) == 3 and all(abs(number) == NOWHERE for number in numbers)
    return () if is_missing else tuple(numbers)


def placed_positions(
    points: Sequence[MarkedPoint],
    vertices: FloatArray,
    unit: float,  # √area of the surface
    distance: Callable[[FloatArray], FloatArray],  # of positions from it
    frame: Frame | None,  # of the surface
    side: str,  # what the surface is, and
    parts: str,  # what the distance is measured to, for messages
) -> tuple[FloatArray, Axes | None]:
    """Return where points are in the coordinates of a surface, nan where they are nowhere, and the axes of these."""
    positions = np.full((len(points), 3), np.nan)
    for i, point in enumerate(points):
        if len(point.at) == 1:
            vertex = int(point.at[0])
            if not 0 <= vertex < len(vertices):
                raise LandmarkError(
                    f"{point.where}: there is no vertex {vertex}; the {side} has vertices 0…{len(vertices) - 1}"
                )
            positions[i] = vertices[vertex]
        elif point.at:
            positions[i] = point.at
    frame = frame or Frame()
    free = [i for i, point in enumerate(points) if len(point.at) == 3]
    if not free:
        return positions, frame.axes
    where, is_said = points[free[0]].where, any(points[i].axes for i in free)
    ways = _ways(positions[free], is_said, frame)
    gaps = [distance(placed) / unit for placed, _, _ in ways]
    means = [gap.mean() for gap in gaps]
    best = min(range(len(ways)), key=lambda i: (gaps[i].max() > FAR_OFF, means[i]))
    # points on the surface stay as they are said or supposed to be, unless nothing is said and others fit much better
    if gaps[0].max() <= OFF and not (is_said and means[best] < CLEARLY * means[0]):
        best = 0
    (positions[free], axes, told), gap = ways[best], gaps[best]
    if best:
        logger.warning("%s: the landmarks lie on the %s %s", where, side, told)
    elif is_said and not frame.axes and gaps[1].max() <= OFF:
        logger.warning("%s: the landmarks lie on the %s in RAS and in LPS, which is taken", where, side)
    worst = int(gap.argmax())
    if gap[worst] > OFF:
        message = f"{points[free[worst]].where}: {gap[worst]:.3g} √area away from all {parts} of the {side}"
        if gap[worst] > FAR_OFF:
            remedy = f"check that the positions are in the units and the coordinates of the {side}"
            if (distance(TURN * positions[free]) <= OFF * unit).all():
                remedy = "one of the files says the wrong space: they lie on it after half a turn"
            raise LandmarkError(f"{message}; {remedy}")
        logger.warning("%s; the nearest one is taken", message)
    return positions, axes


def _ways(positions: FloatArray, is_said: bool, frame: Frame) -> list[tuple[FloatArray, Axes | None, str]]:
    """Return where points can be meant to be, first as they are said to be: positions, axes, and how that is told."""
    # positions of 3D Slicer, which says the axes, are in LPS here, in which it also writes meshes unless they say RAS
    turned = TURN * positions
    if not is_said:
        told = "after half a turn, from RAS to LPS or back"
        return [(positions, frame.axes, ""), (turned, frame.axes, told)]
    said: tuple[tuple[FloatArray, Axes], ...] = (positions, "LPS"), (turned, "RAS")
    ways: list[tuple[FloatArray, Axes | None, str]]
    ways = [(at, axes, f"if it is in {axes}") for at, axes in said if frame.axes in (None, axes)]
    if frame.has_space and not np.array_equal(frame.matrix, np.eye(4)):
        back = np.linalg.inv(frame.matrix)
        ways.append((turned @ back[:3, :3].T + back[:3, 3], frame.axes, f"if they are in {frame.to}"))
    return ways
