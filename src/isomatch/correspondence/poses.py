"""Rotations nearest to matrices, similarities between surfaces, points carried along with a map."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.threads import parallel_map

MATRICES_PER_TASK = 10_000  # number of matrices that one thread decomposes at once; chosen
# number of nearest poses that are refined; chosen: a solid lies on its axes in four ways
MAX_REFINED_POSES = 4
MAX_REFINEMENT_STEPS = 30  # largest number of steps of closest points that refine a pose; chosen
# Exponent of 1 / distance in the weight of a surface point in `carry_along`; chosen above 2, because only
# then the weights over a plane have a finite sum.
FALLOFF_EXPONENT = 4.0
# `carry_along` raises distances to this share of the largest one, so that weights are finite; chosen
MIN_DISTANCE_RATIO = 1e-6
# A pose has converged once a step leaves the mean distance above this share of the least one so far; chosen.
MIN_PROGRESS_RATIO = 0.999


def nearest_rotation(matrices: FloatArray, mirrored: bool = False) -> FloatArray:
    """Find the rotation (..., d, d) nearest to each matrix, or the nearest mirror image, of determinant −1.

    For the rotation R nearest to ``points.T @ others``, the sum of the squared distances between the
    rows of ``points @ R`` and of ``others``, (n, d) both, is least. O(d³) for each.

    Examples
    --------
    >>> nearest_rotation(np.array([[0.0, 2.0], [-3.0, 0.1]])).round(2)
    array([[ 0.02,  1.  ],
           [-1.  ,  0.02]])
    """
    # Kabsch, *A solution for the best rotation to relate two sets of vectors*, Acta Crystallographica A 32,
    # 1976. With the singular value decomposition M = U Σ Vᵀ of a matrix, ‖R − M‖² is least where tr(Rᵀ M) =
    # tr((Uᵀ R V)ᵀ Σ) is greatest: at R = U Vᵀ among orthogonal matrices R, and at R = U diag(1, …, 1, ±1) Vᵀ if
    # the determinant is given; the sign −1 lowers the trace by twice the least singular value. For M = Xᵀ Y,
    # tr(Rᵀ M) is the sum of the products of the entries of X R and Y, so that R also minimises ‖X R − Y‖.
    if matrices.ndim == 3 and len(matrices) > MATRICES_PER_TASK:
        blocks = np.array_split(matrices, -(-len(matrices) // MATRICES_PER_TASK))
        return np.concatenate(parallel_map(lambda block: nearest_rotation(block, mirrored), blocks))
    u, _, vt = np.linalg.svd(matrices)
    side = -1.0 if mirrored else 1.0
    u[..., -1] *= (side * np.linalg.det(u @ vt))[..., None]
    return np.asarray(u @ vt)


def carry_along(
    points: FloatArray, before: FloatArray, after: FloatArray, *, scale: float = 1.0, mirrored: bool = False
) -> FloatArray:
    """Carry points of space (n, 3) along with a map, each by the rigid motion of the nearest surface points.

    ``before`` and ``after`` are points of the surface and their images, (m, 3) with m ≥ 4. Lengths
    change by the factor ``scale``, and a ``mirrored`` map mirrors. Returns the image of each point p,
    (n, 3), which is ȳ + s R (p − x̄), by moving least squares (Schaefer, McPhail, Warren 2006): x̄ and ȳ
    are means of ``before`` and ``after`` with the weights 1 / (distance from p)⁴, s is the scale, and R
    turns the offsets of ``before`` from x̄ as near as possible to those of ``after`` from ȳ. O(n m).

    Examples
    --------
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> carry_along(np.array([[2, 0, 0.0]]), corners, corners @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]).round(9) + 0
    array([[0., 2., 0.]])
    """
    # Surface points x_j move to y_j. For a point of space, with the weights w_j of sum 1, R minimises
    # Σ_j w_j |R (x_j − x̄) − (y_j − ȳ)|². The transpose of R, which multiplies rows from the
    # right, is the rotation nearest to (Σ_j w_j x_j y_jᵀ) − x̄ ȳᵀ.
    distances = cdist(points, before)
    weights = np.maximum(distances, MIN_DISTANCE_RATIO * distances.max()) ** -FALLOFF_EXPONENT
    weights /= weights.sum(axis=1, keepdims=True)
    centre, image_centre = weights @ before, weights @ after
    products = (before[:, :, None] * after[:, None, :]).reshape(-1, 9)
    covariance = (weights @ products).reshape(-1, 3, 3) - centre[:, :, None] * image_centre[:, None, :]
    offsets = ((points - centre)[:, None] @ nearest_rotation(covariance, mirrored))[:, 0]
    return np.asarray(image_centre + scale * offsets)


@dataclass(frozen=True, eq=False)
class Pose:
    """A similarity x ↦ scale · x @ rotation + shift, and the distance to the other surface, normals included.

    Examples
    --------
    >>> Pose(np.eye(3), 2.0, np.zeros(3), np.arange(5), distance=0.1).scale
    2.0
    """

    rotation: FloatArray
    scale: float
    shift: FloatArray
    nearest: IntArray
    distance: float  # mean distance of the points of either surface from the nearest point of the other


def poses_between(source: FloatArray, target: FloatArray, mirrored: bool = False) -> list[Pose]:
    """Find at most four similarities that bring one surface near another, nearest first.

    Both are evenly spread points and their normals times a unit, (n, 6), as from `with_normals`;
    distances are in this space. ``mirrored`` asks for mirror images instead of rotations.

    Examples
    --------
    >>> points = np.random.default_rng(0).normal(size=(200, 3)) * [3.0, 2.0, 1.0]
    >>> normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    >>> pose = poses_between(np.hstack([points, normals]), np.hstack([2.0 * points + 5.0, normals]))[0]
    >>> bool(np.allclose(pose.rotation, np.eye(3))), round(pose.scale, 6), pose.shift.round(6).tolist()
    (True, 2.0, [5.0, 5.0, 5.0])
    """
    # The principal axes of the source are laid on the axes of the target in all 24 ways, because two axes of
    # nearly equal length might be exchanged. From the nearest poses, closest points and the best similarity
    # alternate (Besl & McKay, *A method for registration of 3-D shapes*, PAMI 1992). Surfaces of 400 points
    # take 0.05 s.
    tree = cKDTree(target)
    similarities = _align_axes(source[:, :3], target[:, :3], mirrored)
    starts = parallel_map(lambda similarity: tree.query(_move(source, *similarity)), similarities)
    starts.sort(key=lambda start: start[0].mean())
    starts = starts[:MAX_REFINED_POSES]
    poses = parallel_map(lambda start: _refine_pose(source, tree, start[1], mirrored), starts)
    return sorted(poses, key=lambda pose: pose.distance)


def _refine_pose(source: FloatArray, tree: cKDTree, nearest: IntArray, mirrored: bool) -> Pose:
    """Alternate the best similarity and closest points until they converge."""
    least = np.inf
    for _ in range(MAX_REFINEMENT_STEPS):
        similarity = _best_similarity(source, tree.data[nearest], mirrored)
        moved = _move(source, *similarity)
        distances, nearest = tree.query(moved)
        has_converged = distances.mean() > MIN_PROGRESS_RATIO * least
        if distances.mean() < least:
            least, best = distances.mean(), (similarity, moved, nearest)
        if has_converged:
            break
    similarity, moved, nearest = best
    back = cKDTree(moved).query(tree.data)[0]
    return Pose(*similarity, np.asarray(nearest, dtype=np.int64), float(least + back.mean()) / 2)


Similarity: TypeAlias = tuple[FloatArray, float, FloatArray]
"""Rotation, scale and shift."""


def _align_axes(source: FloatArray, target: FloatArray, mirrored: bool) -> list[Similarity]:
    """Lay the principal axes of the source's points on the axes of the target's, in all 24 ways."""
    (squares, axes), (target_squares, target_axes) = (np.linalg.eigh(np.cov(x.T)) for x in (source, target))
    size, target_size = (float(np.sqrt(variances.sum())) for variances in (squares, target_squares))
    centre, target_centre = source.mean(axis=0), target.mean(axis=0)
    scale, similarities = target_size / size, list[Similarity]()
    for order, signs in product(permutations(range(3)), product([1.0, -1.0], repeat=3)):
        turn = axes @ (np.eye(3)[list(order)] * signs) @ target_axes.T
        if (np.linalg.det(turn) < 0) == mirrored:
            similarities.append((turn, scale, target_centre - scale * centre @ turn))
    return similarities


def _best_similarity(source: FloatArray, target: FloatArray, mirrored: bool) -> Similarity:
    """Least-squares similarity from points and normals to others, row by row (Umeyama, PAMI 1991)."""
    # The minimum of Σ ‖s x_i R + t − y_i‖² has t = ȳ − s x̄ R, so that x and y can be centred. Then R is
    # Kabsch's rotation for XᵀY, for any s; products of normals are added to XᵀY. The derivative by s vanishes
    # at s = Σ (x_i R) · y_i / Σ ‖x_i‖².
    centre, target_centre = source[:, :3].mean(axis=0), target[:, :3].mean(axis=0)
    x, y = source[:, :3] - centre, target[:, :3] - target_centre
    turn = nearest_rotation(x.T @ y + source[:, 3:].T @ target[:, 3:], mirrored)
    scale = float(np.sum((x @ turn) * y) / np.sum(x**2))
    return turn, scale, target_centre - scale * centre @ turn


def _move(points: FloatArray, turn: FloatArray, scale: float, shift: FloatArray) -> FloatArray:
    """Move points and normals by a similarity."""
    return np.hstack([scale * points[:, :3] @ turn + shift, points[:, 3:] @ turn])
