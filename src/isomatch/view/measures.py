"""What each measure of quality means, and from where on it speaks against a map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite, isnan

from isomatch.matching import MatchResult, Outcome, OutcomeSettings

BOUNDS = OutcomeSettings()


@dataclass(frozen=True)
class Measure:
    """Words for one field of `isomatch.Quality`.

    Parameters
    ----------
    name : str
        What it is called.
    written : str
        How its value is written.
    unit : str
        Unit, or what to hold it against, in a few words.
    meaning : str
        What it says, for a reader who has not seen it before.
    most, least : float, optional
        Bound beyond which it speaks against the map on its own.
    """

    name: str
    written: str
    unit: str
    meaning: str
    most: float | None = None
    least: float | None = None

    def value(self, number: float) -> str:
        """Write the value."""
        return self.written.format(number) if isfinite(number) else "none"

    @property
    def bound(self) -> str:
        """Write the bound; empty if there is none."""
        if self.most is not None:
            return f"at most {self.written.format(self.most)}"
        return "" if self.least is None else f"at least {self.written.format(self.least)}"

    def holds(self, number: float) -> bool:
        """Whether the value is within its bound."""
        return (self.most is None or number <= self.most) and (self.least is None or number >= self.least)


MEASURES = {
    "misfit": Measure(
        "misfit",
        "{:.2f}",
        "0: one shape; 0.4: right, of two people",
        "How far corresponding points are apart when shape, curvature and position are compared at once. "
        "0 is the same shape; about 0.4 is a right map between two different people.",
        most=BOUNDS.poor_misfit,
    ),
    "rival": Measure(
        "next best map",
        "{:.2f} ×",
        "1 is a tie, large is clear",
        "How much more speaks against the best different map than against this one. 1 is a tie, as for left and right of "
        "a symmetric shape; below 1 the other fits better; none: no other came near.",
        least=BOUNDS.tie,
    ),
    "mirrored": Measure(
        "mirror image",
        "{:.2f} ×",
        "1 is a tie, above 1.5 is clear",
        "How much more speaks against the best map that turns the surface the other way, where either way was allowed. "
        "Poses alone make a difference of up to 1.5; none: no such map came near, or only one way was allowed.",
        least=BOUNDS.mirror_tie,
    ),
    "distortion_mean": Measure(
        "distortion, mean",
        "{:.2%}",
        "of √area, between pairs of points",
        "How much the map changes distances along the surface between two points, on average, in parts of √area. "
        "About half a per cent of it is the error of the measurement.",
    ),
    "distortion_p95": Measure(
        "distortion, 95th percentile",
        "{:.2%}",
        "of √area",
        "The same where it is bad: one pair of points in twenty is changed more than this.",
    ),
    "coverage": Measure(
        "coverage",
        "{:.1%}",
        "of the target's area is near an image",
        "Share of the target's area near an image of some source vertex. What is missing has no counterpart on the "
        "source, or the map has collapsed there.",
    ),
    "matched": Measure(
        "matched",
        "{:.1%}",
        "of the source's vertices have an image",
        "Share of the source's vertices that have an image. The others lie on parts left out; the notes tell which.",
    ),
    "orientation": Measure(
        "orientation",
        "{:.2f}",
        "1 keeps the outside, −1 inverts it",
        "Whether the map keeps the outside of the surface outside: near 1 it does, near −1 (right where that is "
        "wanted) it is a mirror image, between them it is twisted.",
        least=BOUNDS.poor_orientation,
    ),
    "residual": Measure(
        "descriptor residual",
        "{:.2f}",
        "of √(average distance)",
        "How badly the distances from each point to all others agree on the two shapes. Large: their proportions "
        "differ, or the map is wrong.",
        most=BOUNDS.poor_residual,
    ),
    "stretch": Measure(
        "stretch of edges",
        "{:.2f}",
        "mean square, 1 for an isometry",
        "What the map does to the source's edges: 1 keeps their lengths, more means stretches and tears.",
        most=BOUNDS.poor_stretch,
    ),
    "landmark_error": Measure(
        "landmark error",
        "{:.2%}",
        "of √(target area)",
        "Mean distance on the target between where the landmarks were wanted and where they went, in parts of √area.",
    ),
}


def taken(result: MatchResult) -> Iterator[tuple[Measure, float, bool]]:
    """Give every measure that was taken, its value, and whether the value speaks against the map."""
    for field, number in asdict(result.quality).items():
        measure = MEASURES.get(field, Measure(field, "{:.3g}", "", ""))
        against = not measure.holds(number)
        if field == "orientation":  # to mirror may be wanted, or follow from hints: the outcome knows
            kept = -number if result.config.orientation == "reverse" else number
            against = result.outcome is Outcome.LOW_CONFIDENCE and not measure.holds(kept)
        if not isnan(number):
            yield measure, number, against
