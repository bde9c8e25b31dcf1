"""A rule for the signs of basis vectors, which eigensolvers leave undetermined."""

from __future__ import annotations

import numpy as np

from isomatch.values.arrays import FloatArray


def fix_signs(vectors: FloatArray, weights: FloatArray) -> FloatArray:
    """Change signs of columns so that their third moments are positive.

    Parameters
    ----------
    vectors : (n, k) array of float
        Functions on n points.
    weights : (n,) array of float
        Weights of the points.

    Returns
    -------
    (n, k) array of float
        Each column or its negative.

    Notes
    -----
    The rule does not depend on the order of the points. The third moment of a function that is odd under a symmetry of
    the surface is 0 up to rounding; its sign stays arbitrary, and no result may depend on it. O(n k).
    """
    moments = weights.astype(vectors.dtype) @ (vectors * vectors * vectors)  # a power takes ten times as long
    return np.ascontiguousarray(vectors * np.where(moments < 0, -1.0, 1.0).astype(vectors.dtype))
