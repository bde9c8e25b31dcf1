"""Nearest rows in high dimension, exact, and the nearest points of a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from isomatch._core.arrays import AnyArray, Float32Array, FloatArray, IntArray, single
from isomatch._core.cached import cached_property
from isomatch._core.compiled import compiled
from isomatch._core.threads import parallel_map
from isomatch.surfaces import PrecisePoints, nearest_in_triangle

MIN_SQUARED_DISTANCE = np.float32(1e-30)  # squared distances in denominators are raised to this; chosen
QUERIES_PER_PRODUCT = 1024  # number of queries in each matrix product of `nearest_of_few`; chosen
# Number of queries of a parallel task of `nearest_rows` and `nearest_in_cells`, and number of points of one
# of `nearest_points`; chosen, and the same for any number of threads, so that results do not depend on it.
QUERIES_PER_TASK, POINTS_PER_TASK = 512, 2048
# bound on the rounding error of a squared distance in single precision, over the squared norms of both points
ROUNDING_RATIO = 1e-5
# In `nearest_rows`, candidates whose score is below the best score by at most this share of the largest squared
# norm are compared in double precision; chosen.
TIE_RATIO = 1e-6


def nearest_rows(candidates: FloatArray, queries: FloatArray) -> IntArray:
    """For each query row (m, d), the index (m,) of the nearest candidate row (n, d); the first of equals.

    2 n m d operations in single precision.

    Examples
    --------
    >>> candidates = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 0.0]])
    >>> nearest_rows(candidates, np.array([[1.0, 0.0], [3.0, 1.0]]))
    array([0, 1])
    """
    # For a query y and a candidate x, |y − x|² = |y|² − 2 (y · x − ½ |x|²): the nearest candidate has the
    # largest score y · x − ½ |x|². One matrix product gives all scores. Candidates whose scores equal the
    # best score up to rounding are ranked by their distance in double precision.
    centre = candidates.mean(axis=0)
    x, y = np.ascontiguousarray(candidates - centre), np.ascontiguousarray(queries - centre)
    norms = np.einsum("ij,ij->i", x, x)
    table = np.vstack([x.T, -0.5 * norms]).astype(np.float32)
    probes = np.hstack([y, np.ones((len(y), 1))]).astype(np.float32)
    slack = TIE_RATIO * float(max(norms.max(initial=0.0), np.einsum("ij,ij->i", y, y).max(initial=0.0)))

    def block(first: int) -> IntArray:
        rows = slice(first, first + QUERIES_PER_TASK)
        scores = probes[rows] @ table
        best = np.zeros(len(scores), dtype=np.int64)
        bars = scores.max(axis=1, initial=-np.inf) - np.float32(slack)
        _choose_nearest(scores, bars, x, y[rows], best)
        return best

    return _concatenate(parallel_map(block, range(0, len(y), QUERIES_PER_TASK)))


def nearest_of_few(candidates: FloatArray, queries: FloatArray) -> IntArray:
    """Find nearest rows as `nearest_rows`, faster for few; any of those equal in single precision.

    Examples
    --------
    >>> nearest_of_few(np.array([[0.0], [4.0]]), np.array([[3.0], [-1.0], [9.0]]))
    array([1, 0, 1])
    """
    table, norms = single(candidates).T, single(0.5 * np.einsum("ij,ij->i", candidates, candidates))
    nearest = []
    for first in range(0, len(queries), QUERIES_PER_PRODUCT):
        scores = single(queries[first : first + QUERIES_PER_PRODUCT]) @ table
        scores -= norms
        nearest.append(scores.argmax(axis=1))
    return _concatenate(nearest)


@dataclass(frozen=True, eq=False)
class VertexCells:
    """A partition of n vertices into cells: cell a has the vertices ``members[start[a]:start[a + 1]]``.

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
        start = np.append(0, np.cumsum(np.bincount(owner, minlength=len(centres))))
        return cls(centres, start, np.argsort(owner, kind="stable"))


def nearest_in_cells(candidates: FloatArray, queries: FloatArray, cells: VertexCells) -> IntArray:
    """Find nearest rows as `nearest_rows`, in single precision, by cells; compact cells are fast."""
    # For a query y and a vertex x of a cell with centre z and radius r in these coordinates, the triangle
    # inequality gives |y − x| ≥ |y − z| − r and |y − x| ≥ ||y − z| − |x − z||. Cells and vertices whose bound
    # exceeds the nearest distance so far are passed over. A surface is two-dimensional in any d, so that a
    # handful of cells is opened for each query. With m queries, n vertices and c cells, centres take 2 m c d
    # operations, and each cell that a query opens takes about d n / c.
    middle = candidates.mean(axis=0)
    x = _single(candidates, middle)
    x, centres = x[cells.members], x[cells.centres]
    norms = np.einsum("ij,ij->i", centres, centres)
    radius, from_centre = np.zeros(len(centres), dtype=np.float32), np.zeros(len(x), dtype=np.float32)
    _radii(x, centres, cells.start, from_centre, radius)

    def block(first: int) -> IntArray:
        y = _single(queries[first : first + QUERIES_PER_TASK], middle)
        squared = y @ (-2 * centres.T)  # with the norms below: squared distances of queries from centres
        query_norms = np.einsum("ij,ij->i", y, y)
        squared += norms
        squared += query_norms[:, None]
        error = single(ROUNDING_RATIO * (query_norms + norms.max()))
        best = np.zeros(len(y), dtype=np.int64)
        _open_cells(squared, error, radius, from_centre, x, y, cells.start, cells.members, best)
        return best

    return _concatenate(parallel_map(block, range(0, len(queries), QUERIES_PER_TASK)))


def _single(points: FloatArray, middle: FloatArray) -> Float32Array:
    """Points relative to the middle, in single precision."""
    return np.subtract(points, middle, dtype=np.float32, casting="same_kind")


def _concatenate(parts: list[IntArray]) -> IntArray:
    return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)


@compiled(fastmath={"nnan", "nsz", "reassoc", "contract"})
def _choose_nearest(
    scores: Float32Array, bars: Float32Array, x: FloatArray, y: FloatArray, best: IntArray
) -> None:
    for i in range(len(scores)):
        winner, nearest = -1, np.inf
        for j in range(scores.shape[1]):
            if scores[i, j] >= bars[i]:
                distance = squared_distance(x, j, y, i)
                if distance < nearest:
                    winner, nearest = j, distance
        best[i] = winner


@compiled(fastmath={"nsz", "reassoc", "contract"})
def _radii(
    x: Float32Array, centres: Float32Array, start: IntArray, from_centre: Float32Array, radius: Float32Array
) -> None:
    for a in range(len(centres)):
        for j in range(start[a], start[a + 1]):
            from_centre[j] = np.sqrt(squared_distance(x, j, centres, a))
            radius[a] = max(radius[a], from_centre[j])


@compiled(fastmath={"nsz", "reassoc", "contract"}, error_model="numpy")
def _open_cells(
    squared: Float32Array,
    error: Float32Array,
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
            if squared[i, cell] < squared[i, first]:
                first = cell
        winner, nearest, reach = -1, np.float32(np.inf), np.float32(np.inf)
        for turn in range(-1, len(radius)):
            cell = first if turn < 0 else turn
            within = reach + radius[cell]
            if turn == first or squared[i, cell] - error[i] > within * within:
                continue
            to_centre = np.sqrt(max(squared[i, cell], error[i], MIN_SQUARED_DISTANCE))
            limit = reach + error[i] / to_centre
            for j in range(start[cell], start[cell + 1]):
                if abs(to_centre - from_centre[j]) > limit:
                    continue
                distance = squared_distance(x, j, y, i)
                if distance < nearest or (distance == nearest and members[j] < winner):
                    winner, nearest = members[j], distance
                    reach = np.sqrt(nearest) * np.float32(1.0 + ROUNDING_RATIO)
                    limit = reach + error[i] / to_centre
        best[i] = winner


@compiled(inline="always")  # inlined, so that it is compiled with the flags of the loop that calls it
def squared_distance(x: AnyArray, j: int, y: AnyArray, i: int) -> Any:
    """Squared distance of row j of x from row i of y, in their precision."""
    total = x.dtype.type(0)
    for d in range(x.shape[1]):
        difference = x[j, d] - y[i, d]
        total += difference * difference
    return total


def nearest_points(
    coordinates: FloatArray,
    queries: FloatArray,
    faces: IntArray,
    nearest_vertex: IntArray,
    around: tuple[IntArray, IntArray] | None = None,
) -> PrecisePoints:
    """Find the nearest points of the triangles around the nearest vertices (m,), their first corners.

    Triangles (f, 3) are flat in the d dimensions of the coordinates (n, d); without any, the
    vertices are the result. ``around`` is the result of `faces_around_vertices`, if known. About 6
    m faces, 5 d operations each.

    Examples
    --------
    The first query lies above the triangle; the nearest point of the second is the middle of an edge.

    >>> triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> queries = np.array([[0.25, 0.25, 3.0], [0.5, -2.0, 0.0]])
    >>> nearest_points(triangle, queries, np.array([[0, 1, 2]]), np.array([0, 0])).barycentric
    array([[0.5 , 0.25, 0.25],
           [0.5 , 0.5 , 0.  ]])
    """
    # Ezuz & Ben-Chen, *Deblurring and Denoising of Maps between Shapes*, SGP 2017: the precise
    # image of a vertex is the nearest point of all triangles in the space of the embedding; here
    # only of the triangles around the nearest vertex.
    start, order = around or faces_around_vertices(faces, len(coordinates))
    points = PrecisePoints.at_vertices(nearest_vertex)

    def chunk(first: int) -> None:
        rows = slice(first, first + POINTS_PER_TASK)
        images = points.corners[rows], points.barycentric[rows]
        _nearest(coordinates, queries[rows], faces, start, order, *images)

    parallel_map(chunk, range(0, len(nearest_vertex), POINTS_PER_TASK))
    return points


def faces_around_vertices(faces: IntArray, n_vertices: int) -> tuple[IntArray, IntArray]:
    """List 3 face + corner around each vertex a, increasing: ``order[start[a]:start[a + 1]]``.

    Examples
    --------
    >>> start, order = faces_around_vertices(np.array([[0, 1, 2], [0, 2, 3]]), n_vertices=4)
    >>> [(order[start[a] : start[a + 1]] // 3).tolist() for a in range(4)]
    [[0, 1], [0], [0, 1], [1]]
    """
    start = np.append(0, np.cumsum(np.bincount(faces.ravel(), minlength=n_vertices)))
    return start, np.argsort(faces.ravel(), kind="stable")


@compiled(fastmath={"reassoc", "contract"})
def _nearest(
    x: FloatArray,
    points: FloatArray,
    faces: IntArray,
    start: IntArray,
    order: IntArray,
    corners: IntArray,
    barycentric: FloatArray,
) -> None:
    for i in range(len(points)):
        a = corners[i, 0]
        best = 0.0  # least squared distance found, minus the squared distance of the vertex
        for e in range(start[a], start[a + 1]):
            face, corner = order[e] // 3, order[e] % 3
            b, c = faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
            # The nearest point a + s u + t v of a triangle minimises |p − s u − t v|², with u = b − a,
            # v = c − a, p = point − a. That needs only inner products, in any dimension; if it lies inside
            # the triangle, it solves [uu uv; uv vv] (s, t) = (up, vp).
            uu = uv = vv = up = vp = 0.0
            for d in range(x.shape[1]):
                u, v, p = x[b, d] - x[a, d], x[c, d] - x[a, d], points[i, d] - x[a, d]
                uu += u * u
                uv += u * v
                vv += v * v
                up += u * p
                vp += v * p
            s, t, gain = nearest_in_triangle(uu, uv, vv, up, vp)
            if gain < best:
                best = gain
                corners[i, 1], corners[i, 2] = b, c
                barycentric[i, 0], barycentric[i, 1], barycentric[i, 2] = 1.0 - s - t, s, t


@dataclass(frozen=True, eq=False)
class SurfaceIndex:
    """An index of a surface, by triangles (f, 3) and cells, for searches in smooth coordinates.

    Examples
    --------
    >>> triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> index = SurfaceIndex(np.array([[0, 1, 2]]), VertexCells.of(np.array([0]), np.zeros(3, dtype=int)))
    >>> query = np.array([[0.6, 0.1]])
    >>> index.vertices(triangle, query)
    array([1])
    >>> index.points(triangle, query).interpolated(triangle).round(6)
    array([[0.6, 0.1]])
    """

    faces: IntArray
    cells: VertexCells

    @cached_property
    def _around(self) -> tuple[IntArray, IntArray]:
        return faces_around_vertices(self.faces, len(self.cells.members))

    def vertices(self, coordinates: FloatArray, queries: FloatArray) -> IntArray:
        """Vertex (m,) nearest to each query (m, d), given coordinates (n, d); see ``nearest_in_cells``."""
        return nearest_in_cells(coordinates, queries, self.cells)

    def points(self, coordinates: FloatArray, queries: FloatArray) -> PrecisePoints:
        """Nearest point on the triangles around the nearest vertex, which comes first; `nearest_points`."""
        nearest = self.vertices(coordinates, queries)
        return nearest_points(coordinates, queries, self.faces, nearest, self._around)
