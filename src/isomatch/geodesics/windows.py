"""Windows of straight rays, propagated across the faces of a mesh: exact distances and shortest paths."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.memory import memory_budget, require_memory
from isomatch.surfaces import Mesh, count_fans

# least fraction by which a path to a vertex is shorter than the path that it replaces; chosen above rounding
MIN_GAIN_RATIO = 1e-14
# fraction by which a path must be shorter than a window's path to drop the window; chosen above rounding
MIN_LOSS_RATIO = 1e-12
# largest distance of the ray to a corner from a window, over the edge; chosen: lengths err by its square
MAX_MISS_EDGES = 1e-9
# share by which the angle at a vertex must exceed 2 π (boundary: π) for rays to bend; chosen above rounding
MIN_BEND_RATIO = 1e-12
MIN_WIDTH_EDGES = 1e-15  # windows narrower than this share of their edge are rounding and dropped; chosen
MIN_HEIGHT_EDGES = 1e-13  # heights of unfolded faces are raised to this share of their sides; chosen
BYTES_PER_WINDOW = 270  # bytes of a window while lists grow; they bound the number of windows; measured


class UnfoldedFaces(NamedTuple):
    """The m faces of a mesh in the plane. Side 3 f + i of face f leads from corner i to corner i + 1.

    The sides at edge i are ``sides[first[i]:first[i + 1]]``, and the corners at vertex v
    ``corners[corner_first[v]:corner_first[v + 1]]``.
    """

    faces: IntArray  # the vertices (m, 3) of each face
    length: FloatArray  # the length (3 m,) of each side
    apex: FloatArray  # the third corner (3 m, 2), above the side from (0, 0) to (length, 0)
    edge: IntArray  # the edge (3 m,) of each side
    first: IntArray
    sides: IntArray
    corner_first: IntArray
    corners: IntArray
    bends: BoolArray  # whether a shortest path can bend at each vertex (n,)

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
        apex = np.column_stack([x, np.maximum(height, MIN_HEIGHT_EDGES * np.maximum(length, far))])
        first = np.append(0, np.cumsum(edges.n_faces))
        sides = edges.sides.astype(np.int64)
        edge = np.zeros(faces.size, dtype=np.int64)
        edge[sides] = np.repeat(np.arange(len(edges.ends)), edges.n_faces)
        corner_first = np.append(0, np.cumsum(np.bincount(faces.ravel(), minlength=mesh.n_vertices)))
        corners = np.argsort(faces.ravel(), kind="stable")
        # A shortest path passes straight through a vertex or bends where there are at least π of
        # angle on both sides of it (Mitchell, Mount & Papadimitriou 1987, lemma 3.5): where the
        # angle of the faces is at least 2 π; on a boundary, along which it may run, at least π; and
        # where the mesh is not manifold. At 2 π it is straight: no root is needed.
        angle = np.arctan2(apex[:, 1], apex[:, 0])
        total = np.bincount(faces.ravel(), angle, mesh.n_vertices)
        straight = np.full(mesh.n_vertices, 2 * np.pi)
        straight[edges.ends[edges.n_faces == 1]] = np.pi
        bends = total > straight * (1 + MIN_BEND_RATIO)
        bends[edges.ends[edges.n_faces > 2]] = True
        bends |= count_fans(faces, edges, mesh.n_vertices) > 1
        return cls(faces, length, apex, edge, first, sides, corner_first, corners, bends)


class Windows(NamedTuple):
    """The w windows of rays from one vertex, and how each of n vertices is reached.

    If a target was given, only its distance is exact.
    """

    distance: FloatArray  # the exact distance (n,), ``inf`` where no path leads
    reached: IntArray  # the window by which a vertex (n,) is reached; −1 − u: along the edge from u
    side: IntArray  # the side (w,) by which a window enters a face
    before: IntArray  # the face (w,) from which a window comes
    parent: IntArray  # the window (w,) that a window continues, or −1
    root: IntArray  # the vertex (w,) from which the rays of a window come
    source: FloatArray  # the root (w, 2) in the plane of the face entered, whose side begins at (0, 0)


def windows_from(
    unfolded: UnfoldedFaces, points: FloatArray, source: int, bound: FloatArray, target: int = -1
) -> Windows:
    """Propagate windows from a vertex until all distances (n,), or the distance of a target, are known."""
    limit = memory_budget() // BYTES_PER_WINDOW
    windows = Windows(*_propagate(unfolded, points, source, target, bound.copy(), limit))
    require_memory(
        float(BYTES_PER_WINDOW) * len(windows.side),
        "the windows of exact distances",
        "many faces without area may be the reason: look at check(mesh); or use engine 'fast_marching'",
    )
    return windows


@compiled()
def _distance_to_segment(points: FloatArray, a: int, b: int, low: float, high: float, target: int) -> float:
    """Euclidean distance of a point from the part low…high, in fractions, of the segment from a to b."""
    along = 0.0
    squared = 0.0
    for axis in range(3):
        step = points[b, axis] - points[a, axis]
        along += step * (points[target, axis] - points[a, axis])
        squared += step * step
    fraction = min(max(along / squared, low), high) if squared > 0.0 else low
    total = 0.0
    for axis in range(3):
        place = points[a, axis] + fraction * (points[b, axis] - points[a, axis])
        total += (points[target, axis] - place) ** 2
    return float(np.sqrt(total))


@compiled()
def _add(
    unfolded: UnfoldedFaces,
    windows: list[tuple[int, int, int, int, float, float, float, float, float]],
    queue: list[tuple[float, int]],
    goal: tuple[FloatArray, int, FloatArray],
    exit_side: int,
    light: tuple[float, float, float, float, float],
    root: int,
    parent: int,
    far_end: int,
) -> None:
    """Add the windows that leave a face by part low…high of a side, unless shorter paths beat them."""
    faces, length, apex = unfolded.faces, unfolded.length, unfolded.apex
    points, target, bound = goal
    # The root I is at (along, height) above the side, in the plane of the face, and at the distance
    # sigma from the source.
    low, high, along, height, sigma = light
    full = length[exit_side]
    if high - low <= MIN_WIDTH_EDGES * full:
        return
    face, i = exit_side // 3, exit_side % 3
    a, b, c = faces[face, i], faces[face, (i + 1) % 3], faces[face, (i + 2) % 3]
    from_low = sigma + np.hypot(along - low, height)  # σ + |I X| at X = low
    from_high = sigma + np.hypot(along - high, height)
    # The filter of Xin & Wang 2009. A window is useless if for every X in it the way around one
    # corner v of the face is shorter, bound(v) + |v X| < σ + |I X|. It is enough to look at the end
    # X that is farther from v: if Y is nearer to v, the segments v X and I Y cross, and the
    # diagonals of a quadrilateral are together no shorter than two opposite sides:
    #   |v X| + |I Y| ≥ |v Y| + |I X|, so that |v X| − |I X| is greatest at the far end.
    # The far end is high for v = a, low for v = b, and far_end (0: low, 1: high) for the third
    # corner c, which is on one side of all rays, because these came in through the side between c
    # and a or the side between c and b.
    keep = 1.0 - MIN_LOSS_RATIO
    if bound[a] + high < from_high * keep or bound[b] + full - low < from_low * keep:
        return
    end, from_end = (low, from_low) if far_end == 0 else (high, from_high)
    if bound[c] + np.hypot(apex[exit_side, 0] - end, apex[exit_side, 1]) < from_end * keep:
        return
    # The key is the least distance in the window: straight down from the root if its foot is
    # inside, otherwise at an end. On the way to a target, no path through this window is shorter
    # than the key plus the straight line through space: the order of A*.
    key = sigma + height if low <= along <= high else min(from_low, from_high)
    if target >= 0:
        key += _distance_to_segment(points, a, b, low / full, high / full, target)
        if key > bound[target] * (1.0 + MIN_LOSS_RATIO):
            return
    edge = unfolded.edge[exit_side]
    for k in range(unfolded.first[edge], unfolded.first[edge + 1]):
        side = unfolded.sides[k]  # a side of another face at the edge
        if side == exit_side:
            continue
        # The next face is unfolded to the other side of the edge. Its side may run the other way: t
        # becomes full − t.
        same = faces[side // 3, side % 3] == a
        start, stop = (low, high) if same else (full - high, full - low)
        heappush(queue, (key, len(windows)))
        windows.append(
            (side, face, parent, root, start, stop, along if same else full - along, -height, sigma)
        )


@compiled()
def _propagate(
    unfolded: UnfoldedFaces, points: FloatArray, source: int, target: int, bound: FloatArray, limit: int
) -> tuple[FloatArray, IntArray, IntArray, IntArray, IntArray, IntArray, FloatArray]:
    """Compute the fields of `Windows`; give up at a limit of windows."""
    # Mitchell, Mount & Papadimitriou, *The discrete geodesic problem*, SIAM J. Comput. 1987; Chen & Han,
    # *Shortest paths on a polyhedron*, SoCG 1990; the filter and the queue of Xin & Wang, *Improving Chen and
    # Han's algorithm on the discrete geodesic problem*, TOG 2009. A shortest path is straight in each face,
    # goes straight across an edge once its two faces are unfolded into one plane, and bends only at vertices
    # (*roots*). So the light of a root is followed through rows of unfolded faces. A *window* is the part
    # low…high of a side by which light enters a face; there the distance from the source is
    #   d(t) = σ + |(t, 0) − (px, py)|,   low ≤ t ≤ high,
    # with the root at (px, py), py ≤ 0, in the frame of the side, and σ the distance of the root. Unlike
    # those of Mitchell et al., windows on one edge are not trimmed against one another: that takes O(n²)
    # windows in the worst case too, but no search among intervals. A window that a shorter path beats is
    # dropped by the filter of `_add`, or where a corner is split (below). ``bound`` (n,) holds lengths of
    # some paths to each vertex, such as paths along edges, and is lowered. The queue holds the numbers of
    # windows (≥ 0) and roots (−1 − v) from which light has to spread, by distance.
    faces, length, apex = unfolded.faces, unfolded.length, unfolded.apex
    first, edge = unfolded.first, unfolded.edge
    corner_first, bends = unfolded.corner_first, unfolded.bends
    n = len(bends)
    distance = np.full(n, np.inf)
    reached = np.full(n, -1, np.int64)
    spread_at = np.full(n, np.inf)  # distance (n,) of a vertex from the source when it last became a root
    # For the best window that enters a face by each side (see below): its distance at the opposite corner c,
    # and where the ray to c crosses the side.
    split_at, split_ray = np.full(len(length), np.inf), np.zeros(len(length))
    # an empty list, from which numba infers the types of an entry
    windows = [(0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0) for _ in range(0)]
    queue = [(0.0, -1 - source)]
    distance[source] = 0.0
    bound[source] = 0.0
    goal = (points, target, bound)
    while len(queue) > 0 and len(windows) <= limit:
        key, item = heappop(queue)
        if target >= 0 and key > bound[target] * (1.0 + MIN_LOSS_RATIO):
            break
        if item < 0:
            # Light spreads from a vertex, along the edges to its neighbours and through the sides opposite.
            v = -1 - item
            sigma = distance[v]
            if spread_at[v] <= sigma:
                continue
            spread_at[v] = sigma
            for k in range(corner_first[v], corner_first[v + 1]):
                face, i = unfolded.corners[k] // 3, unfolded.corners[k] % 3
                exit_side = 3 * face + (i + 1) % 3
                for j in range(1, 3):
                    u = faces[face, (i + j) % 3]
                    d = sigma + (length[3 * face + i] if j == 1 else length[3 * face + (i + 2) % 3])
                    _reach(u, d, -1 - v, distance, reached, bends, queue, goal)
                light = (0.0, length[exit_side], apex[exit_side, 0], apex[exit_side, 1], sigma)
                _add(unfolded, windows, queue, goal, exit_side, light, v, -1, 0)
            continue
        side, _, _, root, low, high, px, py, sigma = windows[item]
        if sigma > distance[root]:  # a shorter path has reached the root since
            continue
        face, i = side // 3, side % 3
        c = faces[face, (i + 2) % 3]
        full, x, y = length[side], apex[side, 0], apex[side, 1]
        # p + s (c − p) has the ordinate 0 at s = −py / (y − py): there the ray to the corner c =
        # (x, y) crosses the side. Rays at the left of it leave the face by the side from c to a,
        # those at the right by the side from b to c.
        ray = px - (x - px) * py / (y - py)
        slack = MAX_MISS_EDGES * full
        left, right = ray > low, ray < high
        if low - slack <= ray <= high + slack:
            d = sigma + np.hypot(x - px, y - py)
            _reach(c, d, item, distance, reached, bends, queue, goal)
            # "One angle, one split" (Chen & Han 1990): several windows may enter a face at one side
            # with light on both sides of its corner c. Only the window that reaches c first leaves the
            # face by both other sides. Rays of another window beyond this path to c would cross the
            # path, and shortest paths from one source do not cross.
            if left and right and first[edge[side] + 1] - first[edge[side]] == 2:
                if d < split_at[side]:
                    split_at[side], split_ray[side] = d, ray
                elif d > split_at[side] * (1.0 + MIN_LOSS_RATIO):
                    if ray < split_ray[side]:
                        right = False
                    elif ray > split_ray[side]:
                        left = False
        for j in range(1, 3):
            if not (right if j == 1 else left):
                continue
            exit_side = 3 * face + (i + j) % 3
            # Both exit sides are treated alike, from the end that each has in common with the side entered:
            # from b at the right, mirrored, and from a at the left. near…far is the part of the side entered
            # whose light falls on the exit side.
            if j == 1:
                near, far = full - high, full - max(low, ray)
                ax, sx = full - x, full - px
            else:
                near, far = low, min(high, ray)
                ax, sx = x, px
            begin = _fraction(near, ax, y, sx, py)
            end = _fraction(far, ax, y, sx, py) if far < (full - ray if j == 1 else ray) else 1.0
            reach = length[exit_side]
            if reach == 0.0:
                continue
            # The root in the frame of the side that the light leaves by: its components along and
            # at right angles to it.
            along = (sx * ax + py * y) / reach  # from the common end of both sides
            height = abs(sx * y - py * ax) / reach
            if j == 1:
                light = (begin * reach, end * reach, along, height, sigma)
            else:
                light = ((1.0 - end) * reach, (1.0 - begin) * reach, reach - along, height, sigma)
            _add(unfolded, windows, queue, goal, exit_side, light, root, item, j - 1)
    numbers, sources = np.zeros((len(windows), 4), np.int64), np.zeros((len(windows), 2))
    for k, (side, face, parent, root, _, _, px, py, _) in enumerate(windows):
        numbers[k] = side, face, parent, root
        sources[k] = px, py
    return distance, reached, numbers[:, 0], numbers[:, 1], numbers[:, 2], numbers[:, 3], sources


@compiled()
def _reach(
    vertex: int,
    length: float,
    by: int,
    distance: FloatArray,
    reached: IntArray,
    bends: BoolArray,
    queue: list[tuple[float, int]],
    goal: tuple[FloatArray, int, FloatArray],
) -> None:
    """Note a path to a vertex if it is the shortest yet; queue the vertex if rays can bend there."""
    points, target, bound = goal
    if length < distance[vertex] * (1.0 - MIN_GAIN_RATIO):
        distance[vertex] = length
        bound[vertex] = min(bound[vertex], length)
        reached[vertex] = by
        if bends[vertex]:
            more = _distance_to_segment(points, vertex, vertex, 0.0, 0.0, target) if target >= 0 else 0.0
            heappush(queue, (length + more, -1 - vertex))


@compiled()
def _fraction(t: float, x: float, y: float, px: float, py: float) -> float:
    """Fraction of the way from (0, 0) to (x, y) where the ray from (px, py) through (t, 0) arrives; py ≤ 0 < y."""
    # s (x, y) = p + r (t − px, −py), so that s (x (−py) − y (t − px)) = −py t
    below = x * py + y * (t - px)
    return min(max(py * t / below, 0.0), 1.0) if below != 0.0 else 0.0
