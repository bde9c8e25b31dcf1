"""A part bent onto the whole by its map: where its vertices lie then, and which of the whole's it covers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence import Boundary, PrecisePoints, nearest_with_normals
from isomatch.matching.relations.bending import Bending, Bent, Held, Surroundings
from isomatch.matching.relations.part_pair import PartPair
from isomatch.matching.relations.part_refinement import PartRefinement
from isomatch.surfaces import Mesh
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

ALL_FUNCTIONS = 10**6


@dataclass(frozen=True, eq=False)
class BentPart(Bent):
    """A part bent until it lies on the surface of a whole.

    Parameters
    ----------
    pair : PartPair
        The shapes, in the unit of the map.
    """

    pair: PartPair

    def onto_part(self) -> tuple[PrecisePoints, BoolArray]:
        """Points of the part for the vertices of the whole, and which of these the part covers.

        A vertex may lie somewhat off the part, but less so off its boundary, beyond which nothing is known. Where too few
        distances are known, the map is less exact, and it may lie as far off the boundary.
        """
        bent, whole, settings = self.mesh, self.onto.mesh, self.pair.config.parts
        points = nearest_with_normals(whole, bent, self.pair.part.index)
        gap = np.linalg.norm(points.interpolated(bent.vertices) - whole.vertices, axis=1)
        rim = settings.off if self.pair.is_hardly_known else settings.rim
        return points, gap <= np.where(Boundary(bent).holds(points), rim, settings.off)


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
        self._bending = Bending(part, n_vertices)

    def coarsely(
        self, pair: PartPair, refinement: PartRefinement, image: IntArray, lengths: tuple[float, ...]
    ) -> BentPart:
        """Lay the part on the whole by a map (r,) of the vertices of a refinement, and bend it.

        ``lengths`` are those of `RigidRegistration`, in √area of the whole.
        """
        onto = Surroundings(pair.meshes[1], pair.whole.index, pair.unit)
        of_part, of_whole = refinement.embedding(image, ALL_FUNCTIONS, self._bending.vertices)
        start = onto.index.points(of_whole, of_part).interpolated(onto.mesh.vertices)
        bent = self._bending.coarsely(onto, start, lengths, _held(pair))
        return BentPart(bent.flat, bent.mesh, onto, pair)

    def image(self, bent: BentPart, vertices: IntArray) -> IntArray:
        """Vertices of the whole nearest to some vertices (r,) of the part that is bent at the lower resolution."""
        return self._bending.images(bent, vertices)

    def spread(self, values: FloatArray) -> FloatArray:
        """Interpolate values (n_coarse,) at the lower resolution on the vertices of the part."""
        return self._bending.spread(values)

    def in_full(self, bent: BentPart, lengths: tuple[float, ...]) -> BentPart:
        """Bend the part in full, from where it lies at the lower resolution."""
        full = self._bending.in_full(bent, lengths, _held(bent.pair))
        return BentPart(full.flat, full.mesh, full.onto, bent.pair)


def _held(pair: PartPair) -> Held:
    return pair.anchors[: len(pair.landmarks)], pair.meshes[1].vertices[pair.landmarks]
