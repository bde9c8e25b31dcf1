"""The match of two complete shapes: starts → search → select → refine → result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from isomatch.correspondence import Correspondence, Embedding
from isomatch.errors import SettingError
from isomatch.matching.candidates import Candidate, Judge, extended
from isomatch.matching.elastic import FAR, ElasticMatch, far_from_isometric, match_elastically
from isomatch.matching.hints import Hints
from isomatch.matching.joint_refinement import (
    RefinedCandidate,
    distances_between,
    joint_embedding,
    polished_points,
    refine_jointly,
    shares_elsewhere,
)
from isomatch.matching.outcome import Outcome
from isomatch.matching.pair import ShapePair, SmoothPair
from isomatch.matching.paper_refinements import descriptor_embedding, laplace_icp_embedding
from isomatch.matching.quality import contradicted_landmarks, measure_quality, outcome_of
from isomatch.matching.result import Alternative, MatchResult
from isomatch.matching.search import (
    Hypothesis,
    hypotheses_from_hints,
    search,
    symmetric_variants,
)
from isomatch.matching.select import Selection, contenders, ranked, select
from isomatch.matching.vertex_confidence import doubt_of, expected_errors
from isomatch.runtime.stage_timer import StageTimer
from isomatch.runtime.threads import parallel_map, serial_blas
from isomatch.shapes import describe_symmetries
from isomatch.values.arrays import IntArray


@dataclass(frozen=True, eq=False)
class CompleteMatch:
    """The map of two complete shapes that was selected, and those that were not.

    Parameters
    ----------
    pair : ShapePair
    hints : Hints
    selection : Selection
        Refined winner and its rivals.
    eligible : tuple of Candidate
        Candidates that might win, best first.
    rivals : tuple of Candidate
        Those that might not.
    embedding : Embedding
        Coordinates of all vertices in which images are nearest points.
    """

    pair: ShapePair
    hints: Hints
    selection: Selection[RefinedCandidate]
    eligible: tuple[Candidate, ...]
    rivals: tuple[Candidate, ...]
    embedding: Embedding

    @property
    def origin(self) -> str:
        """Where the winner came from: the initial map, if it agrees with that."""
        candidate, bound = self.selection.winner.candidate, self.pair.config.outcome.contradiction
        known = len(self.hints.known) and candidate.hint_error <= bound
        return "initial map" if known else candidate.hypothesis.origin


def match_complete(
    pair: ShapePair, hints: Hints, timer: StageTimer, known: list[Hypothesis] | None = None
) -> CompleteMatch:
    """Match two complete shapes; hypotheses that are ``known`` take the place of the search.

    Raises
    ------
    SettingError
        If hints are asked for and none was given.
    """
    both = pair.source, pair.target
    parallel_map(lambda shape: (shape.points, shape.signatures, shape.curvature, shape.symmetries), both)
    timer.start("search")
    may_win, only_rivals = _hypotheses(pair, hints) if known is None else (known, [])
    timer.start("selection")
    judge = Judge(pair, hints)
    eligible = _ranked(pair, judge(may_win), hints)
    variants = judge(_symmetric_variants(pair, eligible[0]))
    if pair.config.hypotheses == "all":
        eligible = _ranked(pair, [*eligible, *variants], hints)
        rivals = []
    else:
        rivals = _ranked(pair, [*judge(only_rivals), *variants])
    timer.start("refinement")
    selection = _contest(pair, eligible, rivals)
    embedding = _embedding(pair, selection.winner)
    return CompleteMatch(pair, hints, selection, tuple(eligible), tuple(rivals), embedding)


def complete_result(
    found: CompleteMatch, timer: StageTimer, seed: int, may_stretch: bool = True
) -> MatchResult:
    """Measure a map and sum it up; if it fits badly, and limbs may stretch, an elastic one takes its place."""
    pair, hints, selection = found.pair, found.hints, found.selection
    points = pair.target.index.points(found.embedding.target, found.embedding.source)
    timer.start("quality")
    quality = measure_quality(pair, points, hints, selection)
    elastic, doubt = None, None
    if selection.against:
        images = selection.winner.target_vertex, selection.against.target_vertex
        doubt = doubt_of(pair, *images, selection.rival)
    if may_stretch and far_from_isometric(pair, hints, quality):
        timer.start("elastic match")
        elastic = _elastic(found)
    if elastic:
        points = pair.target.index.points(elastic.embedding.target, elastic.embedding.source)
        quality, doubt = replace(measure_quality(pair, points, hints), rival=elastic.rival), None
    errors = expected_errors(pair, points, doubt)
    against = contradicted_landmarks(pair, points, hints)
    level: SmoothPair = pair
    if pair.has_finer and not elastic and pair.config.refinement in ("joint", "smooth"):
        timer.start("polish")
        level = pair.polishable
        points = polished_points(pair, level, selection.winner, pair.config.refinement == "smooth")
    if pair.source.detail or pair.target.detail:
        timer.start("carry")
    refined = [fit.candidate for fit in (selection.winner, *selection.rivals)]
    alternatives = _alternatives(pair, [*refined, *found.eligible, *found.rivals])
    outcome = outcome_of(pair, quality, pair.config.orientation, hints.any, elastic is not None)
    if pair.round and not hints.any:
        outcome = Outcome.least_sure((outcome, Outcome.SYMMETRY_AMBIGUOUS))
    return MatchResult(
        map=level.source.correspondence(level.target, points),
        outcome=outcome,
        quality=quality,
        expected_error=pair.source.lift_smooth(errors),
        alternatives=alternatives,
        timings=timer.stop(),
        notes=(
            *pair.notes,
            *hints.notes,
            *_notes(pair, hints, selection),
            *_polishing_described(pair, level),
            *([FAR] if elastic else []),
            *against,
        ),
        engine=pair.source.distances.engine,
        origin="anchors" if elastic else found.origin,
        reason=elastic.reason if elastic else selection.reason,
        config=pair.config,
        seed=seed,
        symmetries=(describe_symmetries(pair.source.symmetries), describe_symmetries(pair.target.symmetries)),
    )


def _elastic(found: CompleteMatch) -> ElasticMatch | None:
    """Match elastically, from the winner and all candidates too."""
    pair, winner = found.pair, found.selection.winner
    ordinary = np.column_stack([pair.refinement_vertices, winner.target_vertex])
    others = [
        np.column_stack([pair.source_vertices, pair.target_vertices[candidate.target_row]])
        for candidate in found.eligible
        if candidate.orientation > 0
    ]
    return match_elastically(pair, found.hints.landmarks, ordinary, others)


def _hypotheses(pair: ShapePair, hints: Hints) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """Hypotheses that may win, and those that are searched as rivals only."""
    config = pair.config
    if config.hypotheses == "given" and not hints.any and config.start == "auto":
        raise SettingError("hypotheses = 'given', but no landmarks, initial map or descriptors were given")
    given = hypotheses_from_hints(pair, hints)
    if config.hypotheses == "all":
        return search(pair, given), []
    return given, search(pair, given) if config.searches_rivals else []


def _symmetric_variants(pair: ShapePair, best: Candidate) -> list[Hypothesis]:
    """Compose the best map with the symmetries of the target, where rivals are searched."""
    searched = pair.config.hypotheses == "all" or pair.config.searches_rivals
    return symmetric_variants(pair, best.target_row) if searched else []


def _notes(pair: ShapePair, hints: Hints, selection: Selection[RefinedCandidate]) -> list[str]:
    """Tell what could not be done as it was asked for."""
    notes = []
    if not pair.oriented and pair.config.orientation == "reverse":
        notes.append("orientation = 'reverse' has no effect: points and graphs have no normals")
    if np.isnan(selection.rival):
        notes.append("no other map was tried: symmetric maps go unnoticed")
    off = selection.winner.candidate.hint_error
    if pair.config.start == "pose" and not hints.any and off > pair.config.outcome.out_of_pose:
        notes.append(
            f"images are {off:.2f} √area from the nearest points in space: the shapes do not seem to be aligned, so "
            "start = 'pose' says little about the map; align them within about 30°, or leave start at 'auto'"
        )
    return notes


def _polishing_described(pair: ShapePair, level: SmoothPair) -> list[str]:
    if level is pair:
        return []
    return [f"polished on {level.source.body.n_vertices} and {level.target.body.n_vertices} vertices"]


def _ranked(pair: ShapePair, candidates: list[Candidate], hints: Hints | None = None) -> list[Candidate]:
    """Rank candidates; those that may win must not contradict landmarks."""
    landmarks = hints is not None and len(hints.landmarks) > 0
    return ranked(candidates, pair.config.orientation, pair.config.selection, landmarks)


def _contest(
    pair: ShapePair, eligible: list[Candidate], rivals: list[Candidate]
) -> Selection[RefinedCandidate]:
    """Refine the contenders, and rivals that may not win, and select."""
    orientation, settings = pair.config.orientation, pair.config.selection
    fits, others = (
        refine_jointly(pair, contenders(order, orientation, settings), both_sides=orientation == "any")
        for order in (eligible, rivals)
    )
    may_win = [True] * len(fits) + [False] * len(others)
    fits += others
    n_tried = len(eligible) + len(rivals)
    apart, elsewhere = distances_between(pair, fits), shares_elsewhere(pair, fits)
    return select(fits, may_win, apart, elsewhere, settings, pair.config.outcome, n_tried)


def _embedding(pair: ShapePair, winner: RefinedCandidate) -> Embedding:
    """Coordinates of all vertices in which images are nearest points, by the refinement that was asked for."""
    refinement = pair.config.refinement
    if refinement in ("joint", "smooth"):
        return joint_embedding(pair, winner, smooth=refinement == "smooth")
    embedding = descriptor_embedding(pair, winner.candidate.hypothesis.target_row)
    return laplace_icp_embedding(pair, embedding) if refinement == "laplace_icp" else embedding


def _alternatives(pair: ShapePair, order: list[Candidate]) -> tuple[Alternative, ...]:
    """Runners-up that differ from the winner, which comes first, and from each other; not refined."""
    distinct = order[:1]
    for candidate in order[1:]:
        known = [c.target_row for c in distinct]
        if pair.differs(candidate.target_row, known, pair.config.search.same_map):
            distinct.append(candidate)
    return tuple(
        Alternative(partial(_extended_map, pair, c.target_row), c.energy, c.orientation, c.hypothesis.origin)
        for c in distinct[1 : 1 + pair.config.selection.most_alternatives]
    )


def _extended_map(pair: ShapePair, target_row: IntArray) -> Correspondence:
    """Extend a map of the search vertices to all."""
    with serial_blas():
        image = extended(pair, target_row, np.arange(pair.source.body.n_vertices))
        return pair.source.correspondence(pair.target, image)
