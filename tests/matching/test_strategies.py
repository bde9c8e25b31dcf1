"""Which strategies would be tried is told without matching, and a result names the evidence that decided its outcome."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from isomatch import Config, MatchResult, Outcome, match
from isomatch._core.stage_timer import StageTimer
from isomatch.matching import (
    STRATEGIES,
    Evidence,
    Isometry,
    Priors,
    outcome_of,
    prepare_pair,
    select_strategies,
    strategies,
)
from isomatch.matching.strategies import (
    BOTH_SIDES,
    BOTH_SIDES_LAST,
    PART,
    Attempts,
    part_of,
)
from isomatch_lab.damage import cut
from shapes import box

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def problem(example):
    return prepare_pair(*(animal.mesh for animal in example))


@pytest.fixture(scope="module")
def part(example):
    return cut(example[0].mesh, 0.3, seed=1).mesh


def names(problem):
    return [name for name, _ in select_strategies(problem)]


def test_of_complete_shapes_an_isometry_is_tried_then_an_elastic_map_then_both_sides(problem):
    assert names(problem) == ["isometry", "elastic", "isometry from both sides"]
    assert all(name in STRATEGIES and why for name, why in select_strategies(problem))


def test_priors_doubtful_seek_no_elastic_map(problem):
    given = replace(problem, config=replace(problem.config, hypotheses="given"))
    assert names(given) == ["isometry"]


@pytest.mark.parametrize("asked", ["auto", "source"])
def test_of_a_part_the_part_is_tried_with_and_without_its_holes_closed(example, part, asked):
    problem = prepare_pair(part, example[1].mesh, Config(part=asked))
    ways = {"part", "holes closed", "part, from the holes closed", "part, from both sides"}
    assert set(names(problem)) == set(names(problem.turned)) == ways
    assert (part_of(problem), part_of(problem.turned)) == ("source", "target")
    parts = replace(problem.config.parts, close_holes=False)
    assert names(replace(problem, config=replace(problem.config, parts=parts))) == ["part"]


def test_a_part_is_searched_only_if_no_map_before_is_sure(problem):
    """A symmetric part is sure, though the search from the other side finds no other map to call right."""
    ambiguous = SimpleNamespace(outcome=Outcome.SYMMETRY_AMBIGUOUS)
    assert PART.applies(Attempts(problem, StageTimer()))
    assert not PART.applies(Attempts(problem, StageTimer(), solutions=[ambiguous]))


def test_two_parts_are_tried_as_such(part):
    both_sides = "isometry from both sides"
    assert names(prepare_pair(part, part)) == ["isometry", both_sides, "two parts", both_sides]


def test_a_poor_isometry_of_two_parts_is_searched_from_both_sides_last_if_it_may_win(
    problem, part, monkeypatch
):
    monkeypatch.setattr(strategies, "is_sure", lambda model, ranking: False)
    matches = {"isometry": SimpleNamespace(model=None, ranking=None)}
    two_parts = SimpleNamespace(way="two parts", flags=(), outcome=Outcome.LOW_CONFIDENCE)

    def tries_both_sides(problem, *flags, cost=1.0):
        found = SimpleNamespace(way="isometry", flags=flags, outcome=Outcome.LOW_CONFIDENCE)
        costs = {"isometry": cost, "two parts": 1.0}
        tried = Attempts(problem, StageTimer(), solutions=[found, two_parts], matches=matches, costs=costs)
        return [strategy.applies(tried) for strategy in (BOTH_SIDES, BOTH_SIDES_LAST)]

    parts = prepare_pair(part, part)
    assert tries_both_sides(problem, "poor", "ambiguous") == [True, False]
    assert tries_both_sides(parts, "ambiguous") == [True, False]
    assert tries_both_sides(parts, "poor", "ambiguous") == [False, True]
    assert tries_both_sides(parts, "poor", cost=3.0) == [False, False]


def test_what_was_handed_in_is_all_that_is_tried(problem):
    assert names(replace(problem, relation=Isometry)) == ["Isometry"]


@pytest.mark.long
def test_what_found_the_map_was_selected(prepared_example, problem):
    assert match(*prepared_example).way in names(problem)


def test_nothing_is_known_by_default(problem):
    assert not Priors().any
    assert not problem.priors.any
    assert problem.turned.turned.source is problem.source


@pytest.mark.long
def test_a_result_tells_the_evidence_that_decided_its_outcome(prepared_example, tmp_path):
    sure = match(*prepared_example)
    assert (sure.outcome, sure.evidence) == (Outcome.CONVERGED, ())
    brick = box(4, 6, 8)
    doubtful = match(brick, brick)
    assert doubtful.evidence == ("ambiguous",)
    assert outcome_of([Evidence(**dict.fromkeys(doubtful.evidence, True))]) is doubtful.outcome
    doubtful.save(tmp_path / "result.npz")
    assert MatchResult.load(tmp_path / "result.npz").evidence == doubtful.evidence
    assert doubtful.to_dict()["evidence"] == list(doubtful.evidence)
