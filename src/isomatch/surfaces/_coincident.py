"""Which points are at exactly the same place."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import AnyArray, IntArray


def first_equal(points: AnyArray) -> IntArray:
    """For each point, the first point at exactly the same position.

    Parameters
    ----------
    points : (n, d) array
        Positions, or any rows. A point with a NaN equals no other point.

    Returns
    -------
    (n,) array of int
        Index of the first equal point, at most the point's own index.

    Notes
    -----
    O(n log n) time. Equality is exact, so that it is transitive and never merges what a user kept apart.

    Examples
    --------
    >>> first_equal(np.array([[0, 0, 1.0], [0, 0, 2], [0, -0.0, 1]])).tolist()
    [0, 1, 0]
    """
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    order = np.lexsort(points.T)  # stable: equal points stay in order of their index
    ordered = points[order]
    starts_group = np.ones(len(points), dtype=bool)
    starts_group[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    first = np.zeros(len(points), dtype=np.int64)
    first[order] = order[starts_group][np.cumsum(starts_group) - 1]
    return first
