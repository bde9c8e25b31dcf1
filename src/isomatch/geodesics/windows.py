"""Windows of straight rays, propagated over the faces of a mesh: exact distances, and the paths that have them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.memory import memory_budget, require_memory
from isomatch.surfaces import Mesh, fans

TIE = 1e-14  # of a distance; a vertex is reached anew only by what is shorter by more
LOSS = 1e-12  # of a distance; a window is dropped only if what beats it is shorter by more
GRAZE = 1e-9  # of an edge; a ray so far beside a window is of it, which makes a path too short by the square of that
FLAT = 1e-12  # of an angle; rays do not bend around a vertex whose angle is larger by no more
BYTES = 270  # for each window, while arrays grow
NARROW = 1e-15  # of an edge; windows so narrow are of rounding
THINNEST = 1e-13  # height of a face over a side, in sides


class UnfoldedFaces(NamedTuple):
    """The faces of a mesh in the plane, and what meets at side 3 f + i, from corner i to corner i + 1."""

    faces: IntArray  # (m, 3)
    length: FloatArray  # (3 m,) of each side
    # (3 m, 2) the third corner, the side from (0, 0) to (length, 0); its ordinate is positive
    apex: FloatArray
    edge: IntArray  # (3 m,) of each side
    first: IntArray  # (e + 1,) the sides of edge i are sides[first[i]:first[i + 1]]
    sides: IntArray  # (3 m,)
    # (n + 1,) the corners of vertex v are corners[corner_first[v]:corner_first[v + 1]]
    corner_first: IntArray
    corners: IntArray  # (3 m,)
    bends: BoolArray  # (n,) where a shortest path may bend

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
        # A shortest path passes straight through a vertex or bends where there are at least π of angle on both sides of
        # it (Mitchell, Mount & Papadimitriou 1987, lemma 3.5): where the angle of the faces is at least 2 π; on a
        # boundary, along which it may run, at least π; and where the mesh is not manifold. At 2 π it is straight: no
        # root is needed.
        angle = np.arctan2(apex[:, 1], apex[:, 0])
        total = np.bincount(faces.ravel(), angle, mesh.n_vertices)
        straight = np.full(mesh.n_vertices, 2 * np.pi)
        straight[edges.ends[edges.n_faces == 1]] = np.pi
        bends = total > straight * (1 + FLAT)
        bends[edges.ends[edges.n_faces > 2]] = True
        bends |= fans(faces, edges, mesh.n_vertices) > 1
        return cls(faces, length, apex, edge, first, sides, corner_first, corners, bends)


class Windows(NamedTuple):
    """The windows of rays from one vertex, and how each vertex is reached."""

    distance: FloatArray  # (n,) exact; inf where no path leads. Only that of the target, if there was one
    reached: IntArray  # (n,) the window through whose face a vertex is reached; −1 − u if along an edge from vertex u
    root: IntArray  # (w,)
    parent: IntArray  # (w,) the window that each continues, or −1
    side: IntArray  # (w,) where it enters a face
    before: IntArray  # (w,) the face that it comes from
    source: FloatArray  # (w, 2) the root in the plane of the face entered, with the side from (0, 0) to (length, 0)


class _Queue(NamedTuple):
    """Windows so far, and a binary heap of those (≥ 0) and of roots (−1 − v) from which light has to spread."""

    numbers: IntArray  # (w, 4) side, face before, parent, root
    values: FloatArray  # (w, 5) low, high, root in the plane of the face entered (x, y ≤ 0), its distance from the source
    sizes: IntArray  # numbers of windows, and of items in the heap
    keys: FloatArray
    items: IntArray


def windows_from(
    unfolded: UnfoldedFaces, points: FloatArray, source: int, bound: FloatArray, target: int = -1
) -> Windows:
    """Propagate windows from a vertex until all distances (n,) are known, or that of one target; see `_propagate`."""
    most = memory_budget() // BYTES
    distance, reached, numbers, values = _propagate(unfolded, points, source, target, bound.copy(), most)
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
def _push(queue: _Queue, key: float, item: int) -> None:
    keys, items, sizes = queue.keys, queue.items, queue.sizes
    hole = sizes[1]
    sizes[1] += 1
    while hole > 0:
        above = (hole - 1) // 2
        if keys[above] <= key:
            break
        keys[hole], items[hole] = keys[above], items[above]
        hole = above
    keys[hole], items[hole] = key, item


@compiled()
def _pop(queue: _Queue) -> tuple[float, int]:
    """Take the item with the least key."""
    keys, items, sizes = queue.keys, queue.items, queue.sizes
    key, item = keys[0], items[0]
    sizes[1] -= 1
    size = sizes[1]
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
    unfolded: UnfoldedFaces,
    queue: _Queue,
    goal: tuple[FloatArray, int, FloatArray],
    own: int,
    light: tuple[float, float, float, float, float],
    root: int,
    parent: int,
    far_end: int,
) -> None:
    """Add the windows that leave a face by part low…high of its side ``own``, unless shorter paths make them useless."""
    faces, length, apex = unfolded.faces, unfolded.length, unfolded.apex
    points, target, bound = goal
    # the root I is at (along, height) over the side, in the plane of the face, and at the distance sigma from the source
    low, high, along, height, sigma = light
    full = length[own]
    if high - low <= NARROW * full:
        return
    face, i = own // 3, own % 3
    a, b, c = faces[face, i], faces[face, (i + 1) % 3], faces[face, (i + 2) % 3]
    from_low = sigma + np.hypot(along - low, height)  # σ + |I X| at X = low
    from_high = sigma + np.hypot(along - high, height)
    # The filter of Xin & Wang 2009. A window is useless if for every X in it the way around one corner v of the face is
    # shorter, bound(v) + |v X| < σ + |I X|. It is enough to look at the end X that is farther from v: if Y is nearer to
    # v, the segments v X and I Y cross, and the diagonals of a quadrilateral are together no shorter than two opposite
    # sides:
    #   |v X| + |I Y| ≥ |v Y| + |I X|, so that |v X| − |I X| is greatest at the far end.
    # That is high for v = a, low for v = b, and far_end (0: low, 1: high) for the third corner c, which is on one side of
    # all rays, for these came in over the side between c and a or that between c and b.
    if bound[a] + high < from_high * (1.0 - LOSS) or bound[b] + full - low < from_low * (1.0 - LOSS):
        return
    end, there = (low, from_low) if far_end == 0 else (high, from_high)
    if bound[c] + np.hypot(apex[own, 0] - end, apex[own, 1]) < there * (1.0 - LOSS):
        return
    # the least distance in the window: straight down from the root if its foot is inside, otherwise at an end. On the way
    # to a target, no path by this window is shorter than that and then straight through space: the order of A*
    key = sigma + height if low <= along <= high else min(from_low, from_high)
    if target >= 0:
        key += _to_target(points, a, b, low / full, high / full, target)
        if key > bound[target] * (1.0 + LOSS):
            return
    edge = unfolded.edge[own]
    for k in range(unfolded.first[edge], unfolded.first[edge + 1]):
        side = unfolded.sides[k]  # of another face at the same edge, of which there are several off manifolds
        if side == own:
            continue
        same = faces[side // 3, side % 3] == a  # it runs the same way, or the other, where t becomes full − t
        size = queue.sizes[0]
        numbers, values = queue.numbers[size], queue.values[size]
        numbers[0], numbers[1], numbers[2], numbers[3] = side, face, parent, root
        values[0] = low if same else full - high
        values[1] = high if same else full - low
        values[2] = along if same else full - along
        values[3] = -height  # the next face is unfolded to the other side of the edge
        values[4] = sigma
        _push(queue, key, size)
        queue.sizes[0] += 1


@compiled()
def _propagate(
    unfolded: UnfoldedFaces, points: FloatArray, source: int, target: int, bound: FloatArray, limit: int
) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """Return distances, how each vertex is reached, and the windows, see `_Queue`; give up at a limit of windows."""
    # Mitchell, Mount & Papadimitriou, *The discrete geodesic problem*, SIAM J. Comput. 1987; Chen & Han, *Shortest
    # paths on a polyhedron*, SoCG 1990; the filter and the queue of Xin & Wang, *Improving Chen and Han's algorithm on
    # the discrete geodesic problem*, TOG 2009. A shortest path is straight in each face, goes straight over an edge
    # once its two faces are unfolded into one plane, and bends only at vertices (*roots*). So the light of a root is
    # followed through rows of unfolded faces. A *window* is the part low…high of a side by which it enters a face;
    # there the distance is
    #   d(t) = σ + |(t, 0) − (px, py)|,   low ≤ t ≤ high,
    # with the root at (px, py), py ≤ 0, in the frame of the side, and σ its own distance. Unlike MMP, windows on one
    # edge are not trimmed against one another, which takes O(n²) windows in the worst case too but no search among
    # intervals: those that a shorter path beats are dropped by the filter of `_add`, or where a corner is split
    # (below). ``bound`` (n,) holds lengths of some paths to each vertex, such as those along edges, and is lowered.
    faces, length, apex = unfolded.faces, unfolded.length, unfolded.apex
    first, edge = unfolded.first, unfolded.edge
    corner_first, bends = unfolded.corner_first, unfolded.bends
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
    room = (most + 2) * max(widest, 1)  # windows that one item may add
    size = 4 * room + 1024
    queue = _Queue(
        np.zeros((size, 4), np.int64),
        np.zeros((size, 5)),
        np.zeros(2, np.int64),
        np.zeros(size),
        np.zeros(size, np.int64),
    )
    distance[source] = 0.0
    bound[source] = 0.0
    _push(queue, 0.0, -1 - source)
    while queue.sizes[1] > 0 and queue.sizes[0] <= limit:
        key, at = _pop(queue)
        if target >= 0 and key > bound[target] * (1.0 + LOSS):
            break
        numbers, values, sizes, keys, items = queue
        if sizes[0] + room > len(numbers):
            numbers = np.concatenate((numbers, np.zeros_like(numbers)))
            values = np.concatenate((values, np.zeros_like(values)))
        if sizes[1] + 3 * room > len(keys):
            keys = np.concatenate((keys, np.zeros_like(keys)))
            items = np.concatenate((items, np.zeros_like(items)))
        queue = _Queue(numbers, values, sizes, keys, items)
        goal = (points, target, bound)
        if at < 0:  # light spreads from a vertex, along the edges to neighbours and over the sides opposite
            v = -1 - at
            sigma = distance[v]
            if spread[v] <= sigma:
                continue
            spread[v] = sigma
            for k in range(corner_first[v], corner_first[v + 1]):
                face, i = unfolded.corners[k] // 3, unfolded.corners[k] % 3
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
                            _push(queue, d + more, -1 - u)
                light = (0.0, length[own], apex[own, 0], apex[own, 1], sigma)
                _add(unfolded, queue, goal, own, light, v, -1, 0)
            continue
        side, root = numbers[at, 0], numbers[at, 3]
        low, high, px, py, sigma = values[at]
        if sigma > distance[root]:  # the root has been reached by a shorter path since
            continue
        face, i = side // 3, side % 3
        c = faces[face, (i + 2) % 3]
        full, x, y = length[side], apex[side, 0], apex[side, 1]
        # p + s (c − p) has the ordinate 0 at s = −py / (y − py): there the ray to the corner c = (x, y) crosses the side.
        # Rays at the left of it leave the face by the side from c to a, those at the right by the side from b to c
        ray = px - (x - px) * py / (y - py)
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
                    _push(queue, d + more, -1 - c)
            # "one angle, one split" (Chen & Han 1990): of the windows that enter a face at one side, and whose light
            # falls on both sides of its corner c, only the one that reaches c first goes on at both. Of another one,
            # the rays that lie beyond the path of that window to c would cross it, and shortest paths from one source
            # do not cross
            if left and right and first[edge[side] + 1] - first[edge[side]] == 2:
                if d < split_at[side]:
                    split_at[side], split_ray[side] = d, ray
                elif d > split_at[side] * (1.0 + LOSS):
                    if ray < split_ray[side]:
                        right = False
                    elif ray > split_ray[side]:
                        left = False
        for j in range(1, 3):
            if not (right if j == 1 else left):
                continue
            own = 3 * face + (i + j) % 3
            # Both sides are treated alike, from the end that each has in common with the one entered: from b at the
            # right, mirrored, and from a at the left. near…far is the part of the side entered whose light falls on it
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
            # the root in the frame of the side that the light leaves by: its components along and at right angles to it
            along = (sx * ax + py * y) / reach  # from that end
            height = abs(sx * y - py * ax) / reach
            if j == 1:
                light = (begin * reach, end * reach, along, height, sigma)
                _add(unfolded, queue, goal, own, light, root, at, 0)
            else:
                light = ((1.0 - end) * reach, (1.0 - begin) * reach, reach - along, height, sigma)
                _add(unfolded, queue, goal, own, light, root, at, 1)
    return distance, reached, queue.numbers[: queue.sizes[0]], queue.values[: queue.sizes[0]]


@compiled()
def _share(t: float, x: float, y: float, px: float, py: float) -> float:
    """Share of the way from (0, 0) to (x, y) at which the ray from (px, py) through (t, 0) arrives; py ≤ 0 < y."""
    # s (x, y) = p + r (t − px, −py), so that s (x (−py) − y (t − px)) = −py t
    below = x * py + y * (t - px)
    return min(max(py * t / below, 0.0), 1.0) if below != 0.0 else 0.0
