"""Points with an indefinite inner product: what geodesic distance descriptors are, seen as plain arrays."""

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
    """

    coordinates: FloatArray
    signs: FloatArray

    def at(self, rows: IntArray, k: int | None = None) -> SignedPoints:
        """Restrict to some points, and to the first k columns."""
        return SignedPoints(self.coordinates[rows, :k], self.signs[:k])

    def signed(self) -> FloatArray:
        """Coordinates times signs: ``x.coordinates @ x.signed().T`` holds all inner products."""
        return self.coordinates * self.signs
