"""Verification: from evidence to an outcome, and from a solution to the result of a match."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from isomatch._core.arrays import Float, FloatArray
from isomatch._core.stage_timer import StageTimer
from isomatch.correspondence import Correspondence
from isomatch.matching.assessment.confidence import ANOTHER_MAP, UNLIKE_ITS_IMAGE, DoubtfulRegion
from isomatch.matching.problem import Problem
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality
from isomatch.settings import MatchSettings, Orientation, OutcomeSettings, PartSettings
from isomatch.shapes import describe_symmetries

NO_LEAD = 1e-9  # so that the doubt of a tie is finite

# what each flag of evidence calls for, the least sure first
CALLED_FOR = {
    "contradicted": Outcome.PRIORS_CONTRADICTED,
    "mirrored": Outcome.MIRROR_IMAGE,
    "poor": Outcome.LOW_CONFIDENCE,
    "ambiguous": Outcome.SYMMETRY_AMBIGUOUS,
    "partial": Outcome.PARTIAL,
}


@dataclass(frozen=True)
class Evidence:
    """Reasons not to take a map for right and complete; each flag is one."""

    contradicted: bool = False  # it is far from what priors ask for
    mirrored: bool = False  # the mirror image of a shape fits clearly better
    poor: bool = False  # it fits badly
    ambiguous: bool = False  # another map fits as well
    partial: bool = False  # something has no counterpart

    @classmethod
    def of(cls, outcome: Outcome) -> Self:
        """Return the evidence that calls for an outcome, as of a map that was verified before."""
        return cls(**{flag: called_for is outcome for flag, called_for in CALLED_FOR.items()})


def flags_of(evidence: Iterable[Evidence]) -> tuple[str, ...]:
    """Name the flags that any piece of evidence raises, the least sure first."""
    pieces = list(evidence)
    return tuple(flag for flag in CALLED_FOR if any(getattr(piece, flag) for piece in pieces))


def outcome_of(evidence: Iterable[Evidence]) -> Outcome:
    """Sum up evidence: the first outcome in the order of `Outcome` that any piece of it calls for."""
    # a match is PARTIAL if something has no counterpart, and nothing worse is found
    return next((CALLED_FOR[flag] for flag in flags_of(evidence)), Outcome.CONVERGED)


def lower_outcome(outcome: Outcome, *evidence: Evidence) -> Outcome:
    """Lower the outcome of a map that was verified before, by evidence found since; it never becomes surer."""
    return outcome_of([Evidence.of(outcome), *evidence])


def measured_evidence(
    pair: Problem, quality: Quality, wanted: Orientation, with_priors: bool = False, far: bool = False
) -> Evidence:
    """Compare the measures of a map with the bounds of ``pair.config.outcome``; ``wanted`` is its orientation.

    Priors may have led to the orientation that was not wanted. Between shapes that are ``far`` from isometric,
    measures of isometries cannot tell a right map from a wrong one; how much the shapes have to be bent can.
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
            quality.runner_up < (bounds.look_tie if far else bounds.tie)
            or quality.mirrored < bounds.mirror_tie
            or turned
            or pair.sideless
        ),
        partial=pair.left_out > bounds.large_component,
    )


def fits_badly(quality: Quality, bounds: OutcomeSettings) -> bool:
    """Whether a map of complete shapes does not keep distances, by the measures that take them for isometric."""
    return (
        quality.spectral_residual > bounds.poor_spectral_residual
        or quality.residual > bounds.poor_residual
        or quality.stretch > bounds.poor_stretch
    )


def bends_badly(quality: Quality, bounds: OutcomeSettings) -> bool:
    """Whether shapes far from isometric have to be bent too much to lie on each other."""
    bends = quality.bending_cost <= bounds.poor_bending and quality.residual <= bounds.poor_far_residual
    return not bends or quality.descriptor_distance > bounds.poor_far_descriptor_distance


def region_evidence(regions: Iterable[DoubtfulRegion], least: float) -> Evidence:
    """Weigh regions of doubt: those above a share of the surface are evidence against a map."""
    large = [region for region in regions if region.area > least]
    return Evidence(
        poor=any(UNLIKE_ITS_IMAGE in region.reason for region in large),
        ambiguous=any(ANOTHER_MAP in region.reason for region in large),
    )


def mirror_image_fits(quality: Quality, bounds: OutcomeSettings) -> bool:
    """Whether the best map of the orientation that was not allowed fits clearly better."""
    return bool(quality.mirrored < bounds.mirror_image)


def contradicts(quality: Quality, bound: float) -> bool:
    """Whether a map is farther than a bound, in √area, from its landmarks or from the initial map."""
    return quality.landmark_error > bound or quality.initial_map_error > bound


def part_contradicts(landmark_errors: Float[FloatArray, "m"], initial_map_error: float, bound: float) -> bool:
    """Whether the map of a part is farther than a bound from most of its landmarks, or from the initial map."""
    # single landmarks may be off in a right map: where limbs touch, a vertex of the whole may be nearest to the other one
    most_are_off = len(landmark_errors) and np.median(landmark_errors) > bound
    return bool(initial_map_error > bound or most_are_off)


@dataclass(frozen=True)
class PartDoubt:
    """How sure the map of a part is: how well it fits, and how clearly it is better than others."""

    score: float  # the cost of the map
    runner_up: float  # cost of the best map that differs, over that; inf if none does
    trusted: float  # share of the pairs of anchors whose distance on the whole is known
    settings: PartSettings

    @property
    def doubt(self) -> float:
        """The score if no map comes near, more and more towards a tie."""
        # 1 / doubt = 1 / score − 1 / score′, score′ = runner-up · score of the best map that differs: what is left of the
        # evidence 1 / score for the map when that for the other is taken off
        return self.score / max(1 - 1 / self.runner_up, NO_LEAD)

    @property
    def is_clear(self) -> bool:
        """Whether no other map comes near: where little is known, a wrong map may fit as well as a right one."""
        return self.trusted >= self.settings.little_trusted or self.runner_up >= self.settings.clear

    @property
    def evidence(self) -> Evidence:
        """A map must fit well; the worse it fits, the more clearly it must be better than others."""
        settings = self.settings
        tied = self.runner_up < settings.tie and self.score <= settings.poor_doubt
        sure = self.doubt <= settings.poor_doubt and self.is_clear
        return Evidence(ambiguous=tied, poor=not (tied or sure), partial=True)

    def with_lead(self, lead: float) -> Self:
        """Take a map of another way into account, of which the cost is so many times as high."""
        return replace(self, runner_up=min(self.runner_up, lead))

    def notes(self, with_priors: bool) -> list[str]:
        """Say why a map is not sure, and what to do."""
        if outcome_of([self.evidence]) is Outcome.PARTIAL:
            return []
        why = "it fits badly"
        if self.score <= self.settings.poor_doubt:
            why = f"the score of another map is only {self.runner_up:.2f} times as high"
            if not self.is_clear:
                share = f"{self.trusted:.1%} of the distances on the whole are known"
                why = f"{why}, and too much is missing: {share}"
        return [
            f"the map is not sure, for {why} (doubt {self.doubt:.1e}, at most {self.settings.poor_doubt:.1e} if sure); "
            f"look at the picture, and give {'more' if with_priors else 'three to five'} landmarks at extremities"
        ]


@dataclass(frozen=True)
class CommonDoubt:
    """How sure the map of what two parts have in common is."""

    net_evidence: (
        float  # how much more alike than at random they look there, see `CommonRegions.net_evidence`
    )
    runner_up: float  # its score over that of the best map that differs; inf if none does
    landmarks_hold: bool  # whether landmarks were given and hold, so that nothing else has to speak for it
    settings: PartSettings

    @property
    def doubt(self) -> float:
        """Nothing that compares with the doubt of a part."""
        return np.nan

    def with_lead(self, lead: float) -> Self:
        """Take a map of another way into account, of which the cost is so many times as high."""
        return replace(self, runner_up=min(self.runner_up, lead))

    @property
    def evidence(self) -> Evidence:
        """What is in common must be large and look alike, unless all landmarks hold."""
        return Evidence(
            poor=not self.landmarks_hold and self.net_evidence < self.settings.sure_common, partial=True
        )

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
    """Evidence for a map that was bent until landmarks hold: where it contradicted them before, it fits badly."""
    if contradicts(quality, bound):
        return evidence
    return tuple(replace(each, contradicted=False, poor=each.poor or each.contradicted) for each in evidence)


@dataclass(frozen=True, eq=False)
class Solution:
    """A map in the users' vertices with the evidence for it, before its outcome is told; fields as in `MatchResult`."""

    pair: Problem
    map: Correspondence
    quality: Quality
    evidence: tuple[Evidence, ...]
    expected_error: FloatArray
    alternatives: tuple[Alternative, ...] = ()
    notes: tuple[str, ...] = ()
    origin: str = ""
    reason: str = ""
    config: MatchSettings | None = None  # the settings of the method, if it is not `match`
    descriptor_distance: FloatArray | None = None
    regions: tuple[DoubtfulRegion, ...] = ()
    # whether regions that look unlike are evidence; two species look unlike somewhere
    descriptors_count: bool = True
    doubt: PartDoubt | CommonDoubt | None = None  # of the map of a part
    way: str = ""  # that found it, see `isomatch.matching.strategies`

    @property
    def outcome(self) -> Outcome:
        """What the evidence calls for, and the regions of doubt."""
        return outcome_of(self._with_regions)

    @property
    def flags(self) -> tuple[str, ...]:
        """The flags that it raises, see `Evidence`."""
        return flags_of(self._with_regions)

    @property
    def all_evidence(self) -> tuple[Evidence, ...]:
        """The evidence, and that of the doubt."""
        return self.evidence if self.doubt is None else (*self.evidence, self.doubt.evidence)

    @property
    def _with_regions(self) -> tuple[Evidence, ...]:
        doubtful = region_evidence(self.regions, self.pair.config.outcome.doubtful_area)
        return *self.all_evidence, doubtful if self.descriptors_count else replace(doubtful, poor=False)

    def with_doubt(self, doubt: PartDoubt | CommonDoubt) -> Self:
        """Tell how sure the map of a part is."""
        quality = replace(self.quality, runner_up=doubt.runner_up, doubt=doubt.doubt)
        return replace(self, doubt=doubt, quality=quality)

    def with_lead(self, lead: float) -> Self:
        """Take a map of another way into account, of which the cost is so many times as high."""
        return self if self.doubt is None else self.with_doubt(self.doubt.with_lead(lead))

    def with_evidence(self, *more: Evidence) -> Self:
        """Add evidence."""
        return replace(self, evidence=(*self.evidence, *more))


def result_of(solution: Solution, timer: StageTimer, seed: int) -> MatchResult:
    """Make the result of a match."""
    pair = solution.pair
    shared = "map outcome quality expected_error descriptor_distance regions alternatives origin reason way"
    led = not np.isnan(solution.quality.landmark_error)
    doubts = solution.doubt.notes(led) if solution.doubt else []
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
