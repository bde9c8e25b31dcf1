"""Fans of triangles of polygons that are stored one after another."""

from __future__ import annotations

import numpy as np

from isomatch.values.arrays import IntArray


def triangulate(corners: IntArray, counts: IntArray) -> IntArray:
    """Split each polygon into a fan around its first corner.

    Parameters
    ----------
    corners : (sum of counts,) array of int
        Vertex indices of all polygons, concatenated.
    counts : (p,) array of int
        Number of corners of each polygon, at least 3.

    Returns
    -------
    (sum of counts - 2, 3) array of int
        Triangles, in the order of the polygons.

    Examples
    --------
    >>> triangulate(np.array([0, 1, 2, 3, 7, 8, 9]), np.array([4, 3])).tolist()
    [[0, 1, 2], [0, 2, 3], [7, 8, 9]]
    """
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    starts = np.cumsum(counts) - counts
    second = spans(starts + 1, counts - 2)
    triangles = np.zeros((len(second), 3), dtype=corners.dtype)
    triangles[:, 0] = np.repeat(corners[starts], counts - 2)
    triangles[:, 1] = corners[second]
    second += 1
    triangles[:, 2] = corners[second]
    return triangles


def spans(starts: IntArray, counts: IntArray) -> IntArray:
    """Concatenate the ranges ``start, start + 1, …`` of the given lengths.

    Examples
    --------
    >>> spans(np.array([10, 20]), np.array([2, 3])).tolist()
    [10, 11, 20, 21, 22]
    """
    before = np.cumsum(counts) - counts
    ranges: IntArray = np.repeat(starts - before, counts) + np.arange(counts.sum(), dtype=np.int64)
    return ranges
