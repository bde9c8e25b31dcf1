"""The point of a surface nearest to each of many positions, by a hierarchy of boxes around its triangles."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray, read_only
from isomatch._core.compiled import compiled
from isomatch._core.threads import parallel_map
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.point_cloud import PointCloud
from isomatch.surfaces.precise_points import PrecisePoints, nearest_in_triangle

QUERIES_PER_CHUNK = 1000  # number of positions that one thread treats at once; chosen
MIN_TRIANGLES_PER_BOX = 4  # least number of triangles in a lowest box, which has at most 8; chosen


def nearest_on_surface(surface: Mesh | PointCloud, positions: FloatArray) -> PrecisePoints:
    """Find the nearest point of a surface, or of a point cloud, for each position.

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
    distances, nearest = cKDTree(surface.vertices[used]).query(positions)
    points = PrecisePoints.at_vertices(used[nearest])
    centres = surface.vertices[surface.sound_faces].mean(axis=1)
    faces = surface.sound_faces[cKDTree(centres).indices]  # in an order in which neighbours follow each other
    boxes, starts = _hierarchy(surface.vertices[faces])
    vertices, queries = map(read_only, (surface.vertices, positions))

    def chunk(first: int) -> None:
        rows = slice(first, first + QUERIES_PER_CHUNK)
        found = distances[rows], points.corners[rows], points.barycentric[rows]
        _take_nearest(vertices, faces, boxes, starts, queries[rows], *found)

    parallel_map(chunk, range(0, len(queries), QUERIES_PER_CHUNK))
    return points


def _hierarchy(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Bound triangles (f, 3, 3) by boxes (2 k, 2, 3).

    Box i holds boxes 2 i and 2 i + 1, and box k + j the j-th of k runs of triangles.
    """
    k = 1 << max(len(corners) // MIN_TRIANGLES_PER_BOX, 1).bit_length() - 1
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
    distances: FloatArray,
    corners: IntArray,
    barycentric: FloatArray,
) -> None:
    """Replace the nearest point of each query by nearer ones on the triangles."""
    waiting, gaps = np.empty(64, dtype=np.int64), np.empty(64)  # a stack of boxes; each level adds one
    k = len(boxes) // 2
    for i in range(len(queries)):
        q = queries[i]
        waiting[0], gaps[0], n = 1, 0.0, 1
        while n:
            n -= 1
            box = waiting[n]
            if gaps[n] >= distances[i] ** 2:
                continue
            if box < k:
                pair = _gap(boxes[2 * box], q), _gap(boxes[2 * box + 1], q)
                far = int(pair[0] < pair[1])
                for side in (far, 1 - far):  # the nearer box is pushed last, and so examined first
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
                if gap < distances[i]:
                    distances[i] = gap
                    corners[i, 0], corners[i, 1], corners[i, 2] = a, b, c
                    barycentric[i, 0], barycentric[i, 1], barycentric[i, 2] = 1.0 - s - t, s, t
