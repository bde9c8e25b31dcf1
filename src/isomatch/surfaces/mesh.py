"""The triangle mesh: vertices, faces, and what is derived from them at first use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray, array_of, numbers_of
from isomatch._core.cached import cached_property
from isomatch._core.errors import MeshError
from isomatch.surfaces._edges import EdgeTable, edge_table, label_components, lengths
from isomatch.surfaces._faces import areas_of, cross_products, require_vertices, vertex_normals
from isomatch.surfaces._shared import Plotted, hash_of


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Plotted):
    """An immutable triangle mesh.

    Only the shapes and types of the arrays are checked, so that a defective mesh can still be loaded,
    examined by `check` and repaired by `repair`. Properties that need valid face indices raise
    `MeshError` for others.

    Parameters
    ----------
    vertices : (n, 3) array_like of float
        Positions, in the user's units. Stored as read-only float64.
    faces : (m, 3) array_like of int
        0-based vertex indices of each triangle. Stored as read-only int64.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> square
    Mesh(4 vertices, 2 faces)
    >>> float(square.area), square.boundary_lengths.tolist()
    (1.0, [4.0])
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
        """Number of vertices, including those that no face uses."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @property
    def sound_faces(self) -> IntArray:
        """(m, 3) the faces; `MeshError` if a vertex index is out of range."""
        return self._connectivity.sound_faces

    @cached_property
    def _connectivity(self) -> _Connectivity:
        return _Connectivity(self.faces, self.n_vertices)

    @cached_property
    def face_cross(self) -> FloatArray:
        """(m, 3) cross product of two edges of each face: its unit normal times twice its area."""
        return cross_products(self.vertices, self.sound_faces)

    @cached_property
    def face_areas(self) -> FloatArray:
        """(m,) area of each face, in squared mesh units."""
        return areas_of(self.vertices, self.sound_faces)

    @cached_property
    def vertex_areas(self) -> FloatArray:
        """(n,) barycentric area of each vertex, a third of the area of its faces; 0 if no face uses it."""
        thirds = np.repeat(self.face_areas / 3, 3)
        areas = np.bincount(self.sound_faces.ravel(), thirds, self.n_vertices)
        return areas.astype(np.float64, copy=False)  # without faces, bincount returns integers

    @cached_property
    def area(self) -> float:
        """Total area, in squared mesh units."""
        return float(self.face_areas.sum())

    @cached_property
    def volume(self) -> float:
        """Signed enclosed volume, in cubed mesh units; positive if the faces of a closed surface are oriented outward."""
        a, b, c = (self.vertices[self.sound_faces[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a - self.vertices.mean(axis=0), np.cross(b - a, c - a)) / 6)

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """(n, 3) area-weighted unit normals of the vertices; zero if no face of positive area meets the vertex."""
        return vertex_normals(self.vertices, self.sound_faces)

    @property
    def edge_table(self) -> EdgeTable:
        """The edges, and the sides of faces at each of them."""
        return self._connectivity.edge_table

    @property
    def edges(self) -> IntArray:
        """(e, 2) undirected edges, the smaller index first, in lexicographic order."""
        return self.edge_table.ends

    @cached_property
    def boundary_edges(self) -> IntArray:
        """(b, 2) edges at which only one sound face meets, the smaller index first."""
        edges: IntArray = self.edges[self.edge_table.n_faces == 1]
        return edges

    @cached_property
    def boundary_lengths(self) -> FloatArray:
        """(l,) length of each boundary loop, in mesh units, longest first; loops that share a vertex are one."""
        used, ends = np.unique(self.boundary_edges, return_inverse=True)
        i, j = ends.reshape(-1, 2).T
        n_loops, loop = label_components(len(used), (i, j))
        of_loops = np.bincount(loop[i], lengths(self.vertices, self.boundary_edges), n_loops)
        return np.sort(of_loops.astype(np.float64))[::-1]

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """(e,) length of each edge, in mesh units."""
        return lengths(self.vertices, self.edges)

    @cached_property
    def content_hash(self) -> str:
        """Hash of vertices and faces in their order, 32 hexadecimal digits."""
        return hash_of(self, self.vertices, self.faces)

    @property
    def components(self) -> IntArray:
        """(n,) label of the connected component of each vertex; an unused vertex is a component."""
        return self._connectivity.components

    def moved(self, vertices: ArrayLike) -> Mesh:
        """Return the same faces between vertices at other positions (n, 3)."""
        positions = _frozen_vertices(vertices)
        if len(positions) != self.n_vertices:
            raise MeshError(f"{len(positions)} positions for {self.n_vertices} vertices; give one for each")
        mesh = object.__new__(Mesh)
        for name, value in (
            ("vertices", positions),
            ("faces", self.faces),
            ("_connectivity", self._connectivity),
        ):
            object.__setattr__(mesh, name, value)
        return mesh

    def submesh(self, keep: ArrayLike) -> tuple[Mesh, IntArray]:
        """Return the mesh of the vertices to keep, (n,), with the faces between them, and their old numbers.

        Vertices and faces keep their order. If all vertices are kept, it is this mesh.
        """
        mask = np.asarray(keep, dtype=bool)
        index = np.flatnonzero(mask)
        renumber = np.full(self.n_vertices, -1, dtype=np.int64)
        renumber[index] = np.arange(len(index))
        faces = self.sound_faces
        if len(index) == self.n_vertices:
            return self, index
        faces = faces[mask[faces].all(axis=1)]
        return Mesh(self.vertices[index], renumber[faces]), index


@dataclass(frozen=True, eq=False)
class _Connectivity:
    """Everything derived from the faces alone, shared by meshes with other positions."""

    faces: IntArray
    n_vertices: int

    @cached_property
    def sound_faces(self) -> IntArray:
        require_vertices(self.faces, self.n_vertices)
        return self.faces

    @cached_property
    def edge_table(self) -> EdgeTable:
        return edge_table(self.sound_faces, self.n_vertices)

    @cached_property
    def components(self) -> IntArray:
        return label_components(self.n_vertices, tuple(self.edge_table.ends.T))[1]


def _frozen_vertices(values: ArrayLike) -> FloatArray:
    array = numbers_of(values, "vertices", MeshError)
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshError(f"vertices have shape {array.shape}, expected (n, 3): one row x, y, z per vertex")
    array.flags.writeable = False
    return array


def _frozen_faces(values: ArrayLike) -> IntArray:
    array = array_of(values, "faces", MeshError)
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
