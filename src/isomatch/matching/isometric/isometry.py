"""Isometry: both shapes are complete, and distances along them agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter
from typing import TypeAlias

import numpy as np

from isomatch._core.arrays import BodyVertices, Bool, BoolArray, Float, FloatArray, Int, SearchRows
from isomatch._core.errors import SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Correspondence, Embedding, PrecisePoints
from isomatch.matching.assessment.confidence import doubt_in, doubt_of, expected_errors, regions_of_doubt
from isomatch.matching.assessment.evidence import Evidence, Measured, Solution
from isomatch.matching.assessment.quality import descriptor_distance_of, measure_quality
from isomatch.matching.coordinates import SmoothPair, joint_coordinates, refine_images, register_map
from isomatch.matching.isometric.candidates import (
    Screening,
    energy_of,
    extend_map,
    hypotheses_from_priors,
    is_another,
    is_sure,
    residual_of,
    search,
)
from isomatch.matching.maps import Candidate, Fit
from isomatch.matching.model import Match, Proposals, RefiningModel, origin_of
from isomatch.matching.parameters import MAP_DISTANCE, SCREENING, SYMMETRIC, TIES
from isomatch.matching.problem import Problem, target_rows_near
from isomatch.matching.proposals.flips import (
    keep_distinct_maps,
    mirrored_variants,
    near_symmetric_variants,
    symmetric_variants,
)
from isomatch.matching.result import Alternative, Outcome
from isomatch.matching.selection import (
    Ranking,
    Rules,
    distances_between,
    nearest_to_priors,
    rank_candidates,
    select,
    select_contenders,
    select_survivors,
)

# note on a map that is ambiguous because a shape has a near-symmetry
AMBIGUITY_NOTE = (
    "a shape has a symmetry about as near to exact as the shapes are alike, and the map composed with it fits about as "
    "well: look at the first of the alternatives, and give three to five landmarks if it is right"
)


IsometricMatch: TypeAlias = Match[Fit, Embedding]


def image_of(match: IsometricMatch, side: str) -> BodyVertices:
    """Image on the other shape for each vertex of the shape on a ``side``; for variants, between their originals."""
    sides = zip((match.model.source, match.model.target), match.coordinates)
    (part, of_part), (whole, of_whole) = sides if side == "source" else reversed([*sides])
    n = (part.original or part).body.n_vertices
    image = whole.index.vertices(of_whole, of_part[:n])
    return BodyVertices(image if whole.original is None else whole.original_vertex[image])


def find_torn_vertices(match: IsometricMatch, side: int, distance: float) -> Bool[BoolArray, "n_original"]:
    """Find vertices of a cut body whose copies have images farther apart, in √area."""
    order = 1 if side == 0 else -1
    shape, other = (match.model.source, match.model.target)[::order]
    of_shape, of_other = match.coordinates[::order]
    image = other.index.vertices(of_other, of_shape)
    torn = np.zeros(len(shape.original_vertex), dtype=bool)
    copies = np.flatnonzero(shape.to_original == 0)
    is_far = other.distance(image[copies], image[shape.original_vertex[copies]]) > distance
    torn[shape.original_vertex[copies[is_far]]] = True  # a vertex may have several copies
    return torn


class Isometry(RefiningModel[Fit, Embedding]):
    """Both shapes are complete, and distances along them agree.

    Maps are searched on few vertices, as hypotheses and candidates; the best are refined jointly, and one is selected.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> from isomatch.matching import Isometry, prepare_pair
    >>> source, target = example_pair()
    >>> model = Isometry(prepare_pair(source.mesh, target.mesh))
    >>> candidates, runners_up = model.candidates(*model.hypotheses())
    >>> fits = model.refine(model.begin(candidates[:2]))
    >>> model.cost(fits[0]) < 0.5
    True
    """

    def __init__(self, problem: Problem, hypotheses: Sequence[Candidate] | None = None) -> None:
        super().__init__(problem)
        self._found = hypotheses

    def propose(self, timer: StageTimer) -> Proposals[Fit]:
        """Search hypotheses, screen them, and prepare the contenders for refinement."""
        both, config = (self.source, self.target), self.pair.config
        parallel_map(lambda shape: (shape.points, shape.signatures, shape.curvature, shape.symmetries), both)
        timer.start("search")
        may_win, only_runners_up = self.hypotheses() if self._found is None else (list(self._found), [])
        timer.start("selection")
        screened = self.candidates(may_win, only_runners_up)
        bounds = config.orientation, config.selection
        contend = [self.begin(select_contenders(order, *bounds)) for order in screened]
        eligible, runners_up = map(tuple, screened)
        return Proposals(contend[0], len(eligible) + len(runners_up), contend[1], eligible, runners_up)

    def rank(
        self, maps: list[Fit], rivals: list[Fit], proposals: Proposals[Fit], timer: StageTimer
    ) -> Ranking[Fit]:
        """Select a map by score and descriptors; among maps that tie, by the cost of `verify`."""
        may_win = [True] * len(maps) + [False] * len(rivals)
        ranking = self.select_fit([*maps, *rivals], may_win, proposals.n_tried)
        if self._searches_freely:
            ranking = self._reconsider_dropped(ranking, proposals.eligible)
        return self._compare_with_mirror_image(self._verify_tied(ranking), proposals.eligible)

    def coordinates(self, best: Fit) -> Embedding:
        """Coordinates of all vertices in which images are nearest points."""
        return self.everywhere(best)

    def hypotheses(self) -> tuple[list[Candidate], list[Candidate]]:
        """Hypotheses that may win, and hypotheses that are searched only as runners-up."""
        pair, config, starts = self.pair, self.pair.config, self.problem.starts
        from_priors = hypotheses_from_priors(pair)
        if config.hypotheses == "all":
            return search(pair, from_priors, starts), []
        return from_priors, search(pair, from_priors, starts) if self.searches_runners_up else []

    @property
    def _searches_freely(self) -> bool:
        """Whether neither hypotheses nor the user's starts are given."""
        return self._found is None and self.problem.starts is None

    @property
    def searches_runners_up(self) -> bool:
        """Whether automatic hypotheses are searched as runners-up of given ones."""
        wanted = self.pair.config.search_runners_up
        return self.refinement.searches_further if wanted is None else wanted

    def candidates(
        self, may_win: Sequence[Candidate], only_runners_up: Sequence[Candidate] = ()
    ) -> tuple[list[Candidate], list[Candidate]]:
        """Screen hypotheses and symmetric variants; return what may win, and runners-up."""
        if not may_win:
            raise SettingError(
                "the starts gave no first map, and there are no priors; add *default_starts to them"
            )
        pair, screen = self.pair, Screening(self.pair)
        eligible = self._rank_candidates(screen(list(may_win)), with_priors=True)
        searched = pair.config.hypotheses == "all" or self.searches_runners_up
        variants = screen(symmetric_variants(pair, eligible[0].target_row)) if searched else []
        if pair.config.hypotheses == "all":
            return self._rank_candidates([*eligible, *variants], with_priors=True), []
        return eligible, self._rank_candidates([*screen(list(only_runners_up)), *variants])

    def begin(self, candidates: Sequence[Candidate]) -> list[Fit]:
        """Extend candidates to the refinement vertices."""
        return [
            Fit(
                extend_map(self.pair, c.target_row, self.vertices),
                orientation=c.orientation,
                prior_error=c.prior_error,
                landmark_error=c.landmark_error,
                candidate=c,
                origin=c.origin,
            )
            for c in candidates
        ]

    def refine_jointly(self, fits: Sequence[Fit]) -> list[Fit]:
        """Upsample spectrally, jointly with signatures, positions and normals.

        There are three rounds, the first without positions and normals. After each, a map is dropped if it coincides
        with a better one or fits much worse, see ``select_survivors``. The best are then refined again from few
        functions, and the better of both maps is kept. O(n_refine √n (K + q)) a step.
        """
        pair, settings = self.pair, self.pair.config.refining
        refined, both_sides = list(fits), pair.config.orientation == "any"
        for sizes, with_positions in settings.rounds if fits else ():
            refined = parallel_map(lambda fit: self.step(fit, sizes, with_positions), refined)  # noqa: B023
            distances = self._map_distances(refined)
            kept = select_survivors(refined, distances, pair.config.selection, with_positions, both_sides)
            refined = [refined[i].with_candidate_of(refined[j]) for i, j in kept]
        return self._refine_ties_again([replace(fit, score=self.cost(fit)) for fit in refined])

    def _refine_ties_again(self, fits: Sequence[Fit]) -> list[Fit]:
        """Refine maps that tie with the best from few functions; keep the better ones."""
        # few functions let a limb that is twisted in its place turn back
        settings = self.pair.config.refining
        last, with_positions = settings.last_step
        limit = self.pair.config.outcome.tie * min((fit.score for fit in fits), default=0.0)

        def improve(fit: Fit) -> Fit:
            if not settings.sizes_again or fit.score > limit:
                return fit
            again = self.step(fit, (*settings.sizes_again, *last), with_positions)
            return min(fit, replace(again, score=self.cost(again)), key=attrgetter("score"))

        return parallel_map(improve, fits)

    def step(self, fit: Fit, sizes: tuple[int, ...], with_positions: bool) -> Fit:
        """Refine a map by a few steps."""
        image, spectral_residual = refine_images(self.pair, fit.image, fit.side, sizes, with_positions)
        return replace(fit, image=image, spectral_residual=spectral_residual)

    def measure_fit(self, fit: Fit, image: Int[BodyVertices, "r"]) -> Fit:
        """Measure a map, with its spectral residual after one more step of the refinement."""
        step = self.pair.config.refining.last_step
        _, spectral_residual = refine_images(self.pair, image, fit.side, *step)
        fit = replace(fit, image=image, spectral_residual=spectral_residual)
        return replace(fit, score=self.cost(fit))

    def cost(self, fit: Fit) -> float:
        """Return the cost of a refined map: spectral residual × a power of its energy.

        The spectral residual measures detail after a smooth fit; the energy measures distances and curvature.
        """
        energy = energy_of(self.pair, self.vertices, fit.image)
        return float(fit.spectral_residual * energy**self.pair.config.selection.energy_exponent)

    def embedding(self, fit: Fit) -> Embedding:
        """Joint coordinates of all vertices, with all functions, after registration."""
        return register_map(self.pair, fit.image, fit.side, self.refinement.smooth)

    def select_fit(self, fits: list[Fit], may_win: list[bool], n_tried: int = 2) -> Ranking[Fit]:
        """Select among refined maps by score, weighed by descriptor distances where maps differ."""
        return select(
            fits,
            self._map_distances(fits),
            Rules.of(self.pair.config.selection, self.pair.config.outcome),
            scores=self.weigh(fits, [fit.score for fit in fits], may_win),
            eligible=may_win,
            far_shares=self._far_shares(fits),
            n_tried=n_tried,
        )

    def _reconsider_dropped(self, ranking: Ranking[Fit], candidates: Sequence[Candidate]) -> Ranking[Fit]:
        """If the best map is not sure, refine candidates that were dropped, and add maps that differ from it."""
        # A candidate that was dropped might tie: half turns of ants have 1.15 × the least spectral residual,
        # and so are dropped, yet their scores tie.
        first, config = ranking.best, self.pair.config
        if not self.pair.is_sided or first.candidate is None or is_sure(self, ranking):
            return ranking
        fits = [first, *ranking.others]
        refined = [fit.candidate.target_row for fit in fits if fit.candidate]
        others = select_contenders(candidates, config.orientation, config.selection)
        more = self.refine(self.begin(keep_distinct_maps(self.pair, others, before=refined)))
        fits += [fit for fit in more if is_another(self, fit, first)]
        return self.select_fit(fits, [True] * len(fits))

    def _verify_tied(self, ranking: Ranking[Fit]) -> Ranking[Fit]:
        """Select the best verified map among ties."""
        # maps of capped shapes are not verified: their distances cross the caps; decisions.md, both sides
        if not self.pair.is_sided or any(shape.original for shape in (self.source, self.target)):
            return ranking
        first, limit = ranking.best, self.pair.config.elastic.min_spectral_residual
        is_far = first.spectral_residual > limit and self.problem.allows_elastic
        if is_far and self._searches_freely:  # then `Elastic` or `BothSides` verifies maps
            return ranking
        tied = self.find_tied(ranking)
        best = min(tied, key=lambda fit: self.verified(fit).cost) if len(tied) > 1 else first
        if best is first:
            return ranking
        others = (first, *(fit for fit in ranking.others if fit is not best))
        ranking = replace(ranking, best=best, others=others)
        if is_another(self, best, first) or ranking.against is best:
            return replace(ranking, runner_up=1.0, against=first)
        return ranking

    def find_tied(self, ranking: Ranking[Fit]) -> list[Fit]:
        """Return the best map and the maps of its orientation whose scores tie with it."""
        first, tie = ranking.best, self.pair.config.outcome.tie
        if self.source.handles or self.target.handles:  # handles shorten distances
            return [first]
        fits = (first, *ranking.others)
        tied = [fit for fit in fits if fit.score <= tie * first.score and fit.side == first.side]
        # With start = "pose", the prior error is the mean distance of images from nearest points in space.
        return nearest_to_priors(tied, TIES.landmark_slack)

    def image(self, best: Fit) -> Int[BodyVertices, "n_s"]:
        """Vertex of the target's body for each vertex of the source's."""
        # These coordinates have no registration, which would take two thirds of the time of a verification.
        embedding = self.everywhere(best, self._unregistered)
        return BodyVertices(self.target.index.vertices(embedding.target, embedding.source))

    def _unregistered(self, fit: Fit) -> Embedding:
        """Joint coordinates of all vertices, with all functions."""
        all_vertices, points = np.arange(self.source.body.n_vertices), PrecisePoints.at_vertices(fit.image)
        return joint_coordinates(self.pair, points, self.pair.n_functions, fit.side, all_vertices)

    def _compare_with_mirror_image(
        self, ranking: Ranking[Fit], candidates: Sequence[Candidate]
    ) -> Ranking[Fit]:
        """Compare the best map with the best one of the other orientation, if the latter has much less energy."""
        if not self.pair.is_sided:
            return ranking
        config = self.pair.config
        settings, bounds, wanted = config.selection, config.outcome, self._wanted_sign
        least = min((c.energy for c in candidates if wanted * c.orientation > 0), default=np.inf)
        limit = settings.mirrored_energy * least
        mirrored = [c for c in self.mirrored_candidates(candidates) if c.energy < limit]
        if not mirrored:
            return ranking
        fits = [ranking.best, *self.refine(self.begin(mirrored[: SCREENING.max_mirrored]))]
        costs = self.weigh(fits, [fit.score for fit in fits], [fit is ranking.best for fit in fits])
        ratio = max(min(costs[1:]), TIES.score_noise) / max(costs[0], TIES.score_noise)
        return replace(ranking, mirrored=ratio) if ratio < bounds.mirror_image else ranking

    def mirrored_candidates(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Return the candidates that clearly have the other orientation, least energy first."""
        threshold = self.pair.config.selection.orientation_threshold
        mirrored = [c for c in candidates if self._wanted_sign * c.orientation < -threshold]
        return sorted(mirrored, key=attrgetter("energy"))

    @property
    def _wanted_sign(self) -> int:
        return 1 if self.pair.config.orientation == "preserve" else -1

    def _map_distances(self, fits: list[Fit]) -> FloatArray:
        return distances_between([fit.image for fit in fits], self.target.mean_distances)

    def _far_shares(self, fits: list[Fit]) -> Float[FloatArray, "q q"]:
        """Share of vertices that each two refined maps send to places far apart."""
        far, distance = MAP_DISTANCE.other_limb, self.target.distance
        shares = np.zeros((len(fits),) * 2)
        for i, fit in enumerate(fits):
            for j, other in enumerate(fits[:i]):
                shares[i, j] = shares[j, i] = (distance(fit.image, other.image) > far).mean()
        return shares

    def _rank_candidates(self, candidates: Sequence[Candidate], with_priors: bool = False) -> list[Candidate]:
        """Rank candidates; with priors, drop candidates that contradict landmarks."""
        landmarks = with_priors and len(self.priors.landmarks) > 0
        config = self.pair.config
        return rank_candidates(candidates, config.orientation, config.selection, landmarks)

    def measure(self, match: IsometricMatch) -> Measured:
        """Map vertices to the nearest points, and measure the map."""
        pair, ranking = self.pair, match.ranking
        points = self.target.index.points(match.coordinates.target, match.coordinates.source)
        quality = measure_quality(pair, points, ranking)
        exponent = pair.config.selection.energy_exponent
        reason = (
            f"least spectral residual × energy^{exponent:g}; {match.proposals.n_tried} candidates, "
            f"{1 + len(ranking.others)} refined to the end"
        )
        if ranking.priors_decided:
            reason += "; of those that tie, it agrees best with the priors"
        if ranking.runner_up < np.inf:
            reason += f"; the best alternative scores {ranking.runner_up:.2f} times as much"
        distance = descriptor_distance_of(*self.balls, points.corners[:, 0])
        winner = ranking.best
        return Measured(points, quality, distance, reason, origin_of(pair, winner), fit=winner)

    def sum_up(self, match: IsometricMatch, measured: Measured, timer: StageTimer) -> Solution:
        """Sum up a map with its evidence, and polish it if it is the last one."""
        pair, map_, far = self.pair, measured, bool(measured.note)
        ranking, runners_up = match.ranking, None
        if ranking.against and ranking.runner_up < pair.config.outcome.tie and not far:
            runners_up = ranking.best.image, ranking.against.image
        regions = regions_of_doubt(pair, map_.descriptor_distance, runners_up)
        doubt = doubt_in(regions, self.source.body.n_vertices)
        if runners_up:
            doubt += doubt_of(pair, *runners_up, ranking.runner_up)
        errors = expected_errors(pair, map_.points, doubt)
        level, points, polished = (
            self._polish_points(match, map_, timer) if map_.is_last else (pair, map_.points, ())
        )
        if self.source.detail or self.target.detail:
            timer.start("carry")
        evidence = [map_.evidence(pair, far)]
        if pair.round and not pair.priors.any:
            evidence.append(Evidence(ambiguous=True))
        notes = self._notes(ranking)
        notes += polished
        notes += [map_.note] if far else []
        if any(shape.origin is not None and (shape.origin < 0).any() for shape in (self.source, self.target)):
            notes.append("stretch, residual and distortion are those of the shapes with their holes closed")
        solution = map_.solution(pair, errors, tuple(evidence), notes, level, points, regions)
        solution = replace(solution, descriptors_count=not far)
        if not map_.is_last:
            return replace(solution, alternatives=self._alternatives(match, []))
        return self._with_rivals(match, map_, solution)

    def complete(
        self, match: IsometricMatch, measured: Measured, solution: Solution, timer: StageTimer
    ) -> Solution:
        """Polish a map, and look for symmetric maps that fit as well."""
        level, points, notes = self._polish_points(match, measured, timer)
        if level is not self.pair:
            timer.start("carry")
            found = level.source.correspondence(level.target, points)
            solution = replace(solution, map=found, notes=(*solution.notes, *notes))
        timer.start("quality")
        return self._with_rivals(match, measured, solution)

    def _with_rivals(self, match: IsometricMatch, map_: Measured, solution: Solution) -> Solution:
        """Add alternatives; a map is ambiguous if its composition with a near-symmetry fits."""
        rivals = self.find_symmetric_rivals(map_) if solution.outcome is Outcome.CONVERGED else []
        if rivals:
            solution = solution.with_evidence(Evidence(ambiguous=True))
            solution = replace(solution, notes=(*solution.notes, AMBIGUITY_NOTE))
        return replace(solution, alternatives=self._alternatives(match, rivals))

    def find_symmetric_rivals(self, map_: Measured) -> list[Candidate]:
        """Compose the map with near-symmetries; return the composed maps that fit about as well."""
        pair, config = self.pair, self.pair.config
        searches = self.refinement.searches_further and self.problem.starts is None
        if config.hypotheses != "all" or self.priors.any or not (pair.oriented and searches):
            return []
        image, bounds = BodyVertices(map_.points.corners[pair.source_vertices, 0]), config.outcome
        rows = target_rows_near(pair, image)
        residual = residual_of(pair, pair.source_vertices, image, config.search.start_columns)
        variants = near_symmetric_variants(pair, rows, bounds.tie * residual)
        screen, hypothesis = Screening(pair), Candidate.of_rows(rows, map_.origin)
        winner, *others = screen([hypothesis, *variants])
        half_turns = screen(self._half_turns(winner))
        others += half_turns
        limit = SYMMETRIC.max_energy_ratio * max(winner.energy, TIES.energy_noise)
        turned = [
            c
            for c in sorted(others, key=attrgetter("energy"))
            if c.energy <= limit
            and (config.orientation == "any" or self._wanted_sign * c.orientation > 0)
            and pair.differs(c.target_row, [rows], SYMMETRIC.min_turned_distance)
        ]
        promising = self._keep_promising(winner, turned) if turned else []
        if not promising:
            return []
        # the map and its rivals are compared after the same refinement, even if the map is elastic
        first = map_.fit or self.refine(self.begin([winner]))[0]
        fits = self.refine(self.begin(promising))
        fits = [fit for fit in fits if fit.score <= bounds.tie * first.score and is_another(self, fit, first)]
        if not fits:
            return []
        cost, *costs = parallel_map(lambda fit: self.verified(fit).cost, [first, *fits])
        ratios = [
            SYMMETRIC.max_half_turn_cost_ratio if fit.candidate in half_turns else SYMMETRIC.max_cost_ratio
            for fit in fits
        ]
        tied = sorted((c, i) for i, (c, ratio) in enumerate(zip(costs, ratios)) if c <= ratio * cost)
        return [candidate for _, i in tied if (candidate := fits[i].candidate)]

    def _half_turns(self, winner: Candidate) -> list[Candidate]:
        """Compose a map with a mirror image of a shape, and turn it over; keep the result if few functions fit well."""
        # A mirror image σ exchanges left and right, so f ∘ σ reverses the orientation. The refinement
        # preserves the orientation, so it exchanges back and belly, too, which makes f ∘ σ a half turn. With
        # curled legs, a half turn is too far from an isometry to be found among the near-symmetries.
        begun = self.begin([winner, *mirrored_variants(self.pair, winner.target_row)])
        if len(begun) == 1:
            return []

        def refined(fit: Fit) -> Fit:
            return self.step(replace(fit, orientation=winner.orientation), SYMMETRIC.half_turn_sizes, True)

        first, *others = parallel_map(refined, begun)
        limit = SYMMETRIC.max_half_turn_residual_ratio * first.spectral_residual
        n = len(self.pair.source_vertices)
        images = [BodyVertices(fit.image[:n]) for fit in others if fit.spectral_residual <= limit]
        rows = [target_rows_near(self.pair, image) for image in images]
        return [Candidate.of_rows(row, "symmetry") for row in rows]

    def _keep_promising(self, winner: Candidate, rivals: list[Candidate]) -> list[Candidate]:
        """Keep distinct rivals that score about as well as the map after the first round of the refinement."""
        rivals = keep_distinct_maps(self.pair, rivals, SYMMETRIC.max_maps)
        if not self.refinement.in_rounds:
            return rivals
        sizes, with_positions = self.pair.config.refining.rounds[0]
        begun = self.begin([winner, *rivals])
        first, *scores = parallel_map(lambda fit: self.cost(self.step(fit, sizes, with_positions)), begun)
        limit = SYMMETRIC.max_first_score_ratio * first
        return [rival for rival, score in zip(rivals, scores) if score <= limit]

    def polish(self, match: IsometricMatch) -> tuple[SmoothPair, Embedding]:
        """Refine the selected map on the finer level that a shape has, and compute coordinates there."""
        pair, fit = self.pair, match.ranking.best
        finer, between = pair.polishable, self.target.refining
        image = fit.image if between is None else BodyVertices(between.nearest_members[fit.image])
        image, _ = refine_images(finer, image, fit.side, pair.config.refining.polished_sizes, True)
        return finer, register_map(finer, image, fit.side, self.refinement.smooth)

    def _polish_points(
        self, match: IsometricMatch, measured: Measured, timer: StageTimer
    ) -> tuple[SmoothPair, PrecisePoints, tuple[str, ...]]:
        """Polish images at the finest level of the shapes; return this level, the images and notes."""
        if not (self.pair.has_finer and measured.fit and self.refinement.polishes):
            return self.pair, measured.points, ()
        timer.start("polish")
        finer, embedding = match.polished
        points = finer.target.index.points(embedding.target, embedding.source)
        sizes = finer.source.body.n_vertices, finer.target.body.n_vertices
        return finer, points, ("polished on {} and {} vertices".format(*sizes),)

    def _notes(self, ranking: Ranking[Fit]) -> list[str]:
        """Note which settings had no effect, and what was not searched."""
        pair, notes = self.pair, []
        if not pair.oriented and pair.config.orientation == "reverse":
            notes.append("orientation = 'reverse' has no effect: points and graphs have no normals")
        if np.isnan(ranking.runner_up):
            notes.append("no other map was tried: symmetric maps go unnoticed")
        distance = ranking.best.prior_error
        if pair.config.start == "pose" and not self.priors.any and distance > pair.config.outcome.out_of_pose:
            notes.append(
                f"images are {distance:.2f} √area from the nearest points in space: the shapes do not seem to be "
                "aligned, so start = 'pose' says little about the map; align them within about 30°, or leave start at "
                "'auto'"
            )
        return notes

    def _alternatives(self, match: IsometricMatch, rivals: list[Candidate]) -> tuple[Alternative, ...]:
        """Rivals and runners-up that differ from the best map and from each other; they are not refined."""
        pair, settings, ranking = self.pair, self.pair.config.selection, match.ranking
        refined = [fit.candidate for fit in (ranking.best, *ranking.others) if fit.candidate]
        order = [*refined[:1], *rivals, *refined[1:], *match.proposals.eligible, *match.proposals.runners_up]
        kept = keep_distinct_maps(pair, order, 1 + settings.most_alternatives)
        return tuple(
            Alternative(partial(_extend_to_all, pair, c.target_row), c.energy, c.orientation, c.origin)
            for c in kept[1:]
        )


def _extend_to_all(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> Correspondence:
    """Extend a map of the search vertices to all vertices."""
    image = extend_map(pair, target_row, BodyVertices(np.arange(pair.source.body.n_vertices)))
    return pair.source.correspondence(pair.target, image)
