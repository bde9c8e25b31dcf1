"""Marked points on their surface: the nearest point of all triangles, and the coordinates that 3D Slicer means."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from isomatch.errors import LandmarkError
from isomatch.landmarks.landmark_files import SLICER, MarkedPoint, System
from isomatch.loading.compiled import compiled
from isomatch.surfaces import Mesh, PointCloud, PrecisePoints, nearest_in_triangle
from isomatch.values.arrays import FloatArray, IntArray, read_only

logger = logging.getLogger(__name__)

OFF = 0.02  # √area: a point farther from the surface than this is reported
FAR_OFF = 0.1  # √area: and than this, refused
AT_ONCE = 1000  # points whose triangles are listed together


def nearest_on_surface(surface: Mesh | PointCloud, positions: FloatArray) -> PrecisePoints:
    """Find the point of a surface nearest to each position, of all triangles; of points, the nearest one.

    Parameters
    ----------
    surface : Mesh or PointCloud
        With n vertices.
    positions : (m, 3) array of float
        All finite.

    Returns
    -------
    PrecisePoints
        m points.

    Notes
    -----
    Only triangles that reach into the ball up to the nearest point so far are looked at, those of about one size
    together: a few of each size for each position.

    Examples
    --------
    >>> strip = Mesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [4, -1, 0]], [[0, 1, 2], [0, 3, 1]])
    >>> nearest_on_surface(strip, np.array([[4.5, 0.5, 2.0]])).interpolated(strip.vertices)
    array([[4.5, 0.5, 0. ]])
    """
    if isinstance(surface, PointCloud) or not surface.n_faces:
        return PrecisePoints.at_vertices(cKDTree(surface.vertices).query(positions)[1])
    used = np.unique(surface.sound_faces)
    gap, nearest = cKDTree(surface.vertices[used]).query(positions)
    found = PrecisePoints.at_vertices(used[nearest])
    corners = surface.vertices[surface.sound_faces]  # (f, 3, 3)
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    size = np.frexp(reach)[1]  # of a factor of two each, so that one large triangle does not widen all balls
    vertices, faces, queries = map(read_only, (surface.vertices, surface.faces, positions))
    for each in np.unique(size)[::-1]:
        alike = np.flatnonzero(size == each)
        tree, farthest = cKDTree(middles[alike]), reach[alike].max()
        for first in range(0, len(positions), AT_ONCE):
            rows = slice(first, first + AT_ONCE)
            near = tree.query_ball_point(positions[rows], (gap[rows] + farthest) * (1 + 1e-12))
            of = np.repeat(np.arange(first, first + len(near)), list(map(len, near)))
            listed = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.asarray, near)]).astype(np.int64)
            face = alike[listed]
            apart = np.linalg.norm(middles[face] - positions[of], axis=1)
            reached = apart <= (gap[of] + reach[face]) * (1 + 1e-12)
            _take_nearest(vertices, faces, queries, of[reached], face[reached], gap, *found)
    return found


@compiled(error_model="numpy")
def _take_nearest(
    vertices: FloatArray,
    faces: IntArray,
    queries: FloatArray,
    of: IntArray,
    face: IntArray,
    apart: FloatArray,
    corners: IntArray,
    barycentric: FloatArray,
) -> None:
    """Let the point of a triangle take the row of the query that it is listed with, where it is nearer."""
    for k in range(len(of)):
        i = of[k]
        a, b, c = faces[face[k]]
        u, v, p = vertices[b] - vertices[a], vertices[c] - vertices[a], queries[i] - vertices[a]
        s, t, _ = nearest_in_triangle(
            (u * u).sum(), (u * v).sum(), (v * v).sum(), (u * p).sum(), (v * p).sum()
        )
        gap = np.sqrt(((s * u + t * v - p) ** 2).sum())
        if gap < apart[i]:
            apart[i] = gap
            corners[i] = faces[face[k]]
            barycentric[i] = 1.0 - s - t, s, t


def placed_positions(
    points: Sequence[MarkedPoint],
    vertices: FloatArray,
    unit: float,
    distance: Callable[[FloatArray], FloatArray],
    side: str,
    parts: str,
) -> tuple[FloatArray, System]:
    """Return where points are in the coordinates of a surface, nan where they are nowhere, and which those are.

    Positions of 3D Slicer are taken in LPS, in which it writes meshes, or in RAS if only so they lie on the surface.

    Parameters
    ----------
    points : sequence of MarkedPoint
        m points.
    vertices : (n, 3) array of float
        Of the surface.
    unit : float
        Its √area.
    distance : callable
        Distance of positions from it.
    side, parts : str
        What the surface is, and what the distance is measured to, for messages.

    Raises
    ------
    LandmarkError
        If a vertex does not exist, or a position is farther than 0.1 √area from the surface.
    """
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
    system: System = "LPS"
    free = [i for i, point in enumerate(points) if len(point.at) == 3]
    if not free:
        return positions, system
    gap = distance(positions[free])
    if any(points[i].system for i in free):
        turned = distance(SLICER * positions[free])
        if turned.mean() < 0.5 * gap.mean():
            gap, system = turned, "RAS"
            positions[free] *= SLICER
            logger.warning("%s: the landmarks lie on the %s if it is in RAS", points[free[0]].where, side)
    gap = gap / unit
    worst = int(gap.argmax())
    if gap[worst] > OFF:
        message = f"{points[free[worst]].where}: {gap[worst]:.3g} √area away from all {parts} of the {side}"
        if gap[worst] > FAR_OFF:
            raise LandmarkError(
                f"{message}; check that the positions are in the units and the coordinates of the {side}"
            )
        logger.warning("%s; the nearest one is taken", message)
    return positions, system
