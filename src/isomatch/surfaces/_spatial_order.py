"""Meshes in spatial order: what is near on the surface then lies near in memory, and loops need not wait for it."""

from __future__ import annotations

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.values.arrays import AnyArray, FloatArray, IntArray, read_only

BITS = 10  # of each coordinate


def in_spatial_order(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, AnyArray]:
    """Put vertices (n, 3) of [−1, 1]³ in the order of Morton's curve, and faces (m, 3) in that of their first vertices.

    Returns both, and the old number of each vertex, (n,) of int32. Corners keep their order. O(n + m), by radix and
    counting sorts.
    """
    return _ordered(read_only(vertices), read_only(faces))


@compiled()
def _ordered(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, AnyArray]:
    n = len(points)
    codes, order = np.empty(n, np.int32), np.empty(n, np.int32)
    for v in range(n):
        codes[v] = (
            _spread(int((points[v, 0] + 1.0) * (2 ** (BITS - 1) - 1)))
            | _spread(int((points[v, 1] + 1.0) * (2 ** (BITS - 1) - 1))) << 1
            | _spread(int((points[v, 2] + 1.0) * (2 ** (BITS - 1) - 1))) << 2
        )
        order[v] = v
    other_codes, other_order = np.empty(n, np.int32), np.empty(n, np.int32)
    for digit in range(3):
        shift = BITS * digit
        start = np.zeros(2**BITS + 1, np.int64)
        for i in range(n):
            start[(codes[i] >> shift & 2**BITS - 1) + 1] += 1
        for key in range(2**BITS):
            start[key + 1] += start[key]
        for i in range(n):
            key = codes[i] >> shift & 2**BITS - 1
            other_codes[start[key]], other_order[start[key]] = codes[i], order[i]
            start[key] += 1
        codes, other_codes, order, other_order = other_codes, codes, other_order, order
    place, vertices = codes, np.empty((n, 3))
    for i in range(n):
        place[order[i]] = i
        for x in range(3):
            vertices[i, x] = points[order[i], x]
    first = np.zeros(n + 1, np.int64)
    for f in range(len(faces)):
        first[min(place[faces[f, 0]], place[faces[f, 1]], place[faces[f, 2]]) + 1] += 1
    for v in range(n):
        first[v + 1] += first[v]
    numbered = np.empty((len(faces), 3), np.int64)
    for f in range(len(faces)):
        a, b, c = place[faces[f, 0]], place[faces[f, 1]], place[faces[f, 2]]
        at = first[min(a, b, c)]
        first[min(a, b, c)] += 1
        numbered[at, 0], numbered[at, 1], numbered[at, 2] = a, b, c
    return vertices, numbered, order


@compiled(inline="always")
def _spread(cell: int) -> int:
    """Put two zeros between the bits of a number."""
    cell = (cell | cell << 16) & 0x030000FF
    cell = (cell | cell << 8) & 0x0300F00F
    cell = (cell | cell << 4) & 0x030C30C3
    return (cell | cell << 2) & 0x09249249
