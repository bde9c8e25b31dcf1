"""The outcome of a match in plain words, for a reader who knows none of the measures."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isfinite, isnan

import numpy as np

from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, MatchResult, Outcome
from isomatch.surfaces import Mesh
from isomatch.visualization.camera import of_ordinary_size
from isomatch.visualization.measures import config_of, is_of_whole, quality_measures

# The confidence of an image is low if it is below this: if its expected error exceeds 0.05 √(target area).
LOW_CONFIDENCE_LIMIT = 0.5
MIN_SHARE_TOLD = 0.005  # a summary mentions vertices of low confidence if their share exceeds this; chosen
# a map is partly uncertain if the share of vertices of low confidence exceeds this; chosen
UNCERTAIN_SHARE = 0.1

# headline and advice for each outcome; `Outcome.advice` says more
_HEADLINES_AND_ADVICE = {
    Outcome.PRIORS_CONTRADICTED: (
        "The map and your priors do not agree: either may be wrong.",
        "Check the landmarks or the first map: vertices count from 0, source first. If they are right, match again with "
        "--hypotheses given; if not, without them.",
    ),
    Outcome.MIRROR_IMAGE: (
        "This map is wrong: one shape fits the mirror image of the other.",
        "Perhaps one is a left and the other a right one, or a file is mirrored. Match again with --orientation any, or "
        "reflect one of the shapes.",
    ),
    Outcome.LOW_CONFIDENCE: (
        "This map is doubtful: the shapes fit badly under it.",
        "Look at the picture. If it is wrong, click three to five landmark pairs in the report, or match with --start "
        "pose if both lie alike in space. Are both complete and of one kind?",
    ),
    Outcome.SYMMETRY_AMBIGUOUS: (
        "Two maps fit equally well; this is one of them.",
        "If left or right, front or back matter: choose another in the report, click three to five landmark pairs there, "
        "or match with --start pose if both lie alike in space.",
    ),
    Outcome.PARTIAL: (
        "The shapes match in what they have in common; the rest is left out.",
        "Look at the picture: grey has no partner, and is −1 in the map. Landmarks on two loose pieces make them "
        "partners.",
    ),
    Outcome.CONVERGED: (
        "The shapes match; no problems were found.",
        "Look at the picture once: no check is a proof.",
    ),
}
HEADLINES = {outcome: headline for outcome, (headline, _) in _HEADLINES_AND_ADVICE.items()}
"""The headline of each outcome."""

# Headlines of special cases: the first replaces the headline of CONVERGED, the second and the third replace the headline
# of LOW_CONFIDENCE.
PARTLY_SURE = "The shapes match, but parts of this map are uncertain."
MOSTLY_RIGHT = "Most of this map looks right, but not all of it."
ANOTHER_IS_BETTER = "This map is doubtful: another one fits as well or better."


@dataclass(frozen=True)
class Summary:
    """The outcome of a match in plain words.

    Parameters
    ----------
    headline : str
        The outcome in one sentence.
    sureness : str
        How sure it is, and where it is not, as shares of the surface; empty if nothing is known beyond the headline.
    advice : str
        What to do next; settings are written as options of the command line.
    """

    headline: str
    sureness: str
    advice: str

    @property
    def advice_in_python(self) -> str:
        """The advice without a report, and with settings as in Python: ``start = 'pose'``."""
        return re.sub(r"--([a-z]+) ([a-z]+)", r"\1 = '\2'", re.sub(r" in the report| there", "", self.advice))

    def __str__(self) -> str:
        return "\n".join(filter(None, (self.headline, self.sureness, self.advice_in_python)))


def summary_of(result: MatchResult) -> Summary:
    """Sum up a result for a reader who knows none of its measures.

    Examples
    --------
    >>> from isomatch import match
    >>> from isomatch.datasets import example_pair
    >>> source, target = (animal.mesh for animal in example_pair())
    >>> print(summary_of(match(source, target)).headline)
    The shapes match; no problems were found.
    """
    headline, far_off = HEADLINES[result.outcome], _share_far_off(result)
    parts = [_partners(result), _doubt(result, far_off)]
    if result.outcome is Outcome.CONVERGED and (result.regions or far_off > UNCERTAIN_SHARE):
        headline = PARTLY_SURE
    if result.outcome is Outcome.LOW_CONFIDENCE:
        if result.quality.runner_up < 1.0:
            headline = ANOTHER_IS_BETTER
        elif result.regions and not any(against for _, _, against in quality_measures(result)):
            headline = MOSTLY_RIGHT
        elif not result.regions:
            parts.append("No single place stands out: it may be wrong altogether.")
    if result.outcome.is_called_right:
        parts.append(_expected_error(result, far_off))  # calibrated for maps that are right as a whole
    return Summary(headline, " ".join(filter(None, parts)), _HEADLINES_AND_ADVICE[result.outcome][1])


def _partners(result: MatchResult) -> str:
    """Say how much of both shapes has a partner, unless all has."""
    if result.outcome is Outcome.PARTIAL or not result.map.matched.all():
        matched, covered = (_per_cent(share) for share in result.overlap)
        return f"{matched} of the source's points and {covered} of the target's surface have a partner."
    return ""


def _share_far_off(result: MatchResult) -> float:
    """Share of the points with images that may be far from the right ones."""
    known = result.confidence[np.isfinite(result.confidence)]
    return float((known < LOW_CONFIDENCE_LIMIT).mean()) if len(known) else 0.0


def _doubt(result: MatchResult, far_off: float) -> str:
    """Say how much of the surface is in doubt, and where most of all."""
    if not result.regions:
        sought = is_of_whole(result) and result.descriptor_distance is not None
        is_sure = sought and not result.outcome.is_doubtful and far_off <= MIN_SHARE_TOLD
        return "No region is in doubt." if is_sure else ""
    largest, *others = result.regions
    share = _per_cent(sum(region.area for region in result.regions))
    most = f"most of it around vertex {largest.vertices[0]}, where" if others else "where"
    return f"{share} of the surface is in doubt, {most} {largest.reason}."


def _expected_error(result: MatchResult, far_off: float) -> str:
    """Say how far images may be from the right ones."""
    errors = result.expected_error[np.isfinite(result.expected_error)]
    if not len(errors):
        return ""
    mean, size = float(errors.mean()), result.target_size
    length = f", or {mean * size:.2g} in the target's units" if isfinite(size) else ""
    more = f"; more than 5% at {_per_cent(far_off)} of the points" if far_off > MIN_SHARE_TOLD else ""
    return f"Expected error: {_per_cent(mean)} of the size (√area){length}{more}."


def _per_cent(share: float) -> str:
    """Write a share in per cent, with one decimal if it is below 10 %."""
    return f"{share:.1%}" if 0 < share < 0.1 else f"{share:.0%}"


# √(target area): two images of a vertex are at the same place if the straight line between them is not longer; chosen
SAME_PLACE_DISTANCE = 0.05


def share_elsewhere(source: Mesh, target: Mesh, one: Correspondence, other: Correspondence) -> float:
    """Share of the source's area with images `SAME_PLACE_DISTANCE` apart, or with one only."""
    source, target = of_ordinary_size(source), of_ordinary_size(target)
    images = (correspondence.pull_back(target.vertices) for correspondence in (one, other))
    is_elsewhere = np.linalg.norm(np.subtract(*images), axis=1) > SAME_PLACE_DISTANCE * np.sqrt(target.area)
    is_elsewhere |= one.matched != other.matched
    return float(source.vertex_areas[is_elsewhere].sum() / source.vertex_areas.sum())


def describe_alternative(source: Mesh, target: Mesh, result: MatchResult, other: Alternative) -> str:
    """Say how much an alternative differs from the map, and whether it keeps left and right."""
    before = "The map before this one was chosen. " if isnan(other.energy) else ""
    difference = describe_difference(source, target, result.map, other.map)
    return f"{before}{difference} {_sides(result, other)}".rstrip()


def describe_difference(source: Mesh, target: Mesh, one: Correspondence, other: Correspondence) -> str:
    """Say how much two maps differ."""
    return f"Differs on {share_elsewhere(source, target, one, other):.0%} of the surface."


def describe_alternatives(result: MatchResult) -> str:
    """Say how well the best alternative fits, and when to choose an alternative."""
    runner_up, mirrored = result.quality.runner_up, result.quality.mirrored
    limits = config_of(result).outcome
    near = []
    if runner_up < limits.tie:
        near.append(f"Another map fits {'better' if runner_up < 1 else 'as well'}.")
    elif isfinite(runner_up):
        near.append(f"The best other map fits {runner_up:.1f} times worse.")
    if mirrored < limits.mirror_tie:
        near.append(f"A mirror image fits {'better' if mirrored < 1 else 'about as well'}.")
    if not near and not isnan(runner_up):
        near.append("No other map came near this one.")
    when = (
        "If the map above looks wrong, or exchanges the sides that you want, choose the alternative whose picture looks "
        "right."
    )
    rough = "Alternatives are drawn before refinement, with rough borders, unless they were refined in the search."
    return " ".join([*near, when, rough])


def _sides(result: MatchResult, other: Alternative) -> str:
    """Compare orientations, which are 1 for a map that keeps left and right, and −1 for one that mirrors."""
    least = config_of(result).outcome.poor_orientation
    if isnan(other.orientation) or isnan(result.quality.orientation):
        return ""
    if abs(other.orientation) < least:
        return "Exchanges left and right in places, which is rarely right."
    if other.orientation * result.quality.orientation > 0:
        return "Keeps left and right as the map does."
    return "Mirror image of the map: left and right are exchanged."


# colours of outcomes, which the colour-blind can tell apart (Okabe & Ito)
_COLOURS = {Outcome.CONVERGED: "#0072b2", Outcome.LOW_CONFIDENCE: "#d55e00", Outcome.MIRROR_IMAGE: "#d55e00"}
_OTHER_COLOUR = "#e69f00"  # colour of the other outcomes


def outcome_colour(outcome: Outcome) -> str:
    """Return the colour of an outcome, as CSS writes it."""
    return _COLOURS.get(outcome, _OTHER_COLOUR)
