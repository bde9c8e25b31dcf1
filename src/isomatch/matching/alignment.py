"""Aligning two descriptor clouds: orthogonal Procrustes within sign blocks, and iterative closest points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.descriptors import GeodesicDistanceDescriptor

NULL_DIRECTION = 1e-9  # singular values below this share of the largest leave the rotation undetermined
SETTLED = 0.99  # share of unchanged images at which an iteration has converged


def orthogonal_alignment(
    target: GeodesicDistanceDescriptor, source: GeodesicDistanceDescriptor
) -> FloatArray:
    """Find the orthogonal C that minimises ‖T C − S‖ and mixes columns of equal sign only.

    Parameters
    ----------
    target, source : GeodesicDistanceDescriptor
        The same m points on both shapes, row by row; k_t and k_s columns. Points may be stacks (..., m, k), aligned
        one by one.

    Returns
    -------
    (..., k_t, k_s) array of float
        Real orthogonal on each sign block. D = X Xᵀ must be kept and a real column never turns into an imaginary
        one. Where a block has more columns on one side, or a direction is not determined by the points, C is a
        partial isometry: it drops the direction and does not invent a rotation.

    Notes
    -----
    Schönemann 1966, once for each sign. O(m k²).
    """
    cross = target.coordinates.swapaxes(-1, -2) @ source.coordinates  # (..., k_t, m) (..., m, k_s)
    rotation = np.zeros_like(cross)
    for sign in (1.0, -1.0):
        block = (..., *np.ix_(target.signature == sign, source.signature == sign))
        if cross[block].size:
            u, scale, v = np.linalg.svd(cross[block], full_matrices=False)
            held = scale > NULL_DIRECTION * np.maximum(scale[..., :1], np.finfo(float).tiny)
            rotation[block] = (u * held[..., None, :]) @ v
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
    """

    image: IntArray
    rotation: FloatArray
    residual: float


def icp(
    target: GeodesicDistanceDescriptor,
    source: GeodesicDistanceDescriptor,
    starts: IntArray,
    max_iterations: int,
    extra: tuple[FloatArray, FloatArray] | None = None,
) -> list[Alignment]:
    """Alternate the best rotation and the nearest neighbours, from several given maps at once.

    Parameters
    ----------
    target, source : GeodesicDistanceDescriptor
        m_t and m_s points.
    starts : (h, m_s) array of int
        First guesses: target row of each source row.
    max_iterations : int
        Limit; a map whose images are 99 % unchanged is left as it is.
    extra : pair of (m_t, q) and (m_s, q) arrays, optional
        More coordinates for the nearest neighbours, which the rotation leaves alone.

    Returns
    -------
    list of Alignment
        One for each start.

    Notes
    -----
    Shamai & Kimmel 2017, the algorithm for min ‖P X₁ C − X₂‖; O(m_t m_s k) a step and start.
    """
    images, moving = starts.copy(), np.arange(len(starts))
    beside = (
        (np.empty((len(target.coordinates), 0)), np.empty((len(source.coordinates), 0)))
        if extra is None
        else extra
    )
    fixed = np.hstack([source.coordinates, beside[1]])
    for _ in range(max_iterations):
        previous = images[moving]
        turned = target.coordinates @ orthogonal_alignment(target.at(previous), source)
        for i, points in zip(moving, turned):
            images[i] = _nearest(np.hstack([points, beside[0]]), fixed)
        moving = moving[(images[moving] == previous).mean(axis=1) < SETTLED]
    rotations = orthogonal_alignment(target.at(images), source)
    return [Alignment(i, c, residual(target.at(i), source, c)) for i, c in zip(images, rotations)]


def _nearest(candidates: FloatArray, queries: FloatArray) -> IntArray:
    """Row of the candidate nearest to each query, for few of both."""
    scores = queries @ candidates.T - 0.5 * np.einsum("ij,ij->i", candidates, candidates)
    return np.asarray(scores.argmax(axis=1))


def residual(
    target: GeodesicDistanceDescriptor, source: GeodesicDistanceDescriptor, rotation: FloatArray
) -> float:
    """Root mean square distance of each aligned target point from the source point of the same row."""
    difference = target.coordinates @ rotation - source.coordinates
    return float(np.sqrt((difference**2).sum(axis=1).mean()))
