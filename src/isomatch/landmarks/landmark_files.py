"""Files of points marked on shapes: text, 3D Slicer and MeshLab; and where on a surface the points are."""

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
from isomatch._core.files import read_bytes
from isomatch._core.tables import NO_NUMBER, NO_TEXT, Row, Table, read_table, split_rows
from isomatch._core.texts import is_whole_number, read_text
from isomatch.io import TURN, Axes, Frame
from isomatch.surfaces import Mesh, PointCloud

# remedies in messages: what to write on a line of a file of pairs, and on a line of a file of points
PAIRS = "write two 0-based vertex indices, of the source and of the target, or their positions x y z x y z"
POINTS = "write a 0-based vertex index or a position x y z, after a name if there is a header"
AXES = "x", "y", "z"  # titles of the columns of a table with positions
# titles of the columns with names of points, and with their vertices; the first that a file has is read
NAME_TITLES, VERTEX_TITLES = ("name", "label", "id", "landmark"), ("vertex", "index")
CURVES = "Curve", "ClosedCurve"  # types of markups of 3D Slicer
NO_PLACE = 9999.0  # programs for morphometrics write ±9999 for each coordinate of a point without a position

logger = logging.getLogger(__name__)

# √area; points farther from the surface than the first distance are reported, than the second refused; chosen
MAX_SILENT_DISTANCE, MAX_DISTANCE = 0.02, 0.1
# Points that fit in the likeliest axes are read in other axes only if their mean distance from the surface
# then falls below this fraction of what it was; chosen.
MAX_RAS_DISTANCE_RATIO = 0.5


@dataclass(frozen=True)
class MarkedPoint:
    """One marked point: a vertex index, a position, or neither, if it was named but not placed."""

    name: str
    at: tuple[float, ...]  # vertex, or position, in LPS in files of 3D Slicer; () without a place
    where: str  # the place in the file, for messages
    axes: Axes | None = None  # the axes that the file of 3D Slicer names
    curve: str = ""  # the name of the curve along which the points follow each other
    closed: bool = False
    unit: str = ""  # the unit that the file of 3D Slicer names


def marked_pairs(path: Path) -> list[tuple[MarkedPoint, MarkedPoint]]:
    """Read pairs of points, of the source and of the target."""
    if path.suffix.lower() in READERS:
        message = f"{path}: has the points of one shape only; give the file of the target's points too"
        raise FormatError(message)
    table = read_table(path).titled({"source", "target", "source_x"})
    columns = _pair_columns(table) if table.titles else None
    pairs = []
    for row in table.filled:
        half, odd = divmod(len(row.cells), 2)
        if columns is None and (odd or half not in (1, 3)):
            table.refuse(row, f"is not a landmark; {PAIRS}")
        sides = columns or [list(range(half)), list(range(half, 2 * half))]
        a, b = (_place_in_row(table, row, side, PAIRS) for side in sides)
        where = f"{path}:{row.line}"
        pairs.append((MarkedPoint("", a, where), MarkedPoint("", b, where)))
    return pairs


def _pair_columns(table: Table) -> list[list[int]]:
    sides = ("source", "target")
    for titles in ([[side] for side in sides], [[f"{side}_{axis}" for axis in AXES] for side in sides]):
        columns = [[i for name in names if (i := table.column(name)) is not None] for names in titles]
        if list(map(len, columns)) == list(map(len, titles)):
            return columns
    raise FormatError(
        f"{table.name}:{table.titles_line}: the header {', '.join(table.titles)[:80]!r} has neither the columns source, "
        "target nor source_x, source_y, source_z, target_x, target_y, target_z"
    )


def marked_points(path: Path) -> list[MarkedPoint]:
    """Read the points marked on one shape, in order, also points without a position."""
    return READERS.get(path.suffix.lower(), _text_points)(path)


def _text_points(path: Path) -> list[MarkedPoint]:
    table = read_table(path).titled({*AXES, *VERTEX_TITLES})
    axes = [i for axis in AXES if (i := table.column(axis)) is not None]
    vertex = table.column(*VERTEX_TITLES)
    place = axes if len(axes) == len(AXES) else [] if vertex is None else [vertex]
    if table.titles and not place:
        header = ", ".join(table.titles)[:80]
        raise FormatError(f"{path}:{table.titles_line}: the header {header!r} has neither x, y, z nor vertex")
    name = table.column(*NAME_TITLES, *[""] * (table.titles[:1] == ("",)))
    columns = {"name": name, "curve": table.column("curve"), "closed": table.column("closed")}
    points = []
    for row in table.filled:
        of_place = place or list(range(len(row.cells)))
        if len(of_place) not in (1, 3):
            table.refuse(row, f"is not a point; {POINTS}")
        texts = {
            title: "" if i is None or i >= len(row.cells) else row.cells[i] for title, i in columns.items()
        }
        closed = texts["closed"].lower() in ("1", "true", "yes")
        curve = "" if texts["curve"].lower() in NO_TEXT else texts["curve"]
        at = _place_in_row(table, row, of_place, POINTS, may_miss=True)
        points.append(MarkedPoint(texts["name"], at, f"{path}:{row.line}", curve=curve, closed=closed))
    return points


def _place_in_row(
    table: Table, row: Row, columns: list[int], remedy: str, may_miss: bool = False
) -> tuple[float, ...]:
    """Return the place in some cells of a row, see `_place`."""
    number_in, words = table.integer if len(columns) == 1 else table.number, []
    for i in columns:
        cell = row.cell(i) or "?" * (not may_miss)
        number = number_in(cell)
        words.append(cell if number is None or not np.isfinite(number) else repr(number))
    return _place(words, f"{table.name}:{row.line}", row.text.strip(), remedy, may_miss)


def _slicer_markups(path: Path) -> list[MarkedPoint]:
    text = read_bytes(path)
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
        message = f"{path}: is no list of markups of 3D Slicer, with positions of three numbers ({error!r})"
        raise FormatError(message) from None
    return points


def _slicer_fiducials(path: Path) -> list[MarkedPoint]:
    columns, system, points = ["id", "x", "y", "z"], "RAS", []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        where = f"{path}:{number}"
        if line.startswith("#"):
            key, _, value = line[1:].partition("=")
            if key.strip() == "CoordinateSystem":
                system = value.strip()
            elif key.strip() == "columns":
                columns = [column.strip() for column in value.split(",")]
            continue
        if not line.strip():
            continue
        rows = split_rows([(number, line)], ",", str(path))
        row = dict(zip(columns, (cell for cells in rows for cell in cells.cells)))
        try:
            axes = _axes(system)
            cells = [row[axis].strip().lower() for axis in AXES]
            at = _in_lps([None if cell in NO_NUMBER else float(cell) for cell in cells], axes)
        except (KeyError, ValueError):
            message = f"{where}: {line[:80]!r} has no position in its columns {', '.join(columns)[:80]}"
            raise FormatError(message) from None
        points.append(MarkedPoint(row.get("label") or row.get("id", ""), at, where, axes))
    return points


def _axes(system: Any) -> Axes:
    if str(system) not in ("LPS", "RAS", "0", "1"):
        raise ValueError(f"coordinate system {system!r} is neither LPS nor RAS")
    return "RAS" if str(system) in ("RAS", "0") else "LPS"


def _in_lps(position: Any, axes: Axes) -> tuple[float, ...]:
    at = np.array([np.nan if x is None else float(x) for x in position])
    if at.shape != (3,) or np.isinf(at).any():
        raise ValueError("a position has three finite numbers")
    if np.isnan(at).any() or (np.abs(at) == NO_PLACE).all():
        return ()
    return tuple((TURN * at if axes == "RAS" else at).tolist())


def _meshlab_points(path: Path) -> list[MarkedPoint]:
    text = read_bytes(path)
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
        at = _place(cells, where, " ".join(cells), "write x, y, z", may_miss=True) if is_placed else ()
        points.append(MarkedPoint(point.get("name", ""), at, where))
    return points


def _editor_points(path: Path) -> list[MarkedPoint]:
    """Read a file of Landmark Editor: version, number of points, then a name and a position per line."""
    points = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        cells, where = line.split(), f"{path}:{number}"
        if cells and cells[0].lower() != "version" and len(cells) > 1:
            if len(cells) < 4:
                raise FormatError(f"{where}: {line[:80]!r} is not a name and a position; write name x y z")
            at = _place(cells[-3:], where, line, "write name x y z", may_miss=True)
            points.append(MarkedPoint(" ".join(cells[:-3]), at, where))
    return points


def _freesurfer_label(path: Path) -> list[MarkedPoint]:
    """Read a label of FreeSurfer: comment, number, then per line a vertex, or −1 and a position."""
    points = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        cells, where = line.split(), f"{path}:{number}"
        if number > 1 and len(cells) > 1 and not line.startswith("#"):
            words = [*cells[1:4], "", ""][:3] if cells[0] == "-1" else cells[:1]
            points.append(MarkedPoint("", _place(words, where, line, "write vertex x y z value"), where))
    return points


def _place(words: list[str], where: str, line: str, remedy: str, may_miss: bool = False) -> tuple[float, ...]:
    """Return the vertex index, or the position, in one or three cells; () if it is missing and ``may_miss``."""
    if may_miss and all(word.lower() in NO_NUMBER for word in words):
        return ()
    numbers: list[float] = []
    for word in words:
        number = r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?"
        if not (is_whole_number(word) if len(words) == 1 else re.fullmatch(number, word, re.ASCII)):
            raise FormatError(f"{where}: {line[:80]!r} is not a landmark; {remedy}")
        numbers.append(int(word) if len(words) == 1 else float(word))
    if not np.isfinite(numbers).all():
        raise FormatError(f"{where}: {line[:80]!r} is not finite; {remedy}")
    is_missing = may_miss and len(numbers) == 3 and all(abs(number) == NO_PLACE for number in numbers)
    return () if is_missing else tuple(numbers)


READERS: dict[str, Callable[[Path], list[MarkedPoint]]] = {  # by suffix; files of other suffixes are tables
    ".json": _slicer_markups,
    ".fcsv": _slicer_fiducials,
    ".pp": _meshlab_points,
    ".pts": _editor_points,
    ".label": _freesurfer_label,
}


def place_points(
    points: Sequence[MarkedPoint],
    shape: Mesh | PointCloud,
    distance: Callable[[FloatArray], FloatArray],  # measures how far positions are from the surface
    frame: Frame | None,  # the frame of the coordinates of the surface
    side: str,  # the name of the surface in messages
    parts: str,  # the name of its points or vertices in messages
) -> tuple[FloatArray, Axes | None]:
    """Return positions of points in the coordinates of a surface, nan if unknown, and their axes."""
    vertices, unit = shape.vertices, float(np.sqrt(shape.area))
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
    where, has_axes = points[free[0]].where, any(points[i].axes for i in free)
    readings = _readings(positions[free], has_axes, frame)
    gaps = [distance(reading) / unit for reading, _, _ in readings]
    means = [gap.mean() for gap in gaps]
    best = min(range(len(readings)), key=lambda i: (gaps[i].max() > MAX_DISTANCE, means[i]))
    # The first reading stays if its points are on the surface, unless the file names axes and another fits
    # much better.
    is_clear = has_axes and means[best] < MAX_RAS_DISTANCE_RATIO * means[0]
    if gaps[0].max() <= MAX_SILENT_DISTANCE and not is_clear:
        best = 0
    (positions[free], axes, condition), gap = readings[best], gaps[best]
    if best:
        logger.warning("%s: the landmarks lie on the %s %s", where, side, condition)
    elif has_axes and not frame.axes and gaps[1].max() <= MAX_SILENT_DISTANCE:
        logger.warning("%s: the landmarks lie on the %s in RAS and in LPS, which is taken", where, side)
    worst = int(gap.argmax())
    if gap[worst] > MAX_SILENT_DISTANCE:
        message = f"{points[free[worst]].where}: {gap[worst]:.3g} √area away from all {parts} of the {side}"
        if gap[worst] > MAX_DISTANCE:
            remedy = f"check that the positions are in the units and the coordinates of the {side}"
            if (distance(TURN * positions[free]) <= MAX_SILENT_DISTANCE * unit).all():
                remedy = "one of the files says the wrong space: they lie on it after half a turn"
            raise LandmarkError(f"{message}; {remedy}")
        logger.warning("%s; the nearest one is taken", message)
    return positions, axes


def _readings(
    positions: FloatArray, has_axes: bool, frame: Frame
) -> list[tuple[FloatArray, Axes | None, str]]:
    """Return what positions may mean, the most likely first: positions, axes, and the condition in words."""
    # Positions with axes are in LPS here. Meshes of 3D Slicer are in LPS, too, unless they name RAS.
    turned = TURN * positions
    if not has_axes:
        after_turn = "after half a turn, from RAS to LPS or back"
        return [(positions, frame.axes, ""), (turned, frame.axes, after_turn)]
    both: tuple[tuple[FloatArray, Axes], ...] = (positions, "LPS"), (turned, "RAS")
    readings: list[tuple[FloatArray, Axes | None, str]]
    readings = [(places, axes, f"if it is in {axes}") for places, axes in both if frame.axes in (None, axes)]
    if frame.has_space and not np.array_equal(frame.matrix, np.eye(4)):
        back = np.linalg.inv(frame.matrix)
        readings.append((turned @ back[:3, :3].T + back[:3, 3], frame.axes, f"if they are in {frame.to}"))
    return readings
