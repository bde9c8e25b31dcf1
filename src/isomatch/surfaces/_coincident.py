"""Points at exactly the same position."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import AnyArray, IntArray


def first_equal(points: AnyArray) -> IntArray:
    """Find the first point at exactly the same position, (n,), for each of the points (n, d).

    A point with a NaN equals no other. Equality is exact, because equality up to a tolerance is not
    transitive, and could merge points that are meant to be different. O(n log n) time, most of it to
    sort hashes.
    """
    first = np.arange(len(points))
    hashes = _hashes(points)
    order = np.argsort(hashes)
    hashes = hashes[order]
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = hashes[1:] != hashes[:-1]
    if is_new.all():
        return first
    group = np.cumsum(is_new) - 1
    first[order] = np.minimum.reduceat(order, np.flatnonzero(is_new))[group]
    differs = (points != points[first]).any(axis=1)
    if differs.any():  # different rows have one hash, or a row has nan, which equals nothing
        rows = np.sort(order[np.isin(group, group[differs[order]])])
        first[rows] = rows[_first_equal_by_order(points[rows])]
    return first


def weld_points(points: AnyArray) -> tuple[IntArray, IntArray]:
    """Weld the points (n, d) at exactly the same position into one vertex.

    Returns the first point of each vertex, (n_vertices,), increasing, and the vertex of each point, (n,).
    """
    first = first_equal(points)
    is_first = first == np.arange(len(points))
    return np.flatnonzero(is_first), (np.cumsum(is_first) - 1)[first]


def _first_equal_by_order(points: AnyArray) -> IntArray:
    order = np.lexsort(points.T)  # lexsort is stable, so equal points stay in the order of their index
    ordered = points[order]
    starts_group = np.ones(len(points), dtype=bool)
    starts_group[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    first = np.zeros(len(points), dtype=np.int64)
    first[order] = order[starts_group][np.cumsum(starts_group) - 1]
    return first


def _hashes(points: AnyArray) -> AnyArray:
    """Hash each row to a 64-bit number, the same for equal rows."""
    hashes = np.zeros(len(points), dtype=np.uint64)
    for column in points.T:
        hashes ^= (column + np.zeros(1, column.dtype)).view(np.uint64)  # adding 0 turns -0.0 into 0.0
        hashes *= np.uint64(0x9E3779B97F4A7C15)
        hashes ^= hashes >> np.uint64(32)
    return hashes
