"""Spatial order of meshes: what is near on the surface is near in memory, which makes loops faster."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray

BITS_PER_AXIS = 10  # number of bits of a cell along each axis; chosen: the bits of three axes fit into 32


def in_spatial_order(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, AnyArray]:
    """Sort vertices (n, 3) in [−1, 1]³ along Morton's curve, and faces (m, 3) by their first vertices.

    Returns both, and the old number (n,) of each vertex, as int32. Corners keep their order.
    """
    cells = ((vertices + 1.0) * (2 ** (BITS_PER_AXIS - 1) - 1)).astype(np.int32)
    x, y, z = _spread_bits(cells).T
    order = np.argsort(x | y << 1 | z << 2, kind="stable").astype(np.int32)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    numbered = place[faces]
    return vertices[order], numbered[np.argsort(numbered.min(axis=1), kind="stable")], order


def _spread_bits(cells: AnyArray) -> AnyArray:
    """Put two zeros between the bits of numbers."""
    cells = (cells | cells << 16) & 0x030000FF
    cells = (cells | cells << 8) & 0x0300F00F
    cells = (cells | cells << 4) & 0x030C30C3
    cells = (cells | cells << 2) & 0x09249249
    return cells
