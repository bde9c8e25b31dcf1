"""A measured map of the source's body, from which a solution is summed up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from isomatch._core.arrays import Bool, BoolArray, Float, FloatArray
from isomatch.correspondence import PrecisePoints
from isomatch.matching.assessment.confidence import DoubtfulRegion, lift_regions
from isomatch.matching.assessment.evidence import Evidence, Solution, measured_evidence
from isomatch.matching.assessment.quality import contradicted_landmarks, mean_known
from isomatch.matching.maps import Fit
from isomatch.matching.problem import Problem
from isomatch.matching.result import Quality
from isomatch.matching.smooth_pair import SmoothPair


@dataclass(frozen=True, eq=False)
class Measured:
    """A measured map of the source's body."""

    points: PrecisePoints  # images of the vertices
    quality: Quality
    descriptor_distance: Float[FloatArray, "n_s"] | None  # see `descriptor_distance_of`
    reason: str = ""  # why the map was selected, in a sentence
    origin: str = ""
    matched: Bool[BoolArray, "n_s"] | None = None  # vertices that have an image, if not all have one
    fit: Fit | None = None  # the refined map from which polishing starts; None for elastic maps
    note: str = ""  # a note if the shapes are far from isometric
    is_last: bool = True  # whether no other strategy follows, so that the map is completed at once

    def evidence(self, pair: Problem, far: bool) -> Evidence:
        """Compare the measures with the bounds, see `measured_evidence`."""
        return measured_evidence(
            pair, self._with_distance(pair), pair.config.orientation, pair.priors.any, far
        )

    def _with_distance(self, pair: Problem) -> Quality:
        mean = mean_known(self.descriptor_distance, pair.source.body.vertex_areas)
        return replace(self.quality, descriptor_distance=mean)

    def solution(
        self,
        pair: Problem,
        errors: Float[FloatArray, "n_s"],  # expected errors
        evidence: tuple[Evidence, ...],
        notes: Sequence[str],
        level: SmoothPair | None = None,  # the level to which the points belong; by default the pair
        points: PrecisePoints | None = None,
        regions: Sequence[DoubtfulRegion] = (),
    ) -> Solution:
        """Sum up the map in the users' vertices; a vertex without image has no expected error."""
        source, between, distances = pair.source, level or pair, self.descriptor_distance
        result = between.source.correspondence(between.target, points or self.points, self.matched)
        known = None if distances is None else np.where(result.matched, source.lift(distances), np.nan)
        return Solution(
            pair,
            result,
            replace(self._with_distance(pair), matched=float(result.matched.mean())),
            evidence,
            np.where(result.matched, source.lift_smooth(errors), np.nan),
            notes=(*pair.notes, *pair.priors.notes, *notes, *contradicted_landmarks(pair, self.points)),
            origin=self.origin,
            reason=self.reason,
            descriptor_distance=known,
            regions=lift_regions(regions, source, pair.target),
        )
