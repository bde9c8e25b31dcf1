"""Centroid sizes of shapes in one topology."""

from __future__ import annotations

import numpy as np

from isomatch.statistics.procrustes import shares_of
from isomatch.values.arrays import FloatArray


def centroid_sizes(vertices: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Compute the centroid sizes of shapes: roots of the sums of squared distances of vertices from their centroid.

    Parameters
    ----------
    vertices : (m, n, 3) array of float
        Positions of the vertices of m shapes.
    weights : (n,) array of float, optional
        Weight of each vertex, such as `CorrespondedShapes.area_weights`, so that the size does not depend on where
        vertices are dense: a vertex counts n times its share of the sum. By default all count once.

    Returns
    -------
    (m,) array of float
        In the units of the shapes. It grows with √n, and compares shapes of one topology only.

    Examples
    --------
    >>> square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0.0]])
    >>> centroid_sizes(np.array([square, 3 * square])).round(3)
    array([2.828, 8.485])
    """
    n, share = vertices.shape[1], shares_of(vertices, weights)
    centred = vertices - np.einsum("i,sij->sj", share, vertices)[:, None]
    return np.asarray(np.sqrt(n * np.einsum("i,sij,sij->s", share, centred, centred)))
