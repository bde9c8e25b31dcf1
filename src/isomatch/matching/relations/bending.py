"""A shape bent onto another one by a map: where its vertices lie then, and how much that stretches it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence import (
    PrecisePoints,
    RigidRegistration,
    SurfaceIndex,
    nearest_with_normals,
    with_normals,
)
from isomatch.resolution import Prolongation, decimate
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property

SHORTEST = 1e-9  # edge, in √area, so that logarithms are finite

Held = tuple[IntArray, FloatArray]
"""Vertices (l,) that are held, and positions (l, 3) to which they are drawn."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The surface that another one is bent onto.

    Parameters
    ----------
    mesh : Mesh
        In √area of its own.
    index : SurfaceIndex
        Of the mesh.
    unit : float
        How many times as large the shape is that is bent onto it, in the same unit.
    """

    mesh: Mesh
    index: SurfaceIndex
    unit: float = 1.0


@dataclass(frozen=True, eq=False)
class Bent:
    """A shape bent until it lies on a surface.

    Parameters
    ----------
    flat : Mesh
        The shape, in √area of its own, perhaps at a lower resolution.
    mesh : Mesh
        The same bent, in √area of the surface.
    onto : Surroundings
        The surface.
    """

    flat: Mesh
    mesh: Mesh
    onto: Surroundings

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
    """Bends a shape onto surfaces: at a lower resolution, and from there in full.

    Parameters
    ----------
    shape : Mesh
        In √area of its own.
    n_vertices : int
        Vertices of the lower resolution.
    """

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
        """Bend the shape at the lower resolution.

        Parameters
        ----------
        onto : Surroundings
        start : (n_coarse, 3) array of float
            Where a map puts its vertices on the surface.
        lengths : tuple of float
            See `register_as_rigid_as_possible`; in √area of the surface.
        held : (l,) array of int and (l, 3) array of float
            Vertices of the shape in full, and where they are drawn to.
        most_scaled : float
            See `RigidRegistration`.
        """
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
