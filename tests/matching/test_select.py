"""The selector on plain numbers: no shapes, no maps."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isomatch.matching import selection
from isomatch.matching.parameters import TIES
from isomatch.matching.selection import (
    Rules,
    keep_distinct,
    rank_candidates,
    select_contenders,
    select_survivors,
    weigh_costs,
)
from isomatch.settings import OutcomeSettings, SelectionSettings

SETTINGS, BOUNDS = SelectionSettings(), OutcomeSettings()


def select(fits, eligible, distances, elsewhere, n_tried):
    rules = Rules.of(SETTINGS, BOUNDS)
    return selection.select(fits, distances, rules, eligible=eligible, far_shares=elsewhere, n_tried=n_tried)


@dataclass(frozen=True)
class Found:
    energy: float
    orientation: float = 0.9
    landmark_error: float = 0.0
    prior_error: float = 0.0


@dataclass(frozen=True)
class Fit:
    spectral_residual: float
    score: float = 1.0
    orientation: float = 0.9
    residual: float = 0.2
    landmark_error: float = 0.0
    prior_error: float = 0.0

    @property
    def side(self):
        return 1.0 if self.orientation >= 0 else -1.0


NOWHERE = np.zeros((10, 10))  # no two send limbs to different places


def selected(fits):
    """What is selected of maps that are all different, and may all win."""
    return select(fits, [True] * len(fits), distances_except(len(fits)), NOWHERE, 4)


def distances_except(n, *same):
    """Distances of n maps: 0.5 between each two, and nearly 0 between given pairs."""
    distances = np.full((n, n), 0.5) - 0.5 * np.eye(n)
    for i, j in same:
        distances[i, j] = distances[j, i] = 0.001
    return distances


found = st.builds(
    Found,
    st.floats(0.01, 10),
    st.floats(-1, 1),
    st.sampled_from([0.0, 0.01, 0.04, 0.2]),
)
orientations = st.sampled_from(["preserve", "reverse", "any"])


@given(st.lists(found, max_size=8, unique_by=lambda c: c.energy), orientations, st.randoms())
def test_the_order_of_the_candidates_does_not_matter(candidates, orientation, random):
    shuffled = candidates[:]
    random.shuffle(shuffled)
    for landmarks in (False, True):
        one, other = (
            rank_candidates(order, orientation, SETTINGS, landmarks) for order in (candidates, shuffled)
        )
        assert one == other


@given(st.lists(found, min_size=1, max_size=8))
def test_mirroring_everything_and_asking_for_the_mirror_image_changes_nothing(candidates):
    mirrored = [Found(c.energy, -c.orientation, c.landmark_error) for c in candidates]
    kept = [c.energy for c in rank_candidates(candidates, "preserve", SETTINGS)]
    assert kept == [c.energy for c in rank_candidates(mirrored, "reverse", SETTINGS)]


@given(st.lists(found, max_size=8))
def test_without_landmarks_nothing_is_dropped(candidates):
    assert sorted(rank_candidates(candidates, "preserve", SETTINGS), key=repr) == sorted(candidates, key=repr)


def test_where_only_the_other_side_was_found_it_contends():
    assert select_contenders([Found(1.0, -0.9)], "preserve", SETTINGS) == [Found(1.0, -0.9)]
    assert select_contenders([], "preserve", SETTINGS) == []


def test_of_fits_that_coincide_one_is_kept_for_the_hypothesis_of_least_residual():
    fits = [Fit(1.0, residual=0.3), Fit(1.05, residual=0.1), Fit(1.1, residual=0.2)]
    assert select_survivors(fits, distances_except(3, (0, 1)), SETTINGS, True, False) == [(0, 1), (2, 2)]


def test_the_eligible_fit_of_least_score_wins():
    fits = [Fit(1.0, score=3.0), Fit(1.0, score=1.0), Fit(1.0, score=2.0)]
    chosen = select(fits, [True, False, True], distances_except(3), NOWHERE, 4)
    assert chosen.best is fits[2]
    assert chosen.others == (fits[1], fits[0])
    assert chosen.runner_up == pytest.approx(0.5), "one that may not win fits better"
    assert chosen.mirrored == inf
    assert chosen.against is fits[1]
    assert not chosen.priors_decided


def test_one_that_was_compared_with_nothing_has_no_runner_up():
    alone = select([Fit(1.0)], [True], distances_except(1), NOWHERE, 1)
    assert np.isnan(alone.runner_up)
    assert np.isnan(alone.mirrored)
    assert select([Fit(1.0)], [True], distances_except(1), NOWHERE, 2).runner_up == inf


def test_a_variant_of_the_winner_is_no_runner_up():
    fits = [Fit(1.0, score=1.0), Fit(1.0, score=1.1), Fit(1.0, score=1.5, orientation=-0.9)]
    chosen = select(fits, [True] * 3, distances_except(3, (0, 1)), NOWHERE, 4)
    assert (chosen.runner_up, chosen.mirrored) == (pytest.approx(1.5), pytest.approx(1.5))
    alone = select(fits[:2], [True] * 2, distances_except(2, (0, 1)), NOWHERE, 4)
    assert alone.runner_up == inf
    assert alone.against is None


fits = st.builds(
    Fit, st.just(1.0), st.floats(0.1, 10), st.floats(-1, 1), prior_error=st.sampled_from([0.0, 0.04, 0.2])
)


def several(items, least=1):
    return st.lists(items, min_size=least, max_size=6, unique_by=lambda fit: fit.score)


@given(several(fits), st.randoms())
def test_the_selection_does_not_depend_on_the_order(made, random):
    shuffled = made[:]
    random.shuffle(shuffled)
    assert selected(made) == selected(shuffled)


@given(several(fits))
def test_mirroring_all_maps_selects_the_mirror_image(made):
    made = [replace(fit, orientation=fit.orientation or 1.0) for fit in made]
    chosen = selected([replace(fit, orientation=-fit.orientation) for fit in made])
    assert replace(chosen.best, orientation=-chosen.best.orientation) == selected(made).best
    assert (chosen.runner_up, chosen.mirrored) == (selected(made).runner_up, selected(made).mirrored)


@given(several(fits, least=2))
def test_a_winner_that_fits_better_still_wins_and_no_less_clearly(made):
    before = selected(made)
    better = [replace(fit, score=0.9 * fit.score) if fit is before.best else fit for fit in made]
    after = selected(better)
    assert after.best.prior_error <= before.best.prior_error
    if not before.priors_decided:
        assert after.runner_up >= before.runner_up or after.priors_decided


@given(st.lists(st.tuples(st.floats(0.1, 10), st.floats(0, 0.5)), min_size=1, max_size=6))
def test_priors_decide_ties_and_nothing_else(fits):
    made = [Fit(1.0, score=score, prior_error=error) for score, error in fits]
    chosen = select(made, [True] * len(made), distances_except(len(made)), NOWHERE, 4)
    best = min(score for score, _ in fits)
    tied = [fit for fit in made if fit.score <= BOUNDS.tie * best]
    assert chosen.best in tied
    assert chosen.best.prior_error <= min(fit.prior_error for fit in tied) + TIES.landmark_slack


@given(st.lists(st.integers(0, 9), max_size=8), st.sampled_from([None, 1, 3]))
def test_maps_that_are_kept_differ_from_each_other_and_every_other_one_is_like_one_kept(places, most):
    def distances(place, others):
        return np.abs(np.subtract(others, place))

    kept = keep_distinct(places, lambda place: place, distances, 1.5, most, before=[20])
    assert kept == sorted(kept, key=places.index)
    assert all(abs(a - b) > 1.5 for i, a in enumerate(kept) for b in kept[:i])
    if most is None:
        assert all(min(abs(place - other) for other in kept) <= 1.5 for place in places)
    else:
        assert len(kept) <= most


def line(a, b):
    """Distances between points of a line, by their numbers."""
    return 0.1 * np.abs(np.asarray(a) - b)


HERE, THERE = np.arange(100), np.arange(100) + 5 * (np.arange(100) >= 60)


def test_costs_are_weighed_by_the_descriptor_distance_where_maps_differ():
    """Mismatches where both maps agree do not count, nor do those that are not known."""
    dear = np.where(HERE < 60, 9.0, 0.7)
    dear[90:] = np.nan
    costs = weigh_costs([1.0, 1.1], [HERE, THERE], [dear, np.full(100, 0.5)], line, [True, True], 2.0)
    assert costs == pytest.approx([1.1 * np.exp(2 * 0.2) / 1.1, 1.1])


def test_the_weights_of_maps_that_agree_or_of_which_nothing_is_known_are_none():
    unknown = np.full(100, np.nan)
    for images, descriptor_distances in (
        ([HERE, HERE], [0 * HERE, 9.0 + HERE]),
        ([HERE, THERE], [unknown, unknown]),
    ):
        assert weigh_costs([1.0, 1.1], images, descriptor_distances, line, [True, True], 2.0) == [1.0, 1.1]
    assert weigh_costs(
        [1.0, 1.1], [HERE, THERE], [0.9 + 0 * HERE, 0.1 + 0 * HERE], line, [True] * 2, 0.0
    ) == [
        1.0,
        1.1,
    ]


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 2, 0]])
def test_of_maps_that_beat_each_other_in_a_ring_the_one_that_loses_least_wins(order):
    """By descriptor distance, the first beats the second by 0.3, that the third by 0.05, and that the first by 0.2."""
    early = HERE < 50
    images = [HERE, HERE + 5 * early, HERE + 5 * ~early]
    descriptor_distances = [np.where(early, *values) for values in ((0.2, 0.5), (0.5, 0.3), (0.6, 0.3))]
    ordered = ([arrays[i] for i in order] for arrays in (images, descriptor_distances))
    costs = weigh_costs([1.0] * 3, *ordered, line, [True] * 3, 2.0)
    assert order[int(np.argmin(costs))] == 2
    assert sorted(costs)[:2] == pytest.approx([1.0, 1.0])
    assert max(costs) == pytest.approx(np.exp(2 * 0.2))


def test_only_eligible_maps_are_the_standard():
    poor, good = 0.9 + 0 * HERE, 0.1 + 0 * HERE
    costs = weigh_costs([1.0, 1.1], [HERE, THERE], [poor, good], line, [True, False], 1.0)
    assert costs == pytest.approx([1.0, 1.1 * np.exp(-0.8)])
    assert weigh_costs([1.0, 1.1], [HERE, THERE], [poor, good], line, [True, True], 1.0)[1] == 1.1
