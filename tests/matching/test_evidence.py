"""How sure the map of a part is, from its score and that of its rival."""

from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import Config, Outcome
from isomatch.matching.parts.evidence import Evidence
from isomatch.matching.parts.result import _contradicts
from isomatch.settings import PartSettings

SETTINGS = PartSettings()
BOUND = SETTINGS.poor_doubt


def evidence(score, rival=np.inf, trusted=1.0):
    return Evidence(score, rival, trusted, SETTINGS)


def test_the_doubt_is_the_score_without_a_rival_and_boundless_at_a_tie():
    assert evidence(BOUND).doubt == BOUND
    assert evidence(BOUND, 2.0).doubt == pytest.approx(2 * BOUND)
    assert 1 / evidence(BOUND, 3.0).doubt == pytest.approx(1 / BOUND - 1 / (3 * BOUND))
    assert BOUND < evidence(BOUND, 1.0).doubt < np.inf


def test_the_worse_a_map_fits_the_more_clearly_it_must_be_better():
    assert evidence(BOUND).outcome is Outcome.PARTIAL
    assert evidence(BOUND * 1.01).outcome is Outcome.LOW_CONFIDENCE
    assert evidence(BOUND / 2, 2.0).outcome is Outcome.PARTIAL
    assert evidence(BOUND / 2, 1.9).outcome is Outcome.LOW_CONFIDENCE
    assert evidence(BOUND / 10, 1.9).outcome is Outcome.PARTIAL


def test_where_little_is_known_a_map_must_be_clearly_better():
    little = SETTINGS.little_trusted - 1e-9
    assert evidence(BOUND / 100, SETTINGS.clear - 0.1).outcome is Outcome.PARTIAL
    unclear = evidence(BOUND / 100, SETTINGS.clear - 0.1, little)
    assert unclear.outcome is Outcome.LOW_CONFIDENCE
    assert "too much is missing" in unclear.notes(hinted=False)[0]
    assert evidence(BOUND / 100, SETTINGS.clear, little).outcome is Outcome.PARTIAL


def test_maps_that_fit_as_well_are_ambiguous_unless_they_fit_badly():
    tie = SETTINGS.tie - 1e-9
    assert evidence(BOUND / 100, SETTINGS.tie).outcome is Outcome.PARTIAL
    assert evidence(BOUND / 100, tie).outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert evidence(BOUND * 1.01, tie).outcome is Outcome.LOW_CONFIDENCE


def test_a_score_that_is_unknown_is_not_sure():
    assert evidence(np.nan).outcome is Outcome.LOW_CONFIDENCE


def test_a_map_that_is_not_sure_says_why_and_what_to_do():
    assert evidence(BOUND / 10).notes(hinted=False) == []
    (badly,) = evidence(2 * BOUND).notes(hinted=False)
    assert "it fits badly" in badly
    assert "three to five landmarks" in badly
    (nearly,) = evidence(BOUND / 2, 1.5).notes(hinted=True)
    assert "another map is only 1.50 times as high" in nearly
    assert "give more landmarks" in nearly


def test_single_landmarks_do_not_contradict_the_map_of_a_part():
    quality = SimpleNamespace(initial_map_error=np.nan)
    points = SimpleNamespace(corners=np.arange(5)[:, None])
    hints = SimpleNamespace(landmarks=np.zeros((5, 2), dtype=int))
    for off, contradicted in (([1, 1, 0, 0, 0], False), ([1, 1, 1, 0, 0], True)):
        distance = np.array(off, dtype=float)
        target = SimpleNamespace(distance=lambda a, b, found=distance: found)
        pair = SimpleNamespace(target=target, config=Config())
        assert _contradicts(pair, points, quality, hints) is contradicted
    hints.landmarks = hints.landmarks[:0]
    target.distance = lambda a, b: np.zeros(0)
    assert not _contradicts(pair, points, quality, hints)
    assert _contradicts(pair, points, SimpleNamespace(initial_map_error=1.0), hints)
