"""The seconds of stages: they follow one another and add up, whatever way a match goes."""

import json
from time import sleep

import pytest

from isomatch import MatchResult, match
from isomatch._core.stage_timer import StageTimer
from isomatch.datasets import example_pair
from isomatch_lab.damage import cut

BESIDE = "source: ", "target: "  # stages of the preparation of either shape, which run at the same time


def adds_up(timings: dict[str, float]) -> bool:
    """Whether no stage is negative, and those that follow one another take as long as all."""
    one_by_one = [
        spent for stage, spent in timings.items() if stage != "total" and not stage.startswith(BESIDE)
    ]
    return min(timings.values()) >= 0 and sum(one_by_one) == pytest.approx(
        timings["total"], rel=0.03, abs=0.01
    )


def test_stages_are_named_after_what_they_belong_to():
    told = []
    timer = StageTimer(lambda stage: told.append(stage))
    timer.start("prepare")
    with timer.within("component 2"), timer.within("holes closed"):
        timer.start("search")
    timer.start("search")
    assert told == ["prepare", "component 2: holes closed: search", "search"]
    assert list(timer.stop()) == [*told, "total"]


def test_a_stage_that_starts_again_goes_on():
    timer = StageTimer()
    for stage in ("search", "quality", "search"):
        timer.start(stage)
        sleep(0.02)
    timings = timer.stop()
    assert timings["search"] > 1.5 * timings["quality"]
    assert adds_up(timings)


def test_what_runs_beside_does_not_count():
    timer = StageTimer()
    timer.start("prepare")
    timer.beside("source", {"distances": 100.0})
    timings = timer.stop()
    assert timings["source: distances"] == 100.0
    assert timings["total"] < 1.0
    assert adds_up(timings)


def test_a_scope_ends_with_an_error():
    timer = StageTimer()
    with pytest.raises(KeyError), timer.within("part"):
        raise KeyError
    timer.start("quality")
    assert "quality" in timer.stop()


@pytest.fixture(scope="module")
def of_a_part() -> MatchResult:
    source, target = (shape.mesh for shape in example_pair())
    return match(cut(source, 0.5).mesh, target)


@pytest.mark.long
def test_a_part_says_where_its_time_went(of_a_part):
    told = json.loads(json.dumps(of_a_part.to_dict()))["timings"]
    assert {
        "prepare",
        "part: search",
        "part: refinement",
        "part: bending",
        "part: quality",
        "total",
    } <= told.keys()
    assert {
        f"{side}{stage}" for side in BESIDE for stage in ("body", "distances", "functions")
    } <= told.keys()
    assert adds_up(told)


@pytest.mark.long
def test_a_complete_pair_says_where_its_time_went():
    timings = match(*(shape.mesh for shape in example_pair())).timings
    assert {"prepare", "search", "selection", "refinement", "quality"} <= timings.keys()
    assert adds_up(timings)
