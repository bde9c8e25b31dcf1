"""One shape of an elastic match: canonical coordinates, the mirror image of every vertex, and samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.correspondence import nearest_rows
from isomatch.settings import ElasticSettings
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property

N_COARSE = 300  # samples of each shape in the coarse fit; chosen: enough for 30 functions


@dataclass(frozen=True, eq=False)
class ElasticShape:
    """A prepared mesh in coordinates that other shapes can be mapped to smoothly.

    Parameters
    ----------
    prepared : PreparedShape
        The shape; its body is a mesh of n vertices.
    settings : ElasticSettings
    mirrored : (n, d + 3) array of float, optional
        ``drawn`` of the mirror image of each vertex, smoothed; none if the shape is not nearly symmetric.
    """

    prepared: PreparedShape
    settings: ElasticSettings
    mirrored: FloatArray | None = None

    @property
    def mesh(self) -> Mesh:
        """The body."""
        return self.prepared.mesh_body

    @cached_property
    def canonical(self) -> FloatArray:
        """(n, d) canonical coordinates: classical scaling of the farthest points, extended to all vertices.

        Notes
        -----
        de Silva & Tenenbaum, *Sparse multidimensional scaling using landmark points*, 2004.
        """
        squares = self.prepared.columns.astype(np.float64) ** 2
        among = squares[:, self.prepared.column_vertices]
        among = (among + among.T) / 2
        mean = among.mean(axis=0)
        values, vectors = np.linalg.eigh(-0.5 * (among - mean - mean[:, None] + mean.mean()))
        first = np.argsort(-values, kind="stable")[: self.settings.n_coordinates]
        values, vectors = values[first], vectors[:, first]
        axes = vectors[:, values > 0] / np.sqrt(values[values > 0])
        return np.asarray(-0.5 * (squares - mean[:, None]).T @ axes)

    @cached_property
    def drawn(self) -> FloatArray:
        """(n, d + 3) what a map to this shape pulls back: canonical coordinates, and positions in space."""
        return np.hstack([self.canonical, self.mesh.vertices])

    @cached_property
    def aside(self) -> FloatArray:
        """(n,) distance of each vertex from its mirror image, in canonical coordinates; 0 without mirror images."""
        if self.mirrored is None:
            return np.zeros(self.mesh.n_vertices)
        d = self.canonical.shape[1]
        return np.asarray(np.linalg.norm(self.canonical - self.mirrored[:, :d], axis=1))

    def sampled(self, count: int, everywhere: bool) -> Samples:
        """Take ``count`` samples; their images are sought among samples, or everywhere."""
        vertices = self.prepared.sample_vertices[:count]
        mesh = self.mesh
        if everywhere:
            ring, sought, faces = np.arange(mesh.n_vertices), np.arange(mesh.n_vertices), mesh.faces
        else:
            chosen = np.zeros(mesh.n_vertices, dtype=bool)
            chosen[vertices] = True
            faces = mesh.faces[chosen[mesh.faces].any(axis=1)]
            ring, faces = np.unique(faces, return_inverse=True)
            faces, sought = faces.reshape(-1, 3), np.searchsorted(ring, vertices)
        row = vertices if everywhere else np.arange(len(vertices))
        mirror_row = None
        if self.mirrored is not None:
            d = self.canonical.shape[1]
            mirror_row = nearest_rows(self.canonical[vertices], self.mirrored[vertices, :d])
        return Samples(self, everywhere, vertices, row, ring, sought, faces, mirror_row)


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a shape, and the vertices among which images are sought.

    Parameters
    ----------
    shape : ElasticShape
    everywhere : bool
        Whether images are sought among all vertices, and not among the samples.
    vertices : (m,) array of int
        The samples.
    row : (m,) array of int
        Their rows among the c vertices sought.
    ring : (r,) array of int
        Vertices of all faces around the vertices sought.
    sought : (c,) array of int
        Rows of the vertices sought in the ring.
    faces : (f, 3) array of int
        Those faces, by rows of the ring.
    mirror_row : (m,) array of int, optional
        Sample nearest to the mirror image of each sample.
    """

    shape: ElasticShape
    everywhere: bool
    vertices: IntArray
    row: IntArray
    ring: IntArray
    sought: IntArray
    faces: IntArray
    mirror_row: IntArray | None

    @cached_property
    def functions(self) -> FloatArray:
        """(r, K) Laplace–Beltrami functions on the ring."""
        functions: FloatArray = self.shape.prepared.laplace.vectors[self.ring]
        return functions

    @cached_property
    def functions_sought(self) -> FloatArray:
        """(c, K) the same on the vertices sought."""
        return self.functions if self.everywhere else self.functions[self.sought]

    @cached_property
    def canonical(self) -> FloatArray:
        """(c, d) canonical coordinates of the vertices sought."""
        return np.asarray(self.shape.canonical[self.targets])

    @cached_property
    def normals(self) -> FloatArray:
        """(c, 3) their normals."""
        return np.asarray(self.shape.mesh.vertex_normals[self.targets])

    @cached_property
    def targets(self) -> IntArray:
        """(c,) vertices sought."""
        return self.ring[self.sought]
