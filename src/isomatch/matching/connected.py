"""The match of two connected shapes: as complete ones, or one as a part of the other."""

from __future__ import annotations

from isomatch.matching.complete import complete_result, match_complete
from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair
from isomatch.matching.parts import part_of, part_result
from isomatch.matching.result import MatchResult
from isomatch.runtime.stage_timer import StageTimer


def match_connected(pair: ShapePair, hints: Hints, timer: StageTimer, seed: int) -> MatchResult:
    """Match the bodies of two shapes.

    Raises
    ------
    SettingError
        If hints are asked for and none was given.
    NotConvergedError
        If no map of a part keeps the orientation.
    """
    part = part_of(pair, hints)
    if part:
        return part_result(pair, hints, part, timer, seed)
    return complete_result(match_complete(pair, hints, timer), timer, seed)
