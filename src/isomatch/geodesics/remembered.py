"""Distance columns that are asked for again."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.geodesics.protocol import ColumnEngine, DistanceEngine


class Remembered(ColumnEngine):
    """An engine that keeps the columns it has computed.

    Parameters
    ----------
    engine : DistanceEngine
        Computes them.
    limit : float
        Most bytes to keep; what comes later is computed each time.
    """

    def __init__(self, engine: DistanceEngine, limit: float = 2**30) -> None:
        self.name, self.n_points = engine.name, engine.n_points
        self._engine = engine
        self._most = int(limit / (8 * max(self.n_points, 1)))
        self._kept: dict[int, FloatArray] = {}

    def _columns(self, sources: IntArray) -> FloatArray:
        new = np.array([v for v in np.unique(sources) if int(v) not in self._kept], dtype=np.int64)
        computed = dict(zip(new.tolist(), self._engine.distances_from(new))) if len(new) else {}
        rows = [self._kept[v] if v in self._kept else computed[v] for v in sources.tolist()]
        for vertex, column in computed.items():
            if len(self._kept) < self._most:
                self._kept[vertex] = column.copy()
        return np.array(rows).reshape(len(sources), self.n_points)
