"""The geodesic distance descriptor: coordinates in which the inner product is the geodesic distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.bases import DistanceBasis


@dataclass(frozen=True, eq=False)
class GeodesicDistanceDescriptor:
    """Descriptor X = Q Λ^½ with D ≈ X Xᵀ (bilinear, without conjugation).

    Λ is indefinite, so every column of X is purely real or purely imaginary. Stored are the real coordinates
    Q |Λ|^½ and the signature, so that D_ij ≈ Σ_c signature_c · x_ic · x_jc.

    Parameters
    ----------
    coordinates : (n, k) array of float
        In the square root of mesh units; columns in decreasing order of what they contribute to D.
    signature : (k,) array of float
        1 for a real column, −1 for an imaginary one.
    """

    coordinates: FloatArray
    signature: FloatArray

    def at(self, vertices: IntArray, k: int | None = None) -> GeodesicDistanceDescriptor:
        """Restrict to some of the vertices, and to the first k columns."""
        return GeodesicDistanceDescriptor(self.coordinates[vertices, :k], self.signature[:k])

    def inner(self) -> FloatArray:
        """Coordinates times signature: D ≈ ``coordinates @ inner().T``."""
        return self.coordinates * self.signature


def geodesic_distance_descriptor(basis: DistanceBasis, k: int | None = None) -> GeodesicDistanceDescriptor:
    """Compute the descriptor of every vertex from a distance basis, with its first k columns.

    Notes
    -----
    Shamai & Kimmel, Geodesic Distance Descriptors, CVPR 2017. Two isometric shapes have descriptors that differ by a
    unitary matrix only. Columns are never normalised: their decay is what makes the leading ones count most.

    Examples
    --------
    >>> from isomatch import Mesh, distance_basis
    >>> tetrahedron = Mesh(np.eye(4)[:, :3], [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    >>> x = geodesic_distance_descriptor(distance_basis(tetrahedron, k=4, p=4, weights="uniform"))
    >>> bool(abs(x.coordinates[0] @ x.inner()[1] - 2**0.5) < 1e-6)
    True
    """
    values = basis.values[:k]
    return GeodesicDistanceDescriptor(basis.vectors[:, :k] * np.sqrt(np.abs(values)), np.sign(values))
