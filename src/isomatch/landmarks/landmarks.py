"""Landmarks from files and positions: the vertices nearest to points that were marked on each shape."""

from __future__ import annotations

import logging
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from isomatch.assets import SurfaceLike, surface_from
from isomatch.errors import LandmarkError
from isomatch.landmarks.landmark_files import (
    PAIRS,
    POINTS,
    MarkedPoint,
    marked_pairs,
    marked_points,
)
from isomatch.landmarks.placing import placed_positions
from isomatch.surfaces import Graph
from isomatch.values.arrays import IntArray, numbers_of

logger = logging.getLogger(__name__)


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
        pairs = marked_pairs(first)
        here, there = [a for a, _ in pairs], [b for _, b in pairs]
    else:
        here, there = (
            [point for point in marked_points(file) if point.at] for file in (first, Path(target_path))
        )
        here, there = _joined(here, there, f"{first} and {target_path}")
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
        if not np.isfinite(given).all():
            first = int(np.argmin(np.isfinite(given).all(axis=1)))
            raise LandmarkError(
                f"{side} landmark {first} is not finite; give a position for each, or leave out the pair"
            )
        sides.append([MarkedPoint("", tuple(row), f"landmark {i}") for i, row in enumerate(given.tolist())])
    if len(sides[0]) != len(sides[1]):
        raise LandmarkError(f"{len(sides[0])} source and {len(sides[1])} target landmarks; give as many")
    return np.column_stack([_vertices(sides[0], source, "source"), _vertices(sides[1], target, "target")])


def _vertices(points: list[MarkedPoint], given: SurfaceLike, side: str) -> IntArray:
    """Vertex (m,) of each point: the nearest one to a position."""
    placed = [i for i, point in enumerate(points) if len(point.at) == 3]
    vertices = np.array([int(point.at[0]) if len(point.at) == 1 else -1 for point in points], dtype=np.int64)
    if not placed:
        return vertices
    surface = surface_from(given)
    if isinstance(surface, Graph):
        raise LandmarkError(f"the {side} is a graph, without positions; give vertex indices as landmarks")
    tree = cKDTree(surface.vertices)
    positions, _ = placed_positions(
        [points[i] for i in placed],
        surface.vertices,
        np.sqrt(surface.area),
        lambda x: np.asarray(tree.query(x)[0]),
        side,
        "vertices",
    )
    vertices[placed] = tree.query(positions)[1]
    return vertices


def _joined(
    here: list[MarkedPoint], there: list[MarkedPoint], files: str
) -> tuple[list[MarkedPoint], list[MarkedPoint]]:
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
