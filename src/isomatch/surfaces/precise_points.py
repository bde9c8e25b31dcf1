"""Points on the triangles of a surface, and the nearest point of a triangle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.compiled import compiled


class PrecisePoints(NamedTuple):
    """Points on the triangles of a surface.

    Parameters
    ----------
    corners : (m, 3) array of int
        Vertices of the triangle that holds each point.
    barycentric : (m, 3) array of float
        Their weights: not negative, sum 1.

    Examples
    --------
    >>> points = PrecisePoints(np.array([[0, 1, 2], [2, 2, 2]]), np.array([[0.5, 0.5, 0.0], [1.0, 0.0, 0.0]]))
    >>> points.interpolated(np.array([[0.0], [10.0], [20.0]]))
    array([[ 5.],
           [20.]])
    """

    corners: IntArray
    barycentric: FloatArray

    @classmethod
    def at_vertices(cls, vertices: IntArray) -> PrecisePoints:
        """Take vertices (m,) themselves."""
        return cls(np.repeat(vertices[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (len(vertices), 1)))

    def interpolated(self, values: FloatArray) -> FloatArray:
        """Interpolate values (n, q) at the vertices: (m, q); nan with weight 0 is ignored."""
        weights = self.barycentric.astype(values.dtype)
        total: FloatArray = weights[:, :1] * values[self.corners[:, 0]]
        for corner in (1, 2):
            total += weights[:, corner, None] * values[self.corners[:, corner]]
        rows = np.flatnonzero((weights == 0).any(axis=1) & np.isnan(total).any(axis=1))
        parts = weights[rows, :, None] * values[self.corners[rows]]
        total[rows] = np.where(weights[rows, :, None] == 0, 0, parts).sum(axis=1)
        return total

    def interpolation(self, n_vertices: int) -> scipy.sparse.csr_array:
        """(m, n) matrix whose product with values at the n vertices interpolates them at the points."""
        rows = np.repeat(np.arange(len(self.corners)), 3)
        entries = (self.barycentric.ravel(), (rows, self.corners.ravel()))
        return scipy.sparse.csr_array(entries, shape=(len(self.corners), n_vertices))


@compiled(inline="always")
def nearest_in_triangle(uu: float, uv: float, vv: float, up: float, vp: float) -> tuple[float, float, float]:
    """Find the point s u + t v of a triangle that is nearest to a point p, from inner products alone.

    u = b − a, v = c − a and p start at the corner a, in a space of any dimension. Returns s, t ≥ 0 with s + t ≤ 1, and
    ``|s u + t v − p|² − |p|²``: never positive, and 0 at the corner a.

    Examples
    --------
    >>> nearest_in_triangle(1.0, 0.0, 1.0, 2.0, 2.0)  # u = (1, 0), v = (0, 1), p = (2, 2): beyond the edge from b to c
    (0.5, 0.5, -3.5)
    """
    if up <= 0.0 and vp <= 0.0:  # p lies behind both edges from a
        return 0.0, 0.0, 0.0
    # Inside, the gradient of |s u + t v − p|² vanishes: s uu + t uv = up and s uv + t vv = vp, solved by
    # Cramer's rule; otherwise the minimum is on an edge. A triangle without area has no inside.
    determinant = uu * vv - uv * uv
    if determinant > 1e-12 * uu * vv:
        s, t = (up * vv - vp * uv) / determinant, (vp * uu - up * uv) / determinant
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            return s, t, -(s * up + t * vp)
    best_s = best_t = best = 0.0
    for case in range(3):  # project p onto the edges (a, b), (a, c), (b, c)
        s = t = 0.0
        if case == 0 and uu > 0.0:
            s = min(max(up / uu, 0.0), 1.0)
        elif case == 1 and vv > 0.0:
            t = min(max(vp / vv, 0.0), 1.0)
        elif case == 2:
            across = uu - 2.0 * uv + vv
            if across > 0.0:  # across = |v − u|², and t = (p − u)·(v − u) / across is the share of the way
                t = min(max((uu - uv + vp - up) / across, 0.0), 1.0)
                s = 1.0 - t
        gain = s * s * uu + 2.0 * s * t * uv + t * t * vv - 2.0 * (s * up + t * vp)
        if gain < best:
            best_s, best_t, best = s, t, gain
    return best_s, best_t, best
