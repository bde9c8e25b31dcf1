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

# those without another source: docs/lab/benchmarks.md, symmetry
N_SAMPLES = 200  # samples among which symmetries are searched; chosen: spacing 0.08, less than SAME_SYMMETRY
N_ANCHORS = 5  # samples far from each other: three determine an isometry of a surface, two more its errors
BEAM = 60  # partial assignments that are kept
ROUNDS, STEPS = 3, 4  # of iterations of closest points from each assignment; in a round
SAME_START = 0.04  # √area: mean distance below which two maps between rounds become one; half the spacing of the samples
GENERATORS = 6  # symmetries whose products are tried, too; chosen, not measured
LEAST_ORIENTATION = 0.7  # mean cosine between normals, of either sign, from which a map is a symmetry
LEAST_MOVED = 0.15  # √area: less is a variant of the identity; selection.runner_up_distance
SAME_SYMMETRY = 0.1  # √area: mean distance from which two maps differ; the spacing of the samples
NEAR = 1.5  # residual, over the largest of a symmetry, up to which a map serves in products; chosen, not measured
# residual among the samples of the search, over that among all; near the bound 1.03 to 1.08 on six bodies of FAUST
FEW = 1.2
EXACT = 0.75  # the same, up to which its orientation need not be clear, as of one-sided surfaces; chosen, not measured
# largest residual, and most assignments, of near-symmetries, over those of symmetries; half turns of ants have 1.3, and
# are missed with as many assignments
NEAR_RESIDUAL, NEAR_ASSIGNMENTS = 2.0, 2.5
EXACTLY = IntervalCost(tolerance=0.0, inside=0.0)

Orientation = Callable[[IntArray], float]
"""Orientation, from −1 to 1, of a map of samples (r,) to samples."""


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A map of a shape onto itself that nearly keeps distances."""

    image_row: IntArray  # (r,) sample that each sample goes to
    residual: float  # of the distance descriptors, in √(average distance): 0.1 if exact, from the spacing of the samples
    # near 1 for a rotation, near −1 for a mirror image; 0 where the shape has no triangles
    orientation: float
    moved: float  # mean distance between a sample and its image, in √area


@dataclass(frozen=True, eq=False)
class SymmetrySearch:
    """Maps of a shape onto itself that nearly keep its distances; of a continuous group, some of them."""

    # A symmetry σ keeps all distances, d(σ x, σ y) = d(x, y). Three points determine it, so that few anchors a_i, far
    # from each other, are assigned to samples b_i of least
    #     Σ_{i<j} |d(b_i, b_j) − d(a_i, a_j)|, each bounded and over the distance, see `IntervalCost`,
    # by a beam of partial assignments that differ. The image of any other sample is then the one at the same distances
    # from the b_i as it is from the a_i. In the distance basis D = P S Pᵀ, S = diag(±1), rows p(x) of P are the
    # descriptors, and d(x, y) = p(x) S p(y)ᵀ; if σ keeps d, then p(σ x) = p(x) R with R S Rᵀ = S (Shamai & Kimmel,
    # Geodesic distance descriptors, CVPR 2017). So each first map is improved by iterative closest points of the
    # descriptors with themselves. The identity is such a map, too, and is left out by how far maps move things. O(beam ·
    # samples · log) for the assignments, O(starts · samples² · rank) for the rest.

    points: SignedPoints  # descriptors of r samples, evenly spread, as is every prefix of them
    distances: FloatArray  # (r, r) geodesic distances between them, in √area
    settings: SymmetrySettings

    def symmetries(self, orientation: Orientation) -> tuple[Symmetry, ...]:
        """Find symmetries, best residual first."""
        return self._among(self._first_maps, orientation, self._largest, self._largest, GENERATORS)

    def near_symmetries(self, orientation: Orientation, most: float) -> tuple[Symmetry, ...]:
        """Find maps that distort distances as maps between individuals do, of residuals up to the ``most``."""
        largest = NEAR_RESIDUAL * self._largest
        maps = [*self._first_maps, *self._further_maps]
        return self._among(maps, orientation, largest, min(largest, most), 0)

    @property
    def _largest(self) -> float:
        """Largest residual of a symmetry: images are the nearest of r samples, whose spacing is √(area / r)."""
        return float(self.settings.largest_residual / np.sqrt(len(self.distances)))

    @property
    def _few(self) -> tuple[SignedPoints, FloatArray]:
        n = min(N_SAMPLES, len(self.distances))
        return self.points.at(np.arange(n)), self.distances[:n, :n]

    @cached_property
    def _assigned(self) -> tuple[IntArray, IntArray]:
        """Anchors, and the samples (h, m) that they are assigned to."""
        _, between = self._few
        anchors = farthest_rows(between, N_ANCHORS)
        return anchors, _assignments(between, anchors)

    @cached_property
    def _first_maps(self) -> list[Alignment]:
        return self._improved(slice(self.settings.most))

    @cached_property
    def _further_maps(self) -> list[Alignment]:
        return self._improved(slice(self.settings.most, int(NEAR_ASSIGNMENTS * self.settings.most)))

    def _improved(self, which: slice) -> list[Alignment]:
        """Improve maps of the first samples that agree with some of the assignments."""
        few, between = self._few
        anchors, assigned = self._assigned
        if not len(assigned[which]):
            return []
        to_anchors = between[:, anchors]
        maps = np.array([nearest_rows(between[:, images], to_anchors) for images in assigned[which]])
        for _ in range(ROUNDS):
            maps = _distinct_maps(closest_point_images(few, few, maps, STEPS), between)
        return iterative_closest_points(few, few, maps, 0)

    def _among(
        self,
        alignments: list[Alignment],
        orientation: Orientation,
        largest: float,
        most: float,
        generators: int,
    ) -> tuple[Symmetry, ...]:
        """Symmetries among maps of the first samples, and products of the best of them."""
        points, distances = self.points, self.distances
        few, between = self._few
        self_maps: list[tuple[Symmetry, FloatArray]] = []
        for_products = NEAR * most if generators else most
        seen = [np.arange(len(between))]

        def add(rotation: FloatArray) -> None:
            of_few = nearest_of_few(few.coordinates @ rotation, few.coordinates)
            if (between[np.array(seen), of_few].mean(axis=1) < SAME_START).any():
                return
            seen.append(of_few)
            image_row = nearest_under_rotation(points, points, rotation)
            moved = distances[image_row, np.arange(len(distances))].mean()
            repeats = any(distances[image_row, s.image_row].mean() < SAME_SYMMETRY for s, _ in self_maps)
            if moved < LEAST_MOVED or repeats:
                return
            rotation = signed_procrustes(points, points.at(image_row))
            image_row = nearest_under_rotation(points, points, rotation)
            images = points.at(image_row)
            rotation = signed_procrustes(points, images)
            residual = alignment_residual(points, images, rotation)
            if residual > for_products:
                return
            side = orientation(image_row)
            # σ either preserves the orientation everywhere or reverses it; a map that does both is none, though
            # distances of a limb that is turned in its place hardly tell
            if side == 0 or abs(side) >= LEAST_ORIENTATION or residual <= EXACT * largest:
                self_maps.append((Symmetry(image_row, residual, side, float(moved)), rotation))

        for alignment in sorted(alignments, key=attrgetter("residual")):
            if alignment.residual <= FEW * for_products:
                add(alignment.rotation)
        # Symmetries are a group: σ τ is one, which the beam may have missed. Two mirror images make a rotation.
        factors = [rotation for _, rotation in self_maps[:generators]]
        for first, second in product(factors, repeat=2):
            add(second @ first)
        symmetries = [symmetry for symmetry, _ in self_maps if symmetry.residual <= most]
        return tuple(sorted(symmetries, key=attrgetter("residual")))


def describe_symmetries(symmetries: Sequence[Symmetry]) -> str:
    """Count the symmetries in words; empty if there are none. Groups are not always found whole."""
    sides = np.sign([symmetry.orientation for symmetry in symmetries])
    words = {1: ("rotation", "rotations"), -1: ("mirror image", "mirror images")}
    words[0] = "map onto itself", "maps onto itself"
    counts = [((sides == side).sum(), *both) for side, both in words.items()]
    named = [f"{n} {several if n > 1 else one}" for n, one, several in counts if n]
    return ("at least " if len(symmetries) > 1 else "") + " and ".join(named)


def farthest_rows(distances: FloatArray, count: int, first: Sequence[int] = ()) -> IntArray:
    """Rows far from each other, after some first ones; by default after the most remote one."""
    rows = list(first) or [first_largest(distances.mean(axis=1))]
    while len(rows) < min(count, len(distances)):
        rows.append(first_largest(distances[rows].min(axis=0)))
    return np.array(rows)


def _distinct_maps(image_rows: IntArray, distances: FloatArray) -> IntArray:
    """Keep the first of maps (h, r) that nearly coincide, and none that is nearly the identity."""
    left = np.arange(len(image_rows))
    kept, last = [], np.arange(len(distances))
    while len(left := left[distances[last, image_rows[left]].mean(axis=1) >= SAME_START]):
        last = image_rows[left[0]]
        kept.append(left[0])
        left = left[1:]
    return image_rows[np.array(kept, dtype=np.int64)]


def _assignments(distances: FloatArray, anchors: IntArray) -> IntArray:
    """Rows (h, m) that m anchors are assigned to, with like distances; no two alike, none near the identity."""
    remoteness = distances.mean(axis=1)
    exact = distances[np.ix_(anchors, anchors)]
    unary = 0.5 * np.abs(remoteness - remoteness[anchors, None])
    sides = Intervals(exact, exact), Intervals(distances, distances)
    assigned, _ = assign_points(*sides, unary, EXACTLY, BEAM, LEAST_MOVED)
    moved = distances[assigned, anchors].mean(axis=1)
    return np.asarray(assigned[moved > LEAST_MOVED])
