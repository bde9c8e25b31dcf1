"""Functions on a surface scaled to mean 0 and variance 1, so that those of two surfaces can be compared."""

from __future__ import annotations

import numpy as np

from isomatch.values.arrays import FloatArray


def standardised(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Shift and scale functions to weighted mean 0 and variance 1.

    Parameters
    ----------
    values : (n, q) array of float
        q functions on n vertices.
    weights : (n,) array of float
        Weights of the vertices, such as their areas; not negative, with a positive sum.

    Returns
    -------
    (n, q) array of float
        Without unit. A function that is constant up to rounding, 1e-12 of the largest value of all, becomes 0.

    Notes
    -----
    (f − f̄) / σ with f̄ = Σ w f / Σ w and σ² = Σ w (f − f̄)² / Σ w. O(n q).

    Examples
    --------
    >>> standardised(np.array([[1.0, 5.0], [3.0, 5.0]]), np.ones(2))
    array([[-1.,  0.],
           [ 1.,  0.]])
    """
    centred = values - np.average(values, axis=0, weights=weights)
    deviation = np.sqrt(np.average(centred**2, axis=0, weights=weights))
    scale = np.where(deviation > 1e-12 * np.abs(values).max(initial=0.0), deviation, np.inf)
    return np.asarray(centred / scale, dtype=np.float64)
