"""A rule for the signs of basis vectors, which eigensolvers leave to chance."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray


def fix_signs(vectors: FloatArray, weights: FloatArray) -> FloatArray:
    """Turn each column so that its third moment is positive.

    The rule depends on the function, not on the order of its points. Columns (n, k) that are odd under a symmetry
    have no third moment; their sign stays arbitrary, and nothing may depend on it.
    """
    signs = np.where(weights @ vectors**3 < 0, -1.0, 1.0)
    return vectors * signs
