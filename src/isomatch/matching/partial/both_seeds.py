"""Regions that two parts of a body may share, grown from seeds, ranked by appearance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np

from isomatch._core.arrays import BodyVertices, Bool, BoolArray, Float, FloatArray, Int, IntArray, SampleRows
from isomatch._core.cached import cached_property
from isomatch._core.threads import parallel_map
from isomatch.correspondence import IntervalCost, Intervals, grow_regions, pin_first, trilaterate
from isomatch.descriptors import BallSignature, ball_signature, deviation_of
from isomatch.geodesics import MissingRegion, distance_engine
from isomatch.matching.assessment.confidence import nearest_of
from isomatch.matching.parameters import MAP_DISTANCE, PART_UNIT, SEEDS
from isomatch.matching.partial.part_pair import areas_of_samples, shrink_to_neutral
from isomatch.matching.priors import NO_LANDMARKS
from isomatch.matching.selection import keep_distinct
from isomatch.shapes import PreparedShape

# √area of the body; radii of the balls whose areas are compared; chosen
AREA_RADII = tuple(0.05 * i for i in range(1, 13))
# cost of a distance between two images; chosen with the numbers of `SEEDS`, on pairs of parts of SHREC'16
COST = IntervalCost(tolerance=0.1, inside=0.1, most=0.5, soft=0.15)


@dataclass(frozen=True, eq=False)
class BothSide:
    """One of two parts, with ``s`` samples; source and target have ``s_s`` and ``s_t`` samples."""

    shape: PreparedShape
    unit: float  # √area of the part, in the unit of both parts (√area of the body)
    landmarks: Int[BodyVertices, "l"]

    @cached_property
    def vertices(self) -> Int[BodyVertices, "s"]:
        """The samples: the landmarks, then evenly spread vertices."""
        samples = self.shape.sample_vertices
        others = samples[~np.isin(samples, self.landmarks)]
        return BodyVertices(np.concatenate([self.landmarks, others])[: SEEDS.n_samples])

    @cached_property
    def _missing(self) -> MissingRegion:
        mesh = self.shape.mesh_body
        engine = distance_engine(mesh, self.shape.config.engine, weld=False)
        return MissingRegion.of(mesh, engine, PART_UNIT.n_boundary_vertices)

    @cached_property
    def to_boundary(self) -> Float[FloatArray, "n"]:
        """Distance of each vertex to the boundary."""
        return self.unit * self._missing.to_boundary

    @cached_property
    def intervals(self) -> Intervals:
        """Bounds of distances on the body between the samples."""
        # `PartPair.of` explains the bounds. Both shapes are parts, so both have intervals of distances: two
        # images are possible for two samples if the interval between the images overlaps the interval between
        # the samples.
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
        """Logarithms of areas of balls around samples, and which lie inside the boundary."""
        radii, along = np.array(AREA_RADII), self.intervals.upper
        areas = np.stack([(along < radius) @ self.areas for radius in radii], axis=1)
        whole = radii <= self.to_boundary[self.vertices, None] + SEEDS.max_overhang
        return np.log(np.maximum(areas, self.areas[:, None])), whole

    @cached_property
    def nearest_sample(self) -> Int[SampleRows, "n"]:
        """Number of the nearest sample to each vertex."""
        return nearest_of(self.shape, self.vertices)


def two_sides(
    source: PreparedShape,
    target: PreparedShape,
    same_area: bool,
    landmarks: Int[BodyVertices, "m 2"] = NO_LANDMARKS,
) -> tuple[BothSide, BothSide]:
    """Put both parts in one unit, from the files unless areas are taken as equal."""
    lengths = np.array([source.scale, target.scale])
    if same_area or lengths.max() > SEEDS.max_length_ratio * lengths.min():
        lengths[:] = 1.0
    units = lengths / (SEEDS.body_ratio * np.sqrt((lengths**2).mean()))
    first = map(BodyVertices, landmarks[: SEEDS.max_landmarks].T)
    of_source, of_target = (BothSide(*side) for side in zip((source, target), units.tolist(), first))
    return of_source, of_target


def signed_triangles(
    source: BothSide, rows: Int[SampleRows, "q"], target: BothSide, images: Int[BodyVertices, "q"]
) -> float:
    """Mean sign of small triangles of samples: 1 if images keep the winding, −1 if not."""
    if len(rows) <= SEEDS.n_neighbours:
        return 0.0
    distances = source.intervals.upper[np.ix_(rows, rows)]
    np.fill_diagonal(distances, np.inf)
    near = np.argpartition(distances, SEEDS.n_neighbours - 1, axis=1)[:, : SEEDS.n_neighbours]
    signs = []
    for mesh, vertices in ((source.shape.mesh_body, source.vertices[rows]), (target.shape.mesh_body, images)):
        points, normals = mesh.vertices[vertices], mesh.vertex_normals[vertices]
        around = points[near] - points[:, None]
        # (a × b) · n = (n × a) · b for all pairs of edges a, b to neighbours; n is the normal
        signs.append(np.cross(normals[:, None], around) @ around.transpose(0, 2, 1))
    weights = np.abs(signs[0])
    return float((np.sign(signs[0] * signs[1]) * weights).sum() / max(weights.sum(), 1e-12))


def _sum_over_radii(
    source: BallSignature, target: BallSignature, deviation: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Sum descriptor distances of all pairs over the radii known at both, and count these radii."""
    known = source.known[:, None] & target.known[None]
    total, most = np.zeros(known.shape[:2]), SEEDS.max_descriptor_distance
    for j in range(known.shape[2]):
        difference = np.abs(source.values[:, None, j] - target.values[None, :, j]) / deviation[j]
        total += known[:, :, j] * np.minimum(difference, most).mean(axis=2) / most
    return total, known.sum(axis=2)


@dataclass(frozen=True, eq=False)
class CommonRegion:
    """A region of the source with its images."""

    regions: CommonRegions
    images: Int[BodyVertices, "s"]  # vertex of the target for each sample
    accepted: Bool[BoolArray, "s"]  # which samples are in the region
    # see `CommonRegions.net_evidence`; `CommonRegions.evidence` while the region has only some of the samples
    net_evidence: float
    origin: str

    @cached_property
    def keeps_orientation(self) -> bool:
        """Whether enough of its small triangles keep their winding."""
        rows, regions = SampleRows(np.flatnonzero(self.accepted)), self.regions
        sign = signed_triangles(regions.source, rows, regions.target, BodyVertices(self.images[rows]))
        return sign > SEEDS.min_orientation


class CommonRegions:
    """Searches regions that two parts have in common, and measures how alike they look."""

    def __init__(self, source: BothSide, target: BothSide) -> None:
        self.source, self.target = source, target

    @cached_property
    def _deviation(self) -> FloatArray:
        return deviation_of(self.source.moments, self.target.moments)

    @cached_property
    def _around(self) -> Float[FloatArray, "s_s s_s"]:
        """Weight of each sample of the source in the neighbourhood of each other."""
        lengths = self.source.intervals.upper / SEEDS.smoothing_length
        return np.asarray(np.exp(-(lengths**2)) * self.source.areas)

    def descriptor_distances(
        self, rows: Int[SampleRows, "q"], images: Int[BodyVertices, "q"]
    ) -> Float[FloatArray, "q"]:
        """Descriptor distance in the neighbourhood of samples of the source and their images."""
        # weighted means over nearby samples of the region; with few known radii, they tend to the neutral
        # value
        of_source = self.source.moments.at(self.source.vertices[rows])
        of_target = self.target.moments.at(images)
        count = (of_source.known & of_target.known).sum(axis=1)
        total = np.nan_to_num(of_source.descriptor_distance(of_target, self._deviation)) * count
        around = self._around[np.ix_(rows, rows)]
        neutral, weight = SEEDS.neutral_descriptor_distance, SEEDS.neutral_descriptor_weight
        return np.asarray((around @ (total + neutral * weight)) / (around @ (count + weight)))

    @cached_property
    def _pair_distances(self) -> Float[FloatArray, "s_s s_t"]:
        """Descriptor distance between each sample of the source and each sample of the target."""
        of_source, of_target = (side.moments.at(side.vertices) for side in (self.source, self.target))
        known = _sum_over_radii(of_source, of_target, self._deviation)
        return shrink_to_neutral(*known, SEEDS.neutral_moment_distance, SEEDS.neutral_moment_weight)

    @cached_property
    def _surprise(self) -> Float[FloatArray, "s_s s_t"]:
        """−log of the rank, from 0 to 1, of each target sample by its descriptor distance from a source sample."""
        distances = self._pair_distances
        rank = distances.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")
        return np.asarray(-np.log((rank + SEEDS.rank_offset) / distances.shape[1]))

    def evidence(self, rows: Int[SampleRows, "q"], images: Int[BodyVertices, "q"]) -> float:
        """Measure how much more alike a region looks than a random one, as an area."""
        # Let u(x) be the rank, from 0 to 1, of the image of a sample x among all samples of the target, by
        # descriptor distance from x. For a random image u is uniform, so −log u has mean 1 (as in Fisher's
        # sum of log p-values). The evidence is
        #     Σ_x area(x) max(mean_{x′ near x} −log u(x′) − chance_surprise, 0),
        # where the mean evens out errors of single samples. An image that looks like many other samples has
        # no low rank, so it is no evidence. Ranks also work for shapes of two kinds, which look unlike
        # everywhere. A larger region wins only if the additional area itself looks alike.
        surprise = self._surprise[rows, self.target.nearest_sample[images]]
        around = self._around[np.ix_(rows, rows)]
        mean = around @ surprise / around.sum(axis=1)
        return float(self.source.areas[rows] @ np.maximum(mean - SEEDS.chance_surprise, 0.0))

    def net_evidence(self, rows: Int[SampleRows, "q"], images: Int[BodyVertices, "q"]) -> float:
        """Evidence for a region, less the area that should belong to it and does not."""
        # Let x be in the region, with an image T(x) at distance b(T x) from the boundary of the target. The
        # target contains the whole ball of radius b(T x) around T(x), so each sample y of the source with
        # d(x, y) < b(T x) must have an image. In the same way, each sample of the target that is closer to
        # T(x) than x is to the boundary of the source must be near an image. The area of samples that violate
        # this is subtracted.
        source, target = self.source, self.target
        if not len(rows):
            return 0.0
        from_region = source.intervals.upper[:, rows]
        from_images = target.intervals.upper[:, target.nearest_sample[images]]
        to_boundary = source.to_boundary[source.vertices[rows]]
        needs_image = (target.to_boundary[images] - from_region).max(axis=1) > SEEDS.min_visible_margin
        must_be_image = (to_boundary - from_images).max(axis=1) > SEEDS.min_visible_margin
        needs_image[rows] = False
        left_out = source.areas[needs_image].sum()
        left_out += target.areas[must_be_image & (from_images.min(axis=1) > SEEDS.uncovered_distance)].sum()
        return self.evidence(rows, images) - SEEDS.left_out_weight * float(left_out)

    def candidate_costs(
        self, rows: Int[SampleRows, "m"], columns: Int[SampleRows, "c"]
    ) -> Float[FloatArray, "m c"]:
        """Cost of each candidate for each anchor, by moments and areas of balls."""
        (of_source, source_whole), (of_target, target_whole) = self.source.ball_areas, self.target.ball_areas
        both = source_whole[rows][:, None] & target_whole[columns][None]
        difference = np.abs(of_source[rows][:, None] - of_target[columns][None])
        total = (np.minimum(difference, SEEDS.max_area_difference) * both).sum(axis=2)
        neutral = SEEDS.neutral_area_difference, SEEDS.neutral_area_weight
        areas = shrink_to_neutral(total, both.sum(axis=2), *neutral)
        return SEEDS.moment_weight * self._pair_distances[np.ix_(rows, columns)] + SEEDS.area_weight * areas

    def grow(self) -> list[Int[SampleRows, "m"]]:
        """Grow distinct regions; each is given by the candidates of the anchors, −1 for anchors without one."""
        source, target = self.source, self.target
        rows = SampleRows(np.arange(min(SEEDS.n_anchors, len(source.vertices))))
        columns = SampleRows(np.arange(min(SEEDS.n_candidates, len(target.vertices))))
        costs = self.candidate_costs(rows, columns)
        roots = np.argsort(-source.to_boundary[source.vertices[rows]], kind="stable")[: SEEDS.n_roots]
        likely = np.argsort(costs[roots], axis=1, kind="stable")[:, : SEEDS.n_root_candidates]
        seeds = np.column_stack([np.repeat(roots, likely.shape[1]), likely.ravel()])
        intervals = source.intervals.at(rows, rows), target.intervals.at(columns, columns)
        ranked = []
        for weight in SEEDS.descriptor_gains:
            unary = weight * (costs - SEEDS.neutral_moment_distance)
            if n := len(source.landmarks):
                pin_first(unary, np.arange(n))
                seeds = np.column_stack([np.arange(n)] * 2)
            bounds = SEEDS.near_distance, SEEDS.max_distance_cost, SEEDS.max_distance_cost
            beam = SEEDS.beam_width, SEEDS.same_variant_distance
            regions, gains = grow_regions(*intervals, unary, seeds, COST, *bounds, *beam)
            ranked.append(regions[np.argsort(-gains, kind="stable")])
        return self._keep_distinct(np.stack(ranked, axis=1).reshape(-1, len(rows)))

    def _keep_distinct(self, regions: Int[IntArray, "h m"]) -> list[Int[SampleRows, "m"]]:
        """Keep the first regions that differ."""

        def distances(region: SampleRows, kept: Sequence[SampleRows]) -> FloatArray:
            others = np.array(kept)
            both = (region >= 0) & (others >= 0)
            total = np.where(both, self.target.intervals.upper[region, others], 0.0).sum(axis=1)
            common = both.sum(axis=1)
            return np.where(common >= SEEDS.min_common_anchors, total / np.maximum(common, 1), np.inf)

        least, most = SEEDS.same_region_distance, SEEDS.max_screened
        return keep_distinct(map(SampleRows, regions), lambda region: region, distances, least, most)

    def _extend_from(self, start: tuple[SampleRows, SampleRows], n: int, rounds: int) -> CommonRegion | None:
        """Extend a region to the first n samples by trilateration; None if few samples agree."""
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
        """Map the first n samples by trilateration; say which images agree and map back."""
        source, target = self.source, self.target
        all_rows, all_columns = (np.arange(min(n, len(side.vertices))) for side in (source, target))
        of_source, of_target = source.intervals.at(rows, all_rows), target.intervals.at(columns, all_columns)
        # a sample without an image on the target is placed somewhere, but that point does not map back to it
        placed, costs = trilaterate(of_source, of_target, COST, SEEDS.trilateration_distance)
        accepted = costs < most
        images, of_image = np.unique(placed[accepted], return_inverse=True)
        of_images = of_target.map_bounds(lambda bound: bound[:, images])
        back, _ = trilaterate(of_images, of_source, COST, SEEDS.trilateration_distance)
        round_trip = source.intervals.upper[all_rows[accepted], back[of_image]]
        accepted[accepted] = round_trip < SEEDS.max_round_trip
        marks = np.arange(len(source.landmarks))
        placed[marks], accepted[marks] = marks, True
        return SampleRows(placed), accepted

    def region(self, images: Int[BodyVertices, "n"], accepted: Bool[BoolArray, "n"]) -> CommonRegion:
        """Measure a region of the first samples, given the images of all of them."""
        inside = SampleRows(np.flatnonzero(accepted))
        inside_images = BodyVertices(images[inside])
        is_complete = len(accepted) == len(self.source.vertices)
        evidence = (self.net_evidence if is_complete else self.evidence)(inside, inside_images)
        origin = "landmarks" if len(self.source.landmarks) else "anchors"
        return CommonRegion(self, images, accepted, evidence, origin)

    def find_best(self, count: int) -> list[CommonRegion]:
        """Find the regions with most evidence, extending the best step by step to all samples."""
        grown = self.grow()
        starts = [(rows := SampleRows(np.flatnonzero(x >= 0)), SampleRows(x[rows])) for x in grown]
        marks = SampleRows(np.arange(len(self.source.landmarks)))
        if len(marks):
            starts.insert(0, (marks, marks))
        # the orientation takes longer than the evidence, and is asked of the best regions only
        for n, rounds, most in SEEDS.extensions:
            ranked = (pair for pair in self._extend(starts, n, rounds) if pair[0].keeps_orientation)
            starts = [start for _, start in islice(ranked, most)]
        last = self._extend(starts, len(self.source.vertices), 2)
        is_large = (region for region, _ in last if region.accepted.sum() >= SEEDS.min_samples)
        large = self._keep_different((region for region in is_large if region.keeps_orientation), count)
        if len(marks) and not large:  # no region was found: use the map by trilateration from landmarks
            placed, _ = self.place(marks, marks, len(self.source.vertices), SEEDS.max_sample_cost)
            images = BodyVertices(self.target.vertices[placed])
            large = [self.region(images, np.ones(len(placed), dtype=bool))][:count]
        return large

    def _extend(
        self, starts: list[tuple[SampleRows, SampleRows]], n: int, rounds: int
    ) -> list[tuple[CommonRegion, tuple[SampleRows, SampleRows]]]:
        """Extend regions from starts to the first n samples; return regions and their starts, most evidence first."""
        found = zip(parallel_map(partial(self._extend_from, n=n, rounds=rounds), starts), starts)
        extended = [(region, start) for region, start in found if region is not None]
        return sorted(extended, key=lambda pair: -pair[0].net_evidence)

    def _keep_different(self, regions: Iterable[CommonRegion], count: int) -> list[CommonRegion]:
        """Keep the first regions whose images differ, at most ``count``."""
        target, kept = self.target, list[CommonRegion]()

        def is_same(region: CommonRegion, other: CommonRegion) -> bool:
            both = region.accepted & other.accepted
            distance = target.unit * target.shape.distance(region.images[both], other.images[both])
            overlaps = both.sum() > SEEDS.same_map_overlap * region.accepted.sum()
            return bool(overlaps and distance.mean() < MAP_DISTANCE.same_map)

        different = (region for region in regions if not any(is_same(region, other) for other in kept))
        for region in islice(different, count):
            kept.append(region)
        return kept

    def region_around(
        self, image: Int[BodyVertices, "n_s"], near: Bool[BoolArray, "n_s"], origin: str
    ) -> CommonRegion:
        """Make the region of the vertices in ``near``, given images of all source vertices."""
        vertices = self.source.vertices
        return replace(self.region(BodyVertices(image[vertices]), near[vertices]), origin=origin)
