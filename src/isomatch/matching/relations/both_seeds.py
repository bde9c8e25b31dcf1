"""Regions that two parts may have in common: grown from seeds, and extended to the samples by trilateration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch.correspondence import Intervals, IntervalCost, grow_common_regions, pin_first, trilaterate_common
from isomatch.descriptors import deviation_of
from isomatch.matching.relations.both_side import BothSide
from isomatch.matching.search import FromAnchors
from isomatch.runtime.threads import parallel_map
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_property

# all chosen on two parts of SHREC'16, not one by one; docs/notes/two_parts.md
N_ANCHORS, N_CANDIDATES = 56, 300  # samples of the source that grow regions, and of the target where they go
N_ROOTS, N_LIKELY = 40, 30  # anchors deepest inside from which regions grow, and candidates of each
COST = IntervalCost(tolerance=0.1, inside=0.1, most=0.5, soft=0.15)
NEAR, DEAREST = 0.2, 0.09  # see `grow_common_regions`
WIDTH, VARIANTS_APART = 4, 0.12
LIKELY_GAIN = 2.0  # of an anchor that looks alike, against one whose distances agree
NEUTRAL, PRIOR_RADII = 0.25, 1.5  # mismatch that says nothing, and the number of radii that it counts as
NEUTRAL_AREA, MOST_AREA, PRIOR_AREAS = 0.15, 1.0, 2.0  # the same of the logarithms of areas
LOOKS_WEIGHT, AREAS_WEIGHT = 0.6, 0.5

FEWEST_GROWN = 5  # anchors of a region
SAME_REGION, FEWEST_COMMON = 0.1, 3  # mean distance of images, and anchors in common, of regions that are one
N_SCREENED, N_SCREENING = 150, 300  # regions that are extended, to so many samples
ACCEPTED, ROUND_TRIP = 0.06, 0.12  # cost of a sample, and how far it may be from where it returns to
EXTENSION_NEAR = 0.15  # see `trilaterate_common`
FIRST_ANCHORS, NEXT_ANCHORS = 50, 90  # samples from which others are trilaterated once more
FEWEST_SAMPLES = 25
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
    mismatch : float
        How differently both parts look there.
    area : float
        Of the region, in the unit of both.
    orientation : float
        Mean sign of its small triangles.
    origin : str
        Where it came from.
    """

    images: IntArray
    accepted: BoolArray
    mismatch: float
    area: float
    orientation: float
    origin: str = FromAnchors.name

    @property
    def worth(self) -> float:
        """What the region is worth: large ones that look alike are worth most."""
        return worth(self.area, self.mismatch)


UNLIKE = 0.5  # mismatch from which a region is worth nothing


def worth(area: float, mismatch: float) -> float:
    """Area × (0.5 − mismatch)."""
    return area * (UNLIKE - mismatch)


class CommonRegions:
    """The search of regions that two parts have in common.

    Parameters
    ----------
    source, target : BothSide
        The parts.
    """

    def __init__(self, source: BothSide, target: BothSide) -> None:
        self.source, self.target = source, target

    @cached_property
    def _deviation(self) -> FloatArray:
        return deviation_of(self.source.looks, self.target.looks)

    def mismatches(self, vertices: IntArray, images: IntArray) -> FloatArray:
        """(q,) how differently the parts look around vertices and their images; nan where nothing is known."""
        here, there = self.source.looks.at(vertices), self.target.looks.at(images)
        return here.mismatch(there, self._deviation)

    def mean_mismatch(self, vertices: IntArray, images: IntArray, areas: FloatArray) -> float:
        """Mean of these over the area of what is known; neutral where nothing is."""
        found = self.mismatches(vertices, images)
        known = np.isfinite(found)
        return float(np.average(found[known], weights=areas[known])) if known.any() else UNLIKE

    def alike(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Cost (m, c) of each candidate for each anchor by itself, by looks and areas of balls."""
        here, there = self.source.looks.at(self.source.vertices[rows]), self.target.looks.at(
            self.target.vertices[columns]
        )
        looks = _drawn_to(*_summed(here, there, self._deviation), NEUTRAL, PRIOR_RADII)
        values, known = zip(self.source.ball_areas, self.target.ball_areas)
        both = known[0][rows][:, None] & known[1][columns][None]
        apart = np.minimum(np.abs(values[0][rows][:, None] - values[1][columns][None]), MOST_AREA)
        areas = _drawn_to((apart * both).sum(axis=2), both.sum(axis=2), NEUTRAL_AREA, PRIOR_AREAS)
        return LOOKS_WEIGHT * looks + AREAS_WEIGHT * areas

    def grown(self) -> tuple[IntArray, IntArray]:
        """Grow regions: candidates (s, m) of the anchors, −1 for none, and the order (q,) of those that differ."""
        source, target = self.source, self.target
        rows = np.arange(min(N_ANCHORS, len(source.vertices)))
        columns = np.arange(min(N_CANDIDATES, len(target.vertices)))
        alone = self.alike(rows, columns)
        roots = np.argsort(-source.to_boundary[source.vertices[rows]], kind="stable")[:N_ROOTS]
        likely = np.argsort(alone[roots], axis=1, kind="stable")[:, :N_LIKELY]
        seeds = np.column_stack([np.repeat(roots, likely.shape[1]), likely.ravel()])
        unary = LIKELY_GAIN * (alone - NEUTRAL)
        if n := len(source.landmarks):
            pin_first(unary, np.arange(n))
            seeds = np.column_stack([np.arange(n)] * 2)
        here, there = source.intervals.at(rows, rows), target.intervals.at(columns, columns)
        found, gains = grow_common_regions(
            here, there, unary, seeds, COST, NEAR, DEAREST, WIDTH, VARIANTS_APART
        )
        return found, self._distinct(found, np.argsort(-gains, kind="stable"))

    def _distinct(self, found: IntArray, order: IntArray) -> IntArray:
        """Keep the first regions that differ."""
        distances = self.target.intervals.upper
        kept = np.zeros((N_SCREENED, found.shape[1]), dtype=np.int64)
        chosen: list[int] = []
        for row in order:
            region = found[row]
            if len(chosen) == N_SCREENED:
                break
            if (region >= 0).sum() < FEWEST_GROWN:
                continue
            others = kept[: len(chosen)]
            both = (region >= 0) & (others >= 0)
            common = both.sum(axis=1)
            apart = (np.where(both, distances[region, others], 0.0)).sum(axis=1)
            if ((common >= FEWEST_COMMON) & (apart < SAME_REGION * common)).any():
                continue
            kept[len(chosen)] = region
            chosen.append(int(row))
        return np.array(chosen, dtype=np.int64)

    def extended(self, rows: IntArray, columns: IntArray, n: int, rounds: int = 2) -> CommonRegion | None:
        """Trilaterate the first n samples from some, with images among those of the target; None if few agree."""
        source, target = self.source, self.target
        everything, there = np.arange(min(n, len(source.vertices))), np.arange(min(n, len(target.vertices)))
        accepted = np.zeros(len(everything), dtype=bool)
        for step in range(rounds):
            here_at, there_at = source.intervals.at(rows, everything), target.intervals.at(columns, there)
            placed, costs = trilaterate_common(here_at, there_at, EXTENSION_NEAR, COST)
            back, _ = trilaterate_common(there_at, here_at, EXTENSION_NEAR, COST)
            returned = source.intervals.upper[everything, back[placed]]
            accepted = (costs < ACCEPTED) & (returned < ROUND_TRIP)
            if accepted.sum() < 8:
                return None
            rows = np.flatnonzero(accepted)[: FIRST_ANCHORS if n < len(source.vertices) else NEXT_ANCHORS]
            columns = placed[rows]
        return self.region(target.vertices[placed], accepted)

    def region(self, images: IntArray, accepted: BoolArray) -> CommonRegion:
        """Measure a region of the first samples (n,), by the images of all of them."""
        inside = np.flatnonzero(accepted)
        vertices, areas = self.source.vertices[inside], self.source.areas[inside]
        mismatch = self.mean_mismatch(vertices, images[inside], areas)
        share = self.source.areas.sum() / self.source.areas[: len(accepted)].sum()
        orientation = signed_triangles(self.source, inside, self.target, images[inside])
        return CommonRegion(images, accepted, mismatch, float(areas.sum() * share), orientation)

    def best(self, count: int) -> list[CommonRegion]:
        """Return the regions that are worth most, extended to all samples."""
        found, order = self.grown()

        def screened(row: int) -> tuple[float, IntArray, IntArray] | None:
            rows = np.flatnonzero(found[row] >= 0)
            columns = found[row][rows]
            region = self.extended(rows, columns, N_SCREENING)
            if region is None or region.accepted.sum() < FEWEST_SAMPLES // 2:
                return None
            value = region.worth if region.orientation > ORIENTED else ORIENTED * region.worth
            return value, rows, columns

        ranked = [each for each in parallel_map(screened, order) if each is not None]
        ranked.sort(key=lambda each: -each[0])
        n, marks = len(self.source.vertices), np.arange(len(self.source.landmarks))
        starts = [(marks, marks)] if len(marks) else []
        starts += [(rows, columns) for _, rows, columns in ranked[:count]]
        regions = parallel_map(lambda start: self.extended(*start, n), starts)
        return [
            region for region in regions if region is not None and region.accepted.sum() >= FEWEST_SAMPLES
        ]

    def given(self, image: IntArray, known: BoolArray, origin: str) -> CommonRegion:
        """Take the region where a map is known, by its images (n,) of the vertices of the source."""
        vertices = self.source.vertices
        return replace(self.region(image[vertices], known[vertices]), origin=origin)


N_AROUND = 8  # samples around each whose triangles are compared


def signed_triangles(source: BothSide, rows: IntArray, target: BothSide, images: IntArray) -> float:
    """Mean sign of the small triangles of samples: 1 if their images are wound alike, −1 if they are mirrored."""
    if len(rows) <= N_AROUND:
        return 0.0
    near = np.argsort(source.intervals.upper[np.ix_(rows, rows)], axis=1, kind="stable")[:, 1 : N_AROUND + 1]
    i, j = np.triu_indices(N_AROUND, 1)
    signs = []
    for mesh, vertices in (
        (source.shape.mesh_body, source.vertices[rows]),
        (target.shape.mesh_body, images),
    ):
        points, normals = mesh.vertices[vertices], mesh.vertex_normals[vertices]
        around = points[near] - points[:, None]
        signs.append(np.einsum("akd,ad->ak", np.cross(around[:, i], around[:, j]), normals))
    weights = np.abs(signs[0])
    return float((np.sign(signs[0] * signs[1]) * weights).sum() / max(weights.sum(), 1e-12))


def _summed(here, there, deviation: FloatArray) -> tuple[FloatArray, IntArray]:
    """Sum over the radii known at both of the halved mismatches of all pairs, and their number."""
    known = here.known[:, None] & there.known[None]
    total = np.zeros(known.shape[:2])
    for j in range(known.shape[2]):
        apart = np.abs(here.values[:, None, j] - there.values[None, :, j]) / deviation[j]
        total += known[:, :, j] * np.minimum(apart, 2.0).mean(axis=2) / 2
    return total, known.sum(axis=2)


def _drawn_to(total: FloatArray, count: IntArray, neutral: float, prior: float) -> FloatArray:
    drawn: FloatArray = (total + neutral * prior) / (count + prior)
    return drawn
