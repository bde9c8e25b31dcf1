"""Orthogonal alignment of signed point clouds: Procrustes, and iterative closest points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence.nearest_neighbours import nearest_of_few
from isomatch.correspondence.signed_points import SignedPoints
from isomatch.values.arrays import FloatArray, IntArray

NULL_DIRECTION = (
    1e-9  # rounding: singular values below this share of the largest leave the rotation undetermined
)


def signed_procrustes(source: SignedPoints, target: SignedPoints) -> FloatArray:
    """Find the orthogonal C that minimises ‖T C − S‖ and mixes only columns of equal sign.

    Parameters
    ----------
    source, target : SignedPoints
        The same m points on both shapes, row by row, with k_s and k_t columns. Stacks (..., m, k) are aligned one by
        one.

    Returns
    -------
    (..., k_t, k_s) array of float
        C, orthogonal within each block of equal signs, so that inner products are kept. Where a block has more
        columns on one side, or the points leave a direction undetermined, C is a partial isometry: the direction is
        dropped.

    Notes
    -----
    Schönemann 1966, once for each sign. O(m k²).

    Examples
    --------
    >>> x = SignedPoints(np.array([[1.0, 2.0], [3.0, -1.0]]), np.array([1.0, -1.0]))
    >>> mirrored = SignedPoints(x.coordinates * [1.0, -1.0], x.signs)
    >>> signed_procrustes(mirrored, x)
    array([[ 1.,  0.],
           [ 0., -1.]])
    """
    cross = target.coordinates.swapaxes(-1, -2) @ source.coordinates  # (..., k_t, m) (..., m, k_s)
    rotation = np.zeros_like(cross)
    for sign in (1.0, -1.0):
        block = (..., *np.ix_(target.signs == sign, source.signs == sign))
        if cross[block].size:
            u, scale, v = np.linalg.svd(cross[block], full_matrices=False)
            held = scale > NULL_DIRECTION * np.maximum(scale[..., :1], np.finfo(float).tiny)
            rotation[block] = (u * held[..., None, :]) @ v
    return rotation


def alignment_residual(source: SignedPoints, target: SignedPoints, rotation: FloatArray) -> float:
    """Compute the root mean square of ‖t C − s‖ over the m rows of two clouds.

    Parameters
    ----------
    source, target : SignedPoints
        The same m points on both shapes, row by row, with k_s and k_t columns.
    rotation : (k_t, k_s) array of float
        C.

    Returns
    -------
    float
        √(Σ_i ‖t_i C − s_i‖² / m) in the unit of the coordinates; every column counts as real. O(m k_t k_s).

    Examples
    --------
    >>> source = SignedPoints(np.array([[0.0], [3.0]]), np.ones(1))
    >>> target = SignedPoints(np.array([[0.0], [-4.0]]), np.ones(1))
    >>> round(alignment_residual(source, target, np.array([[-1.0]])), 4)
    0.7071
    """
    difference = target.coordinates @ rotation - source.coordinates
    return float(np.sqrt((difference**2).sum(axis=1).mean()))


@dataclass(frozen=True, eq=False)
class Alignment:
    """A map between two clouds, and the rotation that aligns them under it.

    Parameters
    ----------
    target_row : (m_source,) array of int
        Row of the target cloud for each row of the source cloud.
    rotation : (k_t, k_s) array of float
        C, with target · C ≈ source.
    residual : float
        See `alignment_residual`.

    Examples
    --------
    >>> Alignment(np.array([1, 0]), np.eye(2), residual=0.1).target_row
    array([1, 0])
    """

    target_row: IntArray
    rotation: FloatArray
    residual: float


def iterative_closest_points(
    source: SignedPoints,
    target: SignedPoints,
    starts: IntArray,
    max_iterations: int,
    unchanged: float = 0.99,
) -> list[Alignment]:
    """Alternate the best rotation and the nearest neighbours, from several first maps at once.

    Parameters
    ----------
    source, target : SignedPoints
        m_s and m_t points.
    starts : (h, m_s) array of int
        First maps: target row of each source row.
    max_iterations : int
        Largest number of iterations.
    unchanged : float
        A map with at least this share of unchanged images has converged.

    Returns
    -------
    list of Alignment
        One for each first map.

    Notes
    -----
    Shamai & Kimmel 2017, the algorithm for min ‖P X₁ C − X₂‖. O(m_t m_s k) for each iteration and first map.

    Examples
    --------
    The image of the last point is wrong at first; the rotation that fits the others corrects it.

    >>> corners = SignedPoints(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0], [0.0, 4.0]]), np.ones(2))
    >>> turned = SignedPoints(corners.coordinates @ np.array([[0.0, 1.0], [-1.0, 0.0]]), corners.signs)
    >>> alignment, = iterative_closest_points(corners, turned, np.array([[0, 1, 2, 2]]), max_iterations=10)
    >>> alignment.target_row, round(alignment.residual, 6)
    (array([0, 1, 2, 3]), 0.0)
    """
    images = closest_point_images(source, target, starts, max_iterations, unchanged)
    rotations = signed_procrustes(source, target.at(images))
    return [Alignment(i, c, alignment_residual(source, target.at(i), c)) for i, c in zip(images, rotations)]


def closest_point_images(
    source: SignedPoints,
    target: SignedPoints,
    starts: IntArray,
    max_iterations: int,
    unchanged: float = 0.99,
) -> IntArray:
    """Return the maps of `iterative_closest_points` alone, without the rotations: (h, m_s) target rows.

    Examples
    --------
    >>> corners = SignedPoints(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0], [0.0, 4.0]]), np.ones(2))
    >>> closest_point_images(corners, corners, np.array([[0, 1, 2, 2]]), max_iterations=10)
    array([[0, 1, 2, 3]])
    """
    images, moving = starts.copy(), np.arange(len(starts))
    for _ in range(max_iterations):
        previous = images[moving]
        turned = target.coordinates @ signed_procrustes(source, target.at(previous))
        for i, points in zip(moving, turned):
            images[i] = nearest_of_few(points, source.coordinates)
        moving = moving[(images[moving] == previous).mean(axis=1) < unchanged]
    return images
