"""Places on a surface: points spread on it, curves drawn through a few points, equal distances along them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import LandmarkError
from isomatch._core.settings import generator
from isomatch.geodesics import euclidean_farthest_points
from isomatch.surfaces import Mesh, PointCloud, PrecisePoints, nearest_on_surface, vertex_normals

MAX_STEP_EDGES = 0.5  # mean edge lengths; longest step of a curve on a mesh; chosen
# mean edge lengths; longest step of a curve on points, where edges join neighbouring points; chosen
MAX_STEP_EDGES_ON_POINTS = 1.5
MAX_HALVINGS = 20  # largest number of times that the way between two points is halved; chosen
# √(area / number of points), their spacing; points are spread at least this far from given points; chosen
MIN_SPACINGS = 0.4
# Length of normals, in √(area / number of points). Points are spread by positions with normals appended, so that both
# sides of a thin wall get points; chosen.
NORMAL_LENGTH_SPACINGS = 0.25


def spread_on_surface(surface: Mesh, n: int, around: FloatArray) -> FloatArray:
    """Spread n points (n, 3) evenly on a mesh, on both sides of walls, away from given points (k, 3).

    From 8 n random points, each next one is the farthest from all before it. O(n²) time, 3 s for
    7,500.
    """
    if n < 1 or not 0 < surface.area < np.inf:
        raise LandmarkError(f"cannot spread {n} points over an area of {surface.area:g}; give 1 and more")
    random, count = generator(0), 8 * n
    face = random.choice(surface.n_faces, count, p=surface.face_areas / surface.area)
    low, high = np.sort(random.random((2, count)), axis=0)  # two random cuts of [0, 1] give three weights
    points = PrecisePoints(surface.sound_faces[face], np.column_stack([low, high - low, 1 - high]))
    normals = points.interpolated(vertex_normals(surface.vertices, surface.faces))
    places, spacing = points.interpolated(surface.vertices), np.sqrt(surface.area / (n + len(around)))
    free = cKDTree(around).query(places)[0] > MIN_SPACINGS * spacing
    coordinates = np.hstack([places, NORMAL_LENGTH_SPACINGS * spacing * normals])[free]
    return np.asarray(places[free][euclidean_farthest_points(coordinates, n, 0)])


def draw_curve(
    surface: Mesh | PointCloud, points: FloatArray, closed: bool, name: str = "curve"
) -> FloatArray:
    """Draw a curve on a surface through points (k, 3): a polyline (m, 3).

    Between two points, the middle of the straight line is moved to the nearest point of the
    surface. Both halves are treated in the same way, until steps are half as long as edges. A closed
    curve ends with its first point. `LandmarkError`, with the name of the curve, if there are fewer
    than two points, or the way between two of them leaves the surface.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> draw_curve(square, np.array([[0, 0, 0.1], [1, 0.5, 0]]), closed=False)
    array([[0.   , 0.   , 0.   ],
           [0.25 , 0.125, 0.   ],
           [0.5  , 0.25 , 0.   ],
           [0.75 , 0.375, 0.   ],
           [1.   , 0.5  , 0.   ]])
    """
    if len(points) < 2:
        raise LandmarkError(f"{name}: a curve goes through two points or more, not {len(points)}")
    path = _nearest_places(surface, np.concatenate([points, points[:1]]) if closed else points)
    given_before = np.arange(len(path))  # number of the given point at or before each point of the path
    step_edges = MAX_STEP_EDGES if isinstance(surface, Mesh) else MAX_STEP_EDGES_ON_POINTS
    longest = step_edges * float(surface.edge_lengths.mean())
    for _ in range(MAX_HALVINGS):
        long = np.flatnonzero(_steps(path) > longest)
        if not len(long):
            return path
        middles = _nearest_places(surface, (path[long] + path[long + 1]) / 2)
        path = np.insert(path, long + 1, middles, axis=0)
        given_before = np.insert(given_before, long + 1, given_before[long])
    i = int(given_before[int(_steps(path).argmax())])
    raise LandmarkError(
        f"{name}: the way from point {i + 1} to the next one leaves the surface; give more points between them"
    )


def equally_spaced(path: FloatArray, n: int, closed: bool) -> tuple[IntArray, FloatArray]:
    """Find n points at equal distances along a polyline (m, 3), among them both ends.

    A closed polyline ends with its first point, which is found only once. Returns the point of the
    path before each wanted point, (n,), and the fraction of the way to the next point, (n,).

    Examples
    --------
    >>> path = np.array([[0.0, 0, 0], [1, 0, 0], [4, 0, 0]])
    >>> equally_spaced(path, 3, closed=False)
    (array([0, 1, 1]), array([0.        , 0.33333333, 1.        ]))
    """
    along = np.concatenate([[0.0], np.cumsum(_steps(path))])
    wanted = np.linspace(0.0, along[-1], n, endpoint=not closed)
    piece = np.clip(np.searchsorted(along, wanted, side="right") - 1, 0, len(path) - 2)
    length = along[piece + 1] - along[piece]
    share = np.divide(wanted - along[piece], length, out=np.zeros(n), where=length > 0)
    return piece, np.clip(share, 0.0, 1.0)


def _steps(path: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=1))


def _nearest_places(surface: Mesh | PointCloud, positions: FloatArray) -> FloatArray:
    return nearest_on_surface(surface, positions).interpolated(surface.vertices)


def respace_curve(
    surface: Mesh | PointCloud, points: FloatArray, n: int, closed: bool, name: str
) -> FloatArray:
    """Draw a curve through points of a surface, and return n points at equal distances along it."""
    path = draw_curve(surface, points, closed, name)
    piece, share = equally_spaced(path, n, closed)
    return _nearest_places(surface, path[piece] + share[:, None] * (path[piece + 1] - path[piece]))
