"""Part: one shape is a part of the other, so distances are known up to intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from operator import attrgetter
from typing import Literal

import numpy as np

from isomatch._core.arrays import (
    BodyVertices,
    Bool,
    BoolArray,
    Float,
    FloatArray,
    Int,
    IntArray,
    PartVertices,
    SearchRows,
)
from isomatch._core.cached import cached_method, cached_property
from isomatch._core.errors import NotConvergedError, SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Correspondence, Embedding, PrecisePoints
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.assessment.confidence import expected_errors
from isomatch.matching.assessment.evidence import Evidence, Measured, PartDoubt, Solution, part_contradicts
from isomatch.matching.assessment.quality import (
    covered_share,
    descriptor_distance_of,
    distances_to_priors,
    edge_stretch,
    image_positions,
    prior_errors,
    quality_of,
)
from isomatch.matching.coordinates import SmoothPair
from isomatch.matching.model import Match, Proposals, RefiningModel, origin_of
from isomatch.matching.parameters import MAP_DISTANCE, PART_FIT, TIES
from isomatch.matching.partial.part_pair import PartPair
from isomatch.matching.partial.part_registration import (
    ALL_FUNCTIONS,
    BentPart,
    PartFit,
    PartFits,
    WholeCoordinates,
)
from isomatch.matching.partial.part_starts import PartStarts, find_self_maps
from isomatch.matching.problem import Problem
from isomatch.matching.proposals.starts import nearest_in_pose
from isomatch.matching.result import Alternative
from isomatch.matching.selection import (
    Ranking,
    Rules,
    distances_between,
    keep_distinct,
    nearest_to_priors,
    select,
)
from isomatch.shapes import PreparedShape

PartSide = Literal["source", "target"]


class Part(RefiningModel[PartFit, BentPart]):
    """One shape is a part of the other; maps lead from the part to the whole.

    Parameters
    ----------
    problem : Problem
    side : {"source", "target"}
        The shape that is a part.
    known_map : tuple, optional
        A map that another method found, which is refined instead of a search: the image of each vertex of the part, its
        origin, and the ratio by which it led over other maps.
    coordinates : WholeCoordinates, optional
        Coordinates of the whole, if several parts of it share them.

    Notes
    -----
    Only this model uses intervals of distances, assigns anchors in several units, selects the unit of the part, and
    bends it.

    Examples
    --------
    The model maps the part, even if it is the target of the problem:

    >>> from isomatch.datasets import example_pair
    >>> from isomatch.matching import Part, prepare_pair
    >>> whole, part = example_pair()
    >>> problem = prepare_pair(whole.mesh, part.mesh)
    >>> Part(problem, "target").source is problem.target
    True
    """

    way = "part"
    last_stage = "bending"

    def __init__(
        self,
        problem: Problem,
        side: PartSide = "source",
        known_map: tuple[BodyVertices, str, float] | None = None,
        coordinates: WholeCoordinates | None = None,
    ) -> None:
        if side not in ("source", "target"):
            raise SettingError(f"side = {side!r}; the part is the 'source' or the 'target'")
        super().__init__(problem)
        self.side, self.known_map = side, known_map
        self.pair = problem if side == "source" else problem.turned
        self._coordinates = coordinates

    def refine_jointly(self, fits: Sequence[PartFit]) -> list[PartFit]:
        """Refine maps of a part by functions of the whole that are pulled back to it."""
        return parallel_map(self.fits.refine, fits)

    def refine_again(self, fit: PartFit) -> PartFit:
        """Refine a map again that was moved after its refinement."""
        return self.fits.refine_again(fit) if self.refinement.in_rounds else self._refine_by_user(fit)

    def measure_fit(self, fit: PartFit, image: Int[BodyVertices, "r"]) -> PartFit:
        """Measure a map of the part."""
        return self.fits.measure(fit.pair, image, fit.origin)

    def embedding(self, fit: PartFit) -> Embedding:
        """Coordinates of all vertices of part and whole, with all functions."""
        all_vertices = PartVertices(np.arange(self.source.body.n_vertices))
        return fit.refinement.embedding(fit.image, ALL_FUNCTIONS, all_vertices)

    @property
    def little_is_missing(self) -> bool:
        """Whether the part is nearly the whole, by the units of the files."""
        pair, settings = self.fits.pair, self.pair.config.parts
        knows_distances = pair.known_share >= settings.little_trusted
        least = settings.little_missing if knows_distances else settings.most_there
        return bool(pair.knows_unit and pair.share >= least)

    def require_suitable(self) -> None:
        """Raise an `IsomatchError` unless shapes, orientation and priors suit a part."""
        self.require_sides()
        self.require_priors()
        self.require_no_descriptors("a whole and its part")

    def propose(self, timer: StageTimer) -> Proposals[PartFit]:
        """Search by anchors, refine roughly, and prepare the best and known maps."""
        timer.start("search")
        config, settings = self.pair.config, self.pair.config.parts
        first_maps = self._first_maps()
        only_given = config.hypotheses == "given" and not self.searches_by_anchors
        rough = [] if only_given else self._rough_fits(first_maps)
        kept = self._keep_distinct(rough, PART_FIT.n_contenders)
        hopeful = [fit for fit in kept if fit.rough_cost <= settings.hopeless * kept[0].rough_cost]
        hopeful = kept[: max(len(hopeful), 2)]  # the two best maps are kept in any case
        contenders = [*((fit.pair, fit.image, fit.origin) for fit in hopeful), *first_maps]
        if not contenders:
            raise NotConvergedError(
                "no map of the part keeps the orientation of the faces; give three to five landmarks, or start = 'pose' "
                "if the shapes are roughly aligned in space"
            )
        begun = parallel_map(lambda contender: self.fits.begin(*contender), contenders)
        return Proposals(begun, len(rough) + len(first_maps))

    def rank(
        self, maps: list[PartFit], rivals: list[PartFit], proposals: Proposals[PartFit], timer: StageTimer
    ) -> Ranking[PartFit]:
        """Refine the best from the bent part, and select by cost, or by `verify` if in doubt."""
        settings = self.pair.config.parts
        fits, costs = self._by_cost(maps)
        timer.start("settling")
        n_settled = sum(cost <= settings.hopeless * costs[0] for cost in costs[: settings.n_settled])
        settle = partial(self.fits.refine_from_bending, again=self.refine_again)
        fits, costs = self._by_cost([*parallel_map(settle, fits[:n_settled]), *fits[n_settled:]])
        distances = distances_between([fit.image for fit in fits], self.target.mean_distances)
        rules = Rules(
            runner_up_distance=MAP_DISTANCE.other_map,
            tie=settings.tie,
            mirror_tie=settings.tie,
            landmark_slack=TIES.landmark_slack,
        )
        ranking = select(fits, distances, rules, scores=costs)
        if self.known_map:  # the lead that it had when it was found limits its lead here
            ranking = replace(ranking, runner_up=min(ranking.runner_up, self.known_map[2]))
        return self._verify_if_in_doubt(ranking)

    def _verify_if_in_doubt(self, ranking: Ranking[PartFit]) -> Ranking[PartFit]:
        best = ranking.best
        fits = self._keep_distinct([best, *ranking.others], PART_FIT.n_contenders)
        doubt = self._doubt_of(ranking)
        if doubt.evidence.poor or doubt.evidence.ambiguous:
            fits = self._by_verification(fits)
        ranking = replace(ranking, distinct=tuple(fits[1:]))
        if fits[0] is best:
            return ranking
        ratio = min(best.cost / fits[0].cost, 1.0)  # at most 1: another map was best by cost
        return replace(ranking, best=fits[0], runner_up=ratio)

    def _doubt_of(self, ranking: Ranking[PartFit]) -> PartDoubt:
        best, settings = ranking.best, self.pair.config.parts
        return PartDoubt(best.cost_with_bending, ranking.runner_up, best.pair.known_share, settings)

    def descriptor_distance(self, fit: PartFit) -> Float[FloatArray, "r"]:
        """Descriptor distance of each vertex and its image, by balls."""
        return fit.descriptor_distances

    @property
    def descriptor_weight(self) -> float:
        """Weight of the descriptor distance in the ratio of two costs."""
        return self.pair.config.parts.descriptor_weight

    def _by_cost(self, fits: list[PartFit]) -> tuple[list[PartFit], list[float]]:
        """Order maps by their weighed cost; return maps and costs."""
        costs = self.weigh(fits, list(map(self.cost, fits)), [True] * len(fits))
        order = sorted(range(len(fits)), key=lambda i: costs[i])
        return [fits[i] for i in order], [costs[i] for i in order]

    def coordinates(self, best: PartFit) -> BentPart:
        """Bend the part onto the whole by a map, at full resolution."""
        lengths = self.pair.config.parts.bending[-PART_FIT.n_final_lengths :]
        return best.bending.lay_in_full(best.bent, lengths)

    def cost(self, fit: PartFit) -> float:
        """Cost of a map, see ``PartFit.cost``."""
        return fit.cost

    def image(self, best: PartFit) -> Int[BodyVertices, "n_part"]:
        """Vertex of the whole for each vertex of the part, bent at the lower resolution."""
        return self.fits.bending.images(best.bent, np.arange(self.source.body.n_vertices))

    def _keep_distinct(self, fits: list[PartFit], count: int) -> list[PartFit]:
        least = MAP_DISTANCE.other_map
        return keep_distinct(fits, lambda fit: fit.image, self.target.mean_distances, least, count)

    def _rough_fits(self, first_maps: list[tuple[PartPair, BodyVertices, str]]) -> list[PartFit]:
        """Refine starts and first maps roughly, also composed with self-maps; best first."""
        rough_cost, by = attrgetter("rough_cost"), self.fits
        fits = self._refined_starts if self.known_map is None else []
        fits = [*fits, *parallel_map(lambda x: by.refine_roughly(*x), first_maps)]
        rough = sorted((fit for fit in fits if fit), key=rough_cost)
        if self.known_map:
            return rough
        best = self._keep_distinct(rough, PART_FIT.n_composed)
        composed = parallel_map(lambda x: by.compose(*x), list(product(best, self._self_maps)))
        return sorted([*rough, *(fit for fit in composed if fit)], key=rough_cost)

    @cached_property
    def _self_maps(self) -> list[Int[SearchRows, "m_t"]]:
        """Maps of the whole onto itself; none with landmarks, which tell its sides apart."""
        pair = self.fits.pair
        return [] if len(pair.landmarks) else find_self_maps(pair.whole, pair.config)

    @cached_property
    def _refined_starts(self) -> list[PartFit | None]:
        """Starts by anchors, refined roughly; None for mirror images."""
        if not self.searches_by_anchors:
            return []
        signatures = self.fits.coordinates.signatures
        return parallel_map(self.fits.refine_start, PartStarts(self.fits.pair, signatures, self._self_maps)())

    def _first_maps(self) -> list[tuple[PartPair, BodyVertices, str]]:
        """First maps of the rough vertices, from a known map, priors and starts, with origins."""
        images: list[tuple[BodyVertices, str]] = []
        if self.known_map:
            images.append(self.known_map[:2])
        if self.fits.given is not None:
            origin = "initial map" if len(self.priors.initial_pairs) else "pose"
            images.append((self.fits.given, origin))
        for pairs, origin in self.first_maps_handed_in():
            images.append((fill_images(self.source, pairs_to_whole(pairs, self.side))[0], origin))
        rough, pair = self.source.sample_vertices[: PART_FIT.n_rough_vertices], self.fits.pair
        return [(pair.in_unit_of(image), BodyVertices(image[rough]), origin) for image, origin in images]

    @cached_property
    def fits(self) -> PartFits:
        """Refines maps of the part."""
        return fits_of(self.problem, self.side, self._coordinates)

    def _by_verification(self, fits: list[PartFit]) -> list[PartFit]:
        """Order maps that are in doubt by their cost in `verify`."""
        fits = nearest_to_priors(fits, TIES.landmark_slack)
        if self.known_map or len(fits) < 2:
            return fits
        costs = [self.verified(fit).cost for fit in fits]
        return [fits[i] for i in np.argsort(costs, kind="stable")]

    def _alternatives(self, fits: Sequence[PartFit]) -> tuple[Alternative, ...]:
        """Return other maps that were refined to the end; the part is bent by each at its first use."""
        return tuple(
            Alternative(partial(self._map_of, fit), fit.cost, fit.orientation, origin_of(self.problem, fit))
            for fit in fits[: self.pair.config.selection.most_alternatives]
        )

    def _map_of(self, fit: PartFit) -> Correspondence:
        points, matched, _ = self._directed(fit, self.coordinates(fit))
        return self.problem.source.correspondence(self.problem.target, points, matched)

    def _directed(self, fit: PartFit, bent: BentPart) -> tuple[PrecisePoints, Bool[BoolArray, "n_s"], float]:
        """Map of a bent part in the problem's direction, whether it maps each vertex, and its unit."""
        if self.side == "target":
            return *bent.onto_part(), 1 / fit.pair.unit
        return bent.points, np.ones(self.source.body.n_vertices, dtype=bool), fit.pair.unit

    def measure(self, match: Match[PartFit, BentPart]) -> Measured:
        """Measure the map in the direction of the problem."""
        best, bent = match.ranking.best, match.coordinates
        points, matched, unit = self._directed(best, bent)
        balls = best.pair.signature, best.pair.whole.balls
        of_source, of_target = balls if self.side == "source" else balls[::-1]
        descriptor_distance = descriptor_distance_of(of_source, of_target, points.corners[:, 0], matched)
        reason = f"fits best of {1 + len(match.ranking.others)} maps of a part refined to the end"
        return measure_part(self.problem, best, bent, unit, points, matched, descriptor_distance, reason)

    def sum_up(self, match: Match[PartFit, BentPart], measured: Measured, timer: StageTimer) -> Solution:
        """Sum up the map in the direction of the problem."""
        best, bent, covered = match.ranking.best, match.coordinates, measured.matched
        errors = expected_errors_of_part(best.pair, bent.points)
        if self.side == "target":
            errors = errors[measured.points.corners[:, 0]] / best.pair.unit
        else:
            _, covered = bent.onto_part()
        area = best.pair.whole.mesh_body.vertex_areas[covered].sum()
        share = self.fits.local_unit(best.pair, best.image) ** 2
        notes = [
            f"the {self.side} was matched as a part: it has {share:.0%} of the area of the other shape and covers "
            f"{area:.0%}"
        ]
        evidence = (contradiction_evidence(self.problem, measured),)
        solution = measured.solution(self.problem, errors, evidence, notes)
        solution = solution.with_doubt(self._doubt_of(match.ranking))
        return replace(solution, alternatives=self._alternatives(match.ranking.distinct))


@cached_method
def fits_of(problem: Problem, side: PartSide, coordinates: WholeCoordinates | None) -> PartFits:
    """Return the refiner of maps of a part, which is kept with the problem."""
    pair = problem if side == "source" else problem.turned
    pairs = problem.priors.initial_pairs
    if not len(pairs) and problem.config.start == "pose":
        vertices = BodyVertices(np.arange(problem.source.body.n_vertices))
        images = nearest_in_pose(problem.source, problem.target, vertices)
        pairs = BodyVertices(np.column_stack([vertices, images]))
    given = fill_images(pair.source, pairs_to_whole(pairs, side))[0] if len(pairs) else None
    known = pair.priors.landmarks, pair.known
    return PartFits(PartPair.of(pair.source, pair.target, pair.config, *known), given, coordinates)


def pairs_to_whole(pairs: Int[BodyVertices, "q 2"], side: PartSide) -> Int[IntArray, "q 2"]:
    """Turn pairs of source and target vertices into pairs of part and whole vertices."""
    return pairs if side == "source" else pairs[:, ::-1]


def measure_part(
    problem: Problem,
    fit: PartFit,
    bent: BentPart,
    unit: float,  # √area of the source over √area of the target
    points: PrecisePoints,  # images of the vertices of the source's body
    matched: Bool[BoolArray, "n_s"],  # which vertices have an image
    descriptor_distance: Float[FloatArray, "n_s"] | None,
    reason: str,
) -> Measured:
    """Measure a map from or to a part."""
    priors, source, target = problem.priors, problem.source, problem.target
    image = BodyVertices(points.corners[:, 0])
    initial_pairs = BodyVertices(priors.initial_pairs[matched[priors.initial_pairs[:, 0]]])
    landmark_error, initial_map_error = prior_errors(problem, image, priors.landmarks, initial_pairs)
    positions, bounds = image_positions(source.body, target.body, points), problem.config.outcome
    quality = quality_of(
        spectral_residual=fit.spectral_residual,
        runner_up=np.inf,
        mirrored=np.inf,
        stretch=edge_stretch(source.body, positions, bounds.max_counted_growth, unit, matched),
        orientation=fit.orientation,
        coverage=covered_share(target.body, image[matched], bounds.coverage_radius),
        landmark_error=landmark_error,
        initial_map_error=initial_map_error,
        stress=fit.stress,
        bending_cost=bent.bending_cost,
    )
    return Measured(points, quality, descriptor_distance, reason, origin_of(problem, fit), matched)


def contradiction_evidence(problem: Problem, measured: Measured) -> Evidence:
    """Compare the map of a part with its priors."""
    image = BodyVertices(measured.points.corners[:, 0])
    errors = distances_to_priors(problem, image, problem.priors.landmarks)
    bound = problem.config.outcome.contradiction
    return Evidence(contradicted=part_contradicts(errors, measured.quality.initial_map_error, bound))


def fill_images(
    part: PreparedShape, pairs: Int[IntArray, "q 2"]
) -> tuple[Int[BodyVertices, "n_part"], Float[FloatArray, "n_part"]]:
    """Give each vertex the image of the nearest mapped vertex; also return the distance of the latter."""
    gap, nearest = distance_along_edges_to_nearest(part.body, np.unique(pairs[:, 0]))
    image = np.zeros(part.body.n_vertices, dtype=np.int64)
    image[pairs[::-1, 0]] = pairs[::-1, 1]
    return BodyVertices(image[nearest]), gap


def expected_errors_of_part(pair: PartPair, points: PrecisePoints) -> Float[FloatArray, "n_part"]:
    """Estimate the errors of the images of the part, in √area of the whole."""
    smooth = SmoothPair(pair.part, pair.whole, pair.config)
    return pair.unit * expected_errors(smooth, points, unit=pair.unit)
