"""Functions on a welded mesh, at the vertices as they are in the file: those at one position share its weight."""

from __future__ import annotations

import numpy as np

from isomatch.values.arrays import FloatArray, IntArray


def shared_weights(weights: FloatArray, point: IntArray) -> FloatArray:
    """Share the weight of each point of a welded mesh among its vertices, so that sums and norms stay the same.

    Parameters
    ----------
    weights : (n_points,) array of float
    point : (n,) array of int
        The point of each vertex.

    Returns
    -------
    (n,) array of float

    Examples
    --------
    >>> shared_weights(np.array([1.0, 4.0]), np.array([0, 1, 1]))
    array([1., 2., 2.])
    """
    shares: FloatArray = (weights / np.bincount(point, minlength=len(weights)))[point]
    return shares
