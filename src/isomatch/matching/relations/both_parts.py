"""BothParts: two shapes that show overlapping parts of one body, of which neither shows the whole."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import cast

import numpy as np

from isomatch.correspondence import Embedding, PrecisePoints
from isomatch.errors import MeshError, NotConvergedError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.fit import Fit
from isomatch.matching.quality import contradicted_landmarks, distances_to_hints, mean_known, mismatch_of
from isomatch.matching.relations.both_regions import (
    AROUND,
    N_BENT_IN_FULL,
    RefinedRegion,
    overlaps,
    refined_region,
)
from isomatch.matching.relations.both_seeds import CommonRegion, CommonRegions
from isomatch.matching.relations.both_side import two_sides
from isomatch.matching.relations.part import Part, expected_errors_of_part, quality_of_part
from isomatch.matching.relations.part_fits import PartFit
from isomatch.matching.search import FromAnchors, starts_of
from isomatch.matching.stages import Relation, first_maps_of
from isomatch.matching.starts import nearest_in_pose
from isomatch.matching.verification import CommonDoubt, Evidence, Solution, part_contradicts
from isomatch.runtime.stage_timer import StageTimer
from isomatch.runtime.threads import parallel_map
from isomatch.values.arrays import IntArray
from isomatch.values.cached import cached_property

# best refined regions that are grown again, cost of a sample up to which it joins, and whether it is refined roughly
ROUNDS = (4, 0.05, True), (2, 0.045, False)
APART = 0.12  # mean distance of images, in √area of the target, from which two maps differ


class BothParts(Relation):
    """Two shapes show overlapping parts of one body: some vertices of the source have an image, the others none.

    Notes
    -----
    A distance on the body lies in an interval on both sides, and a point may have no partner. Regions in common are
    grown from seeds; each is refined as a part of the target, as by `Part`. Of two maps, that of the larger region is
    better, unless the parts look different there.
    """

    def match(self) -> list[RefinedRegion]:
        """Search and refine regions in common: those refined to the end, the best first, then those on the way.

        Raises
        ------
        NotConvergedError
            If none was found.
        """
        regions = self._refined(self._first_regions(), roughly=True)
        if not regions:
            raise NotConvergedError(
                "no region was found that both shapes show; give three to five landmarks on both"
            )
        others: list[RefinedRegion] = []
        for count, cost, roughly in ROUNDS:
            grown = [region.grown_again(cost) for region in regions[:count]]
            again = self._refined([region for region in grown if region.accepted.any()], roughly)
            regions, others = again or regions, [*regions, *others]
        return [*regions, *_ranked(others)]

    def _refined(self, regions: list[CommonRegion], roughly: bool) -> list[RefinedRegion]:
        def refined(region: CommonRegion) -> RefinedRegion | None:
            with suppress(MeshError):  # too small to be prepared
                return refined_region(self._regions, region, self.pair, self.hints, self.stages, roughly)
            return None

        return _ranked([found for found in parallel_map(refined, regions) if found])

    @cached_property
    def _regions(self) -> CommonRegions:
        return CommonRegions(
            *two_sides(self.source, self.target, self.pair.config.scale == "area", self.hints.landmarks)
        )

    def _first_regions(self) -> list[CommonRegion]:
        """Regions grown from seeds, those of given maps, and those of starts handed in."""
        starts, pairs = starts_of(self), self.hints.initial_pairs
        found = (
            self._regions.best(self.pair.config.parts.n_common)
            if any(isinstance(x, FromAnchors) for x in starts)
            else []
        )
        given = [(pairs, "initial map")] if len(pairs) else []
        if self.pair.config.start == "pose":
            everything = np.arange(self.source.body.n_vertices)
            images = nearest_in_pose(self.pair.source, self.pair.target, everything)
            given.append((np.column_stack([everything, images]), "pose"))
        given += first_maps_of(starts, self.pair)
        return [*found, *(region for each in given if (region := self._given(*each)).accepted.any())]

    def _given(self, pairs: IntArray, origin: str) -> CommonRegion:
        """Take the region around the first of some pairs (q, 2) of vertices."""
        source, image = self.source.body, np.zeros(self.source.body.n_vertices, dtype=np.int64)
        gap, nearest = distance_along_edges_to_nearest(source, np.unique(pairs[:, 0]))
        image[pairs[::-1, 0]] = pairs[::-1, 1]
        return self._regions.given(image[nearest], self._regions.source.unit * gap <= AROUND, origin)

    def solution(self, timer: StageTimer) -> Solution:
        """Find the map, and the evidence for it."""
        self.require_sides()
        self.require_hints()
        self.require_no_descriptors("two parts")
        timer.start("overlapping parts")
        regions = self.match()
        best = regions[0]
        rivals = (each for each in regions[1:] if each.held >= best.held and self._differs(best, each))
        rival = next(rivals, None)
        return self._summed_up(best, rival, timer)

    def _differs(self, best: RefinedRegion, other: RefinedRegion) -> bool:
        """Whether two maps differ where both have images; those that have none in common do."""
        both = best.matched & other.matched
        return not both.any() or self.target.mean_distance(best.image[both], other.image[both]) > APART

    def _summed_up(self, best: RefinedRegion, rival: RefinedRegion | None, timer: StageTimer) -> Solution:
        """Bend the region in full, and sum up the map."""
        pair, hints, fit = self.pair, self.hints, best.fit
        bent = fit.bending.in_full(fit.bent, pair.config.parts.bending[-N_BENT_IN_FULL:])
        n = pair.source.body.n_vertices
        points, matched = PrecisePoints.at_vertices(np.zeros(n, dtype=np.int64)), np.zeros(n, dtype=bool)
        points.corners[best.vertices], points.barycentric[best.vertices] = bent.points
        matched[best.vertices] = overlaps(bent)
        errors = np.full(n, np.nan)
        errors[best.vertices] = expected_errors_of_part(fit.pair, bent.points)
        timer.start("quality")
        mismatch = mismatch_of(pair.source.balls, pair.target.balls, points.corners[:, 0], matched)
        side, other = self._regions.source, self._regions.target
        quality = quality_of_part(pair, hints, fit, side.unit / other.unit, points, matched)
        led = 0 < len(side.landmarks) == best.held
        doubt = CommonDoubt(best.worth, led, pair.config.parts)
        quality = replace(
            quality,
            rival=best.score / rival.score if rival and rival.score else np.inf,
            bend_misfit=bent.misfit,
            mismatch=mean_known(mismatch, pair.source.body.vertex_areas),
        )
        found = pair.source.correspondence(pair.target, points, matched)
        landmark_errors = distances_to_hints(pair, points.corners[:, 0], hints.landmarks)
        contradicted = part_contradicts(
            landmark_errors, quality.initial_map_error, pair.config.outcome.contradiction
        )
        areas = pair.source.body.vertex_areas
        share = areas[matched].sum() / areas.sum()
        notes = (
            *pair.notes,
            *hints.notes,
            f"both shapes were matched as parts of one body: {share:.0%} of the source and {quality.coverage:.0%} of the "
            "target are in common",
            *doubt.notes(len(hints.landmarks) > 0),
            *contradicted_landmarks(pair, points, hints),
        )
        return Solution(
            pair,
            found,
            quality,
            (doubt.evidence, Evidence(contradicted=contradicted)),
            np.where(found.matched, pair.source.lift_smooth(errors), np.nan),
            notes=notes,
            mismatch=None if mismatch is None else pair.source.lift(mismatch),
            origin=self.origin_of(fit),
            reason="largest region in common that looks alike",
        )

    def _part(self, fit: Fit) -> Part:
        """Return the relation of a region and the target, by a map of the region."""
        own = cast(PartFit, fit).pair
        return Part().on(replace(self.pair, source=own.part, functions=None), self.hints, self.stages)

    def refined(self, fits: Sequence[Fit]) -> list[Fit]:
        """Refine maps of regions, each as that of a part."""
        return [refined for fit in fits for refined in self._part(fit).refined([fit])]

    def measured(self, fit: Fit, image: IntArray) -> Fit:
        """Measure the map of a region."""
        return self._part(fit).measured(fit, image)

    def embedding(self, fit: Fit) -> Embedding:
        """Coordinates of the vertices of a region, and of those of the target."""
        return self._part(fit).embedding(fit)


def _ranked(regions: list[RefinedRegion]) -> list[RefinedRegion]:
    """Put those first that hold most landmarks, and of these those of the highest score."""
    return sorted(regions, key=lambda region: (-region.held, -region.score))
