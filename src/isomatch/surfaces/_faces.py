"""Faces of a list of triangles: unsound ones, areas and normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray, read_only
from isomatch._core.compiled import compiled
from isomatch._core.errors import MeshError, some

# number of each kind of defect of a face; a sound face has 0
OUT_OF_RANGE, NON_FINITE, REPEATED, DUPLICATE = range(1, 5)
# Outputs without rows, which tell `_measure` not to compute cross products (or normals) and areas.
NO_CROSS, NO_AREAS = np.zeros((0, 3)), np.zeros(0)


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
    kind, start = np.zeros(len(faces), np.int8), np.zeros(len(vertices) + 2, np.int64)
    keys, numbers = np.empty(len(faces), np.int64), np.empty(len(faces), np.int32)
    _list_sound(read_only(vertices), read_only(faces), kind, start, keys, numbers)
    sort_lists(start, keys, numbers)
    row = np.flatnonzero(keys[1 : start[-2]] == keys[: max(start[-2] - 1, 0)])
    face, face_before = numbers[row + 1], numbers[row]
    kind[face[faces[face].min(axis=1) == faces[face_before].min(axis=1)]] = DUPLICATE
    return UnsoundFaces(*(kind == k for k in (OUT_OF_RANGE, NON_FINITE, REPEATED, DUPLICATE)))


@compiled()
def _list_sound(
    vertices: FloatArray, faces: IntArray, kind: AnyArray, start: IntArray, keys: IntArray, numbers: AnyArray
) -> None:
    """Set the kind of defect of each face, 0 if sound, and list the sound faces by their smallest vertex.

    The key of a face is made of its other two vertices.
    """
    n = len(vertices)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        low, high = min(a, b, c), max(a, b, c)
        if low < 0 or high >= n:
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
            start[low + 2] += 1
    for v in range(n):
        start[v + 2] += start[v + 1]
    for f in range(len(faces)):
        if kind[f] == 0:
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            low, high = min(a, b, c), max(a, b, c)
            row = start[low + 1]
            keys[row] = (a + b + c - low - high) << 32 | high
            numbers[row] = f
            start[low + 1] = row + 1


@compiled()
def sort_lists(start: IntArray, keys: IntArray, numbers: AnyArray) -> None:
    """Sort each list of keys, ``start[v]`` to ``start[v + 1]``, and then of numbers, in place."""
    for v in range(len(start) - 2):
        first, last = start[v], start[v + 1]
        gap = 1
        while gap < (last - first) // 3:
            gap = 3 * gap + 1
        while gap > 0:  # Shell's sort; for short lists it is insertion sort
            for row in range(first + gap, last):
                key, number, place = keys[row], numbers[row], row
                while place - gap >= first and (
                    keys[place - gap] > key or (keys[place - gap] == key and numbers[place - gap] > number)
                ):
                    keys[place], numbers[place] = keys[place - gap], numbers[place - gap]
                    place -= gap
                keys[place], numbers[place] = key, number
            gap //= 3


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
    normals = np.zeros((len(vertices), 3))
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    _measure(read_only(points), read_only(faces), NO_CROSS, NO_AREAS, normals)
    x, y, z = normals.T
    with np.errstate(all="ignore"):  # huge coordinates give inf or nan
        length = np.sqrt(x**2 + y**2 + z**2)[:, None]
        return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def cross_products(points: FloatArray, faces: IntArray) -> FloatArray:
    """Cross product of two edges of each face, (m, 3); beyond the largest float infinite or nan."""
    cross = np.zeros((len(faces), 3))
    _measure(read_only(points), read_only(faces), cross, NO_AREAS, NO_CROSS)
    return cross


def areas_of(points: FloatArray, faces: IntArray) -> FloatArray:
    """Areas (m,) of faces."""
    areas = np.zeros(len(faces))
    _measure(read_only(points), read_only(faces), NO_CROSS, areas, NO_CROSS)
    return areas


@compiled()
def _measure(
    points: FloatArray, faces: IntArray, cross: FloatArray, areas: FloatArray, normals: FloatArray
) -> None:
    """Set the cross product and the area of each face, and add up the cross products at vertices.

    An output without rows is not computed.
    """
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        if len(cross):
            cross[f, 0], cross[f, 1], cross[f, 2] = x, y, z
        if len(areas):
            areas[f] = 0.5 * np.sqrt(x * x + y * y + z * z)
        if len(normals):
            for corner in range(3):
                v = faces[f, corner]
                normals[v, 0] += x
                normals[v, 1] += y
                normals[v, 2] += z
