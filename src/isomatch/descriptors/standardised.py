"""Functions on a surface made comparable with those of another: mean 0 and variance 1."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray


def standardised(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Give each column of (n, q) values mean 0 and variance 1 in the weights; constant columns become 0."""
    centred = values - np.average(values, axis=0, weights=weights)
    deviation = np.sqrt(np.average(centred**2, axis=0, weights=weights))
    scale = np.where(deviation > 1e-12 * np.abs(values).max(initial=0.0), deviation, np.inf)
    return np.asarray(centred / scale, dtype=np.float64)
