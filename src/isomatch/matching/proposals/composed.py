"""Maps composed with symmetries and near-symmetries of the shapes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from isomatch._core.arrays import Int, SearchRows
from isomatch.correspondence import Alignment, iterative_closest_points
from isomatch.matching.maps import Candidate
from isomatch.matching.problem import Problem
from isomatch.matching.proposals.flips import keep_distinct_maps
from isomatch.shapes import Symmetry


def symmetric_variants(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> list[Candidate]:
    """Compose a map of the search vertices with the symmetries of the target."""
    # σ ∘ f keeps distances as well as f does if σ is a self-isometry
    return _compose(pair, target_row, pair.target.symmetries)


def near_symmetric_variants(pair: Problem, target_row: SearchRows, most: float) -> list[Candidate]:
    """Compose a map with near-symmetries of either shape whose residuals are at most ``most``."""
    # σ ∘ f distorts distances at most as much as f and σ together, so it may be the true map if σ
    # distorts less than f. Closest points repair errors of σ better on the target, so symmetries of
    # the source are composed with the inverse of f.
    back = pair.turned
    composed = _compose(back, pair.inverted(target_row), back.target.near_symmetries(most))
    rows = [back.inverted(candidate.target_row) for candidate in composed]
    inverses = [Candidate(Alignment(row, np.eye(1), 0.0), "symmetry") for row in rows]
    variants = _compose(pair, target_row, pair.target.near_symmetries(most))
    return keep_distinct_maps(pair, [*variants, *inverses])


def _compose(pair: Problem, target_row: SearchRows, symmetries: Sequence[Symmetry]) -> list[Candidate]:
    """Compose a map with allowed symmetries of the target, and run closest points."""
    settings, any_side = pair.config.search, pair.config.orientation == "any"
    starts = [s.image_row[target_row] for s in symmetries if any_side or s.orientation >= 0]
    if not starts:
        return []
    steps = settings.flip_steps, settings.unchanged
    moved = iterative_closest_points(*pair.search_points, np.array(starts), *steps)
    return [Candidate(alignment, "symmetry") for alignment in moved]
