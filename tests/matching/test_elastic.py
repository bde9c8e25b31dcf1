"""Shapes that are far from isometric: limbs of other lengths."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.datasets import ground_truth
from isomatch.matching import Elastic, Fit, prepare_pair
from isomatch.matching.assessment.evidence import bends_badly
from isomatch.matching.isometric.isometry import AMBIGUITY_NOTE
from isomatch.settings import ElasticSettings
from isomatch_lab.procedural import creature
from isomatch_lab.sets import relabelled

pytestmark = pytest.mark.usefixtures("prepared_once")


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


def mean_error(shape, images, truth):
    return shape.mean_distance(shape.body_vertex[images], shape.body_vertex[truth])


def test_limbs_stretch(species, found):
    _, target, truth = species
    assert not np.isnan(found.quality.bending_cost)
    assert any("far from isometric" in note for note in found.notes)
    assert mean_error(target, found.map.vertices, truth) < 0.07


def test_a_map_between_species_is_judged_by_how_much_the_shapes_are_bent(found):
    """A runner-up that is bent as little is a tie, and so is a symmetric variant that fits as well."""
    bounds, quality = Config().outcome, found.quality
    sure = quality.bending_cost <= bounds.poor_bending and quality.residual <= bounds.poor_far_residual
    sure &= quality.descriptor_distance <= bounds.poor_far_descriptor_distance
    sure &= quality.runner_up >= bounds.elastic_tie and AMBIGUITY_NOTE not in found.notes
    assert (found.outcome is Outcome.CONVERGED) == sure
    assert quality.runner_up >= 1
    strict = replace(bounds, poor_bending=0.5 * quality.bending_cost)
    assert bends_badly(quality, strict)
    assert bends_badly(replace(quality, bending_cost=np.nan), bounds)


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
    assert after < 1.1 * before


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
    assert led.outcome is Outcome.PRIORS_CONTRADICTED
    assert mean_error(target, led.map.vertices, truth) < 0.07


@pytest.mark.long
def test_the_score_is_the_stretch_and_the_gap_of_both_shapes_bent(species):
    """A shape on itself is not stretched; exchanged images are dear."""
    relation = Elastic(prepare_pair(species[0], species[0]))
    identity = relation.measure_fit(Fit(relation.vertices), relation.vertices)
    assert identity.score < 1e-4
    moved = relation.measure_fit(identity, np.roll(relation.vertices, 1))
    assert moved.score > 20 * identity.score
    onto_target, onto_source = identity.bent
    assert identity.score == pytest.approx(np.sqrt(onto_target.bending_cost * onto_source.bending_cost))
    assert onto_target.stretch < 0.02


@pytest.mark.long
def test_a_map_that_fits_and_keeps_lengths_stays_what_it_was(animals):
    """Although one was sought that lets limbs stretch."""
    moved, _ = relabelled(creature(2000, pose=1, triangulation=3).mesh, 0)
    bodies = prepare(animals[0].mesh), prepare(moved)
    without = match(*bodies)
    sought = match(*bodies, config=Config(elastic=ElasticSettings(min_spectral_residual=0.0)))
    assert any(stage.startswith("elastic") for stage in sought.timings)
    assert not any(stage.startswith("elastic") for stage in without.timings)
    np.testing.assert_array_equal(sought.map.vertices, without.map.vertices)
    assert sought.outcome is without.outcome
    assert sought.notes == without.notes
