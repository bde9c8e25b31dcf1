"""Correspondences that fit distance intervals: beam search, region growing, trilateration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from isomatch._core.arrays import AnyArray, Float32Array, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.threads import parallel_rows

Terms: TypeAlias = tuple[Any, ...]  # numbers and arrays of a cost in compiled loops, see `IntervalCost.terms`
FORBIDDEN_COST = 50.0  # cost of the wrong candidates of a pinned point; chosen far above usual sums of costs
NO_GAIN = np.float32(-1e9)  # gain that marks an empty place among variants; chosen far below all true gains
# fast-math flags of numba for loops in which no number is nan and the last bits of results do not matter
FAST_MATH = {"nnan", "nsz", "reassoc", "contract", "arcp"}

# If a part of a surface is missing, the distance of two points on the whole surface lies in an interval [l,
# u]: u is their distance along the part, and l allows paths through the missing region (`MissingRegion`;
# Bracha, Dagès & Kimmel, *Wormhole Loss for Partial Shape Matching*, NeurIPS 2024). Under a map f of a
# near-isometric pair, the interval of two points should meet the interval of their images, which is a single
# number if the target is whole. Violations c of pairs of points a, b, with weights w, are summed as in a
# quadratic assignment problem, Σ_ab w_ab c_ab(f(a), f(b)) + Σ_a unary(a, f(a)). It is solved approximately by
# assigning one point after the other: `assign_points` keeps several assignments of all points, `grow_regions`
# leaves out each point for which no candidate agrees, `trilaterate` places each point by itself.


class Intervals(NamedTuple):
    """Least and greatest distances (m, n) between m and n points: the same array twice if they are known.

    Examples
    --------
    >>> distances = np.array([[0.0, 2.0], [2.0, 0.0]])
    >>> Intervals(0.5 * distances, distances).at(np.array([0]), np.array([1])).lower
    array([[1.]])
    """

    lower: AnyArray
    upper: AnyArray

    def map_bounds(self, function: Callable[[AnyArray], AnyArray]) -> Intervals:
        """Apply a function to both bounds, once if they are the same."""
        upper = function(self.upper)
        return Intervals(upper if self.lower is self.upper else function(self.lower), upper)

    def at(self, rows: IntArray, columns: IntArray) -> Intervals:
        """Restrict to some rows and columns."""
        return self.map_bounds(lambda bound: bound[np.ix_(rows, columns)])

    @property
    def single(self) -> Intervals:
        """Both bounds in single precision, for compiled loops."""
        return self.map_bounds(lambda bound: np.ascontiguousarray(bound, np.float32))


@dataclass(frozen=True)
class IntervalCost:
    """The cost of placing two points at distance d, if it should lie in the interval [l, u].

    ``c(d) = min(v + inside |d − u|, most) / (soft + u)``, where v is the violation of [(1 −
    tolerance) l, (1 + tolerance) u]: ``most`` makes the cost robust, ``inside`` prefers the upper
    bound.

    Examples
    --------
    Outside the interval [1, 2], the cost grows with the violation, up to ``most``.

    >>> cost = IntervalCost(tolerance=0.0, inside=0.0, most=3.0, soft=0.0)
    >>> cost(np.array([1.5, 3.0, 100.0]), lower=np.ones(3), upper=np.full(3, 2.0))
    array([0. , 0.5, 1.5])
    """

    tolerance: float = 0.05  # share of l and u by which d may leave [l, u] at no cost; chosen
    inside: float = 0.1  # weight of |d − u|, which is added to the violation of [l, u]; chosen
    most: float = 0.5  # largest sum of both, in the unit of distances: one wrong image costs little; chosen
    # in the unit of distances; added to u in the denominator, so that short distances do not dominate; chosen
    soft: float = 0.15

    def __call__(self, distances: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Costs of arrays of equal shape."""
        below, above = lower * (1 - self.tolerance) - distances, distances - upper * (1 + self.tolerance)
        violation = np.maximum(np.maximum(below, above), 0.0)
        costs = np.minimum(violation + self.inside * np.abs(distances - upper), self.most)
        return np.asarray(costs / (self.soft + upper))

    def terms(self, points: Intervals, weights: AnyArray) -> Terms:
        """Prepare distances (p, m) of p points from m for ``_costs``, in the precision of the intervals."""
        (lower, upper), number = points, points.upper.dtype.type
        tolerance, inside, most, soft = map(number, (self.tolerance, self.inside, self.most, self.soft))
        bounds = lower * (1 - tolerance), upper * (1 + tolerance), upper
        return *bounds, weights, weights / (soft + upper), inside, most


@compiled(inline="always")
def _costs(terms: Terms, point: int, assigned: IntArray, candidates: Intervals, total: AnyArray) -> Any:
    """Set the summed costs (c,) of the candidates of a point, and return the sum of the weights."""
    # Candidate k costs Σ_a w_a c(d(x_a, k)), over the points a that have a candidate x_a already
    # (``assigned``). If the distance of two candidates is an interval too, its violation of [l, u] is the gap
    # between the two intervals. The outer loop runs through the points, the inner one through the candidates,
    # so that memory is read in order.
    lower, higher, upper, weight, scaled, inside, most = terms
    least, greatest = candidates
    zero = total.dtype.type(0)
    total[:] = zero
    weights = zero
    for a in range(len(assigned)):
        row = assigned[a]
        if row < 0:
            continue
        low, high, u, w = lower[point, a], higher[point, a], upper[point, a], scaled[point, a]
        weights += weight[point, a]
        for k in range(len(total)):
            v = max(low - greatest[row, k], least[row, k] - high, zero)
            total[k] += w * min(v + inside * abs(greatest[row, k] - u), most)
    return weights


def assign_points(
    points: Intervals,
    candidates: Intervals,
    unary: FloatArray,
    cost: IntervalCost,
    width: int,
    min_distance: float,
) -> tuple[IntArray, FloatArray]:
    """Assign m points to c candidates by a beam search, keeping partial assignments that differ.

    It takes intervals between points, (m, m), and between candidates, (c, c), and the ``unary``
    costs (m, c) of single assignments. The candidates of the ``width`` assignments that it keeps
    differ by a mean distance of at least ``min_distance``; otherwise all would be variants of one.
    Returns candidates (h, m), h ≤ width, and their cost (h,), least cost first. O(width m (c m +
    width)).

    Examples
    --------
    Three points with known distances fit in one place among candidates at 0, 1, 3 and 7 on a line.

    >>> places = np.array([0.0, 1.0, 3.0, 7.0])
    >>> line, known = np.abs(places[:, None] - places), np.array([[0.0, 4.0, 2.0], [4.0, 0.0, 6.0], [2.0, 6.0, 0.0]])
    >>> sides = Intervals(known, known), Intervals(line, line)
    >>> assigned, cost = assign_points(*sides, np.zeros((3, 4)), IntervalCost(), width=20, min_distance=0.1)
    >>> assigned[0], float(cost[0])
    (array([2, 3, 1]), 0.0)
    """
    # The cost E of an assignment x of the first p points is a sum over pairs of points, so that one more
    # point gives
    #   E(x_0 … x_p) = E(x_0 … x_{p−1}) + unary(p, x_p) + Σ_{a<p} c(d(x_a, x_p)).
    # Each of the h assignments kept has c children, one for each candidate of that point. The cheapest of the
    # h c children that differ are kept. Two assignments x and y differ if Σ_a d(x_a, y_a) ≥ p min_distance;
    # this sum of two children is the sum of their parents plus one distance. The h assignments have
    # candidates (h, m), costs (h,), and sums (h, h).
    m, c = unary.shape
    terms = cost.terms(points.map_bounds(np.ascontiguousarray), np.ones_like(points.upper))
    candidates = candidates.map_bounds(np.ascontiguousarray)
    images, total = np.full((1, m), -1), np.zeros(1)
    sums, next_sums, room = np.zeros((width, width)), np.zeros((width, width)), np.zeros((width, c))
    for point in range(m):
        added = room[: len(images)]
        _costs_of(terms, np.full(len(images), point), images, candidates, added)
        added += total[:, None] + unary[point]
        costs = added.ravel()  # (h c,): the child of a parent with a candidate is at c · parent + candidate
        n_children = min(len(costs), 12 * width)  # chosen: most differ too little from cheaper ones
        best = np.sort(np.argpartition(costs, n_children - 1)[:n_children])
        best = best[np.argsort(costs[best], kind="stable")]  # cheapest first, then in the order of children
        parent, last = np.divmod(best, c)
        kept = _keep_differing(candidates.upper, (parent, last), min_distance * (point + 1), sums, next_sums)
        sums, next_sums = next_sums, sums
        images, total = images[parent[kept]], costs[best[kept]]
        images[:, point] = last[kept]
    return images, total


@compiled(fastmath=FAST_MATH)
def _costs_of(
    terms: Terms, points: IntArray, rows: IntArray, candidates: Intervals, totals: AnyArray
) -> None:
    """Set the summed costs (h, c) of candidates for h points, given the candidates (h, m) of all points."""
    for i in range(len(points)):
        _costs(terms, points[i], rows[i], candidates, totals[i])


def _keep_differing(
    distances: FloatArray,
    children: tuple[IntArray, IntArray],
    min_distance: float,
    sums: FloatArray,
    next_sums: FloatArray,
) -> IntArray:
    """Keep the first children, at most ``width``, that are at least ``min_distance`` from each other."""
    kept, latest = np.zeros(len(sums), dtype=np.int64), np.full(len(sums), -1)
    return kept[: _fill_kept(distances, *children, min_distance, sums, next_sums, kept, latest)]


@compiled()
def _fill_kept(
    distances: AnyArray,
    parents: IntArray,
    last: IntArray,
    min_distance: float,
    sums: AnyArray,
    next_sums: AnyArray,
    kept: IntArray,
    latest: IntArray,
) -> int:
    """Set the numbers of the children that are kept, and count them."""
    # Each child has a parent and one more candidate, the last. ``sums`` (width, width) holds the summed
    # distances between parents; the sums between the children kept are written to ``next_sums``. Most
    # children are too near to the child of the same parent that was kept last, so they are compared with it
    # first: ``latest[parent]`` is its place in ``kept``, −1 if there is none.
    n = 0
    for i in range(len(last)):
        parent, candidate = parents[i], last[i]
        sibling = latest[parent]
        if sibling >= 0 and sums[parent, parent] + distances[candidate, last[kept[sibling]]] < min_distance:
            continue
        for k in range(n - 1, -1, -1):
            next_sums[n, k] = sums[parent, parents[kept[k]]] + distances[candidate, last[kept[k]]]
            if next_sums[n, k] < min_distance:
                break
        else:
            kept[n], latest[parent] = i, n
            for k in range(n + 1):  # the sums in the other direction, as rounding makes distances asymmetric
                next_sums[k, n] = sums[parents[kept[k]], parent] + distances[last[kept[k]], candidate]
            n += 1
            if n == len(kept):
                break
    return n


def pin_first(unary: FloatArray, candidates: IntArray) -> None:
    """Force the first q points to given candidates (q,) by changing their costs (m, c) in place.

    Examples
    --------
    >>> unary = np.ones((2, 3))
    >>> pin_first(unary, np.array([2]))
    >>> unary.tolist()
    [[50.0, 50.0, 0.0], [1.0, 1.0, 1.0]]
    """
    first = np.arange(len(candidates))
    unary[first] = FORBIDDEN_COST
    unary[first, candidates] = 0.0


def grow_regions(
    points: Intervals,
    candidates: Intervals,
    unary: FloatArray,
    seeds: IntArray,
    cost: IntervalCost,
    near: float,
    dearest: float,
    refused: float = np.inf,
    width: int = 1,
    min_distance: float = 0.0,
) -> tuple[IntArray, FloatArray]:
    """Assign m points to c candidates, from one pair outward; a point that agrees with nothing gets none.

    In the intervals between points, (m, m), and between candidates, (c, c), a distance u has the
    weight 1 / (near + u). Unary costs (m, c) are negative for likely assignments; seeds (s, 2) are
    pairs of a point and its candidate. At the mean cost ``dearest`` nothing is gained, beyond
    ``refused`` nothing is assigned. Each region grows in ``width`` variants, in which candidates of
    a point are at least ``min_distance``. Returns the candidate of each point, (s, m), −1 without
    one, and the gain of each region, (s,). O(s width m² c), on all threads, in single precision.

    Examples
    --------
    Candidates lie on a line at 0, 1, 3, 7. The last of three points is far from everything.

    >>> places = np.array([0.0, 1.0, 3.0, 7.0])
    >>> line, known = np.abs(places[:, None] - places), np.array([[0.0, 4, 50], [4, 0, 50], [50, 50, 0]])
    >>> costs = np.zeros((3, 4)), np.array([[0, 2]]), IntervalCost()
    >>> grow_regions(Intervals(known, known), Intervals(line, line), *costs, near=1.0, dearest=0.005)[0]
    array([[ 2,  3, -1]])
    """
    regions, gains = np.full((len(seeds), len(unary)), -1), np.zeros(len(seeds))
    regions[np.arange(len(seeds)), seeds[:, 0]] = seeds[:, 1]
    # Points join a region in the order of their distance from its seed, which is first.
    order = np.argsort(np.where(np.eye(len(unary)), -1.0, points.upper), axis=1, kind="stable")[seeds[:, 0]]
    points, candidates = points.single, candidates.single
    single_unary = np.ascontiguousarray(unary, np.float32)
    # The nearer two points, the greater the weight of their distance: it is known better, and locates a point
    # better.
    terms = cost.terms(points, 1 / (np.float32(near) + points.upper))
    bounds = *map(np.float32, (dearest, refused, min_distance)), width

    def grow(row: int) -> None:
        gains[row] = _grow_region(terms, candidates, single_unary, order[row], bounds, regions[row])

    parallel_rows(grow, len(seeds))
    return regions, gains


@compiled(fastmath=FAST_MATH)
def _grow_region(
    terms: Terms, candidates: Intervals, unary: Float32Array, order: IntArray, bounds: Terms, region: IntArray
) -> float:
    """Fill in the candidates (m,) of points in their order; the first has one already. Return the gain."""
    # Points join in order of their distance from the seed. In each variant of the region, a point without a
    # partner gains 0, and a point with candidate k, of mean cost c̄(k) given the earlier assignments, gains
    #   g(k) = 1 − c̄(k) / dearest − unary(k):
    # 1 for perfect agreement, 0 if the mean cost is ``dearest`` (both without a unary cost). So a region ends
    # where no candidate fits, and the sum of its gains counts its points by how well they fit. Variants are
    # sorted by their gain. Of the candidates for a point in one variant that are nearer to each other than
    # ``min_distance``, only the one that gains most extends it, so that variants differ.
    dearest, refused, min_distance, width = bounds
    one, total = np.float32(1), np.zeros(unary.shape[1], np.float32)
    variants, gains = np.full((width, len(region)), -1), np.full(width, NO_GAIN)
    variants[0] = region
    gains[0] = one - unary[order[0], region[order[0]]]
    next_gains, parents, images = np.empty_like(gains), np.empty(width, np.int64), np.empty(width, np.int64)
    for point in order[1:]:
        for i in range(width):
            next_gains[i], parents[i], images[i] = gains[i], i, -1
        for i in range(width):
            if gains[i] <= NO_GAIN:
                break
            weights = _costs(terms, point, variants[i], candidates, total)
            for k in range(len(total)):
                mean = total[k] / weights
                gain = gains[i] + one - mean / dearest - unary[point, k]
                if mean > refused or gain <= next_gains[-1]:
                    continue
                place = width - 1
                for j in range(width):
                    if parents[j] == i and images[j] >= 0 and candidates.upper[images[j], k] < min_distance:
                        place = j
                        break
                if gain <= next_gains[place]:
                    continue
                while place > 0 and next_gains[place - 1] < gain:
                    next_gains[place] = next_gains[place - 1]
                    parents[place], images[place] = parents[place - 1], images[place - 1]
                    place -= 1
                next_gains[place], parents[place], images[place] = gain, i, k
        variants = variants[parents]
        for i in range(width):
            gains[i], variants[i, point] = next_gains[i], images[i]
    region[:] = variants[0]
    return float(gains[0])


def trilaterate(
    points: Intervals, candidates: Intervals, cost: IntervalCost, near: float | None = None
) -> tuple[IntArray, FloatArray]:
    """Place each point at the candidate whose distances to the images of all anchors agree best with its own.

    In the intervals from m anchors to q points, (m, q), and from their images to c candidates, (m,
    c), a distance u has the weight 1 / (near + u)², or all have the same weight. Returns a
    candidate for each point (q,), and its mean cost (q,). O(q m c), in single precision.

    Examples
    --------
    Anchors are at both ends of a line of five candidates. The first point is known exactly; of two
    candidates that fit the second, the one nearer to its upper bounds costs less.

    >>> ends = np.array([[0.0, 1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0, 0.0]])
    >>> points = Intervals(np.array([[1.0, 0.0], [3.0, 2.0]]), np.array([[1.0, 2.0], [3.0, 3.0]]))
    >>> trilaterate(points, Intervals(ends, ends), IntervalCost())[0]
    array([1, 2])
    """
    points, candidates = points.map_bounds(np.transpose).single, candidates.single
    (q, m), c = points.upper.shape, candidates.upper.shape[1]
    weights = np.ones_like(points.upper) if near is None else 1 / (np.float32(near) + points.upper) ** 2
    totals, anchors = np.empty((q, c), np.float32), np.tile(np.arange(m), (q, 1))
    _costs_of(cost.terms(points, weights), np.arange(q), anchors, candidates, totals)
    best = totals.argmin(axis=1)
    return best, totals[np.arange(q), best] / weights.sum(axis=1, dtype=np.float64)
