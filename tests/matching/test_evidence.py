"""From evidence to an outcome: better evidence never lowers it."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isomatch import Outcome
from isomatch.matching.assessment.evidence import (
    Evidence,
    PartDoubt,
    held_evidence,
    lower_outcome,
    outcome_of,
    part_contradicts,
)
from isomatch.settings import PartSettings

SETTINGS = PartSettings()
BOUND = SETTINGS.poor_doubt
PART, POOR, AMBIGUOUS = Evidence(partial=True), Evidence(partial=True, poor=True), Evidence(ambiguous=True)

evidence = st.builds(Evidence, *(st.booleans() for _ in fields(Evidence)))
scores, shares = st.floats(1e-7, 1e-3), st.floats(0, 1)


def doubt_of(score, runner_up=np.inf, known_share=1.0):
    return PartDoubt(score, runner_up, known_share, SETTINGS)


def test_an_outcome_is_lowered_and_never_raised():
    for outcome in Outcome:
        assert outcome_of([Evidence.of(outcome)]) is outcome
        for other in Outcome:
            assert lower_outcome(outcome, Evidence.of(other)) is min(outcome, other, key=lambda o: o.sureness)


def test_the_doubt_is_the_score_without_a_runner_up_and_boundless_at_a_tie():
    assert doubt_of(BOUND).doubt == BOUND
    assert doubt_of(BOUND, 2.0).doubt == pytest.approx(2 * BOUND)
    assert 1 / doubt_of(BOUND, 3.0).doubt == pytest.approx(1 / BOUND - 1 / (3 * BOUND))
    assert BOUND < doubt_of(BOUND, 1.0).doubt < np.inf


@given(scores, st.floats(1, 10), st.floats(1, 10), shares, shares)
def test_a_part_is_no_less_sure_if_it_is_clearer_and_more_is_known(
    score, runner_up, clearer, known_share, more
):
    worse = doubt_of(score, min(runner_up, clearer), min(known_share, more)).evidence
    better = doubt_of(score, max(runner_up, clearer), max(known_share, more)).evidence
    if not worse.ambiguous:  # a tie is told as such, whatever is known
        assert outcome_of([better]).sureness >= outcome_of([worse]).sureness


def test_a_score_that_is_unknown_is_not_sure():
    assert outcome_of([doubt_of(np.nan).evidence]) is Outcome.LOW_CONFIDENCE


def test_a_map_that_is_not_sure_says_why_and_what_to_do():
    assert doubt_of(BOUND / 10).notes(with_priors=False) == []
    (badly,) = doubt_of(2 * BOUND).notes(with_priors=False)
    assert "badly" in badly
    assert "landmarks" in badly
    (nearly,) = doubt_of(BOUND / 2, 1.5).notes(with_priors=True)
    assert "1.50 times" in nearly


def test_single_landmarks_do_not_contradict_the_map_of_a_part():
    assert not part_contradicts(np.array([1.0, 1, 0, 0, 0]), np.nan, 0.1)
    assert part_contradicts(np.array([1.0, 1, 1, 0, 0]), np.nan, 0.1)
    assert not part_contradicts(np.zeros(0), np.nan, 0.1)
    assert part_contradicts(np.zeros(0), 1.0, 0.1)


def test_a_map_of_another_way_that_comes_near_adds_to_the_doubt():
    assert doubt_of(BOUND / 2, 9.0).with_lead(1.5).doubt == pytest.approx(3 * BOUND / 2)
    assert doubt_of(BOUND / 2, 1.5).with_lead(9.0) == doubt_of(BOUND / 2, 1.5)


def test_a_map_that_had_to_be_bent_to_its_landmarks_is_not_sure():
    held = SimpleNamespace(landmark_error=0.0, initial_map_error=np.nan)
    against = (Evidence(contradicted=True), PART)
    assert outcome_of(held_evidence(against, held, 0.1)) is Outcome.LOW_CONFIDENCE
    assert outcome_of(held_evidence((PART,), held, 0.1)) is Outcome.PARTIAL
    off = SimpleNamespace(landmark_error=0.2, initial_map_error=np.nan)
    assert outcome_of(held_evidence(against, off, 0.1)) is Outcome.PRIORS_CONTRADICTED
