"""How sure the map of a part is, from its score and that of its rival."""

from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import Outcome
from isomatch.matching.verification import (
    Evidence,
    PartDoubt,
    closed_evidence,
    held_evidence,
    lowered,
    outcome_of,
    part_contradicts,
    part_evidence,
)
from isomatch.settings import PartSettings

SETTINGS = PartSettings()
BOUND = SETTINGS.poor_doubt


def evidence(score, rival=np.inf, trusted=1.0):
    return PartDoubt(score, rival, trusted, SETTINGS)


def test_the_doubt_is_the_score_without_a_rival_and_boundless_at_a_tie():
    assert evidence(BOUND).doubt == BOUND
    assert evidence(BOUND, 2.0).doubt == pytest.approx(2 * BOUND)
    assert 1 / evidence(BOUND, 3.0).doubt == pytest.approx(1 / BOUND - 1 / (3 * BOUND))
    assert BOUND < evidence(BOUND, 1.0).doubt < np.inf


def test_the_worse_a_map_fits_the_more_clearly_it_must_be_better():
    assert outcome_of([evidence(BOUND).evidence]) is Outcome.PARTIAL
    assert outcome_of([evidence(BOUND * 1.01).evidence]) is Outcome.LOW_CONFIDENCE
    assert outcome_of([evidence(BOUND / 2, 2.0).evidence]) is Outcome.PARTIAL
    assert outcome_of([evidence(BOUND / 2, 1.9).evidence]) is Outcome.LOW_CONFIDENCE
    assert outcome_of([evidence(BOUND / 10, 1.9).evidence]) is Outcome.PARTIAL


def test_where_little_is_known_a_map_must_be_clearly_better():
    little = SETTINGS.little_trusted - 1e-9
    assert outcome_of([evidence(BOUND / 100, SETTINGS.clear - 0.1).evidence]) is Outcome.PARTIAL
    unclear = evidence(BOUND / 100, SETTINGS.clear - 0.1, little)
    assert outcome_of([unclear.evidence]) is Outcome.LOW_CONFIDENCE
    assert "too much is missing" in unclear.notes(Outcome.LOW_CONFIDENCE, hinted=False)[0]
    assert outcome_of([evidence(BOUND / 100, SETTINGS.clear, little).evidence]) is Outcome.PARTIAL


def test_maps_that_fit_as_well_are_ambiguous_unless_they_fit_badly():
    tie = SETTINGS.tie - 1e-9
    assert outcome_of([evidence(BOUND / 100, SETTINGS.tie).evidence]) is Outcome.PARTIAL
    assert outcome_of([evidence(BOUND / 100, tie).evidence]) is Outcome.SYMMETRY_AMBIGUOUS
    assert outcome_of([evidence(BOUND * 1.01, tie).evidence]) is Outcome.LOW_CONFIDENCE


def test_a_score_that_is_unknown_is_not_sure():
    assert outcome_of([evidence(np.nan).evidence]) is Outcome.LOW_CONFIDENCE


def test_a_map_that_is_not_sure_says_why_and_what_to_do():
    assert evidence(BOUND / 10).notes(Outcome.LOW_CONFIDENCE, hinted=False) == []
    (badly,) = evidence(2 * BOUND).notes(Outcome.LOW_CONFIDENCE, hinted=False)
    assert "it fits badly" in badly
    assert "three to five landmarks" in badly
    (nearly,) = evidence(BOUND / 2, 1.5).notes(Outcome.LOW_CONFIDENCE, hinted=True)
    assert "another map is only 1.50 times as high" in nearly
    assert "give more landmarks" in nearly


def test_single_landmarks_do_not_contradict_the_map_of_a_part():
    assert not part_contradicts(np.array([1.0, 1, 0, 0, 0]), np.nan, 0.1)
    assert part_contradicts(np.array([1.0, 1, 1, 0, 0]), np.nan, 0.1)
    assert not part_contradicts(np.zeros(0), np.nan, 0.1)
    assert part_contradicts(np.zeros(0), 1.0, 0.1)


def test_an_outcome_is_lowered_and_never_raised():
    for outcome in Outcome:
        assert outcome_of([Evidence.of(outcome)]) is outcome
        for other in Outcome:
            assert lowered(outcome, Evidence.of(other)) is min(outcome, other, key=lambda o: o.sureness)
    assert lowered(Outcome.PARTIAL, Evidence(poor=False)) is Outcome.PARTIAL


PART, POOR, AMBIGUOUS = Evidence(partial=True), Evidence(partial=True, poor=True), Evidence(ambiguous=True)


def test_a_closed_map_that_is_sure_and_agrees_vouches_for_that_of_a_part():
    assert outcome_of(part_evidence(POOR, (Evidence(),), agrees=True)) is Outcome.PARTIAL
    assert outcome_of(part_evidence(POOR, (Evidence(),), agrees=False)) is Outcome.LOW_CONFIDENCE


def test_a_closed_map_that_differs_or_is_ambiguous_leaves_doubt():
    assert outcome_of(part_evidence(PART, (AMBIGUOUS,), agrees=True)) is Outcome.SYMMETRY_AMBIGUOUS
    assert outcome_of(part_evidence(PART, (POOR,), agrees=False)) is Outcome.LOW_CONFIDENCE
    assert outcome_of(part_evidence(PART, (POOR,), agrees=True)) is Outcome.PARTIAL


def test_where_caps_spoil_the_measures_two_parts_are_judged_as_parts():
    assert outcome_of(closed_evidence(PART, (Evidence(poor=True),))) is Outcome.PARTIAL
    assert outcome_of(closed_evidence(POOR, (Evidence(),))) is Outcome.PARTIAL
    assert outcome_of(closed_evidence(POOR, (AMBIGUOUS,))) is Outcome.SYMMETRY_AMBIGUOUS


def test_a_map_that_had_to_be_bent_to_its_landmarks_is_not_sure():
    held = SimpleNamespace(landmark_error=0.0, initial_map_error=np.nan)
    against = (Evidence(contradicted=True), PART)
    assert outcome_of(held_evidence(against, held, 0.1)) is Outcome.LOW_CONFIDENCE
    assert outcome_of(held_evidence((PART,), held, 0.1)) is Outcome.PARTIAL
    off = SimpleNamespace(landmark_error=0.2, initial_map_error=np.nan)
    assert outcome_of(held_evidence(against, off, 0.1)) is Outcome.HINTS_CONTRADICTED
