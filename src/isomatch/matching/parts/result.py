"""The result of a match of a part: the map in the direction asked for, its quality and its outcome."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch.correspondence import PrecisePoints
from isomatch.matching.complete import complete_result, match_complete
from isomatch.matching.hints import Hints
from isomatch.matching.outcome import Outcome
from isomatch.matching.pair import ShapePair, SmoothPair
from isomatch.matching.parts.closing import match_closed
from isomatch.matching.parts.evidence import Evidence
from isomatch.matching.parts.match_part import PartMatch, match_part
from isomatch.matching.parts.role import Part, Parts
from isomatch.matching.quality import (
    contradicted_landmarks,
    covered_share,
    distances_to_hints,
    edge_stretch,
    image_positions,
)
from isomatch.matching.result import MatchResult, Quality
from isomatch.matching.starts import nearest_in_pose
from isomatch.matching.vertex_confidence import expected_errors
from isomatch.runtime.stage_timer import StageTimer
from isomatch.shapes import describe_symmetries
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

SURE = Outcome.CONVERGED, Outcome.PARTIAL


def part_result(pair: ShapePair, hints: Hints, part: Parts, timer: StageTimer, seed: int) -> MatchResult:
    """Match a pair of which one shape is a part of the other, or both are parts of a third."""
    return (
        _both_result(pair, hints, timer, seed) if part == "both" else _result(pair, hints, part, timer, seed)
    )


def _both_result(pair: ShapePair, hints: Hints, timer: StageTimer, seed: int) -> MatchResult:
    """Match two parts: as two patches of the same extent, and if these fit badly, with their holes closed."""
    found = match_complete(pair, hints, timer)
    as_they_are = complete_result(found, timer, seed, may_stretch=False)
    if as_they_are.outcome in (*SURE, Outcome.SYMMETRY_AMBIGUOUS):
        return as_they_are
    timer.start("holes closed")
    closed = match_closed(pair, hints, timer) if pair.config.parts.close else None
    if closed is None or closed.found.selection.winner.misfit > found.selection.winner.misfit:
        return complete_result(found, timer, seed)
    evidence, with_caps = closed.evidence, closed.result(hints, timer, seed)
    doubted = with_caps.outcome is Outcome.LOW_CONFIDENCE
    note = "both shapes were matched with their holes closed"
    outcome = evidence.outcome if doubted else with_caps.outcome
    return _closed_result(with_caps, outcome, evidence, hints, note)


def _result(pair: ShapePair, hints: Hints, part: Part, timer: StageTimer, seed: int) -> MatchResult:
    source, target, config = pair.source, pair.target, pair.config
    timer.start("holes closed")
    closed = match_closed(pair, hints, timer) if config.parts.close else None
    image = None if closed is None else closed.image_of(part)
    timer.start("parts")
    known = _known(pair, hints)
    if part == "source":
        found = match_part(source, target, config, hints.landmarks, image, known)
    else:
        found = match_part(target, source, config, hints.landmarks[:, ::-1], image, known[:, ::-1])
    outcome = found.evidence.outcome
    if closed is not None and image is not None:
        returned, agrees = found.closed < config.parts.closed_score, found.agrees(image)
        if returned or (agrees and outcome is not Outcome.PARTIAL):
            with_caps = closed.result(hints, timer, seed)
            if agrees and outcome is Outcome.LOW_CONFIDENCE and with_caps.outcome in SURE:
                outcome = Outcome.PARTIAL  # by the measures of complete shapes
            elif not agrees or with_caps.outcome is Outcome.SYMMETRY_AMBIGUOUS:
                outcome = Outcome.least_sure((outcome, with_caps.outcome))
            if returned and with_caps.outcome is not Outcome.HINTS_CONTRADICTED:
                note = (
                    f"the {part} was matched as a part with its holes closed: it has {found.share:.0%} of the area of "
                    "the other shape"
                )
                with_caps = replace(with_caps, quality=replace(with_caps.quality, rival=found.rival))
                return _closed_result(with_caps, outcome, found.evidence, hints, note)
    onto_whole, (onto_part, covered) = found.bent.onto_whole, found.bent.onto_part()
    errors, area = _expected_errors(found, onto_whole), found.pair.meshes[1].vertex_areas[covered].sum()
    if part == "source":
        points, matched = onto_whole, np.ones(len(errors), dtype=bool)
    else:
        points, matched = onto_part, covered
        errors = errors[points.corners[:, 0]] / found.pair.unit
    timer.start("quality")
    quality = _quality(pair, found, points, matched, hints)
    if _contradicts(pair, points, quality, hints):
        outcome = Outcome.HINTS_CONTRADICTED
    in_full = source.correspondence(target, points, matched)
    return MatchResult(
        map=in_full,
        outcome=outcome,
        quality=quality,
        expected_error=np.where(in_full.matched, source.lift_smooth(errors), np.nan),
        alternatives=(),
        timings=timer.stop(),
        notes=(
            *pair.notes,
            *hints.notes,
            f"the {part} was matched as a part: it has {found.share:.0%} of the area of the other shape and covers "
            f"{area:.0%}",
            *_doubts(outcome, found.evidence, hints),
            *contradicted_landmarks(pair, points, hints),
        ),
        engine=source.distances.engine,
        origin=_origin(found, hints),
        reason=f"fits best of {len(found.fits)} maps of a part refined to the end",
        config=config,
        seed=seed,
        symmetries=(describe_symmetries(source.symmetries), describe_symmetries(target.symmetries)),
    )


def _known(pair: ShapePair, hints: Hints) -> IntArray:
    """Pairs of vertices (q, 2) known beside landmarks: by the initial map, or by the pose."""
    if len(hints.known) or pair.config.start != "pose":
        return hints.known
    vertices = np.arange(pair.source.body.n_vertices)
    return np.column_stack([vertices, nearest_in_pose(pair.source, pair.target, vertices)])


def _origin(found: PartMatch, hints: Hints) -> str:
    if len(hints.known) and found.fits[0].hint_error <= found.pair.config.outcome.contradiction:
        return "initial map"
    return "landmarks" if len(hints.landmarks) else "anchors"


def _closed_result(
    result: MatchResult, outcome: Outcome, evidence: Evidence, hints: Hints, note: str
) -> MatchResult:
    """Take the map with the holes closed; it is no surer than a part's."""
    outcome = Outcome.PARTIAL if outcome in SURE else outcome
    return replace(
        result,
        outcome=outcome,
        quality=replace(result.quality, doubt=evidence.doubt),
        notes=(*result.notes, note, *_doubts(outcome, evidence, hints)),
    )


def _doubts(outcome: Outcome, evidence: Evidence, hints: Hints) -> list[str]:
    if outcome is not Outcome.PARTIAL:
        return evidence.notes(len(hints.landmarks) > 0)
    if evidence.outcome is Outcome.PARTIAL:
        return []
    return [f"its doubt is high ({evidence.doubt:.1e}), but it is sure by the match with the holes closed"]


def _contradicts(pair: ShapePair, points: PrecisePoints, quality: Quality, hints: Hints) -> bool:
    """Whether most landmarks, or the initial map, are contradicted.

    Single landmarks may be off in a right map: where limbs touch, a vertex of the whole may be nearest to the other one.
    """
    off = distances_to_hints(pair, points.corners[:, 0], hints.landmarks)
    bound = pair.config.outcome.contradiction
    return bool(quality.initial_map_error > bound or (len(off) and np.median(off) > bound))


def _expected_errors(found: PartMatch, points: PrecisePoints) -> FloatArray:
    """Estimate the errors (n_part,) of the images of the part, in √area of the whole."""
    pair, unit = SmoothPair(found.pair.part, found.pair.whole, found.pair.config), found.pair.unit
    return unit * expected_errors(pair, points, unit=unit)


def _quality(
    pair: ShapePair,
    found: PartMatch,
    points: PrecisePoints,
    matched: BoolArray,
    hints: Hints,
) -> Quality:
    source, target, best = pair.source, pair.target, found.fits[0]
    image = points.corners[:, 0]
    on_user = np.zeros(source.surface.n_vertices, dtype=bool)
    on_user[source.body_vertex >= 0] = matched[source.body_vertex[source.body_vertex >= 0]]
    unit = found.pair.unit if source is found.pair.part else 1 / found.pair.unit
    landmark_error, initial_map_error = np.nan, np.nan
    if len(hints.landmarks):
        landmark_error = float(distances_to_hints(pair, image, hints.landmarks).mean())
    known = hints.known[matched[hints.known[:, 0]]]
    if len(known):
        initial_map_error = float(np.median(distances_to_hints(pair, image, known)))
    return Quality(
        misfit=best.misfit,
        rival=found.rival,
        mirrored=np.inf,
        residual=np.nan,
        stretch=edge_stretch(
            source.body,
            image_positions(source.body, target.body, points),
            pair.config.outcome.torn,
            unit,
            matched,
        ),
        orientation=best.orientation,
        distortion_mean=np.nan,
        distortion_p95=np.nan,
        coverage=covered_share(target.body, image[matched], pair.config.outcome.coverage_radius),
        matched=float(on_user.mean()),
        landmark_error=landmark_error,
        initial_map_error=initial_map_error,
        stress=best.stress,
        bend_misfit=found.bent.misfit,
        doubt=found.evidence.doubt,
    )
