"""Evidence about a map, the outcome that follows from it, and the result of a match."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from isomatch._core.arrays import Bool, BoolArray, Float, FloatArray
from isomatch._core.stage_timer import StageTimer
from isomatch.correspondence import Correspondence, PrecisePoints
from isomatch.matching.assessment.confidence import (
    ANOTHER_MAP,
    UNLIKE_ITS_IMAGE,
    DoubtfulRegion,
    lift_regions,
)
from isomatch.matching.assessment.quality import contradicted_landmarks, mean_known
from isomatch.matching.coordinates import SmoothPair
from isomatch.matching.maps import Fit
from isomatch.matching.problem import Problem
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality
from isomatch.settings import MatchSettings, Orientation, OutcomeSettings, PartSettings
from isomatch.shapes import describe_symmetries

# least lead of a map, 1 − cost / cost of the best different map; lower leads are raised to this, so that the
# doubt of a tie is finite; chosen
MIN_LEAD = 1e-9

# the outcome of each flag of evidence, the least sure first
OUTCOME_OF_FLAG = {
    "contradicted": Outcome.PRIORS_CONTRADICTED,
    "mirrored": Outcome.MIRROR_IMAGE,
    "poor": Outcome.LOW_CONFIDENCE,
    "ambiguous": Outcome.SYMMETRY_AMBIGUOUS,
    "partial": Outcome.PARTIAL,
}


@dataclass(frozen=True)
class Evidence:
    """Flags that speak against a map being right and complete."""

    contradicted: bool = False  # the map contradicts priors
    mirrored: bool = False  # a map of one shape to the other's mirror image fits clearly better
    poor: bool = False  # the map fits badly
    ambiguous: bool = False  # another map fits as well
    partial: bool = False  # a part of a shape has no counterpart

    @classmethod
    def of(cls, outcome: Outcome) -> Self:
        """Return the evidence that leads to an outcome."""
        return cls(**{flag: other is outcome for flag, other in OUTCOME_OF_FLAG.items()})


def flags_of(evidence: Iterable[Evidence]) -> tuple[str, ...]:
    """Name the flags that are set in any piece of evidence, the least sure first."""
    pieces = list(evidence)
    return tuple(flag for flag in OUTCOME_OF_FLAG if any(getattr(piece, flag) for piece in pieces))


def outcome_of(evidence: Iterable[Evidence]) -> Outcome:
    """Return the least sure outcome that follows from any piece of evidence."""
    return next((OUTCOME_OF_FLAG[flag] for flag in flags_of(evidence)), Outcome.CONVERGED)


def lower_outcome(outcome: Outcome, *evidence: Evidence) -> Outcome:
    """Lower an outcome by later evidence; it never becomes surer."""
    return outcome_of([Evidence.of(outcome), *evidence])


def measured_evidence(
    pair: Problem, quality: Quality, wanted: Orientation, with_priors: bool = False, far: bool = False
) -> Evidence:
    """Compare the measures of a map with bounds; ``wanted`` is its orientation.

    Priors may lead to the other orientation. If shapes are ``far`` from isometric, a right map does not keep distances,
    so the bending of the shapes is measured instead.
    """
    bounds = pair.config.outcome
    sign = {"preserve": 1.0, "reverse": -1.0, "any": np.sign(quality.orientation)}[wanted]
    kept = sign * quality.orientation
    turned = with_priors and kept < -bounds.poor_orientation
    return Evidence(
        contradicted=contradicts(quality, bounds.contradiction),
        mirrored=wanted != "any" and not with_priors and mirror_image_fits(quality, bounds),
        poor=bool(
            (bends_badly if far else fits_badly)(quality, bounds)
            or quality.torn_off > bounds.poor_torn_off
            or (kept < bounds.poor_orientation and not turned)
            or quality.runner_up < 1.0
        ),
        ambiguous=bool(
            quality.runner_up < (bounds.elastic_tie if far else bounds.tie)
            or quality.mirrored < bounds.mirror_tie
            or turned
            or pair.sideless
        ),
        partial=pair.left_out > bounds.large_component,
    )


def fits_badly(quality: Quality, bounds: OutcomeSettings) -> bool:
    """Whether a map does not keep distances as well as a right map of isometric shapes."""
    return (
        quality.spectral_residual > bounds.poor_spectral_residual
        or quality.residual > bounds.poor_residual
        or quality.stretch > bounds.poor_stretch
    )


def bends_badly(quality: Quality, bounds: OutcomeSettings) -> bool:
    """Whether a map between shapes far from isometric bends too much, or descriptors disagree."""
    bends_well = quality.bending_cost <= bounds.poor_bending and quality.residual <= bounds.poor_far_residual
    return not bends_well or quality.descriptor_distance > bounds.poor_far_descriptor_distance


def region_evidence(regions: Iterable[DoubtfulRegion], least: float) -> Evidence:
    """Take regions of doubt above a share of the surface as evidence against a map."""
    large = [region for region in regions if region.area > least]
    return Evidence(
        poor=any(UNLIKE_ITS_IMAGE in region.reason for region in large),
        ambiguous=any(ANOTHER_MAP in region.reason for region in large),
    )


def mirror_image_fits(quality: Quality, bounds: OutcomeSettings) -> bool:
    """Whether the best map of the other orientation fits clearly better."""
    return bool(quality.mirrored < bounds.mirror_image)


def contradicts(quality: Quality, bound: float) -> bool:
    """Whether a map is farther than a bound, in √area, from landmarks or initial map."""
    return quality.landmark_error > bound or quality.initial_map_error > bound


def part_contradicts(landmark_errors: Float[FloatArray, "m"], initial_map_error: float, bound: float) -> bool:
    """Whether the map of a part is far from most of its landmarks, or from the initial map."""
    # A right map may miss single landmarks: where limbs touch, the vertex nearest to a landmark may be on the
    # wrong limb. So the median of the errors counts.
    misses_most = len(landmark_errors) and np.median(landmark_errors) > bound
    return bool(initial_map_error > bound or misses_most)


@dataclass(frozen=True)
class PartDoubt:
    """How sure the map of a part is: how well it fits, and how clearly it beats other maps."""

    score: float  # the cost of the map
    runner_up: float  # cost of the best different map over the cost of this map; inf if there is none
    known_share: float  # share of the pairs of anchors whose distance on the whole is known
    settings: PartSettings

    @property
    def doubt(self) -> float:
        """The score, if no different map has a score close to it; towards a tie, the doubt grows to infinity."""
        # 1 / doubt = 1 / score − 1 / score′, where score′ is the score of the best different map: the
        # evidence 1 / score for this map, less the evidence for the best different one.
        return self.score / max(1 - 1 / self.runner_up, MIN_LEAD)

    @property
    def is_clear(self) -> bool:
        """Whether enough distances are known, or the lead is large enough without them."""
        return self.known_share >= self.settings.little_trusted or self.runner_up >= self.settings.clear_lead

    @property
    def evidence(self) -> Evidence:
        """Evidence from score and lead: the worse a map fits, the larger its lead must be."""
        settings = self.settings
        tied = self.runner_up < settings.tie and self.score <= settings.poor_doubt
        sure = self.doubt <= settings.poor_doubt and self.is_clear
        return Evidence(ambiguous=tied, poor=not (tied or sure), partial=True)

    def with_lead(self, lead: float) -> Self:
        """Limit the lead if a map of another strategy costs only ``lead`` times as much."""
        return replace(self, runner_up=min(self.runner_up, lead))

    def notes(self, with_priors: bool) -> list[str]:
        """Say why a map is not sure, and what to do."""
        if outcome_of([self.evidence]) is Outcome.PARTIAL:
            return []
        why = "it fits badly"
        if self.score <= self.settings.poor_doubt:
            why = f"the score of another map is only {self.runner_up:.2f} times as high"
            if not self.is_clear:
                share = f"{self.known_share:.1%} of the distances on the whole are known"
                why = f"{why}, and too much is missing: {share}"
        return [
            f"the map is not sure, for {why} (doubt {self.doubt:.1e}, at most {self.settings.poor_doubt:.1e} if sure); "
            f"look at the picture, and give {'more' if with_priors else 'three to five'} landmarks at extremities"
        ]


@dataclass(frozen=True)
class CommonDoubt:
    """How sure the map of a region is that two parts have in common."""

    net_evidence: float  # area that looks alike, less area that lacks an image: `CommonRegions`
    # cost of the map over the cost of the best different map, both negative; inf if there is none
    runner_up: float
    landmarks_hold: bool  # whether landmarks were given and all hold, which is enough to be sure
    settings: PartSettings

    @property
    def doubt(self) -> float:
        """nan: two parts have no number that compares with the doubt of a part."""
        return np.nan

    def with_lead(self, lead: float) -> Self:
        """Limit the lead if a map of another strategy costs only ``lead`` times as much."""
        return replace(self, runner_up=min(self.runner_up, lead))

    @property
    def evidence(self) -> Evidence:
        """The region must be large and look alike on both parts, unless all landmarks hold."""
        is_poor = not self.landmarks_hold and self.net_evidence < self.settings.sure_common
        return Evidence(poor=is_poor, partial=True)

    def notes(self, with_priors: bool) -> list[str]:
        """Say why a map is not sure, and what to do."""
        if not self.evidence.poor:
            return []
        return [
            "the map is not sure, for what is in common is small or looks different (evidence "
            f"{self.net_evidence:.2f}, at least {self.settings.sure_common:.2f} if sure); look at the picture, and give "
            f"{'more' if with_priors else 'three to five'} landmarks"
        ]


def held_evidence(evidence: tuple[Evidence, ...], quality: Quality, bound: float) -> tuple[Evidence, ...]:
    """Evidence about a map bent until landmarks hold; poor if it contradicted them before."""
    if contradicts(quality, bound):
        return evidence
    return tuple(replace(e, contradicted=False, poor=e.poor or e.contradicted) for e in evidence)


@dataclass(frozen=True, eq=False)
class Solution:
    """A map between the users' vertices with its evidence; fields as in `MatchResult`."""

    pair: Problem
    map: Correspondence
    quality: Quality
    evidence: tuple[Evidence, ...]
    expected_error: FloatArray
    alternatives: tuple[Alternative, ...] = ()
    notes: tuple[str, ...] = ()
    origin: str = ""
    reason: str = ""
    config: MatchSettings | None = None  # settings of the method, if it is not `match`
    descriptor_distance: FloatArray | None = None
    regions: tuple[DoubtfulRegion, ...] = ()
    # whether regions that look unlike their images are evidence; right maps between species have some
    descriptors_count: bool = True
    doubt: PartDoubt | CommonDoubt | None = None  # how sure the map of a part is
    way: str = ""  # name of the strategy that found the map, see `isomatch.matching.strategies`

    @property
    def outcome(self) -> Outcome:
        """The outcome that follows from the evidence and the regions of doubt."""
        return outcome_of(self._with_regions)

    @property
    def flags(self) -> tuple[str, ...]:
        """The flags of the evidence and the regions of doubt, see `Evidence`."""
        return flags_of(self._with_regions)

    @property
    def all_evidence(self) -> tuple[Evidence, ...]:
        """All evidence except the regions of doubt."""
        return self.evidence if self.doubt is None else (*self.evidence, self.doubt.evidence)

    @property
    def _with_regions(self) -> tuple[Evidence, ...]:
        doubtful = region_evidence(self.regions, self.pair.config.outcome.doubtful_area)
        return *self.all_evidence, doubtful if self.descriptors_count else replace(doubtful, poor=False)

    def with_doubt(self, doubt: PartDoubt | CommonDoubt) -> Self:
        """Set how sure the map of a part is."""
        quality = replace(self.quality, runner_up=doubt.runner_up, doubt=doubt.doubt)
        return replace(self, doubt=doubt, quality=quality)

    def with_lead(self, lead: float) -> Self:
        """Limit the lead of the map of a part, see ``PartDoubt.with_lead``."""
        return self if self.doubt is None else self.with_doubt(self.doubt.with_lead(lead))

    def with_evidence(self, *more: Evidence) -> Self:
        """Add evidence."""
        return replace(self, evidence=(*self.evidence, *more))


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
    is_last: bool = True  # whether no other strategy is tried next, so that the map is completed now

    def evidence(self, pair: Problem, far: bool) -> Evidence:
        """Compare the measures with the bounds, see `measured_evidence`."""
        quality, wanted = self._with_distance(pair), pair.config.orientation
        return measured_evidence(pair, quality, wanted, pair.priors.any, far)

    def _with_distance(self, pair: Problem) -> Quality:
        mean = mean_known(self.descriptor_distance, pair.source.body.vertex_areas)
        return replace(self.quality, descriptor_distance=mean)

    def solution(
        self,
        pair: Problem,
        errors: Float[FloatArray, "n_s"],  # expected errors in √area of the source
        evidence: tuple[Evidence, ...],
        notes: Sequence[str],
        # the shapes at the resolution at which ``points`` were computed; by default ``pair``
        level: SmoothPair | None = None,
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


def result_of(solution: Solution, timer: StageTimer, seed: int) -> MatchResult:
    """Make the result of a match from its solution."""
    pair = solution.pair
    shared = "map outcome quality expected_error descriptor_distance regions alternatives origin reason way"
    with_landmarks = not np.isnan(solution.quality.landmark_error)
    doubts = solution.doubt.notes(with_landmarks) if solution.doubt else []
    shapes = () if solution.config else (pair.source, pair.target)
    source, target = [describe_symmetries(shape.symmetries) for shape in shapes] or ("", "")
    return MatchResult(
        **{name: getattr(solution, name) for name in shared.split()},
        evidence=solution.flags,
        notes=(*solution.notes, *doubts),
        timings=timer.stop(),
        engine=pair.source.distances.engine,
        config=solution.config or pair.config,
        seed=seed,
        symmetries=(source, target),
        target_size=float(pair.target.scale),
    )
