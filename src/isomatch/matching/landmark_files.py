"""Landmarks from files: pairs of vertices or of positions, or the points that were marked on each shape."""

from __future__ import annotations

import csv
import json
import logging
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from isomatch._arrays import IntArray, numbers_of
from isomatch._files import is_whole_number, opened, text_lines
from isomatch.assets import SurfaceLike, surface_from
from isomatch.errors import FormatError, LandmarkError
from isomatch.surfaces import Graph

logger = logging.getLogger(__name__)

OFF = 0.02  # √area: a point farther from all vertices than this is reported
FAR_OFF = 0.1  # √area: and than this, refused
PAIRS = "write two 0-based vertex indices, of the source and of the target, or their positions x y z x y z"
POINTS = "write a 0-based vertex index or a position x y z, after a name if there is a header"
AXES = "x", "y", "z"
NAMES, VERTICES = ("name", "label", "id"), ("vertex", "index")
SLICER = np.array([-1.0, -1.0, 1.0])  # from RAS to LPS and back


@dataclass(frozen=True)
class _Point:
    """One marked point: a vertex index, or a position."""

    name: str
    at: tuple[float, ...]
    where: str
    slicer: bool = False


def read_landmarks(
    path: str | PathLike[str],
    source: SurfaceLike,
    target: SurfaceLike,
    target_path: str | PathLike[str] | None = None,
) -> IntArray:
    r"""Read landmarks from a file of pairs, or from one file of points for each shape.

    Parameters
    ----------
    path : path
        Pairs as text: two vertex indices on each line, or two positions, separated by commas or blanks; or a table whose
        header has the columns ``source`` and ``target``, or ``source_x`` … ``target_z``. With ``target_path``, points
        marked on the source.
    source, target : Mesh, PointCloud, Graph, path_like, tuple or object
        The shapes, as for `match`.
    target_path : path, optional
        Points marked on the target. Points of the two files are joined by name if they share any, otherwise in order.
        They may be files of 3D Slicer (``.mrk.json``, ``.fcsv``) or of MeshLab (``.pp``), or text: one index or position
        on each line, or a table whose header has ``x``, ``y``, ``z`` or ``vertex``, and ``name`` if there are names.

    Returns
    -------
    (m, 2) array of int
        Rows (source vertex, target vertex).

    Raises
    ------
    FormatError
        If a file cannot be read.
    LandmarkError
        If there are none, or a position is farther than 0.1 √area from all vertices.

    Notes
    -----
    A position stands for the nearest vertex. Positions of 3D Slicer are taken in LPS, in which it writes meshes, or in
    RAS if only so they lie on the shape.

    Examples
    --------
    >>> import tempfile
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "landmarks.csv"
    ...     _ = file.write_text("name,source,target\nnose,0,2\ntail,3,1\n")
    ...     read_landmarks(file, square, square)
    array([[0, 2],
           [3, 1]])
    """
    first = Path(path)
    if target_path is None:
        pairs = _pairs(first)
        here, there = [a for a, _ in pairs], [b for _, b in pairs]
    else:
        here, there = _joined(_points(first), _points(Path(target_path)), f"{first} and {target_path}")
    if not here:
        raise LandmarkError(f"{first}: no landmarks; {PAIRS if target_path is None else POINTS}")
    return np.column_stack([_vertices(here, source, "source"), _vertices(there, target, "target")])


def nearest_landmarks(
    source: SurfaceLike, target: SurfaceLike, source_points: ArrayLike, target_points: ArrayLike
) -> IntArray:
    """Take the vertices nearest to positions as landmarks.

    Parameters
    ----------
    source, target : Mesh, PointCloud, path_like, tuple or object
        The shapes, as for `match`.
    source_points, target_points : (m, 3) array_likes
        Positions in the coordinates of each shape.

    Returns
    -------
    (m, 2) array of int
        Rows (source vertex, target vertex).

    Raises
    ------
    LandmarkError
        If the positions do not fit, or one is farther than 0.1 √area from all vertices.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> nearest_landmarks(square, square, [[0.01, 0, 0]], [[1, 1.01, 0]])
    array([[0, 2]])
    """
    sides = []
    for side, points in (("source", source_points), ("target", target_points)):
        given = numbers_of(points, f"{side} landmarks", LandmarkError)
        if given.ndim != 2 or given.shape[1] != 3:
            raise LandmarkError(f"{side} landmarks have shape {given.shape}; expected (m, 3) positions")
        sides.append([_Point("", tuple(row), f"landmark {i}") for i, row in enumerate(given.tolist())])
    if len(sides[0]) != len(sides[1]):
        raise LandmarkError(f"{len(sides[0])} source and {len(sides[1])} target landmarks; give as many")
    return np.column_stack([_vertices(sides[0], source, "source"), _vertices(sides[1], target, "target")])


def _vertices(points: list[_Point], given: SurfaceLike, side: str) -> IntArray:
    """Vertex (m,) of each point: the nearest one to a position."""
    placed = [i for i, point in enumerate(points) if len(point.at) == 3]
    vertices = np.array([point.at[0] for point in points]).astype(np.int64)
    if not placed:
        return vertices
    surface = surface_from(given)
    if isinstance(surface, Graph):
        raise LandmarkError(f"the {side} is a graph, without positions; give vertex indices as landmarks")
    positions, tree = np.array([points[i].at for i in placed]), cKDTree(surface.vertices)
    gap, nearest = tree.query(positions)
    if any(points[i].slicer for i in placed):
        turned = tree.query(SLICER * positions)
        if turned[0].mean() < 0.5 * gap.mean():
            gap, nearest = turned
            logger.warning("%s: the landmarks lie on the %s if it is in RAS", points[0].where, side)
    gap = gap / np.sqrt(surface.area)
    worst = int(gap.argmax())
    if gap[worst] > OFF:
        point = points[placed[worst]]
        message = f"{point.where}: {gap[worst]:.3g} √area away from all vertices of the {side}"
        if gap[worst] > FAR_OFF:
            raise LandmarkError(
                f"{message}; check that the positions are in the units and the coordinates of the {side}"
            )
        logger.warning("%s; the nearest one is taken", message)
    vertices[placed] = nearest
    return vertices


def _joined(here: list[_Point], there: list[_Point], files: str) -> tuple[list[_Point], list[_Point]]:
    """Join points by name, if any name is shared, or else in order."""
    named = [{point.name: point for point in points if point.name} for points in (here, there)]
    shared = [name for name in named[0] if name in named[1]]
    if not shared:
        if len(here) != len(there):
            raise LandmarkError(
                f"{files}: {len(here)} and {len(there)} points that share no names; give as many in the same order, or "
                "equal names to those that belong together"
            )
        return here, there
    for points, by_name in zip((here, there), named):
        if len(by_name) < len(points):
            raise LandmarkError(
                f"{files}: several points have one name, or none; give each a name of its own"
            )
    alone = len(here) + len(there) - 2 * len(shared)
    if alone:
        logger.warning("%s: %d points without a partner of their name are left out", files, alone)
    return [named[0][name] for name in shared], [named[1][name] for name in shared]


def _pairs(path: Path) -> list[tuple[_Point, _Point]]:
    if _reader(path):
        raise FormatError(
            f"{path}: has the points of one shape only; give the file of the target's points too"
        )
    columns: list[list[int]] | None = None
    pairs = []
    for where, cells, line in _cells(path):
        if columns is None and _is_header(cells):
            columns = _pair_columns([cell.lower() for cell in cells], where)
            continue
        if columns is None and len(cells) not in (2, 6):
            raise FormatError(f"{where}: {line[:80]!r} is not a landmark; {PAIRS}")
        half = len(cells) // 2
        chosen = columns or [list(range(half)), list(range(half, 2 * half))]
        a, b = (_place(cells, side, where, line, PAIRS) for side in chosen)
        pairs.append((_Point("", a, where), _Point("", b, where)))
    return pairs


def _pair_columns(header: list[str], where: str) -> list[list[int]]:
    for found in (
        [[side] for side in ("source", "target")],
        [[f"{side}_{axis}" for axis in AXES] for side in ("source", "target")],
    ):
        if all(name in header for names in found for name in names):
            return [[header.index(name) for name in names] for names in found]
    raise FormatError(
        f"{where}: the header {', '.join(header)[:80]!r} has neither the columns source, target nor source_x, source_y, "
        "source_z, target_x, target_y, target_z"
    )


def _points(path: Path) -> list[_Point]:
    """Read points that were marked on one shape."""
    reader = _reader(path)
    return reader(path) if reader else _text_points(path)


def _reader(path: Path) -> Callable[[Path], list[_Point]] | None:
    readers = {".json": _slicer_markups, ".fcsv": _slicer_fiducials, ".pp": _meshlab_points}
    return readers.get(path.suffix.lower())


def _text_points(path: Path) -> list[_Point]:
    points = []
    place: list[int] | None = None
    name: int | None = None
    for where, cells, line in _cells(path):
        if place is None and _is_header(cells):
            header = [cell.lower() for cell in cells]
            name = next((header.index(each) for each in NAMES if each in header), None)
            vertex = [header.index(each) for each in VERTICES if each in header]
            place = [header.index(each) for each in AXES if each in header]
            if len(place) != 3:
                place = vertex[:1]
            if not place:
                raise FormatError(f"{where}: the header {line[:80]!r} has neither x, y, z nor vertex")
            continue
        chosen = list(range(len(cells))) if place is None else place
        if len(chosen) not in (1, 3):
            raise FormatError(f"{where}: {line[:80]!r} is not a point; {POINTS}")
        at = _place(cells, chosen, where, line, POINTS)
        points.append(_Point(cells[name] if name is not None and name < len(cells) else "", at, where))
    return points


def _slicer_markups(path: Path) -> list[_Point]:
    with opened(path) as file:
        text = file.read()
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}:{getattr(error, 'lineno', 1)}: is not JSON ({error})") from None
    points = []
    try:
        for markup in content["markups"]:
            system = markup.get("coordinateSystem", "LPS")
            for i, point in enumerate(markup["controlPoints"], start=1):
                if point.get("positionStatus", "defined") == "defined":
                    at = _in_lps(point["position"], system)
                    points.append(_Point(str(point.get("label", "")), at, f"{path}: point {i}", slicer=True))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise FormatError(
            f"{path}: is no list of markups of 3D Slicer, with positions of three numbers ({error!r})"
        ) from None
    return points


def _slicer_fiducials(path: Path) -> list[_Point]:
    columns, system, points = ["id", "x", "y", "z"], "RAS", []
    with opened(path) as file:
        lines = file.read().decode("utf-8-sig", errors="replace").splitlines()
    for number, line in enumerate(lines, start=1):
        where = f"{path}:{number}"
        if line.startswith("#"):
            key, _, value = line[1:].partition("=")
            if key.strip() == "CoordinateSystem":
                system = value.strip()
            elif key.strip() == "columns":
                columns = [each.strip() for each in value.split(",")]
            continue
        if not line.strip():
            continue
        row = dict(zip(columns, _split(line, where)))
        try:
            at = _in_lps([float(row[axis]) for axis in AXES], system)
        except (KeyError, ValueError):
            raise FormatError(
                f"{where}: {line[:80]!r} has no position in its columns {', '.join(columns)[:80]}"
            ) from None
        points.append(_Point(row.get("label") or row.get("id", ""), at, where, slicer=True))
    return points


def _in_lps(position: Any, system: Any) -> tuple[float, ...]:
    at = np.array([float(each) for each in position])
    if at.shape != (3,) or not np.isfinite(at).all():
        raise ValueError("a position has three finite numbers")
    if str(system) not in ("LPS", "RAS", "0", "1"):
        raise ValueError(f"coordinate system {system!r} is neither LPS nor RAS")
    return tuple((SLICER * at if str(system) in ("RAS", "0") else at).tolist())


def _meshlab_points(path: Path) -> list[_Point]:
    with opened(path) as file:
        text = file.read()
    try:
        root = ElementTree.fromstring(re.sub(rb"<!DOCTYPE[^>]*>", b"", text))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        line = getattr(error, "position", (1, 0))[0]
        raise FormatError(f"{path}:{line}: is not XML ({error})") from None
    points = []
    for i, point in enumerate(root.iter("point"), start=1):
        if point.get("active", "1") == "0":
            continue
        where = f"{path}: point {i}"
        cells = [point.get(axis, "") for axis in AXES]
        points.append(
            _Point(
                point.get("name", ""),
                _place(cells, [0, 1, 2], where, " ".join(cells), "write x, y, z"),
                where,
            )
        )
    return points


def _cells(path: Path) -> Iterator[tuple[str, list[str], str]]:
    """Cells of each line of a text, with where it is and the line itself."""
    for number, line in text_lines(path):
        where = f"{path}:{number}"
        yield where, _split(line, where), line


def _split(line: str, where: str) -> list[str]:
    separator = next((each for each in "\t;," if each in line), None)
    if separator is None:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    except csv.Error as error:
        raise FormatError(f"{where}: {error}") from None


def _is_header(cells: list[str]) -> bool:
    """Tell whether a line names columns: no cell begins like a number."""
    return all(re.match(r"[A-Za-z_]", cell) for cell in cells)


def _place(cells: list[str], columns: list[int], where: str, line: str, remedy: str) -> tuple[float, ...]:
    """Return the vertex index, or the position, in some cells."""
    chosen = [cells[column] if column < len(cells) else "" for column in columns]
    numbers: list[float] = []
    for cell in chosen:
        number = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?"
        if not (is_whole_number(cell) if len(chosen) == 1 else re.fullmatch(number, cell, re.ASCII)):
            raise FormatError(f"{where}: {line[:80]!r} is not a landmark; {remedy}")
        numbers.append(int(cell) if len(chosen) == 1 else float(cell))
    if not np.isfinite(numbers).all():
        raise FormatError(f"{where}: {line[:80]!r} is not finite; {remedy}")
    return tuple(numbers)
