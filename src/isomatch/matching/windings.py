"""A scan that seems to be inside out: both windings of its faces are hypotheses."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from isomatch.errors import NotConvergedError
from isomatch.matching.hints import Hints
from isomatch.matching.judge import Solution
from isomatch.matching.outcome import Outcome
from isomatch.matching.pair import ShapePair
from isomatch.matching.solve import looks_apart, solve
from isomatch.matching.stages import Stages
from isomatch.runtime.stage_timer import StageTimer
from isomatch.shapes import turned_over

LEAST_SURE = Outcome.LOW_CONFIDENCE.sureness + 1  # beyond it, outcomes differ in kind


def side_to_turn(pair: ShapePair) -> Literal["source", "target"] | None:
    """Name the shape that seems to be inside out, if only one of them does; two that do agree with each other."""
    if pair.config.orientation == "any" or not pair.oriented:
        return None
    source, target = pair.source.seems_inside_out, pair.target.seems_inside_out
    return None if source == target else "source" if source else "target"


def solve_either_winding(pair: ShapePair, hints: Hints, stages: Stages, timer: StageTimer) -> Solution:
    """Match the bodies of two shapes; of one that seems to be inside out, with its faces as they are and turned over.

    A map that is not doubtful wins over one that is; otherwise that under which the bodies look more alike around
    vertices and their images.

    Parameters and errors are those of `solve`.
    """
    side = side_to_turn(pair)
    if side is None:
        return solve(pair, hints, stages, timer)
    turned = replace(pair, **{side: turned_over(getattr(pair, side))})  # type: ignore[arg-type]
    solutions: dict[str, Solution] = {}
    failure = None
    for how, wound in (("as they are", pair), ("turned over", turned)):
        try:
            with timer.within(f"faces {how}"):
                solutions[how] = solve(wound, hints, stages, timer)
        except NotConvergedError as error:
            failure = error
    if failure and not solutions:
        raise failure

    def fit(how: str) -> tuple[int, float]:
        found = solutions[how]
        looks = looks_apart(found.pair, found)
        return min(found.outcome.sureness, LEAST_SURE), -looks if np.isfinite(looks) else -np.inf

    timer.start("quality")
    fits = max(solutions, key=fit)
    note = f"the {side} seems to be inside out; of both windings of its faces, the map fits better with them {fits}"
    return replace(solutions[fits], pair=pair, notes=(note, *solutions[fits].notes))
