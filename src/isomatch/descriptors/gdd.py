"""The geodesic distance descriptor: coordinates whose inner products are geodesic distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch.spectral import DistanceBasis


@dataclass(frozen=True, eq=False)
class GeodesicDistanceDescriptor:
    """Descriptor X = Q Λ^½ with D ≈ X Xᵀ (bilinear, without conjugation).

    Λ is indefinite, so every column of X is purely real or purely imaginary. Stored are the real
    coordinates ``Q |Λ|^½`` and the signature; D_ij ≈ Σ_c signature_c · x_ic · x_jc.

    Parameters
    ----------
    coordinates : (n, k) array of float
        In the square root of mesh units; columns in decreasing order of their contribution to D.
    signature : (k,) array of float
        1 for a real column, −1 for an imaginary one.

    Examples
    --------
    Three points on a line: D has trace 0, so that one real coordinate is balanced by two imaginary
    ones.

    >>> from isomatch import distance_basis
    >>> line = np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 1.0], [2.0, 1.0, 0.0]])
    >>> x = geodesic_distance_descriptor(distance_basis(line, k=3, p=3, method="exact"))
    >>> x.signature
    array([ 1., -1., -1.])
    >>> (x.coordinates @ x.inner().T).round(6) + 0.0
    array([[0., 1., 2.],
           [1., 0., 1.],
           [2., 1., 0.]])
    """

    coordinates: FloatArray
    signature: FloatArray

    def at(self, vertices: IntArray, k: int | None = None) -> GeodesicDistanceDescriptor:
        """Restrict to some of the vertices, and to the first k columns."""
        return GeodesicDistanceDescriptor(self.coordinates[vertices, :k], self.signature[:k])

    def inner(self) -> FloatArray:
        """Coordinates times signature, (n, k): D ≈ ``coordinates @ inner().T``."""
        return self.coordinates * self.signature


def geodesic_distance_descriptor(basis: DistanceBasis, k: int | None = None) -> GeodesicDistanceDescriptor:
    """Compute the geodesic distance descriptor of every vertex from k vectors of a distance basis, or all.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017. O(n k).

    Examples
    --------
    >>> from isomatch import Mesh, distance_basis
    >>> tetrahedron = Mesh(np.eye(4)[:, :3], [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    >>> x = geodesic_distance_descriptor(distance_basis(tetrahedron, k=4, p=4, weights="uniform"))
    >>> bool(abs(x.coordinates[0] @ x.inner()[1] - 2**0.5) < 1e-6)
    True
    """
    # X = Q Λ^½ makes D ≈ Q Λ Qᵀ = X Xᵀ. If a permutation P takes the distances of one shape to the distances
    # of another, D₂ = P D₁ Pᵀ, then X₂ X₂ᵀ = (P X₁) (P X₁)ᵀ, and X₂ = P X₁ C with C Cᵀ = I. As both Q are
    # orthonormal eigenvectors, C is ±1 on the diagonal, or orthogonal among columns of one eigenvalue; real
    # and imaginary columns, which belong to eigenvalues of opposite sign, never mix (`signed_procrustes`). So
    # the map is found as the minimum of ‖P X₁ C − X₂‖, alternately in P and C. Columns are not normalised:
    # they decay, so that the leading ones have the largest weight.
    values = basis.values[:k]
    return GeodesicDistanceDescriptor(basis.vectors[:, :k] * np.sqrt(np.abs(values)), np.sign(values))
