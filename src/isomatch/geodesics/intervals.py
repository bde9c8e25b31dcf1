"""Distances on a surface of which a part is missing: between a lower and an upper bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from isomatch.geodesics.protocol import DistanceEngine
from isomatch.geodesics.sampling import euclidean_farthest_points
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class MissingRegion:
    """The missing region beyond the boundary of a surface: distances to it, and how short paths through it may be.

    Parameters
    ----------
    posts : (q,) array of int
        Boundary vertices, evenly spread; none on a closed surface.
    columns : (q, n) array of float
        Distances from them along the surface.
    between : (q, q) array of float
        Straight distances between them: no path through what is missing is shorter.
    gap : float
        How far a boundary vertex may be from the nearest post.
    """

    posts: IntArray
    columns: FloatArray
    between: FloatArray
    gap: float

    @classmethod
    def of(cls, mesh: Mesh, engine: DistanceEngine, n_posts: int) -> MissingRegion:
        """Spread posts along the boundary of a mesh."""
        boundary = np.unique(mesh.boundary_edges)
        if not len(boundary):
            n = mesh.n_vertices
            return cls(boundary, np.zeros((0, n)), np.zeros((0, 0)), 0.0)
        points = mesh.vertices[boundary]
        chosen = euclidean_farthest_points(points, min(n_posts, len(boundary)), 0)
        gap = float(cKDTree(points[chosen]).query(points)[0].max())
        between = np.linalg.norm(points[chosen, None] - points[chosen], axis=2)
        posts = boundary[chosen]
        return cls(posts, engine.distances_from(posts), between, gap)

    @property
    def to_boundary(self) -> FloatArray:
        """(n,) distance of each vertex to the boundary; inf on a closed surface."""
        nearest: FloatArray = self.columns.min(axis=0, initial=np.inf)
        return nearest

    def lower_bound(self, sources: IntArray, others: IntArray, along: FloatArray) -> FloatArray:
        """Bound the distances on the whole surface from below.

        Parameters
        ----------
        sources, others : (m,) and (r,) arrays of int
            Vertices.
        along : (m, r) array of float
            Distances between them along the surface, which bound those on the whole surface from above.

        Returns
        -------
        (m, r) array of float
            min(d(x, y), min over boundary points b, c of d(x, b) + ‖b − c‖ + d(c, y)): a path that leaves the surface
            is no shorter.

        Notes
        -----
        The criterion of Bracha, Dagès & Kimmel, *Wormhole Loss for Partial Shape Matching*, NeurIPS 2024, used as a
        bound. O(m q (q + r)).
        """
        if not len(self.posts):
            return along
        reached = (self.columns[:, sources].T[:, :, None] + self.between).min(axis=1)  # (m, q)
        onward = self.columns[:, others]  # (q, r)
        through = np.empty_like(along)
        for row, to_posts in zip(through, reached):
            row[:] = (to_posts[:, None] + onward).min(axis=0)
        # a path may leave between two posts, for which the gap allows
        bound: FloatArray = np.minimum(along, np.maximum(through - self.gap, 0.0))
        return bound
