"""The measures of quality: their meaning, and the bounds beyond which they are evidence against a map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from math import isfinite, isnan
from operator import attrgetter
from typing import Any

from isomatch.matching import STRATEGIES, MatchResult
from isomatch.settings import Config


@dataclass(frozen=True)
class Measure:
    """Name, unit, meaning and bound of one field of `isomatch.Quality`.

    Parameters
    ----------
    name : str
        Name to show.
    written : str
        Format of its value.
    unit : str
        Unit, or values to compare with, in a few words.
    meaning : str
        Explanation for a reader who has not seen it before.
    most, least : float, optional
        Bound. A value beyond it is, on its own, evidence against the map.
    """

    name: str
    written: str
    unit: str
    meaning: str
    most: float | None = None
    least: float | None = None

    def value(self, number: float) -> str:
        """Format a value."""
        return self.written.format(number) if isfinite(number) else "none"

    @property
    def bound(self) -> str:
        """The bound as text; empty if there is none."""
        if self.most is not None:
            return f"at most {self.written.format(self.most)}"
        return "" if self.least is None else f"at least {self.written.format(self.least)}"

    def holds(self, number: float) -> bool:
        """Whether the value is within its bound."""
        return (self.most is None or number <= self.most) and (self.least is None or number >= self.least)


# field of `Quality`: (name to show, format of its value, unit or values to compare with)
_NAMES_AND_UNITS = {
    "spectral_residual": ("spectral residual", "{:.2f}", "0: same; 0.4: two people"),
    "runner_up": ("best alternative", "{:.2f} ×", "1 is a tie; large is clear"),
    "mirrored": ("mirror image", "{:.2f} ×", "1 is a tie; above 1.5 clear"),
    "distortion_mean": ("distortion, mean", "{:.2%}", "of √area, between two points"),
    "distortion_p95": ("distortion, 95th percentile", "{:.2%}", "of √area"),
    "coverage": ("coverage", "{:.1%}", "of the target near an image"),
    "matched": ("matched", "{:.1%}", "of source vertices have images"),
    "orientation": ("orientation", "{:.2f}", "1 keeps sides, −1 mirrors"),
    "residual": ("descriptor residual", "{:.2f}", "of √(average distance)"),
    "stretch": ("stretch of edges", "{:.2f}", "mean square; 1: an isometry"),
    "descriptor_distance": ("descriptor distance", "{:.2f}", "standard deviations, up to 2"),
    "torn_off": ("torn off", "{:.1%}", "of the source, in one piece"),
    "stress": ("stress of a part", "{:.3f}", "violated distances, relative"),
    "bending_cost": ("spectral residual of the bent shape", "{:.1e}", "stretch × distance"),
    "doubt": ("doubt of a part", "{:.1e}", "score over its lead"),
    "landmark_error": ("landmark error", "{:.2%}", "of √(target area)"),
    "initial_map_error": ("distance to the initial map", "{:.2%}", "of √(target area), median"),
}
_MEANINGS = {  # what each field of `Quality` means, for a reader who meets it for the first time
    "spectral_residual": "Mean distance between corresponding points when eigenfunctions, signatures, positions and "
    "normals are compared together. 0 for the same shape; about 0.4 for a correct map between two different people.",
    "runner_up": "How much worse the best map that differs fits, as a ratio of scores. 1 is a tie, as between the two "
    "sides of a symmetric shape; below 1 the other map fits better; none if no other map came close.",
    "mirrored": "How much worse the best map that exchanges left and right fits, as a ratio of scores. Below 1 it fits "
    "better; a difference in pose alone can make up to 1.5; none if no such map came close, or was allowed.",
    "distortion_mean": "Mean change of the geodesic distance between two points under the map, relative to √area. "
    "About half a per cent of it is measurement error.",
    "distortion_p95": "The same for the worst pairs: for one pair of points in twenty the change is larger.",
    "coverage": "Fraction of the target area that is close to the image of a source vertex. The rest has no "
    "counterpart on the source, or the map collapses there.",
    "matched": "Fraction of the source vertices that have an image. The others are on parts that were left out; see "
    "the notes.",
    "orientation": "Whether the map preserves orientation. Near 1 it keeps the outer side of the surface outside; near "
    "−1 it is a mirror image, which is correct only if that was wanted; values in between mean a twisted map.",
    "residual": "How much the distances from each point to all others differ between the two shapes. If it is large, "
    "their proportions differ or the map is wrong.",
    "stretch": "Sum of the squared lengths of the edges' images over that of the edges: 1 if lengths are preserved, "
    "more if the map stretches or tears the surface. A torn edge counts at most four times.",
    "descriptor_distance": "How differently the two surfaces look in space around a point and its image, on average. "
    "Little is expected for two poses of one body, more for two bodies; about 0.8 for points drawn at random.",
    "torn_off": "Fraction of the source area in the largest piece that the map tears from the rest, such as a limb "
    "that it exchanges with another. 0 for a correct map.",
    "stress": "How much distances between images leave the intervals in which distances on the whole must lie, given "
    "those along the part. 0.01 for a correct map.",
    "bending_cost": "How much the edges of a part, or of a shape of another species, are stretched when it is bent "
    "onto the other shape, times how far it still is from that. Large for many wrong maps.",
    "doubt": "The score of the map, low if all measures are good, over how clearly it is better than that of the best "
    "different map. The map of a part is sure if its doubt is small.",
    "landmark_error": "Mean geodesic distance on the target between the images of the landmarks and their given "
    "positions, relative to √area.",
    "initial_map_error": "Median geodesic distance on the target between the images and those of the initial map, "
    "relative to √area.",
}
MEASURES = {field: Measure(*texts, _MEANINGS[field]) for field, texts in _NAMES_AND_UNITS.items()}
"""The measure of each field of `Quality`, without its bound."""
# for maps of whole shapes, field of `Quality`: (whether its bound is the most or the least value, setting of the bound)
_BOUNDS = {
    "spectral_residual": ("most", "outcome.poor_spectral_residual"),
    "runner_up": ("least", "outcome.tie"),
    "mirrored": ("least", "outcome.mirror_tie"),
    "orientation": ("least", "outcome.poor_orientation"),
    "residual": ("most", "outcome.poor_residual"),
    "stretch": ("most", "outcome.poor_stretch"),
    "torn_off": ("most", "outcome.poor_torn_off"),
    "doubt": ("most", "parts.poor_doubt"),
    "landmark_error": ("most", "outcome.contradiction"),
    "initial_map_error": ("most", "outcome.contradiction"),
}
_BOUNDS_OF_PART = {  # as `_BOUNDS`, for maps of parts of shapes
    "runner_up": ("least", "parts.tie"),
    "doubt": ("most", "parts.poor_doubt"),
    "initial_map_error": ("most", "outcome.contradiction"),
}


def quality_measures(result: MatchResult) -> Iterator[tuple[Measure, float, bool]]:
    """Yield the measures of a result with value, and whether it is evidence against the map."""
    measures = _measures_of(result)
    for field, number in asdict(result.quality).items():
        measure = measures.get(field, Measure(field, "{:.3g}", "", ""))
        against = not measure.holds(number)
        if field == "orientation":  # The user might want a mirror image; the outcome takes this into account.
            kept = -number if result.config.orientation == "reverse" else number
            against = result.outcome.is_doubtful and not measure.holds(kept)
        if not isnan(number):
            yield measure, number, against


def quality_bounds(result: MatchResult) -> dict[str, dict[str, float]]:
    """Return the bounds of a result by field: {"spectral_residual": {"most": 0.6}, …}."""
    return {
        field: {side: bound for side in ("most", "least") if (bound := getattr(measure, side)) is not None}
        for field, measure in _measures_of(result).items()
        if measure.bound
    }


def _measures_of(result: MatchResult) -> dict[str, Measure]:
    """Return the measures with the bounds in the settings of the result."""
    measures = dict(MEASURES)
    for field, (side, setting) in (_BOUNDS if is_of_whole(result) else _BOUNDS_OF_PART).items():
        bound: dict[str, Any] = {side: attrgetter(setting)(config_of(result))}
        measures[field] = replace(measures[field], **bound)
    return measures


def is_of_whole(result: MatchResult) -> bool:
    """Whether the map is between complete shapes; maps of other methods count as such."""
    return result.way not in STRATEGIES or STRATEGIES[result.way].overlap == "whole"


def config_of(result: MatchResult) -> Config:
    """Return the settings with the bounds of a result; defaults if it is of another method."""
    return result.config if isinstance(result.config, Config) else Config()
