"""Signed mean curvature, which distinguishes outward bumps from inward dents; intrinsic descriptors cannot."""

from __future__ import annotations

import numpy as np

from isomatch.bases import LaplaceBasis
from isomatch.mending import without_seams
from isomatch.runtime.threads import row_product
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray

CLIPPED = 0.02  # share of the values clipped at either end; curvature at sharp tips is noisy and large


def mean_curvature(mesh: Mesh, laplace: LaplaceBasis, k: int, *, weld: bool = True) -> FloatArray:
    """Signed mean curvature of a mesh smoothed to its first k Laplace eigenfunctions.

    It is positive where the surface bulges to the side to which its faces look: on outward bumps of a closed mesh that is
    wound outward. Unlike the other descriptors it is extrinsic: it depends on the pose, but not on rigid motion.

    Parameters
    ----------
    mesh : Mesh
        A mesh of n vertices.
    laplace : LaplaceBasis
        Its eigenfunctions Φ and eigenvalues Λ.
    k : int
        Number of eigenfunctions used; fewer give a smoother surface.
    weld : bool
        Whether vertices at exactly the same position are one point of the surface, as they were for ``laplace``.

    Returns
    -------
    (n,) array of float
        In 1 / mesh units, clipped to the 2 % and 98 % quantiles.

    Notes
    -----
    With V_k = Φ_k Φ_kᵀA V the low-passed coordinates, N_k their normals and −Δ V_k = Φ_k Λ_k Φ_kᵀA V the mean curvature
    normal, H = ½ ⟨−Δ V_k, N_k⟩; a sphere of radius r has H = 1 / r. O(n k). The low pass is that of Vallet & Lévy,
    *Spectral Geometry Processing with Manifold Harmonics*, 2008; −Δ V = 2 H N, see Meyer et al., *Discrete
    Differential-Geometry Operators for Triangulated 2-Manifolds*, 2003.
    """
    coefficients = laplace.coefficients(mesh.vertices, k)
    basis = laplace.vectors[:, :k]
    smooth = row_product(basis, coefficients)
    mesh, seams = without_seams(mesh, weld)
    if seams:
        normals = mesh.moved(smooth[seams.vertex_index]).vertex_normals[seams.new_index]
    else:
        normals = mesh.moved(smooth).vertex_normals
    bending = row_product(basis, laplace.values[:k, None] * coefficients)  # −Δ of the coordinates
    curvature = 0.5 * np.einsum("ij,ij->i", bending, normals)
    low, high = np.quantile(curvature, [CLIPPED, 1 - CLIPPED])
    return np.asarray(np.clip(curvature, low, high), dtype=np.float64)
