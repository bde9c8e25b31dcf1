"""Solve each relation that fits a pair of connected shapes, and both windings of one that seems to be inside out."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np

from isomatch.errors import NotConvergedError
from isomatch.matching.pair import ShapePair, search_pairs
from isomatch.matching.priors import Priors
from isomatch.matching.quality import descriptor_distance_of, mean_known
from isomatch.matching.relations.both_parts import BothParts
from isomatch.matching.relations.closed import (
    ClosedMatch,
    has_own_distances,
    match_closed,
    match_creased,
    match_cut,
    with_doubt,
)
from isomatch.matching.relations.elastic import FAR, FAR_KEPT, Elastic, far_from_isometric
from isomatch.matching.relations.isometry import IsometricMatch, Isometry
from isomatch.matching.relations.part import Part, PartSide
from isomatch.matching.result import Outcome
from isomatch.matching.selection import CLEARLY_BETTER
from isomatch.matching.stages import Stages
from isomatch.matching.verification import Evidence, Solution, closed_evidence, fits_badly, measured_evidence
from isomatch.runtime.stage_timer import StageTimer
from isomatch.shapes import crease_length, opened_shape, turned_over

# in √area, by which creases of shapes with touching limbs are longer; docs/lab/design_notes.md
MORE_CREASES = 1.0
SURE = Outcome.CONVERGED, Outcome.PARTIAL, Outcome.SYMMETRY_AMBIGUOUS


def solve(pair: ShapePair, priors: Priors, stages: Stages, timer: StageTimer) -> Solution:
    """Match the bodies of two shapes by the relations that fit them."""
    if stages.relation is not None:
        return stages.relation.on(pair, priors, stages).solution(timer)
    role = part_role(pair, priors, stages)
    if role == "both":
        return _solve_two_parts(pair, priors, stages, timer)
    if role:
        return _solve_part(Part(role).on(pair, priors, stages), timer)
    relation = Isometry().on(pair, priors, stages)
    return solve_touching(relation, relation.match(timer), timer)[0]


def solve_touching(relation: Isometry, isometric: IsometricMatch, timer: StageTimer) -> tuple[Solution, bool]:
    """Sum up the match of complete shapes, or a better one with limbs apart that touch; and whether it is such."""
    cut = fused_limbs_cut(relation, isometric, relation.pair, relation.priors, timer)
    solution = cut.solution(timer) if cut else solve_complete(relation, isometric, timer)
    apart = _limbs_apart(solution, relation.priors, relation.stages, timer)
    return apart or solution, bool(cut or apart)


def fused_limbs_cut(
    relation: Isometry, isometric: IsometricMatch, pair: ShapePair, priors: Priors, timer: StageTimer
) -> ClosedMatch | None:
    """Match with self-contacts cut of the shape that has more handles, or of both; None unless that scores better."""
    stages, complete = relation.stages, relation.pair is pair
    if not _seeks_self_contacts(pair, priors, stages):
        return None
    best, score = None, isometric.selection.winner.score
    ours, theirs = pair.source.handles, pair.target.handles
    more = max(ours - theirs, 0), max(theirs - ours, 0)
    for counts in dict.fromkeys([more, (ours, theirs)]):
        if max(counts):
            with timer.within("self-contacts cut"):
                cut = match_cut(pair, priors, stages, timer, *counts)
            if cut and cut.score < score:
                best, score = cut, cut.score

    # If the best map fits badly, the shape is also cut along its creases, if it has self-contacts to be cut, or
    # clearly longer creases than the other: shapes of two kinds have natural folds of about the same length. With
    # handles, both are.
    def fits_poorly() -> bool:
        quality = (best.isometric if best else isometric).measured.quality
        return measured_evidence(pair, quality, pair.config.orientation).poor

    if not fits_poorly():
        return best
    tried = [(more, False)] if max(more) or (complete and _one_is_creased(pair)) else []
    if min(ours, theirs):
        tried.append(((ours, theirs), True))
    for counts, both in tried:
        if not fits_poorly():
            break
        with timer.within("creases cut"):
            for cut in match_creased(pair, priors, stages, timer, counts, score, both):
                if cut.score < score:
                    best, score = cut, cut.score
    return best


def _one_is_creased(pair: ShapePair) -> bool:
    """Whether one shape has clearly longer creases."""
    return abs(crease_length(pair.source) - crease_length(pair.target)) > MORE_CREASES


def _seeks_self_contacts(pair: ShapePair, priors: Priors, stages: Stages) -> bool:
    """Whether limbs may be fused: of meshes whose distances were not given, by a refinement that looks further."""
    settings = pair.config.preparation
    wanted = settings.self_contact_concavity and not priors.functions[0].shape[1] and pair.oriented
    if not wanted or has_own_distances(pair) or not stages.refinement.searches_further:
        return False
    return max(pair.source.handles, pair.target.handles) <= settings.most_self_contacts


def _limbs_apart(solution: Solution, priors: Priors, stages: Stages, timer: StageTimer) -> Solution | None:
    """Match a source that has more handles with its self-contacts and creases open, as a part, where a map is poor."""
    # What limbs hide where they touch is missing, and distances lie between those of fused limbs and of limbs apart. Such
    # a map is taken, no surer than before, if the bodies look more alike under it. Of a target that is a part much of the
    # source would be left without images.
    pair = solution.pair
    more = pair.source.handles - pair.target.handles
    if solution.outcome is not Outcome.LOW_CONFIDENCE or more <= 0 or pair.config.orientation != "preserve":
        return None
    if not _seeks_self_contacts(pair, priors, stages):
        return None
    with timer.within("limbs apart"):
        timer.start("prepare")
        opened = opened_shape(pair.source, more)
    if opened is None:
        return None
    apart = replace(pair, source=opened)
    with suppress(NotConvergedError), timer.within("limbs apart"):
        of_part = Part("source").on(apart, priors, stages).solution(timer)
        if mean_descriptor_distance(pair, of_part) < mean_descriptor_distance(pair, solution):
            return replace(of_part, pair=pair).with_evidence(Evidence(poor=True))
    return None


def mean_descriptor_distance(pair: ShapePair, solution: Solution) -> float:
    """How differently the bodies look around vertices and their images, on average, both as they are."""
    image = solution.map.vertices[pair.source.user_vertex]
    matched = image >= 0
    image = pair.target.body_vertex[image]
    descriptor_distance = descriptor_distance_of(pair.source.balls, pair.target.balls, image, matched)
    return mean_known(descriptor_distance, pair.source.body.vertex_areas)


def part_role(pair: ShapePair, priors: Priors, stages: Stages) -> PartSide | Literal["both"] | None:
    """Tell which shape is a part of the other, or whether both are parts of something that neither shows."""
    # a part has a long boundary; only refinements that look further, of maps that preserve the orientation, know of parts
    config = pair.config
    searches_further = stages.refinement.searches_further and config.orientation == "preserve"
    if config.part == "none" or not pair.oriented or not searches_further or priors.functions[0].shape[1]:
        return None
    if config.part != "auto":
        return config.part
    longest = config.parts.long_boundary
    open_source, open_target = (x.longest_boundary > longest for x in (pair.source, pair.target))
    if open_source and open_target:
        return "both"
    return "source" if open_source else "target" if open_target else None


def solve_complete(relation: Isometry, isometric: IsometricMatch, timer: StageTimer) -> Solution:
    """Sum up the match of complete shapes; if the map does not fit well, an elastic one may take its place."""
    timer.start("quality")
    measured, note = isometric.measured, None
    if far_from_isometric(relation, measured.quality):
        elastic = _elastic(relation, isometric)
        with timer.within("elastic match"):
            timer.start("bending")
            selection, reason = (None, "") if elastic.is_needless else elastic.match(timer)
            if selection and not elastic.keeps_lengths(selection.winner):
                timer.start("precision")
                measured, note = elastic.measure(selection, reason), FAR
            elif selection:
                bending_cost = selection.winner.score
                quality = replace(measured.quality, runner_up=selection.runner_up, bending_cost=bending_cost)
                measured, note = replace(measured, quality=quality), FAR_KEPT
        timer.start("quality")
    return relation.summed_up(isometric, measured, timer, note)


def _elastic(relation: Isometry, isometric: IsometricMatch) -> Elastic:
    """Match elastically, from the winner and all candidates too."""
    pair = relation.pair
    others = [
        (search_pairs(pair, candidate.target_row), candidate.hypothesis.origin)
        for candidate in isometric.eligible
        if candidate.orientation > 0
    ]
    fits = not fits_badly(isometric.measured.quality, pair.config.outcome)
    return Elastic(isometric.selection.winner, others, fits).on(pair, relation.priors, relation.stages)


def _solve_part(part: Part, timer: StageTimer) -> Solution:
    """Match a part as it is, and with its holes closed, unless the first of the two is sure."""
    # The part as it is comes first, unless little is missing. Then the shapes with their holes closed do, and if that is
    # sure, the part is matched from there without a search of its own.
    pair, priors, stages = part.pair, part.priors, part.stages
    if not pair.config.parts.close:
        return part.solution(timer)
    touching = (
        _seeks_self_contacts(pair, priors, stages) and max(pair.source.handles, pair.target.handles) > 0
    )
    if not (touching or part.closes_first):
        with suppress(NotConvergedError):
            own = part.solution(timer)
            if part.is_sure(own):
                return own
    with timer.within("holes closed"):
        closed = match_closed(pair, priors, stages, timer)
    if closed and (cut := fused_limbs_cut(closed.relation, closed.isometric, pair, priors, timer)):
        solution = cut.solution(timer).with_evidence(Evidence(partial=True))
        if solution.outcome is Outcome.PARTIAL or CLEARLY_BETTER * cut.score < closed.score:
            return solution
        closed = cut
    if closed and part.closes_first and closed.solution(timer).outcome is Outcome.CONVERGED:
        led = part.led_by(closed, alone=True).solution(timer)
        if led.outcome is Outcome.PARTIAL:
            return led
    return part.led_by(closed).solution(timer)


def _solve_two_parts(pair: ShapePair, priors: Priors, stages: Stages, timer: StageTimer) -> Solution:
    """Match two parts: as two patches of the same extent, as overlapping parts of a body, and with holes closed."""
    # The first map that is sure is returned. If none is, and the shapes fit no better with their holes closed, it may be
    # an elastic one; otherwise it is that of overlapping parts.
    relation = Isometry().on(pair, priors, stages)
    isometric = relation.match(timer)
    timer.start("quality")
    as_they_are = relation.summed_up(isometric, isometric.measured, timer)
    if as_they_are.outcome in SURE:
        return as_they_are
    overlapping = None
    with suppress(NotConvergedError):
        overlapping = BothParts().on(pair, priors, stages).solution(timer)
        if overlapping.outcome in SURE:
            return overlapping
    with timer.within("holes closed"):
        closed = match_closed(pair, priors, stages, timer) if pair.config.parts.close else None
    residual = isometric.selection.winner.spectral_residual
    if closed and closed.isometric.selection.winner.spectral_residual <= residual:
        with_caps, doubt = closed.solution(timer), closed.doubt
        evidence = closed_evidence(doubt.evidence, with_caps.evidence)
        note = "both shapes were matched with their holes closed"
        with_caps = with_doubt(with_caps, evidence, doubt, note, len(priors.landmarks) > 0)
        return with_caps if with_caps.outcome in SURE or overlapping is None else overlapping
    complete = solve_complete(relation, isometric, timer)
    return overlapping if overlapping and complete.outcome not in SURE else complete


LEAST_SURE = Outcome.LOW_CONFIDENCE.sureness + 1  # beyond it, outcomes differ in kind


def side_to_turn(pair: ShapePair) -> Literal["source", "target"] | None:
    """Name the shape that seems to be inside out, if only one of them does; two that do agree with each other."""
    if pair.config.orientation == "any" or not pair.oriented:
        return None
    source, target = pair.source.seems_inside_out, pair.target.seems_inside_out
    return None if source == target else "source" if source else "target"


def solve_either_winding(pair: ShapePair, priors: Priors, stages: Stages, timer: StageTimer) -> Solution:
    """Match the bodies of two shapes; one that seems to be inside out also with its faces turned over."""
    side = side_to_turn(pair)
    if side is None:
        return solve(pair, priors, stages, timer)
    turned = replace(pair, **{side: turned_over(getattr(pair, side))})  # type: ignore[arg-type]
    solutions: dict[str, Solution] = {}
    for how, wound in (("as they are", pair), ("turned over", turned)):
        try:
            with timer.within(f"faces {how}"):
                solutions[how] = solve(wound, priors, stages, timer)
        except NotConvergedError:
            if wound is turned and not solutions:
                raise

    # a map that is not doubtful wins over one that is; otherwise that under which the bodies look more alike
    def fit(how: str) -> tuple[int, float]:
        solution = solutions[how]
        distance = mean_descriptor_distance(solution.pair, solution)
        return min(solution.outcome.sureness, LEAST_SURE), -distance if np.isfinite(distance) else -np.inf

    timer.start("quality")
    fits = max(solutions, key=fit)
    note = f"the {side} seems to be inside out; of both windings of its faces, the map fits better with them {fits}"
    return replace(solutions[fits], pair=pair, notes=(note, *solutions[fits].notes))
