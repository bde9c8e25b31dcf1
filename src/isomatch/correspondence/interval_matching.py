"""Points assigned so that distances fall into intervals: by beam search, by growing regions, by trilateration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.runtime.threads import parallel_rows
from isomatch.values.arrays import AnyArray, Float32Array, FloatArray, IntArray, single

FORBIDDEN = 50.0  # more than any assignment costs
NOTHING = np.float32(-1e9)  # gain of a place in a beam that is still free

# Where a part of a surface is missing, the distance of two points on the whole is known only to lie in an interval [l,
# u]: u is the distance along the part, and l allows paths through what is missing (`MissingRegion`; Bracha, Dagès &
# Kimmel, *Wormhole Loss for Partial Shape Matching*, NeurIPS 2024). A map f of a near-isometric pair should then
# satisfy
#   l_ab ≤ d(f(a), f(b)) ≤ u_ab for all pairs a, b of points.
# Violations are summed as in a quadratic assignment problem, Σ_ab c(d(f(a), f(b))) + Σ_a unary(a, f(a)), which is solved
# approximately by assigning one point after the other.


@dataclass(frozen=True)
class IntervalCost:
    """The cost of placing two points at distance d, if it should lie in the interval [l, u].

    ``c(d) = min(v + inside |d − u|, most) / (soft + u)``, with v the violation of [(1 − tolerance) l, (1 + tolerance) u]:
    ``most`` makes the cost robust, ``inside`` prefers the upper bound.

    Examples
    --------
    A distance in the interval [1, 2] costs nothing; farther outside the cost grows with the violation, up to ``most``.

    >>> cost = IntervalCost(tolerance=0.0, inside=0.0, most=3.0, soft=0.0)
    >>> cost(np.array([1.5, 3.0, 100.0]), lower=np.ones(3), upper=np.full(3, 2.0))
    array([0. , 0.5, 1.5])
    """

    tolerance: float = 0.05
    inside: float = 0.1
    most: float = 0.5
    soft: float = 0.15

    def __call__(self, distances: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Costs of arrays of equal shape."""
        below, above = lower * (1 - self.tolerance) - distances, distances - upper * (1 + self.tolerance)
        violation = np.maximum(np.maximum(below, above), 0.0)
        costs = np.minimum(violation + self.inside * np.abs(distances - upper), self.most)
        return np.asarray(costs / (self.soft + upper))

    @property
    def numbers(self) -> tuple[float, float, float, float]:
        """The parameters, for compiled loops."""
        return self.tolerance, self.inside, self.most, self.soft


@dataclass(frozen=True, eq=False)
class Intervals:
    """Least and greatest distances (m, n) between m points and n points of a surface that does not show everything.

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


def assign_points(
    distances: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    unary: FloatArray,
    cost: IntervalCost,
    width: int,
    apart: float,
) -> tuple[IntArray, FloatArray]:
    """Assign m points to candidates, one after the other, keeping many partial assignments that differ.

    Parameters
    ----------
    distances : (c, c) array of float
        Distances between candidates.
    lower, upper : (m, m) array of float
        Intervals of the distances between the points.
    unary : (m, c) array of float
        Cost of each assignment by itself.
    cost : IntervalCost
    width : int
        Partial assignments that are kept.
    apart : float
        Least mean distance between the candidates of any two of them. Without it, all would be variants of one.

    Returns
    -------
    (h, m) array of int, (h,) array of float
        Candidates, h ≤ width, and their cost, least cost first. O(width m (c m + width)).

    Examples
    --------
    Candidates on a line at 0, 1, 3, 7. Three points whose distances are known exactly have one place there.

    >>> places = np.array([0.0, 1.0, 3.0, 7.0])
    >>> distances = np.abs(places[:, None] - places)
    >>> known = np.array([[0.0, 4.0, 2.0], [4.0, 0.0, 6.0], [2.0, 6.0, 0.0]])
    >>> assigned, cost = assign_points(distances, known, known, np.zeros((3, 4)), IntervalCost(), width=20, apart=0.1)
    >>> assigned[0], float(cost[0])
    (array([2, 3, 1]), 0.0)
    """
    m, c = unary.shape
    distances, lower, upper = map(np.ascontiguousarray, (distances, lower, upper))
    # A beam search: the cost of an assignment x of the first p points is a sum over pairs, so that one more point adds
    #   E(x_0 … x_p) = E(x_0 … x_{p−1}) + unary(p, x_p) + Σ_{a<p} c(d(x_a, x_p)),
    # and of the h c children the cheapest that differ are kept. Two assignments differ if Σ_a d(x_a, y_a) ≥ apart p: that
    # sum too is the one of the parents plus one distance. Of h: candidates (h, point), costs (h,), and sums (h, h).
    assigned, total = np.zeros((1, 0), dtype=np.int64), np.zeros(1)
    between, of_kept, room = np.zeros((width, width)), np.zeros((width, width)), np.zeros((width, c))
    for point in range(m):
        added = room[: len(assigned)]
        added[:] = 0.0
        _add_costs(distances, assigned, lower[point, :point], upper[point, :point], *cost.numbers, added)
        added += total[:, None] + unary[point]
        children = added.ravel()  # (h c,): child = parent c + candidate
        take = min(len(children), 12 * width)  # more than are kept, because variants of one are dropped
        best = np.sort(np.argpartition(children, take - 1)[:take])
        best = best[np.argsort(children[best], kind="stable")]  # least cost first, ties by number
        parent, candidate = np.divmod(best, c)
        kept, latest = np.zeros(width, dtype=np.int64), np.full(len(between), -1)
        apart_so_far = apart * (point + 1)
        count = _keep_differing(distances, parent, candidate, apart_so_far, between, latest, kept, of_kept)
        kept, between, of_kept = kept[:count], of_kept, between
        assigned, total = np.column_stack([assigned[parent[kept]], candidate[kept]]), children[best[kept]]
    return assigned, total


@compiled()
def _add_costs(
    distances: FloatArray,
    assigned: IntArray,
    lower: FloatArray,
    upper: FloatArray,
    tolerance: float,
    inside: float,
    most: float,
    soft: float,
    added: FloatArray,
) -> None:
    """Add the cost (h, c) of each candidate for one more point, towards the points of each assignment (h, m)."""
    h, m = assigned.shape
    for i in range(h):
        for a in range(m):
            u = upper[a]
            low, high, scale = lower[a] * (1 - tolerance), u * (1 + tolerance), soft + u
            row = assigned[i, a]
            for k in range(len(distances)):
                d = distances[row, k]
                added[i, k] += min(max(low - d, d - high, 0.0) + inside * abs(d - u), most) / scale


@compiled()
def _keep_differing(
    distances: FloatArray,
    parent: IntArray,
    last: IntArray,
    apart: float,
    of_parents: FloatArray,
    latest: IntArray,
    kept: IntArray,
    of_kept: FloatArray,
) -> int:
    """Keep the first assignments whose summed distance to all kept before is at least ``apart``, and count them."""
    # Each assignment has a parent and one more candidate, the last. of_parents (h, h) holds the summed distances between
    # parents; those between the assignments kept are written to of_kept. latest (h,) is −1 on entry. Most assignments are
    # too near to the latest one kept of the same parent, so they are compared with that one first.
    n = 0
    for i in range(len(last)):
        mine, here = parent[i], last[i]
        sibling = latest[mine]
        if sibling >= 0 and of_parents[mine, mine] + distances[here, last[kept[sibling]]] < apart:
            continue
        differs = True
        for k in range(n - 1, -1, -1):
            other = parent[kept[k]]
            # Σ_a d(x_a, y_a) of two children: that of their parents, and the distance of their last candidates
            total = of_parents[mine, other] + distances[here, last[kept[k]]]
            of_kept[n, k] = total
            if total < apart:
                differs = False
                break
        if differs:
            kept[n] = i
            latest[mine] = n
            for k in range(n + 1):  # the column; distances need not be symmetric to the last bit
                of_kept[k, n] = of_parents[parent[kept[k]], mine] + distances[last[kept[k]], here]
            n += 1
            if n == len(kept):
                break
    return n


def pin_first(unary: FloatArray, candidates: IntArray) -> None:
    """Let the first q points go to given candidates (q,) alone, by their costs (m, c), which are changed in place.

    Examples
    --------
    >>> unary = np.ones((2, 3))
    >>> pin_first(unary, np.array([2]))
    >>> unary
    array([[50., 50.,  0.],
           [ 1.,  1.,  1.]])
    """
    first = np.arange(len(candidates))
    unary[first] = FORBIDDEN
    unary[first, candidates] = 0.0


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
    """Assign m points to candidates, from one pair outward; a point that agrees with nothing gets none.

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
        Candidate of each point, −1 for none, and what each region gains. O(s m² c), on all threads.

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
    numbers = (*cost.numbers, near)

    def region(row: int) -> None:
        root, image = seeds[row]
        gains[row] = _grow(
            distances, lower, upper, unary, order[root], root, image, numbers, dearest, assigned[row]
        )

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
    numbers: tuple[float, ...],
    dearest: float,
    assigned: IntArray,
) -> float:
    """Fill in the candidates (m,) of the points, all −1 on entry, and return the gain."""
    # Points join in order of their distance from that of the seed. With c̄(k) the mean cost of candidate k towards those
    # assigned before (`_summed_costs`), "no partner" gains 0 and a candidate
    #   g(k) = 1 − c̄(k) / dearest − unary(k):
    # one point more for a perfect agreement, nothing at the dearest cost. The candidate that gains most is taken, if any
    # gains. So a region ends where no candidate fits, and the sum of the gains counts the points by how well they fit.
    c = unary.shape[1]
    assigned[root] = image
    gain = 1.0 - unary[root, image]
    total = np.zeros(c)
    for point in order:
        if point == root:
            continue
        weights = _summed_costs(assigned, point, lower, upper, distances, distances, numbers, total)
        best, most_gained = -1, 0.0
        for k in range(c):
            gained = 1.0 - total[k] / weights / dearest - unary[point, k]
            if gained > most_gained:
                best, most_gained = k, gained
        assigned[point] = best
        gain += most_gained
    return float(gain)


@compiled(inline="always")
def _summed_costs(
    assigned: IntArray,
    point: int,
    lower: AnyArray,
    upper: AnyArray,
    least: AnyArray,
    greatest: AnyArray,
    numbers: tuple[Any, ...],
    total: AnyArray,
) -> Any:
    """Set the summed costs (c,) of the candidates of a point, and return the sum of the weights."""
    # c̄(k) = Σ_a w_a c(d(x_a, k)) / Σ_a w_a over the points a that have a candidate, w_a = 1 / (near + u_a): near ones
    # weigh more, whose distances are known better and whose agreement says more of where a point belongs. The distance
    # between candidates lies in [least, greatest], and violates [l, u] by how far the two intervals are apart. Of a
    # whole surface, both are the distance. Anchors outside, candidates inside: rows are read in order.
    tolerance, inside, most, soft, near = numbers
    zero, one = total.dtype.type(0), total.dtype.type(1)
    total[:] = zero
    weights = zero
    for a in range(len(assigned)):
        row = assigned[a]
        if row < 0:
            continue
        u = upper[point, a]
        low, high = lower[point, a] * (one - tolerance), u * (one + tolerance)
        weight = one / (near + u)
        weights += weight
        weight /= soft + u
        for k in range(len(total)):
            v = max(low - greatest[row, k], least[row, k] - high, zero)
            total[k] += weight * min(v + inside * abs(greatest[row, k] - u), most)
    return weights


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
    """Assign m points to c candidates, from one pair outward, or to nothing; distances are intervals on both sides.

    As `grow_regions`, but two points may not be matched only if their intervals are disjoint, and of each region
    ``width`` variants are kept while it grows, in which candidates of one point are at least ``apart``. Nothing is
    assigned beyond the mean cost ``dearest``. O(s width m² c), on all threads.

    Examples
    --------
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
    numbers = tuple(np.float32(number) for number in (*cost.numbers, near))
    bounds = np.float32(dearest), np.float32(apart)

    def region(row: int) -> None:
        root, image = seeds[row]
        gains[row] = _grow_variants(
            *here, *there, alone, order[root], root, image, numbers, bounds, width, assigned[row]
        )

    parallel_rows(region, s)
    return assigned, gains


@compiled(fastmath={"nnan", "nsz", "reassoc", "contract", "arcp"})
def _grow_variants(
    lower: Float32Array,
    upper: Float32Array,
    least: Float32Array,
    greatest: Float32Array,
    unary: Float32Array,
    order: IntArray,
    root: int,
    image: int,
    numbers: tuple[np.float32, ...],
    bounds: tuple[np.float32, np.float32],
    width: int,
    assigned: IntArray,
) -> float:
    """Fill in the candidates (m,) of the points, and return the gain."""
    # As `_grow`, with a beam of variants in place of one region, in order of their gain. Each may go on without a partner
    # for the point, at the same gain, or with a candidate k that gains
    #   g(k) = 1 − c̄(k) / dearest − unary(k),
    # if c̄(k) ≤ dearest: a likely candidate alone does not make up for distances that disagree. A candidate nearer than
    # ``apart`` to another one of the same variant takes its place, if it gains more, so that variants differ.
    dearest, apart = bounds
    m, c = unary.shape
    one = np.float32(1)
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
            weights = _summed_costs(states[state], point, lower, upper, least, greatest, numbers, total)
            for k in range(c):
                mean = total[k] / weights
                if mean > dearest:
                    continue
                gain = gains[state] + one - mean / dearest - unary[point, k]
                at = width - 1
                for i in range(width):
                    sibling = grown_gains[i] > NOTHING and parents[i] == state and images[i] >= 0
                    if sibling and greatest[images[i], k] < apart:
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


def trilaterate(lower: FloatArray, upper: FloatArray, distances: FloatArray, cost: IntervalCost) -> IntArray:
    """Place each of q points where its intervals to m anchors, (q, m), fit best the distances of c candidates, (m, c).

    O(q m c), in single precision.

    Examples
    --------
    Anchors at both ends of a line of five candidates. The first point is known exactly. Two candidates fit the second;
    the one nearer to its upper bounds costs less.

    >>> to_anchors = np.array([[0.0, 1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0, 0.0]])
    >>> lower, upper = np.array([[1.0, 3.0], [0.0, 2.0]]), np.array([[1.0, 3.0], [2.0, 3.0]])
    >>> trilaterate(lower, upper, to_anchors, IntervalCost())
    array([1, 2])
    """
    return _trilaterated(Intervals(lower.T, upper.T), Intervals(distances, distances), cost, -1.0)[0]


def trilaterate_common(
    points: Intervals, candidates: Intervals, near: float, cost: IntervalCost
) -> tuple[IntArray, FloatArray]:
    """Place each point where its intervals to all anchors agree best with those of the candidates to their images.

    Of the intervals from m anchors to q points, (m, q), and from their images to c candidates, (m, c), a distance u
    weighs 1 / (near + u)². Returns a candidate for each point (q,), and its mean cost (q,).

    Examples
    --------
    Anchors at both ends of a line of five candidates, and a point of which both distances are known.

    >>> ends = np.array([[0.0, 1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0, 0.0]])
    >>> point = np.array([[1.0], [3.0]])
    >>> trilaterate_common(Intervals(point, point), Intervals(ends, ends), 1.0, IntervalCost())
    (array([1]), array([0.]))
    """
    return _trilaterated(points, candidates, cost, near)


def _trilaterated(
    points: Intervals, candidates: Intervals, cost: IntervalCost, near: float
) -> tuple[IntArray, FloatArray]:
    """Place points; all distances weigh alike if ``near`` is negative."""
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
    # Once some points are anchors, each other one is placed by itself, at the candidate k of least mean cost
    #   Σ_a w_a c(d(x_a, k)) / Σ_a w_a,  w_a = 1 / (near + u_a)², or 1
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
            weight = one / ((near + u) * (near + u)) if near >= zero else one
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
