"""Places and curves on a surface: its nearest points, curves drawn through a few points, equal distances along them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray, read_only
from isomatch._core.compiled import compiled
from isomatch._core.errors import LandmarkError
from isomatch._core.settings import generator
from isomatch._core.threads import parallel_map
from isomatch.geodesics import euclidean_farthest_points
from isomatch.surfaces import Mesh, PointCloud, PrecisePoints, nearest_in_triangle, vertex_normals

AT_ONCE = 1000  # points of a thread
IN_A_BOX = 4  # triangles, up to twice as many
FINENESS = 0.5  # of the mean edge length: longest step of a curve that is drawn on triangles
BETWEEN_POINTS = 1.5  # the same on points, of which the nearest one is taken; edges join the next 30
MOST_HALVINGS = 20  # of the way between two points
APART = 0.4  # of the spacing of points that are spread: least distance from others
SIDES = 0.25  # of it: weight of normals, so that both sides of a wall get points


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
    A hierarchy of boxes around triangles is searched, nearest first, from the nearest vertex: O((n + m) log n).

    Examples
    --------
    >>> strip = Mesh([[0, 0, 0], [9, 0, 0], [9, 1, 0], [4, -1, 0]], [[0, 1, 2], [0, 3, 1]])
    >>> nearest_on_surface(strip, np.array([[4.5, 0.5, 2.0]])).interpolated(strip.vertices)
    array([[4.5, 0.5, 0. ]])
    """
    if isinstance(surface, PointCloud) or not surface.n_faces:
        return PrecisePoints.at_vertices(cKDTree(surface.vertices).query(positions)[1])
    used = np.unique(surface.sound_faces)
    apart, nearest = cKDTree(surface.vertices[used]).query(positions)
    points = PrecisePoints.at_vertices(used[nearest])
    order = cKDTree(
        surface.vertices[surface.sound_faces].mean(axis=1)
    ).indices  # neighbours follow one another
    faces = surface.sound_faces[order]
    boxes, starts = _hierarchy(surface.vertices[faces])
    vertices, queries = map(read_only, (surface.vertices, positions))

    def chunk(first: int) -> None:
        rows = slice(first, first + AT_ONCE)
        found = apart[rows], points.corners[rows], points.barycentric[rows]
        _take_nearest(vertices, faces, boxes, starts, queries[rows], *found)

    parallel_map(chunk, range(0, len(queries), AT_ONCE))
    return points


def _hierarchy(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Bound triangles (f, 3, 3) by boxes (2 k, 2, 3): box i holds 2 i and 2 i + 1, box k + j the j-th of k runs."""
    k = 1 << max(len(corners) // IN_A_BOX, 1).bit_length() - 1
    starts = np.arange(k + 1) * len(corners) // k
    boxes = np.empty((2 * k, 2, 3))
    for side, most in enumerate((np.minimum, np.maximum)):
        boxes[k:, side] = most.reduceat(most(most(corners[:, 0], corners[:, 1]), corners[:, 2]), starts[:-1])
    while k > 1:
        k //= 2
        boxes[k : 2 * k, 0] = np.minimum(boxes[2 * k : 4 * k : 2, 0], boxes[2 * k + 1 : 4 * k : 2, 0])
        boxes[k : 2 * k, 1] = np.maximum(boxes[2 * k : 4 * k : 2, 1], boxes[2 * k + 1 : 4 * k : 2, 1])
    return boxes, starts


@compiled(error_model="numpy")
def _gap(box: FloatArray, point: FloatArray) -> float:
    """Squared distance of a point from a box."""
    gap = 0.0
    for j in range(3):
        gap += max(box[0, j] - point[j], point[j] - box[1, j], 0.0) ** 2
    return gap


@compiled(error_model="numpy")
def _take_nearest(
    vertices: FloatArray,
    faces: IntArray,
    boxes: FloatArray,
    starts: IntArray,
    queries: FloatArray,
    apart: FloatArray,
    corners: IntArray,
    barycentric: FloatArray,
) -> None:
    """Let the nearest point of a triangle take the row of each query that is nearer to it than the point so far."""
    waiting, gaps = np.empty(64, dtype=np.int64), np.empty(64)  # twice as many as there are levels
    k = len(boxes) // 2
    for i in range(len(queries)):
        q = queries[i]
        waiting[0], gaps[0], n = 1, 0.0, 1
        while n:
            n -= 1
            box = waiting[n]
            if gaps[n] >= apart[i] ** 2:
                continue
            if box < k:
                pair = _gap(boxes[2 * box], q), _gap(boxes[2 * box + 1], q)
                far = int(pair[0] < pair[1])
                for side in (far, 1 - far):  # the nearer one is looked at first
                    waiting[n], gaps[n] = 2 * box + side, pair[side]
                    n += 1
                continue
            for face in faces[starts[box - k] : starts[box - k + 1]]:
                a, b, c = face
                uu = uv = vv = up = vp = 0.0
                for j in range(3):
                    x = vertices[a, j]
                    u, v, p = vertices[b, j] - x, vertices[c, j] - x, q[j] - x
                    uu, uv, vv, up, vp = uu + u * u, uv + u * v, vv + v * v, up + u * p, vp + v * p
                s, t, _ = nearest_in_triangle(uu, uv, vv, up, vp)
                gap = 0.0
                for j in range(3):
                    x = vertices[a, j]
                    gap += (x + s * (vertices[b, j] - x) + t * (vertices[c, j] - x) - q[j]) ** 2
                gap = np.sqrt(gap)
                if gap < apart[i]:
                    apart[i] = gap
                    corners[i, 0], corners[i, 1], corners[i, 2] = a, b, c
                    barycentric[i, 0], barycentric[i, 1], barycentric[i, 2] = 1.0 - s - t, s, t


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
    return nearest_on_surface(surface, between).interpolated(surface.vertices)
