"""Points assigned, and placed, where intervals of distances on both sides agree."""

import numpy as np
import pytest

from isomatch.correspondence import IntervalCost, Intervals, assign_points, grow_regions, trilaterate
from isomatch.correspondence.interval_matching import _keep_differing

COST = IntervalCost()
GROWTH = {"cost": COST, "near": 0.2, "dearest": 0.3}


def distances(a, b):
    return np.linalg.norm(a[:, None] - b, axis=2)


def exactly(a, b):
    return Intervals(*[distances(a, b)] * 2)


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(0).random((60, 2))


def test_distances_inside_the_interval_cost_least():
    d = np.linspace(0, 2, 201)
    cost = COST(d, np.full(201, 0.8), np.ones(201))
    assert d[cost.argmin()] == pytest.approx(1)
    assert cost[90] < cost[50]
    assert cost[90] < cost[130]
    assert cost.max() == pytest.approx(COST.most / (COST.soft + 1))


def test_exact_distances_find_the_points_again(points):
    order = np.random.default_rng(1).permutation(60)
    few = points[order[:7]]
    found, _ = assign_points(exactly(few, few), exactly(points, points), np.zeros((7, 60)), COST, 200, 0.0)
    assert np.array_equal(found[0], order[:7])


def test_the_cost_of_an_assignment_is_that_of_all_pairs_and_of_each_point(points):
    """Two routes: the loop that adds one point after the other, and the formula of `IntervalCost`."""
    rng = np.random.default_rng(4)
    known, unary = distances(points[:5], points[:5]), rng.random((5, 60))
    interval = Intervals(0.7 * known, 1.1 * known)
    found, costs = assign_points(interval, exactly(points, points), unary, COST, 30, 0.01)
    for images, cost in zip(found, costs):
        of_pairs = np.triu(COST(distances(points[images], points[images]), *interval), 1).sum()
        assert cost == pytest.approx(of_pairs + unary[np.arange(5), images].sum())


def test_intervals_of_candidates_cost_nothing_where_they_meet_those_of_the_points(points):
    few = points[:6]
    long, short = (Intervals(d, 2 * d) for d in (distances(few, few), 1.5 * distances(points, points)))
    cost = IntervalCost(inside=0.0)
    assert assign_points(long, short, np.zeros((6, 60)), cost, 50, 0.0)[1][0] == 0
    longer = Intervals(2.5 * distances(few, few), 2.5 * distances(few, few))
    assert assign_points(longer, exactly(few, few), np.zeros((6, 6)), cost, 50, 0.0)[1][0] > 0


def test_partial_assignments_that_are_kept_differ(points):
    few, between = points[:5], distances(points, points)
    found, _ = assign_points(exactly(few, few), exactly(points, points), np.zeros((5, 60)), COST, 20, 0.2)
    assert len(found) == 20
    for i, one in enumerate(found):
        assert all(between[one, other].mean() >= 0.2 for other in found[:i])


def test_the_beam_keeps_what_comparing_whole_assignments_would_keep(points):
    between, rng = distances(points, points), np.random.default_rng(3)
    parents = rng.integers(60, size=(30, 4))
    of_parents = np.stack([between[parents, other].sum(axis=1) for other in parents], axis=1)
    parent, last = rng.integers(30, size=400), rng.integers(60, size=400)
    whole = np.column_stack([parents[parent], last])
    wanted = []
    for i in range(400):
        if len(wanted) < 30 and all(between[whole[i], whole[k]].sum() >= 1.2 for k in wanted):
            wanted.append(i)
    of_kept = np.zeros((30, 30))
    kept = _keep_differing(between, (parent, last), 1.2, of_parents, of_kept)
    assert kept.tolist() == wanted
    sums = [[between[whole[i], whole[k]].sum() for k in wanted] for i in wanted]
    np.testing.assert_allclose(of_kept[: len(kept), : len(kept)], sums, atol=1e-12)


def test_what_is_forbidden_is_not_assigned(points):
    few, unary = points[:4], np.zeros((4, 60))
    unary[0, 0] = 100
    found, _ = assign_points(exactly(few, few), exactly(points, points), unary, COST, 30, 0.01)
    assert (found[:, 0] != 0).all()


def test_a_region_of_points_all_of_which_agree_is_that_of_the_beam_search(points):
    """Two drivers of one cost: from a right pair outward, and all points in turn."""
    few, nothing = points[:8], np.zeros((8, 60))
    sides = exactly(few, few), exactly(points, points)
    grown, gains = grow_regions(*sides, nothing, np.array([[3, 3]]), **GROWTH)
    np.testing.assert_array_equal(grown[0], assign_points(*sides, nothing, COST, 200, 0.0)[0][0])
    assert gains[0] == pytest.approx(8)


def test_the_seed_comes_first_also_among_points_at_one_place(points):
    twice = np.repeat(points[:4], 2, axis=0)
    grown, _ = grow_regions(
        exactly(twice, twice), exactly(points, points), np.zeros((8, 60)), np.array([[5, 2]]), **GROWTH
    )
    assert grown.tolist() == [[0, 0, 1, 1, 2, 2, 3, 3]]


def test_more_variants_gain_no_less(points):
    some = points[:20]
    unary = np.random.default_rng(2).uniform(0, 1.0, (20, 60))
    seeds = np.array([[0, 0], [3, 3], [5, 17]])
    sides = exactly(some, some), exactly(points, points)
    few, many = (
        grow_regions(*sides, unary, seeds, **GROWTH, width=width, min_distance=0.1)[1] for width in (1, 4)
    )
    assert (many >= few - 1e-5).all()


def test_no_likely_candidate_is_assigned_where_distances_disagree_too_much(points):
    some, likely = points[:6], np.full((6, 6), -5.0)
    sides = exactly(some, some), exactly(3 * some, 3 * some)
    seeds = np.array([[0, 0]])
    assert (grow_regions(*sides, likely, seeds, **GROWTH)[0] >= 0).all()
    assert (grow_regions(*sides, likely, seeds, **GROWTH, refused=0.1)[0][0, 1:] < 0).any()


def test_what_is_unknown_on_both_sides_is_no_contradiction(points):
    """A distance that the points show as longer, and the candidates as longer still, may be the same on the body."""
    some = points[:10]
    exact = distances(some, some)
    detours = Intervals(exact, 1.5 * exact)
    seeds, nothing = np.array([[4, 4]]), np.zeros((10, 10))
    options = {"cost": IntervalCost(inside=0.0), "near": 0.2, "dearest": 0.01, "width": 2}
    found, gains = grow_regions(detours, exactly(some, some), nothing, seeds, **options)
    assert gains[0] == pytest.approx(10)
    assert (found >= 0).all()
    shorter = exactly(0.5 * some, 0.5 * some)
    assert grow_regions(detours, shorter, nothing, seeds, **options)[1][0] < 9


@pytest.mark.parametrize("near", [None, 0.15])
def test_trilateration_finds_every_point(points, near):
    to_points = exactly(points[:6], points)
    placed, costs = trilaterate(to_points, to_points, COST, near)
    np.testing.assert_array_equal(placed, np.arange(60))
    np.testing.assert_allclose(costs, 0.0, atol=1e-6)


def test_one_distance_that_is_wrong_does_not_matter(points):
    exact = distances(points[:8], points)
    wrong = exact.copy()
    wrong[3] += 0.7
    placed, _ = trilaterate(Intervals(wrong, wrong), Intervals(exact, exact), COST)
    assert (placed == np.arange(60)).mean() > 0.9


def test_points_that_no_candidate_explains_cost_more(points):
    anchors, far = points[:6], np.array([[5.0, 5.0]])
    assert trilaterate(exactly(anchors, far), exactly(anchors, points), COST, 0.15)[1][0] > 0.05
