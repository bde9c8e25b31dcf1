"""Part: one shape is a part of the other, so that distances on the whole lie in intervals."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from itertools import product
from operator import attrgetter
from typing import Literal, Self, cast

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
from isomatch._core.cached import cached_property
from isomatch._core.errors import NotConvergedError, SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map, serial_blas
from isomatch.correspondence import Correspondence, Embedding, PrecisePoints, SpectralPair
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.assessment.confidence import expected_errors
from isomatch.matching.assessment.evidence import Evidence, PartDoubt, Solution, part_contradicts
from isomatch.matching.assessment.quality import (
    covered_share,
    descriptor_distance_of,
    distances_to_priors,
    edge_stretch,
    image_positions,
    prior_errors,
)
from isomatch.matching.isometric.isometry import Measured
from isomatch.matching.maps import Fit
from isomatch.matching.partial.part_pair import PartPair
from isomatch.matching.partial.part_registration import (
    ALL_FUNCTIONS,
    N_ROUGH_VERTICES,
    BentPart,
    PartFit,
    PartFits,
    WholeCoordinates,
)
from isomatch.matching.partial.part_starts import APART, PartStarts, self_maps
from isomatch.matching.pipeline import Relation
from isomatch.matching.problem import SmoothPair
from isomatch.matching.proposals.pose import nearest_in_pose
from isomatch.matching.result import Alternative, Quality
from isomatch.matching.selection import (
    LANDMARK_SLACK,
    Rules,
    Selection,
    distances_between,
    distinct,
    nearest_to_priors,
    select,
)
from isomatch.matching.verify import verifier_of
from isomatch.shapes import PreparedShape

# those without another source were chosen together on cuts and holes
N_VARIED = 4  # best rough maps that are composed with maps of the whole onto itself
N_CONTENDERS = 8  # best starts that are refined to the end
# last lengths with which the best map bends the part in full; 3 and 10 no better on four parts
N_BENT_IN_FULL = 5

PartSide = Literal["source", "target"]


class Part(Relation):
    """One shape is a part of the other: its vertices are mapped to the whole, whichever of the two is the source.

    Parameters
    ----------
    side : {"source", "target"}
        The shape that is a part.

    Notes
    -----
    Intervals of distances, starts that assign anchors in several units, bending and the choice of the unit concern parts
    alone; model selection, the loop of the refinement and verification are those of every relation.

    Examples
    --------
    What is mapped is the part, also where it is the target:

    >>> from isomatch.datasets import example_pair
    >>> from isomatch.matching import Priors, Part, prepare_pair
    >>> whole, part = example_pair()
    >>> pair = prepare_pair(whole.mesh, part.mesh)
    >>> relation = Part("target").on(pair, Priors.of(pair, None, None, None))
    >>> relation.source is pair.target
    True
    """

    way = "part"

    def __init__(self, side: PartSide = "source") -> None:
        if side not in ("source", "target"):
            raise SettingError(f"side = {side!r}; the part is the 'source' or the 'target'")
        self.side = side
        # a map found otherwise, which is refined without a search: image of each vertex of the part, where it came from,
        # and the ratio by which the other search preferred it to others
        self.led: tuple[BodyVertices, str, float] | None = None
        self.coordinates: WholeCoordinates | None = None  # of the whole, if other parts of it share them

    @property
    def source(self) -> PreparedShape:
        """The part."""
        return self.pair.source if self.side == "source" else self.pair.target

    @property
    def target(self) -> PreparedShape:
        """The whole."""
        return self.pair.target if self.side == "source" else self.pair.source

    @property
    def vertices(self) -> Int[BodyVertices, "r"]:
        """Vertices of the part that a fit maps."""
        return BodyVertices(self.source.sample_vertices[: self.pair.config.n_refine])

    @cached_property
    def spectra(self) -> SpectralPair:
        """The Laplace–Beltrami bases, for maps from these vertices of the part to all vertices of the whole."""
        basis = self.source.sampled_basis(self.pair.config.n_refine)
        return SpectralPair(basis, self.target.laplace.vectors, self.target.index.vertices)

    def refined(self, fits: Sequence[Fit]) -> list[Fit]:
        """Refine maps of a part by functions of the whole that are pulled back to it."""
        return parallel_map(lambda fit: self.fits.refined(cast(PartFit, fit)), fits)

    def refined_again(self, fit: Fit) -> PartFit:
        """Take the last steps of the refinement again."""
        return self.fits.refined_again(cast(PartFit, fit))

    def measured(self, fit: Fit, image: Int[IntArray, "r"]) -> PartFit:
        """Measure a map: where it is verified, the part is bent by it, too."""
        self.require_images(image)
        return self.fits.measured(cast(PartFit, fit).pair, BodyVertices(image), fit.origin)

    def embedding(self, fit: Fit) -> Embedding:
        """Coordinates of all vertices of part and whole, with all functions."""
        refinement = cast(PartFit, fit).refinement
        everywhere = PartVertices(np.arange(self.source.body.n_vertices))
        return refinement.embedding(fit.image, ALL_FUNCTIONS, everywhere)

    @property
    def little_is_missing(self) -> bool:
        """Whether little is missing by the units of the files, or somewhat more where few distances are known."""
        pair, settings = self.fits.pair, self.pair.config.parts
        trusted = pair.trusted >= settings.little_trusted
        least = settings.little_missing if trusted else settings.most_there
        return bool(pair.knows_unit and pair.share >= least)

    def led_by(self, image: Int[BodyVertices, "n_part"], origin: str, runner_up: float) -> Self:
        """Refine a map found otherwise, without a search of others; what this match of the part has found stays known."""
        led = copy(self)
        led.led = image, origin, runner_up
        return led

    def match(self, timer: StageTimer | None = None) -> Selection[PartFit]:
        """Search, refine, settle the best and select."""
        timer = timer or StageTimer()
        timer.start("search")
        config, settings, fits_of = self.pair.config, self.pair.config.parts, self.fits
        first_maps = self._first_maps()
        only_given = config.hypotheses == "given" and not self.searches_by_anchors
        rough = [] if only_given else self._rough_fits(first_maps)
        kept = self._distinct(rough, N_CONTENDERS)
        hopeful = [fit for fit in kept if fit.promise <= settings.hopeless * kept[0].promise]
        hopeful = kept[: max(len(hopeful), 2)]  # the best, and a runner-up
        contenders = [*((fit.pair, fit.image, fit.origin) for fit in hopeful), *first_maps]
        if not contenders:
            raise NotConvergedError(
                "no map of the part keeps the orientation of the faces; give three to five landmarks, or start = 'pose' "
                "if the shapes are roughly aligned in space"
            )
        timer.start("refinement")
        begun = parallel_map(lambda contender: fits_of.begun(*contender), contenders)
        fits, costs = self._by_cost(cast(list[PartFit], self.refine_and_select(begun)))
        timer.start("settling")
        n_settled = sum(cost <= settings.hopeless * costs[0] for cost in costs[: settings.n_settled])
        fits[:n_settled] = parallel_map(lambda fit: fits_of.settled(fit, self._again), fits[:n_settled])
        fits, costs = self._by_cost(fits)
        apart = distances_between([fit.image for fit in fits], self.target.mean_distances)
        rules = Rules(
            runner_up_distance=APART, tie=settings.tie, mirror_tie=settings.tie, landmark_slack=LANDMARK_SLACK
        )
        selection = select(fits, apart, rules, scores=costs)
        if self.led:  # by a match that has looked for others
            return replace(selection, runner_up=min(selection.runner_up, self.led[2]))
        return selection

    def descriptor_distance(self, fit: Fit) -> Float[FloatArray, "r"]:
        """Descriptor distance of the vertices and their images, by balls."""
        return cast(PartFit, fit).descriptor_distances

    @property
    def descriptor_weight(self) -> float:
        """How much the descriptor distance weighs in the ratio of two costs."""
        return self.pair.config.parts.descriptor_weight

    def _by_cost(self, fits: list[PartFit]) -> tuple[list[PartFit], list[float]]:
        """Order maps by their weighed cost; returns also the costs."""
        costs = self.weighed(fits, [fit.cost for fit in fits], [True] * len(fits))
        order = sorted(range(len(fits)), key=lambda i: costs[i])
        return [fits[i] for i in order], [costs[i] for i in order]

    def bent(self, fit: PartFit) -> BentPart:
        """Bend the part onto the whole by a map, in full."""
        return fit.bending.laid_in_full(fit.bent, self.pair.config.parts.bending[-N_BENT_IN_FULL:])

    def _again(self, fit: PartFit) -> PartFit:
        again = self.refinement.again(self, fit)
        self.require_measured(again, PartFit)
        return cast(PartFit, again)

    def _distinct(self, fits: list[PartFit], count: int) -> list[PartFit]:
        return distinct(fits, lambda fit: fit.image, self.target.mean_distances, APART, count)

    def _rough_fits(self, first_maps: list[tuple[PartPair, BodyVertices, str]]) -> list[PartFit]:
        """Refine starts and given maps roughly, and vary the best by maps of the whole onto itself; the best first."""
        promise, fits_of = attrgetter("promise"), self.fits
        fits = [
            *(self._anchored if self.led is None else []),
            *parallel_map(lambda x: fits_of.roughly(*x), first_maps),
        ]
        rough = sorted((fit for fit in fits if fit), key=promise)
        if self.led:
            return rough
        best = self._distinct(rough, N_VARIED)
        varied = parallel_map(lambda x: fits_of.varied(*x), list(product(best, self._onto_itself)))
        return sorted([*rough, *(fit for fit in varied if fit)], key=promise)

    @cached_property
    def _onto_itself(self) -> list[Int[SearchRows, "m_t"]]:
        """Maps of the whole nearly onto itself; none with landmarks, which tell the sides."""
        pair = self.fits.pair
        return [] if len(pair.landmarks) else self_maps(pair.whole, pair.config)

    @cached_property
    def _anchored(self) -> list[PartFit | None]:
        """The starts of the part's own search, refined roughly; None for mirror images."""
        if not self.searches_by_anchors:
            return []
        signatures = self.fits.coordinates.signatures
        return parallel_map(self.fits.rough, PartStarts(self.fits.pair, signatures, self._onto_itself)())

    def _first_maps(self) -> list[tuple[PartPair, BodyVertices, str]]:
        """Map the rough vertices, each time in its unit: by a map found otherwise, priors and starts; with origins."""
        images: list[tuple[BodyVertices, str]] = []
        if self.led:
            images.append(self.led[:2])
        if self._with_priors_image is not None:
            origin = "initial map" if len(self.priors.initial_pairs) else "pose"
            images.append((self._with_priors_image, origin))
        handed_in = self.first_maps_handed_in()
        images += [(filled(self.source, self._towards_whole(pairs))[0], name) for pairs, name in handed_in]
        rough = self.source.sample_vertices[:N_ROUGH_VERTICES]
        pair = self.fits.pair
        return [(pair.in_unit_of(image), BodyVertices(image[rough]), origin) for image, origin in images]

    def _towards_whole(self, pairs: Int[BodyVertices, "q 2"]) -> Int[IntArray, "q 2"]:
        """Turn pairs of vertices of source and target into such of part and whole."""
        return pairs if self.side == "source" else pairs[:, ::-1]

    @cached_property
    def fits(self) -> PartFits:
        """Refines maps of the part."""
        landmarks = self._towards_whole(self.priors.landmarks)
        functions = (self.pair if self.side == "source" else self.pair.turned).known
        pair = PartPair.of(self.source, self.target, self.pair.config, landmarks, functions)
        return PartFits(pair, self._with_priors_image, self.coordinates)

    @cached_property
    def _with_priors_image(self) -> Int[BodyVertices, "n_part"] | None:
        """Images by the initial map, or by the pose."""
        pairs, pair = self.priors.initial_pairs, self.pair
        if not len(pairs) and pair.config.start == "pose":
            vertices = BodyVertices(np.arange(pair.source.body.n_vertices))
            images = nearest_in_pose(pair.source, pair.target, vertices)
            pairs = BodyVertices(np.column_stack([vertices, images]))
        return filled(self.source, self._towards_whole(pairs))[0] if len(pairs) else None

    def solution(self, timer: StageTimer) -> Solution:
        """Find the map, and the evidence for it."""
        self.require_sides()
        self.require_priors()
        self.require_no_descriptors("a whole and its part")
        selection = self.match(timer)
        best = selection.winner
        doubt = PartDoubt(best.bent_cost, selection.runner_up, best.pair.trusted, self.pair.config.parts)
        fits = self._distinct([best, *selection.runners_up], N_CONTENDERS)
        if doubt.evidence.poor or doubt.evidence.ambiguous:
            fits = self._by_verification(fits)
            if fits[0] is not best:  # its own cost speaks for another
                selection = replace(selection, winner=fits[0], runner_up=best.cost / fits[0].cost)
                doubt = PartDoubt(
                    fits[0].bent_cost, min(selection.runner_up, 1.0), fits[0].pair.trusted, doubt.settings
                )
        solution = self._summed_up(selection, doubt, timer)
        return replace(solution, alternatives=self._alternatives(fits[1:]))

    def _by_verification(self, fits: list[PartFit]) -> list[PartFit]:
        """Order maps of which none is sure by what they cost on the shapes as they are, see `verify`."""
        fits = cast(list[PartFit], nearest_to_priors(fits, LANDMARK_SLACK))
        if self.led or len(fits) < 2:
            return fits
        verified = verifier_of(self.pair if self.side == "source" else self.pair.turned)
        vertices = np.arange(self.source.body.n_vertices)
        costs = [verified(self.fits.bending.images(fit.bent, vertices)).cost for fit in fits]
        return [fits[i] for i in np.argsort(costs, kind="stable")]

    def _alternatives(self, fits: list[PartFit]) -> tuple[Alternative, ...]:
        """Give other maps that were refined to the end; the part is bent by one when it is asked for."""
        return tuple(
            Alternative(partial(self._bent_by, fit), fit.cost, fit.orientation, self.origin_of(fit))
            for fit in fits[: self.pair.config.selection.most_alternatives]
        )

    def _bent_by(self, fit: PartFit) -> Correspondence:
        with serial_blas():
            points, matched, _ = self._directed(fit, self.bent(fit))
            return self.pair.source.correspondence(self.pair.target, points, matched)

    def _directed(self, fit: PartFit, bent: BentPart) -> tuple[PrecisePoints, Bool[BoolArray, "n_s"], float]:
        """Return the map by a bent part in the direction asked for, which vertices have an image, and its unit."""
        if self.side == "target":
            return *bent.onto_part(), 1 / fit.pair.unit
        return bent.points, np.ones(self.source.body.n_vertices, dtype=bool), fit.pair.unit

    def _summed_up(self, selection: Selection[PartFit], doubt: PartDoubt, timer: StageTimer) -> Solution:
        """Bend the part in full, and sum up the map in the direction asked for."""
        best = selection.winner
        timer.start("bending")
        bent = self.bent(best)
        points, matched, unit = self._directed(best, bent)
        errors = expected_errors_of_part(best.pair, bent.points)
        covered = matched
        if self.side == "target":
            errors = errors[points.corners[:, 0]] / best.pair.unit
        else:
            _, covered = bent.onto_part()
        area = best.pair.meshes[1].vertex_areas[covered].sum()
        timer.start("quality")
        balls = best.pair.signature, best.pair.whole.balls
        here, there = balls if self.side == "source" else balls[::-1]
        descriptor_distance = descriptor_distance_of(here, there, points.corners[:, 0], matched)
        reason = f"fits best of {1 + len(selection.runners_up)} maps of a part refined to the end"
        measured = measured_part(self, best, bent, unit, points, matched, descriptor_distance, reason)
        notes = [
            f"the {self.side} was matched as a part: it has {best.share:.0%} of the area of the other shape and covers "
            f"{area:.0%}"
        ]
        evidence = (contradiction(self, measured),)
        return measured.solution(self.pair, self.priors, errors, evidence, notes).doubted(doubt)


def measured_part(
    relation: Relation,
    fit: PartFit,
    bent: BentPart,
    unit: float,  # what √area of the source is worth in √area of the target
    points: PrecisePoints,  # images of the vertices of the source's body
    matched: Bool[BoolArray, "n_s"],  # which of them there are
    descriptor_distance: Float[FloatArray, "n_s"] | None,
    reason: str,
) -> Measured:
    """Measure a map in which a part takes part."""
    pair, priors = relation.pair, relation.priors
    source, target = pair.source, pair.target
    image = BodyVertices(points.corners[:, 0])
    initial_pairs = BodyVertices(priors.initial_pairs[matched[priors.initial_pairs[:, 0]]])
    landmark_error, initial_map_error = prior_errors(pair, image, priors.landmarks, initial_pairs)
    positions, bounds = image_positions(source.body, target.body, points), pair.config.outcome
    quality = Quality(
        spectral_residual=fit.spectral_residual,
        runner_up=np.inf,
        mirrored=np.inf,
        residual=np.nan,
        stretch=edge_stretch(source.body, positions, bounds.torn, unit, matched),
        orientation=fit.orientation,
        distortion_mean=np.nan,
        distortion_p95=np.nan,
        coverage=covered_share(target.body, image[matched], bounds.coverage_radius),
        matched=np.nan,
        landmark_error=landmark_error,
        initial_map_error=initial_map_error,
        stress=fit.stress,
        bending_cost=bent.spectral_residual,
    )
    return Measured(points, quality, descriptor_distance, reason, relation.origin_of(fit), matched)


def contradiction(relation: Relation, measured: Measured) -> Evidence:
    """Compare the map of a part with its priors."""
    pair, priors = relation.pair, relation.priors
    errors = distances_to_priors(pair, BodyVertices(measured.points.corners[:, 0]), priors.landmarks)
    bound = pair.config.outcome.contradiction
    return Evidence(contradicted=part_contradicts(errors, measured.quality.initial_map_error, bound))


def filled(
    part: PreparedShape, pairs: Int[IntArray, "q 2"]
) -> tuple[Int[BodyVertices, "n_part"], Float[FloatArray, "n_part"]]:
    """Image of each vertex under a map of some, or of the nearest of these, and how far it is."""
    gap, nearest = distance_along_edges_to_nearest(part.body, np.unique(pairs[:, 0]))
    image = np.zeros(part.body.n_vertices, dtype=np.int64)
    image[pairs[::-1, 0]] = pairs[::-1, 1]
    return BodyVertices(image[nearest]), gap


def expected_errors_of_part(pair: PartPair, points: PrecisePoints) -> Float[FloatArray, "n_part"]:
    """Estimate the errors of the images of the part, in √area of the whole."""
    smooth = SmoothPair(pair.part, pair.whole, pair.config)
    return pair.unit * expected_errors(smooth, points, unit=pair.unit)
