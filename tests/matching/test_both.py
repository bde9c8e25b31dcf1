"""Both directions in one run: the first map equals `match`, and the map back is as good as if searched."""

import json
from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, LandmarkError, MapError, Mesh, Outcome, SettingError, match, match_both
from isomatch.datasets import ground_truth
from isomatch.evaluation import cycle_errors, geodesic_errors
from isomatch.matching import Isometry, prepare_pair, search_under, strategies
from isomatch.matching.isometric.inverse import Inverse
from shapes import icosphere

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def both(prepared_example):
    return match_both(*prepared_example)


def errors_of(example, found):
    truth = ground_truth(*example).vertices
    return geodesic_errors(example[1].mesh, found.map, np.column_stack([np.arange(len(truth)), truth]), 200)


@pytest.mark.long
def test_the_map_there_is_that_of_match(both, prepared_example):
    alone = match(*prepared_example)
    np.testing.assert_array_equal(both.source_to_target.map.vertices, alone.map.vertices)
    assert both.source_to_target.outcome is alone.outcome


@pytest.mark.long
def test_the_map_back_is_as_good_as_one_found_by_itself(both, example, prepared_example):
    alone = match(*prepared_example[::-1])
    errors = [errors_of(example[::-1], found).mean() for found in (both.target_to_source, alone)]
    assert errors[0] < 1.1 * errors[1]
    assert both.target_to_source.outcome is alone.outcome is Outcome.CONVERGED


def test_the_maps_are_nearly_inverse(both, example):
    forward, backward = (result.map for result in both)
    assert cycle_errors(example[0].mesh, forward, backward, 200).mean() < 0.01


def test_the_result_says_what_was_done(both):
    assert "nearest points in the coordinates of the other direction" in both.target_to_source.notes[0]
    assert "alternatives to it, turned around" in both.target_to_source.notes[0]
    assert "prepare" not in both.target_to_source.timings


def test_the_inverse_says_that_nothing_was_compared(both):
    assert both.target_to_source.reason == "nearest points in the coordinates of the other direction"
    assert all(
        (other.map.vertices != both.target_to_source.map.vertices).any()
        for other in both.target_to_source.alternatives
    )


def test_a_doubtful_inverse_is_searched_from_the_hypotheses(prepared_example, monkeypatch):
    monkeypatch.setattr(strategies, "_is_doubtful", lambda match: True)
    monkeypatch.setattr(
        Inverse, "measure_fit", lambda self, fit, image: replace(fit, image=image, score=np.inf)
    )
    found = match_both(*prepared_example).target_to_source
    assert "the hypotheses are the map of the other direction" in found.notes[0]
    assert "refined to the end" in found.reason


def test_maps_of_the_other_direction_are_verified_though_no_isometry_fits(prepared_example):
    """No strategy that verifies them follows an isometry from given hypotheses."""
    problem = prepare_pair(*prepared_example)
    strict = replace(problem.config.elastic, min_spectral_residual=0.0)
    problem = replace(problem, config=replace(problem.config, elastic=strict))
    found = search_under(Isometry(problem))
    right = found.ranking.best
    wrong = replace(right, image=np.roll(right.image, 100))
    ranking = replace(found.ranking, best=wrong, others=(right,))
    assert Isometry(problem, [right.candidate])._verify_tied(ranking).best is right
    assert Isometry(problem)._verify_tied(ranking).best is wrong


@pytest.mark.long
def test_bad_priors_are_refused(prepared_example):
    with pytest.raises(SettingError, match="pin = 0, but no landmarks"):
        match_both(*(shape.surface for shape in prepared_example), config=Config(pin=0))
    with pytest.raises(LandmarkError, match="landmarks"):
        match_both(*prepared_example, landmarks=[[1, 2], [3]])


@pytest.mark.long
def test_a_map_of_other_shapes_is_no_initial_map(both, prepared_example):
    source, target = (shape.surface for shape in prepared_example)
    moved = Mesh(target.vertices + 1, target.faces)
    with pytest.raises(MapError, match="another"):
        match(source, moved, initial_map=both.source_to_target.map)
    assert json.dumps(both.source_to_target.to_dict(), allow_nan=False)
    unknown = replace(both.source_to_target.alternatives[0], energy=np.nan)
    assert json.dumps(replace(both.source_to_target, alternatives=(unknown,)).to_dict(), allow_nan=False)


@pytest.mark.long
def test_a_symmetric_shape_is_ambiguous_in_both_directions():
    forward, backward = match_both(icosphere(3), icosphere(3))
    assert forward.outcome is backward.outcome is Outcome.SYMMETRY_AMBIGUOUS


@pytest.mark.long
def test_priors_are_turned_around(example, prepared_example):
    truth = ground_truth(*example).vertices
    landmarks = np.array([(i, truth[i]) for i in range(0, len(truth), 500)])
    config = Config(hypotheses="given")
    forward, backward = match_both(*prepared_example, landmarks=landmarks, initial_map=truth, config=config)
    assert max(found.quality.landmark_error for found in (forward, backward)) < 0.03
    assert max(found.quality.initial_map_error for found in (forward, backward)) < 0.03
    assert "found by itself" in backward.notes[0]
