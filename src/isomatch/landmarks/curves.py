"""Places on a surface: points spread over it, curves drawn through a few points, equal distances along them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import LandmarkError
from isomatch._core.settings import generator
from isomatch.geodesics import euclidean_farthest_points
from isomatch.surfaces import Mesh, PointCloud, PrecisePoints, nearest_on_surface, vertex_normals

FINENESS = 0.5  # of the mean edge length: longest step of a curve that is drawn on triangles
BETWEEN_POINTS = 1.5  # the same on points, of which the nearest one is taken; edges join the next 30
MOST_HALVINGS = 20  # of the way between two points
APART = 0.4  # of the spacing of points that are spread: least distance from others
SIDES = 0.25  # of it: weight of normals, so that both sides of a wall get points


def spread_on_surface(surface: Mesh, n: int, around: FloatArray) -> FloatArray:
    """Spread n points (n, 3) evenly over a mesh, on both sides of thin walls too, and not beside those (k, 3) around.

    Each is the farthest from all before it of eight times as many random points; O(n²) time, 3 s for 7,500.
    """
    if n < 1 or not 0 < surface.area < np.inf:
        raise LandmarkError(f"cannot spread {n} points over an area of {surface.area:g}; give 1 and more")
    random, count = generator(0), 8 * n
    face = random.choice(surface.n_faces, count, p=surface.face_areas / surface.area)
    low, high = np.sort(random.random((2, count)), axis=0)  # three lengths: uniform in a triangle
    drawn = PrecisePoints(surface.sound_faces[face], np.column_stack([low, high - low, 1 - high]))
    normals = drawn.interpolated(vertex_normals(surface.vertices, surface.faces))
    places, spacing = drawn.interpolated(surface.vertices), np.sqrt(surface.area / (n + len(around)))
    free = cKDTree(around).query(places)[0] > APART * spacing
    sided = np.hstack([places, SIDES * spacing * normals])[free]
    return np.asarray(places[free][euclidean_farthest_points(sided, n, 0)])


def drawn_curve(
    surface: Mesh | PointCloud, points: FloatArray, closed: bool, name: str = "curve"
) -> FloatArray:
    """Draw a curve on a surface through points.

    Between two points, the middle of the straight line is moved to the nearest point of the surface, and so on for both
    halves, until steps are half as long as edges.

    Parameters
    ----------
    surface : Mesh or PointCloud
    points : (k, 3) array of float
        What it goes through, in order.
    closed : bool
        Whether it goes back to the first point.
    name : str
        For messages.

    Returns
    -------
    (m, 3) array of float
        A polyline; of a closed curve, the last point is the first one.

    Raises
    ------
    LandmarkError
        If there are fewer than two points, or the way between two of them leaves the surface.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> drawn_curve(square, np.array([[0, 0, 0.1], [1, 0.5, 0]]), closed=False)
    array([[0.   , 0.   , 0.   ],
           [0.25 , 0.125, 0.   ],
           [0.5  , 0.25 , 0.   ],
           [0.75 , 0.375, 0.   ],
           [1.   , 0.5  , 0.   ]])
    """
    if len(points) < 2:
        raise LandmarkError(f"{name}: a curve goes through two points or more, not {len(points)}")
    path = _moved_to(surface, np.concatenate([points, points[:1]]) if closed else points)
    of = np.arange(len(path))  # the point before each
    fineness = FINENESS if isinstance(surface, Mesh) else BETWEEN_POINTS
    longest = fineness * float(surface.edge_lengths.mean())
    for _ in range(MOST_HALVINGS):
        long = np.flatnonzero(_steps(path) > longest)
        if not len(long):
            return path
        middles = _moved_to(surface, (path[long] + path[long + 1]) / 2)
        path, of = np.insert(path, long + 1, middles, axis=0), np.insert(of, long + 1, of[long])
    i = int(of[int(_steps(path).argmax())])
    raise LandmarkError(
        f"{name}: the way from point {i + 1} to the next one leaves the surface; give more points between them"
    )


def equally_spaced(path: FloatArray, n: int, closed: bool) -> tuple[IntArray, FloatArray]:
    """Find points at equal distances along a polyline.

    Parameters
    ----------
    path : (m, 3) array of float
        Its points; of a closed one, the last is the first.
    n : int
        How many are wanted: with both ends, or of a closed one the first point and n − 1 others.
    closed : bool

    Returns
    -------
    piece : (n,) array of int
        The point before each.
    share : (n,) array of float
        How far it is on the way to the next one, 0 to 1.

    Examples
    --------
    >>> path = np.array([[0.0, 0, 0], [1, 0, 0], [4, 0, 0]])
    >>> equally_spaced(path, 3, closed=False)
    (array([0, 1, 1]), array([0.        , 0.33333333, 1.        ]))
    """
    so_far = np.concatenate([[0.0], np.cumsum(_steps(path))])
    wanted = np.linspace(0.0, so_far[-1], n, endpoint=not closed)
    piece = np.clip(np.searchsorted(so_far, wanted, side="right") - 1, 0, len(path) - 2)
    length = so_far[piece + 1] - so_far[piece]
    share = np.divide(wanted - so_far[piece], length, out=np.zeros(n), where=length > 0)
    return piece, np.clip(share, 0.0, 1.0)


def _steps(path: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=1))


def _moved_to(surface: Mesh | PointCloud, positions: FloatArray) -> FloatArray:
    return nearest_on_surface(surface, positions).interpolated(surface.vertices)


def respaced_curve(
    surface: Mesh | PointCloud, points: FloatArray, n: int, closed: bool, name: str
) -> FloatArray:
    """Draw a curve through points of a surface, and return n points of the surface at equal distances along it."""
    path = drawn_curve(surface, points, closed, name)
    piece, share = equally_spaced(path, n, closed)
    between = path[piece] + share[:, None] * (path[piece + 1] - path[piece])
    return _moved_to(surface, between)
