"""Points beside a surface, carried along by the map of that surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self, cast

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from isomatch.correspondence import UNMATCHED, nearest_rotation
from isomatch.matching.judge import Solution
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray

TINY = 1e-6


@dataclass(frozen=True, eq=False)
class Carrier:
    """A motion of space that follows a map: rigid around each point, as the points nearest on the surface say.

    Parameters
    ----------
    here, there : (m, 3) array of float
        Points of the source and their images, each in units of its shape.
    units : (float, float)
        What lengths of 1 are worth in the users' units.
    scale : float
        Change of lengths.
    side : float
        1, or −1 if the map mirrors.
    falloff : float
        Power of the distance by which the weight of a point decreases.

    References
    ----------
    Schaefer, McPhail, Warren, *Image Deformation Using Moving Least Squares*, SIGGRAPH 2006.
    """

    here: FloatArray
    there: FloatArray
    units: tuple[float, float]
    scale: float
    side: float
    falloff: float

    @classmethod
    def of(cls, maps: list[Solution], falloff: float) -> Self | None:
        """Follow the maps of some components; None if they join fewer than four points."""
        main = maps[0].pair
        units = main.source.scale, main.target.scale
        here = np.concatenate([_positions(found.pair.source, units[0]) for found in maps])
        there = np.concatenate([_images(found, units[1]) for found in maps])
        known = np.isfinite(there).all(axis=1)
        here, there = here[known], there[known]
        if len(here) < 4:
            return None
        nearest = cKDTree(here).query(here, 2)[1][:, 1]
        before, after = (np.linalg.norm(x - x[nearest], axis=1) for x in (here, there))
        side = -1.0 if maps[0].quality.orientation < 0 else 1.0
        return cls(here, there, units, float(np.median(after / np.maximum(before, TINY))), side, falloff)

    def moved(self, source: PreparedShape) -> FloatArray:
        """Carry the (r, 3) samples of a component along."""
        points = _positions(source, self.units[0])
        weights = np.maximum(cdist(points, self.here), TINY) ** -self.falloff
        weights /= weights.sum(axis=1, keepdims=True)
        centre, centre_there = weights @ self.here, weights @ self.there
        products = (self.here[:, :, None] * self.there[:, None, :]).reshape(-1, 9)
        covariance = (weights @ products).reshape(-1, 3, 3) - centre[:, :, None] * centre_there[:, None, :]
        turned: FloatArray = ((points - centre)[:, None] @ _rotation(covariance, self.side))[:, 0]
        return np.asarray(centre_there + self.scale * turned)

    def gap(self, target: PreparedShape) -> float:
        """Distance of a component of the target from the surface that carries it, over √area of the component."""
        centre = _positions(target, self.units[1]).mean(axis=0)
        return float(cKDTree(self.there).query(centre)[0] * self.units[1] / target.scale)

    def offset(self, centre: FloatArray, target: PreparedShape) -> float:
        """Distance of a carried centre from that of a component, over its √area and distance from the surface."""
        apart = centre - _positions(target, self.units[1]).mean(axis=0)
        reach = (1 + self.gap(target)) * target.scale / self.units[1]
        return float(np.linalg.norm(apart) / reach)

    def turned(self, source: PreparedShape) -> FloatArray:
        """Carry the body of a component along as one rigid thing: (n, 3), its centre at 0 and its area 1 as before."""
        body, moved = cast(Mesh, source.body).vertices, self.moved(source)
        covariance = body[source.sample_vertices].T @ (moved - moved.mean(axis=0))
        turned: FloatArray = body @ _rotation(covariance, self.side)
        return turned

    def length_ratio(self, source: PreparedShape, target: PreparedShape) -> float:
        """√area of one component when it is carried along, over that of another."""
        return self.scale * source.scale / self.units[0] / (target.scale / self.units[1])

    def image(self, source: PreparedShape, target: PreparedShape) -> IntArray:
        """Map samples of a component to the nearest samples of its partner when carried there, centres together.

        In the users' vertices; −1 for all others.
        """
        moved, there = self.moved(source), _positions(target, self.units[1])
        nearest = cKDTree(there - there.mean(axis=0)).query(moved - moved.mean(axis=0))[1]
        image = np.full(source.surface.n_vertices, UNMATCHED)
        image[source.user_vertex[source.sample_vertices]] = target.user_vertex[
            target.sample_vertices[nearest]
        ]
        return image


def _rotation(covariance: FloatArray, side: float) -> FloatArray:
    """Find the rotations (..., 3, 3) of rows that keep most of covariances of two point sets; or mirror images."""
    return nearest_rotation(covariance, mirrored=side < 0)


def _positions(shape: PreparedShape, unit: float) -> FloatArray:
    """Give the samples of a component, (r, 3), in a unit of its shape."""
    samples: FloatArray = cast(Mesh, shape.surface).vertices[shape.user_vertex[shape.sample_vertices]]
    return samples / unit


def _images(found: Solution, unit: float) -> FloatArray:
    """Images of the samples of the source, (r, 3), nan where there is none."""
    source, target = found.pair.source, found.pair.target
    images = found.map.pull_back(cast(Mesh, target.surface).vertices / unit)
    return images[source.user_vertex[source.sample_vertices]]
