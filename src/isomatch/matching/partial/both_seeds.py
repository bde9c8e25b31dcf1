"""Regions that two parts of a body may have in common: grown from seeds, and weighed by their appearance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from isomatch._core.arrays import BodyVertices, Bool, BoolArray, Float, FloatArray, Int, IntArray, SampleRows
from isomatch._core.cached import cached_property
from isomatch._core.threads import parallel_map
from isomatch.correspondence import IntervalCost, Intervals, grow_regions, pin_first, trilaterate
from isomatch.descriptors import BallSignature, ball_signature, deviation_of
from isomatch.geodesics import MissingRegion, distance_engine
from isomatch.matching.assessment.confidence import nearest_of
from isomatch.matching.parameters import MAP_DISTANCE, PART_UNIT, SEEDS
from isomatch.matching.partial.part_pair import areas_of_samples
from isomatch.matching.priors import NO_LANDMARKS
from isomatch.matching.selection import keep_distinct
from isomatch.shapes import PreparedShape

AREA_RADII = tuple(0.05 * i for i in range(1, 13))  # of the balls whose areas are compared


COST = IntervalCost(tolerance=0.1, inside=0.1, most=0.5, soft=0.15)


@dataclass(frozen=True, eq=False)
class BothSide:
    """One of two parts, with ``s`` samples; ``s_s`` and ``s_t`` are those of source and target."""

    shape: PreparedShape
    unit: float  # what √area of the part is worth in the unit of both
    landmarks: Int[BodyVertices, "l"]  # whose counterparts on the other part are known

    @cached_property
    def vertices(self) -> Int[BodyVertices, "s"]:
        """Its samples: the landmarks, then vertices evenly spread."""
        spread = self.shape.sample_vertices
        others = spread[~np.isin(spread, self.landmarks)]
        return BodyVertices(np.concatenate([self.landmarks, others])[: SEEDS.n_samples])

    @cached_property
    def _missing(self) -> MissingRegion:
        mesh = self.shape.mesh_body
        return MissingRegion.of(
            mesh, distance_engine(mesh, self.shape.config.engine, weld=False), PART_UNIT.n_boundary_vertices
        )

    @cached_property
    def to_boundary(self) -> Float[FloatArray, "n"]:
        """Distance of each vertex to the boundary."""
        return self.unit * self._missing.to_boundary

    @cached_property
    def intervals(self) -> Intervals:
        """Of distances on the body between the samples."""
        # As of a part and a whole (see `PartPair.of`), the distance on the body lies between the shortest way through
        # what is missing and the way along the part. Here both sides show only parts, so both know intervals, and images
        # of two samples are possible if the intervals meet.
        vertices = self.vertices
        along = np.maximum(self.shape.distances.between(vertices, vertices), 0.0)
        along = np.where(vertices[:, None] == vertices, 0.0, along)
        lower = self._missing.lower_bound(vertices, vertices, along)
        return Intervals(self.unit * lower, self.unit * along)

    @cached_property
    def areas(self) -> Float[FloatArray, "s"]:
        """Area around each sample."""
        return self.unit**2 * areas_of_samples(self.shape, self.vertices)

    @cached_property
    def moments(self) -> BallSignature:
        """The ball signature of every vertex."""
        return ball_signature(
            self.shape.mesh_body, SEEDS.moment_radii, unit=1 / self.unit, samples=self.vertices, weld=False
        )

    @cached_property
    def ball_areas(self) -> tuple[Float[FloatArray, "s radii"], Bool[BoolArray, "s radii"]]:
        """Logarithms of the areas of balls around the samples, and which of them no boundary cuts."""
        radii, along = np.array(AREA_RADII), self.intervals.upper
        areas = np.stack([(along < radius) @ self.areas for radius in radii], axis=1)
        whole = radii <= self.to_boundary[self.vertices, None] + SEEDS.max_overhang
        return np.log(np.maximum(areas, self.areas[:, None])), whole

    @cached_property
    def nearest_sample(self) -> Int[SampleRows, "n"]:
        """Number of the sample nearest to each vertex."""
        return nearest_of(self.shape, self.vertices)


def two_sides(
    source: PreparedShape,
    target: PreparedShape,
    same_area: bool,
    landmarks: Int[BodyVertices, "m 2"] = NO_LANDMARKS,
) -> tuple[BothSide, BothSide]:
    """Both parts in one unit: that of the files, unless these are too unlike or areas are to be the same."""
    lengths = np.array([source.scale, target.scale])
    if same_area or lengths.max() > SEEDS.max_length_ratio * lengths.min():
        lengths[:] = 1.0
    units = lengths / (SEEDS.body_ratio * np.sqrt((lengths**2).mean()))
    first = map(BodyVertices, landmarks[: SEEDS.max_landmarks].T)
    here, there = (BothSide(*side) for side in zip((source, target), units.tolist(), first))
    return here, there


def signed_triangles(
    source: BothSide, rows: Int[SampleRows, "q"], target: BothSide, images: Int[BodyVertices, "q"]
) -> float:
    """Mean sign of the small triangles of samples: 1 if their images are wound alike, −1 if they are mirrored."""
    if len(rows) <= SEEDS.n_neighbours:
        return 0.0
    apart = source.intervals.upper[np.ix_(rows, rows)]
    np.fill_diagonal(apart, np.inf)
    near = np.argpartition(apart, SEEDS.n_neighbours - 1, axis=1)[:, : SEEDS.n_neighbours]
    signs = []
    for mesh, vertices in ((source.shape.mesh_body, source.vertices[rows]), (target.shape.mesh_body, images)):
        points, normals = mesh.vertices[vertices], mesh.vertex_normals[vertices]
        around = points[near] - points[:, None]
        # (a × b) · n = (n × a) · b, of all pairs at once
        signs.append(np.cross(normals[:, None], around) @ around.transpose(0, 2, 1))
    weights = np.abs(signs[0])
    return float((np.sign(signs[0] * signs[1]) * weights).sum() / max(weights.sum(), 1e-12))


def _sum_over_radii(
    here: BallSignature, there: BallSignature, deviation: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Sum over the radii known at both of the halved descriptor distances of all pairs, and their number."""
    counts = here.known[:, None] & there.known[None]
    total, most = np.zeros(counts.shape[:2]), SEEDS.max_descriptor_distance
    for j in range(counts.shape[2]):
        apart = np.abs(here.values[:, None, j] - there.values[None, :, j]) / deviation[j]
        total += counts[:, :, j] * np.minimum(apart, most).mean(axis=2) / most
    return total, counts.sum(axis=2)


def _shrink_to_neutral(total: FloatArray, count: IntArray, neutral: float, prior: float) -> FloatArray:
    # a mean of so many known values, and of as many neutral ones as `prior` says
    return np.asarray((total + neutral * prior) / (count + prior))


@dataclass(frozen=True, eq=False)
class CommonRegion:
    """A region of the source with its images."""

    images: Int[BodyVertices, "s"]  # vertex of the target for each sample
    accepted: Bool[BoolArray, "s"]  # which samples are in the region
    # see `CommonRegions.net_evidence`; while only some samples are placed, without what counts against it
    net_evidence: float
    orientation: float  # mean sign of its small triangles
    origin: str  # where it came from


class CommonRegions:
    """The search of regions that two parts have in common, and how alike these look."""

    def __init__(self, source: BothSide, target: BothSide) -> None:
        self.source, self.target = source, target

    @cached_property
    def _deviation(self) -> FloatArray:
        return deviation_of(self.source.moments, self.target.moments)

    @cached_property
    def _around(self) -> Float[FloatArray, "s_s s_s"]:
        """How much each sample of the source counts around each."""
        return np.asarray(
            np.exp(-((self.source.intervals.upper / SEEDS.smoothing_length) ** 2)) * self.source.areas
        )

    def descriptor_distances(
        self, rows: Int[SampleRows, "q"], images: Int[BodyVertices, "q"]
    ) -> Float[FloatArray, "q"]:
        """Descriptor distance around some samples of the source and their images."""
        # means over near samples of the region, drawn to a neutral value where little is known
        here, there = self.source.moments.at(self.source.vertices[rows]), self.target.moments.at(images)
        count = (here.known & there.known).sum(axis=1)
        total = np.nan_to_num(here.descriptor_distance(there, self._deviation)) * count
        around = self._around[np.ix_(rows, rows)]
        return np.asarray(
            (around @ (total + SEEDS.neutral_descriptor_distance * SEEDS.neutral_descriptor_weight))
            / (around @ (count + SEEDS.neutral_descriptor_weight))
        )

    @cached_property
    def _pair_distances(self) -> Float[FloatArray, "s_s s_t"]:
        """Descriptor distance of each sample of the source and each of the target by themselves."""
        here, there = (side.moments.at(side.vertices) for side in (self.source, self.target))
        return _shrink_to_neutral(
            *_sum_over_radii(here, there, self._deviation),
            SEEDS.neutral_moment_distance,
            SEEDS.neutral_moment_weight,
        )

    @cached_property
    def _surprise(self) -> Float[FloatArray, "s_s s_t"]:
        """How unlikely it is that a sample of the target looks as alike as this one: −log of its rank, 0…1."""
        apart = self._pair_distances
        rank = apart.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")
        return np.asarray(-np.log((rank + SEEDS.rank_offset) / apart.shape[1]))

    def evidence(self, rows: Int[SampleRows, "q"], images: Int[BodyVertices, "q"]) -> float:
        """Sum area × how much better images look than at random, over the samples of a region where that is above 0."""
        # Let u be the rank of the image of a sample x among all samples of the target, by descriptor distance, from 0 to
        # 1. At random it is uniform, so −log u has mean 1 (as in Fisher's sum of log p-values). With the mean over
        # samples around x, whose errors differ, the evidence is
        #     Σ_x area(x) max(mean_{x′ near x} −log u(x′) − by_chance, 0).
        # What everything looks like has no low rank, so it is no evidence; and as ranks, not distances, count, shapes of
        # two kinds, which look unlike everywhere, are verified as those of one. A large region beats a small one only by
        # area that itself looks alike.
        surprise = self._surprise[rows, self.target.nearest_sample[images]]
        around = self._around[np.ix_(rows, rows)]
        mean = around @ surprise / around.sum(axis=1)
        return float(self.source.areas[rows] @ np.maximum(mean - SEEDS.chance_surprise, 0.0))

    def net_evidence(self, rows: Int[SampleRows, "q"], images: Int[BodyVertices, "q"]) -> float:
        """Return the evidence for a region, less what speaks against it."""
        # Two parts of one body show the same wherever both reach. Let x be in the region, with image T(x) at the distance
        # b(T x) from the boundary of the target. The target shows the ball of that radius around T(x) whole; so a sample
        # y of the source with d(x, y) < b(T x) must have an image, and in the same way a sample of the target nearer to
        # T(x) than x is to the boundary of the source must be one. The area of those for which this fails is taken off.
        source, target = self.source, self.target
        if not len(rows):
            return 0.0
        from_region = source.intervals.upper[:, rows]
        from_images = target.intervals.upper[:, target.nearest_sample[images]]
        shown = (target.to_boundary[images] - from_region).max(axis=1) > SEEDS.min_visible_margin
        showing = (source.to_boundary[source.vertices[rows]] - from_images).max(
            axis=1
        ) > SEEDS.min_visible_margin
        shown[rows] = False
        left_out = source.areas[shown].sum()
        left_out += target.areas[showing & (from_images.min(axis=1) > SEEDS.uncovered_distance)].sum()
        return self.evidence(rows, images) - SEEDS.left_out_weight * float(left_out)

    def candidate_costs(
        self, rows: Int[SampleRows, "m"], columns: Int[SampleRows, "c"]
    ) -> Float[FloatArray, "m c"]:
        """Cost of each candidate for each anchor by itself, by moments and areas of balls."""
        (of_source, whole_here), (of_target, whole_there) = self.source.ball_areas, self.target.ball_areas
        both = whole_here[rows][:, None] & whole_there[columns][None]
        apart = np.minimum(
            np.abs(of_source[rows][:, None] - of_target[columns][None]), SEEDS.max_area_difference
        )
        areas = _shrink_to_neutral(
            (apart * both).sum(axis=2),
            both.sum(axis=2),
            SEEDS.neutral_area_difference,
            SEEDS.neutral_area_weight,
        )
        return SEEDS.moment_weight * self._pair_distances[np.ix_(rows, columns)] + SEEDS.area_weight * areas

    def grow(self) -> list[Int[SampleRows, "m"]]:
        """Grow regions: for each that differs from those before, the candidates of the anchors, −1 for none."""
        source, target = self.source, self.target
        rows = SampleRows(np.arange(min(SEEDS.n_anchors, len(source.vertices))))
        columns = SampleRows(np.arange(min(SEEDS.n_candidates, len(target.vertices))))
        alone = self.candidate_costs(rows, columns)
        roots = np.argsort(-source.to_boundary[source.vertices[rows]], kind="stable")[: SEEDS.n_roots]
        likely = np.argsort(alone[roots], axis=1, kind="stable")[:, : SEEDS.n_root_candidates]
        seeds = np.column_stack([np.repeat(roots, likely.shape[1]), likely.ravel()])
        here, there = source.intervals.at(rows, rows), target.intervals.at(columns, columns)
        rank_candidates = []
        for weight in SEEDS.descriptor_gains:
            unary = weight * (alone - SEEDS.neutral_moment_distance)
            if n := len(source.landmarks):
                pin_first(unary, np.arange(n))
                seeds = np.column_stack([np.arange(n)] * 2)
            costs = unary, seeds, COST, SEEDS.near_distance, SEEDS.max_distance_cost, SEEDS.max_distance_cost
            regions, gains = grow_regions(here, there, *costs, SEEDS.beam_width, SEEDS.same_variant_distance)
            rank_candidates.append(regions[np.argsort(-gains, kind="stable")])
        return self._keep_distinct(np.stack(rank_candidates, axis=1).reshape(-1, len(rows)))

    def _keep_distinct(self, regions: Int[IntArray, "h m"]) -> list[Int[SampleRows, "m"]]:
        """Keep the first regions that differ."""

        def apart(region: SampleRows, kept: Sequence[SampleRows]) -> FloatArray:
            others = np.array(kept)
            both = (region >= 0) & (others >= 0)
            total = np.where(both, self.target.intervals.upper[region, others], 0.0).sum(axis=1)
            common = both.sum(axis=1)
            return np.where(common >= SEEDS.min_common_anchors, total / np.maximum(common, 1), np.inf)

        return keep_distinct(
            map(SampleRows, regions),
            lambda region: region,
            apart,
            SEEDS.same_region_distance,
            SEEDS.max_screened,
        )

    def _extend_from(self, start: tuple[SampleRows, SampleRows], n: int, rounds: int) -> CommonRegion | None:
        """Trilaterate the first n samples from some, with images among those of the target; None if few agree."""
        source, target, (rows, columns) = self.source, self.target, start
        most = SEEDS.max_sample_cost_with_landmarks if len(source.landmarks) else SEEDS.max_sample_cost
        for _ in range(rounds):
            placed, accepted = self.place(rows, columns, n, most)
            if accepted.sum() < SEEDS.min_accepted:
                return None
            most_anchors = SEEDS.n_first_anchors if n < len(source.vertices) else SEEDS.n_next_anchors
            rows = SampleRows(np.flatnonzero(accepted)[:most_anchors])
            columns = SampleRows(placed[rows])
        return self.region(BodyVertices(target.vertices[placed]), accepted)

    def place(
        self, rows: Int[SampleRows, "q"], columns: Int[SampleRows, "q"], n: int, most: float
    ) -> tuple[Int[SampleRows, "n"], Bool[BoolArray, "n"]]:
        """Trilaterate the first n samples from some: samples of the target, and which of these agree and return."""
        source, target = self.source, self.target
        everything, there = np.arange(min(n, len(source.vertices))), np.arange(min(n, len(target.vertices)))
        of_source, of_target = source.intervals.at(rows, everything), target.intervals.at(columns, there)
        # there and back: a sample whose image is not there at all is placed somewhere, but does not return from it
        placed, costs = trilaterate(of_source, of_target, COST, SEEDS.trilateration_distance)
        accepted = costs < most
        images, of_image = np.unique(placed[accepted], return_inverse=True)
        back, _ = trilaterate(
            of_target.map_bounds(lambda bound: bound[:, images]), of_source, COST, SEEDS.trilateration_distance
        )
        accepted[accepted] = (
            source.intervals.upper[everything[accepted], back[of_image]] < SEEDS.max_round_trip
        )
        marks = np.arange(len(source.landmarks))
        placed[marks], accepted[marks] = marks, True
        return SampleRows(placed), accepted

    def region(self, images: Int[BodyVertices, "n"], accepted: Bool[BoolArray, "n"]) -> CommonRegion:
        """Measure a region of the first samples, by the images of all of them."""
        inside = SampleRows(np.flatnonzero(accepted))
        at, everywhere = BodyVertices(images[inside]), len(accepted) == len(self.source.vertices)
        worth = (self.net_evidence if everywhere else self.evidence)(inside, at)
        orientation = signed_triangles(self.source, inside, self.target, at)
        origin = "landmarks" if len(self.source.landmarks) else "anchors"
        return CommonRegion(images, accepted, worth, orientation, origin)

    def find_best(self, count: int) -> list[CommonRegion]:
        """Return the regions that are worth most, extended to all samples: a few samples tell which may be."""
        starts = [
            (rows := SampleRows(np.flatnonzero(region >= 0)), SampleRows(region[rows]))
            for region in self.grow()
        ]
        marks = SampleRows(np.arange(len(self.source.landmarks)))
        if len(marks):
            starts.insert(0, (marks, marks))
        regions: list[CommonRegion] = []
        for n, rounds, most in (*SEEDS.extensions, (len(self.source.vertices), 2, count)):
            extend = partial(self._extend_from, n=n, rounds=rounds)
            rank_candidates = [
                (region, start)
                for region, start in zip(parallel_map(extend, starts), starts)
                if region is not None and region.orientation > SEEDS.min_orientation
            ]
            rank_candidates.sort(key=lambda each: -each[0].net_evidence)
            starts = [start for _, start in rank_candidates[:most]]
            regions = [region for region, _ in rank_candidates]
        large = [region for region in regions if region.accepted.sum() >= SEEDS.min_samples]
        if len(marks) and not large:  # all that can be said is where the landmarks lead
            placed, _ = self.place(marks, marks, len(self.source.vertices), SEEDS.max_sample_cost)
            images = BodyVertices(self.target.vertices[placed])
            large = [self.region(images, np.ones(len(placed), dtype=bool))]
        return self._keep_different(large)[:count]

    def _keep_different(self, regions: list[CommonRegion]) -> list[CommonRegion]:
        """Keep the first regions whose images differ."""
        target, kept = self.target, list[CommonRegion]()
        for region in regions:
            for other in kept:
                both = region.accepted & other.accepted
                far = target.unit * target.shape.distance(region.images[both], other.images[both])
                if (
                    both.sum() > SEEDS.same_map_overlap * region.accepted.sum()
                    and far.mean() < MAP_DISTANCE.same_map
                ):
                    break
            else:
                kept.append(region)
        return kept

    def region_around(
        self, image: Int[BodyVertices, "n_s"], near: Bool[BoolArray, "n_s"], origin: str
    ) -> CommonRegion:
        """Take the region of some vertices of the source, by the images of all."""
        vertices = self.source.vertices
        return replace(self.region(BodyVertices(image[vertices]), near[vertices]), origin=origin)
