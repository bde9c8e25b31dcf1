"""A part bent onto the whole by its map: where its vertices lie then, and which of the whole's it covers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import BoolArray, IntArray
from isomatch._cached import cached_property
from isomatch.correspondence import PrecisePoints, nearest_with_normals, register_as_rigid_as_possible
from isomatch.matching.parts.part_pair import PartPair
from isomatch.matching.parts.part_refinement import PartRefinement
from isomatch.surfaces import Mesh

ON_EDGE = 1e-6  # barycentric coordinate below which a point of a triangle lies on an edge
SHORTEST = 1e-9  # edge, in √area, so that logarithms are finite
ALL_FUNCTIONS = 10**6


@dataclass(frozen=True, eq=False)
class BentPart:
    """A part laid on the whole by a map, and bent until it lies on its surface.

    Parameters
    ----------
    pair : PartPair
        The shapes, in the unit of the map.
    refinement : PartRefinement
        Of the map.
    image : (r,) array of int
        Vertices of the whole for those of the refinement.
    lengths : tuple of float
        See `register_as_rigid_as_possible`, in √area of the whole.
    """

    pair: PartPair
    refinement: PartRefinement
    image: IntArray
    lengths: tuple[float, ...]

    @cached_property
    def mesh(self) -> Mesh:
        """The bent part, in √area of the whole."""
        (part, whole), index = self.pair.meshes, self.pair.whole.index
        everywhere = np.arange(part.n_vertices)
        of_part, of_whole = self.refinement.embedding(self.image, ALL_FUNCTIONS, everywhere)
        start = index.points(of_whole, of_part).interpolated(whole.vertices)
        scaled = part.moved(self.pair.unit * part.vertices)
        landmarks = self.pair.landmarks
        held = self.pair.anchors[: len(landmarks)], whole.vertices[landmarks]
        return part.moved(register_as_rigid_as_possible(scaled, whole, index, start, self.lengths, held=held))

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
        """What speaks against the map: mean |log| of the stretch of the edges × mean distance from the whole."""
        part, whole = self.pair.meshes
        after, before = (np.maximum(mesh.edge_lengths, SHORTEST) for mesh in (self.mesh, part))
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
