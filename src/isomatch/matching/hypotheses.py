"""Many cheap candidate maps, so that the true one is among them: starts, flips and compositions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map
from isomatch.matching.alignment import Alignment, icp
from isomatch.matching.initial import images_from_rotation, rotation_from_functions, rotations_from_landmarks
from isomatch.matching.pair import Pair
from isomatch.matching.prepare import PreparedShape

FEATURE_COUNTS = (4, 5, 6)  # extremal points matched at once
FEATURES_AMONG = 7  # extremal points of the other shape they may go to
STARTS_PER_SET = 8
SAME_START = 0.02  # mean distance, in √area, below which two starts are one
SAME_MAP = 0.05  # and below which two converged maps are one
POOL = 14
SIGNATURE_STEPS, DISTANCE_STEPS, SHORT_STEPS = 4, 8, 4
GROUP = 4  # maps moved at once by a thread
ROUND = 2  # steps between comparisons of the maps under way
SIGNATURE_SHARE = 2.0  # weight of point signatures against descriptors in the first steps
FLIPPED_PARENTS = 3
FLIPPED_COLUMNS = 10
FLIPPED_FUNCTIONS = 20
COMPOSED = 6  # best maps of which triples are composed
RECOMPOSED = 10  # the same in a second round, where the first led to a poor map
TURNED = 6  # the same among a winner and its flips


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A candidate map on the search vertices.

    Parameters
    ----------
    alignment : Alignment
        Image, rotation and residual after iterative closest points.
    origin : str
        Where it came from: "features", "landmarks", "initial map", "descriptors", "distance flip", "laplace flip",
        "composition".
    flipped : bool
        Whether it came of flips, or its own flips were tried.
    """

    alignment: Alignment
    origin: str
    flipped: bool = False


def feature_assignments(source: PreparedShape, target: PreparedShape) -> list[tuple[IntArray, IntArray]]:
    """Assign extremal points to extremal points so that their distances agree.

    Returns
    -------
    list of (source vertices, target vertices)
        Body vertices; the best of every count of points and both directions, repetitions removed.
    """
    found: dict[tuple[tuple[int, int], ...], None] = {}
    for count in FEATURE_COUNTS:
        for forward in (True, False):
            a, b = (source, target) if forward else (target, source)
            for few, among in _consistent_assignments(a, b, count):
                pairs = zip(few, among) if forward else zip(among, few)
                found.setdefault(tuple(sorted((int(i), int(j)) for i, j in pairs)))
    return [(np.array([i for i, _ in pairs]), np.array([j for _, j in pairs])) for pairs in found]


def _consistent_assignments(
    a: PreparedShape, b: PreparedShape, count: int
) -> Iterable[tuple[IntArray, IntArray]]:
    few, among = a.features[:count], b.features[:FEATURES_AMONG]
    if len(few) < count or len(among) < count:
        return []
    choices = np.array(list(permutations(range(len(among)), count)))  # (c, count)
    d_few = a.feature_columns[:count][:, few] / a.intrinsic_scale
    d_among = b.feature_columns[: len(among)][:, among] / b.intrinsic_scale
    remote_few = a.average_distance[few] / a.intrinsic_scale
    remote_among = b.average_distance[among] / b.intrinsic_scale
    cost = np.abs(d_few - d_among[choices[:, :, None], choices[:, None, :]]).mean(axis=(1, 2))
    cost += 0.3 * np.abs(remote_few - remote_among[choices]).mean(axis=1)
    best = np.argsort(cost, kind="stable")[:STARTS_PER_SET]
    return [(few, among[choices[c]]) for c in best]


def feature_starts(pair: Pair) -> list[IntArray]:
    """First maps from every assignment of extremal points."""
    source, target = pair.source.shape, pair.target.shape
    assignments = feature_assignments(source, target)
    rotations: list[FloatArray] = []
    for count in FEATURE_COUNTS:
        group = [(i, j) for i, j in assignments if len(i) == count]
        if group:
            at_source, at_target = (np.array(points) for points in zip(*group))
            rotations.extend(rotations_from_landmarks(target.cloud, source.cloud, at_target, at_source))
    return parallel_map(lambda c: images_of_rotation(pair, c), rotations)


def converged(pair: Pair, image: IntArray) -> Alignment:
    """Run iterative closest points on the distance descriptors alone."""
    return icp(pair.target.cloud, pair.source.cloud, image[None], DISTANCE_STEPS)[0]


def search(pair: Pair, given: list[Hypothesis]) -> list[Hypothesis]:
    """Collect distinct candidate maps, best residual first.

    Parameters
    ----------
    pair : Pair
        The two shapes.
    given : list of Hypothesis
        Maps from what the user knows.

    Returns
    -------
    list of Hypothesis
        Those given, maps from extremal points, flips of the leading basis functions (left and right, front and back)
        and compositions of maps found (a ∘ b⁻¹ ∘ c reaches the fourth variant from three).
    """
    pool = _Pool(pair)
    pool.merge(given)
    share = SIGNATURE_SHARE * np.sqrt((pair.source.cloud.coordinates**2).sum(axis=1).mean() / 2)
    of_target, of_source = pair.signatures
    signatures = share * of_target[pair.target.rows], share * of_source[pair.source.rows]
    guided = pool.settled(feature_starts(pair), SIGNATURE_STEPS, signatures)
    pool.add([alignment.image for alignment in guided], DISTANCE_STEPS, "features")
    if not pool.hypotheses:
        return []
    pool.flip(pool.hypotheses[:FLIPPED_PARENTS])
    pool.compose(COMPOSED)
    return pool.hypotheses


def recomposed(pair: Pair, found: list[Hypothesis]) -> list[Hypothesis]:
    """Compose once more, among more maps, compositions too; give those that differ from all that were found.

    The right map can be composed of three that are each wrong about other limbs.
    """
    pool = _Pool(pair)
    pool.merge(found)
    pool.compose(RECOMPOSED)
    images = [h.alignment.image for h in found]
    return [
        h for h in pool.hypotheses if h not in found and pair.differs(h.alignment.image, images, SAME_MAP)
    ]


def twins(pair: Pair, winner: Hypothesis, known: list[Hypothesis]) -> list[Hypothesis]:
    """Find maps that flips of one basis function, and their compositions, make of the winner, other than those known.

    They are the half-turned and mirrored maps most easily taken for it, or it for them. None if it was flipped before.
    """
    if winner.flipped:
        return []
    pool = _Pool(pair)
    pool.merge([winner])
    pool.flip([winner])  # gives mirror images
    pool.compose(TURNED)  # and of these half turns
    images = [h.alignment.image for h in known]
    return [h for h in pool.hypotheses if pair.differs(h.alignment.image, images, SAME_MAP)]


class _Pool:
    """The best distinct hypotheses so far."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        self.hypotheses: list[Hypothesis] = []

    def add(self, images: list[IntArray], steps: int, origin: str) -> None:
        """Settle first maps and merge what comes of them."""
        flipped = origin != "features"
        self.merge([Hypothesis(alignment, origin, flipped) for alignment in self.settled(images, steps)])

    def flip(self, parents: list[Hypothesis]) -> None:
        """Add what comes of turning the sign of a basis function, of either basis, in each of some maps."""
        pair, maps = self._pair, [parent.alignment for parent in parents]
        self.hypotheses = [replace(h, flipped=True) if h in parents else h for h in self.hypotheses]
        flips = [(parent, j) for parent in maps for j in range(FLIPPED_COLUMNS)]
        self.add(
            parallel_map(lambda flip: _distance_flip(pair, *flip), flips), DISTANCE_STEPS, "distance flip"
        )
        spectral = [pair.functional_map(pair.upsampled(p.image, (20,) * 3), FLIPPED_FUNCTIONS) for p in maps]
        turned = [(c, j) for c in spectral for j in range(2, FLIPPED_FUNCTIONS)]
        self.add(parallel_map(lambda flip: _laplace_flip(pair, *flip), turned), SHORT_STEPS, "laplace flip")

    def compose(self, count: int) -> None:
        """Add what comes of a ∘ b⁻¹ ∘ c for triples of the best maps."""
        best = [h.alignment.rotation for h in self.hypotheses[:count]]
        n = range(len(best))
        triples = [
            (a, b, c) for a in n for b in n for c in n if a < c and b not in (a, c) and min(a, b, c) < 2
        ]
        composed = [best[a] @ best[b].T @ best[c] for a, b, c in triples]
        images = parallel_map(lambda rotation: images_of_rotation(self._pair, rotation), composed)
        self.add(images, SHORT_STEPS, "composition")

    def settled(
        self, images: list[IntArray], steps: int, extra: tuple[FloatArray, FloatArray] | None = None
    ) -> list[Alignment]:
        """Run iterative closest points from many first maps; one that meets another, or a known map, is dropped.

        Most starts lead to few maps: comparing them after every round saves most of the steps.
        """
        source, target = self._pair.source.cloud, self._pair.target.cloud
        alignments: list[Alignment] = []
        for _ in range(0, steps, ROUND):
            images = self._distinct(images)
            groups = [np.array(images[i : i + GROUP]) for i in range(0, len(images), GROUP)]
            moved = parallel_map(lambda group: icp(target, source, group, ROUND, extra), groups)
            alignments = [alignment for group in moved for alignment in group]
            images = [alignment.image for alignment in alignments]
        return alignments

    def _distinct(self, images: list[IntArray]) -> list[IntArray]:
        known = [h.alignment.image for h in self.hypotheses]
        kept: list[IntArray] = []
        for image in images:
            if self._pair.differs(image, [*known, *kept], SAME_START):
                kept.append(image)
        return kept

    def merge(self, new: list[Hypothesis]) -> None:
        """Take in hypotheses; of maps that nearly coincide the one of smallest residual is kept."""
        kept: list[Hypothesis] = []
        for hypothesis in sorted([*self.hypotheses, *new], key=lambda h: h.alignment.residual):
            image = hypothesis.alignment.image
            if len(kept) < POOL and self._pair.differs(image, [h.alignment.image for h in kept], SAME_MAP):
                kept.append(hypothesis)
        self.hypotheses = kept


def images_of_rotation(pair: Pair, rotation: FloatArray) -> IntArray:
    """First map from a rotation of the leading columns."""
    return images_from_rotation(pair.target.cloud, pair.source.cloud, rotation)


def start_from_functions(pair: Pair, of_source: FloatArray, of_target: FloatArray) -> IntArray:
    """First map from functions on the bodies that should correspond, (n_s, q) and (n_t, q)."""
    source, target = pair.source.shape, pair.target.shape
    weights = target.body.vertex_areas, source.body.vertex_areas
    return images_of_rotation(
        pair, rotation_from_functions(target.cloud, source.cloud, of_target, of_source, *weights)
    )


def _distance_flip(pair: Pair, parent: Alignment, column: int) -> IntArray:
    rotation = parent.rotation.copy()
    rotation[:, min(column, rotation.shape[1] - 1)] *= -1
    return images_of_rotation(pair, rotation)


def _laplace_flip(pair: Pair, functional_map: FloatArray, function: int) -> IntArray:
    size = max(function + 1, 4)
    flipped = functional_map[:size, :size].copy()
    flipped[function] *= -1
    return pair.upsampled(pair.image_of(flipped), range(size, FLIPPED_FUNCTIONS + 1, 2))
