"""Exchange of regions: exchanged limbs come back from a map that has them right, and nothing else moves."""

import numpy as np
import pytest

from isomatch import geodesic_distances
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import prepare_pair
from isomatch.matching.isometric.both_sides import exchange_regions
from isomatch.matching.verify import Verifier, on_bodies

pytestmark = pytest.mark.usefixtures("prepared_once")
LIMB = 0.25  # √area, length of the limbs that are exchanged


@pytest.fixture(scope="module")
def prepared(prepared_once):
    """A pair, and its true map between the bodies."""
    source, target = example_pair()
    pair = prepare_pair(source.mesh, target.mesh)
    return pair, on_bodies(pair, ground_truth(source, target).vertices)


def with_limbs(pair, true, *ends):
    """Send each limb of the source to the next one's place, by the distances of its vertices from its end."""
    mesh, tips = pair.source.mesh_body, pair.source.extremities[list(ends)]
    columns = np.asarray(geodesic_distances(mesh, tips)).reshape(len(tips), -1) / np.sqrt(mesh.area)
    limbs = [np.flatnonzero(column < LIMB)[np.argsort(column[column < LIMB])] for column in columns]
    wrong = true.copy()
    for limb, next_limb in zip(limbs, [*limbs[1:], limbs[0]]):
        wrong[limb] = true[next_limb[np.linspace(0, len(next_limb) - 1, len(limb)).astype(int)]]
    return wrong


def error(pair, image, true):
    return float(pair.target.distance(image, true).mean())


def test_exchanged_limbs_come_back(prepared):
    pair, true = prepared
    wrong = with_limbs(pair, true, 0, 1)
    cost = Verifier(pair)(wrong).cost
    mended = exchange_regions(pair, wrong, cost, [true])
    assert error(pair, wrong, true) > 0.05
    assert error(pair, mended, true) < 0.3 * error(pair, wrong, true)
    assert Verifier(pair)(mended).cost < cost


def test_a_right_map_keeps_its_limbs(prepared):
    pair, true = prepared
    others = [with_limbs(pair, true, 0, 1), with_limbs(pair, true, 1, 2)]
    assert exchange_regions(pair, true, Verifier(pair)(true).cost, others) is None
    assert exchange_regions(pair, true, Verifier(pair)(true).cost, []) is None


def test_two_limbs_sent_to_one_leave_the_other_without_support(prepared):
    """All of the source has images, but not all of the target is an image."""
    pair, true = prepared
    mesh, first = pair.source.mesh_body, pair.source.extremities[0]
    swapped, doubled = with_limbs(pair, true, 0, 1), true.copy()
    moved = np.asarray(geodesic_distances(mesh, [first]))[0] < LIMB * np.sqrt(mesh.area)
    doubled[moved] = swapped[moved]
    found = Verifier(pair)(doubled)
    assert found.support < 0.97 < Verifier(pair)(true).support
    assert found.cost > 1.5 * Verifier(pair)(true).cost
