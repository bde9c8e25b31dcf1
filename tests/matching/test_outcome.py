"""The outcome from the measures: each bound on either side, and the order where several hold."""

import importlib
from dataclasses import fields, replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import Config, NotConvergedError, Outcome, match
from isomatch.matching import Evidence, Quality, measured_evidence, outcome_of
from isomatch.matching.assessment.quality import torn_off_share
from shapes import icosphere

BOUNDS = Config().outcome
NONE = Quality(**{field.name: np.nan for field in fields(Quality)})
GOOD = replace(
    NONE,
    spectral_residual=0.1,
    runner_up=np.inf,
    mirrored=np.inf,
    residual=0.1,
    stretch=1.0,
    orientation=0.95,
)
LITTLE = 1e-9


def outcome(quality, wanted="preserve", with_priors=False, left_out=0.0):
    pair = SimpleNamespace(sideless=False, config=Config(), left_out=left_out)
    return outcome_of([measured_evidence(pair, quality, wanted, with_priors)])


@pytest.mark.parametrize(
    ("measure", "good", "side", "otherwise"),
    [
        ("landmark_error", BOUNDS.contradiction, 1, Outcome.PRIORS_CONTRADICTED),
        ("initial_map_error", BOUNDS.contradiction, 1, Outcome.PRIORS_CONTRADICTED),
        ("spectral_residual", BOUNDS.poor_spectral_residual, 1, Outcome.LOW_CONFIDENCE),
        ("residual", BOUNDS.poor_residual, 1, Outcome.LOW_CONFIDENCE),
        ("stretch", BOUNDS.poor_stretch, 1, Outcome.LOW_CONFIDENCE),
        ("torn_off", BOUNDS.poor_torn_off, 1, Outcome.LOW_CONFIDENCE),
        ("orientation", BOUNDS.poor_orientation, -1, Outcome.LOW_CONFIDENCE),
        ("runner_up", BOUNDS.tie, -1, Outcome.SYMMETRY_AMBIGUOUS),
        ("mirrored", BOUNDS.mirror_tie, -1, Outcome.SYMMETRY_AMBIGUOUS),
    ],
)
def test_each_measure_has_one_bound(measure, good, side, otherwise):
    assert outcome(replace(GOOD, **{measure: good})) is Outcome.CONVERGED
    assert outcome(replace(GOOD, **{measure: good + side * LITTLE})) is otherwise


def test_a_better_runner_up_leaves_no_confidence():
    assert outcome(replace(GOOD, runner_up=1.0)) is Outcome.SYMMETRY_AMBIGUOUS
    assert outcome(replace(GOOD, runner_up=1.0 - LITTLE)) is Outcome.LOW_CONFIDENCE


def test_a_mirror_image_that_fits_clearly_better_is_named():
    better = replace(GOOD, mirrored=BOUNDS.mirror_image - LITTLE)
    assert outcome(better) is outcome(better, "reverse") is Outcome.MIRROR_IMAGE
    assert outcome(better, "any") is outcome(better, with_priors=True) is Outcome.SYMMETRY_AMBIGUOUS
    assert outcome(replace(GOOD, mirrored=BOUNDS.mirror_image)) is Outcome.SYMMETRY_AMBIGUOUS


def test_the_orientation_that_was_wanted():
    turned = replace(GOOD, orientation=-GOOD.orientation)
    assert outcome(turned, "reverse") is outcome(turned, "any") is outcome(GOOD, "any") is Outcome.CONVERGED
    assert outcome(turned, "preserve") is outcome(GOOD, "reverse") is Outcome.LOW_CONFIDENCE
    assert outcome(turned, "preserve", with_priors=True) is Outcome.SYMMETRY_AMBIGUOUS, (
        "priors led to the mirror image"
    )
    undecided = replace(GOOD, orientation=0.0)
    assert outcome(undecided, with_priors=True) is Outcome.LOW_CONFIDENCE


def test_what_is_not_known_speaks_against_nothing():
    assert outcome(NONE) is Outcome.CONVERGED


def test_the_first_outcome_that_holds_is_given():
    everything = replace(GOOD, landmark_error=1.0, mirrored=0.5, spectral_residual=1.0, runner_up=1.0)
    found = []
    for measure in ("landmark_error", "mirrored", "spectral_residual", "runner_up"):
        found.append(outcome(everything, left_out=1.0))
        everything = replace(everything, **{measure: getattr(GOOD, measure)})
    found += [outcome(everything, left_out=1.0), outcome(everything, left_out=BOUNDS.large_component)]
    assert found == list(Outcome)


def test_the_least_sure_piece_of_evidence_decides_however_they_are_grouped():
    names = [field.name for field in fields(Evidence)]
    pieces = [Evidence(*flags) for flags in product((False, True), repeat=len(names))]
    for first, second in product(pieces, repeat=2):
        both = outcome_of([first, second])
        assert both.sureness == min(outcome_of([first]).sureness, outcome_of([second]).sureness)
        merged = Evidence(**{name: getattr(first, name) or getattr(second, name) for name in names})
        assert outcome_of([merged]) is both


def test_a_cap_that_goes_to_the_other_pole_is_torn_off():
    sphere = icosphere(3)
    images = np.arange(sphere.n_vertices)
    cap = sphere.vertices[:, 2] > 0.8
    opposite = (sphere.vertices @ -sphere.vertices[cap].T).argmax(axis=0)

    def torn_off(images):
        return torn_off_share(sphere, sphere.area, sphere.vertices[images], BOUNDS.torn_growth)

    assert torn_off(images) == 0.0
    assert torn_off(images[::-1]) < 0.05, "scattered points are no piece"
    images[cap] = opposite
    assert torn_off(images) == pytest.approx(sphere.vertex_areas[cap].sum() / sphere.area)
    assert torn_off(images) == pytest.approx(0.1, abs=0.02)


@pytest.mark.long
def test_a_way_that_finds_no_map_is_told(prepared_example, monkeypatch):
    solving = importlib.import_module("isomatch.matching.strategies")

    def broken(tried):
        raise NotConvergedError("nothing turned up")

    strategies = solving.Strategy("broken", "whole", "always", broken), solving.ISOMETRIC
    monkeypatch.setattr(solving, "strategies_of", lambda problem: strategies)
    assert "the way 'broken' found no map: nothing turned up" in match(*prepared_example).notes
