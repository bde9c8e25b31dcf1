"""A match under one model: propose, refine, rank, measure, sum up."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from isomatch._core.stage_timer import StageTimer
from isomatch.matching.assessment.evidence import Solution
from isomatch.matching.model import Match, MatchingModel

M = TypeVar("M")
C = TypeVar("C")


def match_under(model: MatchingModel[M, C], timer: StageTimer) -> Solution:
    """Find a map under a model, and the evidence about it."""
    return finish(search_under(model, timer), timer)


def search_under(model: MatchingModel[M, C], timer: StageTimer | None = None) -> Match[M, C]:
    """Propose maps, refine the contenders, and rank them."""
    timer = timer or StageTimer()
    model.require_suitable()
    proposals = model.propose(timer)
    timer.start("refinement")
    maps, rivals = model.refine(proposals.contenders), model.refine(proposals.rivals)
    return Match(model, proposals, model.rank(maps, rivals, proposals, timer))


def finish(match: Match[M, C], timer: StageTimer, is_last: bool = True) -> Solution:
    """Compute precise images, measure and sum up the map; complete it if it is the last."""
    if match.model.last_stage:
        timer.start(match.model.last_stage)
    _ = match.coordinates  # computed now, so that their time belongs to this stage
    timer.start("quality")
    return match.model.sum_up(match, replace(match.measured, is_last=is_last), timer)
