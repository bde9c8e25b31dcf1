"""The expected error of each vertex: none for the identity, much where a map is wrong, about right elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Graph, Mesh, PointCloud, match
from isomatch.correspondence import PrecisePoints
from isomatch.datasets import ground_truth
from isomatch.evaluation import geodesic_errors
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching import expected_errors, prepare_pair
from isomatch.matching.assessment.confidence import doubt_of
from isomatch_lab.baselines import BASELINES
from isomatch_lab.damage import cut
from shapes import icosphere
from zoo.made import moved, together


@pytest.fixture(scope="module")
def pair(prepared_example):
    return prepare_pair(*prepared_example)


@pytest.fixture(scope="module")
def result(prepared_example):
    return match(*prepared_example)


@pytest.fixture(scope="module")
def onto_itself(prepared_example):
    return prepare_pair(prepared_example[0], prepared_example[0])


def disturbed(pair, turn):
    """The identity, but that a patch is turned about its middle by an angle; and the patch."""
    mesh = pair.source.mesh_body
    middle = pair.source.extremities[0]
    gap, _ = distance_along_edges_to_nearest(mesh, np.array([middle]))
    patch = np.flatnonzero(gap < 0.15)
    image = np.arange(mesh.n_vertices)
    around = mesh.vertices[patch] - mesh.vertices[middle]
    axis = mesh.vertex_normals[middle]
    turned = (
        around * np.cos(turn)
        + np.cross(axis, around) * np.sin(turn)
        + np.outer(around @ axis, axis) * (1 - np.cos(turn))
    )
    distances = np.linalg.norm(around[None] - turned[:, None], axis=2)
    image[patch] = patch[distances.argmin(axis=1)]
    return PrecisePoints.at_vertices(image), patch


def test_the_identity_has_no_expected_error(onto_itself):
    identity = PrecisePoints.at_vertices(np.arange(onto_itself.source.body.n_vertices))
    assert expected_errors(onto_itself, identity).max() < 1e-3


def test_a_patch_mapped_wrongly_is_what_is_trusted_least(onto_itself):
    everywhere = np.arange(onto_itself.source.body.n_vertices)
    means = []
    for turn in (0.5, 1.0, 2.0):
        points, patch = disturbed(onto_itself, turn)
        errors = expected_errors(onto_itself, points)
        least = np.argsort(-errors)[: len(patch)]
        assert np.isin(least, patch).mean() > 0.6
        assert errors[patch].mean() > 4 * errors[np.setdiff1d(everywhere, patch)].mean()
        means.append(errors[patch].mean())
    assert means == sorted(means)


@pytest.mark.long
def test_the_vertices_trusted_least_contain_half_of_the_error_of_the_worst(example, prepared_example):
    """On a shape whose limbs grew by up to 45 %."""
    source, target = (made.mesh for made in example)
    centre = np.average(target.vertices, axis=0, weights=target.vertex_areas)
    radius = np.linalg.norm(target.vertices - centre, axis=1, keepdims=True)
    grown = Mesh(
        centre + (target.vertices - centre) * (1 + 0.45 * (radius / radius.max()) ** 1.5), target.faces
    )
    found = match(prepared_example[0], grown)
    rows = np.arange(0, source.n_vertices, 6)
    errors = geodesic_errors(grown, found.map, np.column_stack([rows, ground_truth(*example).vertices[rows]]))
    worst = len(rows) // 10
    least_trusted = np.argsort(-found.expected_error[rows])[:worst]
    assert errors[least_trusted].sum() > 0.5 * np.sort(errors)[-worst:].sum()
    assert 0.5 < found.expected_error[rows].mean() / errors.mean() < 2


def test_a_runner_up_casts_doubt_where_it_differs(pair):
    rows = pair.refinement_vertices
    image = pair.target.sample_vertices[np.arange(len(rows)) % len(pair.target.sample_vertices)]
    runner_up = image.copy()
    runner_up[:5] = np.roll(image[:5], 1)
    distance = pair.target.distances.distance(image[:5], runner_up[:5])
    tied = doubt_of(pair, image, runner_up, 1.0)
    np.testing.assert_allclose(tied[rows[:5]], np.maximum(distance, 0) / 2)
    assert not tied[rows[5:]].any()
    clear, better, none = (doubt_of(pair, image, runner_up, ratio) for ratio in (2.0, 0.5, np.inf))
    assert clear.max() < 0.01 * tied.max()
    np.testing.assert_allclose(better, 2 * tied, rtol=1e-3)
    assert not none.any()


@pytest.mark.long
def test_confidence_is_one_half_at_a_twentieth(result):
    known = replace(result, expected_error=np.array([0.0, 0.05, 0.45, np.nan]))
    np.testing.assert_allclose(known.confidence, [1.0, 0.5, 0.1, np.nan])
    described = known.to_dict()["expected_error"]
    np.testing.assert_allclose([described["mean"], described["below_half"]], [0.5 / 3, 1 / 3])
    nothing = replace(result, expected_error=np.full(4, np.nan)).to_dict()["expected_error"]
    assert set(nothing.values()) == {None}


def assert_known_where_matched(found):
    np.testing.assert_array_equal(np.isfinite(found.expected_error), found.map.matched)
    assert (found.expected_error[found.map.matched] >= 0).all()


@pytest.mark.long
def test_of_a_part_the_error_is_known_where_it_is_matched(example, prepared_example):
    found = match(prepared_example[0], cut(example[1].mesh, 0.3, seed=1).mesh)
    assert "the target was matched as a part" in found.notes[-1]
    assert_known_where_matched(found)
    assert 0.001 < np.nanmean(found.expected_error) < 0.1


@pytest.mark.long
def test_of_points_and_components(example, prepared_example):
    source, target = (made.mesh for made in example)
    with_balls = [
        together(mesh, moved(icosphere(3), mesh.vertices.max(axis=0), 0.1)) for mesh in (source, target)
    ]
    for found in (match(*with_balls), match(PointCloud(source.vertices), prepared_example[1])):
        assert_known_where_matched(found)
        assert np.isfinite(found.expected_error).all()


@pytest.mark.long
@pytest.mark.parametrize("name", ["functional_maps", "zoomout", "gmds"])
def test_of_baselines_and_graphs(example, name):
    source, target = (made.mesh for made in example)
    rows = np.arange(0, source.n_vertices, 300)
    landmarks = np.column_stack([rows, ground_truth(*example).vertices[rows]])
    assert_known_where_matched(BASELINES[name].function(source, target, landmarks=landmarks))
    graph = Graph(source.n_vertices, source.edges, source.edge_lengths)
    assert_known_where_matched(match(graph, target))


@pytest.mark.long
def test_errors_at_a_coarse_level_are_interpolated(prepared_example, example):
    config = prepared_example[0].requested
    coarse = replace(config, levels=replace(config.levels, matched=1000, polished=2000))
    found = match(example[0].mesh, example[1].mesh, config=coarse)
    assert_known_where_matched(found)
    assert len(np.unique(found.expected_error)) > 2000
