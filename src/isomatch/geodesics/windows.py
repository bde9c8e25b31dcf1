"""Windows of straight rays, propagated over the faces of a mesh: exact distances, and the paths that have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.runtime.memory import memory_budget, require_memory
from isomatch.surfaces import Mesh, fans
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

TIE = 1e-14  # of a distance; a vertex is reached anew only by what is shorter by more
LOSS = 1e-12  # of a distance; a window is dropped only if what beats it is shorter by more
GRAZE = 1e-9  # of an edge; a ray so far beside a window is of it, which makes a path too short by the square of that
FLAT = 1e-12  # of an angle; rays do not bend around a vertex whose angle is larger by no more
BYTES = 270  # for each window, while arrays grow
NARROW = 1e-15  # of an edge; windows so narrow are of rounding
THINNEST = 1e-13  # height of a face over a side, in sides


class UnfoldedFaces(NamedTuple):
    """The faces of a mesh in the plane, and what meets at their sides; side 3 f + i goes from corner i to corner i + 1.

    Parameters
    ----------
    faces : (m, 3) array of int
    length : (3 m,) array of float
        Of each side.
    apex : (3 m, 2) array of float
        The third corner, with the side from (0, 0) to (length, 0); its ordinate is positive.
    edge : (3 m,) array of int
        The edge of each side.
    first, sides : (e + 1,) and (3 m,) arrays of int
        The sides of edge i are ``sides[first[i]:first[i + 1]]``.
    corner_first, corners : (n + 1,) and (3 m,) arrays of int
        The corners of vertex v are ``corners[corner_first[v]:corner_first[v + 1]]``.
    bends : (n,) array of bool
        Where a shortest path may bend: the angle of the faces is more than 2 π, on a boundary more than π, or the mesh
        is not manifold there.
    """

    faces: IntArray
    length: FloatArray
    apex: FloatArray
    edge: IntArray
    first: IntArray
    sides: IntArray
    corner_first: IntArray
    corners: IntArray
    bends: BoolArray

    @classmethod
    def of(cls, mesh: Mesh) -> UnfoldedFaces:
        """Lay out the faces of a mesh of ordinary size."""
        faces, points, edges = mesh.sound_faces, mesh.vertices, mesh.edge_table
        a = points[faces]
        b, c = a[:, [1, 2, 0]], a[:, [2, 0, 1]]
        along, to_apex = b - a, c - a
        length = np.linalg.norm(along, axis=2).ravel()
        unit = np.where(length > 0, length, 1.0)
        x = (along * to_apex).sum(axis=2).ravel() / unit
        height = np.linalg.norm(np.cross(along, to_apex), axis=2).ravel() / unit
        far = np.linalg.norm(to_apex, axis=2).ravel()
        apex = np.column_stack([x, np.maximum(height, THINNEST * np.maximum(length, far))])
        first = np.append(0, np.cumsum(edges.n_faces))
        sides = edges.sides.astype(np.int64)
        edge = np.zeros(faces.size, dtype=np.int64)
        edge[sides] = np.repeat(np.arange(len(edges.ends)), edges.n_faces)
        corner_first = np.append(0, np.cumsum(np.bincount(faces.ravel(), minlength=mesh.n_vertices)))
        corners = np.argsort(faces.ravel(), kind="stable")
        angle = np.arctan2(apex[:, 1], apex[:, 0])
        total = np.bincount(faces.ravel(), angle, mesh.n_vertices)
        straight = np.full(mesh.n_vertices, 2 * np.pi)
        straight[edges.ends[edges.n_faces == 1]] = np.pi
        bends = total > straight * (1 + FLAT)
        bends[edges.ends[edges.n_faces > 2]] = True
        bends |= fans(faces, edges, mesh.n_vertices) > 1
        return cls(faces, length, apex, edge, first, sides, corner_first, corners, bends)


@dataclass(frozen=True, eq=False)
class Windows:
    """The windows of rays from one vertex, and how each vertex is reached.

    A window is an interval of an edge that light reaches from a vertex, its *root*, through a row of faces that lie in
    one plane once they are unfolded. It is about to enter a face at one of its sides.

    Parameters
    ----------
    distance : (n,) array of float
        Exact distance of each vertex; ``inf`` where no path leads. Only that of the target, if there was one.
    reached : (n,) array of int
        The window through whose face a vertex is reached; or −1 − u if along an edge from vertex u.
    root, parent, side, before : (w,) arrays of int
        The root of each window, the window that it continues or −1, the side where it enters a face, and the face that
        it comes from.
    source : (w, 2) array of float
        The root in the plane of the face entered, with the side from (0, 0) to (length, 0).
    """

    distance: FloatArray
    reached: IntArray
    root: IntArray
    parent: IntArray
    side: IntArray
    before: IntArray
    source: FloatArray


def windows_from(
    unfolded: UnfoldedFaces, points: FloatArray, source: int, bound: FloatArray, target: int = -1
) -> Windows:
    """Propagate windows from a vertex until all distances are known, or that of one target.

    Parameters
    ----------
    unfolded : UnfoldedFaces
        Of a mesh of n vertices, manifold or not.
    points : (n, 3) array of float
        Its vertices.
    source : int
    bound : (n,) array of float
        Lengths of some paths to each vertex, such as those along edges; ``inf`` where none is known.
    target : int
        The vertex whose distance is wanted; −1 for all.

    Returns
    -------
    Windows

    Notes
    -----
    Chen & Han, *Shortest paths on a polyhedron*, SoCG 1990, with the filter and the queue of Xin & Wang, *Improving Chen
    and Han's algorithm on the discrete geodesic problem*, TOG 2009. At a corner only the window that reaches it first
    goes on at both sides of it; a window is dropped where a path through a corner of its face is shorter; and on the way
    to a target the queue is in the order of the shortest path that a window may still be part of. O(n²) windows in the
    worst case; at most 270 bytes for each.
    """
    most = memory_budget() // BYTES
    distance, reached, numbers, values = _propagate(*unfolded, points, source, target, bound.copy(), most)
    require_memory(
        float(BYTES) * len(numbers),
        "the windows of exact distances",
        "many faces without area may be the reason: look at check(mesh); or use engine 'fast_marching'",
    )
    side, before, parent, root = numbers.T
    return Windows(distance, reached, root, parent, side, before, values[:, 2:4])


@compiled()
def _to_target(points: FloatArray, a: int, b: int, low: float, high: float, target: int) -> float:
    """Euclidean distance of a point from the part low…high, in shares, of the segment from a to b."""
    along = 0.0
    squared = 0.0
    for axis in range(3):
        step = points[b, axis] - points[a, axis]
        along += step * (points[target, axis] - points[a, axis])
        squared += step * step
    share = min(max(along / squared, low), high) if squared > 0.0 else low
    apart = 0.0
    for axis in range(3):
        place = points[a, axis] + share * (points[b, axis] - points[a, axis])
        apart += (points[target, axis] - place) ** 2
    return float(np.sqrt(apart))


@compiled()
def _push(keys: FloatArray, items: IntArray, count: IntArray, key: float, item: int) -> None:
    """Put an item in a binary heap whose size is ``count[1]``."""
    hole = count[1]
    count[1] += 1
    while hole > 0:
        above = (hole - 1) // 2
        if keys[above] <= key:
            break
        keys[hole], items[hole] = keys[above], items[above]
        hole = above
    keys[hole], items[hole] = key, item


@compiled()
def _pop(keys: FloatArray, items: IntArray, count: IntArray) -> tuple[float, int]:
    """Take the item with the least key."""
    key, item = keys[0], items[0]
    count[1] -= 1
    size = count[1]
    last = keys[size]
    hole = 0
    while 2 * hole + 1 < size:
        below = 2 * hole + 1
        if below + 1 < size and keys[below + 1] < keys[below]:
            below += 1
        if keys[below] >= last:
            break
        keys[hole], items[hole] = keys[below], items[below]
        hole = below
    keys[hole], items[hole] = last, items[size]
    return key, item


@compiled()
def _add(
    faces: IntArray,
    length: FloatArray,
    apex: FloatArray,
    edge: IntArray,
    first: IntArray,
    sides: IntArray,
    points: FloatArray,
    target: int,
    bound: FloatArray,
    numbers: IntArray,
    values: FloatArray,
    count: IntArray,
    keys: FloatArray,
    items: IntArray,
    own: int,
    low: float,
    high: float,
    along: float,
    height: float,
    sigma: float,
    root: int,
    parent: int,
    third_is_near: int,
) -> None:
    """Add the windows that leave a face by part low…high of its side ``own``, unless a shorter path makes them useless.

    The root is at (along, height) over that side, at the distance sigma from the source. ``third_is_near`` is the end of
    the interval, 0 or 1, on whose side of all rays the third corner of the face is. ``count`` holds the numbers of
    windows and of queued items.
    """
    full = length[own]
    if high - low <= NARROW * full:
        return
    face, i = own // 3, own % 3
    a, b, c = faces[face, i], faces[face, (i + 1) % 3], faces[face, (i + 2) % 3]
    from_low = sigma + np.hypot(along - low, height)
    from_high = sigma + np.hypot(along - high, height)
    if bound[a] + high < from_high * (1.0 - LOSS) or bound[b] + full - low < from_low * (1.0 - LOSS):
        return
    end, there = (low, from_low) if third_is_near == 0 else (high, from_high)
    if bound[c] + np.hypot(apex[own, 0] - end, apex[own, 1]) < there * (1.0 - LOSS):
        return
    key = sigma + height if low <= along <= high else min(from_low, from_high)
    if target >= 0:
        key += _to_target(points, a, b, low / full, high / full, target)
        if key > bound[target] * (1.0 + LOSS):
            return
    for k in range(first[edge[own]], first[edge[own] + 1]):
        side = sides[k]
        if side == own:
            continue
        same = faces[side // 3, side % 3] == a
        size = count[0]
        numbers[size, 0] = side
        numbers[size, 1] = face
        numbers[size, 2] = parent
        numbers[size, 3] = root
        values[size, 0] = low if same else full - high
        values[size, 1] = high if same else full - low
        values[size, 2] = along if same else full - along
        values[size, 3] = -height
        values[size, 4] = sigma
        _push(keys, items, count, key, size)
        count[0] += 1


@compiled()
def _propagate(
    faces: IntArray,
    length: FloatArray,
    apex: FloatArray,
    edge: IntArray,
    first: IntArray,
    sides: IntArray,
    corner_first: IntArray,
    corners: IntArray,
    bends: BoolArray,
    points: FloatArray,
    source: int,
    target: int,
    bound: FloatArray,
    limit: int,
) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """Return distances, how each vertex is reached, and the windows: (w, 4) numbers and (w, 5) values; see `_add`.

    It gives up when there are more windows than a limit.
    """
    n = len(bends)
    distance = np.full(n, np.inf)
    reached = np.full(n, -1, np.int64)
    spread = np.full(n, np.inf)  # distance at which a vertex became a root
    split_at = np.full(len(length), np.inf)  # distance of the apex by the window that is split there
    split_ray = np.zeros(len(length))  # where its ray to the apex crosses the side
    widest = 0
    for k in range(len(first) - 1):
        widest = max(widest, first[k + 1] - first[k])
    most = np.int64(0)
    for v in range(n):
        most = max(most, corner_first[v + 1] - corner_first[v])
    room = (most + 2) * max(widest, 1)
    numbers = np.zeros((4 * room + 1024, 4), np.int64)
    values = np.zeros((4 * room + 1024, 5))
    count = np.zeros(2, np.int64)
    keys, items = np.zeros(len(numbers)), np.zeros(len(numbers), np.int64)
    distance[source] = 0.0
    bound[source] = 0.0
    _push(keys, items, count, 0.0, -1 - source)
    while count[1] > 0 and count[0] <= limit:
        key, at = _pop(keys, items, count)
        if target >= 0 and key > bound[target] * (1.0 + LOSS):
            break
        if count[0] + room > len(numbers):
            numbers = np.concatenate((numbers, np.zeros_like(numbers)))
            values = np.concatenate((values, np.zeros_like(values)))
        if count[1] + 3 * room > len(keys):
            keys = np.concatenate((keys, np.zeros_like(keys)))
            items = np.concatenate((items, np.zeros_like(items)))
        if at < 0:  # a vertex from which light spreads
            v = -1 - at
            sigma = distance[v]
            if spread[v] <= sigma:
                continue
            spread[v] = sigma
            for k in range(corner_first[v], corner_first[v + 1]):
                face, i = corners[k] // 3, corners[k] % 3
                own = 3 * face + (i + 1) % 3
                for j in range(1, 3):
                    u = faces[face, (i + j) % 3]
                    d = sigma + (length[3 * face + i] if j == 1 else length[3 * face + (i + 2) % 3])
                    if d < distance[u] * (1.0 - TIE):
                        distance[u] = d
                        bound[u] = min(bound[u], d)
                        reached[u] = -1 - v
                        if bends[u]:
                            more = _to_target(points, u, u, 0.0, 0.0, target) if target >= 0 else 0.0
                            _push(keys, items, count, d + more, -1 - u)
                _add(
                    faces, length, apex, edge, first, sides, points, target, bound, numbers, values, count, keys, items,
                    own, 0.0, length[own], apex[own, 0], apex[own, 1], sigma, v, -1, 0,
                )  # fmt: skip
            continue
        side, root = numbers[at, 0], numbers[at, 3]
        low, high, px, py, sigma = values[at]
        if sigma > distance[root]:  # the root has been reached by a shorter path since
            continue
        face, i = side // 3, side % 3
        c = faces[face, (i + 2) % 3]
        full, x, y = length[side], apex[side, 0], apex[side, 1]
        ray = px - (x - px) * py / (y - py)  # where the ray to c crosses the side
        slack = GRAZE * full
        left, right = ray > low, ray < high
        if low - slack <= ray <= high + slack:
            d = sigma + np.hypot(x - px, y - py)
            if d < distance[c] * (1.0 - TIE):
                distance[c] = d
                bound[c] = min(bound[c], d)
                reached[c] = at
                if bends[c]:
                    more = _to_target(points, c, c, 0.0, 0.0, target) if target >= 0 else 0.0
                    _push(keys, items, count, d + more, -1 - c)
            if left and right and first[edge[side] + 1] - first[edge[side]] == 2:
                if d < split_at[side]:
                    split_at[side], split_ray[side] = d, ray
                elif d > split_at[side] * (1.0 + LOSS):
                    # the path to c of that window cuts off the rays on its other side
                    if ray < split_ray[side]:
                        right = False
                    elif ray > split_ray[side]:
                        left = False
        for j in range(1, 3):
            if not (right if j == 1 else left):
                continue
            own = 3 * face + (i + j) % 3
            # in shares of the side from the end that it has in common with the one entered
            if j == 1:
                near, far = full - high, full - max(low, ray)
                ax, sx = full - x, full - px
            else:
                near, far = low, min(high, ray)
                ax, sx = x, px
            begin = _share(near, ax, y, sx, py)
            end = _share(far, ax, y, sx, py) if far < (full - ray if j == 1 else ray) else 1.0
            reach = length[own]
            if reach == 0.0:
                continue
            along = (sx * ax + py * y) / reach  # from that end
            height = abs(sx * y - py * ax) / reach
            if j == 1:
                _add(
                    faces, length, apex, edge, first, sides, points, target, bound, numbers, values, count, keys, items,
                    own, begin * reach, end * reach, along, height, sigma, root, at, 0,
                )  # fmt: skip
            else:
                _add(
                    faces, length, apex, edge, first, sides, points, target, bound, numbers, values, count, keys, items,
                    own, (1.0 - end) * reach, (1.0 - begin) * reach, reach - along, height, sigma, root, at, 1,
                )  # fmt: skip
    return distance, reached, numbers[: count[0]], values[: count[0]]


@compiled()
def _share(t: float, x: float, y: float, px: float, py: float) -> float:
    """Share of the way from (0, 0) to (x, y) at which the ray from (px, py) through (t, 0) arrives; py ≤ 0 < y."""
    # s (x, y) = p + r (t − px, −py), so that s (x (−py) − y (t − px)) = −py t
    below = x * py + y * (t - px)
    return min(max(py * t / below, 0.0), 1.0) if below != 0.0 else 0.0
