"""A distance engine that keeps its columns, because the distortion of all maps of a pair has the same rows."""

from __future__ import annotations

import numpy as np

from isomatch.geodesics import DistanceEngine, pair_distances
from isomatch.values.arrays import FloatArray, IntArray


class CachingEngine:
    """A distance engine that keeps the columns it has computed.

    Parameters
    ----------
    engine : DistanceEngine
        Computes the columns.
    limit : float
        Bytes of columns to keep at most; further columns are computed each time.
    """

    def __init__(self, engine: DistanceEngine, limit: float) -> None:
        self.name, self.n_points = engine.name, engine.n_points
        self._engine = engine
        self._most = int(limit / (8 * max(self.n_points, 1)))
        self._kept: dict[int, FloatArray] = {}

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances from each of m sources; the caller may change the array."""
        wanted = np.asarray(sources).tolist()
        new = [vertex for vertex in dict.fromkeys(wanted) if vertex not in self._kept]
        computed = dict(zip(new, self._engine.distances_from(np.array(new)))) if new else {}
        columns = [self._kept.get(vertex, computed.get(vertex)) for vertex in wanted]
        for vertex in new[: self._most - len(self._kept)]:
            self._kept[vertex] = computed[vertex].copy()
        return np.array(columns, dtype=np.float64).reshape(len(wanted), self.n_points)

    def pair_distances(self, pairs: IntArray) -> FloatArray:
        """Distances (m,) of m pairs, as the engine finds them; nothing is kept."""
        return pair_distances(self._engine, pairs)

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` as the engine does; nothing is kept."""
        return self._engine.lower(nearest, source)
