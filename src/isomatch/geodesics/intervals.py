"""Lower and upper bounds of distances on a surface with a missing part."""

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
    """The missing region beyond the boundary of a surface: distances to it, and bounds of paths through it.

    It is sampled by q boundary vertices, evenly spread; there are none on a closed surface.
    """

    samples: IntArray  # vertices of the boundary, (q,)
    columns: FloatArray  # distances (q, n) from the samples along the surface
    straight: FloatArray  # Euclidean distances (q, q) between the samples
    gap: float  # the largest Euclidean distance of a boundary vertex from the nearest sample

    @classmethod
    def of(cls, mesh: Mesh, engine: DistanceEngine, n_samples: int) -> MissingRegion:
        """Sample the boundary of a mesh."""
        boundary = np.unique(mesh.boundary_edges)
        if not len(boundary):
            return cls(boundary, np.zeros((0, mesh.n_vertices)), np.zeros((0, 0)), 0.0)
        points = mesh.vertices[boundary]
        chosen = euclidean_farthest_points(points, min(n_samples, len(boundary)), 0)
        gap = float(cKDTree(points[chosen]).query(points)[0].max())
        straight = np.linalg.norm(points[chosen, None] - points[chosen], axis=2)
        samples = boundary[chosen]
        return cls(samples, engine.distances_from(samples), straight, gap)

    @property
    def to_boundary(self) -> FloatArray:
        """(n,) distance of each vertex to the boundary; inf on a closed surface."""
        return np.asarray(self.columns.min(axis=0, initial=np.inf))

    def lower_bound(self, sources: IntArray, others: IntArray, along: FloatArray) -> FloatArray:
        """Lower bounds (m, r) of distances on the whole surface, given the distances ``along`` the part."""
        if not len(self.samples):
            return along
        # The criterion of Bracha, Dagès & Kimmel, *Wormhole Loss for Partial Shape Matching*,
        # NeurIPS 2024, used as a bound. A path on the whole surface either stays on the part, and
        # is no shorter than along it, or it leaves the part first at a point b of the boundary and
        # comes back last at c. Between b and c it lies in space, so that
        #   d(x, y) ≥ min(d_part(x, y), min over b, c of d_part(x, b) + ‖b − c‖ + d_part(c, y)).
        # Two minima, first over b and then over c, cost O(m q (q + r)).
        # (m, q, 1) + (q, q) -> (m, q), from each source to the point c of return
        before = (self.columns[:, sources].T[:, :, None] + self.straight).min(axis=1)
        after = self.columns[:, others]
        through = np.stack([(row[:, None] + after).min(axis=0) for row in before]) if len(before) else along
        # A path can leave the part between two samples, so that it is shorter by up to the gap.
        return np.asarray(np.minimum(along, np.maximum(through - self.gap, 0.0)))
