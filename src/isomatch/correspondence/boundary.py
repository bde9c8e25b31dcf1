"""The boundary of a surface, in space."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch.surfaces import Mesh, PrecisePoints
from isomatch.values.arrays import BoolArray, FloatArray

ON_EDGE = 1e-6  # barycentric coordinate below which a point of a triangle lies on an edge


class Boundary:
    """Which points of a surface lie on its boundary, and which of the boundary are nearest to others.

    Parameters
    ----------
    mesh : Mesh
        The surface.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> Boundary(square).nearest(np.array([[0.3, 0.2, 0.5]]))
    array([[0.3, 0. , 0. ]])
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._of_rim = self.vertices_of(mesh)

    @staticmethod
    def vertices_of(mesh: Mesh) -> BoolArray:
        """(n,) whether each vertex of a mesh is on its boundary."""
        of_rim = np.zeros(mesh.n_vertices, dtype=bool)
        of_rim[mesh.boundary_edges] = True
        return of_rim

    def holds(self, points: PrecisePoints) -> BoolArray:
        """(m,) whether points of the surface lie on its boundary."""
        on_edges: BoolArray = self._of_rim[points.corners] | (points.barycentric < ON_EDGE)
        return np.asarray(on_edges.all(axis=1))

    def nearest(self, positions: FloatArray) -> FloatArray:
        """Nearest points (m, 3) of the boundary, on the edges at the nearest of its vertices."""
        x, ends = self._mesh.vertices, self._mesh.boundary_edges
        rim = np.flatnonzero(self._of_rim)
        nearest = rim[cKDTree(x[rim]).query(positions)[1]]
        points = np.array(x[nearest])
        least = np.linalg.norm(points - positions, axis=1)
        order = np.argsort(ends.ravel(), kind="stable")
        first = np.searchsorted(ends.ravel()[order], nearest)
        for at in (first, first + 1):  # a vertex of the boundary has two edges there, and rarely more
            edge = ends[order[np.minimum(at, len(order) - 1)] // 2]
            start, along = x[edge[:, 0]], x[edge[:, 1]] - x[edge[:, 0]]
            share = np.einsum("ni,ni->n", positions - start, along) / np.maximum(
                np.einsum("ni,ni->n", along, along), 1e-30
            )
            there = start + np.clip(share, 0.0, 1.0)[:, None] * along
            apart = np.linalg.norm(there - positions, axis=1)
            points[apart < least] = there[apart < least]
            least = np.minimum(least, apart)
        return points
