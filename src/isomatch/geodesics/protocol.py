"""What is asked of a distance engine: columns, pairs and balls; the base class of the engines of this package."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MeshError, some
from isomatch._core.memory import require_memory
from isomatch.surfaces import Mesh, PointCloud

BLOCK = 64  # columns held at a time, where pairs or balls are asked of an engine that has only columns


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
        m = len(wanted)
        require_memory(8.0 * m * self.n_points, f"{m} distance columns", "ask for fewer at once")
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


def pair_distances(engine: DistanceEngine, pairs: ArrayLike) -> FloatArray:
    """Compute the distances (m,) of (m, 2) pairs of points, source and target; ``inf`` where no path leads.

    Raises
    ------
    MeshError
        If ``pairs`` has another shape or type, or names a point that does not exist.

    Notes
    -----
    One column per distinct source, 64 at a time: of the two ends, put the one with fewer distinct points first. An
    engine that has a method ``pair_distances``, as fast marching does, is asked directly: its fronts end early.

    Examples
    --------
    >>> from isomatch.geodesics import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    >>> pair_distances(distance_engine(line), [[0, 3], [2, 1]])
    array([3., 1.])
    """
    wanted = np.asarray(pairs)
    if wanted.ndim != 2 or wanted.shape[1] != 2 or wanted.dtype.kind not in "iu":
        raise MeshError(
            f"pairs have shape {wanted.shape} and type {wanted.dtype}, expected (m, 2) integers: two vertices each"
        )
    bad = wanted[((wanted < 0) | (wanted >= engine.n_points)).any(axis=1)].ravel()
    if len(bad):
        raise MeshError(
            f"pairs of vertices {some(bad)} leave 0…{engine.n_points - 1}, the vertices of the surface"
        )
    if hasattr(engine, "pair_distances"):
        return np.asarray(engine.pair_distances(wanted))
    sources, of_pair = np.unique(wanted[:, 0], return_inverse=True)
    order = np.argsort(of_pair, kind="stable")
    distances = np.zeros(len(wanted))
    for first in range(0, len(sources), BLOCK):
        columns = engine.distances_from(sources[first : first + BLOCK])
        low, high = np.searchsorted(of_pair[order], [first, first + BLOCK])
        rows = order[low:high]
        distances[rows] = columns[of_pair[rows] - first, wanted[rows, 1]]
    return distances


class Balls(NamedTuple):
    """The points within a radius of m centres: those of centre i are in ``start[i]:start[i + 1]``."""

    start: IntArray  # (m + 1,)
    points: IntArray  # (b,)
    distances: FloatArray  # (b,) from the centre

    @classmethod
    def of(cls, parts: Sequence[tuple[IntArray, FloatArray]]) -> Self:
        """Join the points and distances of single balls."""
        start = np.zeros(len(parts) + 1, dtype=np.int64)
        np.cumsum([len(points) for points, _ in parts], out=start[1:])
        points = np.concatenate([np.zeros(0, np.int64), *(points for points, _ in parts)])
        return cls(start, points, np.concatenate([np.zeros(0), *(distances for _, distances in parts)]))


def geodesic_balls(engine: DistanceEngine, centres: ArrayLike, radius: float) -> Balls:
    """Find the points within a distance of m centres, those of each ball in increasing order.

    Raises
    ------
    MeshError
        If ``centres`` names a point that does not exist.

    Notes
    -----
    The fronts of an engine that has a method ``balls``, as fast marching does, end at the radius. Of any other engine
    whole columns are asked, 64 at a time.

    Examples
    --------
    >>> from isomatch import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(5.0), np.arange(5.0)))
    >>> geodesic_balls(distance_engine(line), [0, 3], 1.0)
    Balls(start=array([0, 2, 5]), points=array([0, 1, 2, 3, 4]), distances=array([0., 1., 1., 0., 1.]))
    """
    wanted = np.atleast_1d(np.asarray(centres))
    if hasattr(engine, "balls"):
        balls: Balls = engine.balls(wanted, radius)
        return balls
    parts = []
    for first in range(0, len(wanted), BLOCK):
        columns = engine.distances_from(wanted[first : first + BLOCK])
        rows = [np.flatnonzero(column <= radius) for column in columns]
        parts += [(inside, column[inside]) for inside, column in zip(rows, columns)]
    return Balls.of(parts)


def ordinary_unit(surface: Mesh | PointCloud) -> float:
    """Length to divide coordinates by so that their squares neither overflow nor vanish; 1 at ordinary sizes."""
    extent = float(np.abs(surface.vertices).max(initial=0.0))
    return 1.0 if extent == 0.0 or 1e-10 < extent < 1e10 else extent


def require_finite(mesh: Mesh) -> None:
    """Raise `MeshError` if a coordinate is not finite."""
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise MeshError(
            f"vertices {some(bad)} have coordinates that are not finite, so no distance is defined; "
            "correct the file or call repair(mesh)"
        )
