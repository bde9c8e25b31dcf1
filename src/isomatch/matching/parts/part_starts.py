"""First maps of a part: images of its anchors, by a beam search and trilateration."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map
from isomatch.correspondence import Alignment, assign_points, trilaterate
from isomatch.matching.config import Config
from isomatch.matching.pair import ShapePair
from isomatch.matching.parts.part_pair import COST, PartPair, areas_of_samples
from isomatch.matching.parts.part_signatures import PartSignatures
from isomatch.matching.prepare import PreparedShape
from isomatch.matching.search import Hypothesis, flips

BALL_TOLERANCE = 0.15
MOST_BALL = 0.7
FORBIDDEN = 50.0  # cost of another image of a landmark


class PartStarts:
    """The search for images of the anchors, and of what they become under maps of the whole onto itself."""

    def __init__(self, pair: PartPair, signatures: PartSignatures, onto_itself: list[IntArray]) -> None:
        self._pair, self._signatures, self._self_maps = pair, signatures, onto_itself
        self._settings = pair.config.parts
        self._fine = pair.whole.sample_vertices
        whole = pair.whole
        self._candidates = np.unique(
            np.concatenate(
                [
                    whole.sample_vertices[: self._settings.n_candidates],
                    whole.extremities,
                    whole.column_vertices,
                    pair.landmarks,
                ]
            )
        )

    def __call__(self) -> list[IntArray]:
        """Images (m,) of the anchors, least stress first; no two alike."""
        pair, settings = self._pair, self._settings
        lower, upper = pair.anchor_intervals
        placed = min(settings.n_placed, len(pair.anchors))
        assigned = assign_points(
            pair.whole.distances_between(self._candidates),
            lower,
            upper,
            self._unary()[:placed],
            COST,
            settings.width,
            settings.apart,
        )
        first = [self._candidates[row] for row in assigned[: settings.n_trilaterated]]
        complete = parallel_map(lambda images: self.completed(images, 3), first)
        kept = self._distinct(complete, settings.n_starts)
        mirrored = [self._mirrored(images) for images in kept]
        more = [images for group in mirrored for images in group]
        return self._distinct(
            [*kept, *parallel_map(lambda images: self.completed(images, 2), more)], settings.n_mirrored
        )

    def completed(self, images: IntArray, rounds: int) -> IntArray:
        """Trilaterate all anchors from the images of the first ones, several times."""
        pair = self._pair
        lower, upper = pair.anchor_intervals
        for _ in range(rounds):
            m = len(images)
            there = np.maximum(pair.whole.distances.between(images, self._fine), 0.0)
            images = self._fine[trilaterate(lower[:, :m], upper[:, :m], there, COST)]
            images[: len(pair.landmarks)] = pair.landmarks
        return images

    def dense(self, images: IntArray, vertices: IntArray) -> IntArray:
        """Trilaterate vertices (r,) of the part from the images of all anchors: vertices of the whole."""
        lower, upper = self._pair.intervals(vertices)
        there = np.maximum(self._pair.whole.distances.between(images, self._fine), 0.0)
        return self._fine[trilaterate(lower.T, upper.T, there, COST)]

    def _distinct(self, found: list[IntArray], most: int) -> list[IntArray]:
        pair = self._pair
        kept: list[IntArray] = []
        for images in sorted(found, key=pair.stress):
            if all(pair.whole.mean_distance(images, known) > self._settings.apart for known in kept):
                kept.append(images)
            if len(kept) == most:
                break
        return kept

    def _mirrored(self, images: IntArray) -> list[IntArray]:
        """Compose with maps of the whole nearly onto itself, which exchange its sides, or its front and back."""
        rows = self._pair.whole.sample_vertices[: self._pair.whole.config.n_search]
        near = self._pair.whole.distances.between(images, rows).argmin(axis=1)
        composed: list[IntArray] = [rows[image_row[near]] for image_row in self._self_maps]
        return composed

    def _unary(self) -> FloatArray:
        """Cost (m, c) of each image of each anchor: areas of balls, and signatures."""
        pair, radii = self._pair, np.array(self._settings.radii)
        part, whole = pair.part, pair.whole
        samples = part.sample_vertices
        areas = areas_of_samples(part, samples) * pair.share
        lower, upper = pair.intervals(samples)
        least = np.stack([(upper < r) @ areas for r in radii], axis=1)
        most = np.stack([(lower < r) @ areas for r in radii], axis=1)
        most += (radii > pair.to_boundary[pair.anchors, None]) * max(1 - pair.share, 0.0)
        areas = areas_of_samples(whole, self._fine)
        there = whole.distances.between(self._candidates, self._fine)
        balls = np.stack([(there < r) @ areas for r in radii], axis=1)
        below, above = (
            least[:, None] * (1 - BALL_TOLERANCE) - balls,
            balls - most[:, None] * (1 + BALL_TOLERANCE),
        )
        violation = np.maximum(np.maximum(below, above), 0.0) / balls.mean(axis=0)
        cost = np.asarray(np.minimum(violation, MOST_BALL).mean(axis=2))
        of_part, of_whole, weights = self._signatures
        apart = np.abs(of_part[pair.anchors, None] - of_whole[self._candidates]) * weights[pair.anchors, None]
        apart /= 2 * np.abs(of_whole).mean(axis=0)
        cost += self._settings.signature_cost * np.minimum(apart, 1.0).mean(axis=2)
        led = np.arange(len(pair.landmarks))
        cost[led] = FORBIDDEN
        cost[led, np.searchsorted(self._candidates, pair.landmarks)] = 0.0
        return cost


def self_maps(whole: PreparedShape, config: Config) -> list[IntArray]:
    """Symmetries of the whole and flips of its identity: rows (r,) that its search vertices go to."""
    pair = ShapePair(whole, whole, config)
    rows = np.arange(len(pair.source_vertices))
    identity = Hypothesis(Alignment(rows, np.eye(1), 0.0), "identity")
    found = [each.image_row for each in whole.symmetries]
    found += [flip.target_row for flip in flips(pair, identity, [identity])]
    distinct: list[IntArray] = []
    for image_row in found:
        if pair.differs(image_row, distinct, config.symmetry.same_map):
            distinct.append(image_row)
    return distinct
