"""The triangle mesh: vertices and faces, nothing else; everything derived is computed once, on demand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from isomatch._arrays import FloatArray, IntArray
from isomatch.errors import MeshError, some


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """A triangle mesh, immutable.

    Only array shapes and types are checked here, so that a defective mesh can still be loaded, reported on by
    `check` and mended by `repair`. What needs sound faces raises `MeshError` when they are not.

    Parameters
    ----------
    vertices : (n, 3) array_like of float
        Positions, in the user's units. Stored as read-only float64.
    faces : (m, 3) array_like of int
        0-based vertex indices of each triangle. Stored as read-only int64.

    Raises
    ------
    MeshError
        If an array has the wrong shape or the faces are not integers.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> square
    Mesh(4 vertices, 2 faces)
    >>> float(square.area)
    1.0
    """

    vertices: FloatArray
    faces: IntArray

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        object.__setattr__(self, "vertices", _frozen_vertices(vertices))
        object.__setattr__(self, "faces", _frozen_faces(faces))

    def __repr__(self) -> str:
        return f"Mesh({self.n_vertices} vertices, {self.n_faces} faces)"

    @property
    def n_vertices(self) -> int:
        """Number of vertices, used by a face or not."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @cached_property
    def sound_faces(self) -> IntArray:
        """(m, 3) the faces, after every index has been seen to be in range; `MeshError` if one is not."""
        bad = np.flatnonzero(((self.faces < 0) | (self.faces >= self.n_vertices)).any(axis=1))
        if len(bad):
            raise MeshError(
                f"faces {some(bad)} refer to vertices outside 0…{self.n_vertices - 1}, so the surface is "
                "undefined there; remove them with repair(mesh) or export the file again"
            )
        return self.faces

    @cached_property
    def face_cross(self) -> FloatArray:
        """(m, 3) cross product of two edges of each face: the normal times twice the area."""
        a, b, c = (self.vertices[self.sound_faces[:, i]] for i in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def face_areas(self) -> FloatArray:
        """(m,) area of each face, in squared mesh units."""
        areas: FloatArray = 0.5 * np.linalg.norm(self.face_cross, axis=1)
        return areas

    @cached_property
    def vertex_areas(self) -> FloatArray:
        """(n,) barycentric area of each vertex: a third of its faces; 0 where no face uses it."""
        thirds = np.repeat(self.face_areas / 3, 3)
        areas: FloatArray = np.bincount(self.sound_faces.ravel(), thirds, self.n_vertices).astype(np.float64)
        return areas

    @cached_property
    def area(self) -> float:
        """Total area, in squared mesh units."""
        return float(self.face_areas.sum())

    @cached_property
    def volume(self) -> float:
        """Signed enclosed volume; positive when the faces of a closed surface look outward."""
        a, b, c = (self.vertices[self.sound_faces[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a - self.vertices.mean(axis=0), np.cross(b - a, c - a)) / 6)

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """(n, 3) area-weighted unit normals; zero where no face of positive area meets the vertex."""
        return vertex_normals(self.vertices, self.sound_faces)

    @cached_property
    def edges(self) -> IntArray:
        """(e, 2) undirected edges, each once, smaller index first, in lexicographic order."""
        half = self.sound_faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        low, high = half.min(axis=1), half.max(axis=1)
        keys = np.unique(low * self.n_vertices + high)
        return np.column_stack([keys // self.n_vertices, keys % self.n_vertices])

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """(e,) length of each edge, in mesh units."""
        x, y, z = (self.vertices[self.edges[:, 0]] - self.vertices[self.edges[:, 1]]).T
        return np.asarray(np.hypot(np.hypot(x, y), z))  # no square leaves the range of numbers

    @cached_property
    def components(self) -> IntArray:
        """(n,) label of the connected component of each vertex; a vertex no face uses is a component."""
        i, j = self.edges.T
        graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(self.n_vertices,) * 2)
        labels: IntArray = connected_components(graph, directed=False)[1].astype(np.int64)
        return labels

    def submesh(self, keep: ArrayLike) -> tuple[Mesh, IntArray]:
        """Restrict to some vertices and the faces between them.

        Parameters
        ----------
        keep : (n,) array_like of bool
            Which vertices to keep.

        Returns
        -------
        mesh : Mesh
            The restricted mesh; order is preserved.
        index : (n_kept,) array of int
            Vertex of this mesh for each vertex of the restricted one.
        """
        mask = np.asarray(keep, dtype=bool)
        index = np.flatnonzero(mask)
        renumber = np.full(self.n_vertices, -1, dtype=np.int64)
        renumber[index] = np.arange(len(index))
        faces = self.sound_faces[mask[self.sound_faces].all(axis=1)]
        return Mesh(self.vertices[index], renumber[faces]), index


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Area-weighted unit normals of each vertex, (n, 3); zero where no face of positive area meets it."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    normals = np.column_stack(
        [np.bincount(faces.ravel(), np.repeat(cross[:, x], 3), len(vertices)) for x in range(3)]
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: FloatArray = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    return unit


def _frozen_vertices(values: ArrayLike) -> FloatArray:
    array = np.array(values, dtype=np.float64, order="C")
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshError(
            f"vertices have shape {array.shape}, expected (n, 3): one row x, y, z for each vertex"
        )
    array.flags.writeable = False
    return array


def _frozen_faces(values: ArrayLike) -> IntArray:
    array = np.asarray(values)
    if array.size == 0:
        array = np.zeros((0, 3), dtype=np.int64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshError(
            f"faces have shape {array.shape}, expected (m, 3): split polygons into triangles first"
        )
    if array.dtype.kind not in "iu":
        raise MeshError(f"faces have type {array.dtype}, expected integers: vertex indices from 0")
    array = np.array(array, dtype=np.int64, order="C")
    array.flags.writeable = False
    return array
