"""Many cheap candidate maps, so that the true one is among them: starts, flips and compositions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map
from isomatch.matching.alignment import Alignment, icp
from isomatch.matching.initial import images_from_rotation, rotations_from_landmarks
from isomatch.matching.nearest import nearest_rows
from isomatch.matching.pair import Pair
from isomatch.matching.prepare import PreparedShape

FEATURE_COUNTS = (4, 5, 6)  # extremal points matched at once
FEATURES_AMONG = 7  # extremal points of the other shape they may go to
STARTS_PER_SET = 8
SAME_START = 0.02  # mean distance, in √area, below which two starts are one
SAME_MAP = 0.05  # and below which two converged maps are one
POOL = 14
SIGNATURE_STEPS, DISTANCE_STEPS, SHORT_STEPS = 4, 8, 4
SIGNATURE_SHARE = 2.0  # weight of point signatures against descriptors in the first steps
FLIPPED_PARENTS = 3
FLIPPED_COLUMNS = 10
FLIPPED_FUNCTIONS = 20
COMPOSED = 6


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
    """

    alignment: Alignment
    origin: str


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
    """First maps from every assignment of extremal points; those that coincide are kept once."""
    source, target = pair.source.shape, pair.target.shape
    assignments = feature_assignments(source, target)
    rotations: list[FloatArray] = []
    for count in FEATURE_COUNTS:
        group = [(i, j) for i, j in assignments if len(i) == count]
        if group:
            at_source, at_target = (np.array(points) for points in zip(*group))
            rotations.extend(rotations_from_landmarks(target.cloud, source.cloud, at_target, at_source))
    images = parallel_map(lambda c: images_from_rotation(pair.target.cloud, pair.source.cloud, c), rotations)
    starts: list[IntArray] = []
    for image in images:
        if all(pair.difference(image, other) > SAME_START for other in starts):
            starts.append(image)
    return starts


def converged(pair: Pair, image: IntArray, steps: int = DISTANCE_STEPS) -> Alignment:
    """Run iterative closest points on the distance descriptors alone."""
    return icp(pair.target.cloud, pair.source.cloud, image, steps)


def guided(pair: Pair, image: IntArray) -> Alignment:
    """Run iterative closest points, first with point signatures beside the distances, then without."""
    share = SIGNATURE_SHARE * np.sqrt((pair.source.cloud.points**2).sum(axis=1).mean() / 2)
    signatures = share * pair.target.signatures, share * pair.source.signatures
    first = icp(pair.target.cloud, pair.source.cloud, image, SIGNATURE_STEPS, signatures)
    return converged(pair, first.image)


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
    pool.add(given)
    pool.add(_each(lambda image: guided(pair, image), feature_starts(pair), "features"))
    if not pool.hypotheses:
        return []
    parents = [h.alignment for h in pool.hypotheses[:FLIPPED_PARENTS]]
    flips = [(parent, j) for parent in parents for j in range(FLIPPED_COLUMNS)]
    pool.add(_each(lambda flip: _distance_flip(pair, *flip), flips, "distance flip"))
    maps = [pair.functional_map(pair.upsampled(p.image, (20,) * 3), FLIPPED_FUNCTIONS) for p in parents]
    turned = [(c, j) for c in maps for j in range(2, FLIPPED_FUNCTIONS)]
    pool.add(_each(lambda flip: _laplace_flip(pair, *flip), turned, "laplace flip"))
    best = [h.alignment.rotation for h in pool.hypotheses[:COMPOSED]]
    n = range(len(best))
    triples = [(a, b, c) for a in n for b in n for c in n if a < c and b not in (a, c) and min(a, b, c) < 2]
    pool.add(
        _each(lambda t: _composition(pair, best[t[0]] @ best[t[1]].T @ best[t[2]]), triples, "composition")
    )
    return pool.hypotheses


class _Pool:
    """The best distinct hypotheses so far."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        self.hypotheses: list[Hypothesis] = []

    def add(self, new: list[Hypothesis]) -> None:
        """Merge; of maps that nearly coincide the one of smallest residual is kept."""
        ranked = sorted([*self.hypotheses, *new], key=lambda h: h.alignment.residual)
        kept: list[Hypothesis] = []
        for hypothesis in ranked:
            image = hypothesis.alignment.image
            if len(kept) < POOL and all(
                self._pair.difference(image, other.alignment.image) > SAME_MAP for other in kept
            ):
                kept.append(hypothesis)
        self.hypotheses = kept


def _each(find: Callable[..., Alignment], starts: list, origin: str) -> list[Hypothesis]:  # type: ignore[type-arg]
    return [Hypothesis(found, origin) for found in parallel_map(find, starts)]


def _distance_flip(pair: Pair, parent: Alignment, column: int) -> Alignment:
    rotation = parent.rotation.copy()
    rotation[:, min(column, rotation.shape[1] - 1)] *= -1
    return converged(pair, images_from_rotation(pair.target.cloud, pair.source.cloud, rotation))


def _laplace_flip(pair: Pair, functional_map: FloatArray, function: int) -> Alignment:
    size = max(function + 1, 4)
    flipped = functional_map[:size, :size].copy()
    flipped[function] *= -1
    image = pair.upsampled(pair.image_of(flipped), range(size, FLIPPED_FUNCTIONS + 1, 2))
    return converged(pair, image, SHORT_STEPS)


def _composition(pair: Pair, rotation: FloatArray) -> Alignment:
    image = nearest_rows(pair.target.cloud.points @ rotation, pair.source.cloud.points)
    return converged(pair, image, SHORT_STEPS)
