"""Signed mean curvature: what tells a surface from its mirror image, and a chest from a back."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray
from isomatch.bases import LaplaceBasis
from isomatch.surfaces import Mesh
from isomatch.surfaces.mesh import vertex_normals


def mean_curvature(mesh: Mesh, laplace: LaplaceBasis, k: int) -> FloatArray:
    """Signed mean curvature of the surface rebuilt from its first k eigenfunctions; positive on outward bumps.

    H = ½ ⟨Δ V_k, N_k⟩ with V_k the low-passed coordinates and N_k their normals; clipped to its 2 % and 98 % quantiles.
    (n,), in 1 / mesh units.
    """
    coefficients = laplace.coefficients(mesh.vertices, k)
    basis = laplace.vectors[:, :k]
    normals = vertex_normals(basis @ coefficients, mesh.faces)
    bending = basis @ (laplace.values[:k, None] * coefficients)  # −Δ of the coordinates
    curvature = 0.5 * np.einsum("ij,ij->i", bending, normals)
    low, high = np.quantile(curvature, [0.02, 0.98])
    return np.asarray(np.clip(curvature, low, high), dtype=np.float64)
