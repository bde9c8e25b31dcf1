"""Maps composed with symmetries and near-symmetries of the shapes."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import Int, SearchRows
from isomatch.correspondence import Alignment, iterative_closest_points
from isomatch.matching.maps import Candidate
from isomatch.matching.problem import Problem
from isomatch.matching.proposals.flips import keep_distinct_maps
from isomatch.shapes import Symmetry


def symmetric_variants(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> list[Candidate]:
    """Compose a map of the search vertices with the symmetries of the target."""
    # σ ∘ f keeps distances as f does, if σ is a self-isometry; mirror images only if either orientation is allowed
    starts = [
        _compose_with_symmetry(each, target_row) for each in pair.target.symmetries if _allowed(pair, each)
    ]
    return _move_by_closest_points(pair, starts, "symmetry")


def near_symmetric_variants(pair: Problem, target_row: SearchRows, most: float) -> list[Candidate]:
    """Compose a map with near-symmetries of either shape, of residuals up to the ``most``."""

    # σ ∘ f distorts distances at most as f and σ do together: so may the truth, if σ distorts less than f. Closest
    # points repair σ better on the side of the target, so symmetries of the source are composed with the inverse.
    def move_with_symmetries(between: Problem, rows: SearchRows) -> list[Candidate]:
        near = [s for s in between.target.near_symmetries(most) if _allowed(pair, s)]
        return _move_by_closest_points(between, [_compose_with_symmetry(s, rows) for s in near], "symmetry")

    turned = pair.turned
    back = [
        turned.inverted(each.target_row) for each in move_with_symmetries(turned, pair.inverted(target_row))
    ]
    still = [Candidate(Alignment(rows, np.eye(1), 0.0), "symmetry") for rows in back]
    return keep_distinct_maps(pair, [*move_with_symmetries(pair, target_row), *still])


def _allowed(pair: Problem, symmetry: Symmetry) -> bool:
    return symmetry.orientation >= 0 or pair.config.orientation == "any"


def _compose_with_symmetry(symmetry: Symmetry, target_row: SearchRows) -> SearchRows:
    return SearchRows(symmetry.image_row[target_row])


def _move_by_closest_points(pair: Problem, starts: list[SearchRows], origin: str) -> list[Candidate]:
    """Let closest points move maps of the search vertices that are nearly right."""
    settings = pair.config.search
    steps = settings.flip_steps, settings.unchanged
    moved = iterative_closest_points(*pair.search_points, np.array(starts), *steps) if starts else []
    return [Candidate(alignment, origin) for alignment in moved]
