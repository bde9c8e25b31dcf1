"""Triangles of polygons that are not convex."""

from __future__ import annotations

import math

import numpy as np
from mapbox_earcut import triangulate_float64

from isomatch.loading.compiled import compiled
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

ROUNDING = 16 * np.finfo(np.float64).eps  # of a corner, relative to the largest coordinate
COCIRCULAR = 1e-12  # below this, in a polygon of size 1, corners count as on one line or circle
OVERLAP = 1e-9  # share of the area of a polygon that triangles of rounded corners may cover twice


def ear_clipped(
    points: FloatArray, corners: IntArray, sizes: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Cut polygons that are not convex into triangles that cover them.

    Parameters
    ----------
    points : (n, 3) array of float
        Positions.
    corners : (sum of sizes,) array of int
        Point of each corner, of all polygons one after another.
    sizes : (p,) array of int
        Number of corners of each polygon, at least 3.

    Returns
    -------
    rows : (t,) array of int
        Which triangles are not those of fans, if all polygons are triangulated in their order.
    triangles : (t, 3) array of int
        Their corners.
    left : (l,) array of int
        Polygons that remain fans though they are not convex, because their outline crosses itself or has no area.

    Notes
    -----
    A polygon is cut in the plane of its vector area (Newell's normal). It is convex if its outline turns to the same
    side at every corner there, and once around. The triangles do not depend on which corner is the first. Linear time
    in the number of polygons, quadratic in the corners of one that is not convex; a polygon with a corner that has no
    finite position remains a fan.
    """
    starts = np.cumsum(sizes) - sizes
    sound: BoolArray = (corners >= 0) & (corners < len(points))
    finite: BoolArray = np.isfinite(np.abs(points).max(axis=1, initial=0))
    sound[sound] = finite[corners[sound]]
    rows, triangles, left = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3), dtype=np.int64)], []
    for polygon in np.flatnonzero(_are_concave(points, corners, sound, starts, sizes)).tolist():
        start, size = int(starts[polygon]), int(sizes[polygon])
        found = _ears(points, corners[start : start + size])
        if found is None:
            left.append(polygon)
        else:
            rows.append(np.arange(size - 2) + start - 2 * polygon)
            triangles.append(start + found)
    return np.concatenate(rows), np.concatenate(triangles), np.array(left, dtype=np.int64)


@compiled()
def _are_concave(
    points: FloatArray, corners: IntArray, sound: BoolArray, starts: IntArray, sizes: IntArray
) -> BoolArray:
    """(p,) which polygons are not convex; one with a corner that has no place is not examined."""
    concave = np.zeros(len(sizes), dtype=np.bool_)
    for polygon in range(len(sizes)):
        start, size = starts[polygon], sizes[polygon]
        if size > 3 and sound[start : start + size].all():
            flat, rounding = _flattened(points, corners[start : start + size])
            concave[polygon] = not _is_convex(flat, rounding)
    return concave


@compiled()
def _flattened(points: FloatArray, corners: IntArray) -> tuple[FloatArray, float]:
    """(k, 2) corners in the plane of a polygon, which turns left there; and how exact they are."""
    size = len(corners)
    scaled, flat = np.zeros((size, 3)), np.zeros((size, 2))
    scale = extent = 0.0
    for i in range(size):
        for k in range(3):
            scale = max(scale, abs(points[corners[i], k]))
    if scale == 0:
        return flat, ROUNDING
    for i in range(size):
        for k in range(3):
            scaled[i, k] = points[corners[i], k] / scale - points[corners[0], k] / scale
            extent = max(extent, abs(scaled[i, k]))
    if extent == 0:
        return flat, ROUNDING
    scaled /= extent
    normal = np.zeros(3)
    for i in range(size):
        j = (i + 1) % size
        for k in range(3):
            normal[k] += scaled[i, k - 2] * scaled[j, k - 1] - scaled[i, k - 1] * scaled[j, k - 2]
    length = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if length == 0:
        return flat, ROUNDING
    # right is the cross product of an axis and the normal, and up that of the normal and right
    axis = np.abs(normal).argmin()
    y, z, x = normal[axis - 2] / length, normal[axis - 1] / length, normal[axis] / length
    beside = math.hypot(y, z)
    for i in range(size):
        b, c = scaled[i, axis - 2], scaled[i, axis - 1]
        flat[i, 0] = (y * c - z * b) / beside
        flat[i, 1] = beside * scaled[i, axis] - x * (y * b + z * c) / beside
    return flat, ROUNDING / extent


@compiled()
def _is_convex(flat: FloatArray, rounding: float) -> bool:
    """Whether an outline turns to the left everywhere, and once around."""
    size = len(flat)
    dx = dy = angle = area = 0.0
    for i in range(-size, size):  # once to find the edge before the first corner
        j = (i + 1) % size
        next_dx, next_dy = flat[j, 0] - flat[i, 0], flat[j, 1] - flat[i, 1]
        if max(abs(next_dx), abs(next_dy)) <= rounding:
            continue
        if i >= 0:
            area += flat[i, 0] * flat[j, 1] - flat[i, 1] * flat[j, 0]
            turn = dx * next_dy - dy * next_dx
            if turn < -rounding * (abs(dx) + abs(dy) + abs(next_dx) + abs(next_dy)):
                return False
            angle += math.atan2(max(turn, 0.0), dx * next_dx + dy * next_dy)
        dx, dy = next_dx, next_dy
    return area > rounding and angle < 3 * math.pi


def _ears(points: FloatArray, corners: IntArray) -> IntArray | None:
    """(k - 2, 3) corners of triangles of one polygon; None if none cover its outline once."""
    flat, rounding = _flattened(points, corners)
    n = len(corners)
    if _area(flat) <= rounding:
        return None
    order = np.roll(np.arange(n), -np.lexsort(points[corners].T)[0])  # whichever corner is the first
    triangles = order[
        triangulate_float64(flat[order].astype(np.float64), np.array([n], np.uint32)).reshape(-1, 3)
    ]
    if len(triangles) < n - 2 and _side(flat, triangles):
        triangles = np.array(_with_every_corner(triangles.tolist(), n))
    side = _side(flat, triangles) if len(triangles) == n - 2 else 0
    if not side:
        return None
    triangles = _delaunay(flat, np.ascontiguousarray(triangles[:, ::side]))
    from_least = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    triangles = np.take_along_axis(triangles, from_least, axis=1)
    return triangles[np.lexsort(triangles.T[::-1])]


@compiled()
def _area(flat: FloatArray) -> float:
    """Twice the area of an outline that turns left."""
    area = 0.0
    for i in range(len(flat)):
        a, b = flat[i], flat[(i + 1) % len(flat)]
        area += a[0] * b[1] - a[1] * b[0]
    return area


@compiled()
def _side(flat: FloatArray, triangles: IntArray) -> int:
    """1 if triangles cover an outline once, -1 if they do so from below, 0 if they do not."""
    total = turned = 0.0
    for i in range(len(triangles)):
        a, b, c = flat[triangles[i, 0]], flat[triangles[i, 1]], flat[triangles[i, 2]]
        each = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        total += each
        turned += abs(each)
    if turned > (1 + OVERLAP) * _area(flat):
        return 0
    return 1 if total > 0 else -1


@compiled()
def _delaunay(flat: FloatArray, triangles: IntArray) -> IntArray:
    """Flip inner edges of triangles in place until no circumcircle holds the corner across an edge (Lawson 1977)."""
    beside = _neighbours(triangles, len(flat))
    for _ in range(len(triangles)):  # far more than it takes; rounding could flip an edge to and fro
        flipped = False
        for t in range(len(triangles)):
            for k in range(3):
                u = beside[t, k]
                if u < 0:
                    continue
                a, b, c = triangles[t, k], triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
                j = 0
                while triangles[u, j] in (b, c):
                    j += 1
                d = triangles[u, j]
                if not _should_flip(flat[a], flat[b], flat[c], flat[d]):
                    continue
                at_b, at_c = beside[t, (k + 1) % 3], beside[t, (k + 2) % 3]
                far_c, far_b = beside[u, (j + 2) % 3], beside[u, (j + 1) % 3]  # of (d, c, b)
                triangles[t, 0], triangles[t, 1], triangles[t, 2] = a, b, d
                triangles[u, 0], triangles[u, 1], triangles[u, 2] = a, d, c
                beside[t, 0], beside[t, 1], beside[t, 2] = far_b, u, at_c
                beside[u, 0], beside[u, 1], beside[u, 2] = far_c, at_b, t
                for outer, old, new in ((far_b, u, t), (at_b, t, u)):
                    for i in range(3):
                        if outer >= 0 and beside[outer, i] == old:
                            beside[outer, i] = new
                flipped = True
                break
        if not flipped:
            break
    return triangles


@compiled()
def _neighbours(triangles: IntArray, n: int) -> IntArray:
    """(m, 3) the triangle across the edge opposite each corner, -1 for none."""
    beside = np.full((len(triangles), 3), -1)
    edges = np.zeros(3 * len(triangles), dtype=np.int64)
    for side in range(len(edges)):
        b, c = triangles[side // 3, (side + 1) % 3], triangles[side // 3, (side + 2) % 3]
        edges[side] = min(b, c) * n + max(b, c)
    order = np.argsort(edges)
    for i in range(len(order) - 1):
        one, other = order[i], order[i + 1]
        if edges[one] == edges[other]:
            beside[one // 3, one % 3], beside[other // 3, other % 3] = other // 3, one // 3
    return beside


@compiled()
def _should_flip(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> bool:
    """Whether d is in the circumcircle of (a, b, c), and b and c are on different sides of the line from a to d."""
    bx, by, cx, cy, dx, dy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1], d[0] - a[0], d[1] - a[1]
    beyond_b, before_c = bx * dy - by * dx, dx * cy - dy * cx
    b2, c2, d2 = bx * bx + by * by, cx * cx + cy * cy, dx * dx + dy * dy
    inside = b2 * (cx * dy - cy * dx) - c2 * (bx * dy - by * dx) + d2 * (bx * cy - by * cx)
    flip: bool = min(beyond_b, before_c) > COCIRCULAR and inside < -COCIRCULAR
    return flip


def _with_every_corner(triangles: list[list[int]], n: int) -> list[list[int]]:
    """Put corners in that were left out because they lie on a line between others: they split a triangle there."""
    used = sorted({corner for triangle in triangles for corner in triangle})
    for a, b in zip(used, [*used[1:], *(used[:1] and [used[0] + n])]):
        for between in range(a + 1, b):
            ends = {(between - 1) % n, b % n}
            for i, triangle in enumerate(triangles):
                if ends <= set(triangle):
                    triangles[i] = [between % n if each == b % n else each for each in triangle]
                    triangles.append(
                        [between % n if each == (between - 1) % n else each for each in triangle]
                    )
                    break
    return triangles
