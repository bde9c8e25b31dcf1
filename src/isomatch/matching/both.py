"""Both directions in one run: the shapes are prepared once, and the map back starts from the map there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from isomatch.assets import SurfaceLike
from isomatch.correspondence import UNMATCHED, iterative_closest_points
from isomatch.loading.first_use import view_room
from isomatch.matching.fit import Hypothesis
from isomatch.matching.hints import Hints, checked_initial_map, checked_landmarks
from isomatch.matching.judge import Evidence, judged
from isomatch.matching.known_functions import with_functions
from isomatch.matching.match import require_landmarks_for_pins, solve_prepared, stages_of
from isomatch.matching.pair import ShapePair, prepare_pair
from isomatch.matching.relations.isometry import IsometricMatch, Isometry
from isomatch.matching.result import MatchResult
from isomatch.matching.search import HINT_STEPS
from isomatch.matching.solve import part_role, solve_complete, solve_touching
from isomatch.matching.stages import Refinement, Relation, Stages, Start
from isomatch.matching.windings import side_to_turn
from isomatch.runtime.stage_timer import Progress, StageTimer, two_arguments
from isomatch.runtime.threads import in_background, serial_blas
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import IntArray

THERE = 0.75  # of the time, with the preparation


class BothDirections(NamedTuple):
    """Results of `match_both`: ``there``, source → target, and ``back``, target → source."""

    there: MatchResult
    back: MatchResult

    def _repr_html_(self) -> str:
        html: str = view_room().html_of(self)  # a named tuple has no other base
        return html


def match_both(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    refinement: Refinement | None = None,
    starts: Sequence[Start] | None = None,
    relation: Relation | None = None,
    functions: tuple[ArrayLike, ArrayLike] | None = None,
) -> BothDirections:
    """Match two surfaces in both directions.

    The shapes are prepared once, and hints are turned around. Of complete shapes that are matched automatically, and
    none of which alone seems to be inside out, the map back is not searched again: the map there and its alternatives,
    turned around, are the hypotheses, which are judged and refined like any others. Otherwise the way back is matched
    like the way there. The first note of ``back`` says which.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, config, seed, progress
        As for `match`, whose errors are raised.
    refinement, starts, relation, functions
        As for `match`; of both directions.

    Returns
    -------
    BothDirections
        ``there`` is what `match` returns. The timings of ``back`` are without the preparation.

    Notes
    -----
    About 1.3 times the time of one direction.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> there, back = match_both(source.mesh, target.mesh)
    >>> there.map.shape == back.map.shape[::-1]
    True
    """
    tell = two_arguments(progress) if progress else lambda stage, share: None
    timer = StageTimer(lambda stage, share: tell(stage, THERE * share))
    timer_back = StageTimer(lambda stage, share: tell(f"back: {stage}", THERE + (1 - THERE) * share))

    def matched() -> BothDirections:
        with serial_blas():
            timer.start("prepare")
            pair = with_functions(prepare_pair(source, target, config, seed, timer), functions)
            require_landmarks_for_pins(pair, landmarks)
            stages = stages_of(pair, refinement, starts, relation)
            return _both(pair, (landmarks, initial_map, initial_descriptors), stages, timer, timer_back, seed)

    both = in_background(matched)
    tell("done", 1.0)
    return both


UserHints = tuple[ArrayLike | None, ArrayLike | None, tuple[ArrayLike, ArrayLike] | None]


def _both(
    pair: ShapePair,
    user_hints: UserHints,
    stages: Stages,
    timer: StageTimer,
    timer_back: StageTimer,
    seed: int,
) -> BothDirections:
    pair_back, hints_back = pair.turned, _turned(pair, user_hints)
    alone = pair.oriented and (pair.source.others or pair.target.others)
    hints = None if alone else Hints.of(pair, *user_hints)
    searched = hints is not None and not hints.any and pair.config.hypotheses == "all"
    searched = searched and stages.relation is None
    found: IsometricMatch | None = None
    if hints is None or not searched or part_role(pair, hints, stages) or side_to_turn(pair):
        solution_there = solve_prepared(pair, user_hints, stages, timer)
    else:
        relation = Isometry().on(pair, hints, stages)
        found = relation.match(timer)
        solution_there, apart = solve_touching(relation, found, timer)
        found = None if apart else found
    there = judged(solution_there, timer, seed)
    timer_back.restart()
    if found is None:
        solution = solve_prepared(pair_back, hints_back, stages, timer_back)
        note = "the shapes were prepared for both directions at once; the map was found by itself"
    else:
        hypotheses = _turned_hypotheses(found, pair, pair_back)
        relation_back = Isometry().on(pair_back, Hints.of(pair_back, *hints_back), stages)
        solution = solve_complete(relation_back, relation_back.match(timer_back, hypotheses), timer_back)
        solution = solution.with_evidence(Evidence.of(solution_there.outcome))
        note = (
            "the shapes were prepared for both directions at once; the hypotheses are the map of the other direction and "
            f"{len(hypotheses) - 1} alternatives to it, turned around, and the outcome is at most as sure as there"
        )
    solution = replace(solution, notes=(note, *solution.notes))
    return BothDirections(there, judged(solution, timer_back, seed))


def _turned(pair: ShapePair, user_hints: UserHints) -> UserHints:
    """Turn hints around; of several vertices with one image, the last one is its image on the way back."""
    landmarks, initial_map, descriptors = user_hints
    sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
    image_back = None
    if initial_map is not None:
        image = checked_initial_map(initial_map, *sizes)
        rows = np.flatnonzero(image != UNMATCHED)
        image_back = np.full(sizes[1], UNMATCHED)
        image_back[image[rows]] = rows
    return (
        None if landmarks is None else checked_landmarks(landmarks, *sizes)[:, ::-1],
        image_back,
        None if descriptors is None else descriptors[::-1],
    )


def _turned_hypotheses(found: IsometricMatch, pair: ShapePair, pair_back: ShapePair) -> list[Hypothesis]:
    """Turn around the refined maps, best first, and the best of the others, as maps of the target's search vertices."""
    fits = (found.selection.winner, *found.selection.rivals)
    refined = [fit.candidate for fit in fits if fit.candidate]
    images = [fit.image[: len(pair.source_vertices)] for fit in fits]
    others = [
        candidate
        for candidate in found.eligible
        if all(candidate.hypothesis is not fit.hypothesis for fit in refined)
    ]
    others = others[: pair.config.selection.most_contenders]
    images += [pair.target_vertices[candidate.target_row] for candidate in others]
    starts = np.array([_turned_rows(pair, image) for image in images])
    aligned = iterative_closest_points(*pair_back.search_points, starts, HINT_STEPS)
    return [
        Hypothesis(alignment, candidate.hypothesis.origin)
        for alignment, candidate in zip(aligned, refined + others)
    ]


def _turned_rows(pair: ShapePair, target_vertex: IntArray) -> IntArray:
    """For each search vertex of the target, the row of the source whose image is nearest, by geodesic distance."""
    apart = pair.target.distances.between(pair.target_vertices, target_vertex)
    rows: IntArray = apart.argmin(axis=1)
    return rows
