"""Distinct hypotheses, and more of them: by flipping functions, and by symmetries of the shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter, itemgetter
from typing import TypeVar

import numpy as np

from isomatch._core.arrays import FloatArray, Int, IntArray, SearchRows
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Alignment, closest_point_images, iterative_closest_points
from isomatch.matching.maps import Candidate
from isomatch.matching.problem import Problem
from isomatch.matching.selection import keep_distinct
from isomatch.shapes import Symmetry

T = TypeVar("T")
M = TypeVar("M", Alignment, Candidate)
GROUP_SIZE = 4  # maps that a thread moves at once; chosen, and fixed so that threads do not change results


def find_flips(pair: Problem, hypothesis: Candidate, others: list[Candidate]) -> list[Candidate]:
    """Flip one Laplace–Beltrami function at a time; return maps that differ from ``others``."""
    pool = Pool(pair, pair.config.search.n_hypotheses)
    pool.merge([hypothesis])
    pool.flip([hypothesis], hypothesis.origin)
    images = [h.target_row for h in others]
    least = pair.config.search.same_map
    return [flip for flip in pool.hypotheses if pair.differs(flip.target_row, images, least)]


def keep_distinct_maps(
    pair: Problem, maps: Iterable[M], most: int | None = None, before: Sequence[SearchRows] = ()
) -> list[M]:
    """Keep the first maps of the search vertices that differ, see `keep_distinct`."""
    distances, least = pair.distances_between_maps, pair.config.search.same_map
    return keep_distinct(maps, lambda map_: SearchRows(map_.target_row), distances, least, most, before)


class Pool:
    """The best distinct hypotheses so far, at most ``most``."""

    def __init__(self, pair: Problem, most: int) -> None:
        self.pair = pair
        self._most = most
        self._settings = pair.config.search
        self.hypotheses: list[Candidate] = []

    def merge(self, new: list[Candidate]) -> None:
        """Add hypotheses; if maps nearly coincide, keep the one of least residual."""
        order = sorted([*self.hypotheses, *new], key=attrgetter("alignment.residual"))
        self.hypotheses = keep_distinct_maps(self.pair, order, self._most)

    def add(self, starts: list[Int[SearchRows, "m_s"]], steps: int, origin: str) -> None:
        """Run iterative closest points from first maps, and merge the results."""
        self.merge([Candidate(alignment, origin) for alignment in self.converge(starts, steps)])

    def flip(self, parents: list[Candidate], origin: str) -> None:
        """Turn the sign of one of the first functions in each map, and add the results."""
        # The sign of the function Φ_j is arbitrary, and on a symmetric shape functions are even or odd. With
        # the functional map F and D = diag(1, …, −1 at j, …, 1), the product D·F is close to the functional
        # map of a mirror image, or of the map that exchanges front and back.
        pair = self.pair
        n = min(self._settings.flipped_functions, pair.n_functions)
        grown = [pair.search_spectra.fit_and_upsample(parent.target_row, (n,) * 4) for parent in parents if n]
        # function 0 is constant; that function 1 is not flipped either is chosen, not measured
        flips = [(functional_map, j) for functional_map in grown for j in range(2, n)]
        starts = parallel_map(lambda flip: _flip_function(pair, *flip), flips)
        self.add(starts, self._settings.flip_steps, origin)

    def converge(self, starts: list[Int[SearchRows, "m_s"]], steps: int) -> list[Alignment]:
        """Run iterative closest points from many first maps; drop maps that come close to other ones."""
        settings, points = self._settings, self.pair.search_points
        bounds = settings.compare_every, settings.unchanged
        known, converged = [h.target_row for h in self.hypotheses], list[SearchRows]()
        # Many first maps converge to few maps. So most of the work is saved if repeated maps are dropped early,
        # and maps that have converged are moved no further.
        for _ in range(0, steps, settings.compare_every):
            before, distances = [*known, *converged], self.pair.distances_between_maps
            starts = keep_distinct(starts, lambda rows: rows, distances, settings.same_start, before=before)
            images = _map_in_groups(lambda maps: closest_point_images(*points, maps, *bounds), starts)
            moving = [(rows == start).mean() < settings.unchanged for rows, start in zip(images, starts)]
            converged += [rows for rows, moves in zip(images, moving) if not moves]
            starts = [rows for rows, moves in zip(images, moving) if moves]
        return _map_in_groups(lambda maps: iterative_closest_points(*points, maps, 0), [*converged, *starts])


def _map_in_groups(move: Callable[[Int[IntArray, "h m_s"]], Iterable[T]], maps: list[SearchRows]) -> list[T]:
    """Apply a function of several maps to many maps, on all threads."""
    groups = [np.array(maps[i : i + GROUP_SIZE]) for i in range(0, len(maps), GROUP_SIZE)]
    return [moved for group in parallel_map(move, groups) for moved in group]


def _flip_function(pair: Problem, functional_map: FloatArray, function: int) -> Int[SearchRows, "m_s"]:
    """Turn the sign of one function in the leading block, and upsample to the same size."""
    # upsampling as in ZoomOut, two functions at a time: the j × j block of the functional map gives a map of
    # vertices, to which the (j + 2) × (j + 2) block is fitted
    size, spectra = max(function + 1, 4), pair.search_spectra
    flipped = functional_map[:size, :size].copy()
    flipped[function] *= -1
    sizes = range(size, len(functional_map) + 1, 2)
    return SearchRows(spectra.image(spectra.upsample(flipped, sizes)))


def symmetric_variants(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> list[Candidate]:
    """Compose a map of the search vertices with the symmetries of the target."""
    # σ ∘ f keeps distances as well as the map f does if the symmetry σ keeps them
    return _compose(pair, target_row, pair.target.symmetries)


def near_symmetric_variants(pair: Problem, target_row: SearchRows, most: float) -> list[Candidate]:
    """Compose a map with near-symmetries of either shape whose residuals are at most ``most``."""
    # The map f composed with a near-symmetry σ distorts distances at most as much as f and σ together, so it
    # might be the true map if σ distorts less than f. Closest points repair errors of σ better if σ acts
    # after the map, so near-symmetries of the source are composed with the inverse of f.
    back, both = pair.turned, (pair.source, pair.target)
    of_source, of_target = parallel_map(lambda shape: shape.near_symmetries(most), both)
    composed = _compose(back, pair.inverted(target_row), of_source)
    rows = [back.inverted(candidate.target_row) for candidate in composed]
    inverses = [Candidate.of_rows(row, "symmetry") for row in rows]
    variants = _compose(pair, target_row, of_target)
    return keep_distinct_maps(pair, [*variants, *inverses])


def mirrored_variants(pair: Problem, target_row: SearchRows) -> list[Candidate]:
    """Compose a map with the best mirror image of either shape, if there is one."""
    shapes = (pair.target, lambda row: row[target_row]), (pair.source, lambda row: target_row[row])
    composed = [
        (symmetry.residual, compose(symmetry.image_row))
        for shape, compose in shapes
        for symmetry in shape.symmetries
        if symmetry.orientation < 0
    ]
    best = sorted(composed, key=itemgetter(0))[:1]
    return [Candidate.of_rows(SearchRows(row), "symmetry") for _, row in best]


def _compose(pair: Problem, target_row: SearchRows, symmetries: Sequence[Symmetry]) -> list[Candidate]:
    """Compose a map with allowed symmetries of the target, and run closest points."""
    settings, any_side = pair.config.search, pair.config.orientation == "any"
    starts = [s.image_row[target_row] for s in symmetries if any_side or s.orientation >= 0]
    if not starts:
        return []
    steps = settings.flip_steps, settings.unchanged
    moved = iterative_closest_points(*pair.search_points, np.array(starts), *steps)
    return [Candidate(alignment, "symmetry") for alignment in moved]
