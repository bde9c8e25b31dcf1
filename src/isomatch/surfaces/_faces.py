"""Faces of a list of triangles: which cannot be part of a surface, their areas and normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.errors import MeshError, some
from isomatch.loading.compiled import compiled
from isomatch.values.arrays import AnyArray, BoolArray, FloatArray, IntArray, read_only

OUT_OF_RANGE, NON_FINITE, REPEATED, DUPLICATE = range(1, 5)


@dataclass(frozen=True)
class UnsoundFaces:
    """One mask over the faces for each defect. Of several defects of a face only the first counts."""

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
    kind, start = np.zeros(len(faces), dtype=np.int8), np.zeros(len(vertices) + 2, dtype=np.int64)
    number = np.empty(len(faces), dtype=np.int32)
    _classify(read_only(vertices), read_only(faces), start, number, kind)
    return UnsoundFaces(*(kind == k for k in (OUT_OF_RANGE, NON_FINITE, REPEATED, DUPLICATE)))


@compiled()
def _classify(
    vertices: FloatArray, faces: IntArray, start: IntArray, number: AnyArray, kind: AnyArray
) -> None:
    """Tell what is wrong with each face, 0 for nothing; sound ones with the same smallest vertex are sorted and compared.

    ``start`` (n + 2,) and ``kind`` are 0 on entry; ``number`` (m,) is room for the sound faces of each vertex.
    """
    n = len(vertices)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if min(a, b, c) < 0 or max(a, b, c) >= n:
            kind[f] = OUT_OF_RANGE
            continue
        total = 0.0
        for i in range(3):
            for x in range(3):
                total += 0.0 * vertices[faces[f, i], x]
        if total != 0.0:
            kind[f] = NON_FINITE
        elif a == b or b == c or c == a:
            kind[f] = REPEATED
        else:
            start[min(a, b, c) + 2] += 1
    for v in range(n):
        start[v + 2] += start[v + 1]
    for f in range(len(faces)):
        if kind[f] == 0:
            low = min(faces[f, 0], faces[f, 1], faces[f, 2])
            number[start[low + 1]] = f
            start[low + 1] += 1
    for v in range(n):
        first, last = start[v], start[v + 1]
        gap = 1
        while gap < (last - first) // 3:
            gap = 3 * gap + 1
        while gap > 0:  # Shell's sort
            for here in range(first + gap, last):
                face, at = number[here], here
                while at - gap >= first and _is_before(faces, face, number[at - gap]):
                    number[at] = number[at - gap]
                    at -= gap
                number[at] = face
            gap //= 3
        for at in range(first + 1, last):
            if _sorted(faces, number[at]) == _sorted(faces, number[at - 1]):
                kind[number[at]] = DUPLICATE


@compiled()
def _is_before(faces: IntArray, f: int, g: int) -> bool:
    """Whether the larger vertices of a face come before those of another one, or are the same and its number does."""
    _, mid, high = _sorted(faces, f)
    _, other_mid, other_high = _sorted(faces, g)
    if mid != other_mid:
        return mid < other_mid
    if high != other_high:
        return high < other_high
    return f < g


@compiled()
def _sorted(faces: IntArray, f: int) -> tuple[int, int, int]:
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    return min(a, b, c), a + b + c - min(a, b, c) - max(a, b, c), max(a, b, c)


def require_vertices(faces: IntArray, n_vertices: int) -> None:
    """Raise `MeshError` if a vertex index is out of range."""
    if faces.size and not (faces.min() >= 0 and faces.max() < n_vertices):
        bad = np.flatnonzero(((faces < 0) | (faces >= n_vertices)).any(axis=1))
        raise MeshError(
            f"faces {some(bad)} refer to vertices outside 0…{n_vertices - 1}, so the surface is "
            "undefined there; remove these faces with repair(mesh), or export the file again"
        )


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
