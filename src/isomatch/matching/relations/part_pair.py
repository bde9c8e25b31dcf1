"""A part and a whole in common units, with what is known of distances on the whole between points of the part."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from isomatch.correspondence import Embedding, IntervalCost
from isomatch.descriptors import RADII, BallSignature, ball_signature
from isomatch.geodesics import MissingRegion, distance_along_edges_to_nearest, distance_engine
from isomatch.matching.pair import SmoothPair
from isomatch.settings import Config
from isomatch.shapes import N_BALLS, PreparedShape
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property

# bound of the cost of a distance, in √area of the part, see `IntervalCost`; chosen on cuts and holes, not one by one
MOST_COST = 0.6

SOFT = 0.18  # of the same cost, in √area of the part; chosen on cuts and holes, not one by one

# boundary vertices through which paths may leave the part; chosen on cuts and holes, not one by one
N_POSTS = 60

# share of the pairs of anchors whose distance on the whole is known, below which ``scale = "auto"`` keeps the unit of the
# files; chosen on cuts and holes, not one by one
LEAST_TRUSTED = 0.07

# distance columns of the part whose images a start consists of; chosen on cuts and holes, not one by one
N_ANCHORS = 50

UNIT_STEP = 1.1  # ratio of the units that are tried; tolerance of the intervals

# least area of a part over that of the whole, where the units of the files say nothing; views show 16 % and more
LEAST_SHARE = 0.1

# factor by which the unit of the files may be off; FAUST remeshed: bodies of one person differ by up to 1.2
LARGEST_UNIT_CHANGE = 1.4

RADIUS_STEP = 1.25  # ratio of the radii between which ball signatures are interpolated

UNKNOWN = BallSignature(np.ones(1), np.zeros((0, 1, 4)), np.zeros(0))
NO_LANDMARKS = np.zeros((0, 2), dtype=np.int64)


@dataclass(frozen=True)
class PartPair:
    """A part and a whole; lengths are in √area of the whole. Two are equal if their shapes and units are.

    Parameters
    ----------
    part, whole : PreparedShape
        The shapes.
    unit : float
        What √area of the part is worth in √area of the whole.
    config : Config
        The settings of the match.
    missing : MissingRegion
        What lies beyond the part's boundary, in units of the part.
    anchors : (m,) array of int
        Vertices of the part whose images a start consists of: landmarks, then farthest points.
    lower, along : (m, n_part) array of float
        Lower bounds of the distances from them on the whole, and distances along the part, in its units.
    landmarks : (l,) array of int
        Vertices of the whole that the first anchors go to.
    balls : BallSignature
        Of the part, in its own units.
    functions : Embedding
        Known functions on the bodies of part and whole: (n_part, q) and (n_whole, q).
    """

    part: PreparedShape
    whole: PreparedShape
    unit: float
    config: Config
    missing: MissingRegion = field(compare=False)
    anchors: IntArray = field(compare=False)
    lower: FloatArray = field(compare=False)
    along: FloatArray = field(compare=False)
    landmarks: IntArray = field(compare=False)
    balls: BallSignature = field(compare=False)
    functions: Embedding = field(compare=False)

    @classmethod
    def of(
        cls,
        part: PreparedShape,
        whole: PreparedShape,
        config: Config,
        landmarks: IntArray = NO_LANDMARKS,
        functions: Embedding | None = None,
    ) -> PartPair:
        """Assume that both shapes came in the same units; landmarks (l, 2) are vertices of part and whole."""
        mesh = part.mesh_body
        engine = distance_engine(mesh, part.config.engine, weld=False)
        missing = MissingRegion.of(mesh, engine, N_POSTS)
        n = N_ANCHORS
        anchors = np.concatenate([landmarks[:, 0], part.column_vertices[:n]])
        along = part.columns[:n].astype(np.float64)
        if len(landmarks):
            along = np.vstack([engine.distances_from(landmarks[:, 0]), along])
        unit = 1.0 if config.scale == "area" else part.scale / whole.scale
        if part.origin is None:
            lower = missing.lower_bound(anchors, np.arange(mesh.n_vertices), along)
        else:  # limbs cut apart: at least as far as where they are fused
            fused = distance_engine(mesh, part.config.engine)
            lower = np.minimum(fused.distances_from(anchors), along)
        if functions is None:
            functions = SmoothPair(part, whole, config).known
        found = cls(
            part, whole, unit, config, missing, anchors, lower, along, landmarks[:, 1], UNKNOWN, functions
        )
        units = found.units
        first, last = RADII[0] / max(*units, LARGEST_UNIT), RADII[-1] / min(units)
        radii = np.geomspace(first, last, 2 + round(np.log(last / first) / np.log(RADIUS_STEP)))
        samples = part.sample_vertices[:N_BALLS]
        return replace(found, balls=ball_signature(mesh, radii, unit=1.0, samples=samples, weld=False))

    def with_unit(self, unit: float) -> PartPair:
        """Return the pair with another unit of the part."""
        return replace(self, unit=unit)

    @property
    def meshes(self) -> tuple[Mesh, Mesh]:
        """The bodies of part and whole."""
        return self.part.mesh_body, self.whole.mesh_body

    @property
    def cost(self) -> IntervalCost:
        """Cost of distances on the whole; the same for every unit if part and distances grow alike."""
        return IntervalCost(most=MOST_COST * self.unit, soft=SOFT * self.unit)

    @property
    def share(self) -> float:
        """Area of the part over that of the whole."""
        return self.unit**2

    def intervals(self, vertices: IntArray) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds (m, r) of distances on the whole between the anchors and r vertices of the part."""
        return self.lower[:, vertices] * self.unit, self.along[:, vertices] * self.unit

    @cached_property
    def anchor_intervals(self) -> tuple[FloatArray, FloatArray]:
        """The same between anchors, symmetric."""
        lower, upper = self.intervals(self.anchors)
        return np.minimum(lower, lower.T), 0.5 * (upper + upper.T)

    @cached_property
    def trusted(self) -> float:
        """Share of the pairs of anchors whose distance on the whole is known."""
        lower, upper = self.anchor_intervals
        return float((lower >= TRUSTED * upper)[~np.eye(len(lower), dtype=bool)].mean())

    @property
    def is_hardly_known(self) -> bool:
        """Whether so little of the whole is known that no unit is sure, and no map exact."""
        return self.trusted < LEAST_TRUSTED

    @cached_property
    def to_boundary(self) -> FloatArray:
        """(n_part,) distance of each vertex of the part to its boundary."""
        return self.missing.to_boundary * self.unit

    @cached_property
    def signature(self) -> BallSignature:
        """The ball signature of the part, in units of the whole."""
        return self.balls.scaled(self.unit, RADII)

    def stress(self, images: IntArray) -> float:
        """Mean cost of the images (m,) of the anchors."""
        lower, upper = self.anchor_intervals
        distances = np.maximum(self.whole.distances.between(images, images), 0.0)
        return float(self.cost(distances, lower, upper)[~np.eye(len(images), dtype=bool)].mean())

    @property
    def knows_unit(self) -> bool:
        """Whether the unit of the files is one that a part may have."""
        least, most = np.sqrt(LEAST_SHARE), LARGEST_UNIT_CHANGE
        return bool(self.config.scale != "free" and least / most <= self.unit <= most)

    @cached_property
    def keeps_unit(self) -> bool:
        """Whether the unit is fixed: by what is asked for, or because too few distances are known to measure it."""
        scale = self.config.scale
        unmeasured = scale == "auto" and self.is_hardly_known
        return scale in ("same", "area") or (unmeasured and self.knows_unit)

    @property
    def units(self) -> tuple[float, ...]:
        """Units to search in, by what is asked for; the given one may be anything."""
        if self.keeps_unit:
            return (min(self.unit, 1.0),)
        first, last = np.sqrt(LEAST_SHARE), 1.0
        if self.knows_unit:
            first = self.unit / LARGEST_UNIT_CHANGE
            last = min(self.unit * LARGEST_UNIT_CHANGE, 1.0)
        count = 1 + max(round(np.log(last / first) / np.log(UNIT_STEP)), 0)
        return tuple(float(unit) for unit in np.geomspace(first, last, count))

    def unit_of(self, images: IntArray) -> float:
        """Measure the unit by images (m,) of the anchors whose distances on the whole are known, where it may change."""
        lower, upper = self.anchor_intervals
        known = (lower >= TRUSTED * upper) & (upper > LONG * self.unit)
        if known.sum() < FEWEST_KNOWN:
            return self.unit
        distances = self.whole.distances.between(images, images)
        return self.restricted(self.unit * float(np.median(distances[known] / upper[known])))

    def in_unit_of(self, image: IntArray) -> PartPair:
        """Return the pair in the unit that a map (n_part,) measures, within those to search in."""
        units = self.units
        return self.with_unit(float(np.clip(self.unit_of(image[self.anchors]), units[0], units[-1])))

    def restricted(self, unit: float) -> float:
        """Return the nearest unit that is allowed: one on a grid around that of the pair, and not much above 1."""
        if self.keeps_unit:
            return self.unit
        steps = np.round(np.log(unit / self.unit) / UNIT_GRID)
        return min(self.unit * float(np.exp(UNIT_GRID * steps)), LARGEST_UNIT)


TRUSTED = 0.97  # lower over upper bound from which a distance counts as known
LONG = 0.3  # √(area of the part): shorter distances do not measure the unit
FEWEST_KNOWN = 40
UNIT_GRID = 0.02  # logarithm of the ratio of two units that are told apart
LARGEST_UNIT = 1.05


def areas_of_samples(shape: PreparedShape, samples: IntArray) -> FloatArray:
    """Area (r,) of the vertices nearest to each of r samples."""
    owner = distance_along_edges_to_nearest(shape.body, samples)[1]
    number = np.zeros(shape.body.n_vertices, dtype=np.int64)
    number[samples] = np.arange(len(samples))
    areas = np.bincount(number[owner], shape.body.vertex_areas, len(samples))
    return np.asarray(areas, dtype=np.float64)
