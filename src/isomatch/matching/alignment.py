"""Aligning two descriptor clouds: orthogonal Procrustes within sign blocks, and iterative closest points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.matching.nearest import nearest_rows

NULL_DIRECTION = 1e-9  # singular values below this share of the largest leave the rotation undetermined
SETTLED = 0.99  # share of unchanged images at which an iteration has converged


@dataclass(frozen=True, eq=False)
class DescriptorCloud:
    """Geodesic distance descriptors of some vertices.

    Parameters
    ----------
    points : (m, k) array of float
        Real coordinates.
    signature : (k,) array of float
        1 for a real column, −1 for an imaginary one.
    """

    points: FloatArray
    signature: FloatArray

    def at(self, rows: IntArray) -> DescriptorCloud:
        """Restrict to some of the vertices."""
        return DescriptorCloud(self.points[rows], self.signature)


def orthogonal_alignment(target: DescriptorCloud, source: DescriptorCloud) -> FloatArray:
    """Find the orthogonal C that minimises ‖T C − S‖ and mixes columns of equal sign only.

    Parameters
    ----------
    target, source : DescriptorCloud
        The same m points on both shapes, row by row; k_t and k_s columns.

    Returns
    -------
    (k_t, k_s) array of float
        Real orthogonal on each sign block. D = X Xᵀ must be kept and a real column never turns into an imaginary
        one. Where a block has more columns on one side, or a direction is not determined by the points, C is a
        partial isometry: it drops the direction and does not invent a rotation.

    Notes
    -----
    Schönemann 1966, once for each sign. O(m k²).
    """
    cross = target.points.T @ source.points  # (k_t, m) (m, k_s)
    rotation = np.zeros_like(cross)
    for sign in (1.0, -1.0):
        block = np.ix_(target.signature == sign, source.signature == sign)
        if cross[block].size:
            u, scale, v = np.linalg.svd(cross[block], full_matrices=False)
            held = scale > NULL_DIRECTION * max(scale[0], np.finfo(float).tiny)
            rotation[block] = u[:, held] @ v[held]
    return rotation


@dataclass(frozen=True, eq=False)
class Alignment:
    """Result of `icp`: the image of each source row, the rotation, and how well they fit.

    Parameters
    ----------
    image : (m_source,) array of int
        Row of the target cloud for each row of the source cloud.
    rotation : (k_t, k_s) array of float
        C, with target · C ≈ source.
    residual : float
        Root mean square of ‖x_target C − x_source‖ over the rows.
    n_iterations : int
        Steps taken.
    """

    image: IntArray
    rotation: FloatArray
    residual: float
    n_iterations: int


def icp(
    target: DescriptorCloud,
    source: DescriptorCloud,
    image: IntArray,
    max_iterations: int,
    extra: tuple[FloatArray, FloatArray] | None = None,
) -> Alignment:
    """Alternate the best rotation and the nearest neighbours, from a given map.

    Parameters
    ----------
    target, source : DescriptorCloud
        m_t and m_s points.
    image : (m_s,) array of int
        First guess: target row of each source row.
    max_iterations : int
        Limit; the iteration ends sooner when 99 % of the images are unchanged.
    extra : pair of (m_t, q) and (m_s, q) arrays, optional
        More coordinates for the nearest neighbours, which the rotation leaves alone.

    Returns
    -------
    Alignment

    Notes
    -----
    Shamai & Kimmel 2017, the algorithm for min ‖P X₁ C − X₂‖; O(m_t m_s k) a step.
    """
    steps = 0
    for steps in range(1, max_iterations + 1):  # noqa: B007 - the count is part of the result
        rotation = orthogonal_alignment(target.at(image), source)
        turned, fixed = target.points @ rotation, source.points
        if extra is not None:
            turned, fixed = np.hstack([turned, extra[0]]), np.hstack([fixed, extra[1]])
        previous, image = image, nearest_rows(turned, fixed)
        if (previous == image).mean() >= SETTLED:
            break
    rotation = orthogonal_alignment(target.at(image), source)
    return Alignment(image, rotation, residual(target.at(image), source, rotation), steps)


def residual(target: DescriptorCloud, source: DescriptorCloud, rotation: FloatArray) -> float:
    """Root mean square distance of each aligned target point from the source point of the same row."""
    difference = target.points @ rotation - source.points
    return float(np.sqrt((difference**2).sum(axis=1).mean()))
