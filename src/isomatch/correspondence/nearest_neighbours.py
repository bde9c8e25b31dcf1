"""Exact nearest rows in high dimension: by matrix products for few rows, by cells of a surface for many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.runtime.threads import parallel_map
from isomatch.values.arrays import Float32Array, FloatArray, IntArray, single

TINY = np.float32(1e-30)
ROWS = 1024  # queries at once among few candidates
BLOCK = 512  # queries at once; fixed, so that results do not depend on the number of threads
ROUNDING = 1e-5  # of sums of products in single precision, relative to the squared norms
TIE = 1e-6  # score differences below this share of the largest squared norm are compared again in float64


def nearest_rows(candidates: FloatArray, queries: FloatArray) -> IntArray:
    """For each query row, the index of the nearest candidate row; the first of equals.

    Parameters
    ----------
    candidates : (n, d) array of float
    queries : (m, d) array of float

    Returns
    -------
    (m,) array of int

    Notes
    -----
    2 n m d operations in single precision. The nearest candidate has the largest ``y·x − |x|²/2``; all candidates whose
    score is within the rounding error of the best are ranked by their true distance in double precision.

    Examples
    --------
    >>> candidates = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 0.0]])
    >>> nearest_rows(candidates, np.array([[1.0, 0.0], [3.0, 1.0]]))
    array([0, 1])
    """
    centre = candidates.mean(axis=0)
    x, y = np.ascontiguousarray(candidates - centre), np.ascontiguousarray(queries - centre)
    norms = np.einsum("ij,ij->i", x, x)
    table = np.vstack([x.T, -0.5 * norms]).astype(np.float32)
    probes = np.hstack([y, np.ones((len(y), 1))]).astype(np.float32)
    slack = TIE * float(max(norms.max(initial=0.0), np.einsum("ij,ij->i", y, y).max(initial=0.0)))

    def block(first: int) -> IntArray:
        rows = slice(first, first + BLOCK)
        scores = probes[rows] @ table
        best = np.zeros(len(scores), dtype=np.int64)
        bars = scores.max(axis=1, initial=-np.inf) - np.float32(slack)
        _settle(scores, bars, x, y[rows], best)
        return best

    return _joined(parallel_map(block, range(0, len(y), BLOCK)))


def nearest_of_few(candidates: FloatArray, queries: FloatArray) -> IntArray:
    """Find nearest rows as `nearest_rows` does, faster for few rows, in single precision.

    Parameters
    ----------
    candidates : (n, d) array of float
    queries : (m, d) array of float

    Returns
    -------
    (m,) array of int
        Of candidates that are equally near in single precision, any one. O(n m d).

    Examples
    --------
    >>> nearest_of_few(np.array([[0.0], [4.0]]), np.array([[3.0], [-1.0], [9.0]]))
    array([1, 0, 1])
    """
    table, norms = single(candidates).T, single(0.5 * np.einsum("ij,ij->i", candidates, candidates))
    nearest = []
    for first in range(0, len(queries), ROWS):
        scores = single(queries[first : first + ROWS]) @ table
        scores -= norms
        nearest.append(scores.argmax(axis=1))
    return _joined(nearest)


@dataclass(frozen=True, eq=False)
class VertexCells:
    """A partition of the vertices of a surface into cells, each around a centre.

    Parameters
    ----------
    centres : (c,) array of int
        Vertices.
    start : (c + 1,) array of int
    members : (n,) array of int
        ``members[start[a]:start[a + 1]]`` are the vertices of cell a, increasing.

    Examples
    --------
    >>> cells = VertexCells.of(centres=np.array([0, 3]), owner=np.array([0, 0, 1, 1, 0]))
    >>> cells.start, cells.members
    (array([0, 3, 5]), array([0, 1, 4, 2, 3]))
    """

    centres: IntArray
    start: IntArray
    members: IntArray

    @classmethod
    def of(cls, centres: IntArray, owner: IntArray) -> VertexCells:
        """Group vertices by the number of the centre that owns them, (n,)."""
        start = np.zeros(len(centres) + 1, dtype=np.int64)
        np.cumsum(np.bincount(owner, minlength=len(centres)), out=start[1:])
        return cls(centres, start, np.argsort(owner, kind="stable"))


def nearest_in_cells(candidates: FloatArray, queries: FloatArray, cells: VertexCells) -> IntArray:
    """Find nearest rows as `nearest_rows` does, among the vertices of a surface in smooth coordinates.

    Distances are compared in single precision.

    Parameters
    ----------
    candidates : (n, d) array of float
        Coordinates of every vertex.
    queries : (m, d) array of float
    cells : VertexCells
        Any partition of the vertices; compact cells make it fast.

    Returns
    -------
    (m,) array of int

    Notes
    -----
    By the triangle inequality no vertex of a cell is nearer than the distance to its centre less the cell's radius in
    these coordinates. A surface is two-dimensional whatever d is, so a handful of cells is opened for each query:
    2 m c d operations for the centres, about m d n / c for each cell opened.

    Examples
    --------
    >>> line = np.arange(6.0)[:, None]
    >>> cells = VertexCells.of(np.array([1, 4]), np.array([0, 0, 0, 1, 1, 1]))
    >>> nearest_in_cells(line, np.array([[2.2], [9.0]]), cells)
    array([2, 5])
    """
    middle = candidates.mean(axis=0)
    x = _single(candidates[cells.members], middle)
    centres = _single(candidates[cells.centres], middle)
    norms = np.einsum("ij,ij->i", centres, centres)
    radius, from_centre = np.zeros(len(centres), dtype=np.float32), np.zeros(len(x), dtype=np.float32)
    _radii(x, centres, cells.start, from_centre, radius)

    def block(first: int) -> IntArray:
        y = _single(queries[first : first + BLOCK], middle)
        squared_apart = y @ (-2 * centres.T)
        own = np.einsum("ij,ij->i", y, y)
        squared_apart += norms
        squared_apart += own[:, None]
        doubt = single(ROUNDING * (own + norms.max()))
        best = np.zeros(len(y), dtype=np.int64)
        _open_cells(squared_apart, doubt, radius, from_centre, x, y, cells.start, cells.members, best)
        return best

    return _joined(parallel_map(block, range(0, len(queries), BLOCK)))


def _single(points: FloatArray, middle: FloatArray) -> Float32Array:
    """Points about the middle, in single precision."""
    return np.subtract(points, middle, dtype=np.float32, casting="same_kind")


def _joined(parts: list[IntArray]) -> IntArray:
    return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)


@compiled(fastmath={"nnan", "nsz", "reassoc", "contract"})
def _settle(scores: Float32Array, bars: Float32Array, x: FloatArray, y: FloatArray, best: IntArray) -> None:
    for i in range(len(scores)):
        winner, nearest = -1, np.inf
        for j in range(scores.shape[1]):
            if scores[i, j] >= bars[i]:
                distance = _squared(x, j, y, i)
                if distance < nearest:
                    winner, nearest = j, distance
        best[i] = winner


@compiled(fastmath={"nsz", "reassoc", "contract"})
def _radii(
    x: Float32Array, centres: Float32Array, start: IntArray, from_centre: Float32Array, radius: Float32Array
) -> None:
    for a in range(len(centres)):
        for j in range(start[a], start[a + 1]):
            from_centre[j] = np.sqrt(_squared_single(x, j, centres, a))
            radius[a] = max(radius[a], from_centre[j])


@compiled(fastmath={"nsz", "reassoc", "contract"}, error_model="numpy")
def _open_cells(
    squared_apart: Float32Array,
    doubt: Float32Array,
    radius: Float32Array,
    from_centre: Float32Array,
    x: Float32Array,
    y: Float32Array,
    start: IntArray,
    members: IntArray,
    best: IntArray,
) -> None:
    for i in range(len(y)):
        first = 0
        for cell in range(len(radius)):
            if squared_apart[i, cell] < squared_apart[i, first]:
                first = cell
        winner, nearest, reach = -1, np.float32(np.inf), np.float32(np.inf)
        for turn in range(-1, len(radius)):
            cell = first if turn < 0 else turn
            within = reach + radius[cell]
            if turn == first or squared_apart[i, cell] - doubt[i] > within * within:
                continue
            away = np.sqrt(max(squared_apart[i, cell], doubt[i], TINY))
            beyond = reach + doubt[i] / away
            for j in range(start[cell], start[cell + 1]):
                if abs(away - from_centre[j]) > beyond:
                    continue
                distance = _squared_single(x, j, y, i)
                if distance < nearest or (distance == nearest and members[j] < winner):
                    winner, nearest = members[j], distance
                    reach = np.sqrt(nearest) * np.float32(1.0 + ROUNDING)
                    beyond = reach + doubt[i] / away
        best[i] = winner


@compiled(fastmath={"nsz", "reassoc", "contract"}, inline="always")
def _squared_single(x: Float32Array, j: int, y: Float32Array, i: int) -> np.float32:
    total = np.float32(0.0)
    for d in range(x.shape[1]):
        difference = x[j, d] - y[i, d]
        total += difference * difference
    return total


@compiled(fastmath={"nsz", "reassoc", "contract"}, inline="always")
def _squared(x: FloatArray, j: int, y: FloatArray, i: int) -> float:
    total = 0.0
    for d in range(x.shape[1]):
        difference = x[j, d] - y[i, d]
        total += difference * difference
    return total
