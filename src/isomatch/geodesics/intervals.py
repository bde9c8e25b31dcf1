"""Distances on a surface of which a part is missing: between a lower and an upper bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch.geodesics.protocol import DistanceEngine
from isomatch.geodesics.sampling import euclidean_farthest_points
from isomatch.surfaces import Mesh


@dataclass(frozen=True, eq=False)
class MissingRegion:
    """The missing region beyond the boundary of a surface: distances to it, and how short paths through it may be.

    ``posts`` (q,) are boundary vertices, evenly spread, none on a closed surface; ``columns`` (q, n) distances from them
    along the surface, ``between`` (q, q) straight distances between them, and ``gap`` how far a boundary vertex may be
    from the nearest post.
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
        return np.asarray(self.columns.min(axis=0, initial=np.inf))

    def lower_bound(self, sources: IntArray, others: IntArray, along: FloatArray) -> FloatArray:
        """Lower bounds (m, r) of distances on the whole surface between vertices, given those along the part."""
        if not len(self.posts):
            return along
        # The criterion of Bracha, Dagès & Kimmel, *Wormhole Loss for Partial Shape Matching*, NeurIPS 2024, used as a
        # bound. A path on the whole surface either stays on the part, and is no shorter than along it, or leaves it for
        # good at a point b of the boundary and comes back at c. What is between b and c lies in space, so that
        #   d(x, y) ≥ min(d_part(x, y), min over b, c of d_part(x, b) + ‖b − c‖ + d_part(c, y)),
        # where b is the first point left and c the last. Two minima, over b and then over c, cost O(m q (q + r)).
        reached = (self.columns[:, sources].T[:, :, None] + self.between).min(axis=1)  # (m, q)
        onward = self.columns[:, others]  # (q, r)
        through = np.empty_like(along)
        for row, to_posts in zip(through, reached):
            row[:] = (to_posts[:, None] + onward).min(axis=0)
        # a path may leave between two posts, for which the gap allows
        return np.asarray(np.minimum(along, np.maximum(through - self.gap, 0.0)))
