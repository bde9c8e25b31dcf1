"""Faces of a list of triangles: unsound ones, areas and normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray, read_only
from isomatch._core.compiled import compiled
from isomatch._core.errors import MeshError, some

OUT_OF_RANGE, NON_FINITE, REPEATED, DUPLICATE = range(1, 5)  # defects of a face; 0 is a sound face


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
    kind = _kinds(read_only(vertices), read_only(faces))
    return UnsoundFaces(*(kind == k for k in (OUT_OF_RANGE, NON_FINITE, REPEATED, DUPLICATE)))


@compiled()
def _kinds(vertices: FloatArray, faces: IntArray) -> AnyArray:
    """Find the defect of each face, (m,), 0 for none."""
    n = len(vertices)
    kind, start = np.zeros(len(faces), np.int8), np.zeros(n + 2, np.int64)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if min(a, b, c) < 0 or max(a, b, c) >= n:
            kind[f] = OUT_OF_RANGE
            continue
        total = 0.0
        for i in range(3):
            for x in range(3):
                total += 0.0 * vertices[faces[f, i], x]
        if total != 0.0:  # a coordinate is infinite or nan, as 0 × inf and 0 × nan are nan
            kind[f] = NON_FINITE
        elif a == b or b == c or c == a:
            kind[f] = REPEATED
        else:
            start[min(a, b, c) + 2] += 1
    for v in range(n):
        start[v + 2] += start[v + 1]
    keys, number = np.empty(start[n + 1], np.int64), np.empty(start[n + 1], np.int32)
    for f in range(len(faces)):
        if kind[f] == 0:
            low, mid, high = _sorted(faces, f)
            keys[start[low + 1]], number[start[low + 1]] = mid << 32 | high, f
            start[low + 1] += 1
    sort_lists(start, keys, number)
    for v in range(n):
        for row in range(start[v] + 1, start[v + 1]):
            if keys[row] == keys[row - 1]:
                kind[number[row]] = DUPLICATE
    return kind


@compiled()
def sort_lists(start: IntArray, keys: IntArray, numbers: AnyArray) -> None:
    """Sort each list of keys, ``start[v]`` to ``start[v + 1]``, and then of numbers, in place."""
    for v in range(len(start) - 2):
        first, last = start[v], start[v + 1]
        gap = 1
        while gap < (last - first) // 3:
            gap = 3 * gap + 1
        while gap > 0:  # Shell's sort, which is insertion sort for short lists
            for row in range(first + gap, last):
                key, number, place = keys[row], numbers[row], row
                while place - gap >= first and (
                    keys[place - gap] > key or (keys[place - gap] == key and numbers[place - gap] > number)
                ):
                    keys[place], numbers[place] = keys[place - gap], numbers[place - gap]
                    place -= gap
                keys[place], numbers[place] = key, number
            gap //= 3


@compiled()
def _sorted(faces: IntArray, f: int) -> tuple[int, int, int]:
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    return min(a, b, c), a + b + c - min(a, b, c) - max(a, b, c), max(a, b, c)


def require_vertices(faces: IntArray, n_vertices: int) -> None:
    """Raise `MeshError` if a vertex index is out of range."""
    if faces.size and not (faces.min() >= 0 and faces.max() < n_vertices):
        outside = np.flatnonzero(((faces < 0) | (faces >= n_vertices)).any(axis=1))
        raise MeshError(
            f"faces {some(outside)} refer to vertices outside 0…{n_vertices - 1}, so the surface is "
            "undefined there; remove these faces with repair(mesh), or export the file again"
        )


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute area-weighted unit normals of the vertices, (n, 3); zero if no face of positive area meets a vertex."""
    require_vertices(faces, len(vertices))
    return _normals(read_only(np.ascontiguousarray(vertices, dtype=np.float64)), read_only(faces))


@compiled()
def cross_products(points: FloatArray, faces: IntArray) -> FloatArray:
    """Cross product of two edges of each face, (m, 3); beyond the largest float infinite or nan."""
    cross = np.zeros((len(faces), 3))
    for f in range(len(faces)):
        cross[f, 0], cross[f, 1], cross[f, 2] = _cross(points, faces, f)
    return cross


@compiled()
def areas_of(points: FloatArray, faces: IntArray) -> FloatArray:
    """Areas (m,) of faces."""
    areas = np.zeros(len(faces))
    for f in range(len(faces)):
        x, y, z = _cross(points, faces, f)
        areas[f] = 0.5 * np.sqrt(x * x + y * y + z * z)
    return areas


@compiled()
def _normals(points: FloatArray, faces: IntArray) -> FloatArray:
    normals = np.zeros((len(points), 3))
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
    return normals


@compiled(inline="always")
def _cross(points: FloatArray, faces: IntArray, f: int) -> tuple[float, float, float]:
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
