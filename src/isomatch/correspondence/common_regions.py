"""Regions that two surfaces have in common: points assigned where intervals of distances on both sides agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence.interval_matching import IntervalCost
from isomatch.loading.compiled import compiled
from isomatch.runtime.threads import parallel_rows
from isomatch.values.arrays import Float32Array, FloatArray, IntArray, single

NOTHING = np.float32(-1e9)  # gain of a place in a beam that is still free


@dataclass(frozen=True, eq=False)
class Intervals:
    """Bounds of distances of which neither side shows everything, as of a surface with a boundary.

    Parameters
    ----------
    lower, upper : (m, n) array of float
        Least and greatest distances between m points and n points.

    Examples
    --------
    >>> apart = np.array([[0.0, 2.0], [2.0, 0.0]])
    >>> Intervals(0.5 * apart, apart).at(np.array([0]), np.array([1])).lower
    array([[1.]])
    """

    lower: FloatArray
    upper: FloatArray

    def at(self, rows: IntArray, columns: IntArray) -> Intervals:
        """Restrict to some of both."""
        return Intervals(self.lower[np.ix_(rows, columns)], self.upper[np.ix_(rows, columns)])

    @property
    def arrays(self) -> tuple[Float32Array, Float32Array]:
        """Both bounds for compiled loops."""
        return single(np.ascontiguousarray(self.lower)), single(np.ascontiguousarray(self.upper))


def grow_common_regions(
    points: Intervals,
    candidates: Intervals,
    unary: FloatArray,
    seeds: IntArray,
    cost: IntervalCost,
    near: float,
    dearest: float,
    width: int,
    apart: float,
) -> tuple[IntArray, FloatArray]:
    """Assign points to candidates, from one pair outward, or to nothing; distances are intervals on both sides.

    As `grow_regions`, but two points may not be matched only if their intervals are disjoint, and of each region several
    variants are kept while it grows.

    Parameters
    ----------
    points, candidates : Intervals
        Between m points, (m, m), and between c candidates, (c, c).
    unary : (m, c) array of float
        Cost of each assignment by itself, negative where it is likely.
    seeds : (s, 2) array of int
        Pairs of a point and its candidate.
    cost : IntervalCost
        A distance lies between the bounds of the point, its nearest value between those of the candidates.
    near : float
        A distance u weighs 1 / (near + u).
    dearest : float
        Mean cost of distances at which nothing is gained, and from which nothing is assigned.
    width : int
        Variants that are kept.
    apart : float
        Least distance between candidates of one point for them to be variants.

    Returns
    -------
    (s, m) array of int, (s,) array of float
        Candidate of each point, −1 for none, in the best variant, and what it gains.

    Notes
    -----
    O(s width m² c), on all threads.

    Examples
    --------
    Candidates on a line at 0, 1, 3, 7. Of three points whose distances are 4, 2 and 50, the last is far from everything.

    >>> places = np.array([0.0, 1.0, 3.0, 7.0])
    >>> distances = np.abs(places[:, None] - places)
    >>> known = np.array([[0.0, 4.0, 50.0], [4.0, 0.0, 50.0], [50.0, 50.0, 0.0]])
    >>> points, candidates = Intervals(known, known), Intervals(distances, distances)
    >>> costs = np.zeros((3, 4)), np.array([[0, 2]]), IntervalCost()
    >>> grow_common_regions(points, candidates, *costs, near=1.0, dearest=0.005, width=2, apart=0.1)[0]
    array([[ 2,  3, -1]])
    """
    s, m = len(seeds), len(unary)
    assigned, gains = np.full((s, m), -1, dtype=np.int64), np.zeros(s)
    order = np.argsort(points.upper, axis=1, kind="stable")
    here, there, alone = points.arrays, candidates.arrays, single(np.ascontiguousarray(unary))
    numbers = tuple(np.float32(number) for number in (*cost.numbers, near, dearest, apart))

    def region(row: int) -> None:
        root, image = seeds[row]
        gains[row] = _grow(*here, *there, alone, order[root], root, image, numbers, width, assigned[row])

    parallel_rows(region, s)
    return assigned, gains


@compiled(fastmath={"nnan", "nsz", "reassoc", "contract", "arcp"})
def _grow(
    lower: Float32Array,
    upper: Float32Array,
    least: Float32Array,
    greatest: Float32Array,
    unary: Float32Array,
    order: IntArray,
    root: int,
    image: int,
    numbers: tuple[np.float32, ...],
    width: int,
    assigned: IntArray,
) -> float:
    """Fill in the candidates (m,) of the points, and return the gain."""
    tolerance, inside, most, soft, near, dearest, apart = numbers
    m, c = unary.shape
    one, zero = np.float32(1), np.float32(0)
    states, gains = np.full((width, m), -1), np.full(width, NOTHING)
    grown, grown_gains = np.full((width, m), -1), np.full(width, NOTHING)
    parents, images = np.zeros(width, np.int64), np.zeros(width, np.int64)
    states[0, root], gains[0] = image, one - unary[root, image]
    total = np.zeros(c, np.float32)
    for point in order:
        if point == root:
            continue
        grown_gains[:] = NOTHING
        for state in range(width):
            if gains[state] > NOTHING:
                _enter(grown_gains, parents, images, width - 1, gains[state], state, -1)
        for state in range(width):
            if gains[state] <= NOTHING:
                continue
            total[:] = zero
            weights = zero
            for a in range(m):
                row = states[state, a]
                if row < 0:
                    continue
                u = upper[point, a]
                low, high = lower[point, a] * (one - tolerance), u * (one + tolerance)
                weight = one / (near + u)
                weights += weight
                weight /= soft + u
                for k in range(c):
                    v = max(low - greatest[row, k], least[row, k] - high, zero)
                    total[k] += weight * min(v + inside * abs(greatest[row, k] - u), most)
            for k in range(c):
                mean = total[k] / weights
                if mean > dearest:
                    continue
                gain = gains[state] + one - mean / dearest - unary[point, k]
                at = width - 1
                for i in range(width):
                    known = grown_gains[i] > NOTHING and parents[i] == state and images[i] >= 0
                    if known and greatest[images[i], k] < apart:
                        at = i
                        break
                if gain > grown_gains[at]:
                    _enter(grown_gains, parents, images, at, gain, state, k)
        for i in range(width):
            if grown_gains[i] > NOTHING:
                grown[i] = states[parents[i]]
                grown[i, point] = images[i]
        states[:], gains[:] = grown, grown_gains
    assigned[:] = states[0]
    return float(gains[0])


@compiled()
def _enter(
    gains: Float32Array,
    parents: IntArray,
    images: IntArray,
    at: int,
    gain: np.float32,
    parent: int,
    image: int,
) -> None:
    """Put one more variant in the place of another, and move it up to where it belongs."""
    if gain <= gains[at]:
        return
    while at > 0 and gains[at - 1] < gain:
        gains[at], parents[at], images[at] = gains[at - 1], parents[at - 1], images[at - 1]
        at -= 1
    gains[at], parents[at], images[at] = gain, parent, image


def trilaterate_common(
    points: Intervals, candidates: Intervals, near: float, cost: IntervalCost
) -> tuple[IntArray, FloatArray]:
    """Place each point where its intervals to all anchors agree best with those of the candidates to their images.

    Parameters
    ----------
    points : Intervals
        From m anchors to q points.
    candidates : Intervals
        From the images of the anchors to c candidates.
    near : float
        A distance u weighs 1 / (near + u)².
    cost : IntervalCost

    Returns
    -------
    (q,) array of int, (q,) array of float
        A candidate for each point, and its mean cost.

    Notes
    -----
    O(q m c), in single precision.

    Examples
    --------
    Anchors at both ends of a line of five candidates, and a point of which both distances are known.

    >>> ends = np.array([[0.0, 1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0, 0.0]])
    >>> point = np.array([[1.0], [3.0]])
    >>> trilaterate_common(Intervals(point, point), Intervals(ends, ends), 1.0, IntervalCost())
    (array([1]), array([0.]))
    """
    q = points.upper.shape[1]
    placed, costs = np.zeros(q, dtype=np.int64), np.zeros(q)
    numbers = tuple(np.float32(number) for number in (*cost.numbers, near))
    _trilaterate(*points.arrays, *candidates.arrays, numbers, placed, costs)
    return placed, costs


@compiled(fastmath={"nnan", "nsz", "reassoc", "contract", "arcp"})
def _trilaterate(
    lower: Float32Array,
    upper: Float32Array,
    least: Float32Array,
    greatest: Float32Array,
    numbers: tuple[np.float32, ...],
    placed: IntArray,
    costs: FloatArray,
) -> None:
    tolerance, inside, most, soft, near = numbers
    m, q = upper.shape
    c = greatest.shape[1]
    zero, one = np.float32(0), np.float32(1)
    total = np.zeros(c, np.float32)
    for i in range(q):
        total[:] = zero
        weights = zero
        for a in range(m):
            u = upper[a, i]
            low, high = lower[a, i] * (one - tolerance), u * (one + tolerance)
            weight = one / ((near + u) * (near + u))
            weights += weight
            weight /= soft + u
            for k in range(c):
                v = max(low - greatest[a, k], least[a, k] - high, zero)
                total[k] += weight * min(v + inside * abs(greatest[a, k] - u), most)
        best = 0
        for k in range(c):
            if total[k] < total[best]:
                best = k
        placed[i], costs[i] = best, total[best] / weights
