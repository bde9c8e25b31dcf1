"""Assigning points so that distances fall into intervals."""

import numpy as np
import pytest

from isomatch.correspondence import IntervalCost, assign_points, trilaterate
from isomatch.correspondence.interval_matching import _keep_differing

COST = IntervalCost()


def distances(a, b):
    return np.linalg.norm(a[:, None] - b, axis=2)


@pytest.fixture
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
    exact = distances(few, few)
    found, _ = assign_points(distances(points, points), exact, exact, np.zeros((7, 60)), COST, 200, 0.0)
    assert np.array_equal(found[0], order[:7])


def test_partial_assignments_that_are_kept_differ(points):
    few = points[:5]
    exact = distances(few, few)
    between = distances(points, points)
    found, _ = assign_points(between, exact, exact, np.zeros((5, 60)), COST, 20, 0.2)
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
        if len(wanted) < 25 and all(between[whole[i], whole[k]].sum() >= 1.2 for k in wanted):
            wanted.append(i)
    kept, of_kept = np.zeros(25, dtype=np.int64), np.zeros((25, 25))
    count = _keep_differing(
        between, parent, last, 1.2, of_parents, np.full(len(of_parents), -1), kept, of_kept
    )
    assert kept[:count].tolist() == wanted
    sums = [[between[whole[i], whole[k]].sum() for k in wanted] for i in wanted]
    np.testing.assert_allclose(of_kept[:count, :count], sums, atol=1e-12)


def test_what_is_forbidden_is_not_assigned(points):
    few = points[:4]
    exact = distances(few, few)
    unary = np.zeros((4, 60))
    unary[0, 0] = 100
    found, _ = assign_points(distances(points, points), exact, exact, unary, COST, 30, 0.01)
    assert (found[:, 0] != 0).all()


def test_trilateration_finds_every_point(points):
    exact = distances(points, points[:6])
    found = trilaterate(exact, exact, distances(points[:6], points), COST)
    assert np.array_equal(found, np.arange(60))


def test_one_distance_that_is_wrong_does_not_matter(points):
    exact = distances(points, points[:8])
    wrong = exact.copy()
    wrong[:, 3] += 0.7
    found = trilaterate(wrong, wrong, distances(points[:8], points), COST)
    assert (found == np.arange(60)).mean() > 0.9
