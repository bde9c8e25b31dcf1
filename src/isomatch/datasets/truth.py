"""Ground truth between two triangulations of one surface: exact closest points of a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch.surfaces import Mesh, nearest_on_surface


@dataclass(frozen=True, eq=False)
class Truth:
    """True image of each of n source vertices on the target."""

    vertices: IntArray  # (n,) nearest target vertex
    faces: IntArray  # (n,) target face that contains the closest point
    barycentric: FloatArray  # (n, 3) weights of the three corners of that face

    def points(self, target: Mesh) -> FloatArray:
        """Compute the precise images, (n, 3), on the target mesh in any pose."""
        corners = target.vertices[target.faces[self.faces]]
        return np.asarray(np.einsum("ij,ijx->ix", self.barycentric, corners))


def closest_points(points: FloatArray, mesh: Mesh) -> Truth:
    """Find the closest point of a mesh to each of (n, 3) points, exactly."""
    corners, barycentric = nearest_on_surface(mesh, points)
    number = {face: i for i, face in enumerate(map(tuple, mesh.faces.tolist()))}
    faces = np.array([number.get(face, -1) for face in map(tuple, corners.tolist())], dtype=np.int64)
    alone = np.flatnonzero(faces < 0)  # vertices, which are in the first face that has them
    used, first = np.unique(mesh.faces, return_index=True)
    at = first[np.searchsorted(used, corners[alone, 0])]
    faces[alone], barycentric[alone] = at // 3, np.eye(3)[at % 3]
    nearest: IntArray = KDTree(mesh.vertices).query(points)[1].astype(np.int64)
    return Truth(nearest, faces, np.maximum(barycentric, 0.0))  # −1e-17 by rounding
