"""Symmetries of one shape: maps onto itself, other than the identity, that keep its distances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from operator import attrgetter

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.ties import first_largest
from isomatch.correspondence import (
    Alignment,
    IntervalCost,
    Intervals,
    SignedPoints,
    alignment_residual,
    assign_points,
    closest_point_images,
    iterative_closest_points,
    nearest_of_few,
    nearest_rows,
    nearest_under_rotation,
    signed_procrustes,
)
from isomatch.settings import SymmetrySettings

N_SAMPLES = 200  # samples of the search; chosen: their spacing of 0.08 √area is below SAME_SYMMETRY
N_ANCHORS = 5  # samples that are assigned; chosen: three determine an isometry, two more test it
BEAM_WIDTH = 60  # partial assignments of the anchors that are kept; chosen: 200 find no more symmetries
N_ROUNDS, STEPS_PER_ROUND = 3, 4  # rounds of closest points from an assignment, and steps in each; chosen
SAME_START = 0.04  # √area, mean; of two maps with nearer images, one is dropped; chosen: half the spacing
N_GENERATORS = 6  # best symmetries that are composed with each other; chosen
MIN_ORIENTATION = 0.7  # least |mean cosine| of normals under a symmetry; mirror images of bodies have more
MIN_MOVED = 0.15  # √area, mean; maps that move less are the identity; chosen as selection.runner_up_distance
SAME_SYMMETRY = 0.1  # √area, mean; maps with nearer images are one symmetry; chosen: about the spacing
# Two largest residuals, over the largest residual of a symmetry: of maps that are composed with each other,
# and of maps whose orientation need not be clear, as on one-sided surfaces; chosen.
GENERATOR_RESIDUAL_RATIO, EXACT_RESIDUAL_RATIO = 1.5, 0.75
# Residual of a map on the samples of the search over the largest residual on all samples, up to which the map
# is tried. The ratio is 1.03 to 1.08 for maps near the bound, in six bodies of FAUST.
SEARCH_RESIDUAL_RATIO = 1.2
# Largest residual of a near-symmetry, and number of assignments from which near-symmetries are sought, over
# those of symmetries. Half turns of ants have residuals of 1.3, and need more assignments.
NEAR_RESIDUAL_RATIO, NEAR_ASSIGNMENTS_RATIO = 2.0, 2.5
EXACTLY = IntervalCost(tolerance=0.0, inside=0.0)  # a cost in which every difference of two distances counts

Orientation = Callable[[IntArray], float]
"""Orientation, from −1 to 1, of a map of samples (r,) to samples."""


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A map of a shape onto itself that nearly keeps distances."""

    image_row: IntArray  # (r,) image of each sample
    residual: float  # mean descriptor difference, in √(average distance); about 0.1 for exact symmetries
    orientation: float  # near 1 for a rotation, −1 for a mirror image; 0 if the shape has no triangles
    moved: float  # mean distance between a sample and its image, in √area


@dataclass(frozen=True, eq=False)
class SymmetrySearch:
    """Maps of a shape onto itself that nearly keep its distances; if these are infinitely many, some of them."""

    # A symmetry σ keeps all distances, d(σ x, σ y) = d(x, y). Images of three points determine σ. So a few
    # anchors a_i, far from each other, are assigned to samples b_i by a beam search, which keeps partial
    # assignments that differ. The assignments minimise
    #     Σ_{i<j} |d(b_i, b_j) − d(a_i, a_j)|, each term bounded and relative to the distance, see `IntervalCost`.
    # The image of any other sample has the same distances from the b_i as the sample from the a_i. In the
    # distance basis D = P S Pᵀ, S = diag(±1), rows p(x) of P are the descriptors, and d(x, y) = p(x) S p(y)ᵀ;
    # if σ keeps d, then p(σ x) = p(x) R with R S Rᵀ = S (Shamai & Kimmel, Geodesic distance descriptors, CVPR
    # 2017). So each first map is improved by iterative closest points of the descriptors with themselves. As
    # the identity keeps distances, too, maps that move samples little are left out. O(beam · samples · log)
    # for the assignments, O(starts · samples² · rank) for the rest.

    points: SignedPoints  # descriptors of r samples, evenly spread, as is every prefix
    distances: FloatArray  # (r, r) geodesic distances between the samples, in √area
    settings: SymmetrySettings

    def symmetries(self, orientation: Orientation) -> tuple[Symmetry, ...]:
        """Find symmetries, best residual first."""
        return self._select(self._first_maps, orientation, self._largest, self._largest, N_GENERATORS)

    def near_symmetries(self, orientation: Orientation, most: float) -> tuple[Symmetry, ...]:
        """Find maps that distort distances as maps between individuals do, with residuals up to ``most``."""
        largest = NEAR_RESIDUAL_RATIO * self._largest
        maps = [*self._first_maps, *self._further_maps]
        return self._select(maps, orientation, largest, min(largest, most), 0)

    @property
    def _largest(self) -> float:
        """Largest residual of a symmetry; it falls with the number r of samples as 1 / √r, like their spacing."""
        return float(self.settings.largest_residual / np.sqrt(len(self.distances)))

    @property
    def _first_samples(self) -> tuple[SignedPoints, FloatArray]:
        n = min(N_SAMPLES, len(self.distances))
        return self.points.at(np.arange(n)), self.distances[:n, :n]

    @cached_property
    def _anchor_images(self) -> tuple[IntArray, IntArray]:
        """Anchors, and the samples (h, m) that they are assigned to."""
        _, between = self._first_samples
        anchors = farthest_rows(between, N_ANCHORS)
        return anchors, _assignments(between, anchors)

    @cached_property
    def _first_maps(self) -> list[Alignment]:
        return self._improve_maps(slice(self.settings.n_assignments))

    @cached_property
    def _further_maps(self) -> list[Alignment]:
        n = self.settings.n_assignments
        return self._improve_maps(slice(n, int(NEAR_ASSIGNMENTS_RATIO * n)))

    def _improve_maps(self, rows: slice) -> list[Alignment]:
        """Improve maps of the first samples that agree with some rows of the assignments."""
        samples, between = self._first_samples
        anchors, images = self._anchor_images
        if not len(images[rows]):
            return []
        to_anchors = between[:, anchors]
        maps = np.array([nearest_rows(between[:, row], to_anchors) for row in images[rows]])
        for _ in range(N_ROUNDS):
            maps = _distinct_maps(closest_point_images(samples, samples, maps, STEPS_PER_ROUND), between)
        return iterative_closest_points(samples, samples, maps, 0)

    def _select(
        self,
        alignments: list[Alignment],
        orientation: Orientation,
        largest: float,
        most: float,
        n_generators: int,
    ) -> tuple[Symmetry, ...]:
        """Find symmetries among maps of the first samples, and products of the best of them."""
        points, distances = self.points, self.distances
        samples, between = self._first_samples
        self_maps: list[tuple[Symmetry, FloatArray, IntArray]] = []
        largest_tried = GENERATOR_RESIDUAL_RATIO * most if n_generators else most
        tried = [np.arange(len(between))]

        def add(rotation: FloatArray) -> None:
            sample_map = nearest_of_few(samples.coordinates @ rotation, samples.coordinates)
            if (between[np.array(tried), sample_map].mean(axis=1) < SAME_START).any():
                return
            tried.append(sample_map)
            image_row = nearest_under_rotation(points, points, rotation)
            moved = distances[image_row, np.arange(len(distances))].mean()
            repeats = any(distances[image_row, s.image_row].mean() < SAME_SYMMETRY for s, *_ in self_maps)
            if moved < MIN_MOVED or repeats:
                return
            rotation = signed_procrustes(points, points.at(image_row))
            image_row = nearest_under_rotation(points, points, rotation)
            images = points.at(image_row)
            rotation = signed_procrustes(points, images)
            residual = alignment_residual(points, images, rotation)
            if residual > largest_tried:
                return
            side = orientation(image_row)
            # A symmetry preserves the orientation everywhere, or reverses it everywhere. A map that turns a
            # limb in its place does both: it is no symmetry, although distances hardly show it.
            if side == 0 or abs(side) >= MIN_ORIENTATION or residual <= EXACT_RESIDUAL_RATIO * largest:
                self_maps.append((Symmetry(image_row, residual, side, float(moved)), rotation, sample_map))

        for alignment in sorted(alignments, key=attrgetter("residual")):
            if alignment.residual <= SEARCH_RESIDUAL_RATIO * largest_tried:
                add(alignment.rotation)
        # Symmetries are a group: the composition of two, for example of two mirror images, is a symmetry,
        # too, which the beam search may have missed.
        generators = [rotation for _, rotation, _ in self_maps[:n_generators]]
        # rejected maps are forgotten, so that a composition that comes close to one of them can be accepted
        tried[1:] = [sample_map for *_, sample_map in self_maps]
        for first, second in product(generators, repeat=2):
            add(second @ first)
        symmetries = [symmetry for symmetry, *_ in self_maps if symmetry.residual <= most]
        return tuple(sorted(symmetries, key=attrgetter("residual")))


def describe_symmetries(symmetries: Sequence[Symmetry]) -> str:
    """Count the symmetries in words; empty if there are none. Groups are not always found completely."""
    sides = np.sign([symmetry.orientation for symmetry in symmetries])
    words = {1: ("rotation", "rotations"), -1: ("mirror image", "mirror images")}
    words[0] = "map onto itself", "maps onto itself"
    counts = [((sides == side).sum(), *both) for side, both in words.items()]
    phrases = [f"{n} {several if n > 1 else one}" for n, one, several in counts if n]
    return ("at least " if len(symmetries) > 1 else "") + " and ".join(phrases)


def farthest_rows(distances: FloatArray, count: int, first: Sequence[int] = ()) -> IntArray:
    """Choose rows far from each other, after some first ones; by default after the most remote one."""
    rows = list(first) or [first_largest(distances.mean(axis=1))]
    while len(rows) < min(count, len(distances)):
        rows.append(first_largest(distances[rows].min(axis=0)))
    return np.array(rows)


def _distinct_maps(image_rows: IntArray, distances: FloatArray) -> IntArray:
    """Keep the first of the maps (h, r) that nearly coincide; drop maps that are nearly the identity."""
    remaining = np.arange(len(image_rows))
    kept, last = [], np.arange(len(distances))
    while len(remaining := remaining[distances[last, image_rows[remaining]].mean(axis=1) >= SAME_START]):
        last = image_rows[remaining[0]]
        kept.append(remaining[0])
        remaining = remaining[1:]
    return image_rows[np.array(kept, dtype=np.int64)]


def _assignments(distances: FloatArray, anchors: IntArray) -> IntArray:
    """Assign m anchors to differing rows (h, m) at similar distances, none of them near the identity."""
    remoteness = distances.mean(axis=1)
    exact = distances[np.ix_(anchors, anchors)]
    unary = 0.5 * np.abs(remoteness - remoteness[anchors, None])
    sides = Intervals(exact, exact), Intervals(distances, distances)
    images, _ = assign_points(*sides, unary, EXACTLY, BEAM_WIDTH, MIN_MOVED)
    moved = distances[images, anchors].mean(axis=1)
    return np.asarray(images[moved > MIN_MOVED])
