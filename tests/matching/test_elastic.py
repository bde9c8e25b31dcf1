"""Shapes that are far from isometric: limbs of other lengths."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.correspondence import Embedding
from isomatch.datasets import creature, ground_truth
from isomatch.matching import Elastic, Fit, Hints, Isometry, ShapePair, prepare_pair, stages_of
from isomatch.matching.judge import bends_badly
from isomatch.matching.relations.elastic import far_from_isometric
from isomatch.matching.relations.elastic_fit import (
    N_PLAIN_STARTS,
    ElasticFit,
    ElasticShape,
    Step,
    anchor_starts,
    with_mirror,
)
from isomatch.settings import ElasticSettings
from isomatch_lab.sets import relabelled

pytestmark = pytest.mark.usefixtures("prepared_once")
NONE = np.zeros((0, 2), dtype=np.int64)


def other_species(made):
    """A creature in its rest pose with a tail and hind legs of twice the length and half the head."""
    _, y, z = made.rest.T
    forward = -np.maximum(-0.4 - y, 0) - 0.5 * np.maximum(y - 0.4, 0)
    up = -0.9 * np.maximum(0.45 - z, 0) * (y < 0)
    return Mesh(made.rest + np.column_stack([0 * y, forward, up]), made.mesh.faces)


@pytest.fixture(scope="module")
def animals():
    return [creature(2000, triangulation=i, symmetric=True) for i in (1, 2)]


@pytest.fixture(scope="module")
def species(animals):
    """Two shapes, prepared, and the true image of every vertex of the first."""
    target, new = relabelled(other_species(animals[1]), 0)
    return prepare(animals[0].mesh), prepare(target), new[ground_truth(*animals).vertices]


@pytest.fixture(scope="module")
def found(species):
    return match(*species[:2])


@pytest.fixture(scope="module")
def mirrored(species):
    """Both shapes with their mirror images."""
    return tuple(with_mirror(shape, Config()) for shape in species[:2])


def mean_error(shape, images, truth):
    return shape.mean_distance(shape.body_vertex[images], shape.body_vertex[truth])


def test_limbs_stretch(species, found):
    _, target, truth = species
    assert not np.isnan(found.quality.bend_misfit)
    assert any("far from isometric" in note for note in found.notes)
    assert mean_error(target, found.map.vertices, truth) < 0.07


def test_a_map_between_species_is_judged_by_how_much_the_shapes_are_bent(found):
    """A rival that is bent as little is a tie."""
    bounds, quality = Config().outcome, found.quality
    sure = quality.bend_misfit <= bounds.poor_bending and quality.residual <= bounds.poor_far_residual
    assert (found.outcome is Outcome.CONVERGED) == (sure and quality.rival >= bounds.look_tie)
    assert quality.rival >= 1
    strict = replace(bounds, poor_bending=0.5 * quality.bend_misfit)
    assert bends_badly(quality, strict)
    assert bends_badly(replace(quality, bend_misfit=np.nan), bounds)


@pytest.mark.long
def test_landmarks_lead_the_map(species):
    source, target, truth = species
    vertices = source.user_vertex[source.column_vertices[:5]]
    led = match(source, target, landmarks=np.column_stack([vertices, truth[vertices]]))
    assert led.quality.landmark_error < 0.06
    assert mean_error(target, led.map.vertices, truth) < 0.07


@pytest.mark.long
def test_a_result_given_back_does_not_become_worse(species, found):
    source, target, truth = species
    again = match(source, target, initial_map=found.map)
    before, after = (mean_error(target, result.map.vertices, truth) for result in (found, again))
    assert after < 1.02 * before + 0.001


@pytest.mark.long
@pytest.mark.parametrize("share", [1.0, 0.2])
def test_the_truth_given_does_not_end_worse_than_without_it(species, found, share):
    """Known everywhere, and on a connected fifth of the surface."""
    source, target, truth = species
    far = source.columns[0][source.body_vertex]
    known = np.where(far <= np.quantile(far, share), truth, -1)
    led = match(source, target, initial_map=known)
    before, after = (mean_error(target, result.map.vertices, truth) for result in (found, led))
    assert after < 1.02 * before + 0.001


@pytest.mark.long
def test_a_wrong_initial_map_does_not_win(species, found):
    source, target, truth = species
    wrong = np.random.default_rng(0).permutation(truth)
    led = match(source, target, initial_map=wrong)
    assert led.outcome is Outcome.HINTS_CONTRADICTED
    assert mean_error(target, led.map.vertices, truth) < 0.07


@pytest.mark.long
def test_the_score_is_the_stretch_and_the_gap_of_both_shapes_bent(species):
    """A shape on itself is not stretched; exchanged images are dear."""
    relation = Elastic().on(
        prepare_pair(species[0], species[0]), Hints.of(prepare_pair(species[0], species[0]), None, None, None)
    )
    own = relation.measured(Fit(relation.vertices), relation.vertices)
    assert own.score < 1e-4
    moved = relation.measured(own, np.roll(relation.vertices, 1))
    assert moved.score > 20 * own.score
    there, back = own.bent
    assert own.score == pytest.approx(np.sqrt(there.misfit * back.misfit))
    assert there.stretch < 0.02


def test_only_shapes_that_fit_badly_are_far_from_isometric(animals, species, found):
    pair = ShapePair(*species[:2], Config())
    none = Hints.of(pair, None, None, None)
    poor = replace(found.quality, misfit=0.9)

    def far(quality, pair=pair, hints=none):
        return far_from_isometric(Isometry().on(pair, hints, stages_of(pair)), quality)

    assert far(poor)
    good = replace(poor, misfit=0.4, residual=0.2, stretch=1.0)
    assert not far(good)
    assert far(replace(good, misfit=0.6))  # sooner than a map fits badly
    assert not far(
        replace(good, misfit=0.6), replace(pair, config=Config(elastic=ElasticSettings(sought=0.65)))
    )
    given = Hints.of(pair, None, species[2], None)
    assert far(poor, hints=given)
    known = Hints.of(pair, None, None, tuple(shape.signatures for shape in species[:2]))
    assert not far(poor, hints=known)
    for config in (Config(orientation="any"), Config(refinement="none"), Config(hypotheses="given")):
        assert not far(poor, replace(pair, config=config))


@pytest.mark.long
def test_a_map_that_fits_and_keeps_lengths_stays_what_it_was(animals):
    """Although one was sought that lets limbs stretch."""
    moved, _ = relabelled(creature(2000, pose=1, triangulation=3).mesh, 0)
    bodies = prepare(animals[0].mesh), prepare(moved)
    without = match(*bodies)
    sought = match(*bodies, config=Config(elastic=ElasticSettings(sought=0.0)))
    assert any(stage.startswith("elastic match") for stage in sought.timings)
    assert not any(stage.startswith("elastic match") for stage in without.timings)
    np.testing.assert_array_equal(sought.map.vertices, without.map.vertices)
    assert sought.outcome is without.outcome
    assert sought.notes == without.notes


def test_canonical_coordinates_keep_distances(species):
    shape = ElasticShape(species[0], replace(ElasticSettings(), n_coordinates=20))
    vertices = species[0].sample_vertices[:100]
    apart = np.linalg.norm(shape.canonical[vertices, None] - shape.canonical[vertices], axis=2)
    assert np.abs(apart - species[0].distances_between(vertices)).mean() < 0.1 * apart.mean()


@pytest.mark.long
def test_the_mirror_image_of_a_stretched_creature_is_found(animals, species, mirrored):
    _, new = relabelled(other_species(animals[1]), 0)
    there = new[ground_truth(animals[1], animals[1], mirrored=True).vertices][np.argsort(new)]
    shape = mirrored[1]
    found = species[1].index.vertices(shape.drawn, shape.mirrored)
    truth = species[1].body_vertex[there[species[1].user_vertex]]
    assert species[1].mean_distance(found, truth) < 0.08


def test_a_fit_from_the_identity_stays_there(species):
    shape = ElasticShape(species[0], ElasticSettings())
    samples = shape.sampled(400, True)
    signatures = Embedding(species[0].signatures, species[0].signatures)
    fit = ElasticFit(samples, samples, signatures, NONE)
    pairs = np.column_stack([samples.vertices, samples.vertices])
    step = Step(100, 0.0, 2, False)
    _, images = fit.run(fit.from_pairs(pairs, step), (step,))
    assert (images.forth == samples.vertices).mean() > 0.95
    assert (images.back == samples.vertices).mean() > 0.95
    assert images.orientation > 0.9


def test_starts_respect_landmarks(species):
    pair = prepare_pair(*species[:2])
    landmarks = np.column_stack([pair.source.column_vertices[:3], pair.target.column_vertices[[4, 2, 6]]])
    for start in anchor_starts(pair, landmarks):
        np.testing.assert_array_equal(start[:3], landmarks)


def test_legs_lie_aside_and_the_plane_of_symmetry_does_not(animals, mirrored):
    x = np.abs(animals[0].rest[mirrored[0].prepared.user_vertex, 0])
    aside = mirrored[0].aside
    assert np.median(aside[x < 0.02]) < 0.5 * np.median(aside[x > 0.12])


def test_mirror_images_lead_the_starts(species, mirrored):
    pair, n = prepare_pair(*species[:2]), ElasticSettings().n_starts

    def difference(starts):
        source, target = (shape.aside / shape.prepared.intrinsic_scale for shape in mirrored)
        return np.mean([np.abs(source[start[:, 0]] - target[start[:, 1]]).mean() for start in starts])

    led, plain = anchor_starts(pair, NONE, mirrored), anchor_starts(pair, NONE)
    assert len(led) == n + N_PLAIN_STARTS
    np.testing.assert_array_equal(led[n:], plain[:N_PLAIN_STARTS])
    assert difference(led[:n]) < 0.7 * difference(plain)
    one_sided = mirrored[0], replace(mirrored[1], mirrored=None)
    np.testing.assert_array_equal(anchor_starts(pair, NONE, one_sided), plain)
