"""The protocol of distance engines: columns, pairs and balls; the base class of the engines of this package."""

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

COLUMNS_AT_ONCE = 64  # number of columns that an engine without pairs or balls computes at once; chosen


@runtime_checkable
class DistanceEngine(Protocol):
    """Distances of a metric space of n points, one column (source) at a time.

    An engine that finds single distances faster than columns may also have a method
    ``pair_distances``, from (m, 2) pairs of points to (m,) distances; the function `pair_distances`
    then uses it.
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

    A subclass sets ``name`` and ``n_points`` and implements ``_columns``. It overrides `lower`
    where its front can stop as soon as another source is nearer.
    """

    name: str
    n_points: int

    def distances_from(self, sources: ArrayLike) -> FloatArray:
        """(m, n) distances from each of m sources; ``inf`` where no path leads."""
        sources = np.atleast_1d(np.asarray(sources))
        if sources.ndim != 1 or (sources.size and sources.dtype.kind not in "iu"):
            raise MeshError("sources must be a one-dimensional array of vertex indices")
        require_in_range(sources, self.n_points, "sources")
        m = len(sources)
        require_memory(8.0 * m * self.n_points, f"{m} distance columns", "ask for fewer at once")
        return self._columns(sources.astype(np.int64))

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        column: FloatArray = self.distances_from([source])[0]
        np.minimum(nearest, column, out=nearest)
        return column

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
    One column per distinct source, 64 at a time, so put the end with fewer distinct points first.
    An engine that has a method ``pair_distances``, such as fast marching, is asked directly: its
    fronts end early.

    Examples
    --------
    >>> from isomatch.geodesics import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    >>> pair_distances(distance_engine(line), [[0, 3], [2, 1]])
    array([3., 1.])
    """
    pairs = np.asarray(pairs)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise MeshError(
            f"pairs have shape {pairs.shape} and type {pairs.dtype}, expected (m, 2) integers: two vertices each"
        )
    require_in_range(pairs, engine.n_points, "ends of pairs")
    if hasattr(engine, "pair_distances"):
        return np.asarray(engine.pair_distances(pairs))
    sources, row_of_pair = np.unique(pairs[:, 0], return_inverse=True)
    distances = np.zeros(len(pairs))
    for first in range(0, len(sources), COLUMNS_AT_ONCE):
        columns = engine.distances_from(sources[first : first + COLUMNS_AT_ONCE])
        members = (first <= row_of_pair) & (row_of_pair < first + COLUMNS_AT_ONCE)
        distances[members] = columns[row_of_pair[members] - first, pairs[members, 1]]
    return distances


class Balls(NamedTuple):
    """The points within a radius of m centres; entries ``start[i]:start[i + 1]`` belong to centre i."""

    start: IntArray  # where the entries of each centre begin, (m + 1,)
    points: IntArray  # the points of all balls, (b,)
    distances: FloatArray  # the distance of each of these points from its centre, (b,)

    @classmethod
    def of(cls, parts: Sequence[tuple[IntArray, FloatArray]]) -> Self:
        """Join the points and distances of single balls."""
        start = np.zeros(len(parts) + 1, dtype=np.int64)
        np.cumsum([len(points) for points, _ in parts], out=start[1:])
        points = np.concatenate([np.zeros(0, np.int64), *(points for points, _ in parts)])
        return cls(start, points, np.concatenate([np.zeros(0), *(distances for _, distances in parts)]))


def geodesic_balls(engine: DistanceEngine, centres: ArrayLike, radius: float) -> Balls:
    """Find the points within a distance of m centres, in increasing order for each ball.

    Raises
    ------
    MeshError
        If ``centres`` names a point that does not exist.

    Notes
    -----
    The fronts of an engine that has a method ``balls``, such as fast marching, end at the radius.
    Any other engine computes whole columns, 64 at a time.

    Examples
    --------
    >>> from isomatch import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(5.0), np.arange(5.0)))
    >>> geodesic_balls(distance_engine(line), [0, 3], 1.0)
    Balls(start=array([0, 2, 5]), points=array([0, 1, 2, 3, 4]), distances=array([0., 1., 1., 0., 1.]))
    """
    centres = np.atleast_1d(np.asarray(centres))
    if hasattr(engine, "balls"):
        balls: Balls = engine.balls(centres, radius)
        return balls
    parts = []
    for first in range(0, len(centres), COLUMNS_AT_ONCE):
        for column in engine.distances_from(centres[first : first + COLUMNS_AT_ONCE]):
            inside = np.flatnonzero(column <= radius)
            parts.append((inside, column[inside]))
    return Balls.of(parts)


def ordinary_unit(surface: Mesh | PointCloud) -> float:
    """Length that scales coordinates so that squares neither overflow nor underflow; 1 at ordinary sizes."""
    extent = float(np.abs(surface.vertices).max(initial=0.0))
    return 1.0 if extent == 0.0 or 1e-10 < extent < 1e10 else extent


def require_in_range(
    numbers: ArrayLike, n: int, what: str = "vertices", whole: str = "the vertices of the surface"
) -> None:
    """Raise `MeshError` if numbers are not in 0…n − 1."""
    given = np.asarray(numbers)
    bad = given[(given < 0) | (given >= n)]
    if len(bad):
        raise MeshError(f"{what} {some(bad)} are outside 0…{n - 1}, {whole}")


def require_finite(mesh: Mesh) -> None:
    """Raise `MeshError` if a coordinate is not finite."""
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise MeshError(
            f"vertices {some(bad)} have coordinates that are not finite, so no distance is defined; "
            "correct the file or call repair(mesh)"
        )
