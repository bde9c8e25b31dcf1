"""Elastic: limbs may stretch, so that distances of two shapes agree only roughly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from isomatch.correspondence import Embedding
from isomatch.errors import NotConvergedError
from isomatch.matching.confidence import expected_errors
from isomatch.matching.contest import Rules, Selection, distances_between, distinct, select
from isomatch.matching.fit import Fit
from isomatch.matching.judge import Solution, fits_badly, measured_evidence, mirror_image_fits
from isomatch.matching.quality import contradicted_landmarks, mean_known, measure_quality, mismatch_of
from isomatch.matching.regions import doubt_in, lifted, regions_of_doubt
from isomatch.matching.relations.elastic_fit import Coefficients, ElasticFit, Images, Step, coarse_steps
from isomatch.matching.relations.elastic_shape import N_COARSE, ElasticShape
from isomatch.matching.relations.elastic_starts import anchor_starts
from isomatch.matching.relations.isometry import Measured
from isomatch.matching.relations.mirror import with_mirror
from isomatch.matching.result import Quality
from isomatch.matching.search import FromAnchors, starts_of
from isomatch.matching.stages import Relation, first_maps_of
from isomatch.matching.starts import starts_from_hints
from isomatch.runtime.stage_timer import StageTimer
from isomatch.runtime.threads import parallel_map
from isomatch.values.arrays import IntArray
from isomatch.values.cached import cached_property

N_CONTENDERS = 6  # coarse fits that are fitted finely; docs/robustness.md, other species

# score of a fine fit = misfit × stretch to this power; docs/robustness.md, other species
STRETCH_EXPONENT = 0.03

# score of a coarse fit = misfit × (unit + asymmetry)^exponent; chosen on pairs of animals, not one by one
ASYMMETRY_UNIT = 0.1

ASYMMETRY_EXPONENT = 0.25  # see ASYMMETRY_UNIT; chosen on pairs of animals, not one by one

# mean cosine between normals from which a coarse fit is followed up; selection.orientation_threshold
LEAST_ORIENTATION = 0.3

FINE_FUNCTIONS = (40, 70, 100, 150, 200)  # in the steps of the fine fit; Melzi et al. 2019, in larger steps
# factor of the Dirichlet energy in these steps; chosen: halved as functions double
FINE_SMOOTHNESS = (0.01, 0.005, 0.0025, 0.001, 0.0005)

# from so many on, maps need not exchange mirror images; chosen: details may differ from side to side
FREE_FUNCTIONS = 100

# mean distance, in √area, by which coarse fits that are fitted finely differ; search.same_map
SAME_MAP = 0.05

# of normals, beside canonical coordinates: in the fine fit, and in the misfit that scores it;
# docs/robustness.md, other species
FINE_NORMAL_WEIGHT, SCORE_NORMAL_WEIGHT = 0.15, 0.0

FINE_ITERATIONS = 2  # in each step; docs/robustness.md, other species

FAR = (
    "the shapes are far from isometric, so a map was sought that lets limbs stretch; it may be wrong in places: look at "
    "the picture, and give five landmarks at extremities if it is"
)
FAR_KEPT = (
    "the shapes are far from isometric, but no map that lets limbs stretch scores better; the map may be wrong in "
    "places: look at the picture, and give five landmarks at extremities if it is"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class StretchedFit(Fit):
    """An elastic map: the images of the fine samples of the source, and what makes them.

    Parameters
    ----------
    coefficients : Coefficients
        Of the smooth maps both ways.
    images : Images
        Of the samples, both ways.
    is_ordinary : bool
        Whether it is a map found otherwise, drawn as it is.
    """

    coefficients: Coefficients
    images: Images
    is_ordinary: bool = False


class Elastic(Relation):
    """Limbs may stretch.

    Parameters
    ----------
    ordinary : (q, 2) array of int, optional
        A map found otherwise, as vertices of source and target, which an elastic one must beat.
    others : sequence of ((q, 2) array of int, str)
        Further first maps, and where each came from.
    origin : str
        Where the ordinary map came from.

    Notes
    -----
    Maps are scored by misfit × a small power of the stretch, see `ElasticFit`, weighed by their mismatches, see
    `Relation.weighed`; normals, which a map that turns a body over fits as well, take no part. The ordinary map contends
    as it is, drawn by as many functions.

    Examples
    --------
    Handed to `match` as ``relation=Elastic()``, or with first maps that contend with those searched:

    >>> pairs = np.array([[0, 10], [5, 7], [9, 2]])
    >>> relation = Elastic(others=[(pairs, "by hand")])
    >>> relation.ordinary is None
    True
    """

    def __init__(
        self,
        ordinary: IntArray | None = None,
        others: Sequence[tuple[IntArray, str]] = (),
        origin: str = "ordinary",
    ) -> None:
        self.ordinary, self.others, self.origin = ordinary, others, origin

    def match(self) -> tuple[Selection[StretchedFit], str]:
        """Fit first maps coarsely, the best that differ finely, and select, among them and the ordinary map.

        Returns
        -------
        selection : Selection
        reason : str
            How many maps contended, in a sentence.

        Raises
        ------
        NotConvergedError
            If there is no ordinary map, and none that keeps the orientation was found.
        """
        starts = self._starts()
        rough = [fit for fit in parallel_map(lambda start: self._roughly(*start), starts) if fit]
        rough.sort(key=lambda fit: fit.score)
        kept = distinct(rough, lambda fit: fit.image, self.target.mean_distances, SAME_MAP, N_CONTENDERS)
        fits = cast(list[StretchedFit], self.contest(parallel_map(self._begun, kept)))
        if self.ordinary is not None:
            fits.append(replace(self._unchanged(self.ordinary, self.origin), is_ordinary=True))
        if not fits:
            raise NotConvergedError(
                "no elastic map keeps the orientation of the faces; give three to five landmarks"
            )
        fits.sort(key=lambda fit: fit.score)
        costs = self.weighed(fits, [fit.score for fit in fits], [True] * len(fits))
        apart = distances_between([fit.image for fit in fits], self.target.mean_distances)
        rules = Rules(rival_distance=self.pair.config.selection.rival_distance)
        reason = f"least score of {len(starts)} elastic maps, {len(fits)} fitted to the end"
        return select(fits, apart, rules, scores=costs), reason

    @property
    def mismatch_weight(self) -> float:
        """None with landmarks, which tell limbs apart better than looks do: docs/notes/ball_signature.md."""
        return 0.0 if len(self.hints.landmarks) else super().mismatch_weight

    def _starts(self) -> list[tuple[IntArray, str]]:
        """First maps (q, 2), and where each comes from; those of an ordinary map have made use of hints before."""
        pair, landmarks, starts = self.pair, self.hints.landmarks, starts_of(self)
        first_maps: list[tuple[IntArray, str]] = []
        if any(isinstance(start, FromAnchors) for start in starts):
            source, target = self._shapes
            back = anchor_starts(pair.turned, landmarks[:, ::-1], (target, source))
            pairs = [*anchor_starts(pair, landmarks, (source, target)), *(start[:, ::-1] for start in back)]
            first_maps = [(start, "landmarks" if len(landmarks) else FromAnchors.name) for start in pairs]
        if self.ordinary is not None:
            first_maps.append((self.ordinary, self.origin))
        else:
            first_maps += [
                (np.column_stack([pair.source_vertices, pair.target_vertices[rows]]), origin)
                for rows, origin in starts_from_hints(pair, self.hints)
            ]
        return [*first_maps, *self.others, *first_maps_of(starts, pair)]

    @cached_property
    def _shapes(self) -> tuple[ElasticShape, ElasticShape]:
        config = self.pair.config
        source, target = parallel_map(lambda shape: with_mirror(shape, config), (self.source, self.target))
        return source, target

    def _fit(self, count: int, everywhere: bool) -> ElasticFit:
        first, second = (shape.sampled(count, everywhere) for shape in self._shapes)
        return ElasticFit(first, second, self.pair.signatures, self.hints.landmarks)

    @cached_property
    def _coarse(self) -> ElasticFit:
        return self._fit(N_COARSE, False)

    @cached_property
    def _fine(self) -> ElasticFit:
        return replace(self._fit(self.pair.config.n_refine, True), normal_weight=FINE_NORMAL_WEIGHT)

    @cached_property
    def _fine_steps(self) -> tuple[Step, ...]:
        return tuple(
            Step(k, smoothness, FINE_ITERATIONS, k < FREE_FUNCTIONS)
            for k, smoothness in zip(FINE_FUNCTIONS, FINE_SMOOTHNESS)
        )

    def _roughly(self, start: IntArray, origin: str) -> StretchedFit | None:
        """Fit a first map (q, 2) with few functions; None if it reverses the orientation, or is twisted."""
        coarse, steps = self._coarse, coarse_steps()
        coefficients = coarse.from_pairs(start, steps[0])
        if coarse.orientation(coefficients, coarse.images(coefficients)) < 0:
            return None
        coefficients, images = coarse.run(coefficients, steps)
        if coarse.orientation(coefficients, images) < LEAST_ORIENTATION:
            return None
        penalty = (ASYMMETRY_UNIT + coarse.asymmetry(images)) ** ASYMMETRY_EXPONENT
        image = coarse.target.targets[images.forth]
        score = images.misfit * penalty
        return StretchedFit(
            image, images.misfit, score, origin=origin, coefficients=coefficients, images=images
        )

    def _begun(self, fit: StretchedFit) -> StretchedFit:
        """Extend a rough fit to the vertices of the relation."""
        images = self._fine.images(fit.coefficients)
        image = self._fine.target.targets[images.forth]
        return replace(fit, image=image, misfit=np.inf, score=np.nan, images=images)

    def refined(self, fits: Sequence[Fit]) -> list[Fit]:
        """Fit with all functions."""
        return parallel_map(self._refined, [cast(StretchedFit, fit) for fit in fits])

    def _refined(self, fit: StretchedFit) -> StretchedFit:
        return self._scored(*self._fine.run(fit.coefficients, self._fine_steps, fit.images), fit.origin)

    def measured(self, fit: Fit, image: IntArray) -> StretchedFit:
        """Measure a map as it is, drawn by all functions."""
        self.require_images(image)
        return self._unchanged(np.column_stack([self.vertices, image]), fit.origin)

    def embedding(self, fit: Fit) -> Embedding:
        """Coordinates of all vertices of both bodies: canonical ones, and those of the other shape drawn on each."""
        return self._fine.embedding(cast(StretchedFit, fit).coefficients)

    def _unchanged(self, pairs: IntArray, origin: str = "") -> StretchedFit:
        """Score a map (q, 2) as it is."""
        coefficients = self._fine.from_pairs(pairs, self._fine_steps[-1])
        return self._scored(coefficients, self._fine.images(coefficients), origin)

    def _scored(self, coefficients: Coefficients, images: Images, origin: str) -> StretchedFit:
        judge = replace(self._fine, normal_weight=SCORE_NORMAL_WEIGHT)
        misfit, stretch = judge.images(coefficients).misfit, judge.stretch(coefficients)
        score = misfit * stretch**STRETCH_EXPONENT
        image = self._fine.target.targets[images.forth]
        return StretchedFit(image, misfit, score, origin=origin, coefficients=coefficients, images=images)

    def measure(self, selection: Selection[StretchedFit], reason: str) -> Measured:
        """Take the nearest points under the map selected, and measure it."""
        embedding = self.everywhere(selection.winner)
        points = self.target.index.points(embedding.target, embedding.source)
        mismatch = mismatch_of(self.source.balls, self.target.balls, points.corners[:, 0])
        quality = measure_quality(self.pair, points, self.hints)
        quality = replace(
            quality, rival=selection.rival, mismatch=mean_known(mismatch, self.source.body.vertex_areas)
        )
        return Measured(points, quality, None, mismatch, reason, selection.winner.origin)

    def solution(self, timer: StageTimer) -> Solution:
        """Find the map, and the evidence for it, where no other relation was tried."""
        self.require_sides()
        self.require_hints()
        timer.start("elastic match")
        selection, reason = self.match()
        pair, measured = self.pair, self.measure(selection, reason)
        against = contradicted_landmarks(pair, measured.points, self.hints)
        far = measured_evidence(pair, measured.quality, pair.config.orientation, self.hints.any, far=True)
        regions = regions_of_doubt(pair, measured.mismatch)
        doubt = doubt_in(regions, self.source.body.n_vertices)
        return Solution(
            pair,
            self.source.correspondence(self.target, measured.points),
            measured.quality,
            (far,),
            self.source.lift_smooth(expected_errors(pair, measured.points, doubt)),
            notes=(*pair.notes, *self.hints.notes, FAR, *against),
            origin=measured.origin,
            reason=reason,
            mismatch=None if measured.mismatch is None else self.source.lift(measured.mismatch),
            regions=lifted(regions, self.source, self.target),
        )


def far_from_isometric(relation: Relation, quality: Quality) -> bool:
    """Tell whether the best map that keeps distances fits badly, so that an elastic one should be sought.

    Two meshes are needed, without an initial map or descriptors, maps that are not given, and a refinement that looks
    further, and no mirror image fits better.
    """
    pair, config = relation.pair, relation.pair.config
    if not (pair.oriented and relation.refinement.looks_further and config.orientation == "preserve"):
        return False
    if config.hypotheses != "all" or not relation.hints.only_landmarks:
        return False
    return fits_badly(quality, config.outcome) and not mirror_image_fits(quality, config.outcome)
