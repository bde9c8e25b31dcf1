"""temporary"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from isomatch.surfaces.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Resampling:
    fine: Mesh
    coarse: Mesh
    owner: np.ndarray

    def _go(self, mesh, P, N, w=0.05):
        from isomatch.correspondence.precise_points import nearest_points

        X = np.hstack([mesh.vertices, w * mesh.vertex_normals])
        Q = np.hstack([P, w * N])
        v = cKDTree(X, balanced_tree=False, compact_nodes=False).query(Q)[1]
        return nearest_points(X, Q, mesh.faces, v)

    @cached_property
    def place(self):
        return self._go(self.coarse, self.fine.vertices, self.fine.vertex_normals)

    def nearest(self, P, N, seeds):
        N = N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-12)
        return self._go(self.fine, P, N)
