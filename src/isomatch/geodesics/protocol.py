"""The interface of distance engines, and the base class of those in this package."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from isomatch.errors import MeshError, some
from isomatch.runtime.memory import require_memory
from isomatch.values.arrays import FloatArray, IntArray


@runtime_checkable
class DistanceEngine(Protocol):
    """Distances of a metric space of n points, one column (source) at a time; nothing else of the space is needed.

    An engine that finds single distances faster than columns may also have a method ``pair_distances``, from (m, 2) pairs
    of points to (m,) distances; the function `pair_distances` then uses it.
    """

    name: str
    n_points: int

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances from each of m sources; ``inf`` where no path leads."""
        ...

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer.

        Returns the full column (n,) if it had to be computed, ``None`` if the front stopped early.
        """
        ...


class ColumnEngine(ABC):
    """Base class of the engines of this package, which checks sources and memory.

    A subclass sets ``name`` and ``n_points`` and implements ``_columns``. It overrides `lower` where its front can stop
    as soon as another source is nearer.
    """

    name: str
    n_points: int

    def distances_from(self, sources: ArrayLike) -> FloatArray:
        """(m, n) distances from each of m sources; ``inf`` where no path leads."""
        wanted = np.atleast_1d(np.asarray(sources))
        if wanted.ndim != 1 or (wanted.size and wanted.dtype.kind not in "iu"):
            raise MeshError("sources must be a one-dimensional array of vertex indices")
        self._require_in_range(wanted)
        require_memory(
            8.0 * len(wanted) * self.n_points, f"{len(wanted)} distance columns", "ask for fewer at once"
        )
        return self._columns(wanted.astype(np.int64))

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        column: FloatArray = self.distances_from([source])[0]
        np.minimum(nearest, column, out=nearest)
        return column

    def _require_in_range(self, sources: IntArray) -> None:
        bad = sources[(sources < 0) | (sources >= self.n_points)]
        if len(bad):
            raise MeshError(
                f"sources {some(bad)} are outside 0…{self.n_points - 1}, the vertices of the surface"
            )

    @abstractmethod
    def _columns(self, sources: IntArray) -> FloatArray:
        """(m, n) distances from sources that are in range."""
