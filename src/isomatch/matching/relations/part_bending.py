"""A part bent onto the whole by its map: where its vertices lie then, and which of the whole's it covers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence import PrecisePoints, RigidRegistration, nearest_with_normals, with_normals
from isomatch.matching.relations.part_pair import PartPair
from isomatch.matching.relations.part_refinement import PartRefinement
from isomatch.resolution import Prolongation, decimate
from isomatch.surfaces import Mesh
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_property

ON_EDGE = 1e-6  # barycentric coordinate below which a point of a triangle lies on an edge
SHORTEST = 1e-9  # edge, in √area, so that logarithms are finite
ALL_FUNCTIONS = 10**6


@dataclass(frozen=True, eq=False)
class BentPart:
    """A part bent until it lies on the surface of a whole.

    Parameters
    ----------
    pair : PartPair
        The shapes, in the unit of the map.
    flat : Mesh
        The part, in √area of its own, perhaps at a lower resolution.
    mesh : Mesh
        The same bent, in √area of the whole.
    """

    pair: PartPair
    flat: Mesh
    mesh: Mesh

    @cached_property
    def onto_whole(self) -> PrecisePoints:
        """Points of the whole for the vertices of the part."""
        return nearest_with_normals(self.mesh, self.pair.meshes[1], self.pair.whole.index)

    @property
    def images(self) -> IntArray:
        """Vertex of the whole (n_part,) nearest to each vertex of the part, of the triangle that it lies on."""
        nearest = self.onto_whole.barycentric.argmax(axis=1)
        images: IntArray = self.onto_whole.corners[np.arange(len(nearest)), nearest]
        return images

    @cached_property
    def misfit(self) -> float:
        """The cost of bending: mean |log| of the stretch of the edges × mean distance from the whole."""
        whole = self.pair.meshes[1]
        after, before = (np.maximum(mesh.edge_lengths, SHORTEST) for mesh in (self.mesh, self.flat))
        stretch = np.log(after / (self.pair.unit * before))
        apart = self.onto_whole.interpolated(whole.vertices) - self.mesh.vertices
        return float(np.abs(stretch).mean() * np.linalg.norm(apart, axis=1).mean())

    def onto_part(self) -> tuple[PrecisePoints, BoolArray]:
        """Points of the part for the vertices of the whole, and which of these the part covers.

        A vertex may lie somewhat off the part, but less so off its boundary, beyond which nothing is known. Where too few
        distances are known, the map is less exact, and it may lie as far off the boundary.
        """
        bent, whole, settings = self.mesh, self.pair.meshes[1], self.pair.config.parts
        points = nearest_with_normals(whole, bent, self.pair.part.index)
        gap = np.linalg.norm(points.interpolated(bent.vertices) - whole.vertices, axis=1)
        of_rim = np.zeros(bent.n_vertices, dtype=bool)
        of_rim[bent.boundary_edges] = True
        on_rim = (of_rim[points.corners] | (points.barycentric < ON_EDGE)).all(axis=1)
        rim = settings.off if self.pair.is_hardly_known else settings.rim
        return points, gap <= np.where(on_rim, rim, settings.off)


class PartBending:
    """Bends a part onto a whole by maps: at a lower resolution, and for the last one in full.

    Parameters
    ----------
    part : Mesh
        The part.
    n_vertices : int
        Vertices of the lower resolution.
    """

    def __init__(self, part: Mesh, n_vertices: int) -> None:
        self._coarse = Prolongation(part, decimate(part, n_vertices))
        self._registration = RigidRegistration(self._coarse.coarse.mesh)

    def coarsely(
        self, pair: PartPair, refinement: PartRefinement, image: IntArray, lengths: tuple[float, ...]
    ) -> BentPart:
        """Lay the part on the whole by a map (r,) of the vertices of a refinement, and bend it.

        ``lengths`` are those of `RigidRegistration`, in √area of the whole.
        """
        whole, index = pair.meshes[1], pair.whole.index
        of_part, of_whole = refinement.embedding(image, ALL_FUNCTIONS, self._coarse.nearest_members)
        start = index.points(of_whole, of_part).interpolated(whole.vertices)
        held = self._coarse.coarse.owner[pair.anchors[: len(pair.landmarks)]]
        return self._bent(self._registration, pair, start, lengths, held)

    def image(self, bent: BentPart, vertices: IntArray) -> IntArray:
        """Vertices of the whole nearest to some vertices (r,) of the part that is bent at the lower resolution."""
        corners, weights = self._coarse.on_coarse
        places = PrecisePoints(corners[vertices], weights[vertices])
        there, here = with_normals(bent.pair.meshes[1]), places.interpolated(with_normals(bent.mesh))
        return bent.pair.whole.index.vertices(there, here)

    def in_full(self, bent: BentPart, lengths: tuple[float, ...]) -> BentPart:
        """Bend the part in full, from where it lies at the lower resolution."""
        pair, start = bent.pair, self._coarse.on_coarse.interpolated(bent.mesh.vertices)
        held = pair.anchors[: len(pair.landmarks)]
        return self._bent(RigidRegistration(pair.meshes[0]), pair, start, lengths, held)

    def _bent(
        self,
        registration: RigidRegistration,
        pair: PartPair,
        start: FloatArray,
        lengths: tuple[float, ...],
        landmarks: IntArray,
    ) -> BentPart:
        whole, flat = pair.meshes[1], registration.source
        held = landmarks, whole.vertices[pair.landmarks]
        bent = registration(whole, pair.whole.index, start, lengths, pair.unit, held=held)
        return BentPart(pair, flat, flat.moved(bent))
