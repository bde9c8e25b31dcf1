"""One of two parts of a body: what it tells of distances, areas and looks, as far as its boundary lets it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence import Intervals
from isomatch.descriptors import BallSignature, ball_signature
from isomatch.geodesics import MissingRegion, distance_along_edges_to_nearest, distance_engine
from isomatch.matching.relations.part_pair import N_POSTS, NO_LANDMARKS, areas_of_samples
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_property

N_SAMPLES = 600  # vertices of each part that are mapped; chosen, not measured
MOST_LANDMARKS = 50  # that lead the search, of those given; all lead the refinement

# lengths below are in the unit of both parts, about √area of the body that they are parts of

# √area of the body over the root mean square of those of its parts; only the unit of the bounds below
BODY = 1.25

# times that one part may be as long as the other in the units of the files; beyond, the areas are taken for equal
MOST_UNLIKE = 4.0

# of the balls whose moments are compared; small ones are noise, large ones cross the boundary
MOMENT_RADII = (0.06, 0.09, 0.13, 0.18, 0.24)

# of the balls whose areas are compared
AREA_RADII = tuple(0.05 * i for i in range(1, 13))
OVERHANG = 0.02  # by which a ball may reach over a boundary and count


@dataclass(frozen=True, eq=False)
class BothSide:
    """One of two parts.

    Parameters
    ----------
    shape : PreparedShape
        The part.
    unit : float
        What √area of the part is worth in the unit of both.
    landmarks : (l,) array of int
        Vertices whose counterparts on the other part are known.
    """

    shape: PreparedShape
    unit: float
    landmarks: IntArray

    @cached_property
    def vertices(self) -> IntArray:
        """(r,) its samples: the landmarks, then vertices evenly spread."""
        spread = self.shape.sample_vertices
        return np.concatenate([self.landmarks, spread[~np.isin(spread, self.landmarks)]])[:N_SAMPLES]

    @cached_property
    def _missing(self) -> MissingRegion:
        mesh = self.shape.mesh_body
        return MissingRegion.of(mesh, distance_engine(mesh, self.shape.config.engine, weld=False), N_POSTS)

    @cached_property
    def to_boundary(self) -> FloatArray:
        """(n,) distance of each vertex to the boundary."""
        return self.unit * self._missing.to_boundary

    @cached_property
    def intervals(self) -> Intervals:
        """Of distances on the body between the samples, (r, r)."""
        return self.intervals_from(self.vertices)

    def intervals_from(self, vertices: IntArray) -> Intervals:
        """Of distances on the body between some vertices (m,) and the samples, (m, r)."""
        along = np.maximum(self.shape.distances.between(vertices, self.vertices), 0.0)
        along = np.where(vertices[:, None] == self.vertices, 0.0, along)
        lower = self._missing.lower_bound(vertices, self.vertices, along)
        return Intervals(self.unit * lower, self.unit * along)

    @cached_property
    def areas(self) -> FloatArray:
        """(r,) area around each sample."""
        return self.unit**2 * areas_of_samples(self.shape, self.vertices)

    @cached_property
    def looks(self) -> BallSignature:
        """The ball signature of every vertex."""
        return ball_signature(
            self.shape.mesh_body, MOMENT_RADII, unit=1 / self.unit, samples=self.vertices, weld=False
        )

    @cached_property
    def ball_areas(self) -> tuple[FloatArray, BoolArray]:
        """Logarithms of the areas of balls around the samples, (r, q), and which of them no boundary cuts."""
        radii, along = np.array(AREA_RADII), self.intervals.upper
        areas = np.stack([(along < radius) @ self.areas for radius in radii], axis=1)
        known = radii <= self.to_boundary[self.vertices, None] + OVERHANG
        return np.log(np.maximum(areas, self.areas[:, None])), known

    @cached_property
    def nearest_sample(self) -> IntArray:
        """(n,) number of the sample nearest to each vertex."""
        owner = distance_along_edges_to_nearest(self.shape.body, self.vertices)[1]
        number = np.zeros(self.shape.body.n_vertices, dtype=np.int64)
        number[self.vertices] = np.arange(len(self.vertices))
        nearest: IntArray = number[owner]
        return nearest


def two_sides(
    source: PreparedShape, target: PreparedShape, same_area: bool, landmarks: IntArray = NO_LANDMARKS
) -> tuple[BothSide, BothSide]:
    """Both parts in one unit: that of the files, unless these are too unlike or areas are to be the same."""
    lengths = np.array([source.scale, target.scale])
    if same_area or lengths.max() > MOST_UNLIKE * lengths.min():
        lengths[:] = 1.0
    first = landmarks[:MOST_LANDMARKS]
    units = lengths / (BODY * np.sqrt((lengths**2).mean()))
    return (
        BothSide(source, float(units[0]), first[:, 0]),
        BothSide(target, float(units[1]), first[:, 1]),
    )
