"""Two shapes of an elastic match bent onto each other, from smooth maps."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import Embedding
from isomatch.matching.relations.bending import Bending, Bent, Held, Surroundings
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh
from isomatch.values.arrays import IntArray


class ElasticBending:
    """Bends one shape of a pair onto the other one.

    Parameters
    ----------
    shape, onto : PreparedShape
        The shape that is bent, and the other one.
    n_vertices : int
        Vertices of the shape at the low resolution.
    back : bool
        Whether the target is bent onto the source.
    landmarks : (l, 2) array of int
        Vertices of source and target that correspond; they hold.
    """

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
        """Bend the shape at the low resolution, from where images are nearest in coordinates of both bodies.

        ``known`` pairs (q, 2) of vertices of source and target hold, as landmarks. The rest is as in `Bending.coarsely`.
        """
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
