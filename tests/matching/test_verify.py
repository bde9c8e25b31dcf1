"""One verification: the same map costs the same, however its shapes are numbered, placed, wound or ordered."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from isomatch import MapError, Mesh, MeshError, PointCloud, prepare, verify
from isomatch.datasets import example_pair, ground_truth
from isomatch_lab.damage import cut
from shapes import disguised, inside_out

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def shapes():
    """Two poses of an animal, the true map, and that back."""
    source, target = example_pair()
    return (
        source.mesh,
        target.mesh,
        ground_truth(source, target).vertices,
        ground_truth(target, source).vertices,
    )


@pytest.fixture(scope="module")
def right(shapes):
    return verify(*shapes[:3])


def test_a_right_map_costs_less_than_wrong_ones(shapes, right):
    source, target, truth, _ = shapes
    rng = np.random.default_rng(0)
    noisy = np.where(rng.random(len(truth)) < 0.2, rng.permutation(truth), truth)
    mirrored = cKDTree(target.vertices * [1, -1, 1]).query(target.vertices[truth])[1]
    costs = [verify(source, target, image).cost for image in (noisy, mirrored)]
    assert right.cost < min(costs) / 2
    assert right.support == right.unit == 1.0


def test_numbers_place_and_size_change_nothing(shapes, right):
    source, target, truth, _ = shapes
    other = disguised(target, 1, scale=30.0)
    found = verify(source, other.mesh, other.new_vertex[truth])
    assert found.cost == pytest.approx(right.cost, rel=0.03)
    assert found.descriptor_distance == pytest.approx(right.descriptor_distance, rel=0.01)


@pytest.mark.long
def test_turning_both_over_changes_nothing(shapes, right):
    source, target, truth, _ = shapes
    assert verify(inside_out(source), inside_out(target), truth).cost == pytest.approx(right.cost, rel=0.03)


def test_the_inverse_map_costs_the_same(shapes, right):
    source, target, _, back = shapes
    found = verify(target, source, back)
    assert found.cost == pytest.approx(right.cost, rel=0.03)
    assert found.bending == pytest.approx(right.bending_back, rel=0.05)


def test_a_part_is_measured_where_it_has_images(shapes, right):
    source, target, truth, back = shapes
    part = cut(source, 0.4, seed=1)
    found = verify(part.mesh, target, truth[part.original])
    whole_to_part = part.damaged_vertex[back]
    inverse = verify(target, part.mesh, whole_to_part)
    assert found.support == pytest.approx(1.0, abs=0.01)
    assert found.unit == pytest.approx(np.sqrt(part.mesh.area / source.area), rel=0.05)
    assert inverse.support == pytest.approx(found.support, abs=0.03)
    assert inverse.unit == pytest.approx(1 / found.unit, rel=0.05)
    assert 0.4 < inverse.cost / found.cost < 2.5
    assert found.cost < 3 * right.cost


@pytest.mark.long
def test_prepared_shapes_and_correspondences_are_taken(shapes, right):
    source, target, truth, _ = shapes
    one, other = prepare(source), prepare(target)
    found = verify(one, other, one.correspondence(other, truth))
    assert found.cost == right.cost


def test_a_map_without_images_costs_more_than_any(shapes):
    source, target, truth, _ = shapes
    assert verify(source, target, np.full(len(truth), -1)).cost == np.inf


def test_what_cannot_be_verified_is_refused(shapes):
    source, target, truth, _ = shapes
    with pytest.raises(MeshError, match="triangles"):
        verify(PointCloud(source.vertices), target, truth)
    with pytest.raises(MapError):
        verify(source, target, truth[1:])
    with pytest.raises(MapError):
        verify(Mesh(source.vertices, source.faces), target, truth + target.n_vertices)
