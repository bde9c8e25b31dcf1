"""Maps that are permutations of one sphere: what cycles tell of wrong ones is known exactly."""

import numpy as np
import pytest

from isomatch.cohort.combine import MAX_INCONSISTENCY, inconsistency, turned_shapes

N_POINTS = 60
RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(N_POINTS, 3))
POINTS /= np.linalg.norm(POINTS, axis=1, keepdims=True) * np.sqrt(4 * np.pi)
HALF_TURN = np.linalg.norm(POINTS[:, None] * [-1, -1, 1] - POINTS[None], axis=2).argmin(axis=1)


def true_maps(n):
    """The same points in n orders, and the maps between them."""
    rng = np.random.default_rng(n)
    orders = [rng.permutation(N_POINTS) for _ in range(n)]
    maps = {(a, b): np.argsort(orders[b])[orders[a]] for a in range(n) for b in range(n) if a != b}
    return orders, maps


def readings(orders, maps):
    """Mean distance between a → b → c and a → c."""
    n = len(orders)
    found = np.full((n, n, n), np.nan)
    for (a, b), first in maps.items():
        for c in range(n):
            if (b, c) in maps and (a, c) in maps:
                places = POINTS[orders[c]]
                gap = places[maps[b, c][first]] - places[maps[a, c]]
                found[a, b, c] = np.linalg.norm(gap, axis=1).mean()
    return found


def turn(orders, maps, a, b):
    """Turn the map of a pair by half a turn of its target, in both directions."""
    for source, target in ((a, b), (b, a)):
        half = np.argsort(orders[target])[HALF_TURN][orders[target]]
        maps[source, target] = half[maps[source, target]]


def contradicted(orders, maps):
    found = inconsistency(readings(orders, maps))
    return {(int(a), int(b)) for a, b in np.argwhere(np.triu(found > MAX_INCONSISTENCY))}


def test_right_maps_are_consistent():
    orders, maps = true_maps(5)
    found = inconsistency(readings(orders, maps))
    off_diagonal = ~np.eye(5, dtype=bool)
    assert (found[off_diagonal] == 0).all()
    assert np.isnan(np.diag(found)).all()


@pytest.mark.parametrize("n", [4, 5, 12])
def test_one_wrong_map_is_found_with_its_error(n):
    orders, maps = true_maps(n)
    right = maps[0, 2]
    turn(orders, maps, 0, 2)
    places = POINTS[orders[2]]
    error = np.linalg.norm(places[maps[0, 2]] - places[right], axis=1).mean()
    found = inconsistency(readings(orders, maps))
    assert contradicted(orders, maps) == {(0, 2)}
    assert found[0, 2] == found[2, 0]
    assert found[0, 2] == pytest.approx(error, rel=0.1)


@pytest.mark.parametrize("wrong", [{(0, 1), (2, 3)}, {(0, 1), (1, 2)}, {(0, 1), (0, 2), (3, 4), (5, 6)}])
def test_several_wrong_maps_are_found(wrong):
    orders, maps = true_maps(10)
    for pair in wrong:
        turn(orders, maps, *pair)
    assert contradicted(orders, maps) == wrong


def test_a_map_wrong_in_one_direction_is_found():
    orders, maps = true_maps(8)
    right = maps[1, 0]
    turn(orders, maps, 0, 1)
    maps[1, 0] = right
    assert contradicted(orders, maps) == {(0, 1)}


def test_all_maps_of_one_shape_wrong_are_consistent():
    """Composition law: turning a shape turns every map to it, and cancels on the way through it."""
    orders, maps = true_maps(6)
    flip = np.random.default_rng(1).permutation(N_POINTS)
    for other in range(1, 6):
        maps[other, 0] = flip[maps[other, 0]]
        maps[0, other] = maps[0, other][np.argsort(flip)]
    assert np.nanmax(inconsistency(readings(orders, maps))) == 0


def test_missing_maps_leave_the_rest():
    orders, maps = true_maps(6)
    turn(orders, maps, 0, 1)
    for pair in ((4, 5), (5, 4), (3, 5), (5, 3), (2, 5), (5, 2), (1, 5), (5, 1)):
        del maps[pair]
    found = inconsistency(readings(orders, maps))
    assert contradicted(orders, maps) == {(0, 1)}
    assert np.isnan(found[5]).all()


def test_groups_that_no_maps_join_are_not_mirrored():
    orientations = np.full((11, 11), np.nan)
    orientations[:5, :5] = orientations[5:, 5:] = 0.9
    assert turned_shapes(orientations).tolist() == []
    orientations[7, 5:] = orientations[5:, 7] = orientations[1, :5] = orientations[:5, 1] = -0.9
    assert turned_shapes(orientations).tolist() == [1, 7]


def test_orientation_tells_a_mirrored_shape():
    orientations = np.full((7, 7), 0.9)
    orientations[2] = orientations[:, 2] = -0.9
    orientations[0, 1] = orientations[1, 0] = np.nan
    assert turned_shapes(orientations).tolist() == [2]
    assert turned_shapes(np.full((7, 7), 0.9)).tolist() == []
