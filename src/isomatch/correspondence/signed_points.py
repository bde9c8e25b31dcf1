"""Points with an indefinite inner product, as plain arrays; geodesic distance descriptors are such points."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class SignedPoints:
    """A point cloud with the inner product ⟨x, y⟩ = Σ_c sign_c x_c y_c.

    Parameters
    ----------
    coordinates : (..., n, k) array of float
        One row for each point. Leading axes are stacks of clouds.
    signs : (k,) array of float
        1 or −1 for each column. A column of sign −1 stands for an imaginary one.

    Examples
    --------
    In one real and one imaginary column, a vector may have a negative square, or square 0 without being 0.

    >>> import numpy as np
    >>> x = SignedPoints(np.array([[2.0, 1.0], [1.0, 1.0], [0.0, 1.0]]), np.array([1.0, -1.0]))
    >>> x.coordinates @ x.signed().T
    array([[ 3.,  1., -1.],
           [ 1.,  0., -1.],
           [-1., -1., -1.]])
    """

    coordinates: FloatArray
    signs: FloatArray

    def at(self, rows: IntArray, k: int | None = None) -> SignedPoints:
        """Restrict to some points, and to the first k columns."""
        return SignedPoints(self.coordinates[rows, :k], self.signs[:k])

    def signed(self) -> FloatArray:
        """Coordinates times signs: ``x.coordinates @ x.signed().T`` holds all inner products."""
        return self.coordinates * self.signs
