"""Points assigned, and placed, where intervals of distances on both sides agree."""

import numpy as np
import pytest

from isomatch.correspondence import (
    IntervalCost,
    Intervals,
    grow_common_regions,
    grow_regions,
    trilaterate_common,
)

NUMBERS = {"cost": IntervalCost(), "near": 0.2, "dearest": 0.3}


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(0).uniform(size=(60, 2))


def distances(here, there):
    return np.linalg.norm(here[:, None] - there[None], axis=2)


def exactly(here, there):
    apart = distances(here, there)
    return Intervals(apart, apart)


def test_of_known_distances_the_regions_are_those_with_one_side_known(points):
    """Two kernels: with one variant and without negative costs, both take the best partner if it gains anything."""
    some, apart = points[:20], distances(points, points)
    unary = np.random.default_rng(1).uniform(0, 0.5, (20, 60))
    seeds = np.array([[0, 0], [3, 3], [5, 17]])
    known = distances(some, some)
    single, gains = grow_regions(apart, known, known, unary, seeds, **NUMBERS)
    both, same = grow_common_regions(
        exactly(some, some), exactly(points, points), unary, seeds, **NUMBERS, width=1, apart=0.0
    )
    np.testing.assert_array_equal(both, single)
    np.testing.assert_allclose(same, gains, rtol=1e-4)
    assert (both >= 0).any(axis=1).all()


def test_more_variants_gain_no_less(points):
    some = points[:20]
    unary = np.random.default_rng(2).uniform(0, 1.0, (20, 60))
    seeds = np.array([[0, 0], [3, 3], [5, 17]])
    sides = exactly(some, some), exactly(points, points)
    few, many = (
        grow_common_regions(*sides, unary, seeds, **NUMBERS, width=width, apart=0.1)[1] for width in (1, 4)
    )
    assert (many >= few - 1e-5).all()


def test_what_is_unknown_on_both_sides_is_no_contradiction(points):
    """A distance that the points show as longer, and the candidates as longer still, may be the same on the body."""
    some = points[:10]
    apart = distances(some, some)
    detours = Intervals(apart, 1.5 * apart)
    cost = IntervalCost(inside=0.0)
    seeds, nothing = np.array([[4, 4]]), np.zeros((10, 10))
    options = {"cost": cost, "near": 0.2, "dearest": 0.01, "width": 2, "apart": 0.0}
    found, gains = grow_common_regions(detours, exactly(some, some), nothing, seeds, **options)
    assert gains[0] == pytest.approx(10)
    assert (found >= 0).all()
    shorter = exactly(0.5 * some, 0.5 * some)
    assert grow_common_regions(detours, shorter, nothing, seeds, **options)[1][0] < 9


def test_points_are_placed_where_they_are(points):
    anchors = points[:6]
    placed, costs = trilaterate_common(
        exactly(anchors, points), exactly(anchors, points), 0.15, IntervalCost()
    )
    np.testing.assert_array_equal(placed, np.arange(60))
    np.testing.assert_allclose(costs, 0.0, atol=1e-6)


def test_points_that_no_candidate_explains_cost_more(points):
    anchors, far = points[:6], np.array([[5.0, 5.0]])
    _, costs = trilaterate_common(exactly(anchors, far), exactly(anchors, points), 0.15, IntervalCost())
    assert costs[0] > 0.05
