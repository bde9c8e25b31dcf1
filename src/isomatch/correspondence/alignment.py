"""Orthogonal alignment of signed point clouds: Procrustes, iterative closest points, and first alignments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch.correspondence.nearest import nearest_of_few, nearest_rows

# Singular values of TᵀS (see `signed_procrustes`) up to this share of the largest one are rounding: the
# points do not determine a rotation in their directions, which are dropped; chosen.
MIN_SINGULAR_RATIO = 1e-9


@dataclass(frozen=True, eq=False)
class SignedPoints:
    """A cloud of points (..., n, k), ⟨x, y⟩ = Σ_c sign_c x_c y_c; sign −1 stands for an imaginary column.

    Examples
    --------
    In one real and one imaginary column, a vector that is not 0 may have the square 0 or −1.

    >>> x = SignedPoints(np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([1.0, -1.0]))
    >>> np.diag(x.coordinates @ x.signed().T)
    array([ 0., -1.])
    """

    coordinates: FloatArray
    signs: FloatArray

    def at(self, rows: IntArray, k: int | None = None) -> SignedPoints:
        """Restrict to some points, and to the first k columns."""
        return SignedPoints(self.coordinates[rows, :k], self.signs[:k])

    def signed(self) -> FloatArray:
        """Coordinates times signs: ``x.coordinates @ x.signed().T`` holds all inner products."""
        return self.coordinates * self.signs


def signed_procrustes(source: SignedPoints, target: SignedPoints) -> FloatArray:
    """Find the orthogonal C (..., k_t, k_s) that minimises ‖T C − S‖ and mixes only columns of equal sign.

    The clouds hold the same m points on both shapes, row by row; stacks (..., m, k) are aligned one
    by one. If a sign has more columns on one side, or the points leave a direction undetermined, C
    is a partial isometry. O(m k²).

    Examples
    --------
    >>> x = SignedPoints(np.array([[1.0, 2.0], [3.0, -1.0]]), np.array([1.0, -1.0]))
    >>> mirrored = SignedPoints(x.coordinates * [1.0, -1.0], x.signs)
    >>> signed_procrustes(mirrored, x)
    array([[ 1.,  0.],
           [ 0., -1.]])
    """
    # Schönemann, *A generalized solution of the orthogonal Procrustes problem*, Psychometrika 1966, applied
    # to the columns of each sign. T and S are the coordinates of target and source. For orthogonal C, ‖T
    # C − S‖² = ‖T‖² + ‖S‖² − 2 tr(Cᵀ Tᵀ S). With the SVD Tᵀ S = U Σ Vᵀ the trace is tr((Uᵀ C V)ᵀ Σ) ≤ tr
    # Σ, and C = U Vᵀ attains this bound. C keeps the inner products within each sign, and so the signed ones:
    # (T C) diag(signs) (T C)ᵀ = T diag(signs) Tᵀ. Where a singular value is 0, any rotation would do, and C
    # drops the direction.
    cross = target.coordinates.swapaxes(-1, -2) @ source.coordinates  # (..., k_t, m) @ (..., m, k_s)
    rotation = np.zeros_like(cross)
    for sign in (1.0, -1.0):
        block = (..., *np.ix_(target.signs == sign, source.signs == sign))
        if cross[block].size:
            u, scale, v = np.linalg.svd(cross[block], full_matrices=False)
            is_determined = scale > MIN_SINGULAR_RATIO * np.maximum(scale[..., :1], np.finfo(float).tiny)
            rotation[block] = (u * is_determined[..., None, :]) @ v
    return rotation


def alignment_residual(source: SignedPoints, target: SignedPoints, rotation: FloatArray) -> float:
    """Compute √(Σ_i ‖t_i C − s_i‖² / m) over the m rows of two clouds; every column counts as real.

    Examples
    --------
    >>> three, minus_four = (SignedPoints(np.array([[x]]), np.ones(1)) for x in (3.0, -4.0))
    >>> alignment_residual(three, minus_four, np.array([[-1.0]]))
    1.0
    """
    difference = target.coordinates @ rotation - source.coordinates
    return float(np.sqrt((difference**2).sum(axis=1).mean()))


@dataclass(frozen=True, eq=False)
class Alignment:
    """A map between clouds, the C (k_t, k_s) that aligns them, target · C ≈ source, and its residual.

    Examples
    --------
    >>> Alignment(np.array([1, 0]), np.eye(2), residual=0.1).target_row
    array([1, 0])
    """

    target_row: IntArray  # the row of the target cloud for each row of the source cloud, (m_source,)
    rotation: FloatArray
    residual: float


def iterative_closest_points(
    source: SignedPoints, target: SignedPoints, starts: IntArray, max_iterations: int, unchanged: float = 0.99
) -> list[Alignment]:
    """Alternate the best rotation and the nearest neighbours, from several first maps at once.

    The first maps, (h, m_s), give a target row for each source row. A map with at least the share
    ``unchanged`` of unchanged images has converged. Returns an alignment for each first map.
    O(m_t m_s k) for each iteration and first map.

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
    source: SignedPoints, target: SignedPoints, starts: IntArray, max_iterations: int, unchanged: float = 0.99
) -> IntArray:
    """Return the maps of `iterative_closest_points` alone, without the rotations: (h, m_s) target rows.

    Examples
    --------
    >>> corners = SignedPoints(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0], [0.0, 4.0]]), np.ones(2))
    >>> closest_point_images(corners, corners, np.array([[0, 1, 2, 2]]), max_iterations=10)
    array([[0, 1, 2, 3]])
    """
    # min ‖P X_t C − X_s‖ over maps P and orthogonal C, with the coordinates X_t of the target and X_s of the
    # source (Shamai & Kimmel 2017; Besl & McKay, PAMI 1992, for rigid motions). Given P, `signed_procrustes`
    # finds C; given C, the best image of a source point is the nearest target point. Each step lowers the
    # norm.
    images, active = starts.copy(), np.arange(len(starts))
    for _ in range(max_iterations):
        previous = images[active]
        rotated = target.coordinates @ signed_procrustes(source, target.at(previous))
        for i, points in zip(active, rotated):
            images[i] = nearest_of_few(points, source.coordinates)
        active = active[(images[active] == previous).mean(axis=1) < unchanged]
    return images


def alignments_from_points(
    source: SignedPoints,
    target: SignedPoints,
    source_rows: IntArray,
    target_rows: IntArray,
    n_columns: int = 20,
    off_diagonal: float = 0.01,
    ridge: float = 0.001,
) -> FloatArray:
    """Align the leading k columns of two clouds at m corresponding rows (h, m): (h, k, k).

    A few points determine no more than ``n_columns``. ``off_diagonal`` is the penalty on mixing
    columns, ``ridge`` the penalty on every entry, which decides what the points leave open.

    Examples
    --------
    The second columns differ in sign, as two points show.

    >>> cloud = SignedPoints(np.array([[1.0, 2.0], [-1.0, 1.0], [3.0, 0.0]]), np.ones(2))
    >>> mirrored = SignedPoints(cloud.coordinates * [1.0, -1.0], cloud.signs)
    >>> alignments_from_points(cloud, mirrored, np.array([[0, 1]]), np.array([[0, 1]])).round(1)[0] + 0.0
    array([[ 1.,  0.],
           [ 0., -1.]])
    """
    # Shamai & Kimmel 2017, initialisation from feature points. Y and X hold the first k coordinates of the
    # target's and of the source's points, one row for each of the m points, and Y C ≈ X. Each column c_j of C
    # solves by itself
    #   min ‖Y c_j − x_j‖² + Σ_i (q s (i − j)² + r s) c_ij²,  (YᵀY + diag_i(q s (i − j)² + r s)) c_j = Yᵀ x_j,
    # with the penalties q (``off_diagonal``) and r (``ridge``) and the mean squared norm s of all rows of the
    # target. Near-isometric shapes have nearly equal spectra, so that distant columns mix little. Columns i
    # and j of unequal sign do not mix: c_ij = 0. O(h k⁴).
    k = min(n_columns, len(target.signs), len(source.signs))
    leading = target.coordinates[:, :k]
    s = float((leading**2).sum(axis=1).mean())
    allowed = target.signs[:k, None] == source.signs[:k]  # (i, j)
    y, x = leading[target_rows], source.coordinates[source_rows][..., :k]  # (h, m, k)
    offset = np.subtract.outer(np.arange(k), np.arange(k))
    penalty = s * (off_diagonal * offset**2 + ridge)  # (i, j)
    gram, right = y.swapaxes(1, 2) @ y, y.swapaxes(1, 2) @ x  # (h, k, k)
    # Row i of the system of column j has only its diagonal entry if the signs of i and j differ, so that
    # c_ij = 0.
    mask = allowed.T[:, :, None] & allowed.T[:, None, :]  # (j, i, i')
    systems = np.where(mask, gram[:, None], 0.0) + np.eye(k) * penalty.T[:, None, :]
    columns = np.linalg.solve(systems, (right * allowed).swapaxes(1, 2)[..., None])[..., 0]  # (h, j, i)
    return np.asarray(columns.swapaxes(1, 2))


def alignment_from_functions(
    source: SignedPoints,
    target: SignedPoints,
    source_functions: FloatArray,
    target_functions: FloatArray,
    source_weights: FloatArray,
    target_weights: FloatArray,
    n_columns: int = 20,
    off_diagonal: float = 0.01,
    ridge: float = 0.001,
) -> FloatArray:
    """Align two clouds of all vertices by q functions that should correspond, (n_s, q) and (n_t, q): (k, k).

    The weights are the vertex areas; other parameters as for `alignments_from_points`.

    Examples
    --------
    Indicators of corresponding vertices show that the second columns differ in sign.

    >>> cloud = SignedPoints(np.array([[1.0, 2.0], [-1.0, 1.0], [3.0, 0.0]]), np.ones(2))
    >>> mirrored = SignedPoints(cloud.coordinates * [1.0, -1.0], cloud.signs)
    >>> areas = np.full(3, 1 / 3)
    >>> alignment_from_functions(cloud, mirrored, np.eye(3), np.eye(3), areas, areas).round(1) + 0.0
    array([[ 1.,  0.],
           [ 0., -1.]])
    """
    # Shamai & Kimmel 2017, initialisation from descriptors. The coordinates are X = Q W, with W = |Λ|^½ and Q
    # orthonormal in the vertex areas A, so that Xᵀ A f = W (Qᵀ A f) is W times the coefficients of a function
    # f. For an isometry, C relates these products of both shapes as it relates their points: (F_tᵀ A_t X_t)
    # C ≈ F_sᵀ A_s X_s, with one column of F for each function. This is the problem of
    # `alignments_from_points`, with one row for each function.
    on_source = (source.coordinates.T @ (source_weights[:, None] * source_functions)).T
    on_target = (target.coordinates.T @ (target_weights[:, None] * target_functions)).T
    points = SignedPoints(on_source, source.signs), SignedPoints(on_target, target.signs)
    rows = np.arange(source_functions.shape[1])[None]
    return np.asarray(alignments_from_points(*points, rows, rows, n_columns, off_diagonal, ridge)[0])


def nearest_under_rotation(source: SignedPoints, target: SignedPoints, rotation: FloatArray) -> IntArray:
    """Find the nearest target row (m_s,) of each source row, with the leading columns of the target rotated.

    Examples
    --------
    >>> source = SignedPoints(np.array([[1.0], [5.0]]), np.ones(1))
    >>> target = SignedPoints(np.array([[-5.5], [-0.5]]), np.ones(1))
    >>> nearest_under_rotation(source, target, np.array([[-1.0]]))
    array([1, 0])
    """
    k_target, k_source = rotation.shape
    return nearest_rows(target.coordinates[:, :k_target] @ rotation, source.coordinates[:, :k_source])
