"""Hypotheses: first maps after iterative closest points, and flips of the best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import TypeVar

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Alignment, closest_point_images, iterative_closest_points
from isomatch.matching.maps import Candidate, Hypothesis
from isomatch.matching.pipeline import Start, first_maps_of, name_of
from isomatch.matching.problem import ShapePair
from isomatch.matching.proposals.priors import Priors
from isomatch.matching.proposals.starts import (
    default_starts,
    start_from_pairs,
    starts_from_anchors,
    starts_from_priors,
)
from isomatch.matching.selection import distinct
from isomatch.shapes import Symmetry

PRIOR_STEPS = 8  # of closest points from priors; most maps change little afterwards

# most hypotheses of limbless shapes: the residuals of round shapes tell little, so many are kept until curvature has been
# compared; docs/lab/robustness.md, shapes without limbs
MOST_WITHOUT_LIMBS = 40

T = TypeVar("T")
M = TypeVar("M", Alignment, Hypothesis, Candidate)
AT_ONCE = 4  # maps moved together by a thread; fixed, so that results do not depend on the number of threads


def hypotheses_from_priors(pair: ShapePair, priors: Priors) -> list[Hypothesis]:
    """Hypotheses from what the user knows, each after iterative closest points."""
    # landmarks at extremities leave the front and the back of a thin body undecided: with hypotheses = "given" the flips
    # of the map from them come with it; otherwise automatic hypotheses compete
    settings = pair.config.search
    from_priors = [
        Hypothesis(iterative_closest_points(*pair.search_points, start[None], PRIOR_STEPS)[0], origin)
        for start, origin in starts_from_priors(pair, priors)
    ]
    from_landmarks = [start for start in from_priors if start.origin == "landmarks"]
    if not from_landmarks or not settings.flip_landmarks or pair.config.hypotheses == "all":
        return from_priors
    best = min(from_landmarks, key=lambda start: start.alignment.residual)
    return [*from_priors, *flips(pair, best, from_priors)]


def flips(pair: ShapePair, hypothesis: Hypothesis, others: list[Hypothesis]) -> list[Hypothesis]:
    """Find the maps that the flip of one Laplace–Beltrami function makes of a hypothesis, other than those there are."""
    pool = Pool(pair, pair.config.search.n_hypotheses)
    pool.merge([hypothesis])
    pool.flip([hypothesis], hypothesis.origin)
    images = [h.target_row for h in others]
    least = pair.config.search.same_map
    return [flip for flip in pool.hypotheses if pair.differs(flip.target_row, images, least)]


def symmetric_variants(pair: ShapePair, target_row: IntArray) -> list[Hypothesis]:
    """Compose a map of the search vertices (m_s,) with the symmetries of the target."""
    # σ ∘ f keeps distances as f does, if σ is a self-isometry; mirror images only if either orientation is allowed
    starts = [each.image_row[target_row] for each in pair.target.symmetries if _allowed(pair, each)]
    return _moved(pair, starts, "symmetry")


def composed(pair: ShapePair, target_row: IntArray, most: float) -> list[Hypothesis]:
    """Compose a map (m_s,) with near-symmetries of either shape, of residuals up to the ``most``."""

    # σ ∘ f distorts distances at most as f and σ do together: so may the truth, if σ distorts less than f. Closest
    # points repair σ better on the side of the target, so symmetries of the source are composed with the inverse.
    def moved(between: ShapePair, rows: IntArray) -> list[Hypothesis]:
        near = [s for s in between.target.near_symmetries if s.residual <= most and _allowed(pair, s)]
        return _moved(between, [s.image_row[rows] for s in near], "symmetry")

    turned = pair.turned
    back = [turned.inverted(each.target_row) for each in moved(turned, pair.inverted(target_row))]
    still = [Hypothesis(Alignment(rows, np.eye(1), 0.0), "symmetry") for rows in back]
    return distinct_maps(pair, [*moved(pair, target_row), *still])


def _allowed(pair: ShapePair, symmetry: Symmetry) -> bool:
    return symmetry.orientation >= 0 or pair.config.orientation == "any"


def _moved(pair: ShapePair, starts: list[IntArray], origin: str) -> list[Hypothesis]:
    """Let closest points move maps of the search vertices (m_s,) that are nearly right."""
    settings = pair.config.search
    steps = settings.flip_steps, settings.unchanged
    moved = iterative_closest_points(*pair.search_points, np.array(starts), *steps) if starts else []
    return [Hypothesis(alignment, origin) for alignment in moved]


def search(
    pair: ShapePair, from_priors: list[Hypothesis], starts: Sequence[Start] | None = None
) -> list[Hypothesis]:
    """Collect distinct hypotheses from priors and starts, and flips of the best; best residual first."""
    settings, starts = pair.config.search, default_starts if starts is None else starts
    pool = Pool(pair, MOST_WITHOUT_LIMBS if pair.limbless else settings.n_hypotheses)
    pool.merge(from_priors)
    for start in starts:
        rows = [start_from_pairs(pair, pairs) for pairs, _ in first_maps_of([start], pair)]
        # closest points of a round shape stop anywhere, so `slid` has moved the maps from anchors
        pool.add(rows, 0 if start is starts_from_anchors else settings.start_steps, name_of(start))
    if any(start in default_starts for start in starts):  # starts of a user stand alone
        pool.flip(pool.hypotheses[: settings.flipped], "flip")
    return pool.hypotheses


def distinct_maps(
    pair: ShapePair, maps: Iterable[M], most: int | None = None, before: Sequence[IntArray] = ()
) -> list[M]:
    """Keep the first maps of the search vertices that differ, see `distinct`."""
    least = pair.config.search.same_map
    return distinct(maps, lambda map_: map_.target_row, pair.distances_between_maps, least, most, before)


class Pool:
    """The best distinct hypotheses so far, at most so many."""

    def __init__(self, pair: ShapePair, most: int) -> None:
        self.pair = pair
        self._most = most
        self._settings = pair.config.search
        self.hypotheses: list[Hypothesis] = []

    def merge(self, new: list[Hypothesis]) -> None:
        """Take in hypotheses; of maps that nearly coincide the one of smallest residual is kept."""
        order = sorted([*self.hypotheses, *new], key=attrgetter("alignment.residual"))
        self.hypotheses = distinct_maps(self.pair, order, self._most)

    def add(self, starts: list[IntArray], steps: int, origin: str) -> None:
        """Run iterative closest points from first maps and merge what comes of them."""
        self.merge([Hypothesis(alignment, origin) for alignment in self.converged(starts, steps)])

    def flip(self, parents: list[Hypothesis], origin: str) -> None:
        """Add what comes of turning the sign of one of the first Laplace–Beltrami functions in each of some maps."""
        # Φ_j is defined but for its sign, and a symmetric shape has even and odd functions: D F with D = diag(1, …, −1 at
        # j, …, 1) is near the functional map of the mirror image, or of the map that exchanges front and back
        pair = self.pair
        n = min(self._settings.flipped_functions, pair.n_functions)
        grown = [pair.search_spectra.grown(parent.target_row, (n,) * 4) for parent in parents if n]
        # the first function is constant; leaving out the second is chosen, not measured
        flips = [(functional_map, j) for functional_map in grown for j in range(2, n)]
        starts = parallel_map(lambda flip: _flipped(pair, *flip), flips)
        self.add(starts, self._settings.flip_steps, origin)

    def converged(self, starts: list[IntArray], steps: int) -> list[Alignment]:
        """Run iterative closest points from many first maps; one that meets another, or a known map, is dropped."""
        settings, points = self._settings, self.pair.search_points
        before, settled = [h.target_row for h in self.hypotheses], list[IntArray]()
        # most starts lead to few maps: comparing them every other iteration saves most of the work, as does leaving
        # those that have settled
        for _ in range(0, steps, settings.compare_every):
            met, apart = [*before, *settled], self.pair.distances_between_maps
            starts = distinct(starts, lambda rows: rows, apart, settings.same_start, before=met)
            images = _in_groups(
                lambda maps: closest_point_images(*points, maps, settings.compare_every, settings.unchanged),
                starts,
            )
            moving = [(rows == start).mean() < settings.unchanged for rows, start in zip(images, starts)]
            settled += [rows for rows, moves in zip(images, moving) if not moves]
            starts = [rows for rows, moves in zip(images, moving) if moves]
        return _in_groups(lambda maps: iterative_closest_points(*points, maps, 0), [*settled, *starts])


def _in_groups(move: Callable[[IntArray], Iterable[T]], maps: list[IntArray]) -> list[T]:
    """Apply a function of several maps (h, m_s) to many, on all threads."""
    groups = [np.array(maps[i : i + AT_ONCE]) for i in range(0, len(maps), AT_ONCE)]
    return [each for group in parallel_map(move, groups) for each in group]


def _flipped(pair: ShapePair, functional_map: FloatArray, function: int) -> IntArray:
    """Turn one function of the leading block, and grow the map again to the size it had, two functions at a time."""
    # spectral upsampling: the j × j block of F, its map to points, and from these the (j + 2) × (j + 2) block (ZoomOut)
    size, spectra = max(function + 1, 4), pair.search_spectra
    flipped = functional_map[:size, :size].copy()
    flipped[function] *= -1
    sizes = range(size, len(functional_map) + 1, 2)
    return spectra.image(spectra.upsampled(flipped, sizes))
