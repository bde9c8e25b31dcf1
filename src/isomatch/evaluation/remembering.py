"""Distance columns that are asked for again: those from the truth of a pair, for every method that is judged."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.geodesics import DistanceEngine
from isomatch.geodesics.protocol import ColumnEngine


class RememberingEngine(ColumnEngine):
    """An engine that keeps the columns it has computed.

    Parameters
    ----------
    engine : DistanceEngine
        Computes them.
    limit : float
        Most bytes to keep; what comes later is computed each time.
    """

    def __init__(self, engine: DistanceEngine, limit: float) -> None:
        self.name, self.n_points = engine.name, engine.n_points
        self._engine = engine
        self._most = int(limit / (8 * max(self.n_points, 1)))
        self._kept: dict[int, FloatArray] = {}

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` as the engine does; nothing is kept."""
        return self._engine.lower(nearest, source)

    def _columns(self, sources: IntArray) -> FloatArray:
        new = [vertex for vertex in dict.fromkeys(sources.tolist()) if vertex not in self._kept]
        computed = dict(zip(new, self._engine.distances_from(np.array(new)))) if new else {}
        columns = [self._kept.get(vertex, computed.get(vertex)) for vertex in sources.tolist()]
        for vertex in new[: self._most - len(self._kept)]:
            self._kept[vertex] = computed[vertex].copy()
        return np.array(columns, dtype=np.float64).reshape(len(sources), self.n_points)
