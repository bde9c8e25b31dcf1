"""Regions that two parts may have in common: grown from seeds, and extended to the samples by trilateration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from isomatch.correspondence import (
    IntervalCost,
    grow_common_regions,
    pin_first,
    trilaterate_common,
)
from isomatch.matching.relations.both_looks import USUAL, BothLooks, signed_triangles
from isomatch.matching.search import FromAnchors
from isomatch.runtime.threads import parallel_map
from isomatch.values.arrays import BoolArray, IntArray

# all chosen on two parts of SHREC'16, not one by one; docs/lab/design_notes.md
N_ANCHORS, N_CANDIDATES = 56, 300  # samples of the source that grow regions, and of the target where they go
N_ROOTS, N_LIKELY = 40, 30  # anchors deepest inside from which regions grow, and candidates of each
COST = IntervalCost(tolerance=0.1, inside=0.1, most=0.5, soft=0.15)
NEAR, DEAREST = 0.2, 0.09  # see `grow_common_regions`
WIDTH, VARIANTS_APART = 4, 0.12
LIKELY_GAINS = 2.0, 0.5  # of an anchor that looks alike, against one whose distances agree

FEWEST_GROWN = 5  # anchors of a region
SAME_REGION, FEWEST_COMMON = 0.1, 3  # mean distance of images, and anchors in common, of regions that are one

# mean distance of images, and share of samples in both, of maps that become one
SAME_MAP, SAME_SHARE = 0.05, 0.7

N_SCREENED = 400  # regions that are extended
RANKS = (150, 1, 80), (300, 2, 30)  # samples to which they are extended, rounds, and how many remain

# cost of a sample, also where landmarks lead, so that little is wrong; and how far it may be from where it returns to
ACCEPTED, LED_ACCEPTED, ROUND_TRIP = 0.06, 0.12, 0.12

EXTENSION_NEAR = 0.15  # see `trilaterate_common`
FIRST_ANCHORS, NEXT_ANCHORS = 50, 90  # samples from which others are trilaterated once more
FEWEST_ACCEPTED, FEWEST_SAMPLES = 8, 25  # samples of a region on the way, and in the end
ORIENTED = 0.2  # mean sign of triangles, below which a region is taken for a mirror image


@dataclass(frozen=True, eq=False)
class CommonRegion:
    """A region of the source with its images.

    Parameters
    ----------
    images : (r,) array of int
        Vertex of the target's body for each sample.
    accepted : (r,) array of bool
        Which samples are in the region.
    worth : float
        See `BothLooks.worth`; while only some samples are placed, without what counts against it.
    orientation : float
        Mean sign of its small triangles.
    origin : str
        Where it came from.
    """

    images: IntArray
    accepted: BoolArray
    worth: float
    orientation: float
    origin: str


class CommonRegions(BothLooks):
    """The search of regions that two parts have in common.

    Parameters
    ----------
    source, target : BothSide
        The parts.
    """

    def grown(self) -> list[IntArray]:
        """Grow regions: for each that differs from those before, the candidates (m,) of the anchors, −1 for none."""
        source, target = self.source, self.target
        rows = np.arange(min(N_ANCHORS, len(source.vertices)))
        columns = np.arange(min(N_CANDIDATES, len(target.vertices)))
        alone = self.alike(rows, columns)
        roots = np.argsort(-source.to_boundary[source.vertices[rows]], kind="stable")[:N_ROOTS]
        likely = np.argsort(alone[roots], axis=1, kind="stable")[:, :N_LIKELY]
        seeds = np.column_stack([np.repeat(roots, likely.shape[1]), likely.ravel()])
        here, there = source.intervals.at(rows, rows), target.intervals.at(columns, columns)
        ranked = []
        for weight in LIKELY_GAINS:
            unary = weight * (alone - USUAL)
            if n := len(source.landmarks):
                pin_first(unary, np.arange(n))
                seeds = np.column_stack([np.arange(n)] * 2)
            found, gains = grow_common_regions(
                here, there, unary, seeds, COST, NEAR, DEAREST, WIDTH, VARIANTS_APART
            )
            ranked.append(found[np.argsort(-gains, kind="stable")])
        return self._distinct(np.stack(ranked, axis=1).reshape(-1, len(rows)))

    def _distinct(self, found: IntArray) -> list[IntArray]:
        """Keep the first regions that differ."""
        distances = self.target.intervals.upper
        kept = np.zeros((N_SCREENED, found.shape[1]), dtype=np.int64)
        n = 0
        for region in found[(found >= 0).sum(axis=1) >= FEWEST_GROWN]:
            if n == N_SCREENED:
                break
            both = (region >= 0) & (kept[:n] >= 0)
            common = both.sum(axis=1)
            apart = np.where(both, distances[region, kept[:n]], 0.0).sum(axis=1)
            if not ((common >= FEWEST_COMMON) & (apart < SAME_REGION * common)).any():
                kept[n] = region
                n += 1
        return list(kept[:n])

    def _extended_from(self, start: tuple[IntArray, IntArray], n: int, rounds: int) -> CommonRegion | None:
        """Trilaterate the first n samples from some, with images among those of the target; None if few agree."""
        source, target, (rows, columns) = self.source, self.target, start
        most = LED_ACCEPTED if len(source.landmarks) else ACCEPTED
        for _ in range(rounds):
            placed, accepted = self.placed(rows, columns, n, most)
            if accepted.sum() < FEWEST_ACCEPTED:
                return None
            rows = np.flatnonzero(accepted)[: FIRST_ANCHORS if n < len(source.vertices) else NEXT_ANCHORS]
            columns = placed[rows]
        return self.region(target.vertices[placed], accepted)

    def placed(self, rows: IntArray, columns: IntArray, n: int, most: float) -> tuple[IntArray, BoolArray]:
        """Trilaterate the first n samples from some, with images among those of the target.

        Returns samples of the target, (n,), and which agree, at most at a cost, and return to near where they came from.
        Landmarks go where they are known to.
        """
        source, target = self.source, self.target
        everything, there = np.arange(min(n, len(source.vertices))), np.arange(min(n, len(target.vertices)))
        of_source, of_target = source.intervals.at(rows, everything), target.intervals.at(columns, there)
        placed, costs = trilaterate_common(of_source, of_target, EXTENSION_NEAR, COST)
        back, _ = trilaterate_common(of_target, of_source, EXTENSION_NEAR, COST)
        returned = source.intervals.upper[everything, back[placed]]
        accepted = (costs < most) & (returned < ROUND_TRIP)
        known = np.arange(len(source.landmarks))
        placed[known], accepted[known] = known, True
        return placed, accepted

    def region(self, images: IntArray, accepted: BoolArray) -> CommonRegion:
        """Measure a region of the first samples (n,), by the images of all of them."""
        inside = np.flatnonzero(accepted)
        everywhere = len(accepted) == len(self.source.vertices)
        worth = (self.worth if everywhere else self.evidence)(inside, images[inside])
        orientation = signed_triangles(self.source, inside, self.target, images[inside])
        origin = "landmarks" if len(self.source.landmarks) else FromAnchors.name
        return CommonRegion(images, accepted, worth, orientation, origin)

    def best(self, count: int) -> list[CommonRegion]:
        """Return the regions that are worth most, extended to all samples: a few samples tell which may be."""
        starts = [(rows := np.flatnonzero(region >= 0), region[rows]) for region in self.grown()]
        marks = np.arange(len(self.source.landmarks))
        if len(marks):
            starts.insert(0, (marks, marks))
        regions: list[CommonRegion] = []
        for n, rounds, most in (*RANKS, (len(self.source.vertices), 2, count)):
            extend = partial(self._extended_from, n=n, rounds=rounds)
            ranked = [
                (region, start)
                for region, start in zip(parallel_map(extend, starts), starts)
                if region is not None and region.orientation > ORIENTED
            ]
            ranked.sort(key=lambda each: -each[0].worth)
            starts = [start for _, start in ranked[:most]]
            regions = [region for region, _ in ranked]
        large = [region for region in regions if region.accepted.sum() >= FEWEST_SAMPLES]
        if len(marks) and not large:  # all that can be said is where the landmarks lead
            placed, _ = self.placed(marks, marks, len(self.source.vertices), ACCEPTED)
            large = [self.region(self.target.vertices[placed], np.ones(len(placed), dtype=bool))]
        return self._apart(large)[:count]

    def _apart(self, regions: list[CommonRegion]) -> list[CommonRegion]:
        """Keep the first regions whose images differ."""
        target, kept = self.target, list[CommonRegion]()
        for region in regions:
            for other in kept:
                both = region.accepted & other.accepted
                far = target.unit * target.shape.distance(region.images[both], other.images[both])
                if both.sum() > SAME_SHARE * region.accepted.sum() and far.mean() < SAME_MAP:
                    break
            else:
                kept.append(region)
        return kept

    def given(self, image: IntArray, known: BoolArray, origin: str) -> CommonRegion:
        """Take the region where a map is known, by its images (n,) of the vertices of the source."""
        vertices = self.source.vertices
        return replace(self.region(image[vertices], known[vertices]), origin=origin)
