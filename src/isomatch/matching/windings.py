"""A scan that seems to be inside out: both windings of its faces are hypotheses."""

from __future__ import annotations

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
    if side == "source":
        turned = replace(pair, source=turned_over(pair.source))
    else:
        turned = replace(pair, target=turned_over(pair.target))
    solutions: dict[str, Solution] = {}
    failure = None
    for how, wound in (("as they are", pair), ("turned over", turned)):
        timer.start(f"faces {how}")
        try:
            solutions[how] = solve(wound, hints, stages, timer)
        except NotConvergedError as error:
            failure = error
    if failure and not solutions:
        raise failure

    def fit(how: str) -> tuple[int, float]:
        found = solutions[how]
        return found.outcome.sureness, -looks_apart(found.pair, found)

    fits = max(solutions, key=fit)
    note = f"the {side} seems to be inside out; of both windings of its faces, the map fits better with them {fits}"
    return replace(solutions[fits], notes=(note, *solutions[fits].notes))
