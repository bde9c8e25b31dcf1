"""First maps of a part: images of its anchors, from a beam search and trilateration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import chain
from operator import attrgetter

import numpy as np

from isomatch._core.arrays import (
    BodyVertices,
    Float,
    FloatArray,
    Int,
    IntArray,
    PartVertices,
    SearchRows,
    single,
)
from isomatch._core.cached import cached_method
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Intervals, assign_points, grow_regions, pin_first, trilaterate
from isomatch.descriptors import BallSignature, deviation_of
from isomatch.matching.maps import Candidate
from isomatch.matching.parameters import MAP_DISTANCE, PART_SEARCH
from isomatch.matching.partial.part_pair import (
    PartPair,
    WholeSignatures,
    areas_of_samples,
    shrink_to_neutral,
)
from isomatch.matching.problem import Problem
from isomatch.matching.proposals.flips import find_flips
from isomatch.matching.selection import keep_distinct
from isomatch.settings import Config
from isomatch.shapes import SAME_SYMMETRY, PreparedShape


@dataclass(frozen=True, eq=False)
class PartStart:
    """Images of the anchors of a part, in the unit that they measure."""

    pair: PartPair
    images: Int[BodyVertices, "m"]
    cost: float  # cost by distances, areas of balls and signatures

    def extend(self, vertices: Int[PartVertices, "q"]) -> Int[BodyVertices, "q"]:
        """Map vertices of the part by trilateration from the images of all anchors."""
        whole = self.pair.whole
        to_samples = whole.distances.between(self.images, whole.sample_vertices)
        return _trilaterate_points(self.pair, self.pair.intervals(vertices), to_samples)


def _trilaterate_points(pair: PartPair, points: Intervals, to_samples: FloatArray) -> BodyVertices:
    """Map points by trilateration from the distances of anchors' images to samples."""
    distances = np.maximum(to_samples, 0.0)
    rows, _ = trilaterate(points, Intervals(distances, distances), pair.cost)
    return BodyVertices(pair.whole.sample_vertices[rows])


def complete_anchors(
    pair: PartPair,
    images: Int[BodyVertices, "q"],
    rounds: int,
    to_samples: Callable[[BodyVertices], FloatArray] | None = None,
) -> Int[BodyVertices, "m"]:
    """Map all anchors by repeated trilateration from known images (−1: unknown)."""
    to_samples = to_samples or partial(pair.whole.distances.between, columns=pair.whole.sample_vertices)
    for _ in range(rounds):
        rows = np.flatnonzero(images >= 0)
        points = pair.anchor_intervals.at(rows, np.arange(len(pair.anchors)))
        images = _trilaterate_points(pair, points, to_samples(BodyVertices(images[rows])))
        images[: len(pair.landmarks)] = pair.landmarks
    return images


def compose_with_self_map(
    whole: PreparedShape, images: Int[BodyVertices, "q"], image_row: Int[SearchRows, "m_t"]
) -> Int[BodyVertices, "q"]:
    """Compose images with a self-map of the whole, which exchanges its sides, or front and back."""
    vertices = whole.sample_vertices[: whole.config.n_search]
    rows = whole.distances.between(images, vertices).argmin(axis=1)
    return BodyVertices(vertices[image_row[rows]])


class PartStarts:
    """The search for images of anchors in several units, also composed with self-maps."""

    def __init__(self, pair: PartPair, signatures: WholeSignatures, self_maps: list[SearchRows]) -> None:
        self._pair, self._signatures, self._self_maps = pair, signatures, self_maps
        whole = pair.whole
        samples = whole.sample_vertices[: PART_SEARCH.n_candidates]
        points = samples, whole.extremities, whole.column_vertices, pair.landmarks
        self._candidates = np.unique(np.concatenate(points))
        self._places = np.union1d(whole.sample_vertices, self._candidates)
        self._to_samples = single(whole.distances.between(self._places, whole.sample_vertices))
        areas = areas_of_samples(whole, whole.sample_vertices)
        # areas of the balls around all places; one column for each radius
        self._balls = np.stack([(self._to_samples < r) @ areas for r in PART_SEARCH.ball_radii], axis=1)
        self._areas = areas_of_samples(pair.part, pair.part.sample_vertices)
        self._at = lru_cache(pair.with_unit)
        self._mean_signatures = np.abs(signatures.values).mean(axis=0)
        self._same_distance = MAP_DISTANCE.other_map
        if len(pair.landmarks):
            self._same_distance = PART_SEARCH.same_assignment_with_landmarks

    def __call__(self) -> list[PartStart]:
        """Search distinct starts, least cost first."""
        assigned = chain(*parallel_map(self._assign_anchors, self._pair.units))
        best = sorted(assigned, key=attrgetter("cost"))[: PART_SEARCH.n_trilaterated]
        starts = parallel_map(lambda start: self._complete_start(start.pair, start.images, 3), best)
        kept = self._keep_distinct(sorted(starts, key=attrgetter("cost")), PART_SEARCH.n_starts)
        mirrored = [
            (start.pair, compose_with_self_map(start.pair.whole, start.images, image_row))
            for start in kept
            for image_row in self._self_maps
        ]
        more = parallel_map(lambda start: self._complete_start(*start, 2), mirrored)
        # first maps that exchange left and right cost as little as right ones; later steps decide between them
        both = sorted([*kept, *more], key=attrgetter("cost"))
        return [*self._keep_distinct(both, PART_SEARCH.n_starts_with_composed), *self._grow_starts()]

    def _grow_starts(self) -> list[PartStart]:
        """Grow regions from anchors far from the boundary, at the most similar candidates."""
        pair, candidates, whole = self._at(min(self._pair.unit, 1.0)), self._candidates, self._pair.whole
        if whole.balls is None or len(pair.landmarks):
            return []
        descriptor_distance = self._descriptor_distances(pair, whole.balls)
        roots = np.argsort(-pair.to_boundary[pair.anchors], kind="stable")[: PART_SEARCH.n_roots]
        order = np.argsort(descriptor_distance[roots], axis=1, kind="stable")
        likely = order[:, : PART_SEARCH.n_root_candidates]
        seeds = np.column_stack([np.repeat(roots, likely.shape[1]), likely.ravel()])
        unary = PART_SEARCH.descriptor_gain * (descriptor_distance - PART_SEARCH.neutral_descriptor_distance)
        bounds = PART_SEARCH.near_distance, PART_SEARCH.max_distance_cost
        regions, gains = grow_regions(*self._sides(pair), unary, seeds, pair.cost, *bounds)
        best = regions[np.argsort(-gains, kind="stable")[: PART_SEARCH.max_grown_regions]]
        images = BodyVertices(np.where(best >= 0, candidates[best], -1))
        starts = parallel_map(lambda row: self._complete_start(pair, row, 2), images)
        return self._keep_distinct(starts, PART_SEARCH.n_starts_from_regions)

    def _sides(self, pair: PartPair) -> tuple[Intervals, Intervals]:
        """Distances between the anchors, and between the candidates."""
        distances = self._pair.whole.distances_between(self._candidates)
        return pair.anchor_intervals, Intervals(distances, distances)

    def _descriptor_distances(
        self, pair: PartPair, of_whole: BallSignature
    ) -> Float[FloatArray, "m candidates"]:
        """Descriptor distance of anchors and candidates, neutral where little is known."""
        anchors, candidates = pair.signature.at(pair.anchors), of_whole.at(self._candidates)
        n_radii = (anchors.known[:, None] & candidates.known[None]).sum(axis=2)
        a, b = np.indices((len(anchors.values), len(candidates.values))).reshape(2, -1)
        distance = anchors.at(a).descriptor_distance(candidates.at(b), deviation_of(candidates))
        total = np.where(n_radii > 0, distance.reshape(n_radii.shape), 0.0) * n_radii
        neutral = PART_SEARCH.neutral_descriptor_distance, PART_SEARCH.neutral_weight
        return shrink_to_neutral(total, n_radii, *neutral)

    def _assign_anchors(self, unit: float) -> list[PartStart]:
        """Assign the first anchors to candidates in one unit."""
        pair, candidates = self._at(unit), self._candidates
        n = min(PART_SEARCH.n_assigned_anchors, len(pair.anchors))
        unary = self._unary(pair, np.arange(n)[:, None], np.searchsorted(self._places, candidates))
        pin_first(unary, np.searchsorted(candidates, pair.landmarks[:n]))
        rows, costs = assign_points(
            *self._sides(pair), unary, pair.cost, PART_SEARCH.beam_width, self._same_distance
        )
        # For n anchors, the cost Σ_a unary_a + Σ_{a<b} c_ab over the number of pairs, n (n − 1) / 2, is the
        # mean of c_ab plus 2 / (n − 1) × the mean of unary_a. `_complete_start` uses the same weights.
        costs = costs / (n * (n - 1) / 2) + self._unit_cost(unit)
        return [PartStart(pair, BodyVertices(candidates[row]), float(cost)) for row, cost in zip(rows, costs)]

    def _complete_start(self, pair: PartPair, images: BodyVertices, rounds: int) -> PartStart:
        """Complete the images of anchors (−1: unknown), and again in the unit that they measure."""
        images = complete_anchors(pair, images, rounds, self._distances_to_samples)
        scaled = self._at(pair.unit_of(images))
        if scaled.unit != pair.unit:
            images = complete_anchors(scaled, images, 1, self._distances_to_samples)
        unary = self._unary(scaled, np.arange(len(images)), np.searchsorted(self._places, images))
        unary[: len(scaled.landmarks)] = 0.0
        mean_unary = unary.mean() * 2 / (PART_SEARCH.n_assigned_anchors - 1)
        cost = scaled.stress(images) + mean_unary + self._unit_cost(scaled.unit)
        return PartStart(scaled, images, float(cost))

    def _unit_cost(self, unit: float) -> float:
        """Cost of a unit that differs from the unit of the files."""
        if not self._pair.knows_unit:
            return 0.0
        return float(PART_SEARCH.unit_change_weight * np.log(unit / self._pair.unit) ** 2)

    def _keep_distinct(self, starts: list[PartStart], most: int) -> list[PartStart]:
        distances = self._pair.whole.mean_distances
        return keep_distinct(starts, lambda start: start.images, distances, self._same_distance, most)

    def _distances_to_samples(self, places: Int[BodyVertices, "q"]) -> Float[FloatArray, "q samples"]:
        """Distances from places, given as vertices, to the samples of the whole."""
        return self._to_samples[np.searchsorted(self._places, places)]

    def _unary(self, pair: PartPair, anchors: IntArray, places: IntArray) -> FloatArray:
        """Cost of sending anchors to places (numbers), by areas of balls and signatures."""
        least, most = self._balls_of_part(pair)
        # The error of the area of a ball is divided by the mean area of such balls. The difference between
        # signatures is weighted by how little the boundary disturbs them, and divided by twice the mean size.
        below = least[anchors] * (1 - PART_SEARCH.ball_tolerance) - self._balls[places]
        above = self._balls[places] - most[anchors] * (1 + PART_SEARCH.ball_tolerance)
        violation = np.maximum(np.maximum(below, above), 0.0) / self._balls.mean(axis=0)
        cost = np.asarray(np.minimum(violation, PART_SEARCH.max_ball_cost).mean(axis=-1))
        of_part, weights = (values[anchors] for values in self._signatures.of_anchors(pair))
        of_whole = self._signatures.values
        distance = weights * np.abs(of_part - of_whole[self._places[places]]) / (2 * self._mean_signatures)
        cost += PART_SEARCH.signature_weight * np.minimum(distance, 1.0).mean(axis=-1)
        return cost

    @cached_method
    def _balls_of_part(self, pair: PartPair) -> tuple[Float[FloatArray, "m q"], Float[FloatArray, "m q"]]:
        """Least and greatest areas of the balls of all radii around the anchors."""
        # The ball of radius r around x on the whole consists of all y with D(x, y) < r, where lower ≤ D ≤
        # upper. So
        #     area{upper < r} ≤ area of the ball ≤ area{lower < r} + area missing from the part,
        # where the last term is added only if the boundary is closer to x than r.
        radii, samples = np.array(PART_SEARCH.ball_radii), PartVertices(pair.part.sample_vertices)
        areas = self._areas * pair.share
        lower, upper = pair.intervals(samples)
        least = np.stack([(upper < r) @ areas for r in radii], axis=1)
        most = np.stack([(lower < r) @ areas for r in radii], axis=1)
        most += (radii > pair.to_boundary[pair.anchors, None]) * max(1 - pair.share, 0.0)
        return least, most


def find_self_maps(whole: PreparedShape, config: Config) -> list[Int[SearchRows, "m_t"]]:
    """Find distinct self-maps of the whole: symmetries, and flips of the identity."""
    pair = Problem(whole, whole, config)
    rows = np.arange(len(pair.source_vertices))
    identity = Candidate.of_rows(SearchRows(rows), "identity")
    image_rows = [SearchRows(symmetry.image_row) for symmetry in whole.symmetries]
    image_rows += [flip.target_row for flip in find_flips(pair, identity, [identity])]
    return keep_distinct(image_rows, lambda image_row: image_row, pair.distances_between_maps, SAME_SYMMETRY)
