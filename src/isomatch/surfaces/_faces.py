"""Faces of a list of triangles: unsound ones, areas and normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray, read_only
from isomatch._core.compiled import compiled
from isomatch._core.errors import MeshError, some
from isomatch.surfaces._coincident import first_equal


@dataclass(frozen=True)
class UnsoundFaces:
    """A mask of the faces for each defect; a face with several defects has only the first."""

    out_of_range: BoolArray
    non_finite: BoolArray
    repeated_index: BoolArray
    duplicate: BoolArray

    @property
    def any(self) -> BoolArray:
        """(m,) faces with a defect."""
        return self.out_of_range | self.non_finite | self.repeated_index | self.duplicate


def unsound_faces(vertices: FloatArray, faces: IntArray) -> UnsoundFaces:
    """Find the faces that cannot be part of a surface. The arrays may contain anything.

    A duplicate has the same three vertices as an earlier face, in any order. The earlier face is not a duplicate.
    """
    outside = np.asarray(((faces < 0) | (faces >= len(vertices))).any(axis=1))
    bad_vertex = np.append(~np.isfinite(vertices).all(axis=1), False)
    infinite = ~outside & bad_vertex[np.where(outside[:, None], -1, faces)].any(axis=1)
    repeated = ~(outside | infinite) & (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    duplicate = ~(outside | infinite | repeated)
    rows = np.flatnonzero(duplicate)
    duplicate[rows] = first_equal(np.sort(faces[rows], axis=1)) != np.arange(len(rows))
    return UnsoundFaces(outside, infinite, repeated, duplicate)


def require_vertices(faces: IntArray, n_vertices: int) -> None:
    """Raise `MeshError` if a vertex index is out of range."""
    if faces.size and not (faces.min() >= 0 and faces.max() < n_vertices):
        outside = np.flatnonzero(((faces < 0) | (faces >= n_vertices)).any(axis=1))
        raise MeshError(
            f"faces {some(outside)} refer to vertices outside 0…{n_vertices - 1}, so the surface is "
            "undefined there; remove these faces with repair(mesh), or export the file again"
        )


@np.errstate(over="ignore", invalid="ignore")
def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute area-weighted unit normals of the vertices, (n, 3); zero if no face of positive area meets a vertex."""
    require_vertices(faces, len(vertices))
    cross = cross_products(read_only(np.ascontiguousarray(vertices, dtype=np.float64)), read_only(faces))
    corners, n = faces.ravel(), len(vertices)
    sums: FloatArray = np.zeros((n, 3))
    for axis in range(3):
        sums[:, axis] = np.bincount(corners, np.repeat(cross[:, axis], 3), n)
    return np.divide(sums, norms(sums), out=np.zeros((n, 3)), where=norms(sums) > 0)


@np.errstate(over="ignore", invalid="ignore")
def norms(vectors: FloatArray) -> FloatArray:
    """Compute the lengths (n, 1) of vectors (n, 3); beyond the largest float infinite or nan."""
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z)[:, None])


@compiled()
def cross_products(points: FloatArray, faces: IntArray) -> FloatArray:
    """Cross product of two edges of each face, (m, 3); beyond the largest float infinite or nan."""
    cross = np.zeros((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        cross[f, 0], cross[f, 1], cross[f, 2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return cross
