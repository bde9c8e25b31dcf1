"""Wrong maps lead to the right one: mirrored maps, half twists, and maps of the other direction."""

import numpy as np
import pytest

from isomatch.correspondence import iterative_closest_points
from isomatch.datasets import ground_truth
from isomatch.matching import Candidate, default_starts, prepare_pair
from isomatch.matching.isometric.candidates import search
from isomatch.matching.problem import search_pairs
from isomatch.matching.proposals.flips import find_flips
from isomatch.matching.proposals.starts import start_from_pairs, starts_from_extremities, starts_from_poses
from isomatch_lab.procedural import creature


def distance_between(pair, one, other):
    return pair.distances_between_maps(one.target_row, [other.target_row])[0]


@pytest.fixture(scope="module")
def known():
    """A pair of symmetric bipeds, its true map and its mirror image, after iterative closest points."""
    source, target = (creature(2000, kind="biped", symmetric=True, pose=i, triangulation=i) for i in (1, 2))
    pair = prepare_pair(source.mesh, target.mesh)
    maps = []
    for mirrored in (False, True):
        vertices = ground_truth(source, target, mirrored=mirrored).vertices[pair.source_vertices]
        onto = pair.target.body.vertices[pair.target_vertices]
        nearest = np.linalg.norm(pair.target.body.vertices[vertices][:, None] - onto, axis=2).argmin(axis=1)
        maps.append(
            Candidate(iterative_closest_points(*pair.search_points, nearest[None], 8)[0], "extremities")
        )
    return pair, *maps


@pytest.mark.long
def test_flips_of_the_mirror_image_contain_the_true_map(known):
    pair, true, mirrored = known
    found = find_flips(pair, mirrored, [mirrored])
    assert min(distance_between(pair, h, true) for h in found) < 0.03
    assert all(distance_between(pair, h, mirrored) > 0.05 for h in found)
    assert all(h.alignment is not mirrored.alignment for h in found)
    assert {h.origin for h in found} == {mirrored.origin}


@pytest.mark.long
@pytest.mark.parametrize("origin", ["extremities", "initial map"])
def test_flips_are_new_whatever_is_known(known, origin):
    pair, true, mirrored = known
    winner = Candidate(mirrored.alignment, origin)
    everything = [winner, true, *find_flips(pair, winner, [winner, true])]
    assert len(everything) > 2
    assert find_flips(pair, winner, everything) == []
    for i, one in enumerate(everything):
        for other in everything[:i]:
            assert distance_between(pair, one, other) > 0.05


def test_a_map_of_the_search_vertices_survives_as_pairs(known):
    pair, true, _ = known
    pairs = search_pairs(pair, true.target_row)
    np.testing.assert_array_equal(start_from_pairs(pair, pairs), true.target_row)


@pytest.mark.long
def test_own_starts_and_a_users_are_of_one_kind(known):
    pair = known[0]

    def mine(pair):
        return starts_from_extremities(pair)

    defaults, users = (
        search(pair, [], [start, *default_starts[1:]]) for start in (starts_from_extremities, mine)
    )
    assert {h.origin for h in users} <= {"mine", "flip"}
    for one, other in zip(defaults, users, strict=True):
        np.testing.assert_array_equal(one.target_row, other.target_row)


def test_the_best_maps_are_flipped_unless_starts_or_priors_stand_alone(known):
    pair, true, mirrored = known

    def mine(pair):
        return [search_pairs(pair, mirrored.target_row)]

    flipped = search(pair, [], [mine, starts_from_poses])
    assert min(distance_between(pair, h, true) for h in flipped) < 0.03
    assert len(search(pair, [], [mine])) == len(search(pair, [mirrored], [])) == 1


def test_the_inverse_of_a_permutation_is_exact(known):
    shape = known[0].source
    pair = prepare_pair(shape, shape)
    order = np.random.default_rng(0).permutation(len(pair.source_vertices))
    np.testing.assert_array_equal(pair.inverted(order), np.argsort(order))
