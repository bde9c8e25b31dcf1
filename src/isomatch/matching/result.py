"""What a match returns: the map, how good it looks, and what to do about it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from enum import Enum
from functools import partial
from typing import Any

from isomatch._cached import cached_property
from isomatch.correspondence import Correspondence, wrap
from isomatch.matching.config import MatchSettings
from isomatch.surfaces import Mesh, SurfaceLike


class Outcome(Enum):
    """How a match ended; ``advice`` says what it means and what to do. Where several hold, the first one is given."""

    HINTS_CONTRADICTED = "hints contradicted"
    LOW_CONFIDENCE = "low confidence"
    SYMMETRY_AMBIGUOUS = "symmetry ambiguous"
    PARTIAL = "partial"
    CONVERGED = "converged"

    @property
    def advice(self) -> str:
        """One sentence: what happened, why, what to do."""
        return _ADVICE[self]


_ADVICE = {
    Outcome.HINTS_CONTRADICTED: (
        "The map does not agree with the landmarks or the initial map. Either may be wrong: check that landmarks are "
        "pairs (source vertex, target vertex) that count from 0; if they are right, match with hypotheses = 'given'."
    ),
    Outcome.LOW_CONFIDENCE: (
        "The shapes fit badly under this map; it may be wrong in places or altogether. Look at the picture; give "
        "three to five landmark pairs at extremities, or check that both shapes are complete and of one kind."
    ),
    Outcome.SYMMETRY_AMBIGUOUS: (
        "A second, symmetric map fits as well, or the hints led to the mirror image. If sides matter, give landmarks: "
        "three to five pairs, at least one on one side only (a left hand, a right ear), and say which orientation "
        "is meant."
    ),
    Outcome.PARTIAL: (
        "One shape is a part of the other, or has further components; what has no counterpart is marked unmatched (−1). "
        "The notes say what is missing. Landmarks on two components make them partners."
    ),
    Outcome.CONVERGED: "The evidence agrees on one map.",
}


@dataclass(frozen=True)
class Quality:
    """Measures of a map that need no ground truth.

    Of large meshes, they are those of the level on which they are matched, before polishing. Of shapes of several
    components, ``coverage`` and ``matched`` count all, and the others are those of the largest.

    Parameters
    ----------
    misfit : float
        Mean distance of refinement vertices from their images in the joint coordinates (spectrum, signatures, positions,
        normals) after the joint refinement: 0 for the same shape, about 0.4 for the right map of two people. With another
        refinement it still tells which hypothesis is right, not how precise the map returned is; nan for a baseline and
        for a map between shapes that are far from isometric.
    rival : float
        What speaks against the best map that differs (misfit, times the fourth root of residual × curvature mismatch²),
        over the same for the map returned: 1 is a tie, large is clear, below 1 the other fits better (it was not among
        those given); ``inf`` if no other came near; nan if no other was tried, as by a baseline.
    mirrored : float
        The same for the best map of the other side, if ``orientation="any"`` allows either; up to 1.5 may be the
        difference of the poses.
    residual : float
        Misfit of the distance descriptors after the best rotation, in units of √(average distance).
    stretch : float
        Squared lengths of the images of edges over those of the edges, summed: 1 for an isometry, more for tears, of
        which each edge counts at most four times (``Config.outcome.torn``); nan for a graph.
    orientation : float
        Mean cosine between the normals of the smooth target and of its copy drawn on the source: near 1 the map keeps the
        outside, near −1 it mirrors, between it is twisted; nan without triangles on both.
    distortion_mean, distortion_p95 : float
        Mean and 95th percentile of |d_source(i, j) − d_target(f(i), f(j))|, each distance divided by √area of its
        own surface, over pairs of a farthest point sample and a spread vertex; marched on the source, low-rank on the
        target, so that the error of the basis, about half a per cent, is part of it. A graph's distances are scaled to
        the same average.
    coverage : float
        Share of the target's area within 0.05 √area, along edges, of an image (``Config.outcome.coverage_radius``).
    matched : float
        Share of the source's vertices that have an image.
    landmark_error : float
        Mean distance between the images of the landmarks and their given targets / √target area; nan without.
    initial_map_error : float
        Median distance between the images and those of the initial map / √target area; nan without.
    stress : float
        For a part, how much distances between images leave the intervals in which those on the whole must lie, relative
        to them: 0.01 for a right map, above 0.03 poor; nan for complete shapes. For a part, residual and distortion are
        nan, and misfit and orientation are those of the part's refinement.
    """

    misfit: float
    rival: float
    mirrored: float
    residual: float
    stretch: float
    orientation: float
    distortion_mean: float
    distortion_p95: float
    coverage: float
    matched: float
    landmark_error: float
    initial_map_error: float
    stress: float = math.nan


@dataclass(frozen=True, eq=False)
class Alternative:
    """A runner-up.

    Parameters
    ----------
    extend : callable
        Makes the map when it is first asked for.
    energy, orientation : float
        Evidence; lower energy is better.
    origin : str
        Where the hypothesis came from.
    """

    extend: Callable[[], Correspondence] = field(repr=False)
    energy: float
    orientation: float
    origin: str

    @cached_property
    def map(self) -> Correspondence:
        """Source → target, extended by its functional map, not refined."""
        return self.extend()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the map itself, and not the shapes it is made from."""
        return Alternative, (partial(_itself, self.map), self.energy, self.orientation, self.origin)


def _itself(found: Correspondence) -> Correspondence:
    return found


@dataclass(frozen=True, eq=False)
class MatchResult:
    """Result of `match`, or of a baseline.

    Parameters
    ----------
    map : Correspondence
        Source → target.
    outcome : Outcome
        How it ended.
    quality : Quality
        Measures without ground truth.
    alternatives : tuple of Alternative
        Distinct other maps, best first.
    timings : dict of str to float
        Seconds of each stage.
    notes : tuple of str
        What was repaired, left out or replaced on the way.
    engine : str
        Geodesic engine of the source.
    origin : str
        Where the winning hypothesis came from.
    reason : str
        Why it won; empty for a baseline, which has no other.
    config : Config or the settings of a baseline
        Settings used.
    seed : int
        Seed used.
    symmetries : tuple of str
        Maps of the source, and of the target, onto themselves, in words; empty where none was found, or for a baseline,
        which searches for none.
    """

    map: Correspondence
    outcome: Outcome
    quality: Quality
    alternatives: tuple[Alternative, ...]
    timings: dict[str, float]
    notes: tuple[str, ...]
    engine: str
    origin: str
    reason: str
    config: MatchSettings
    seed: int
    symmetries: tuple[str, str] = ("", "")

    def as_mesh(self, source: SurfaceLike, target: SurfaceLike) -> Mesh:
        """Return the target's surface with the vertices and faces of the source, see `isomatch.wrap`.

        Parameters
        ----------
        source, target : Mesh, or what `mesh_from` takes
            The surfaces that were matched.

        Raises
        ------
        MapError
            If they are others.
        """
        return wrap(self.map, source, target).mesh

    def to_dict(self) -> dict[str, Any]:
        """Everything but the maps, as plain values for JSON; nan and inf become None."""
        quality = {
            key: value if abs(value) < float("inf") else None for key, value in asdict(self.quality).items()
        }
        return {
            "direction": "source -> target",
            "n_source": len(self.map.vertices),
            "n_target": self.map.n_target,
            "outcome": self.outcome.name,
            "advice": self.outcome.advice,
            "quality": quality,
            "alternatives": [
                {"energy": a.energy, "orientation": a.orientation, "origin": a.origin}
                for a in self.alternatives
            ],
            "symmetries": dict(zip(("source", "target"), self.symmetries)),
            "timings": self.timings,
            "notes": list(self.notes),
            "engine": self.engine,
            "origin": self.origin,
            "reason": self.reason,
            "config": self.config.to_dict(),
            "seed": self.seed,
        }
