"""A shape bent onto another one by a map: where its vertices lie then, and how much that stretches it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray
from isomatch._core.cached import cached_property
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
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh

SHORTEST = 1e-9  # edge, in √area, so that logarithms are finite

HardLandmarks: TypeAlias = tuple[Int[IntArray, "l"], Float[FloatArray, "l 3"]]
"""Vertices of the shape that is bent, and positions to which they are drawn."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The surface that another one is bent onto."""

    mesh: Mesh  # in √area of its own
    index: SurfaceIndex
    unit: float = 1.0  # how many times as large the shape is that is bent onto it, in the same unit


@dataclass(frozen=True, eq=False)
class BentShape:
    """A shape bent until it lies on a surface."""

    rest: Mesh  # the shape as it was, in √area of its own, perhaps at a lower resolution
    mesh: Mesh  # the same bent, in √area of the surface
    onto: Surroundings

    @cached_property
    def points(self) -> PrecisePoints:
        """Points of the surface for the vertices of the shape."""
        return nearest_with_normals(self.mesh, self.onto.mesh, self.onto.index)

    @property
    def images(self) -> Int[BodyVertices, "n"]:
        """Vertex of the surface nearest to each vertex of the shape, of the triangle that it lies on."""
        nearest = self.points.barycentric.argmax(axis=1)
        return BodyVertices(self.points.corners[np.arange(len(nearest)), nearest])

    # How badly the shape can be bent by a map is told by two measures, over edges e and vertices i:
    #     s = mean_e |log(|e| bent / |e| at rest)|     stretch: of a right map between poses, only that of the joints
    #     g = mean_i |y_i − p_i|                       gap: how far the bent shape stays away from the surface
    # A map that exchanges limbs asks for a large s; where the shape resists, g becomes large instead. The product is in
    # one unit for all maps of a pair, and needs no weight between the two: of the scores compared on elastic maps
    # (decisions.md, elastic choice), it tells wrong maps from right ones by the largest ratio.
    @property
    def stretch(self) -> float:
        """Mean |log| of the stretch of the edges."""
        after, before = (np.maximum(mesh.edge_lengths, SHORTEST) for mesh in (self.mesh, self.rest))
        return float(np.abs(np.log(after / (self.onto.unit * before))).mean())

    @property
    def turning(self) -> float:
        """Mean angle in radians between the rotations of neighbouring vertices, of what lies two edges around each."""
        # Levi & Gotsman, Smooth rotation enhanced as-rigid-as-possible mesh animation, 2015, add this variation to the
        # energy. Of two maps that stretch alike, the wrong one bends joints the other way
        i, j = self.rest.edges.T
        before, after = (mesh.vertices[j] - mesh.vertices[i] for mesh in (self.rest, self.mesh))
        n, ends = self.rest.n_vertices, (np.concatenate([i, j]), np.concatenate([j, i]))
        links = csr_array((np.ones(len(ends[0])), ends), shape=(n, n))
        of_edges = (before[:, :, None] * after[:, None, :]).reshape(-1, 9)
        at_ends = csr_array(
            (np.ones(2 * len(i)), (ends[0], np.tile(np.arange(len(i)), 2))), shape=(n, len(i))
        )
        covariances = at_ends @ of_edges
        for _ in range(2):
            covariances = covariances + links @ covariances
        rotations = nearest_rotation(covariances.reshape(-1, 3, 3))
        cosines = (np.einsum("ijk,ijk->i", rotations[i], rotations[j]) - 1.0) / 2.0
        return float(np.arccos(np.clip(cosines, -1.0, 1.0)).mean())

    @cached_property
    def spectral_residual(self) -> float:
        """The cost of bending: stretch × mean distance from the surface."""
        apart = self.points.interpolated(self.onto.mesh.vertices) - self.mesh.vertices
        return self.stretch * float(np.linalg.norm(apart, axis=1).mean())


class Bending:
    """Bends a shape onto surfaces: at a lower resolution, and from there in full."""

    # A shape at rest x_i, with areas a_i, that a map puts near the points p_i of a surface, goes to the y_i of least
    #     Σ_i a_i |y_i − p_i|² + ½ ℓ² Σ_i Σ_j w_ij |(y_i − y_j) − c_i R_i (x_i − x_j)|²,
    # where R_i are rotations, one for each vertex, and c_i = 1, or any scale in [1/c, c] if pieces may grow (as similar
    # as possible instead of as rigid as possible). The second sum is that of Sorkine & Alexa (As-rigid-as-possible
    # surface modeling, SGP 2007). For given rotations let L x̂ be what they ask for; then ∇ = 0 reads
    #     (1 + ℓ² Δ) (y − x̂) = p − x̂:
    # the shape leaves its own form x̂ for p only as far as p − x̂ is smooth on the scale ℓ, and forgets what the map has
    # wrong on smaller ones. So the lengths decrease from a third of √area, with which limbs move as wholes, to a
    # twentieth, and between two of them p_i moves to the nearest point of the surface, in space and normals. A hard
    # landmark has the weight π ℓ², that of a disc of radius ℓ, in place of a_i: it moves the piece that it is on.
    def __init__(self, shape: Mesh, n_vertices: int) -> None:  # the shape in √area of its own
        self._coarse = Prolongation(shape, decimate(shape, n_vertices))
        self._coarse_registration = RigidRegistration(self._coarse.coarse.mesh, keeps=True)
        self._full_registration = RigidRegistration(shape)

    @property
    def vertices(self) -> Int[IntArray, "n_coarse"]:
        """Vertex of the shape at each vertex of the lower resolution."""
        return self._coarse.nearest_members

    def bend_coarsely(
        self,
        onto: Surroundings,
        start: Float[FloatArray, "n_coarse 3"],  # where a map puts the vertices
        lengths: tuple[float, ...],  # ℓ, in √area of the surface
        landmarks: HardLandmarks,
        most_scaled: float = 1.0,  # c
    ) -> BentShape:
        """Bend the shape at the lower resolution."""
        vertices, points = landmarks
        landmarks = self._coarse.coarse.owner[vertices], points
        return bend_onto(self._coarse_registration, onto, start, lengths, landmarks, most_scaled)

    def bend_in_full(
        self, bent: BentShape, lengths: tuple[float, ...], landmarks: HardLandmarks, most_scaled: float = 1.0
    ) -> BentShape:
        """Bend the shape in full, from where it lies at the lower resolution."""
        start = self._coarse.on_coarse.interpolated(bent.mesh.vertices)
        return bend_onto(self._full_registration, bent.onto, start, lengths, landmarks, most_scaled)

    def images(self, bent: BentShape, vertices: Int[IntArray, "q"]) -> Int[BodyVertices, "q"]:
        """Vertices of the surface nearest to some of the shape that is bent at the lower resolution."""
        corners, weights = self._coarse.on_coarse
        places = PrecisePoints(corners[vertices], weights[vertices])
        there, here = with_normals(bent.onto.mesh), places.interpolated(with_normals(bent.mesh))
        return BodyVertices(bent.onto.index.vertices(there, here))

    def interpolate(self, values: Float[FloatArray, "n_coarse"]) -> Float[FloatArray, "n"]:
        """Interpolate values at the lower resolution on the vertices of the shape."""
        return np.asarray(self._coarse.on_coarse.interpolated(values[:, None])[:, 0])


def bend_onto(
    registration: RigidRegistration,
    onto: Surroundings,
    start: Float[FloatArray, "n 3"],
    lengths: tuple[float, ...],
    landmarks: HardLandmarks | None = None,
    most_scaled: float = 1.0,
) -> BentShape:
    """Bend a shape onto a surface, from where a map puts its vertices."""
    moved = registration(
        onto.mesh, onto.index, start, lengths, onto.unit, held=landmarks, most_scaled=most_scaled
    )
    return BentShape(registration.source, registration.source.moved(moved), onto)


class ElasticBending(Bending):
    """Bends one shape of a pair onto the other one."""

    # back: whether it is the target that is bent onto the source; landmarks: pairs of vertices of source and target
    def __init__(
        self, shape: PreparedShape, onto: PreparedShape, n_vertices: int, back: bool, landmarks: BodyVertices
    ) -> None:
        super().__init__(unit_area_mesh(shape), n_vertices)
        self._onto = Surroundings(unit_area_mesh(onto), onto.index)
        self._back, self._landmarks = back, landmarks
        self._all_vertices = np.arange(shape.body.n_vertices)

    def lay(
        self,
        coordinates: Embedding,
        lengths: tuple[float, ...],
        held: Int[BodyVertices, "q 2"] | None = None,
        most_scaled: float = 1.0,
    ) -> BentShape:
        """Bend the shape coarsely, from nearest images in coordinates; ``held`` pairs hold as landmarks do."""
        here, there = coordinates[::-1] if self._back else coordinates
        start = self._onto.mesh.vertices[self._onto.index.vertices(there, here[self.vertices])]
        pairs = self._landmarks if held is None else np.concatenate([self._landmarks, held])
        return self.bend_coarsely(self._onto, start, lengths, self._hard_landmarks(pairs), most_scaled)

    def bend_further(self, bent: BentShape, lengths: tuple[float, ...]) -> BentShape:
        """Bend the shape at the lower resolution, from where it lies."""
        return self.bend_coarsely(
            self._onto, bent.mesh.vertices, lengths, self._hard_landmarks(self._landmarks)
        )

    def lay_in_full(self, bent: BentShape, lengths: tuple[float, ...], most_scaled: float) -> BentShape:
        """Bend the shape in full, from where it lies at the lower resolution."""
        return self.bend_in_full(bent, lengths, self._hard_landmarks(self._landmarks), most_scaled)

    def pairs(self, bent: BentShape) -> Int[BodyVertices, "n 2"]:
        """All vertices of the bent shape and their images: vertices of source and target."""
        both = np.column_stack([self._all_vertices, self.images(bent, self._all_vertices)])
        return BodyVertices(both[:, ::-1] if self._back else both)

    def _hard_landmarks(self, pairs: Int[IntArray, "q 2"]) -> HardLandmarks:
        own, other = (pairs[:, ::-1] if self._back else pairs).T
        return own, self._onto.mesh.vertices[other]


def unit_area_mesh(shape: PreparedShape) -> Mesh:
    """Body of a shape, scaled to area 1."""
    mesh = shape.mesh_body
    return mesh.moved(mesh.vertices / np.sqrt(mesh.area))
