"""A shape bent onto another one by a map: where its vertices lie then, and how much that stretches it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence import (
    Embedding,
    PrecisePoints,
    RigidRegistration,
    SurfaceIndex,
    nearest_with_normals,
    with_normals,
)
from isomatch.resolution import Prolongation, decimate
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property

SHORTEST = 1e-9  # edge, in √area, so that logarithms are finite

Held = tuple[IntArray, FloatArray]
"""Vertices (l,) that are held, and positions (l, 3) to which they are drawn."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The surface that another one is bent onto."""

    mesh: Mesh  # in √area of its own
    index: SurfaceIndex  # of the mesh
    unit: float = 1.0  # how many times as large the shape is that is bent onto it, in the same unit


@dataclass(frozen=True, eq=False)
class Bent:
    """A shape bent until it lies on a surface."""

    flat: Mesh  # the shape, in √area of its own, perhaps at a lower resolution
    mesh: Mesh  # the same bent, in √area of the surface
    onto: Surroundings  # the surface

    @cached_property
    def points(self) -> PrecisePoints:
        """Points of the surface for the vertices of the shape."""
        return nearest_with_normals(self.mesh, self.onto.mesh, self.onto.index)

    @property
    def images(self) -> IntArray:
        """Vertex of the surface (n,) nearest to each vertex of the shape, of the triangle that it lies on."""
        nearest = self.points.barycentric.argmax(axis=1)
        images: IntArray = self.points.corners[np.arange(len(nearest)), nearest]
        return images

    @property
    def stretch(self) -> float:
        """Mean |log| of the stretch of the edges."""
        after, before = (np.maximum(mesh.edge_lengths, SHORTEST) for mesh in (self.mesh, self.flat))
        return float(np.abs(np.log(after / (self.onto.unit * before))).mean())

    @cached_property
    def misfit(self) -> float:
        """The cost of bending: stretch × mean distance from the surface."""
        apart = self.points.interpolated(self.onto.mesh.vertices) - self.mesh.vertices
        return self.stretch * float(np.linalg.norm(apart, axis=1).mean())


class Bending:
    """Bends a shape onto surfaces: at a lower resolution, and from there in full."""

    def __init__(self, shape: Mesh, n_vertices: int) -> None:
        self._coarse = Prolongation(shape, decimate(shape, n_vertices))
        self._coarsely = RigidRegistration(self._coarse.coarse.mesh, keeps=True)
        self._in_full = RigidRegistration(shape)

    @property
    def vertices(self) -> IntArray:
        """Vertex of the shape (n_coarse,) at each vertex of the lower resolution."""
        return self._coarse.nearest_members

    def coarsely(
        self,
        onto: Surroundings,
        start: FloatArray,
        lengths: tuple[float, ...],
        held: Held,
        most_scaled: float = 1.0,
    ) -> Bent:
        """Bend the shape at the lower resolution."""
        vertices, points = held
        return self._bent(
            self._coarsely, onto, start, lengths, (self._coarse.coarse.owner[vertices], points), most_scaled
        )

    def in_full(self, bent: Bent, lengths: tuple[float, ...], held: Held, most_scaled: float = 1.0) -> Bent:
        """Bend the shape in full, from where it lies at the lower resolution."""
        start = self._coarse.on_coarse.interpolated(bent.mesh.vertices)
        return self._bent(self._in_full, bent.onto, start, lengths, held, most_scaled)

    def images(self, bent: Bent, vertices: IntArray) -> IntArray:
        """Vertices of the surface nearest to some vertices (r,) of the shape that is bent at the lower resolution."""
        corners, weights = self._coarse.on_coarse
        places = PrecisePoints(corners[vertices], weights[vertices])
        there, here = with_normals(bent.onto.mesh), places.interpolated(with_normals(bent.mesh))
        return bent.onto.index.vertices(there, here)

    def spread(self, values: FloatArray) -> FloatArray:
        """Interpolate values (n_coarse,) at the lower resolution on the vertices of the shape."""
        spread: FloatArray = self._coarse.on_coarse.interpolated(values[:, None])[:, 0]
        return spread

    def _bent(
        self,
        registration: RigidRegistration,
        onto: Surroundings,
        start: FloatArray,
        lengths: tuple[float, ...],
        held: Held,
        most_scaled: float,
    ) -> Bent:
        moved = registration(
            onto.mesh, onto.index, start, lengths, onto.unit, held=held, most_scaled=most_scaled
        )
        return Bent(registration.source, registration.source.moved(moved), onto)


class ElasticBending:
    """Bends one shape of a pair onto the other one."""

    def __init__(
        self, shape: PreparedShape, onto: PreparedShape, n_vertices: int, back: bool, landmarks: IntArray
    ) -> None:
        self._bending = Bending(_of_area_1(shape), n_vertices)
        self._onto = Surroundings(_of_area_1(onto), onto.index)
        self._back, self._landmarks = back, landmarks
        self._all_vertices = np.arange(shape.body.n_vertices)

    def coarsely(
        self,
        drawn: Embedding,
        lengths: tuple[float, ...],
        known: IntArray | None = None,
        most_scaled: float = 1.0,
    ) -> Bent:
        """Bend the shape at the low resolution, from where images are nearest in coordinates of both bodies."""
        here, there = drawn[::-1] if self._back else drawn
        image = self._onto.index.vertices(there, here[self._bending.vertices])
        pairs = self._landmarks if known is None else np.concatenate([self._landmarks, known])
        start = self._onto.mesh.vertices[image]
        return self._bending.coarsely(self._onto, start, lengths, self._held(pairs), most_scaled)

    def further(self, bent: Bent, lengths: tuple[float, ...]) -> Bent:
        """Bend the shape at the low resolution, from where it lies."""
        return self._bending.coarsely(self._onto, bent.mesh.vertices, lengths, self._held(self._landmarks))

    def in_full(self, bent: Bent, lengths: tuple[float, ...], most_scaled: float) -> Bent:
        """Bend the shape in full, from where it lies at the low resolution."""
        return self._bending.in_full(bent, lengths, self._held(self._landmarks), most_scaled)

    def images(self, bent: Bent, vertices: IntArray) -> IntArray:
        """Vertices of the other shape nearest to some vertices (r,) of the one that is bent."""
        return self._bending.images(bent, vertices)

    def pairs(self, bent: Bent) -> IntArray:
        """All vertices of the bent shape and their images: (n, 2) vertices of source and target."""
        both = np.column_stack([self._all_vertices, self.images(bent, self._all_vertices)])
        return both[:, ::-1] if self._back else both

    def _held(self, pairs: IntArray) -> Held:
        own, other = (pairs[:, ::-1] if self._back else pairs).T
        return own, self._onto.mesh.vertices[other]


def _of_area_1(shape: PreparedShape) -> Mesh:
    mesh = shape.mesh_body
    return mesh.moved(mesh.vertices / np.sqrt(mesh.area))
