"""Other maps of a match in words: how much of the surface they send elsewhere, and whether they mirror it."""

from __future__ import annotations

from math import isfinite, isnan

import numpy as np

from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, MatchResult
from isomatch.surfaces import Mesh
from isomatch.view.measures import config_of

STAYED = 0.05  # √area; an image that is moved by less is at the same place


def share_elsewhere(source: Mesh, target: Mesh, one: Correspondence, other: Correspondence) -> float:
    """Share of the source's area whose images differ by more than `STAYED`, or that has an image by one map alone.

    Images differ by their distance in space, not along the surface.
    """
    images = (each.pull_back(target.vertices) for each in (one, other))
    apart = np.linalg.norm(np.subtract(*images), axis=1) > STAYED * np.sqrt(target.area)
    apart |= one.matched != other.matched
    return float(source.vertex_areas[apart].sum() / source.vertex_areas.sum())


def told_of_alternative(source: Mesh, target: Mesh, result: MatchResult, other: Alternative) -> str:
    """Say of an alternative where it differs from the map of a result, and which sides it keeps."""
    share = share_elsewhere(source, target, result.map, other.map)
    before = "The map before this one was chosen. " if isnan(other.energy) else ""
    return f"{before}Sends {share:.0%} of the surface elsewhere. {_sides(result, other)}".rstrip()


def told_of_all(result: MatchResult) -> str:
    """Say of all alternatives how near the best of them comes to the map, and when to choose one."""
    rival, mirrored = result.quality.rival, result.quality.mirrored
    limits = config_of(result).outcome
    near = []
    if rival < limits.tie:
        near.append(f"Another map fits {'better' if rival < 1 else 'as well'}.")
    elif isfinite(rival):
        near.append(f"The best other map fits {rival:.1f} times worse.")
    if mirrored < limits.mirror_tie:
        near.append(f"A mirror image fits {'better' if mirrored < 1 else 'about as well'}.")
    if not near and not isnan(rival):
        near.append("No other map came near this one.")
    when = "Choose one if its picture looks right where the map above looks wrong, or has the sides that you want."
    return " ".join(
        [*near, when, "Those that were only searched are shown before refinement, with rough borders."]
    )


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
