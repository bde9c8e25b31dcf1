"""Normals and areas of faces and vertices."""

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
    _add_normals(read_only(np.ascontiguousarray(vertices, dtype=np.float64)), read_only(faces), normals)
    return normals


def areas_of(points: FloatArray, faces: IntArray) -> FloatArray:
    """Areas (m,) of faces."""
    areas = np.zeros(len(faces))
    _fill_areas(read_only(points), read_only(faces), areas)
    return areas


def thirds_of(face_areas: FloatArray, faces: IntArray, n_vertices: int) -> FloatArray:
    """Areas (n,) of vertices: a third of each of their faces."""
    areas = np.zeros(n_vertices)
    _add_thirds(face_areas, read_only(faces), areas)
    return areas


def cross_products(points: FloatArray, faces: IntArray) -> FloatArray:
    """Cross product of two edges of each face, (m, 3); beyond the largest float infinite or nan."""
    cross = np.zeros((len(faces), 3))
    _fill_cross(read_only(points), read_only(faces), cross)
    return cross


@compiled()
def _fill_cross(points: FloatArray, faces: IntArray, cross: FloatArray) -> None:
    for f in range(len(faces)):
        cross[f, 0], cross[f, 1], cross[f, 2] = _cross(points, faces, f)


@compiled()
def _fill_areas(points: FloatArray, faces: IntArray, areas: FloatArray) -> None:
    for f in range(len(faces)):
        x, y, z = _cross(points, faces, f)
        areas[f] = 0.5 * np.sqrt(x * x + y * y + z * z)


@compiled()
def _add_thirds(face_areas: FloatArray, faces: IntArray, areas: FloatArray) -> None:
    for f in range(len(faces)):
        for corner in range(3):
            areas[faces[f, corner]] += face_areas[f] / 3


@compiled()
def _add_normals(points: FloatArray, faces: IntArray, normals: FloatArray) -> None:
    for f in range(len(faces)):
        x, y, z = _cross(points, faces, f)
        for corner in range(3):
            v = faces[f, corner]
            normals[v, 0] += x
            normals[v, 1] += y
            normals[v, 2] += z
    for v in range(len(normals)):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for i in range(3):
            normals[v, i] = normals[v, i] / length if length > 0 else 0.0


@compiled(inline="always")
def _cross(points: FloatArray, faces: IntArray, f: int) -> tuple[float, float, float]:
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
