"""Distances given by the user: a matrix, or a function that returns columns."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from isomatch.errors import MeshError, some
from isomatch.geodesics.protocol import ColumnEngine
from isomatch.values.arrays import AnyArray, FloatArray, IntArray

DistanceFunction = Callable[[IntArray], ArrayLike]
"""Maps sources (m,) to distance columns (m, n)."""

ASYMMETRY = 0.01  # of the largest distance; fast marching from i to j and from j to i differs by less
DIAGONAL = 1e-6  # of the largest distance; below it the distance of a point to itself counts as 0
ROWS = 256  # rows of a matrix that are checked at once


class GivenMatrix(ColumnEngine):
    """An n × n matrix of distances.

    Parameters
    ----------
    matrix : (n, n) array
        Distances, finite or ``inf``. It is not copied, so it may be a memory map. d_ij and d_ji may differ by 1 % of the
        largest distance, as they do when computed approximately; their mean is used.

    Raises
    ------
    MeshError
        If the matrix is not square, real and symmetric with a diagonal of 0, or has entries that are negative or NaN.

    Notes
    -----
    Reading and checking take O(n²) time once, but no memory of that order. O(n) time per column.
    """

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
            near = (rows == columns) | (np.abs(_difference(rows, columns)) <= ASYMMETRY * largest)
            _require_all(near, first, "the distance matrix is not symmetric")
            own = rows[np.arange(len(rows)), first + np.arange(len(rows))]
            _require_all(
                own[:, None] <= DIAGONAL * largest, first, "the diagonal of the distance matrix is not 0"
            )

    def _blocks(self) -> Iterator[tuple[int, FloatArray]]:
        for first in range(0, self.n_points, ROWS):
            yield first, np.asarray(self._matrix[first : first + ROWS], dtype=np.float64)

    def _columns(self, sources: IntArray) -> FloatArray:
        columns = 0.5 * (np.asarray(self._matrix[sources], dtype=np.float64) + self._matrix[:, sources].T)
        columns[np.arange(len(sources)), sources] = 0.0
        return columns


class GivenFunction(ColumnEngine):
    """A function from sources (m,) to distance columns (m, n).

    Parameters
    ----------
    function : callable
        Takes an (m,) array of int and returns (m, n) distances, finite or ``inf``. Every result is checked.
    n_points : int, optional
        Number of points n; by default the function is called with one source to learn it.

    Raises
    ------
    MeshError
        If the function returns the wrong shape, a distance that is negative or NaN, or a distance other than 0 from
        a source to itself.
    """

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
        own = distances[np.arange(len(sources)), sources]
        largest = np.max(distances, axis=1, initial=0.0, where=np.isfinite(distances))
        bad = sources[own > DIAGONAL * largest]
        if len(bad):
            raise MeshError(f"the distance function is not 0 from sources {some(bad)} to themselves")
        distances[np.arange(len(sources)), sources] = 0.0
        return distances


def _difference(a: FloatArray, b: AnyArray) -> FloatArray:
    with np.errstate(invalid="ignore"):  # inf − inf is NaN; equal entries are compared before
        return np.asarray(a - b)


def _require_distances(rows: FloatArray, labels: IntArray, what: str) -> None:
    with np.errstate(invalid="ignore"):
        bad = labels[~(rows >= 0).all(axis=1)]
    if len(bad):
        raise MeshError(f"{what} has negative entries or NaN in the rows of points {some(bad)}")


def _require_all(good: AnyArray, first: int, complaint: str) -> None:
    bad = first + np.flatnonzero(~good.all(axis=1))
    if len(bad):
        raise MeshError(f"{complaint} at points {some(bad)}; give distances of a metric")
