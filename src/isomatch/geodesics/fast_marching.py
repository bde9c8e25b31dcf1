"""Fast marching on meshes: second order in the edge length, and the fastest engine for meshes."""

from __future__ import annotations

import numpy as np

from isomatch.geodesics.front import Balls, march, march_bounded, march_to, march_within
from isomatch.geodesics.protocol import ColumnEngine
from isomatch.geodesics.stencil import stencil_of
from isomatch.geodesics.units import ordinary_unit, require_finite
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray


class FastMarching(ColumnEngine):
    """Fast marching with unfolded obtuse triangles and a correction for the curvature of the front.

    Parameters
    ----------
    mesh : Mesh
        Any mesh of finite coordinates; it need not be manifold.

    Raises
    ------
    MeshError
        If a coordinate is not finite.

    Notes
    -----
    Kimmel & Sethian, *Computing geodesic paths on manifolds*, PNAS 1998; `isomatch.geodesics.front.march` describes
    the update and the curvature correction. O(n log n) time per column, on all threads. The mean relative error with
    respect to exact geodesics is 0.1 to 0.3 % on animals and people of 5 000 vertices, 0.04 % at 28 000.
    """

    name = "fast_marching"

    def __init__(self, mesh: Mesh) -> None:
        require_finite(mesh)
        self._unit = ordinary_unit(mesh)  # stencils hold lengths in single precision
        self._stencil = stencil_of(mesh.moved(mesh.vertices / self._unit))
        self.n_points = mesh.n_vertices

    def lower(self, nearest: FloatArray, source: int) -> None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        self._require_in_range(np.array([source]))
        if self._unit == 1.0:
            march_bounded(self._stencil, source, nearest)
            return
        scaled = nearest / self._unit
        march_bounded(self._stencil, source, scaled)
        nearest[:] = scaled * self._unit

    def pair_distances(self, pairs: IntArray) -> FloatArray:
        """Distances (m,) of m pairs of vertices; a front ends at the farthest vertex paired with its source."""
        self._require_in_range(pairs.ravel())
        return march_to(self._stencil, pairs.astype(np.int64)) * self._unit

    def balls(self, centres: IntArray, radius: float) -> Balls:
        """Vertices within a radius of m centres; a front ends at the radius."""
        self._require_in_range(centres)
        found = march_within(self._stencil, centres.astype(np.int64), radius / self._unit)
        return found._replace(distances=found.distances * self._unit)

    def _columns(self, sources: IntArray) -> FloatArray:
        distances = march(self._stencil, sources)
        return distances if self._unit == 1.0 else distances * self._unit
