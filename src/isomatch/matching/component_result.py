"""One map of shapes of several components, from those of the components."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from isomatch.correspondence import UNMATCHED
from isomatch.matching.component_hints import ComponentHints
from isomatch.matching.hints import FEWEST_POINTS
from isomatch.matching.judge import Evidence, Solution
from isomatch.matching.pair import ShapePair
from isomatch.matching.result import MAP_ARRAYS
from isomatch.shapes import PreparedShape, components_of

SIDES = "source", "target"


@dataclass(frozen=True, eq=False)
class ComponentMatch:
    """Two components that are partners.

    Parameters
    ----------
    solution : Solution
        Their map, in the users' vertices; its pair are the components, each as a prepared shape of the whole surface.
    remark : str
        How the map was decided upon, if not by the components alone.
    hinted : bool
        Whether the user gave hints for them.
    """

    solution: Solution
    remark: str = ""
    hinted: bool = False

    @property
    def pair(self) -> ShapePair:
        """The components."""
        return self.solution.pair

    @property
    def share(self) -> float:
        """Share of the area or of the vertices of either shape, the largest one."""
        return max(max(shape.share, _vertex_share(shape)) for shape in (self.pair.source, self.pair.target))


def composed(pair: ShapePair, matches: list[ComponentMatch], tied: bool, hints: ComponentHints) -> Solution:
    """Sum up the maps of all pairs of components; the first is the main one.

    The map is no surer than that of any component that is large, or has hints of its own.
    """
    main, *others = matches
    bounds = pair.config.outcome
    counted = [
        match.solution.evidence
        for match in matches
        if match is main or match.share > bounds.large_component or match.hinted
    ]
    unmatched = [_unpartnered(side, [getattr(match.pair, side) for match in matches], pair) for side in SIDES]
    large = max(left_out for left_out, _ in unmatched) > bounds.large_component
    evidence = (*chain(*counted), Evidence(partial=large, ambiguous=tied))
    notes = [*main.solution.notes, *(_described(match) for match in others)]
    if tied:
        notes.append("the largest components may as well be exchanged: nothing tells which are partners")
    if lost := len(hints.landmarks) - sum(len(hints.landmarks_on(match.pair)) for match in matches):
        notes.append(
            f"{lost} of {len(hints.landmarks)} landmarks do not lie on partners, or fewer than {FEWEST_POINTS} on one, "
            "and are left out"
        )
    vertices, corners, weights = (getattr(main.solution.map, name).copy() for name in MAP_ARRAYS)
    errors = main.solution.expected_error.copy()
    mismatch = None if main.solution.mismatch is None else main.solution.mismatch.copy()
    for match in others:
        new = match.solution.map.matched & (vertices == UNMATCHED)
        for array, name in zip((vertices, corners, weights), MAP_ARRAYS):
            array[new] = getattr(match.solution.map, name)[new]
        if mismatch is not None and match.solution.mismatch is not None:
            mismatch[new] = match.solution.mismatch[new]
        errors[new] = match.solution.expected_error[new] * np.sqrt(
            match.pair.target.share / main.pair.target.share
        )
    whole = replace(main.solution.map, vertices=vertices, faces=corners, barycentric=weights)
    quality = replace(
        main.solution.quality,
        matched=float(whole.matched.mean()),
        coverage=sum(match.pair.target.share * match.solution.quality.coverage for match in matches),
    )
    return replace(
        main.solution,
        map=whole,
        evidence=evidence,
        quality=quality,
        expected_error=errors,
        mismatch=mismatch,
        regions=tuple(sorted(chain(*(m.solution.regions for m in matches)), key=lambda region: -region.area)),
        notes=(*notes, *(note for _, side_notes in unmatched for note in side_notes)),
    )


def _unpartnered(side: str, matched: list[PreparedShape], pair: ShapePair) -> tuple[float, list[str]]:
    """Share of one shape that is unmatched, of the area or of the vertices, and a note on each component of it."""
    components = components_of(getattr(pair, side))
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
    outcome = match.solution.outcome.value + (f", {match.remark}" if match.remark else "")
    return f"{_named(match.pair.source)} is matched to {_named(match.pair.target)} of the target: {outcome}"


def numbers_without(side: tuple[PreparedShape, ...], matched: list[PreparedShape]) -> list[int]:
    """Numbers of the components that are not yet matched."""
    return [i for i, shape in enumerate(side) if not any(shape is other for other in matched)]
