"""A first alignment of two signed point clouds by penalised least squares: from a few points, or from functions."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence.nearest_neighbours import nearest_rows
from isomatch.correspondence.signed_points import SignedPoints
from isomatch.values.arrays import FloatArray, IntArray


def alignments_from_points(
    source: SignedPoints,
    target: SignedPoints,
    source_rows: IntArray,
    target_rows: IntArray,
    n_columns: int = 20,
    off_diagonal: float = 0.01,
    ridge: float = 0.001,
) -> FloatArray:
    """Align the leading columns of two clouds at a few corresponding points.

    Parameters
    ----------
    source, target : SignedPoints
        The clouds, with k_s and k_t columns.
    source_rows, target_rows : (h, m) array of int
        Rows of m corresponding points, for each of h alignments.
    n_columns : int
        Leading columns k that are aligned; a few points determine no more.
    off_diagonal : float
        Penalty q on mixing columns.
    ridge : float
        Penalty r on every entry; it decides where the points do not.

    Returns
    -------
    (h, k, k) array of float
        For each set of points the C with target[:, :k] · C ≈ source[:, :k]. Each column j solves
        min ‖Y c − x‖² + Σᵢ (q s (i − j)² + r s) cᵢ², s the mean squared norm of the target's rows. Near-isometric
        shapes have nearly equal spectra, so distant columns mix little. Columns of unequal sign do not mix.

    Notes
    -----
    Shamai & Kimmel 2017, initialisation from feature points. O(h k⁴).

    Examples
    --------
    The second columns differ in sign. Two points show it; one at the origin of that column leaves it to the penalty.

    >>> cloud = SignedPoints(np.array([[1.0, 2.0], [-1.0, 1.0], [3.0, 0.0]]), np.ones(2))
    >>> mirrored = SignedPoints(cloud.coordinates * [1.0, -1.0], cloud.signs)
    >>> rows = np.array([[0, 1], [2, 2]])
    >>> alignments_from_points(cloud, mirrored, rows, rows).round(1) + 0.0
    array([[[ 1.,  0.],
            [ 0., -1.]],
    <BLANKLINE>
           [[ 1.,  0.],
            [ 0.,  0.]]])
    """
    k = min(n_columns, len(target.signs), len(source.signs))
    leading = target.coordinates[:, :k]
    s = float((leading**2).sum(axis=1).mean())
    allowed = target.signs[:k, None] == source.signs[:k]  # (i, j)
    y, x = leading[target_rows], source.coordinates[source_rows][..., :k]  # (h, m, k)
    offset = np.subtract.outer(np.arange(k), np.arange(k))
    penalty = s * (off_diagonal * offset**2 + ridge)  # (i, j)
    gram, right = y.swapaxes(1, 2) @ y, y.swapaxes(1, 2) @ x  # (h, k, k)
    # for every column j: (gram restricted to allowed rows and columns, identity elsewhere) c = right_j
    mask = allowed.T[:, :, None] & allowed.T[:, None, :]  # (j, i, i')
    systems = np.where(mask, gram[:, None], 0.0) + np.eye(k) * penalty.T[:, None, :]
    columns = np.linalg.solve(systems, (right * allowed).swapaxes(1, 2)[..., None])[..., 0]  # (h, j, i)
    rotations: FloatArray = columns.swapaxes(1, 2)
    return rotations


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
    """Align two point clouds by functions that should correspond: least squares (F_tᵀ W_t) C ≈ F_sᵀ W_s.

    Parameters
    ----------
    source, target : SignedPoints
        Clouds of all n_s and n_t vertices.
    source_functions, target_functions : (n_s, q), (n_t, q) arrays of float
        Values of q corresponding functions, such as signatures or indicators of segments.
    source_weights, target_weights : (n_s,), (n_t,) arrays of float
        Vertex areas.
    n_columns, off_diagonal, ridge
        As for `alignments_from_points`.

    Returns
    -------
    (k, k) array of float
        C, with target[:, :k] · C ≈ source[:, :k].

    Notes
    -----
    Shamai & Kimmel 2017, initialisation from descriptors. Columns of X = Q W are orthogonal in the areas, so that XᵀA f
    holds W times the coefficients of f, and the problem is that of points. O(n k q + k⁴).

    Examples
    --------
    Functions that correspond, the indicators of the vertices, tell that the second column of the target has another sign.

    >>> cloud = SignedPoints(np.array([[1.0, 2.0], [-1.0, 1.0], [3.0, 0.0]]), np.ones(2))
    >>> mirrored = SignedPoints(cloud.coordinates * [1.0, -1.0], cloud.signs)
    >>> areas = np.full(3, 1 / 3)
    >>> alignment_from_functions(cloud, mirrored, np.eye(3), np.eye(3), areas, areas).round(1) + 0.0
    array([[ 1.,  0.],
           [ 0., -1.]])
    """
    as_source = SignedPoints(
        (source.coordinates.T @ (source_weights[:, None] * source_functions)).T, source.signs
    )
    as_target = SignedPoints(
        (target.coordinates.T @ (target_weights[:, None] * target_functions)).T, target.signs
    )
    rows = np.arange(source_functions.shape[1])[None]
    rotation: FloatArray = alignments_from_points(
        as_source, as_target, rows, rows, n_columns, off_diagonal, ridge
    )[0]
    return rotation


def nearest_under_rotation(source: SignedPoints, target: SignedPoints, rotation: FloatArray) -> IntArray:
    """Find the nearest target row of each source row, once the target is rotated.

    Parameters
    ----------
    source, target : SignedPoints
        m_s and m_t points.
    rotation : (k_t, k_s) array of float
        C. As many leading columns of either cloud are used as it has.

    Returns
    -------
    (m_s,) array of int
        Row of target · C nearest to each row of the source, see `nearest_rows`. O(m_s m_t k_s).

    Examples
    --------
    >>> source = SignedPoints(np.array([[1.0], [5.0]]), np.ones(1))
    >>> target = SignedPoints(np.array([[-5.5], [-0.5]]), np.ones(1))
    >>> nearest_under_rotation(source, target, np.array([[-1.0]]))
    array([1, 0])
    """
    k_target, k_source = rotation.shape
    return nearest_rows(target.coordinates[:, :k_target] @ rotation, source.coordinates[:, :k_source])
