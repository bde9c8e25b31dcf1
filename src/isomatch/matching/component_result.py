"""One map of shapes of several components, from those of the components."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch.correspondence import UNMATCHED
from isomatch.matching.component_hints import ComponentHints
from isomatch.matching.hints import FEWEST_POINTS
from isomatch.matching.outcome import Outcome
from isomatch.matching.pair import ShapePair
from isomatch.matching.result import MAP_ARRAYS, MatchResult
from isomatch.runtime.stage_timer import StageTimer
from isomatch.shapes import PreparedShape

SIDES = "source", "target"


@dataclass(frozen=True, eq=False)
class ComponentMatch:
    """Two components that are partners.

    Parameters
    ----------
    pair : ShapePair
        The components, each as a prepared shape of the user's whole surface.
    result : MatchResult
        Their map, in the users' vertices.
    remark : str
        How the map was decided upon, if not by the components alone.
    hinted : bool
        Whether the user gave hints for them.
    """

    pair: ShapePair
    result: MatchResult
    remark: str = ""
    hinted: bool = False

    @property
    def share(self) -> float:
        """Share of the area or of the vertices of either shape, the largest one."""
        return max(max(shape.share, _vertex_share(shape)) for shape in (self.pair.source, self.pair.target))


def composed(
    pair: ShapePair, matches: list[ComponentMatch], tied: bool, given: ComponentHints, timer: StageTimer
) -> MatchResult:
    """Sum up the maps of all pairs of components; the first is the main one."""
    main, *others = matches
    bounds = pair.config.outcome
    counted = [
        match.result.outcome
        for match in matches
        if match is main or match.share > bounds.large_component or match.hinted
    ]
    unmatched = [_unpartnered(side, [getattr(match.pair, side) for match in matches], pair) for side in SIDES]
    if max(left_out for left_out, _ in unmatched) > bounds.large_component:
        counted.append(Outcome.PARTIAL)
    notes = [*main.result.notes, *(_described(match) for match in others)]
    if tied:
        counted.append(Outcome.SYMMETRY_AMBIGUOUS)
        notes.append("the largest components may as well be exchanged: nothing tells which are partners")
    if lost := len(given.landmarks) - sum(len(given.landmarks_on(match.pair)) for match in matches):
        notes.append(
            f"{lost} of {len(given.landmarks)} landmarks do not lie on partners, or fewer than {FEWEST_POINTS} on one, "
            "and are left out"
        )
    vertices, corners, weights = (getattr(main.result.map, name).copy() for name in MAP_ARRAYS)
    errors = main.result.expected_error.copy()
    for match in others:
        new = match.result.map.matched & (vertices == UNMATCHED)
        for array, name in zip((vertices, corners, weights), MAP_ARRAYS):
            array[new] = getattr(match.result.map, name)[new]
        errors[new] = match.result.expected_error[new] * np.sqrt(
            match.pair.target.share / main.pair.target.share
        )
    whole = replace(main.result.map, vertices=vertices, faces=corners, barycentric=weights)
    quality = replace(
        main.result.quality,
        matched=float(whole.matched.mean()),
        coverage=sum(match.pair.target.share * match.result.quality.coverage for match in matches),
    )
    return replace(
        main.result,
        map=whole,
        outcome=Outcome.least_sure(counted),
        quality=quality,
        expected_error=errors,
        notes=(*notes, *(note for _, side_notes in unmatched for note in side_notes)),
        timings=timer.stop(),
    )


def _unpartnered(side: str, matched: list[PreparedShape], pair: ShapePair) -> tuple[float, list[str]]:
    """Share of one shape that is unmatched, of the area or of the vertices, and a note on each component of it."""
    components = getattr(pair, side).components
    alone = [components[i] for i in numbers_without(components, matched)]
    notes = [f"{side}: {_named(shape)} has no partner and is left unmatched" for shape in alone]
    tiny = 1 - sum(shape.share for shape in components)
    if tiny > 1e-9:
        notes.append(
            f"{side}: components that cannot be matched by themselves, with {tiny:.1%} of the area, are left unmatched"
        )
    area = tiny + sum(shape.share for shape in alone)
    return max(area, sum(map(_vertex_share, alone))), notes


def _vertex_share(shape: PreparedShape) -> float:
    return float((shape.body_vertex >= 0).mean())


def _named(shape: PreparedShape) -> str:
    size = f"{(shape.body_vertex >= 0).sum()} vertices, {shape.share:.1%} of the area"
    return f"the component of vertex {shape.user_vertex[0]} ({size})"


def _described(match: ComponentMatch) -> str:
    outcome = match.result.outcome.value + (f", {match.remark}" if match.remark else "")
    return f"{_named(match.pair.source)} is matched to {_named(match.pair.target)} of the target: {outcome}"


def numbers_without(side: tuple[PreparedShape, ...], matched: list[PreparedShape]) -> list[int]:
    """Numbers of the components that are not yet matched."""
    return [i for i, shape in enumerate(side) if not any(shape is other for other in matched)]
