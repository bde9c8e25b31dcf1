"""Nearest vertices and nearest points of one surface, in any coordinates of its vertices."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.correspondence.nearest_neighbours import VertexCells, nearest_in_cells
from isomatch.correspondence.nearest_points import faces_around_vertices, nearest_points
from isomatch.surfaces import PrecisePoints
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property


@dataclass(frozen=True, eq=False)
class SurfaceIndex:
    """An index of a surface that speeds up searches in any smooth coordinates of its n vertices.

    Parameters
    ----------
    faces : (f, 3) array of int
        Triangles; none for points and graphs.
    cells : VertexCells
        Partition of the vertices into compact cells.

    Examples
    --------
    >>> import numpy as np
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
        """Vertex (m,) nearest to each query (m, d), given coordinates (n, d); see `nearest_in_cells`."""
        return nearest_in_cells(coordinates, queries, self.cells)

    def points(self, coordinates: FloatArray, queries: FloatArray) -> PrecisePoints:
        """Nearest point on the triangles around the nearest vertex, see `nearest_points`; that vertex comes first."""
        nearest = self.vertices(coordinates, queries)
        return nearest_points(coordinates, queries, self.faces, nearest, self._around)
