"""Hypotheses: first maps after iterative closest points, and flips of the best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence import Alignment, iterative_closest_points
from isomatch.matching.anchors import starts_from_anchors
from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair
from isomatch.matching.starts import starts_from_extremities, starts_from_hints
from isomatch.runtime.threads import parallel_map
from isomatch.values.arrays import FloatArray, IntArray

AT_ONCE = 4  # maps moved together by a thread; fixed, so that results do not depend on the number of threads


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A candidate map of the search vertices.

    Parameters
    ----------
    alignment : Alignment
        Target row of each source row, rotation and residual after iterative closest points.
    origin : str
        Where it came from: "extremities", "anchors", "landmarks", "initial map", "descriptors", "pose", "flip" or
        "symmetry".
    """

    alignment: Alignment
    origin: str

    @property
    def target_row(self) -> IntArray:
        """(m_s,) target row of each source row."""
        return self.alignment.target_row


def hypotheses_from_hints(pair: ShapePair, hints: Hints) -> list[Hypothesis]:
    """Hypotheses from what the user knows, each after iterative closest points.

    Landmarks at extremities leave the front and the back of a thin body undecided. With ``hypotheses="given"``, the
    flips of the map from landmarks come with it; otherwise automatic hypotheses compete.
    """
    settings = pair.config.search
    given = [
        Hypothesis(iterative_closest_points(*pair.search_points, start[None], settings.hint_steps)[0], origin)
        for start, origin in starts_from_hints(pair, hints)
    ]
    led = [start for start in given if start.origin == "landmarks"]
    if not led or not settings.flip_landmarks or pair.config.hypotheses == "all":
        return given
    best = min(led, key=lambda start: start.alignment.residual)
    return [*given, *flips(pair, best, given)]


def flips(pair: ShapePair, hypothesis: Hypothesis, known: list[Hypothesis]) -> list[Hypothesis]:
    """Find the maps that the flip of one Laplace–Beltrami function makes of a hypothesis, other than those known.

    They are its mirror images, and of a thin body the map that exchanges front and back.
    """
    pool = _Pool(pair, pair.config.search.n_hypotheses)
    pool.merge([hypothesis])
    pool.flip([hypothesis], hypothesis.origin)
    return [flip for flip in pool.hypotheses if _is_new(pair, flip, known)]


def symmetric_variants(pair: ShapePair, target_row: IntArray) -> list[Hypothesis]:
    """Compose a map of the search vertices (m_s,) with the symmetries of the target.

    Mirror images are left out unless either orientation is allowed.
    """
    starts = [
        symmetry.image_row[target_row]
        for symmetry in pair.target.symmetries
        if symmetry.orientation >= 0 or pair.config.orientation == "any"
    ]
    if not starts:
        return []
    settings = pair.config.search
    moved = iterative_closest_points(
        *pair.search_points, np.array(starts), settings.flip_steps, settings.unchanged
    )
    return [Hypothesis(alignment, "symmetry") for alignment in moved]


def search(pair: ShapePair, given: list[Hypothesis]) -> list[Hypothesis]:
    """Collect distinct hypotheses, best residual first.

    Parameters
    ----------
    pair : ShapePair
        The two shapes.
    given : list of Hypothesis
        Maps from what the user knows.

    Returns
    -------
    list of Hypothesis
        Those given, maps from extremal points, of shapes without limbs also maps from anchors, and flips of the best of
        them, which exchange left and right or front and back.
    """
    settings = pair.config.search
    extremal = starts_from_extremities(pair)
    limbless = not extremal or pair.both_open
    pool = _Pool(pair, pair.config.anchors.n_hypotheses if limbless else settings.n_hypotheses)
    pool.merge(given)
    pool.add(extremal, settings.start_steps, "extremities")
    if limbless:
        anchored = iterative_closest_points(*pair.search_points, np.array(starts_from_anchors(pair)), 0)
        pool.merge([Hypothesis(alignment, "anchors") for alignment in anchored])
    pool.flip(pool.hypotheses[: settings.flipped], "flip")
    return pool.hypotheses


def _is_new(pair: ShapePair, hypothesis: Hypothesis, known: list[Hypothesis]) -> bool:
    return pair.differs(hypothesis.target_row, [h.target_row for h in known], pair.config.search.same_map)


class _Pool:
    """The best distinct hypotheses so far, at most so many."""

    def __init__(self, pair: ShapePair, most: int) -> None:
        self._pair = pair
        self._most = most
        self._settings = pair.config.search
        self.hypotheses: list[Hypothesis] = []

    def merge(self, new: list[Hypothesis]) -> None:
        """Take in hypotheses; of maps that nearly coincide the one of smallest residual is kept."""
        kept: list[Hypothesis] = []
        for hypothesis in sorted([*self.hypotheses, *new], key=lambda h: h.alignment.residual):
            if len(kept) < self._most and _is_new(self._pair, hypothesis, kept):
                kept.append(hypothesis)
        self.hypotheses = kept

    def add(self, starts: list[IntArray], steps: int, origin: str) -> None:
        """Run iterative closest points from first maps and merge what comes of them."""
        self.merge([Hypothesis(alignment, origin) for alignment in self.converged(starts, steps)])

    def flip(self, parents: list[Hypothesis], origin: str) -> None:
        """Add what comes of turning the sign of one Laplace–Beltrami function in each of some maps."""
        pair = self._pair
        n = min(self._settings.flipped_functions, pair.n_functions)
        grown = [pair.search_spectra.grown(parent.target_row, (n,) * 4) for parent in parents if n]
        # the first function is constant; leaving out the second is chosen, not measured
        flips = [(functional_map, j) for functional_map in grown for j in range(2, n)]
        starts = parallel_map(lambda flip: _flipped(pair, *flip), flips)
        self.add(starts, self._settings.flip_steps, origin)

    def converged(self, starts: list[IntArray], steps: int) -> list[Alignment]:
        """Run iterative closest points from many first maps; one that meets another, or a known map, is dropped.

        Most starts lead to few maps: comparing them every other iteration saves most of the work.
        """
        settings = self._settings
        alignments: list[Alignment] = []
        for _ in range(0, steps, settings.compare_every):
            starts = self._distinct(starts)
            groups = [np.array(starts[i : i + AT_ONCE]) for i in range(0, len(starts), AT_ONCE)]
            moved = parallel_map(
                lambda group: iterative_closest_points(
                    *self._pair.search_points, group, settings.compare_every, settings.unchanged
                ),
                groups,
            )
            alignments = [alignment for group in moved for alignment in group]
            starts = [alignment.target_row for alignment in alignments]
        return alignments

    def _distinct(self, starts: list[IntArray]) -> list[IntArray]:
        known = [h.target_row for h in self.hypotheses]
        kept: list[IntArray] = []
        for start in starts:
            if self._pair.differs(start, [*known, *kept], self._settings.same_start):
                kept.append(start)
        return kept


def _flipped(pair: ShapePair, functional_map: FloatArray, function: int) -> IntArray:
    """Turn one function of the leading block, and grow the map again to the size it had, two functions at a time."""
    size, spectra = max(function + 1, 4), pair.search_spectra
    flipped = functional_map[:size, :size].copy()
    flipped[function] *= -1
    sizes = range(size, len(functional_map) + 1, 2)
    return spectra.image(spectra.upsampled(flipped, sizes))
