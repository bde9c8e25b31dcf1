"""Half-turned and mirrored maps lead to the right one."""

import numpy as np
import pytest

from isomatch.datasets import creature, ground_truth
from isomatch.matching.hypotheses import Hypothesis, converged, twins
from isomatch.matching.pair import prepared_pair


@pytest.fixture(scope="module")
def known():
    """A pair of symmetric bipeds, its true map and its mirror image, after iterative closest points."""
    source, target = (creature(2000, kind="biped", symmetric=True, pose=i, triangulation=i) for i in (1, 2))
    pair, _ = prepared_pair(source.mesh, target.mesh, None, 0)
    maps = []
    for mirrored in (False, True):
        vertices = ground_truth(source, target, mirrored=mirrored).vertices[pair.source.rows]
        onto = pair.target.shape.body.vertices[pair.target.rows]
        nearest = np.linalg.norm(pair.target.shape.body.vertices[vertices][:, None] - onto, axis=2).argmin(
            axis=1
        )
        maps.append(Hypothesis(converged(pair, nearest), "features"))
    return pair, *maps


def test_twins_of_the_mirror_image_contain_the_true_map(known):
    pair, true, mirrored = known
    found = twins(pair, mirrored, [mirrored])
    assert min(pair.difference(h.alignment.image, true.alignment.image) for h in found) < 0.03
    assert all(pair.difference(h.alignment.image, mirrored.alignment.image) > 0.05 for h in found)
    assert all(h.alignment is not mirrored.alignment for h in found)


@pytest.mark.parametrize("origin", ["features", "initial map"])
def test_twins_are_new_whatever_is_known(known, origin):
    pair, true, mirrored = known
    winner = Hypothesis(mirrored.alignment, origin)
    everything = [winner, true, *twins(pair, winner, [winner, true])]
    assert len(everything) > 3
    assert twins(pair, winner, everything) == []
    for i, one in enumerate(everything):
        for other in everything[:i]:
            assert pair.difference(one.alignment.image, other.alignment.image) > 0.05


def test_what_was_flipped_is_not_flipped_again(known):
    pair, true, _ = known
    assert twins(pair, Hypothesis(true.alignment, "features", flipped=True), [true]) == []
