"""The result of a damage: the damaged mesh, and the original vertex of each of its vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.errors import MeshError, SettingError
from isomatch.mending import check
from isomatch.surfaces import Mesh
from isomatch.values.arrays import IntArray

SHARES = (0.0, 1.0)
LENGTHS = (1e-100, 1e100)  # of edges, so that areas neither vanish nor overflow


@dataclass(frozen=True, eq=False)
class Damaged:
    """A mesh made from a whole one, and the relation of their vertices.

    Parameters
    ----------
    whole : Mesh
        The mesh before the damage.
    mesh : Mesh
        The damaged mesh, n vertices.
    original : (n,) array of int
        Vertex of the whole mesh that each damaged vertex was.
    twin : (n,) array of int, optional
        Where two vertices were merged into one, the second of them; −1 elsewhere.
    stand_in : (n_whole,) array of int, optional
        Where vertices were thinned out but the surface is still there, the damaged vertex that stands for each vertex of
        the whole; −1 for those that are gone.
    """

    whole: Mesh
    mesh: Mesh
    original: IntArray
    twin: IntArray | None = None
    stand_in: IntArray | None = None

    @property
    def damaged_vertex(self) -> IntArray:
        """(n_whole,) damaged vertex that each vertex of the whole became; −1 where it is gone or was merged."""
        if self.stand_in is not None:
            return self.stand_in
        became = np.full(self.whole.n_vertices, -1, dtype=np.int64)
        single = np.ones(len(self.original), dtype=bool) if self.twin is None else self.twin < 0
        became[self.original[single]] = np.flatnonzero(single)
        return became

    @property
    def merged(self) -> IntArray:
        """Vertices of the whole that were merged with others."""
        if self.twin is None:
            return np.zeros(0, dtype=np.int64)
        pairs = self.twin >= 0
        return np.concatenate([self.original[pairs], self.twin[pairs]])

    @property
    def with_twins(self) -> IntArray:
        """(n,) ``original``, with the twin in place of the first of two merged vertices."""
        return self.original if self.twin is None else np.where(self.twin < 0, self.original, self.twin)


def with_faces(whole: Mesh, faces: IntArray) -> Damaged:
    """Make a mesh of (m, 3) faces between vertices of a whole one, without the vertices that they do not use."""
    original = np.unique(faces)
    renumber = np.zeros(whole.n_vertices, dtype=np.int64)
    renumber[original] = np.arange(len(original))
    return Damaged(whole, Mesh(whole.vertices[original], renumber[faces]), original)


def undamaged(mesh: Mesh) -> Damaged:
    """Return a mesh as its own original."""
    return Damaged(mesh, mesh, np.arange(mesh.n_vertices))


def require_usable(mesh: Mesh, name: str, level: float, bounds: tuple[float, float]) -> None:
    """Raise `MeshError` unless a mesh is a surface, and `SettingError` unless a level lies between its bounds."""
    fatal = check(mesh, wall=0.0).fatal
    if fatal:
        raise MeshError("; ".join(fatal))
    longest = float(mesh.edge_lengths.max())
    if not LENGTHS[0] < longest < LENGTHS[1]:
        raise MeshError(
            f"the longest edge of {mesh!r} is {longest:g}, whose square is no number; scale the mesh"
        )
    require_between(name, level, bounds)


def require_between(name: str, value: float, bounds: tuple[float, float]) -> None:
    """Raise `SettingError` unless a value lies strictly between two bounds."""
    low, high = bounds
    if not low < value < high:
        raise SettingError(f"{name} = {value} does not lie between {low:g} and {high:g}")
