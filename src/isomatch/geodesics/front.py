"""The compiled loop of fast marching: one front, from a vertex to all others, in O(n log n)."""

from __future__ import annotations

import numba
import numpy as np

from isomatch._arrays import AnyArray, Float32Array, FloatArray, IntArray
from isomatch._threads import n_threads, parallel_map
from isomatch.geodesics.stencil import Stencil

MOST_SHIFT = 0.02  # of an edge: most that the curvature of a front may change a distance by in one triangle
MOST_FOCUS = 0.3  # a front runs together no faster than to a point 1 / 0.3 steps ahead
TIE = 1e-6  # of a step: paths that differ by less are equal, and the first one found is kept


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
    A front is carried across a triangle by unfolding its *virtual source*: the point of the plane at the known
    distances from the two known vertices. Where the straight line from it to the third vertex misses the edge
    between them, the path runs along an edge. On a flat surface this is exact up to the order in which vertices
    become known. Sources are shared among threads; O(n log n) time each and 28 bytes a vertex and thread.

    On a curved surface a front at distance d is not curved like a circle of radius d. Its curvature κ obeys the
    Riccati equation κ' = −κ² − K along its rays, K being the Gaussian curvature. The *excess* ε = κ − 1/d is carried
    from vertex to vertex; where a ray crosses an edge of length L at t, under the angle α, the distance is less
    than that from the virtual source by ½ ε sin²α t (L − t), to leading order. Without this the error is of first
    order in the edge length, and on rough meshes three times as large.
    """
    out = np.full((len(sources), stencil.n_vertices), np.inf)
    threads = max(1, min(n_threads(), len(sources)))

    def rows(first: int) -> None:
        for row in range(first, len(sources), threads):
            _march(*stencil.arrays, sources[row], out[row], _NO_BOUND)

    parallel_map(rows, range(threads))
    return out


def march_bounded(stencil: Stencil, source: int, nearest: FloatArray) -> None:
    """Lower ``nearest`` to the distance from one more source, marching only where that source is the nearest.

    ``nearest`` (n,) is changed in place. The fronts of p successive sources together cost about log p full ones.
    """
    distance = np.full(stencil.n_vertices, np.inf)
    _march(*stencil.arrays, source, distance, nearest)
    np.minimum(nearest, distance, out=nearest)


_NO_BOUND = np.zeros(0)


@numba.njit(cache=True, nogil=True, inline="always")
def _excess(before: float, radius: float, step: float, gauss: float) -> float:  # pragma: no cover - compiled
    """Excess of a front's curvature at ``radius``, one ``step`` after it was ``before``.

    Limits keep rough meshes in order: a front is no more curved than a circle of one step around its last edge.
    """
    start = radius - step
    if step <= 0.0:
        return before
    spread = before * start  # how much faster than a circle the front spreads, at the start
    share = start / radius
    bent = (1.0 + spread) / max(radius + spread * step, 0.5 * start)
    bent -= gauss * step * (1.0 + share + share * share) / 3.0
    return min(max(bent, -MOST_FOCUS / step), 1.0 / step) - 1.0 / radius


@numba.njit(cache=True, nogil=True, fastmath={"contract", "arcp", "nsz"})
def _march(
    start: IntArray,
    other: AnyArray,
    target: AnyArray,
    shape: Float32Array,
    curvature: FloatArray,
    source: int,
    distance: FloatArray,
    bound: FloatArray,
) -> None:  # pragma: no cover - compiled
    """Label-setting march with an indexed binary heap; ``distance`` (n,) enters as inf and leaves as the result.

    With a bound, a vertex that is no nearer than its bound is neither kept nor passed on.
    """
    n = len(start) - 1
    known = np.full(n, np.inf)
    excess = np.zeros(n)
    slot = np.full(n, -1, np.int32)  # place in the heap
    heap = np.zeros(n, np.int32)
    size = 1
    heap[0] = source
    slot[source] = 0
    distance[source] = 0.0
    while size > 0:
        v = heap[0]
        dv = distance[v]
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
        if len(bound) and dv >= bound[v]:
            distance[v] = np.inf
            known[v] = -1.0
            continue
        known[v] = dv
        for e in range(start[v], start[v + 1]):
            c = target[e]
            if known[c] != np.inf:
                continue
            step = np.float64(shape[e, 3])
            candidate = radius = dv + step
            bent = excess[v]
            gauss = curvature[v]
            w = other[e]
            dw = known[w]
            if dw != np.inf and dw >= 0.0:
                length, x, y = np.float64(shape[e, 0]), np.float64(shape[e, 1]), np.float64(shape[e, 2])
                sx = 0.5 * (length + (dv * dv - dw * dw) / length) if length > 0.0 else 0.0
                squared = dv * dv - sx * sx
                if squared > 0.0:
                    height = y + np.sqrt(squared)
                    crossing = sx * y + x * (height - y)  # where the line meets the edge, times the height
                    if crossing >= 0.0 and crossing <= length * height:
                        straight = np.sqrt((x - sx) ** 2 + height * height)
                        part = crossing / (height * length)
                        mean = excess[v] + part * (excess[w] - excess[v])
                        shift = 0.5 * mean * (height / straight) ** 2 * part * (1.0 - part) * length * length
                        most = MOST_SHIFT * min(length, straight)
                        shift = min(max(shift, -most), most)
                        if straight - shift < candidate:
                            candidate = straight - shift
                            radius = straight
                            step = straight * y / height
                            bent = mean
                            gauss = curvature[v] + part * (curvature[w] - curvature[v])
            if candidate < distance[c] - TIE * step:
                distance[c] = candidate
                excess[c] = _excess(bent, radius, step, 0.5 * (gauss + curvature[c]))
                hole = slot[c]
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
