"""Regions of doubt: exactly where another map differs or surfaces look unlike, in any order of vertices, and in files."""

import json
from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, FormatError, MatchResult, Mesh, Outcome, match, prepare
from isomatch.cli.results import say_result
from isomatch.datasets import ground_truth
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching import DoubtfulRegion, outcome_of, prepare_pair
from isomatch.matching.assessment.confidence import (
    ANOTHER_MAP,
    UNLIKE_ITS_IMAGE,
    doubt_in,
    lift_regions,
    regions_of_doubt,
)
from isomatch.matching.assessment.evidence import region_evidence
from isomatch_lab.procedural import creature
from shapes import icosphere

FORELEGS = 0.4  # height, in the rest pose, below which there are legs only


@pytest.fixture(scope="module")
def animal():
    return creature(2000, pose={}, symmetric=True)


@pytest.fixture(scope="module")
def pair(animal):
    shape = prepare(animal.mesh)
    return prepare_pair(shape, shape)


@pytest.fixture(scope="module")
def exchanged(animal, pair):
    """The identity of the refinement vertices, and a map that exchanges the forelegs."""
    mirrored = ground_truth(animal, animal, mirrored=True).vertices
    forelegs = (animal.rest[:, 1] > 0) & (animal.rest[:, 2] < FORELEGS)
    runner_up = np.where(forelegs, mirrored, np.arange(len(mirrored)))
    source = pair.source
    rows = pair.refinement_vertices
    return rows, source.body_vertex[runner_up[source.user_vertex[rows]]]


def ellipsoid():
    """Three half turns map it onto itself."""
    sphere = icosphere(3)
    return Mesh(sphere.vertices * [1.0, 2.0, 0.6], sphere.faces)


@pytest.fixture(scope="module")
def result():
    """A quick match of an ellipsoid."""
    quick = Config(n_columns=40, rank=20, n_functions=60, n_search=100, n_refine=120)
    return match(ellipsoid(), ellipsoid(), config=quick)


def patches(pair, *middles, radius=0.2):
    """Vertices of the source's body near some of its extremities, one array for each."""
    at = pair.source.extremities[list(middles)]
    return [
        np.flatnonzero(distance_along_edges_to_nearest(pair.source.body, at[[i]])[0] < radius)
        for i in range(len(at))
    ]


def unlike_in(pair, *parts, value=2.0):
    descriptor_distance = np.zeros(pair.source.body.n_vertices)
    for part in parts:
        descriptor_distance[part] = value
    return descriptor_distance


@pytest.mark.long
def test_a_runner_up_that_exchanges_two_limbs_gives_these(animal, pair, exchanged):
    image, runner_up = exchanged
    regions = regions_of_doubt(pair, tied_images=exchanged)
    assert [region.reason for region in regions] == [ANOTHER_MAP] * 2
    differs = pair.target.distance(image, runner_up) > pair.config.selection.runner_up_distance
    inside = np.concatenate([region.vertices for region in regions])
    np.testing.assert_array_equal(np.sort(image[differs]), np.sort(np.intersect1d(inside, image)))
    image_of = dict(zip(image, runner_up))
    sides = []
    for region in regions:
        x, y, z = animal.rest[pair.source.user_vertex[region.vertices]].T
        assert len(set(np.sign(x))) == 1, "a region is one leg"
        assert y.min() > 0
        assert z.max() < FORELEGS + 0.05
        positions = animal.rest[pair.target.user_vertex[region.runner_up]]
        assert (np.sign(positions[:, 0]) == -np.sign(x)).all(), "the runner-up sends it to the other one"
        assert all(image_of[v] == r for v, r in zip(region.vertices, region.runner_up) if v in image_of)
        sides.append(np.sign(x[0]))
    assert sorted(sides) == [-1, 1]
    assert regions[0].area == pytest.approx(regions[1].area, rel=0.2)


def test_where_nothing_differs_nothing_is_doubtful(pair, exchanged):
    image, _ = exchanged
    nothing_known = np.full(pair.source.body.n_vertices, np.nan)
    assert regions_of_doubt(pair) == ()
    for descriptor_distance in (None, unlike_in(pair), unlike_in(pair, slice(None)), nothing_known):
        assert regions_of_doubt(pair, descriptor_distance, (image, image)) == ()


def test_areas_sum_to_what_is_doubtful(pair):
    areas = pair.source.body.vertex_areas / pair.source.body.area
    first, second = patches(pair, 0, 1)
    assert not set(first) & set(second)
    regions = regions_of_doubt(pair, unlike_in(pair, first, second))
    assert len(regions) == 2
    assert regions[0].area >= regions[1].area, "the largest first"
    for region in regions:
        assert region.area == pytest.approx(areas[region.vertices].sum())
        assert region.reason == UNLIKE_ITS_IMAGE
        assert region.runner_up is None
        assert max(np.isin(region.vertices, part).mean() for part in (first, second)) > 0.8


def test_single_vertices_that_look_unlike_are_no_region(pair):
    scattered = np.arange(0, pair.source.body.n_vertices, 10)
    assert regions_of_doubt(pair, unlike_in(pair, scattered)) == ()


def test_what_is_not_known_does_not_count(pair):
    (part,) = patches(pair, 0)
    descriptor_distance = unlike_in(pair, part)
    (region,) = regions_of_doubt(pair, descriptor_distance)
    hidden = np.where(
        np.isin(np.arange(len(descriptor_distance)), region.vertices), np.nan, descriptor_distance
    )
    assert regions_of_doubt(pair, hidden) == ()


def test_two_reasons_for_one_region(animal, pair, exchanged):
    region = regions_of_doubt(pair, tied_images=exchanged)[0]
    both = regions_of_doubt(pair, unlike_in(pair, region.vertices), exchanged)
    assert sorted(region.reason for region in both) == sorted(
        [ANOTHER_MAP, f"{ANOTHER_MAP} and {UNLIKE_ITS_IMAGE}"]
    )
    assert all(region.runner_up is not None for region in both)


def test_vertices_in_another_order_give_the_same_regions(animal, pair):
    n = animal.mesh.n_vertices
    new_place = np.random.default_rng(0).permutation(n)
    vertices = np.empty_like(animal.mesh.vertices)
    vertices[new_place] = animal.mesh.vertices
    shape = prepare(Mesh(vertices, new_place[animal.mesh.faces]))
    permuted = prepare_pair(shape, shape)
    descriptor_distance = np.zeros(n)
    descriptor_distance[pair.source.user_vertex[np.concatenate(patches(pair, 0, 2))]] = 2.0
    moved = np.zeros(n)
    moved[new_place] = descriptor_distance
    ours, theirs = (
        lift_regions(
            regions_of_doubt(problem, problem.source.restrict(values)), problem.source, problem.target
        )
        for problem, values in ((pair, descriptor_distance), (permuted, moved))
    )
    assert len(ours) == len(theirs) == 2
    for one, other in zip(ours, theirs):
        assert set(new_place[one.vertices]) == set(other.vertices)
        assert one.area == pytest.approx(other.area)
        assert other.vertices[0] == new_place[one.vertices[0]], "the most doubtful one is first"


@pytest.mark.parametrize(
    ("area", "reason", "outcome"),
    [
        (0.019, UNLIKE_ITS_IMAGE, Outcome.CONVERGED),
        (0.021, UNLIKE_ITS_IMAGE, Outcome.LOW_CONFIDENCE),
        (0.021, ANOTHER_MAP, Outcome.SYMMETRY_AMBIGUOUS),
        (0.021, f"{ANOTHER_MAP} and {UNLIKE_ITS_IMAGE}", Outcome.LOW_CONFIDENCE),
    ],
)
def test_the_outcome_speaks_of_regions(area, reason, outcome):
    region = DoubtfulRegion(np.array([3, 4]), area, reason)
    assert outcome_of([region_evidence([region], 0.02)]) is outcome


@pytest.mark.long
def test_a_symmetric_shape_is_doubtful_nearly_everywhere():
    result = match(ellipsoid(), ellipsoid())
    assert result.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert result.regions
    assert all(ANOTHER_MAP in region.reason for region in result.regions)
    assert 0.8 < sum(region.area for region in result.regions) < 1.001


@pytest.mark.long
def test_a_limb_that_another_one_has_replaced_is_doubtful():
    """The head of one shape is swollen to a ball: the map is right, but there is no telling."""
    source, target = (creature(2000, pose=pose, triangulation=pose) for pose in (0, 1))
    head = target.rest[:, 1] > np.quantile(target.rest[:, 1], 0.93)
    middle = target.mesh.vertices[head].mean(axis=0)
    away = target.mesh.vertices - middle
    radius = np.linalg.norm(away, axis=1, keepdims=True)
    ball = middle + away * np.where(head[:, None], 0.25 / np.maximum(radius, 1e-9), 1.0)
    found = match(source.mesh, Mesh(ball, target.mesh.faces))
    assert found.outcome is Outcome.LOW_CONFIDENCE
    assert any(UNLIKE_ITS_IMAGE in region.reason for region in found.regions)
    plain = match(source.mesh, target.mesh)
    assert (plain.outcome, plain.regions) == (Outcome.CONVERGED, ())
    inside = found.regions[0].vertices
    outside = np.setdiff1d(np.arange(source.mesh.n_vertices), inside)
    assert found.expected_error[inside].mean() > 3 * found.expected_error[outside].mean()


def test_an_error_is_expected_where_surfaces_look_unlike():
    unlike, runner_up = (
        DoubtfulRegion(np.array([i]), 0.1, why) for i, why in enumerate((UNLIKE_ITS_IMAGE, ANOTHER_MAP))
    )
    doubt = doubt_in([unlike, runner_up], 3)
    assert doubt[0] == pytest.approx(0.5 * np.sqrt(0.1)), "half of the width of the region"
    assert not doubt[1:].any(), "what a runner-up means is counted by its distance"


def assert_same(ours, theirs):
    assert [(r.area, r.reason) for r in ours] == [(r.area, r.reason) for r in theirs]
    for one, other in zip(ours, theirs):
        np.testing.assert_array_equal(one.vertices, other.vertices)
        assert (one.runner_up is None) == (other.runner_up is None)
        if one.runner_up is not None:
            np.testing.assert_array_equal(one.runner_up, other.runner_up)


@pytest.fixture
def saved(result, tmp_path):
    """A file of a result with a region of each kind."""
    unlike = DoubtfulRegion(np.array([5, 1]), 0.01, UNLIKE_ITS_IMAGE)
    mixed = replace(result, regions=(*result.regions, unlike))
    mixed.save(tmp_path / "result.npz")
    return tmp_path / "result.npz", mixed


@pytest.mark.long
def test_regions_in_files(saved, result):
    path, mixed = saved
    assert_same(MatchResult.load(path).regions, mixed.regions)
    replace(result, regions=()).save(path)
    assert MatchResult.load(path).regions == ()


def test_files_of_earlier_versions(saved):
    path, mixed = saved
    with np.load(path) as stored:
        arrays = {name: values for name, values in stored.items() if not name.startswith("region_")}
    about = json.loads(str(arrays["about"]))
    del about["regions"]
    np.savez(path, **{**arrays, "about": json.dumps(about)})
    old = MatchResult.load(path)
    assert (old.regions, old.outcome) == ((), mixed.outcome)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("region_vertices", 10**6, "region_vertices has entries outside"),
        ("region_sizes", 0, "regions that end at"),
        ("region_sizes", 10**6, "regions that end at"),
    ],
)
def test_regions_that_a_shape_does_not_have(saved, name, value, message):
    path, _ = saved
    with np.load(path) as stored:
        arrays = dict(stored)
    arrays[name][0] = value
    np.savez(path, **arrays)
    with pytest.raises(FormatError, match=message):
        MatchResult.load(path)


def test_regions_in_json(saved):
    _, mixed = saved
    summary = json.loads(json.dumps(mixed.to_dict()))
    restored = MatchResult.from_dict(summary, mixed.map, mixed.config)
    assert [(r.area, r.reason) for r in restored.regions] == [(r.area, r.reason) for r in mixed.regions]
    assert [r.vertices.tolist() for r in restored.regions] == [r.vertices[:1].tolist() for r in mixed.regions]
    assert restored.to_dict()["regions"][0]["vertex"] == mixed.regions[0].vertices[0]
    del summary["regions"]
    assert MatchResult.from_dict(summary, mixed.map, mixed.config).regions == ()


@pytest.mark.usefixtures("small_pictures")
def test_regions_are_told(saved, capsys):
    _, mixed = saved
    sentence = "1.0% of the area around vertex 5: it looks unlike its image"
    assert sentence in mixed._repr_html_()
    say_result(mixed, details=True)
    assert f"doubtful: {sentence}" in capsys.readouterr().out
