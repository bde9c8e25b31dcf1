"""A scan that seems to be inside out: both windings of its faces are hypotheses."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from isomatch.errors import NotConvergedError
from isomatch.matching.hints import Hints
from isomatch.matching.judge import Solution
from isomatch.matching.pair import ShapePair
from isomatch.matching.solve import looks_apart, solve
from isomatch.matching.stages import Stages
from isomatch.runtime.stage_timer import StageTimer
from isomatch.shapes import turned_over


def side_to_turn(pair: ShapePair) -> str | None:
    """Name the shape that seems to be inside out, if only one of them does; two that do agree with each other."""
    seem = {side: getattr(pair, side).seems_inside_out for side in ("source", "target")}
    if pair.config.orientation == "any" or not pair.oriented or all(seem.values()):
        return None
    return next((side for side, inside_out in seem.items() if inside_out), None)


def solve_either_winding(pair: ShapePair, hints: Hints, stages: Stages, timer: StageTimer) -> Solution:
    """Match the bodies of two shapes; of one that seems to be inside out, with its faces as they are and turned over.

    The surer map wins; of two as sure ones, that under which the bodies look more alike around vertices and their images.

    Parameters and errors are those of `solve`.
    """
    side = side_to_turn(pair)
    if side is None:
        return solve(pair, hints, stages, timer)
    solutions: dict[str, Solution] = {}
    with suppress(NotConvergedError):
        solutions["as they are"] = solve(pair, hints, stages, timer)
    timer.start("turned over")
    turned = replace(pair, **{side: turned_over(getattr(pair, side))})
    try:
        solutions["turned over"] = solve(turned, hints, stages, timer)
    except NotConvergedError:
        if not solutions:
            raise
    fits = max(
        solutions,
        key=lambda how: (solutions[how].outcome.sureness, -looks_apart(solutions[how].pair, solutions[how])),
    )
    note = f"the {side} seems to be inside out; of both windings of its faces, the map fits better with them {fits}"
    return replace(solutions[fits], notes=(note, *solutions[fits].notes))
