"""Fast marching on triangles: geodesic distance from a vertex to all others in O(n log n)."""

from __future__ import annotations

import numba
import numpy as np

from isomatch._arrays import AnyArray, Float32Array, FloatArray, IntArray
from isomatch._threads import n_threads, parallel_map
from isomatch.geodesics.stencil import Stencil


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
    become known. Sources are shared among threads; O(n log n) time each and 20 bytes a vertex and thread.
    """
    out = np.full((len(sources), stencil.n_vertices), np.inf)
    threads = max(1, min(n_threads(), len(sources)))

    def rows(first: int) -> None:
        for row in range(first, len(sources), threads):
            _march(
                stencil.start, stencil.other, stencil.target, stencil.shape, sources[row], out[row], _NO_BOUND
            )

    parallel_map(rows, range(threads))
    return out


def march_bounded(stencil: Stencil, source: int, nearest: FloatArray) -> None:
    """Lower ``nearest`` to the distance from one more source, marching only where that source is the nearest.

    ``nearest`` (n,) is changed in place. The fronts of p successive sources together cost about log p full ones.
    """
    distance = np.full(stencil.n_vertices, np.inf)
    _march(stencil.start, stencil.other, stencil.target, stencil.shape, source, distance, nearest)
    np.minimum(nearest, distance, out=nearest)


_NO_BOUND = np.zeros(0)


@numba.njit(cache=True, nogil=True, fastmath={"contract", "arcp", "nsz"})
def _march(
    start: IntArray,
    other: AnyArray,
    target: AnyArray,
    shape: Float32Array,
    source: int,
    distance: FloatArray,
    bound: FloatArray,
) -> None:  # pragma: no cover - compiled
    """Label-setting march with an indexed binary heap; ``distance`` (n,) enters as inf and leaves as the result.

    With a bound, a vertex that is no nearer than its bound is neither kept nor passed on.
    """
    n = len(start) - 1
    known = np.full(n, np.inf)
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
            candidate = dv + shape[e, 3]
            dw = known[other[e]]
            if dw != np.inf and dw >= 0.0:
                length, x, y = np.float64(shape[e, 0]), np.float64(shape[e, 1]), np.float64(shape[e, 2])
                sx = 0.5 * (length + (dv * dv - dw * dw) / length) if length > 0.0 else 0.0
                squared = dv * dv - sx * sx
                if squared > 0.0:
                    sy = np.sqrt(squared)
                    crossing = sx * y + x * sy  # where the line meets the edge, times (y + sy)
                    if crossing >= 0.0 and crossing <= length * (y + sy):
                        candidate = min(candidate, np.sqrt((x - sx) ** 2 + (y + sy) ** 2))
            if candidate < distance[c]:
                distance[c] = candidate
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
