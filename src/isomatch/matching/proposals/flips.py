"""Distinct hypotheses, and the flips of Laplace–Beltrami functions that make others of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import TypeVar

import numpy as np

from isomatch._core.arrays import FloatArray, Int, IntArray, SearchRows
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Alignment, closest_point_images, iterative_closest_points
from isomatch.matching.maps import Candidate
from isomatch.matching.problem import Problem
from isomatch.matching.selection import keep_distinct

T = TypeVar("T")
M = TypeVar("M", Alignment, Candidate)
AT_ONCE = 4  # maps moved together by a thread; fixed, so that results do not depend on the number of threads


def find_flips(pair: Problem, hypothesis: Candidate, others: list[Candidate]) -> list[Candidate]:
    """Find the maps that the flip of one Laplace–Beltrami function makes of a hypothesis, other than those there are."""
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
    least = pair.config.search.same_map
    apart = pair.distances_between_maps
    return keep_distinct(maps, lambda map_: SearchRows(map_.target_row), apart, least, most, before)


class Pool:
    """The best distinct hypotheses so far, at most so many."""

    def __init__(self, pair: Problem, most: int) -> None:
        self.pair = pair
        self._most = most
        self._settings = pair.config.search
        self.hypotheses: list[Candidate] = []

    def merge(self, new: list[Candidate]) -> None:
        """Take in hypotheses; of maps that nearly coincide the one of smallest residual is kept."""
        order = sorted([*self.hypotheses, *new], key=attrgetter("alignment.residual"))
        self.hypotheses = keep_distinct_maps(self.pair, order, self._most)

    def add(self, starts: list[Int[SearchRows, "m_s"]], steps: int, origin: str) -> None:
        """Run iterative closest points from first maps and merge what comes of them."""
        self.merge([Candidate(alignment, origin) for alignment in self.converge(starts, steps)])

    def flip(self, parents: list[Candidate], origin: str) -> None:
        """Add what comes of turning the sign of one of the first Laplace–Beltrami functions in each of some maps."""
        # Φ_j is defined but for its sign, and a symmetric shape has even and odd functions: D F with D = diag(1, …, −1 at
        # j, …, 1) is near the functional map of the mirror image, or of the map that exchanges front and back
        pair = self.pair
        n = min(self._settings.flipped_functions, pair.n_functions)
        grown = [pair.search_spectra.fit_and_upsample(parent.target_row, (n,) * 4) for parent in parents if n]
        # the first function is constant; leaving out the second is chosen, not measured
        flips = [(functional_map, j) for functional_map in grown for j in range(2, n)]
        starts = parallel_map(lambda flip: _flip_function(pair, *flip), flips)
        self.add(starts, self._settings.flip_steps, origin)

    def converge(self, starts: list[Int[SearchRows, "m_s"]], steps: int) -> list[Alignment]:
        """Run iterative closest points from many first maps; one that meets another, or a known map, is dropped."""
        settings, points = self._settings, self.pair.search_points
        before, settled = [h.target_row for h in self.hypotheses], list[SearchRows]()
        # most starts lead to few maps: comparing them every other iteration saves most of the work, as does leaving
        # those that have settled
        for _ in range(0, steps, settings.compare_every):
            met, apart = [*before, *settled], self.pair.distances_between_maps
            starts = keep_distinct(starts, lambda rows: rows, apart, settings.same_start, before=met)
            images = _map_in_groups(
                lambda maps: closest_point_images(*points, maps, settings.compare_every, settings.unchanged),
                starts,
            )
            moving = [(rows == start).mean() < settings.unchanged for rows, start in zip(images, starts)]
            settled += [rows for rows, moves in zip(images, moving) if not moves]
            starts = [rows for rows, moves in zip(images, moving) if moves]
        return _map_in_groups(lambda maps: iterative_closest_points(*points, maps, 0), [*settled, *starts])


def _map_in_groups(move: Callable[[Int[IntArray, "h m_s"]], Iterable[T]], maps: list[SearchRows]) -> list[T]:
    """Apply a function of several maps to many, on all threads."""
    groups = [np.array(maps[i : i + AT_ONCE]) for i in range(0, len(maps), AT_ONCE)]
    return [each for group in parallel_map(move, groups) for each in group]


def _flip_function(pair: Problem, functional_map: FloatArray, function: int) -> Int[SearchRows, "m_s"]:
    """Turn one function of the leading block, and grow the map again to the size it had, two functions at a time."""
    # spectral upsampling: the j × j block of F, its map to points, and from these the (j + 2) × (j + 2) block (ZoomOut)
    size, spectra = max(function + 1, 4), pair.search_spectra
    flipped = functional_map[:size, :size].copy()
    flipped[function] *= -1
    sizes = range(size, len(functional_map) + 1, 2)
    return SearchRows(spectra.image(spectra.upsample(flipped, sizes)))
