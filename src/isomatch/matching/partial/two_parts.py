"""TwoParts: two shapes are overlapping parts of one body that neither shows completely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from isomatch._core.arrays import (
    BodyVertices,
    Bool,
    BoolArray,
    Float,
    FloatArray,
    Int,
    PartVertices,
    SampleRows,
)
from isomatch._core.cached import cached_method, cached_property
from isomatch._core.errors import MeshError, NotConvergedError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import UNMATCHED, Boundary, Correspondence, Embedding, PrecisePoints
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.assessment.evidence import CommonDoubt, Measured, Solution
from isomatch.matching.assessment.quality import descriptor_distance_of
from isomatch.matching.model import Match, MatchingModel, Proposals
from isomatch.matching.parameters import MAP_DISTANCE, PART_FIT, SEEDS, TWO_PARTS
from isomatch.matching.partial.both_seeds import CommonRegion, CommonRegions, two_sides
from isomatch.matching.partial.part import (
    Part,
    contradiction_evidence,
    expected_errors_of_part,
    fill_images,
    measure_part,
)
from isomatch.matching.partial.part_registration import BentPart, PartFit, WholeCoordinates
from isomatch.matching.priors import Priors
from isomatch.matching.problem import Problem
from isomatch.matching.proposals.starts import nearest_in_pose
from isomatch.matching.result import Alternative
from isomatch.matching.selection import Ranking
from isomatch.matching.verify import largest_piece
from isomatch.settings import Config
from isomatch.shapes import region_of


@dataclass(frozen=True, eq=False)
class RefinedRegion:
    """A region of the source refined as a part of the target."""

    regions: CommonRegions
    vertices: Int[BodyVertices, "m"]  # source vertices of the region
    fit: PartFit

    @cached_property
    def image(self) -> Int[BodyVertices, "n_s"]:
        """Vertex of the target for each vertex of the source; −1 outside the region."""
        image = np.full(self.regions.source.shape.body.n_vertices, UNMATCHED)
        of_part = PartVertices(np.arange(len(self.vertices)))
        image[self.vertices] = self.fit.bending.images(self.fit.bent, of_part)
        return BodyVertices(image)

    @cached_property
    def matched(self) -> Bool[BoolArray, "n_s"]:
        """Which source vertices lie near the target, bent at the lower resolution."""
        # beyond the boundary of the target, the bent region keeps its lengths, and so lies off the target
        near = self.fit.bending.interpolate(lies_on_target(self.fit.bent).astype(np.float64)) > 0.5
        matched = np.zeros(len(self.image), dtype=bool)
        matched[self.vertices] = near
        return matched

    @cached_property
    def rows(self) -> Int[SampleRows, "q"]:
        """Samples of the source that are matched."""
        return SampleRows(np.flatnonzero(self.matched[self.regions.source.vertices]))

    @cached_property
    def descriptor_distances(self) -> Float[FloatArray, "q"]:
        """Descriptor distance around matched samples, see `CommonRegions.descriptor_distances`."""
        return self.regions.descriptor_distances(self.rows, self._images)

    @property
    def _images(self) -> Int[BodyVertices, "q"]:
        return BodyVertices(self.image[self.regions.source.vertices[self.rows]])

    @cached_property
    def net_evidence(self) -> float:
        """Evidence for the region, see `CommonRegions.net_evidence`."""
        return self.regions.net_evidence(self.rows, self._images)

    @cached_property
    def n_landmarks_held(self) -> int:
        """Number of landmarks whose images are close to their targets."""
        target, image = self.regions.target, self.image[self.regions.source.landmarks]
        errors = target.shape.distance(image, target.landmarks)[image != UNMATCHED]
        return int((errors < TWO_PARTS.landmark_tolerance).sum())

    @property
    def cost(self) -> float:
        """Cost among other maps: −net evidence × orientation; 0 if the region has neither."""
        # A mean cost of vertices would favour tiny regions that fit perfectly, because it does not penalise
        # area without an image; the net evidence is an area. The orientation is 1 − 2t if a share t of the
        # region is turned inside out. A power of the spectral residual as a further factor selected no better
        # maps: decisions.md, two parts.
        return -max(self.net_evidence, 0.0) * max(self.fit.orientation, 0.0)

    def grow_again(self, most: float) -> CommonRegion:
        """Extend the region from its samples to all samples that cost at most ``most``."""
        # samples that look unlike their images do not place other samples, but may be placed by them again
        source, target = self.regions.source, self.regions.target
        at_samples = np.full(len(source.vertices), UNMATCHED)
        alike = self.rows[self.descriptor_distances < TWO_PARTS.max_descriptor_distance]
        at_samples[alike] = self.image[source.vertices[alike]]
        at_samples[: len(source.landmarks)] = target.landmarks
        rows = SampleRows(np.flatnonzero(at_samples != UNMATCHED)[: SEEDS.n_next_anchors])
        columns = SampleRows(target.nearest_sample[at_samples[rows]])
        placed, accepted = self.regions.place(rows, columns, len(source.vertices), most)
        images = BodyVertices(np.where(at_samples != UNMATCHED, at_samples, target.vertices[placed]))
        return replace(self.regions.region(images, accepted), origin=self.fit.origin)


class TwoParts(MatchingModel[RefinedRegion, BentPart]):
    """Two shapes are overlapping parts of one body: some vertices of the source have no image.

    Notes
    -----
    A distance on the body is known up to an interval on both sides, and a point may have no partner. Common regions are
    grown from seeds, and each is refined as a part of the target, as by `Part`. The map of the largest region wins,
    unless the parts look different there.
    """

    way = "two parts"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.left_out: list[str] = []  # reasons why regions could not be refined

    def require_suitable(self) -> None:
        """Raise an `IsomatchError` unless shapes, orientation and priors suit a part."""
        self.require_sides()
        self.require_priors()
        self.require_no_descriptors("two parts")

    def propose(self, timer: StageTimer) -> Proposals[RefinedRegion]:
        """Search common regions, and refine them roughly."""
        timer.start("search")
        first = self._first_regions()
        regions = self._refine_regions(first, roughly=True)
        if not regions:
            raise NotConvergedError(
                "no region was found that both shapes show; give three to five landmarks on both"
            )
        return Proposals(regions, len(first))

    def refine(self, maps: Sequence[RefinedRegion]) -> list[RefinedRegion]:
        """Grow the best regions again, and refine them; regions refined to the end come first."""
        regions, others = list(maps), list[RefinedRegion]()
        for count, cost, roughly in TWO_PARTS.rounds if regions else ():
            grown = [region.grow_again(cost) for region in regions[:count]]
            again = self._refine_regions([region for region in grown if region.accepted.any()], roughly)
            regions, others = again or regions, [*regions, *others]
        return [*regions, *_rank_regions(others)]

    def rank(
        self,
        maps: list[RefinedRegion],
        rivals: list[RefinedRegion],
        proposals: Proposals[RefinedRegion],
        timer: StageTimer,
    ) -> Ranking[RefinedRegion]:
        """Select the first region; compare it with the next different one as good on landmarks."""
        best, *rest = maps
        others = tuple(
            region
            for region in rest
            if region.n_landmarks_held >= best.n_landmarks_held and self._differs(best, region)
        )
        lead = best.cost / others[0].cost if others and others[0].cost else np.inf
        return Ranking(best, tuple(rest), lead, np.inf, others[0] if others else None, distinct=others)

    def cost(self, fit: RefinedRegion) -> float:
        """Cost of a region among regions that hold as many landmarks."""
        return fit.cost

    def image(self, best: RefinedRegion) -> Int[BodyVertices, "n_s"]:
        """Vertex of the target for each vertex of the source, −1 where there is none."""
        return BodyVertices(np.where(best.matched, best.image, UNMATCHED))

    def coordinates(self, best: RefinedRegion) -> BentPart:
        """Bend the region at full resolution."""
        fit = best.fit
        return fit.bending.lay_in_full(fit.bent, self.pair.config.parts.bending[-TWO_PARTS.n_final_lengths :])

    def _refine_regions(self, regions: list[CommonRegion], roughly: bool) -> list[RefinedRegion]:
        def refine_or_explain(region: CommonRegion) -> RefinedRegion | str:
            try:
                return self._refine_region(region, roughly)
            except MeshError as error:  # for example, the region is too small to be prepared
                return str(error)

        tried = parallel_map(refine_or_explain, regions)
        self.left_out += [region for region in tried if isinstance(region, str)]
        return _rank_regions([region for region in tried if not isinstance(region, str)])

    def _refine_region(self, region: CommonRegion, roughly: bool) -> RefinedRegion:
        """Refine the samples of a region and their surroundings as a part of the target."""
        pair, regions, landmarks = self.pair, self._regions, self.priors.landmarks
        source, target = regions.source, regions.target
        n = source.shape.body.n_vertices
        gap, owner = distance_along_edges_to_nearest(source.shape.body, source.vertices[region.accepted])
        vertices = largest_piece(source.shape.mesh_body, source.unit * gap <= TWO_PARTS.region_margin)
        without_extremities = replace(pair.config.preparation, n_extremities=0)
        config = replace(pair.config, scale="same", preparation=without_extremities)
        config = rough_config(config) if roughly else config
        part = region_of(source.shape, vertices, config)
        # √area of the region over √area of the target, from lengths in the common unit of both shapes
        length = part.scale / source.shape.scale * source.unit / target.unit
        part = replace(part, scale=length * target.shape.scale)
        images, number = np.full(n, -1), np.full(n, -1)
        images[source.vertices], number[vertices] = region.images, np.arange(len(vertices))
        kept = number[landmarks[:, 0]] >= 0
        landmarks = BodyVertices(np.column_stack([number[landmarks[:, 0]], landmarks[:, 1]])[kept])
        functions = pair.functions and Embedding(pair.known.source[vertices], pair.functions.target)
        priors = Priors(landmarks)
        problem = Problem(part, target.shape, config, functions, priors, pair.refinement, pair.starts)
        model = Part(problem, coordinates=self._coordinates(tuple(landmarks[:, 1].tolist())))
        first = images[owner[vertices[part.sample_vertices[: PART_FIT.n_rough_vertices]]]]
        begun = model.fits.begin(model.fits.pair, BodyVertices(first), region.origin)
        return RefinedRegion(regions, vertices, model.refine([begun])[0])

    @cached_method
    def _coordinates(self, landmarks: tuple[int, ...]) -> WholeCoordinates:
        """Coordinates of the target, shared by regions that hold the same landmarks."""
        functions = self.pair.known.target
        marks = BodyVertices(np.array(landmarks, dtype=np.int64))
        return WholeCoordinates(self.target, self.pair.config, marks, functions)

    @cached_property
    def _regions(self) -> CommonRegions:
        same_area = self.pair.config.scale == "area"
        return CommonRegions(*two_sides(self.source, self.target, same_area, self.priors.landmarks))

    def _first_regions(self) -> list[CommonRegion]:
        """Regions grown from seeds, from given maps, and from the user's starts."""
        pairs, count = self.priors.initial_pairs, self.pair.config.parts.n_common
        regions = self._regions.find_best(count) if self.searches_by_anchors else []
        first_maps = [(pairs, "initial map")] if len(pairs) else []
        if self.pair.config.start == "pose":
            vertices = BodyVertices(np.arange(self.source.body.n_vertices))
            images = nearest_in_pose(self.pair.source, self.pair.target, vertices)
            first_maps.append((BodyVertices(np.column_stack([vertices, images])), "pose"))
        for pairs, origin in (*first_maps, *self.first_maps_handed_in()):
            image, gap = fill_images(self.source, pairs)
            near = self._regions.source.unit * gap <= TWO_PARTS.region_margin
            regions.append(self._regions.region_around(image, near, origin))
        return [region for region in regions if region.accepted.any()]

    def _alternatives(self, regions: Sequence[RefinedRegion]) -> tuple[Alternative, ...]:
        """Return maps of other regions that differ from each other, without bending in full."""
        kept: list[RefinedRegion] = []
        for region in regions:
            if len(kept) < self.pair.config.selection.most_alternatives:
                kept += [region] * all(self._differs(other, region) for other in kept)
        return tuple(
            Alternative(partial(self._map_of, region), region.cost, region.fit.orientation, region.fit.origin)
            for region in kept
        )

    def _map_of(self, region: RefinedRegion) -> Correspondence:
        image = np.where(region.matched, region.image, 0)
        return self.pair.source.correspondence(self.pair.target, image, region.matched)

    def _differs(self, best: RefinedRegion, other: RefinedRegion) -> bool:
        """Whether two maps differ where both have images, or have no vertex in common."""
        both = best.matched & other.matched
        if not both.any():
            return True
        return self.target.mean_distance(best.image[both], other.image[both]) > MAP_DISTANCE.other_map

    def measure(self, match: Match[RefinedRegion, BentPart]) -> Measured:
        """Measure the map of the region."""
        pair, best, bent = self.pair, match.ranking.best, match.coordinates
        n = pair.source.body.n_vertices
        points, matched = PrecisePoints.at_vertices(np.zeros(n, dtype=np.int64)), np.zeros(n, dtype=bool)
        points.corners[best.vertices], points.barycentric[best.vertices] = bent.points
        matched[best.vertices] = lies_on_target(bent)
        balls, reason = (pair.source.balls, pair.target.balls), "largest region in common that looks alike"
        descriptor_distance = descriptor_distance_of(*balls, points.corners[:, 0], matched)
        unit = self._regions.source.unit / self._regions.target.unit
        return measure_part(pair, best.fit, bent, unit, points, matched, descriptor_distance, reason)

    def sum_up(
        self, match: Match[RefinedRegion, BentPart], measured: Measured, timer: StageTimer
    ) -> Solution:
        """Sum up the map of the region."""
        pair, ranking, best = self.pair, match.ranking, match.ranking.best
        errors = np.full(pair.source.body.n_vertices, np.nan)
        errors[best.vertices] = expected_errors_of_part(best.fit.pair, match.coordinates.points)
        landmarks_hold = 0 < len(self._regions.source.landmarks) == best.n_landmarks_held
        doubt = CommonDoubt(best.net_evidence, ranking.runner_up, landmarks_hold, pair.config.parts)
        areas = pair.source.body.vertex_areas
        share = areas[measured.matched].sum() / areas.sum()
        notes = [
            f"both shapes were matched as parts of one body: {share:.0%} of the source and "
            f"{measured.quality.coverage:.0%} of the target are in common"
        ]
        if self.left_out:
            notes.append(f"{len(self.left_out)} regions in common were left out: {self.left_out[0]}")
        evidence = (contradiction_evidence(pair, measured),)
        solution = measured.solution(pair, errors, evidence, notes).with_doubt(doubt)
        return replace(solution, alternatives=self._alternatives(ranking.distinct))


def _rank_regions(regions: list[RefinedRegion]) -> list[RefinedRegion]:
    """Sort regions by the number of landmarks that hold, then by cost."""
    return sorted(regions, key=lambda region: (-region.n_landmarks_held, region.cost))


def lies_on_target(bent: BentPart) -> Bool[BoolArray, "n"]:
    """Which vertices of a bent part lie on the target, with a smaller tolerance at its boundary."""
    onto, points = bent.onto.mesh, bent.points
    gap = np.linalg.norm(points.interpolated(onto.vertices) - bent.mesh.vertices, axis=1)
    at_boundary, inside = TWO_PARTS.boundary_tolerance, TWO_PARTS.surface_tolerance
    return np.asarray(gap <= np.where(Boundary(onto).holds(points), at_boundary, inside))


def rough_config(config: Config) -> Config:
    """Change settings so that the refinement of regions that may be wrong takes less time."""
    refining = config.refining
    names = "sizes_without_positions", "sizes_with_positions", "final_sizes", "sizes_of_parts"
    sizes: dict[str, Any] = {
        name: tuple(k for k in getattr(refining, name) if k <= TWO_PARTS.n_rough_functions) for name in names
    }
    if any(sizes[name] for name in names[:3]):
        refining = replace(refining, **sizes)
    bending, n_bent = config.parts.bending[::2], min(config.parts.n_bent_vertices, 600)
    return replace(
        config,
        n_columns=min(config.n_columns, 40),
        rank=min(config.rank, 20),
        n_functions=min(config.n_functions, TWO_PARTS.n_rough_functions),
        n_refine=min(config.n_refine, 500),
        refining=refining,
        parts=replace(config.parts, bending=bending, n_bent_vertices=n_bent),
    )
