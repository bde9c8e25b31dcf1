"""`match`: prepare → starts → search → select → refine → result."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from isomatch._threads import parallel_map, serial_blas
from isomatch.correspondence import Embedding, PrecisePoints
from isomatch.errors import NotConvergedError, SettingError
from isomatch.matching.config import Config
from isomatch.matching.descriptor_refinement import descriptor_embedding, laplace_icp_embedding
from isomatch.matching.evidence import Candidate, Judge, extended
from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair, prepare_pair
from isomatch.matching.prepare import PreparedShape
from isomatch.matching.quality import measure_quality, outcome_of
from isomatch.matching.refine import RefinedCandidate, distances_between, joint_embedding, refine_jointly
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality
from isomatch.matching.search import (
    Hypothesis,
    hypotheses_from_hints,
    recomposed,
    search,
    symmetric_variants,
)
from isomatch.matching.select import Selection, contenders, ranked, select
from isomatch.matching.stage_timer import Progress, StageTimer
from isomatch.surfaces import Surface

NO_START = (
    "no first map could be formed: a shape has fewer than four extremities (a sphere, a flat patch); give landmarks, an "
    "initial map or descriptors"
)


def match(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> MatchResult:
    """Match two near-isometric surfaces.

    Parameters
    ----------
    source, target : Mesh, PointCloud, Graph or PreparedShape
        The shapes; `prepare` one that is matched more than once.
    landmarks : (m, 2) array_like of int, optional
        Rows (source vertex, target vertex), m ≥ 3.
    initial_map : (n_source,) array_like of int, optional
        Target vertex of each source vertex from another method; −1 where unknown.
    initial_descriptors : two array_likes, optional
        (n_source, q) and (n_target, q) values of functions that should correspond.
    config : Config, optional
        Settings; by default those of the prepared shapes, else the defaults.
    seed : int
        Seeds sampling and eigensolver of shapes not yet prepared.
    progress : callable, optional
        Called with the name of each stage as it starts. If the first map is poor, stages after "prepare" are repeated.

    Returns
    -------
    MatchResult
        ``.map`` is the `Correspondence` source → target.

    Raises
    ------
    MeshError
        If a surface cannot be used.
    LandmarkError, MapError, DescriptorError
        If landmarks, initial map or descriptors do not fit the shapes.
    NotConvergedError
        If no hypothesis could be formed at all.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, with automatic starts and a joint refinement beyond it.
    About 2 s for two shapes of 5 000 vertices on two cores, half of it preparation; 1 s more where the first map is poor.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> result = match(source.mesh, target.mesh)
    >>> result.outcome.name
    'CONVERGED'
    """
    timer = StageTimer(progress)
    with serial_blas():
        timer.start("prepare")
        pair = prepare_pair(source, target, config, seed)
        parallel_map(
            lambda shape: (shape.points, shape.signatures, shape.curvature), [pair.source, pair.target]
        )
        hints = Hints.of(pair, landmarks, initial_map, initial_descriptors)
        if pair.config.hypotheses == "given" and not hints.any:
            raise SettingError(
                "hypotheses = 'given', but no landmarks, initial map or descriptors were given"
            )
        matcher = _Matcher(pair, hints, timer)
        found = matcher.matched()
        alternatives = parallel_map(lambda c: _alternative(pair, c), found.alternatives)
    notes = [
        f"{side}: {n}" for side, s in (("source", pair.source), ("target", pair.target)) for n in s.notes
    ]
    return MatchResult(
        map=pair.source.correspondence(pair.target, found.points),
        outcome=found.outcome,
        quality=found.quality,
        alternatives=tuple(alternatives),
        timings=timer.stop(),
        notes=(*notes, *found.notes),
        engine=pair.source.distances.engine,
        origin=found.selection.winner.candidate.hypothesis.origin,
        reason=found.selection.reason,
        config=pair.config,
        seed=seed,
    )


@dataclass(frozen=True, eq=False)
class _Found:
    """A map of bodies, judged."""

    selection: Selection[RefinedCandidate]
    alternatives: list[Candidate]
    points: PrecisePoints
    quality: Quality
    outcome: Outcome
    notes: tuple[str, ...] = ()


class _Matcher:
    """One pair on its way through search, selection and refinement."""

    def __init__(self, pair: ShapePair, hints: Hints, timer: StageTimer) -> None:
        self._pair, self._hints, self._timer, self._config = pair, hints, timer, pair.config
        self._judge = Judge(pair, hints)

    def matched(self) -> _Found:
        """Search, select and refine; once more among more hypotheses if the map is poor."""
        pair, config = self._pair, self._config
        self._timer.start("search")
        given = hypotheses_from_hints(pair, self._hints)
        searched = config.hypotheses == "all" or config.search_rivals
        found = search(pair, given) if searched else given
        result = self._selected(given, found)
        if result.outcome is not Outcome.LOW_CONFIDENCE or config.hypotheses == "given":
            return result
        self._timer.start("search")
        new = recomposed(pair, found)
        if not new:
            return result
        note = f"the first map was poor: {len(new)} more compositions of the hypotheses were tried"
        return replace(self._selected(given, [*found, *new], rounds=2), notes=(note,))

    def _selected(self, given: list[Hypothesis], found: list[Hypothesis], rounds: int = 1) -> _Found:
        """Select among what was found in some rounds of the search, refine the winner and measure its map."""
        pair, config = self._pair, self._config
        self._timer.start("selection")
        eligible = self._ranked(given) if config.hypotheses == "given" else self._with_variants(found)
        rivals = self._with_variants(found) if config.hypotheses == "given" and config.search_rivals else []
        if not eligible:
            raise NotConvergedError(NO_START)
        self._timer.start("refinement")
        selection = self._refined(eligible, rivals, rounds)
        embedding = self._embedding(selection.winner)
        points = pair.target.index.points(embedding.target, embedding.source)
        self._timer.start("quality")
        quality = measure_quality(pair, points, self._hints.landmarks, selection)
        left_out = max(pair.source.left_out, pair.target.left_out)
        outcome = outcome_of(quality, left_out, config.orientation, config.outcome, self._hints.any)
        order = [*(fit.candidate for fit in (selection.winner, *selection.rivals)), *eligible, *rivals]
        return _Found(selection, self._alternatives(order), points, quality, outcome)

    def _ranked(self, hypotheses: list[Hypothesis]) -> list[Candidate]:
        return ranked(
            self._judge(hypotheses),
            self._config.orientation,
            self._config.selection,
            landmarks=bool(len(self._hints.landmarks)),
        )

    def _with_variants(self, hypotheses: list[Hypothesis]) -> list[Candidate]:
        """Rank hypotheses and the symmetric variants of the best: it may be the half-turned one of the two."""
        order = self._ranked(hypotheses)
        new = symmetric_variants(self._pair, order[0].hypothesis, hypotheses) if order else []
        return self._ranked([*hypotheses, *new]) if new else order

    def _refined(
        self, eligible: list[Candidate], rivals: list[Candidate], rounds: int
    ) -> Selection[RefinedCandidate]:
        """Refine the contenders, and rivals that may not win, and select."""
        pair, orientation, settings = self._pair, self._config.orientation, self._config.selection
        fits: list[RefinedCandidate] = []
        may_win: list[bool] = []
        for candidates, allowed in (
            (contenders(eligible, orientation, settings, rounds), True),
            (contenders(rivals, orientation, settings), False),
        ):
            refined = refine_jointly(pair, candidates, both_sides=orientation == "any")
            fits += refined
            may_win += [allowed] * len(refined)
        return select(fits, may_win, distances_between(pair, fits), settings)

    def _embedding(self, winner: RefinedCandidate) -> Embedding:
        """Coordinates of all vertices in which images are nearest points, by the refinement that was asked for."""
        refinement = self._config.refinement
        if refinement in ("joint", "smooth"):
            return joint_embedding(self._pair, winner, smooth=refinement == "smooth")
        embedding = descriptor_embedding(self._pair, winner.candidate.hypothesis.target_row)
        return laplace_icp_embedding(self._pair, embedding) if refinement == "laplace_icp" else embedding

    def _alternatives(self, order: list[Candidate]) -> list[Candidate]:
        """Runners-up that differ from the winner and from each other."""
        distinct = order[:1]
        for candidate in order[1:]:
            apart = self._pair.distances_between_maps(candidate.target_row, [c.target_row for c in distinct])
            if (apart > self._config.search.same_map).all():
                distinct.append(candidate)
        return distinct[1 : 1 + self._config.selection.most_alternatives]


def _alternative(pair: ShapePair, candidate: Candidate) -> Alternative:
    image = extended(pair, candidate.target_row, np.arange(pair.source.body.n_vertices))
    return Alternative(
        pair.source.correspondence(pair.target, image),
        candidate.energy,
        candidate.orientation,
        candidate.hypothesis.origin,
    )
