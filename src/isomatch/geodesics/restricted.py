"""The distances among some points of a larger space, in another unit of length."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from isomatch.errors import MeshError, SettingError, some
from isomatch.geodesics.protocol import ColumnEngine, DistanceEngine
from isomatch.values.arrays import FloatArray, IntArray


class RestrictedEngine(ColumnEngine):
    """Distances among some points of a space, divided by a unit of length.

    Paths may leave the chosen points: a distance is that of the whole space.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of the whole space.
    vertices : (n,) array_like of int
        The points of the whole space that are kept; point i of this engine is ``vertices[i]``.
    unit : float
        Length, in the units of ``engine``, that becomes 1.

    Raises
    ------
    MeshError
        If ``vertices`` is not a list of points of the whole space.
    SettingError
        If ``unit`` is not a positive number.

    Notes
    -----
    A column takes as long as a column of the whole space. `lower` stops early where ``engine`` does. The name is that of
    ``engine``.

    Examples
    --------
    >>> from isomatch.geodesics import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(9.0), np.arange(9.0)))
    >>> RestrictedEngine(distance_engine(line), [0, 4, 8], unit=4.0).distances_from([1])
    array([[1., 0., 1.]])
    """

    def __init__(self, engine: DistanceEngine, vertices: ArrayLike, unit: float = 1.0) -> None:
        kept = np.asarray(vertices)
        if kept.ndim != 1 or (kept.size and kept.dtype.kind not in "iu"):
            raise MeshError(
                f"vertices of shape {kept.shape} and type {kept.dtype} are not a list of points, expected (n,) integers"
            )
        bad = kept[(kept < 0) | (kept >= engine.n_points)]
        if len(bad):
            raise MeshError(
                f"vertices {some(bad)} are outside 0…{engine.n_points - 1}, the points of the engine"
            )
        if not 0.0 < unit < np.inf:
            raise SettingError(f"unit = {unit} is not a positive length")
        self.name, self.n_points = engine.name, len(kept)
        self._engine, self._vertices, self._unit = engine, kept.astype(np.int64), float(unit)

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        self._require_in_range(np.array([source]))
        whole = np.full(self._engine.n_points, np.inf)  # no bound elsewhere: a front may pass there
        whole[self._vertices] = nearest * self._unit
        column = self._engine.lower(whole, int(self._vertices[source]))
        np.minimum(nearest, whole[self._vertices] / self._unit, out=nearest)
        return None if column is None else column[self._vertices] / self._unit

    def _columns(self, sources: IntArray) -> FloatArray:
        return self._engine.distances_from(self._vertices[sources])[:, self._vertices] / self._unit
