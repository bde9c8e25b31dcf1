"""Orthogonal alignment of signed point clouds: Procrustes, iterative closest points, and first alignments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence.nearest import nearest_of_few, nearest_rows
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
