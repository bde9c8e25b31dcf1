"""Shapes without limbs: every one gets a map, and symmetric ones are called ambiguous."""

import numpy as np
import pytest

from isomatch import Config, Graph, Outcome, PointCloud, SettingError, match, prepare
from isomatch.matching import prepare_pair
from isomatch.matching.proposals.starts import relax_spectrally, start_from_pairs, starts_from_anchors
from isomatch_lab.procedural import organ, organ_truth
from isomatch_lab.sets import relabelled
from shapes import box, cylinder, disguised, flat_grid, icosphere
from zoo.made import mobius_strip

pytestmark = pytest.mark.usefixtures("prepared_once")


def organ_pair(kind, symmetry="none", n=1500):
    source, target = (organ(kind, n, symmetry=symmetry, pose=pose) for pose in (1, 2))
    mesh, new = relabelled(target.mesh, 0)
    return source.mesh, mesh, new[organ_truth(source, target).vertices]


def error(target, found, truth):
    whole = prepare(target)
    return whole.mean_distance(whole.body_vertex[found.map.vertices], whole.body_vertex[truth])


@pytest.mark.long
@pytest.mark.parametrize("kind", ["kidney", "face"])
def test_organs_are_matched(kind):
    source, target, truth = organ_pair(kind)
    found = match(source, target)
    assert found.outcome is Outcome.CONVERGED
    assert error(target, found, truth) < 0.05


@pytest.mark.long
def test_half_a_turn_of_an_organ_is_found():
    source, target, _ = organ_pair("kidney", "turn")
    found = match(source, target)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert all("rotation" in words for words in found.symmetries)


@pytest.mark.long
@pytest.mark.parametrize("mesh", [icosphere(2), cylinder(12, 10), mobius_strip(40, 6), flat_grid(7, 8)])
def test_small_symmetric_surfaces_get_a_map_that_is_not_called_right(mesh):
    found = match(mesh, disguised(mesh, seed=1).mesh)
    assert found.map.matched.all()
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS


@pytest.mark.long
def test_shapes_that_have_nothing_in_common_get_a_poor_map():
    assert match(icosphere(3), box(2, 3, 30)).outcome is Outcome.LOW_CONFIDENCE


def test_one_of_the_starts_of_a_copy_is_the_identity():
    mesh = organ("kidney", 1500, pose=1).mesh
    pair = prepare_pair(mesh, mesh)
    rows = np.arange(len(pair.source_vertices))
    starts = [start_from_pairs(pair, pairs) for pairs in starts_from_anchors(pair)]
    distances = pair.distances_between_maps(rows, starts)
    assert distances.min() < 0.03
    np.testing.assert_array_equal(relax_spectrally(pair, rows), rows)


@pytest.mark.long
def test_the_pose_decides_where_the_shape_does_not():
    mesh = icosphere(3)
    found = match(mesh, mesh, config=Config(start="pose", hypotheses="given"))
    assert found.origin == "pose"
    assert (found.map.vertices == np.arange(mesh.n_vertices)).all()


@pytest.mark.long
def test_the_pose_is_one_hypothesis_among_others():
    source, target, truth = organ_pair("kidney")
    found = match(source, target, config=Config(start="pose"))
    assert error(target, found, truth) < 0.05, "the target is turned, so the pose misleads"


@pytest.mark.long
def test_points_have_a_pose_and_graphs_have_none():
    cloud = PointCloud(icosphere(3).vertices * [1.5, 1, 0.7])
    config = Config(start="pose", hypotheses="given")
    assert match(cloud, cloud, config=config).origin == "pose"
    grid = flat_grid(12, 12)
    graph = Graph(grid.n_vertices, grid.edges, np.ones(len(grid.edges)))
    with pytest.raises(SettingError, match="a graph has no positions"):
        match(graph, graph, config=config)
