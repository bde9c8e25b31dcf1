"""Bending a shape onto another one by a map, and measures of the bent shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray
from isomatch._core.cached import cached_method, cached_property
from isomatch.correspondence import (
    Embedding,
    PrecisePoints,
    RigidRegistration,
    SurfaceIndex,
    nearest_rotation,
    nearest_with_normals,
    with_normals,
)
from isomatch.decimation import Prolongation, decimate
from isomatch.matching.problem import Problem
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh

MIN_EDGE = 1e-9  # √area; lengths of edges below this are raised to it, so that logarithms are finite; chosen

HardLandmarks: TypeAlias = tuple[Int[IntArray, "l"], Float[FloatArray, "l 3"]]
"""Vertices of the bent shape, and the positions to which they are drawn."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The surface onto which a shape is bent."""

    mesh: Mesh  # the surface, in its own √area
    index: SurfaceIndex
    unit: float = 1.0  # √area of the bent shape over √area of this surface


@dataclass(frozen=True, eq=False)
class BentShape:
    """A shape bent until it lies on a surface."""

    rest: Mesh  # the shape before it was bent, in its own √area, at the resolution at which it was bent
    mesh: Mesh  # the bent shape, in √area of the surface
    onto: Surroundings

    @cached_property
    def points(self) -> PrecisePoints:
        """Nearest point of the surface for each vertex of the shape."""
        return nearest_with_normals(self.mesh, self.onto.mesh, self.onto.index)

    @property
    def images(self) -> Int[BodyVertices, "n"]:
        """For each vertex of the shape, the nearest corner of the triangle of its point."""
        nearest = self.points.barycentric.argmax(axis=1)
        return BodyVertices(self.points.corners[np.arange(len(nearest)), nearest])

    # Two measures tell how well a map can bend the shape, means over its edges e and its vertices i, where
    # y_i is the bent vertex and p_i the nearest point of the surface:
    #     s = mean_e |log(|e| bent / |e| at rest)|     stretch
    #     g = mean_i |y_i − p_i|                       gap between the bent shape and the surface
    # A right map between poses stretches only joints. A map that exchanges limbs needs a large s, or, where
    # the shape resists, leaves a large g. The product s g has one unit for all maps of a pair and needs no
    # weight. Of the scores compared on elastic maps, s g of both shapes separates wrong maps from right ones
    # by the largest ratio (decisions.md, elastic choice).
    @property
    def stretch(self) -> float:
        """Mean |log| of the stretch of the edges."""
        after, before = (np.maximum(mesh.edge_lengths, MIN_EDGE) for mesh in (self.mesh, self.rest))
        return float(np.abs(np.log(after / (self.onto.unit * before))).mean())

    @property
    def turning(self) -> float:
        """Mean angle in radians between rotations of neighbouring vertices, each fitted to two rings."""
        # Levi & Gotsman, Smooth rotation enhanced as-rigid-as-possible mesh animation, 2015, have an energy
        # of the differences between rotations of neighbours. A wrong map may stretch as little as a right
        # one, but turns joints the wrong way.
        i, j = self.rest.edges.T
        before, after = (mesh.vertices[j] - mesh.vertices[i] for mesh in (self.rest, self.mesh))
        n, ends = self.rest.n_vertices, (np.concatenate([i, j]), np.concatenate([j, i]))
        links = csr_array((np.ones(len(ends[0])), ends), shape=(n, n))
        of_edges = (before[:, :, None] * after[:, None, :]).reshape(-1, 9)
        edge_rows = np.tile(np.arange(len(i)), 2)
        at_ends = csr_array((np.ones(2 * len(i)), (ends[0], edge_rows)), shape=(n, len(i)))
        covariances = at_ends @ of_edges
        for _ in range(2):
            covariances = covariances + links @ covariances
        rotations = nearest_rotation(covariances.reshape(-1, 3, 3))
        cosines = (np.einsum("ijk,ijk->i", rotations[i], rotations[j]) - 1.0) / 2.0
        return float(np.arccos(np.clip(cosines, -1.0, 1.0)).mean())

    @cached_property
    def bending_cost(self) -> float:
        """The cost of bending: stretch × mean distance from the surface."""
        offset = self.points.interpolated(self.onto.mesh.vertices) - self.mesh.vertices
        return self.stretch * float(np.linalg.norm(offset, axis=1).mean())


class CoarseShape:
    """A shape at a lower resolution, and registrations that share their factors."""

    def __init__(self, shape: Mesh, n_vertices: int) -> None:
        self.prolongation = Prolongation(shape, decimate(shape, n_vertices))
        self.registration = RigidRegistration(self.prolongation.coarse.mesh, keeps=True)


class CoarseShapes:
    """Source and target of a pair, in area 1, at lower resolutions."""

    def __init__(self, pair: Problem) -> None:
        self.meshes = [unit_area_mesh(shape) for shape in (pair.source, pair.target)]

    @cached_method
    def at(self, side: int, n_vertices: int) -> CoarseShape:
        """Decimate the source, side 0, or the target, side 1."""
        return CoarseShape(self.meshes[side], n_vertices)


@cached_method
def coarse_shapes(pair: Problem) -> CoarseShapes:
    """Return the coarse shapes of a pair, which are kept with it."""
    return CoarseShapes(pair)


class Bending:
    """Bends a shape onto surfaces: at a lower resolution, and then at full resolution."""

    # Let x_i be the vertices of the shape at rest, a_i their areas, and p_i the points of the
    # surface to which a map sends them. The bent shape y minimises
    #     Σ_i a_i |y_i − p_i|² + ½ ℓ² Σ_i Σ_j w_ij |(y_i − y_j) − c_i R_i (x_i − x_j)|²,
    # where w_ij are weights of edges, R_i are rotations, and c_i is 1, or a scale in [1/c, c] if pieces are
    # allowed to grow (as similar as possible instead of as rigid as possible). The second sum is from Sorkine
    # & Alexa (As-rigid-as-possible surface modeling, SGP 2007). For fixed rotations, let x̂ minimise it. Then
    # y satisfies
    #     (1 + ℓ² Δ) (y − x̂) = p − x̂,
    # so y differs from x̂ only by p − x̂ smoothed over the length ℓ, and errors of the map on
    # shorter lengths have no effect. The lengths ℓ decrease from a third of √area, where
    # limbs move as wholes, to a twentieth. Between two lengths, p_i moves to the nearest point of
    # the surface, in space and normals. A hard landmark has the weight π ℓ² of a disc of radius ℓ
    # instead of a_i, so that it moves the piece on which it lies.
    def __init__(self, coarse: CoarseShape) -> None:  # of a shape of area 1
        self._coarse, self._coarse_registration = coarse.prolongation, coarse.registration
        self._full_registration = RigidRegistration(coarse.prolongation.fine)

    @property
    def vertices(self) -> Int[IntArray, "n_coarse"]:
        """Vertex of the shape nearest to each vertex of the lower resolution."""
        return self._coarse.nearest_members

    def bend_coarsely(
        self,
        onto: Surroundings,
        start: Float[FloatArray, "n_coarse 3"],  # positions to which a map sends the vertices
        lengths: tuple[float, ...],  # ℓ, in √area of the surface
        landmarks: HardLandmarks,
        most_scaled: float = 1.0,  # c, the factor by which pieces are allowed to grow or shrink
    ) -> BentShape:
        """Bend the shape at the lower resolution."""
        vertices, points = landmarks
        landmarks = self._coarse.coarse.owner[vertices], points
        return bend_onto(self._coarse_registration, onto, start, lengths, landmarks, most_scaled)

    def bend_in_full(
        self, bent: BentShape, lengths: tuple[float, ...], landmarks: HardLandmarks, most_scaled: float = 1.0
    ) -> BentShape:
        """Bend the shape at full resolution, starting from its bent coarse version."""
        start = self._coarse.on_coarse.interpolated(bent.mesh.vertices)
        return bend_onto(self._full_registration, bent.onto, start, lengths, landmarks, most_scaled)

    def images(self, bent: BentShape, vertices: Int[IntArray, "q"]) -> Int[BodyVertices, "q"]:
        """Map vertices to the nearest vertices of the surface, after coarse bending."""
        corners, weights = self._coarse.on_coarse
        points = PrecisePoints(corners[vertices], weights[vertices])
        onto, bent_points = with_normals(bent.onto.mesh), points.interpolated(with_normals(bent.mesh))
        return BodyVertices(bent.onto.index.vertices(onto, bent_points))

    def interpolate(self, values: Float[FloatArray, "n_coarse"]) -> Float[FloatArray, "n"]:
        """Interpolate values from the lower resolution to the vertices of the shape."""
        return np.asarray(self._coarse.on_coarse.interpolated(values[:, None])[:, 0])


def bend_onto(
    registration: RigidRegistration,
    onto: Surroundings,
    start: Float[FloatArray, "n 3"],
    lengths: tuple[float, ...],
    landmarks: HardLandmarks | None = None,
    most_scaled: float = 1.0,
) -> BentShape:
    """Bend a shape onto a surface, starting from positions that a map gives its vertices."""
    surface = onto.mesh, onto.index
    moved = registration(*surface, start, lengths, onto.unit, held=landmarks, most_scaled=most_scaled)
    return BentShape(registration.source, registration.source.moved(moved), onto)


class ElasticBending(Bending):
    """Bends one shape of a pair onto the other one."""

    # ``back``: whether the target is bent onto the source; landmarks are pairs of source and target vertices
    def __init__(self, pair: Problem, n_vertices: int, back: bool, landmarks: BodyVertices) -> None:
        coarse = coarse_shapes(pair)
        super().__init__(coarse.at(int(back), n_vertices))
        shape, onto = (pair.target, pair.source) if back else (pair.source, pair.target)
        self._onto = Surroundings(coarse.meshes[not back], onto.index)
        self._back, self._all_vertices = back, np.arange(shape.body.n_vertices)
        self._landmarks, self._held = landmarks, self._hard_landmarks(landmarks)

    def lay(
        self,
        coordinates: Embedding,
        lengths: tuple[float, ...],
        held: Int[BodyVertices, "q 2"] | None = None,
        most_scaled: float = 1.0,
    ) -> BentShape:
        """Bend coarsely, starting from nearest points; ``held`` pairs are further landmarks."""
        of_shape, of_surface = coordinates[::-1] if self._back else coordinates
        start = self._onto.mesh.vertices[self._onto.index.vertices(of_surface, of_shape[self.vertices])]
        hold = self._held if held is None else self._hard_landmarks(np.concatenate([self._landmarks, held]))
        return self.bend_coarsely(self._onto, start, lengths, hold, most_scaled)

    def bend_further(self, bent: BentShape, lengths: tuple[float, ...]) -> BentShape:
        """Bend the shape further at the lower resolution."""
        return self.bend_coarsely(self._onto, bent.mesh.vertices, lengths, self._held)

    def lay_in_full(self, bent: BentShape, lengths: tuple[float, ...], most_scaled: float) -> BentShape:
        """Bend the shape at full resolution, starting from its bent coarse version."""
        return self.bend_in_full(bent, lengths, self._held, most_scaled)

    def pairs(self, bent: BentShape) -> Int[BodyVertices, "n 2"]:
        """Pairs of all vertices and their images, as source and target vertices."""
        both = np.column_stack([self._all_vertices, self.images(bent, self._all_vertices)])
        return BodyVertices(both[:, ::-1] if self._back else both)

    def _hard_landmarks(self, pairs: Int[IntArray, "q 2"]) -> HardLandmarks:
        of_shape, of_surface = (pairs[:, ::-1] if self._back else pairs).T
        return of_shape, self._onto.mesh.vertices[of_surface]


def unit_area_mesh(shape: PreparedShape) -> Mesh:
    """Body of a shape, scaled to area 1."""
    mesh = shape.mesh_body
    return mesh.moved(mesh.vertices / np.sqrt(mesh.area))
