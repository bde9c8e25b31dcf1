"""Engines of distances that come from elsewhere: from the user, or from a larger or a welded space."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import MeshError, SettingError, some
from isomatch.geodesics.protocol import (
    Balls,
    ColumnEngine,
    DistanceEngine,
    geodesic_balls,
    pair_distances,
    require_in_range,
)

DistanceFunction = Callable[[IntArray], ArrayLike]
"""Maps sources (m,) to distance columns (m, n)."""

# largest difference of d_ij and d_ji, over the largest distance, with which a matrix is accepted; chosen
MAX_ASYMMETRY = 0.01
MAX_DIAGONAL = 1e-6  # largest d_ii, over the largest distance, with which distances are accepted; chosen
CHECKED_ROWS = 256  # number of rows of a matrix that are in memory at once while it is checked; chosen


class GivenMatrix(ColumnEngine):
    """An n × n matrix of distances, finite or ``inf``; it is not copied, so it may be a memory map."""

    # d_ij and d_ji are allowed to differ by 1 % of the largest distance, as approximate distances do; their
    # mean is used. Reading and checking take O(n²) time once, but no memory of that order. O(n) time per
    # column.
    name = "matrix"

    def __init__(self, matrix: AnyArray) -> None:
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.dtype.kind not in "fiu":
            raise MeshError(
                f"a distance matrix of shape {matrix.shape} and type {matrix.dtype} cannot be used, expected (n, n) "
                "real numbers"
            )
        self.n_points = len(matrix)
        self._matrix = matrix
        largest = 0.0
        for first, rows in self._blocks():
            _require_distances(rows, np.arange(first, first + len(rows)), "the distance matrix")
            largest = max(largest, float(np.max(rows, initial=0.0, where=np.isfinite(rows))))
        for first, rows in self._blocks():
            columns = matrix[:, first : first + len(rows)].T
            # differences of two infinite entries are nan here, but equal entries were accepted before
            with np.errstate(invalid="ignore"):
                near = (rows == columns) | (np.abs(rows - columns) <= MAX_ASYMMETRY * largest)
            _require_all(near, first, "the distance matrix is not symmetric")
            near = rows[np.arange(len(rows)), first + np.arange(len(rows)), None] <= MAX_DIAGONAL * largest
            _require_all(near, first, "the diagonal of the distance matrix is not 0")

    def _blocks(self) -> Iterator[tuple[int, FloatArray]]:
        for first in range(0, self.n_points, CHECKED_ROWS):
            yield first, np.asarray(self._matrix[first : first + CHECKED_ROWS], dtype=np.float64)

    def _columns(self, sources: IntArray) -> FloatArray:
        columns = 0.5 * (np.asarray(self._matrix[sources], dtype=np.float64) + self._matrix[:, sources].T)
        columns[np.arange(len(sources)), sources] = 0.0
        return columns


class GivenFunction(ColumnEngine):
    """A function from sources (m,) to distance columns (m, n), finite or ``inf``; every result is checked."""

    name = "function"

    def __init__(self, function: DistanceFunction, n_points: int | None = None) -> None:
        self._function = function
        first = np.shape(function(np.zeros(1, dtype=np.int64))) if n_points is None else (1, n_points)
        if len(first) != 2 or first[0] != 1:
            raise MeshError(
                f"the distance function returned shape {first} for one source, expected (1, n): a row for each source"
            )
        self.n_points = int(first[1])

    def _columns(self, sources: IntArray) -> FloatArray:
        columns = np.array(self._function(sources.copy()))
        expected = len(sources), self.n_points
        if columns.shape != expected or columns.dtype.kind not in "fiu":
            raise MeshError(
                f"the distance function returned shape {columns.shape} and type {columns.dtype}, expected {expected} "
                "real numbers: a row for each source"
            )
        distances = columns.astype(np.float64)
        _require_distances(distances, sources, "what the distance function returned")
        diagonal = np.arange(len(sources)), sources
        largest = np.max(distances, axis=1, initial=0.0, where=np.isfinite(distances))
        bad = sources[distances[diagonal] > MAX_DIAGONAL * largest]
        if len(bad):
            raise MeshError(f"the distance function is not 0 from sources {some(bad)} to themselves")
        distances[diagonal] = 0.0
        return distances


def _require_distances(rows: FloatArray, labels: IntArray, what: str) -> None:
    with np.errstate(invalid="ignore"):
        bad = labels[~(rows >= 0).all(axis=1)]
    if len(bad):
        raise MeshError(f"{what} has negative entries or NaN in the rows of points {some(bad)}")


def _require_all(good: AnyArray, first: int, complaint: str) -> None:
    bad = first + np.flatnonzero(~good.all(axis=1))
    if len(bad):
        raise MeshError(f"{complaint} at points {some(bad)}; give distances of a metric")


class RestrictedEngine(ColumnEngine):
    """Distances among some points of a space, divided by a unit of length; paths may leave these points.

    Point i of this engine is point ``vertices[i]`` of the whole space.

    Raises
    ------
    MeshError
        If ``vertices`` is not a list of points of the whole space.
    SettingError
        If ``unit`` is not a positive number.

    Examples
    --------
    >>> from isomatch.geodesics import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(9.0), np.arange(9.0)))
    >>> RestrictedEngine(distance_engine(line), [0, 4, 8], unit=4.0).distances_from([1])
    array([[1., 0., 1.]])
    """

    def __init__(self, engine: DistanceEngine, vertices: ArrayLike, unit: float = 1.0) -> None:
        points = np.asarray(vertices)
        if points.ndim != 1 or (points.size and points.dtype.kind not in "iu"):
            raise MeshError(
                f"vertices of shape {points.shape} and type {points.dtype} are not a list of points, "
                "expected (n,) integers"
            )
        require_in_range(points, engine.n_points, whole="the points of the engine")
        if not 0.0 < unit < np.inf:
            raise SettingError(f"unit = {unit} is not a positive length")
        self.name, self.n_points = engine.name, len(points)
        self._engine, self._vertices, self._unit = engine, points.astype(np.int64), float(unit)

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        require_in_range(source, self.n_points, "sources")
        whole = np.full(self._engine.n_points, -np.inf)
        np.maximum.at(whole, self._vertices, nearest * self._unit)
        whole[whole < 0] = np.inf  # nothing bounds a front at points that were left out
        column = self._engine.lower(whole, int(self._vertices[source]))
        np.minimum(nearest, whole[self._vertices] / self._unit, out=nearest)
        return None if column is None else column[self._vertices] / self._unit

    def _columns(self, sources: IntArray) -> FloatArray:
        return self._engine.distances_from(self._vertices[sources])[:, self._vertices] / self._unit


class WeldedEngine(RestrictedEngine):
    """Distances of vertices that lie at points of a welded space; both sides of a seam share their points."""

    def __init__(self, engine: DistanceEngine, point: IntArray, notes: tuple[str, ...] = ()) -> None:
        super().__init__(engine, point)
        self.notes = notes

    def pair_distances(self, pairs: IntArray) -> FloatArray:
        """Distances (m,) of m pairs of vertices."""
        require_in_range(pairs, self.n_points, "ends of pairs")
        return pair_distances(self._engine, self._vertices[pairs])

    def balls(self, centres: IntArray, radius: float) -> Balls:
        """Vertices within a radius of m centres."""
        require_in_range(centres, self.n_points, "centres")
        start, points, distances = geodesic_balls(self._engine, self._vertices[centres], radius)
        shape = len(centres), self._engine.n_points
        balls = csr_array((distances, points, start), shape=shape)[:, self._vertices]
        balls.sort_indices()
        return Balls(balls.indptr.astype(np.int64), balls.indices.astype(np.int64), balls.data)
