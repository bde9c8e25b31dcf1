"""Regions grown from seeds: points are assigned outward from one pair, to what agrees with those before or to nothing."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence.interval_matching import IntervalCost
from isomatch.loading.compiled import compiled
from isomatch.runtime.threads import parallel_rows
from isomatch.values.arrays import FloatArray, IntArray


def grow_regions(
    distances: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    unary: FloatArray,
    seeds: IntArray,
    cost: IntervalCost,
    near: float,
    dearest: float,
) -> tuple[IntArray, FloatArray]:
    """Assign points to candidates, from one pair outward; a point that agrees with nothing gets none.

    The points join in order of their distance from that of the seed. A candidate gains 1 − c / ``dearest`` − its unary
    cost, with c the mean of the costs of its distances from the candidates assigned before, the nearer points weighing
    more. The one that gains most is taken, if any gains.

    Parameters
    ----------
    distances : (c, c) array of float
        Distances between candidates.
    lower, upper : (m, m) array of float
        Intervals of the distances between the points.
    unary : (m, c) array of float
        Cost of each assignment by itself, negative where it is likely.
    seeds : (s, 2) array of int
        Pairs of a point and its candidate.
    cost : IntervalCost
    near : float
        A distance u weighs 1 / (near + u).
    dearest : float
        Mean cost at which nothing is gained.

    Returns
    -------
    (s, m) array of int, (s,) array of float
        Candidate of each point, −1 for none, and what each region gains.

    Notes
    -----
    O(s m² c), on all threads. Growing regions with "no partner" as a choice follows Bracha, Dagès & Kimmel 2024 only in
    the intervals; the order and the gain are ours.

    Examples
    --------
    Candidates on a line at 0, 1, 3, 7. Of three points whose distances are 4, 2 and 50, the last is far from everything.

    >>> places = np.array([0.0, 1.0, 3.0, 7.0])
    >>> distances = np.abs(places[:, None] - places)
    >>> known = np.array([[0.0, 4.0, 50.0], [4.0, 0.0, 50.0], [50.0, 50.0, 0.0]])
    >>> seeds = np.array([[0, 2]])
    >>> grow_regions(distances, known, known, np.zeros((3, 4)), seeds, IntervalCost(), near=1.0, dearest=0.005)[0]
    array([[ 2,  3, -1]])
    """
    s, m = len(seeds), len(lower)
    assigned, gains = np.full((s, m), -1, dtype=np.int64), np.zeros(s)
    distances, lower, upper, unary = map(np.ascontiguousarray, (distances, lower, upper, unary))
    order = np.argsort(upper, axis=1, kind="stable")

    def region(row: int) -> None:
        root, image = seeds[row]
        numbers = *cost.numbers, near, dearest
        gains[row] = _grow(distances, lower, upper, unary, order, root, image, *numbers, assigned[row])

    parallel_rows(region, s)
    return assigned, gains


@compiled()
def _grow(
    distances: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    unary: FloatArray,
    order: IntArray,
    root: int,
    image: int,
    tolerance: float,
    inside: float,
    most: float,
    soft: float,
    near: float,
    dearest: float,
    assigned: IntArray,
) -> float:
    """Fill in the candidates (m,) of the points, all −1 on entry, and return the gain."""
    m, c = unary.shape
    assigned[root] = image
    gain = 1.0 - unary[root, image]
    total = np.zeros(c)
    for point in order[root]:
        if point == root:
            continue
        total[:] = 0.0
        weights = 0.0
        for a in range(m):
            row = assigned[a]
            if row < 0:
                continue
            u = upper[point, a]
            low, high = lower[point, a] * (1 - tolerance), u * (1 + tolerance)
            weight = 1.0 / (near + u)
            weights += weight
            weight /= soft + u
            for k in range(c):
                d = distances[row, k]
                total[k] += weight * min(max(low - d, d - high, 0.0) + inside * abs(d - u), most)
        best, most_gained = -1, 0.0
        for k in range(c):
            gained = 1.0 - total[k] / weights / dearest - unary[point, k]
            if gained > most_gained:
                best, most_gained = k, gained
        assigned[point] = best
        gain += most_gained
    return float(gain)
