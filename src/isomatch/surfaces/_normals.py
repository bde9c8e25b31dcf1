"""Normals of faces and vertices."""

from __future__ import annotations

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.surfaces._faces import require_vertices
from isomatch.values.arrays import FloatArray, IntArray, read_only


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute area-weighted unit normals of the vertices, (n, 3); zero if no face of positive area meets a vertex.

    Raises
    ------
    MeshError
        If a vertex index is out of range.
    """
    require_vertices(faces, len(vertices))
    normals = np.zeros((len(vertices), 3))
    cross = cross_products(np.ascontiguousarray(vertices, dtype=np.float64), faces)
    _add_normals(read_only(faces), cross, normals)
    return normals


def cross_products(points: FloatArray, faces: IntArray) -> FloatArray:
    """Cross product of two edges of each face, (m, 3); beyond the largest float infinite or nan."""
    cross = np.zeros((len(faces), 3))
    _fill_cross(read_only(points), read_only(faces), cross)
    return cross


@compiled()
def _fill_cross(points: FloatArray, faces: IntArray, cross: FloatArray) -> None:
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        cross[f, 0] = uy * vz - uz * vy
        cross[f, 1] = uz * vx - ux * vz
        cross[f, 2] = ux * vy - uy * vx


@compiled()
def _add_normals(faces: IntArray, cross: FloatArray, normals: FloatArray) -> None:
    for f in range(len(faces)):
        for corner in range(3):
            for x in range(3):
                normals[faces[f, corner], x] += cross[f, x]
    for v in range(len(normals)):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for x in range(3):
            normals[v, x] = normals[v, x] / length if length > 0 else 0.0
