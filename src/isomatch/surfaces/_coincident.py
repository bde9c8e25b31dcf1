"""Points at exactly the same position."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import AnyArray, IntArray


def first_equal(points: AnyArray) -> IntArray:
    """Find, for each point, the first point at exactly the same position.

    Parameters
    ----------
    points : (n, d) array
        Positions, or rows of any other kind. A row that contains NaN is equal to no other.

    Returns
    -------
    (n,) array of int
        Index of the first equal point; the point's own index if no earlier one is equal.

    Notes
    -----
    O(n log n) time. Equality is exact, because equality up to a tolerance is not transitive, and could merge points
    that are meant to be different.

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
