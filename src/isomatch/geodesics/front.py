"""The compiled loop of fast marching: one front from one vertex to all others in O(n log n)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from isomatch.geodesics.stencil import Stencil
from isomatch.loading.compiled import compiled
from isomatch.runtime.threads import parallel_rows
from isomatch.values.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray

MOST_SHIFT = 0.02  # of an edge; limits how much the curvature correction changes a distance in one triangle
MOST_FOCUS = 0.3  # a front converges at most to a focus 1 / 0.3 steps ahead
TIE = 1e-6  # of a step; paths that differ by less count as equal, and the first one found is kept


def march(stencil: Stencil, sources: IntArray) -> FloatArray:
    """Distances from each source to every vertex.

    Parameters
    ----------
    stencil : Stencil
        The update stencils of the surface, from `stencil_of`.
    sources : (m,) array of int
        Source vertices, each a separate front.

    Returns
    -------
    (m, n) array of float
        Distances in mesh units; ``inf`` where no path leads.

    Notes
    -----
    *Update.* Two vertices of a triangle have known distances. The *virtual source* is the point of the triangle's
    plane at these distances from them, on the other side of the edge between them. The third vertex gets its straight
    distance from the virtual source if the straight line crosses that edge, and otherwise the distance of one of the
    two vertices plus the length of an edge. On a flat surface this is exact up to the order in which vertices become
    known.

    *Curvature correction.* On a curved surface a front at distance d does not have the curvature 1/d of a circle. Its
    curvature κ obeys the Riccati equation κ' = −κ² − K along its rays, K being the Gaussian curvature. The *excess*
    ε = κ − 1/d is propagated from vertex to vertex. Where a ray crosses an edge of length L at t, at the angle α, the
    distance is less than that from the virtual source by ½ ε sin²α t (L − t), to leading order. Without this
    correction the error is of first order in the edge length, and on rough meshes three times as large.

    *Cost.* O(n log n) time per source; sources are distributed over threads, each with 28 bytes per vertex.
    """
    out = np.full((len(sources), stencil.n_vertices), np.inf)

    def front(row: int) -> None:
        _march(stencil, sources[row], out[row], _NO_BOUND, _TO_ALL, np.inf)

    parallel_rows(front, len(sources))
    return out


class Balls(NamedTuple):
    """The points within a radius of m centres.

    Parameters
    ----------
    start : (m + 1,) array of int
        Those of centre i are in ``start[i]:start[i + 1]``.
    points : (b,) array of int
    distances : (b,) array of float
        From the centre.
    """

    start: IntArray
    points: IntArray
    distances: FloatArray

    @classmethod
    def of(cls, parts: Sequence[tuple[IntArray, FloatArray]]) -> Self:
        """Join the points and distances of single balls."""
        start = np.zeros(len(parts) + 1, dtype=np.int64)
        np.cumsum([len(points) for points, _ in parts], out=start[1:])
        points = np.concatenate([_TO_ALL, *(points for points, _ in parts)])
        return cls(start, points, np.concatenate([_NO_BOUND, *(distances for _, distances in parts)]))


def march_within(stencil: Stencil, sources: IntArray, radius: float) -> Balls:
    """Distances from each source to the vertices within a radius, the same numbers as by `march`.

    A front ends at the radius. O(b log b) time for b vertices, and 28 bytes to be cleared for each of all.
    """
    parts: list[tuple[IntArray, FloatArray]] = [(_TO_ALL, _NO_BOUND)] * len(sources)

    def front(row: int) -> None:
        column = np.full(stencil.n_vertices, np.inf)
        _march(stencil, sources[row], column, _NO_BOUND, _TO_ALL, radius)
        inside = np.flatnonzero(column <= radius)
        parts[row] = inside, column[inside]

    parallel_rows(front, len(sources))
    return Balls.of(parts)


def march_to(stencil: Stencil, pairs: IntArray) -> FloatArray:
    """Distances (m,) of m pairs (source, target), the same numbers as by `march`.

    A front ends at the farthest target of its source: where pairs are near, it passes a small part of the surface.
    """
    sources, of_pair = np.unique(pairs[:, 0], return_inverse=True)
    order = np.argsort(of_pair, kind="stable")
    ends = np.searchsorted(of_pair[order], np.arange(len(sources) + 1))
    distances = np.full(len(pairs), np.inf)

    def front(row: int) -> None:
        chosen = order[ends[row] : ends[row + 1]]
        column = np.full(stencil.n_vertices, np.inf)
        _march(stencil, sources[row], column, _NO_BOUND, pairs[chosen, 1], np.inf)
        distances[chosen] = column[pairs[chosen, 1]]

    parallel_rows(front, len(sources))
    return distances


def march_bounded(stencil: Stencil, source: int, nearest: FloatArray) -> None:
    """Lower ``nearest`` (n,) in place to the distance from one more source, marching only where it is the nearest.

    The fronts of p successive sources together cost about log p full ones.
    """
    distance = np.full(stencil.n_vertices, np.inf)
    _march(stencil, source, distance, nearest, _TO_ALL, np.inf)
    np.minimum(nearest, distance, out=nearest)


_NO_BOUND = np.zeros(0)
_TO_ALL = np.zeros(0, np.int64)


@compiled(inline="always")
def _excess(before: float, radius: float, step: float, gauss: float) -> float:
    """Excess of the front's curvature at distance ``radius``, if it was ``before`` one ``step`` earlier.

    Solves the Riccati equation κ' = −κ² − K over the step, to first order in K. The result is limited, because the
    curvature of rough meshes is noisy: the radius of a diverging front is at least one step, and that of a converging
    front at least 1 / MOST_FOCUS steps.
    """
    start = radius - step
    if step <= 0.0:  # c is on the edge, or coincides with v
        return before
    spread = before * start  # κ start − 1: how much faster than a circle the front spreads, at the start
    share = start / radius
    # κ' = −κ²: the radius of curvature 1/κ grows by the step. A front that converges is kept before its focus.
    bent = (1.0 + spread) / max(radius + spread * step, 0.5 * start)
    # κ = 1/r + δ with small δ: (r² δ)' = −K r², integrated from start to radius and divided by radius²
    bent -= gauss * step * (1.0 + share + share * share) / 3.0
    return min(max(bent, -MOST_FOCUS / step), 1.0 / step) - 1.0 / radius


def _march(
    stencil: Stencil, source: int, distance: FloatArray, bound: FloatArray, targets: IntArray, farthest: float
) -> None:
    """Set distances in increasing order, as in Dijkstra's algorithm, with an indexed binary heap.

    ``distance`` (n,) is all ``inf`` on entry and holds the result on return. ``bound`` is empty or (n,): a vertex no
    nearer than its bound stays at ``inf``, and the front does not continue from it. The front ends at the distance
    ``farthest``, or as soon as all ``targets`` are known, if there are any; entries of ``distance`` beyond are then
    meaningless.
    """
    n = len(distance)
    awaited = np.zeros(n if len(targets) else 0, dtype=bool)
    awaited[targets] = True
    known = np.full(n, np.inf)  # final distances; inf while tentative, −1 where the bound is nearer
    excess = np.zeros(n)
    slot = np.full(n, -1, dtype=np.int32)  # index in the heap, −1 for a vertex never reached
    heap = np.empty(n, dtype=np.int32)
    missing = int(np.count_nonzero(awaited))
    _advance(*stencil.arrays, source, distance, bound, awaited, missing, farthest, known, excess, slot, heap)


@compiled(fastmath={"contract", "arcp", "nsz"})
def _advance(
    start: IntArray,
    other: AnyArray,
    target: AnyArray,
    shape: Float32Array,
    curvature: FloatArray,
    source: int,
    distance: FloatArray,
    bound: FloatArray,
    awaited: BoolArray,
    missing: int,
    farthest: float,
    known: FloatArray,
    excess: FloatArray,
    slot: AnyArray,
    heap: AnyArray,
) -> None:
    size = 1
    heap[0] = source
    slot[source] = 0
    distance[source] = 0.0
    while size > 0:
        v = heap[0]
        dv = distance[v]
        if dv > farthest:
            return
        size -= 1
        if size > 0:  # sift the last entry down from the root
            moved = heap[size]
            key = distance[moved]
            hole = 0
            while True:
                child = 2 * hole + 1
                if child >= size:
                    break
                if child + 1 < size and distance[heap[child + 1]] < distance[heap[child]]:
                    child += 1
                if distance[heap[child]] >= key:
                    break
                heap[hole] = heap[child]
                slot[heap[hole]] = hole
                hole = child
            heap[hole] = moved
            slot[moved] = hole
        if len(bound) and dv >= bound[v]:  # an earlier source is nearer: the front ends here
            distance[v] = np.inf
            known[v] = -1.0
            continue
        known[v] = dv
        if missing > 0 and awaited[v]:
            missing -= 1
            if missing == 0:
                return
        for e in range(start[v], start[v + 1]):
            c = target[e]
            if known[c] != np.inf:
                continue
            step = np.float64(shape[e, 3])
            candidate = radius = dv + step  # along the edge from v
            bent = excess[v]
            gauss = curvature[v]
            w = other[e]
            dw = known[w]
            if dw != np.inf and dw >= 0.0 and shape[e, 0] > 0.0:
                length, x, y = np.float64(shape[e, 0]), np.float64(shape[e, 1]), np.float64(shape[e, 2])
                # in the plane of the stencil, v = (0, 0), w = (length, 0), c = (x, y), y > 0; the virtual source at
                # distances dv and dw is (sx, −√squared), and height is how far above it c lies
                # sx² + squared = dv², (sx − length)² + squared = dw²
                sx = 0.5 * (length + (dv * dv - dw * dw) / length)
                squared = dv * dv - sx * sx
                if squared > 0.0:  # else these circles do not meet: |dv − dw| > length, by curvature
                    height = y + np.sqrt(squared)
                    # abscissa at which the ray from there to c crosses the edge, times height
                    crossing = sx * y + x * (height - y)
                    if crossing >= 0.0 and crossing <= length * height:
                        straight = np.sqrt((x - sx) ** 2 + height * height)
                        part = crossing / (height * length)  # of the edge, from v
                        mean = excess[v] + part * (excess[w] - excess[v])
                        # ½ ε sin²α t (L − t) with sin α = height / straight and t = part L
                        shift = 0.5 * mean * (height / straight) ** 2 * part * (1.0 - part) * length * length
                        most = MOST_SHIFT * min(length, straight)
                        shift = min(max(shift, -most), most)
                        if straight - shift < candidate:
                            candidate = straight - shift
                            radius = straight
                            step = straight * y / height  # length of the ray beyond the edge
                            bent = mean
                            gauss = curvature[v] + part * (curvature[w] - curvature[v])
            if candidate < distance[c] - TIE * step:
                distance[c] = candidate
                excess[c] = _excess(bent, radius, step, 0.5 * (gauss + curvature[c]))
                hole = slot[c]  # insert c, or sift it up from where it is
                if hole < 0:
                    hole = size
                    size += 1
                while hole > 0:
                    parent = (hole - 1) // 2
                    if distance[heap[parent]] <= candidate:
                        break
                    heap[hole] = heap[parent]
                    slot[heap[hole]] = hole
                    hole = parent
                heap[hole] = c
                slot[c] = hole
