"""The choice of a template before anything is matched: the medoid of a cheap distance between prepared shapes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from isomatch.shapes import PreparedShape
from isomatch.values.arrays import FloatArray

N_EIGENVALUES = 30  # after the first: the coarse form
N_QUANTILES = 20
N_OTHERS = 1000


def features_of(shape: PreparedShape) -> list[float]:
    """Describe a shape by its spectrum and the distribution of its distances, whatever its size and pose.

    Eigenvalues are divided by what Weyl's law expects, 4π i / area, distances by √area.
    """
    n = N_EIGENVALUES + 1
    values = np.full(n, np.nan)
    scaled = shape.laplace.values[:n] * shape.laplace.weights.sum()
    values[: len(scaled)] = scaled
    spectrum = values[1:] / (4 * np.pi * np.arange(1, n))
    vertices = shape.sample_vertices[: shape.config.n_search]
    apart = shape.distances_between(vertices)
    levels = (np.arange(N_QUANTILES) + 0.5) / N_QUANTILES
    quantiles = np.quantile(apart[np.triu_indices(len(vertices), 1)], levels)
    return [float(x) for x in np.concatenate([spectrum, quantiles])]


def medoid(features: FloatArray) -> int:
    """Row (m, q) of the shape with the least mean distance to all others, or to every so many-th of very many.

    Each feature is divided by its standard deviation over the collection.
    """
    rows = np.nan_to_num(features)
    spread = rows.std(axis=0)
    rows = rows / np.where(spread > 0, spread, 1.0)
    others = rows[:: len(rows) // N_OTHERS + 1]
    blocks = (rows[i : i + N_OTHERS] for i in range(0, len(rows), N_OTHERS))
    return int(np.concatenate([cdist(block, others).mean(axis=1) for block in blocks]).argmin())
