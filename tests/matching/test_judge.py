"""A map of any tool is judged: kinds of wrong maps are told from right ones, and from rough ones."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from isomatch import MapError, Mesh, geodesic_distances, judge, verify
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import prepare_pair
from shapes import icosphere

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def judged(prepared_once):
    """Give what judges a map of the pair by the truth, the truth, and distances from the ends of two limbs, in √area."""
    source, target = example_pair()
    pair = prepare_pair(source.mesh, target.mesh)
    true = ground_truth(source, target).vertices
    ends = geodesic_distances(source.mesh, pair.source.user_vertex[pair.source.extremities[:2]])
    return (
        lambda map_: judge(pair.source, pair.target, map_, reference=true),
        true,
        ends / np.sqrt(source.mesh.area),
        (pair.source, pair.target),
    )


def test_the_reference_itself_is_right(judged):
    by_truth, true, _, _ = judged
    found = by_truth(true)
    assert (found.verdict, found.ratio, found.elsewhere, found.regions) == ("right", 1.0, 0.0, ())
    assert (found.distance == 0).all()


def test_random_images_are_wrong_and_their_share_is_told(judged):
    by_truth, true, _, _ = judged
    rng = np.random.default_rng(0)
    third = rng.permutation(len(true))[: len(true) // 3]
    spoiled = true.copy()
    spoiled[third] = rng.permutation(true)[third]
    found = by_truth(spoiled)
    assert found.verdict == "wrong"
    assert found.elsewhere == pytest.approx(1 / 3, abs=0.08)


def test_a_half_turn_of_an_ellipsoid_exchanges_sides_and_costs_as_much(judged):
    sphere = icosphere(3)
    ellipsoid = Mesh(sphere.vertices * [1.0, 2.0, 0.6], sphere.faces)
    turned = cKDTree(ellipsoid.vertices).query(ellipsoid.vertices * [-1, -1, 1])[1]
    found = judge(ellipsoid, ellipsoid, turned, reference=np.arange(len(turned)))
    assert found.verdict == "doubtful"
    assert "exchanges sides" in str(found)
    by_truth, true, _, _ = judged
    assert "exchanges sides" not in str(by_truth(np.random.default_rng(1).permutation(true)))


def test_nearest_points_in_space_are_wrong(judged):
    by_truth, _, _, shapes = judged
    source, target = (x.surface.vertices - x.surface.vertices.mean(axis=0) for x in shapes)
    assert by_truth(cKDTree(target).query(source @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]])[1]).verdict == "wrong"


def test_two_limbs_on_one_are_wrong_and_the_limb_is_named(judged):
    by_truth, true, ends, _ = judged
    one, two = (np.flatnonzero(end < 0.25)[np.argsort(end[end < 0.25])] for end in ends)
    doubled = true.copy()
    doubled[one] = true[two[np.linspace(0, len(two) - 1, len(one)).astype(int)]]
    found = by_truth(doubled)
    assert found.verdict == "wrong"
    assert np.isin(found.regions[0].vertices, one).mean() > 0.9
    assert (found.regions[0].runner_up == true[found.regions[0].vertices]).all()


def test_a_coarse_map_that_is_right_is_called_so(judged):
    by_truth, true, _, (source, _) = judged
    samples = np.random.default_rng(0).permutation(len(true))[:300]
    nearest = np.argmin(geodesic_distances(source.surface, samples), axis=0)
    found = by_truth(true[samples[nearest]])
    assert found.verdict == "right"
    assert "coarse" in found.sentence


def test_a_map_that_leaves_much_out_is_no_right_one(judged):
    by_truth, true, ends, _ = judged
    assert by_truth(np.where(ends[0] < ends[1], true, -1)).verdict == "wrong"


def test_maps_are_files_too_and_have_to_fit(judged, tmp_path):
    _, true, _, shapes = judged
    np.savetxt(tmp_path / "true.txt", true, fmt="%d")
    by_file = judge(*shapes, tmp_path / "true.txt", reference=str(tmp_path / "true.txt"))
    assert str(by_file).startswith(
        "right: it agrees with the reference on 100.0% of the surface, and costs as much"
    )
    assert f"cost={verify(*shapes, tmp_path / 'true.txt').cost:.4g}" in repr(by_file.given)
    with pytest.raises(MapError, match="expected one integer target vertex"):
        judge(*shapes, true[:-1], reference=true)
