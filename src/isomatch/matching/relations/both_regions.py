"""A region that two parts have in common, refined as a part of the target, and grown again from where it lies then."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from isomatch.correspondence import UNMATCHED, Boundary, Embedding
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair
from isomatch.matching.relations.both_seeds import (
    NEXT_ANCHORS,
    CommonRegion,
    CommonRegions,
)
from isomatch.matching.relations.part import Part
from isomatch.matching.relations.part_bending import BentPart
from isomatch.matching.relations.part_fits import PartFit
from isomatch.matching.relations.part_pair import NO_LANDMARKS
from isomatch.matching.relations.part_refinement import N_ROUGH_VERTICES
from isomatch.matching.stages import Stages
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, region_of
from isomatch.surfaces import linked
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_property

AROUND = 0.05  # by which a region reaches beyond its samples when it is refined
HELD = 0.1  # distance from where it is known to go, in √area of the target, up to which a landmark is held
TOO_UNLIKE = 0.6  # mismatch from which a sample and its surroundings do not lead others
OFF = 0.04  # distance from the target up to which bent vertices count as in common
RIM = 0.02  # the same from its boundary
ROUGH_FUNCTIONS = 100  # of a rough refinement, which ranks regions as one in full
N_BENT_IN_FULL = 3  # last lengths with which the best region is bent in full


@dataclass(frozen=True, eq=False)
class RefinedRegion:
    """A region of the source refined as a part of the target.

    Parameters
    ----------
    regions : CommonRegions
        The two parts.
    vertices : (m,) array of int
        Vertices of the source's body that the region consists of.
    fit : PartFit
        Its map.
    """

    regions: CommonRegions
    vertices: IntArray
    fit: PartFit

    @cached_property
    def image(self) -> IntArray:
        """(n_source,) vertex of the target for each vertex of the source; −1 outside the region."""
        image = np.full(self.regions.source.shape.body.n_vertices, UNMATCHED)
        inside = np.arange(len(self.vertices))
        image[self.vertices] = self.fit.bending.image(self.fit.bent, inside)
        return image

    @cached_property
    def matched(self) -> BoolArray:
        """(n_source,) which of its vertices lie near the target, bent at the lower resolution."""
        near = self.fit.bending.spread(overlaps(self.fit.bent).astype(np.float64)) > 0.5
        matched = np.zeros(len(self.image), dtype=bool)
        matched[self.vertices] = near
        return matched

    @cached_property
    def rows(self) -> IntArray:
        """(q,) samples of the source that are matched."""
        return np.flatnonzero(self.matched[self.regions.source.vertices])

    @cached_property
    def mismatches(self) -> FloatArray:
        """(q,) how differently the parts look around them, see `BothLooks.mismatches`."""
        return self.regions.mismatches(self.rows, self._images)

    @property
    def _images(self) -> IntArray:
        return self.image[self.regions.source.vertices[self.rows]]

    @cached_property
    def worth(self) -> float:
        """What the region is worth, see `BothLooks.worth`."""
        return self.regions.worth(self.rows, self._images)

    @cached_property
    def held(self) -> int:
        """Number of landmarks that the map sends near to where they are known to go."""
        source, target = self.regions.source, self.regions.target
        image = self.image[source.landmarks]
        return int((target.shape.distance(image, target.landmarks)[image != UNMATCHED] < HELD).sum())

    @property
    def score(self) -> float:
        """How good the map is among others: its worth × orientation; 0 if it is worth nothing or mirrored."""
        return max(self.worth, 0.0) * max(self.fit.orientation, 0.0)

    def grown_again(self, most: float) -> CommonRegion:
        """Extend the region from where its samples lie, to those that cost at most so much."""
        source, target = self.regions.source, self.regions.target
        at_samples = np.full(len(source.vertices), UNMATCHED)
        known = self.rows[self.mismatches < TOO_UNLIKE]
        at_samples[known] = self.image[source.vertices[known]]
        at_samples[: len(source.landmarks)] = target.landmarks
        rows = np.flatnonzero(at_samples != UNMATCHED)[:NEXT_ANCHORS]
        columns = target.nearest_sample[at_samples[rows]]
        placed, accepted = self.regions.placed(rows, columns, len(source.vertices), most)
        images = np.where(at_samples != UNMATCHED, at_samples, target.vertices[placed])
        return replace(self.regions.region(images, accepted), origin=self.fit.origin)


def overlaps(bent: BentPart) -> BoolArray:
    """Which vertices of a bent part lie on the target, where that is not just its boundary."""
    onto, points = bent.onto.mesh, bent.points
    gap = np.linalg.norm(points.interpolated(onto.vertices) - bent.mesh.vertices, axis=1)
    found: BoolArray = gap <= np.where(Boundary(onto).holds(points), RIM, OFF)
    return found


def rough(config: Config) -> Config:
    """Change settings so that a refinement takes less time, for regions that may be wrong."""
    refining = config.refining
    steps = (
        refining.sizes_without_positions,
        refining.sizes_of_parts,
        refining.sizes_with_positions,
        refining.final_sizes,
    )
    without, of_parts, with_positions, final = (
        tuple(k for k in sizes if k <= ROUGH_FUNCTIONS) for sizes in steps
    )
    if without or with_positions or final:
        refining = replace(
            refining,
            sizes_without_positions=without,
            sizes_of_parts=of_parts,
            sizes_with_positions=with_positions,
            final_sizes=final,
        )
    return replace(
        config,
        n_columns=min(config.n_columns, 40),
        rank=min(config.rank, 20),
        n_functions=min(config.n_functions, ROUGH_FUNCTIONS),
        n_refine=min(config.n_refine, 500),
        refining=refining,
        parts=replace(
            config.parts,
            bending=config.parts.bending[::2],
            n_bent_vertices=min(config.parts.n_bent_vertices, 600),
        ),
    )


def refined_region(
    regions: CommonRegions,
    region: CommonRegion,
    pair: ShapePair,
    hints: Hints,
    stages: Stages,
    roughly: bool = False,
) -> RefinedRegion:
    """Refine the samples of a region, and what lies around them, as a part of the target."""
    source, target = regions.source, regions.target
    n = source.shape.body.n_vertices
    gap, owner = distance_along_edges_to_nearest(source.shape.body, source.vertices[region.accepted])
    vertices = _largest(source.shape, source.unit * gap <= AROUND)
    config = replace(pair.config, scale="same")
    if roughly:
        config = rough(config)
    part = region_of(source.shape, vertices, config)
    # what a length is worth on the target, as if both came in the unit of both parts
    length = part.scale / source.shape.scale * source.unit / target.unit
    part = replace(part, scale=length * target.shape.scale)
    images, number = np.full(n, -1), np.full(n, -1)
    images[source.vertices], number[vertices] = region.images, np.arange(len(vertices))
    landmarks = np.column_stack([number[hints.landmarks[:, 0]], hints.landmarks[:, 1]])
    nothing = np.zeros((len(vertices), 0)), np.zeros((target.shape.body.n_vertices, 0))
    known = Hints(landmarks[landmarks[:, 0] >= 0], NO_LANDMARKS, nothing)
    functions = pair.functions and Embedding(pair.known.source[vertices], pair.functions.target)
    relation = Part().on(ShapePair(part, target.shape, config, functions), known, stages)
    first = images[owner[vertices[part.sample_vertices[:N_ROUGH_VERTICES]]]]
    begun = relation.fits.begun(relation.fits.pair, first, region.origin)
    fit = relation.contest([begun])[0]
    return RefinedRegion(regions, vertices, cast(PartFit, fit))


def _largest(shape: PreparedShape, kept: BoolArray) -> IntArray:
    """Vertices of the largest piece of some vertices of a body, connected by its faces."""
    faces = shape.faces[kept[shape.faces].all(axis=1)]
    in_faces = np.zeros(len(kept), dtype=bool)
    in_faces[faces] = True
    _, label = linked(len(kept), (faces[:, 0], faces[:, 1]), (faces[:, 1], faces[:, 2]))
    areas = np.bincount(label, shape.body.vertex_areas * in_faces)
    return np.flatnonzero(in_faces & (label == areas.argmax()))
