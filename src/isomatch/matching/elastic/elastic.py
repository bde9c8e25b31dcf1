"""Elastic: limbs may stretch, so distances on the two shapes agree only roughly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter

import numpy as np

from isomatch._core.arrays import BodyVertices, Int
from isomatch._core.cached import cached_property
from isomatch._core.errors import NotConvergedError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding, with_normals
from isomatch.matching.assessment.confidence import doubt_in, expected_errors, regions_of_doubt
from isomatch.matching.assessment.evidence import Measured, Solution, fits_badly, mirror_image_fits
from isomatch.matching.assessment.quality import descriptor_distance_of, measure_quality
from isomatch.matching.bending import BentShape, ElasticBending
from isomatch.matching.coordinates import refine_images, register_map
from isomatch.matching.elastic.elastic_fit import (
    COARSE_STEPS,
    Coefficients,
    ElasticFit,
    ElasticShape,
    Images,
    Step,
    anchor_starts,
    find_mirror_images,
)
from isomatch.matching.isometric.candidates import is_another
from isomatch.matching.maps import Fit
from isomatch.matching.model import Match, Proposals, RefiningModel
from isomatch.matching.parameters import ELASTIC_FIT, ELASTIC_SEARCH, MAP_DISTANCE, TIES
from isomatch.matching.problem import Problem, search_pairs
from isomatch.matching.proposals.starts import starts_from_priors
from isomatch.matching.result import Quality
from isomatch.matching.selection import Ranking, Rules, distances_between, keep_distinct, select

# step of the fit before shapes are bent at full resolution: number of functions, squared length of smoothing
# in areas of the shape, iterations, whether mirror images are respected: decisions.md, elastic steps
LAST_STEP = Step(200, 0.0005, 2, False)
MIN_SCORE = 1e-12  # √area; lower scores are raised to this, so that ratios of scores are finite; chosen

FAR_NOTE = (  # note on a map of shapes that are far from isometric
    "the shapes are far from isometric, so a map was sought that lets limbs stretch; it may be wrong in places: look at "
    "the picture, and give five landmarks at extremities if it is"
)
FAR_KEPT_NOTE = (  # note on shapes far from isometric that keep an isometric map
    "the shapes are far from isometric, but no map that lets limbs stretch scores better; the map may be wrong in "
    "places: look at the picture, and give five landmarks at extremities if it is"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class StretchedFit(Fit):
    """An elastic map: smooth maps both ways, and both shapes bent onto each other by them."""

    coefficients: Coefficients  # coefficients of the smooth maps both ways
    images: Images | None = None  # images of the samples of the coarse fit, both ways
    # the source bent onto the target, and the target bent onto the source; empty before they are bent
    bent: tuple[BentShape, ...] = ()
    is_isometric: bool = False  # whether this is the map found under the isometric model
    is_initial_map: bool = False  # whether this is the user's initial map, held while large pieces move

    @property
    def stretch(self) -> float:
        """The larger stretch of both bent shapes."""
        return max(bent.stretch for bent in self.bent)


class Elastic(RefiningModel[StretchedFit, Embedding]):
    """Limbs may stretch.

    Parameters
    ----------
    problem : Problem
    found : Match, optional
        The match under an `Isometry`; its map, rivals and candidates contend with elastic maps.

    Notes
    -----
    A map bends both shapes onto each other, at a low resolution. Let s be the mean absolute logarithm of the stretch of
    edges, g the mean distance of the bent source from the target, and s′, g′ the same for the bent target. The score is::

        √(s g · s′ g′)

    A map that omits a limb has a large g′; a map that exchanges limbs has a large s. Among the maps that are bent to
    the end, the one with the least product of √score and cost by `verify` is selected.

    Examples
    --------
    Handed to `match` as ``relation=Elastic``:

    >>> from isomatch.datasets import example_pair
    >>> from isomatch.matching import prepare_pair
    >>> problem = prepare_pair(*(animal.mesh for animal in example_pair()))
    >>> Elastic(problem).isometric_map is None
    True
    """

    way = "elastic"
    last_stage = "precision"

    def __init__(self, problem: Problem, found: Match[Fit, Embedding] | None = None) -> None:
        super().__init__(problem)
        self.found = found
        self.isometric_map: Fit | None = None  # the map of ``found``
        self.isometric_map_fits = False  # whether this map fits like a right map between isometric shapes
        self._other_starts: list[tuple[BodyVertices, str]] = []  # candidates of ``found``, with origins
        self._rivals: list[Fit] = []  # other refined maps of ``found``
        if found:
            first, *others = found.ranking.best, *found.ranking.others
            self.isometric_map = first
            self.isometric_map_fits = not fits_badly(found.measured.quality, problem.config.outcome)
            self._rivals = [fit for fit in others if fit.side == first.side and is_another(self, fit, first)]
            candidates = (c for c in found.proposals.eligible if c.orientation > 0)
            self._other_starts = [(search_pairs(problem, c.target_row), c.origin) for c in candidates]

    def require_suitable(self) -> None:
        """Raise an `IsomatchError` unless the shapes are meshes, to be kept in orientation."""
        self.require_sides()
        self.require_priors()

    def propose(self, timer: StageTimer) -> Proposals[StretchedFit]:
        """Fit first maps coarsely; the best contend with the maps known before."""
        timer.start("mirror images")
        _ = self._shapes
        timer.start("search")
        starts = self._starts()
        first = partial(self._draw, self._coarse, COARSE_STEPS[0])
        kept, distances = [first(start, origin) for start, origin in starts], self.target.mean_distances
        for step, most in zip(COARSE_STEPS, ELASTIC_SEARCH.n_maps_kept):
            moved = parallel_map(partial(self._step, step=step), kept)
            order = sorted((fit for fit in moved if fit), key=attrgetter("score"))
            kept = keep_distinct(order, lambda fit: fit.image, distances, MAP_DISTANCE.same_map, most)
        timer.start("bending")
        if self.isometric_map is not None:
            kept.append(replace(self._draw_fit(self.isometric_map), is_isometric=True))
        kept += map(self._draw_fit, self._rivals)
        if len(self.priors.initial_pairs):
            kept.append(replace(first(self.priors.initial_pairs, "initial map"), is_initial_map=True))
        if not kept:
            raise NotConvergedError(
                "no elastic map keeps the orientation of the faces; give three to five landmarks"
            )
        return Proposals(parallel_map(self._begin, kept), len(starts))

    def rank(
        self,
        maps: list[StretchedFit],
        rivals: list[StretchedFit],
        proposals: Proposals[StretchedFit],
        timer: StageTimer,
    ) -> Ranking[StretchedFit]:
        """Select the map of least cost."""
        fits = sorted(maps, key=attrgetter("score"))
        distances = distances_between([fit.image for fit in fits], self.target.mean_distances)
        tie = ELASTIC_FIT.prior_tie_ratio if len(self.priors.initial_pairs) else 1.0
        least = self.pair.config.selection.runner_up_distance
        rules = Rules(runner_up_distance=least, tie=tie, landmark_slack=TIES.landmark_slack)
        costs = parallel_map(self.cost, fits)
        ranking = select(fits, distances, rules, scores=costs)
        # the best map leads only if both the costs and the scores of different maps are higher
        from_winner = distances[fits.index(ranking.best)]
        scores = [fit.score for fit, distance in zip(fits, from_winner) if distance > least]
        ratio = max(min(scores, default=np.inf) / ranking.best.score, 1.0)
        return replace(ranking, runner_up=min(ranking.runner_up, ratio))

    def coordinates(self, best: StretchedFit) -> Embedding:
        """Coordinates of all vertices in which images are nearest points."""
        return self.found.coordinates if self.found and self.keeps_lengths(best) else self.everywhere(best)

    def cost(self, fit: StretchedFit) -> float:
        """Cost by `verify` × a power of the score, which measures the bending once more."""
        return float(self.verified(fit).cost * fit.score**ELASTIC_FIT.score_exponent)

    def image(self, best: StretchedFit) -> Int[BodyVertices, "n_s"]:
        """Target vertex for each source vertex, bent at the lower resolution."""
        return self._bendings[0].images(best.bent[0], np.arange(self.source.body.n_vertices))

    @property
    def is_needless(self) -> bool:
        """Whether the isometric map fits, and bending by it hardly stretches the shapes."""
        if self.found is None or not self.isometric_map_fits:
            return False
        coordinates, lengths = self.found.coordinates, self.pair.config.elastic.bending
        bent = parallel_map(lambda bending: bending.lay(coordinates, lengths), self._bendings)
        return max(shape.stretch for shape in bent) < ELASTIC_FIT.max_isometric_stretch

    def keeps_lengths(self, winner: StretchedFit) -> bool:
        """Whether the winner is the isometric map, hardly stretches, and so is kept as it is."""
        most = ELASTIC_FIT.max_isometric_stretch
        if self.isometric_map_fits:
            most = ELASTIC_FIT.max_isometric_stretch_of_winner
        return winner.is_isometric and winner.stretch < most

    def _pairs(self, image: Int[BodyVertices, "r"]) -> Int[BodyVertices, "r 2"]:
        """Pair the vertices of the model with their images."""
        return BodyVertices(np.column_stack([self.vertices, image]))

    def _starts(self) -> list[tuple[Int[BodyVertices, "_ 2"], str]]:
        """First maps with their origins; maps from priors only if no isometric map, which used them, is known."""
        pair, landmarks = self.pair, self.priors.landmarks
        first_maps: list[tuple[BodyVertices, str]] = []
        if self.searches_by_anchors:
            source, target = self._shapes
            back = anchor_starts(pair.turned, BodyVertices(landmarks[:, ::-1]), (target, source))
            turned = (BodyVertices(start[:, ::-1]) for start in back)
            origin = "landmarks" if len(landmarks) else "anchors"
            starts = [*anchor_starts(pair, landmarks, (source, target)), *turned]
            first_maps = [(start, origin) for start in starts]
        if self.isometric_map is not None:
            first_maps.append((self._pairs(self.isometric_map.image), self.isometric_map.origin))
        else:
            from_priors = starts_from_priors(pair)
            first_maps += [(search_pairs(pair, rows), origin) for rows, origin in from_priors]
        return [*first_maps, *self._other_starts, *self.first_maps_handed_in()]

    @cached_property
    def _shapes(self) -> tuple[ElasticShape, ElasticShape]:
        config = self.pair.config
        both = self.source, self.target
        source, target = parallel_map(lambda shape: find_mirror_images(shape, config), both)
        return source, target

    @cached_property
    def _coarse(self) -> ElasticFit:
        source, target = (shape.sample(ELASTIC_SEARCH.n_coarse_samples, False) for shape in self._shapes)
        return ElasticFit(source, target, self.pair.signatures, self.priors.landmarks)

    @cached_property
    def _fine(self) -> ElasticFit:
        source, target = (shape.sample(self.pair.config.n_refine, True) for shape in self._shapes)
        weight = ELASTIC_FIT.fine_normal_weight
        return replace(self._coarse, source=source, target=target, normal_weight=weight)

    @cached_property
    def _bendings(self) -> tuple[ElasticBending, ElasticBending]:
        """Bending of the source onto the target, and of the target onto the source."""
        pair, count, landmarks = self.pair, self.pair.config.elastic.n_bent_vertices, self.priors.landmarks
        of_source, of_target = parallel_map(
            lambda back: ElasticBending(pair, count, back, landmarks), (False, True)
        )
        return of_source, of_target

    def _step(self, fit: StretchedFit, step: Step) -> StretchedFit | None:
        """Take a coarse step; None if the map reverses the orientation before it, or is twisted after it."""
        coarse = self._coarse
        images = fit.images or coarse.images(fit.coefficients)
        if images.orientation < 0:
            return None
        coefficients, images = coarse.run(fit.coefficients, (step,), images)
        if images.orientation < ELASTIC_SEARCH.min_orientation:
            return None
        # score = spectral residual × (asymmetry_unit + asymmetry)^asymmetry_exponent: of equally good fits,
        # the map is right that sends mirror images to mirror images. An asymmetry below the unit may come
        # from the shapes.
        asymmetry = ELASTIC_SEARCH.asymmetry_unit + coarse.asymmetry(images)
        penalty = asymmetry**ELASTIC_SEARCH.asymmetry_exponent
        image, residual = BodyVertices(coarse.target.targets[images.forth]), images.spectral_residual
        moved = replace(fit, image=image, coefficients=coefficients, images=images)
        return replace(moved, spectral_residual=residual, score=residual * penalty)

    def _begin(self, fit: StretchedFit) -> StretchedFit:
        """Extend a coarse fit to the vertices of the model."""
        source, target = self._fine.embedding(fit.coefficients)
        image = BodyVertices(self.target.index.vertices(target, source[self.vertices]))
        return replace(fit, image=image, spectral_residual=np.inf, score=np.nan)

    def _draw(self, by: ElasticFit, step: Step, pairs: BodyVertices, origin: str) -> StretchedFit:
        """Fit smooth maps to pairs of vertices, with the functions of a step."""
        coefficients = by.from_pairs(pairs, step)
        return StretchedFit(BodyVertices(pairs[:0, 0]), origin=origin, coefficients=coefficients)

    def _draw_fit(self, fit: Fit) -> StretchedFit:
        return self._draw(self._fine, LAST_STEP, self._pairs(fit.image), fit.origin)

    @cached_property
    def _initial_images(self) -> Int[BodyVertices, "r"]:
        """Images of the vertices of the model under the initial map, −1 where it has none."""
        image = np.full(self.source.body.n_vertices, -1)
        image[self.priors.initial_pairs[:, 0]] = self.priors.initial_pairs[:, 1]
        return BodyVertices(image[self.vertices])

    def refine_jointly(self, fits: Sequence[StretchedFit]) -> list[StretchedFit]:
        """Bend both shapes onto each other, at a low resolution; images are nearest points."""
        # halfway, maps with much worse scores are dropped, except the isometric map and the initial map
        halfway = parallel_map(self._bend_halfway, fits)
        most = ELASTIC_FIT.hopeless_ratio * min((fit.score for fit in halfway), default=0.0)
        kept = [fit for fit in halfway if fit.score <= most or fit.is_isometric or fit.is_initial_map]
        return parallel_map(self._bend_further, kept)

    def _bend_halfway(self, fit: StretchedFit) -> StretchedFit:
        """Bend by the first lengths, which move large pieces."""
        coordinates, lengths = self._fine.embedding(fit.coefficients), self.pair.config.elastic.bending
        held = self.priors.initial_pairs if fit.is_initial_map else None
        lengths = lengths[: len(lengths) // 2]
        bent = tuple(bending.lay(coordinates, lengths, held) for bending in self._bendings)
        return replace(fit, bent=bent, score=_score(bent))

    def _bend_further(self, fit: StretchedFit) -> StretchedFit:
        """Bend by the other lengths, and take nearest points as images."""
        lengths = self.pair.config.elastic.bending
        lengths = lengths[len(lengths) // 2 :]
        bent = tuple(bending.bend_further(shape, lengths) for bending, shape in zip(self._bendings, fit.bent))
        image, score = self._bendings[0].images(bent[0], self.vertices), _score(bent)
        rows = np.flatnonzero(self._initial_images >= 0)
        error = self.target.mean_distance(image[rows], self._initial_images[rows]) if len(rows) else 0.0
        return replace(fit, image=image, spectral_residual=score, score=score, bent=bent, prior_error=error)

    def measure_fit(self, fit: Fit, image: Int[BodyVertices, "r"]) -> StretchedFit:
        """Fit smooth maps by all functions, and bend the shapes by them."""
        is_isometric = isinstance(fit, StretchedFit) and fit.is_isometric
        drawn = self._draw(self._fine, LAST_STEP, self._pairs(image), fit.origin)
        return replace(self._bend_further(self._bend_halfway(drawn)), is_isometric=is_isometric)

    def embedding(self, fit: StretchedFit) -> Embedding:
        """Joint coordinates, with positions and normals of the target and the bent source.

        The smooth maps are fitted again, with all functions, to both bent shapes. By them the source is bent in full, as
        similarly as possible. Then the joint refinement takes its last step, starting from nearest points, and from a
        map known before if both are the same: bending finds limbs, and the refinement details.
        """
        pair, bent = self.pair, self._bend_in_full(fit)
        both = bent.mesh, bent.onto.mesh
        positions = Embedding(*(with_normals(mesh, ELASTIC_FIT.normal_weight) for mesh in both))
        image = self._nearest_images(positions)
        known = self._known_before(fit, image)
        if known is not None:
            image = self._nearest_images(self._add_positions(known, positions))
        image, _ = refine_images(pair, image, 1.0, *pair.config.refining.last_step)
        return self._add_positions(image, positions)

    def _known_before(self, fit: StretchedFit, image: BodyVertices) -> Int[BodyVertices, "r"] | None:
        """Images of the initial map, or of an isometric map that fits, if it is the same map."""
        if len(self.priors.initial_pairs) and fit.prior_error < MAP_DISTANCE.same_map:
            return BodyVertices(np.where(self._initial_images >= 0, self._initial_images, image))
        if self.isometric_map is None or not self.isometric_map_fits:
            return None
        is_same = self.target.mean_distance(fit.image, self.isometric_map.image) < MAP_DISTANCE.same_map
        return self.isometric_map.image if is_same else None

    def _bend_in_full(self, fit: StretchedFit) -> BentShape:
        """Bend the source onto the target in full, starting from both coarsely bent shapes."""
        settings, bending = self.pair.config.elastic, self._bendings[0]
        pairs = np.concatenate([bending.pairs(bent) for bending, bent in zip(self._bendings, fit.bent)])
        coefficients, _ = self._fine.run(self._fine.from_pairs(BodyVertices(pairs), LAST_STEP), (LAST_STEP,))
        lengths = settings.bending[ELASTIC_FIT.n_skipped_lengths :]
        coarse = bending.lay(self._fine.embedding(coefficients), lengths, most_scaled=settings.most_scaled)
        return bending.lay_in_full(coarse, ELASTIC_FIT.full_lengths, settings.most_scaled)

    def _nearest_images(self, embedding: Embedding) -> Int[BodyVertices, "r"]:
        """Images of the vertices of the model: nearest points in coordinates."""
        return BodyVertices(self.target.index.vertices(embedding.target, embedding.source[self.vertices]))

    def _add_positions(self, image: Int[BodyVertices, "r"], positions: Embedding) -> Embedding:
        """Joint coordinates under a map, and positions of bent shapes."""
        joint = register_map(self.pair, image, 1.0, self.refinement.smooth)
        return Embedding(*(np.hstack([x, ELASTIC_FIT.position_weight * y]) for x, y in zip(joint, positions)))

    def measure(self, match: Match[StretchedFit, Embedding]) -> Measured:
        """Map vertices to nearest points, and measure the map, unless it was measured before."""
        ranking, winner = match.ranking, match.ranking.best
        if self.found and self.keeps_lengths(winner):
            before = self.found.measured
            quality = replace(before.quality, runner_up=ranking.runner_up, bending_cost=winner.score)
            return replace(before, quality=quality, note=FAR_KEPT_NOTE)
        points = self.target.index.points(match.coordinates.target, match.coordinates.source)
        distance = descriptor_distance_of(*self.balls, points.corners[:, 0])
        quality = measure_quality(self.pair, points)
        quality = replace(quality, runner_up=ranking.runner_up, bending_cost=winner.score)
        n_bent = 1 + len(ranking.others)
        reason = f"least cost of {match.proposals.n_tried} elastic maps, {n_bent} bent"
        return Measured(points, quality, distance, reason, winner.origin, note=FAR_NOTE)

    def sum_up(
        self, match: Match[StretchedFit, Embedding], measured: Measured, timer: StageTimer
    ) -> Solution:
        """Sum up the map, with the alternatives of the isometric match if there was one."""
        if self.found:
            return self.found.model.sum_up(self.found, measured, timer)
        pair = self.pair
        regions = regions_of_doubt(pair, measured.descriptor_distance)
        errors = expected_errors(pair, measured.points, doubt_in(regions, self.source.body.n_vertices))
        far = (measured.evidence(pair, far=True),)
        solution = measured.solution(pair, errors, far, [measured.note], regions=regions)
        return replace(solution, descriptors_count=False)

    def complete(
        self,
        match: Match[StretchedFit, Embedding],
        measured: Measured,
        solution: Solution,
        timer: StageTimer,
    ) -> Solution:
        """Complete a map as the isometric match would."""
        return self.found.model.complete(self.found, measured, solution, timer) if self.found else solution


def _score(bent: tuple[BentShape, ...]) -> float:
    # √(s g · s′ g′) with the stretch and gap of both bent shapes, see `BentShape`. Both directions are
    # needed: the source bends well onto a target even if one limb of the target has no counterpart.
    source, target = bent
    return max(float(np.sqrt(source.bending_cost * target.bending_cost)), MIN_SCORE)


def far_from_isometric(problem: Problem, quality: Quality) -> bool:
    """Whether the best isometric map fits badly, so that an elastic map should be searched."""
    bounds, limit = problem.config.outcome, problem.config.elastic.min_spectral_residual
    if not problem.allows_elastic:
        return False
    stretched = quality.spectral_residual > limit or fits_badly(quality, bounds)
    return stretched and not mirror_image_fits(quality, bounds)
