"""The rotation nearest to a matrix."""

from __future__ import annotations

import numpy as np

from isomatch.runtime.threads import parallel_map
from isomatch.values.arrays import FloatArray

AT_ONCE = 10_000  # matrices of a thread


def nearest_rotation(matrices: FloatArray, mirrored: bool = False) -> FloatArray:
    """Find the rotation nearest to each matrix, or the nearest mirror image.

    Parameters
    ----------
    matrices : (..., d, d) array of float
        For the rotation that carries points (m, d) to others row by row, ``points.T @ others``.
    mirrored : bool
        Whether to find orthogonal matrices of determinant −1 in place of rotations.

    Returns
    -------
    (..., d, d) array of float
        R, which minimises ‖R − M‖ and maximises tr(Rᵀ M): ``points @ R`` is nearest to the others.

    Notes
    -----
    Kabsch, *A solution for the best rotation to relate two sets of vectors*, Acta Crystallographica A 32, 1976. O(d³) for
    each.

    Examples
    --------
    >>> nearest_rotation(np.array([[0.0, 2.0], [-3.0, 0.1]])).round(2)
    array([[ 0.02,  1.  ],
           [-1.  ,  0.02]])
    """
    if matrices.ndim == 3 and len(matrices) > AT_ONCE:
        blocks = np.array_split(matrices, -(-len(matrices) // AT_ONCE))
        return np.concatenate(parallel_map(lambda block: nearest_rotation(block, mirrored), blocks))
    u, _, vt = np.linalg.svd(matrices)
    side = -1.0 if mirrored else 1.0
    u[..., -1] *= (side * np.linalg.det(u @ vt))[..., None]
    rotations: FloatArray = u @ vt
    return rotations
