"""The selector on plain numbers: no shapes, no maps."""

from dataclasses import dataclass
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isomatch.matching import selection
from isomatch.matching.selection import (
    LANDMARK_SLACK,
    SCORE_NOISE,
    Rules,
    contenders,
    distinct,
    ranked,
    survivors,
    weighed,
)
from isomatch.settings import OutcomeSettings, SelectionSettings

SETTINGS, BOUNDS = SelectionSettings(), OutcomeSettings()


def select(fits, eligible, apart, elsewhere, n_tried):
    rules = Rules.of(SETTINGS, BOUNDS)
    return selection.select(fits, apart, rules, eligible=eligible, elsewhere=elsewhere, n_tried=n_tried)


@dataclass(frozen=True)
class Found:
    energy: float
    orientation: float = 0.9
    landmark_error: float = 0.0
    hint_error: float = 0.0


@dataclass(frozen=True)
class Fit:
    misfit: float
    score: float = 1.0
    orientation: float = 0.9
    residual: float = 0.2
    landmark_error: float = 0.0
    hint_error: float = 0.0

    @property
    def side(self):
        return 1.0 if self.orientation >= 0 else -1.0


NOWHERE = np.zeros((10, 10))  # no two send limbs to different places


def apart(n, *same):
    """Maps that are all 0.5 apart, but for some pairs that coincide."""
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
        one, other = (ranked(each, orientation, SETTINGS, landmarks) for each in (candidates, shuffled))
        assert one == other


@given(st.lists(found, min_size=1, max_size=8))
def test_mirroring_everything_and_asking_for_the_mirror_image_changes_nothing(candidates):
    mirrored = [Found(c.energy, -c.orientation, c.landmark_error) for c in candidates]
    kept = [c.energy for c in ranked(candidates, "preserve", SETTINGS)]
    assert kept == [c.energy for c in ranked(mirrored, "reverse", SETTINGS)]


@given(st.lists(found, max_size=8))
def test_without_landmarks_nothing_is_dropped(candidates):
    assert sorted(ranked(candidates, "preserve", SETTINGS), key=repr) == sorted(candidates, key=repr)


def test_orientation_goes_before_energy():
    right, mixed, mirrored = Found(3.0, 0.8), Found(2.0, 0.1), Found(1.0, -0.8)
    everything = [mirrored, mixed, right]
    assert ranked(everything, "preserve", SETTINGS) == [right, mixed, mirrored]
    assert ranked(everything, "reverse", SETTINGS) == [mirrored, mixed, right]
    assert ranked(everything, "any", SETTINGS) == [mirrored, right, mixed]


def test_what_contradicts_the_landmarks_is_dropped():
    near, slack, far = (
        Found(3.0, landmark_error=0.02),
        Found(2.0, landmark_error=0.06),
        Found(1.0, landmark_error=0.2),
    )
    assert ranked([near, slack, far], "preserve", SETTINGS, landmarks=True) == [slack, near]


def test_landmarks_may_ask_for_the_mirror_image():
    """The wanted orientation comes first only where it fits nearly as well."""
    mirrored, near, poor = Found(1.0, -0.8), Found(1.4, 0.8), Found(1.6, 0.8)
    assert ranked([mirrored, near], "preserve", SETTINGS, landmarks=True)[0] == near
    assert ranked([mirrored, poor], "preserve", SETTINGS, landmarks=True)[0] == mirrored


def test_contenders_are_of_comparable_energy_and_not_of_the_other_side():
    best, near, weak, mirrored = Found(1.0), Found(2.9), Found(3.1), Found(0.5, -0.8)
    order = ranked([mirrored, weak, near, best], "preserve", SETTINGS)
    assert contenders(order, "preserve", SETTINGS) == [best, near]


def test_a_map_that_leans_to_the_wanted_side_is_a_contender():
    order = ranked([Found(1.0, 0.9), Found(0.8, 0.1)], "preserve", SETTINGS)
    assert contenders(order, "preserve", SETTINGS) == [Found(0.8, 0.1), Found(1.0, 0.9)]


def test_where_only_the_other_side_was_found_it_contends():
    assert contenders([Found(1.0, -0.9)], "preserve", SETTINGS) == [Found(1.0, -0.9)]
    assert contenders([], "preserve", SETTINGS) == []


def test_there_is_a_limit_to_the_contenders():
    order = [Found(1.0 + 0.01 * i) for i in range(20)]
    assert len(contenders(order, "preserve", SETTINGS)) == SETTINGS.most_contenders


def test_hopeless_fits_are_given_up():
    fits = [Fit(1.2), Fit(1.0), Fit(1.1)]
    assert survivors(fits, apart(3), SETTINGS, True, False) == [(1, 1), (2, 2)]


def test_the_best_of_either_side_is_spared_where_both_are_wanted():
    fits = [Fit(1.0), Fit(3.0, orientation=-0.9), Fit(4.0, orientation=-0.9)]
    assert survivors(fits, apart(3), SETTINGS, True, True) == [(0, 0), (1, 1)]
    assert survivors(fits, apart(3), SETTINGS, True, False) == [(0, 0)]


def test_a_twisted_map_sets_no_standard_while_normals_take_no_part():
    fits = [Fit(0.5, orientation=0.1), Fit(1.0)]
    assert survivors(fits, apart(2), SETTINGS, False, False) == [(1, 1), (0, 0)]
    assert survivors(fits, apart(2), SETTINGS, True, False) == [(0, 0)]


def test_of_fits_that_coincide_one_is_kept_for_the_hypothesis_of_least_residual():
    fits = [Fit(1.0, residual=0.3), Fit(1.05, residual=0.1), Fit(1.1, residual=0.2)]
    assert survivors(fits, apart(3, (0, 1)), SETTINGS, True, False) == [(0, 1), (2, 2)]


def test_a_fit_of_the_other_side_lends_no_hypothesis():
    fits = [Fit(1.0, residual=0.3), Fit(1.05, orientation=-0.9, residual=0.1)]
    assert survivors(fits, apart(2, (0, 1)), SETTINGS, True, False) == [(0, 0)]


def test_the_eligible_fit_of_least_score_wins():
    fits = [Fit(1.0, score=3.0), Fit(1.0, score=1.0), Fit(1.0, score=2.0)]
    chosen = select(fits, [True, False, True], apart(3), NOWHERE, 4)
    assert chosen.winner is fits[2]
    assert chosen.rivals == (fits[1], fits[0])
    assert chosen.rival == pytest.approx(0.5), "one that may not win fits better"
    assert chosen.mirrored == inf
    assert chosen.against is fits[1]
    assert not chosen.hints_decided


def test_one_that_was_compared_with_nothing_has_no_rival():
    alone = select([Fit(1.0)], [True], apart(1), NOWHERE, 1)
    assert np.isnan(alone.rival)
    assert np.isnan(alone.mirrored)
    assert select([Fit(1.0)], [True], apart(1), NOWHERE, 2).rival == inf


def test_a_variant_of_the_winner_is_no_rival():
    fits = [Fit(1.0, score=1.0), Fit(1.0, score=1.1), Fit(1.0, score=1.5, orientation=-0.9)]
    chosen = select(fits, [True] * 3, apart(3, (0, 1)), NOWHERE, 4)
    assert (chosen.rival, chosen.mirrored) == (pytest.approx(1.5), pytest.approx(1.5))
    alone = select(fits[:2], [True] * 2, apart(2, (0, 1)), NOWHERE, 4)
    assert alone.rival == inf
    assert alone.against is None


@given(st.lists(st.floats(0.1, 10), min_size=1, max_size=6, unique=True), st.randoms())
def test_the_winner_does_not_depend_on_the_order(scores, random):
    fits = [Fit(1.0, score=score) for score in scores]
    chosen = select(fits, [True] * len(fits), apart(len(fits)), NOWHERE, 4)
    assert chosen.winner.score == min(scores)
    assert len(chosen.rivals) == len(fits) - 1
    assert chosen.rival >= 1


def test_differences_below_the_noise_of_triangulations_are_ties():
    copy = Fit(0.01, score=0.0001)
    other = Fit(0.1, score=0.02)
    assert select([copy, other], [True, True], apart(2), NOWHERE, 2).rival == 1
    assert len(survivors([copy, other], apart(2), SETTINGS, with_normals=True, both_sides=False)) == 2
    far = Fit(0.6, score=0.2)
    assert select([copy, far], [True, True], apart(2), NOWHERE, 2).rival == 0.2 / SCORE_NOISE
    assert len(survivors([copy, far], apart(2), SETTINGS, with_normals=True, both_sides=False)) == 1


def test_a_rival_that_contradicts_the_landmarks_counts_only_if_it_is_clearly_better():
    winner = Fit(0.3, score=0.10)
    for score, rival in ((0.101, inf), (0.095, inf), (0.05, 0.5)):
        other = Fit(0.3, score=score, landmark_error=0.4)
        assert select([winner, other], [True, False], apart(2), NOWHERE, 2).rival == pytest.approx(rival)


def test_a_variant_that_may_not_win_counts_only_if_it_is_clearly_better():
    near = np.array([[0, 0.08], [0.08, 0]])
    for score, rival in ((0.11, inf), (0.095, inf), (0.05, 0.5)):
        fits = [Fit(0.3, score=0.10), Fit(0.3, score=score)]
        assert select(fits, [True, False], near, NOWHERE, 2).rival == pytest.approx(rival)


def test_a_near_map_that_fits_as_well_and_sends_a_limb_elsewhere_is_a_rival():
    near = np.array([[0, 0.07], [0.07, 0]])
    for share, score, rival in ((0.08, 0.102, 1.02), (0.08, 0.11, inf), (0.02, 0.102, inf)):
        elsewhere = np.array([[0, share], [share, 0]])
        fits = [Fit(0.3, score=0.10), Fit(0.3, score=score)]
        chosen = select(fits, [True, True], near, elsewhere, 2)
        assert chosen.rival == pytest.approx(rival)
        assert chosen.against is (fits[1] if rival < inf else None)


def test_a_perfect_map_has_no_rival_though_both_are_below_the_noise():
    near, elsewhere = np.array([[0, 0.07], [0.07, 0]]), np.array([[0, 0.08], [0.08, 0]])
    fits = [Fit(0.01, score=0.0), Fit(0.15, score=0.5 * SCORE_NOISE)]
    assert select(fits, [True, True], near, elsewhere, 2).rival == inf


def test_a_variant_of_a_perfect_map_is_no_rival():
    near = np.array([[0, 0.05], [0.05, 0]])
    assert select([Fit(0.01, score=0.0), Fit(0.15, score=0.018)], [True, True], near, NOWHERE, 2).rival == inf


@given(st.lists(st.tuples(st.floats(0.1, 10), st.floats(0, 0.5)), min_size=1, max_size=6))
def test_hints_decide_ties_and_nothing_else(fits):
    made = [Fit(1.0, score=score, hint_error=error) for score, error in fits]
    chosen = select(made, [True] * len(made), apart(len(made)), NOWHERE, 4)
    best = min(score for score, _ in fits)
    tied = [fit for fit in made if fit.score <= BOUNDS.tie * best]
    assert chosen.winner in tied
    assert chosen.winner.hint_error <= min(fit.hint_error for fit in tied) + LANDMARK_SLACK


def test_of_maps_that_tie_the_one_nearest_to_the_hints_wins():
    better, hinted = Fit(0.3, score=0.10, hint_error=0.4), Fit(0.3, score=0.11, hint_error=0.02)
    chosen = select([better, hinted], [True] * 2, apart(2), NOWHERE, 2)
    assert chosen.winner is hinted
    assert chosen.rival == 1, "it does not lose to one that it ties with"
    assert chosen.hints_decided
    worse = Fit(0.3, score=0.13, hint_error=0.02)
    assert select([better, worse], [True] * 2, apart(2), NOWHERE, 2).winner is better


def test_a_mirror_image_ties_as_far_as_the_outcome_says():
    direct, mirrored = Fit(0.3, score=0.10, hint_error=0.3), Fit(0.3, 0.14, -0.9, hint_error=0.02)
    assert select([direct, mirrored], [True] * 2, apart(2), NOWHERE, 2).winner is mirrored
    twisted = Fit(0.3, score=0.16, orientation=-0.9, hint_error=0.02)
    assert select([direct, twisted], [True] * 2, apart(2), NOWHERE, 2).winner is direct


def test_the_candidate_nearest_to_the_hints_is_refined_whatever_its_side():
    best, hinted = Found(1.0, hint_error=0.3), Found(4.0, -0.8, hint_error=0.1)
    order = ranked([hinted, best], "preserve", SETTINGS)
    assert contenders(order, "preserve", SETTINGS) == [best, hinted]
    no_nearer = Found(4.0, -0.8, hint_error=0.28)
    assert contenders([best, no_nearer], "preserve", SETTINGS) == [best]


def test_the_fit_nearest_to_the_hints_is_not_given_up():
    fits = [Fit(1.0, hint_error=0.3), Fit(1.4, hint_error=0.01), Fit(1.3, hint_error=0.2)]
    assert survivors(fits, apart(3), SETTINGS, True, False) == [(0, 0), (1, 1)]


@given(st.lists(st.integers(0, 9), max_size=8), st.sampled_from([None, 1, 3]))
def test_maps_that_are_kept_differ_from_each_other_and_every_other_one_is_like_one_kept(places, most):
    def distances(place, others):
        return np.abs(np.subtract(others, place))

    kept = distinct(places, lambda place: place, distances, 1.5, most, known=[20])
    assert kept == sorted(kept, key=places.index)
    assert all(abs(a - b) > 1.5 for i, a in enumerate(kept) for b in kept[:i])
    if most is None:
        assert all(min(abs(place - other) for other in kept) <= 1.5 for place in places)
    else:
        assert len(kept) <= most


def test_without_rules_about_limbs_only_the_distance_makes_a_rival():
    fits = [Fit(0.3, score=0.10), Fit(0.3, score=0.11), Fit(0.3, score=0.12)]
    rules = Rules(rival_distance=0.1)
    near = np.array([[0, 0.07, 0.2], [0.07, 0, 0.2], [0.2, 0.2, 0]])
    assert selection.select(fits, near, rules).rival == pytest.approx(1.2)
    assert selection.select(fits, near, rules, scores=[3, 2, 6]).winner is fits[1]


def line(a, b):
    """Distances between points of a line, by their numbers."""
    return 0.1 * np.abs(np.asarray(a) - b)


HERE, THERE = np.arange(100), np.arange(100) + 5 * (np.arange(100) >= 60)


def test_costs_are_weighed_by_the_mismatch_where_maps_differ():
    """Mismatches where both maps agree do not count, nor do those that are not known."""
    dear = np.where(HERE < 60, 9.0, 0.7)
    dear[90:] = np.nan
    costs = weighed([1.0, 1.1], [HERE, THERE], [dear, np.full(100, 0.5)], line, [True, True], 2.0)
    assert costs == pytest.approx([1.1 * np.exp(2 * 0.2) / 1.1, 1.1])


def test_the_weights_of_maps_that_agree_or_of_which_nothing_is_known_are_none():
    unknown = np.full(100, np.nan)
    for images, mismatches in (([HERE, HERE], [0 * HERE, 9.0 + HERE]), ([HERE, THERE], [unknown, unknown])):
        assert weighed([1.0, 1.1], images, mismatches, line, [True, True], 2.0) == [1.0, 1.1]
    assert weighed([1.0, 1.1], [HERE, THERE], [0.9 + 0 * HERE, 0.1 + 0 * HERE], line, [True] * 2, 0.0) == [
        1.0,
        1.1,
    ]


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 2, 0]])
def test_of_maps_that_beat_each_other_in_a_ring_the_one_that_loses_least_wins(order):
    """The first beats the second by 0.3 of the mismatch, the second the third by 0.05, and the third the first by 0.2."""
    early = HERE < 50
    images = [HERE, HERE + 5 * early, HERE + 5 * ~early]
    mismatches = [np.where(early, *values) for values in ((0.2, 0.5), (0.5, 0.3), (0.6, 0.3))]
    ordered = ([each[i] for i in order] for each in (images, mismatches))
    costs = weighed([1.0] * 3, *ordered, line, [True] * 3, 2.0)
    assert order[int(np.argmin(costs))] == 2
    assert sorted(costs)[:2] == pytest.approx([1.0, 1.0])
    assert max(costs) == pytest.approx(np.exp(2 * 0.2))


def test_only_eligible_maps_are_the_standard():
    poor, good = 0.9 + 0 * HERE, 0.1 + 0 * HERE
    costs = weighed([1.0, 1.1], [HERE, THERE], [poor, good], line, [True, False], 1.0)
    assert costs == pytest.approx([1.0, 1.1 * np.exp(-0.8)])
    assert weighed([1.0, 1.1], [HERE, THERE], [poor, good], line, [True, True], 1.0)[1] == 1.1
