"""OBJ: the ``v`` and ``f`` lines of a Wavefront file; all other lines are ignored."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isomatch._arrays import IntArray
from isomatch.surfaces.io._polygons import triangulate
from isomatch.surfaces.io._text import NumberRows, TextLines, format_rows, read_lines
from isomatch.surfaces.mesh import Mesh


def read(data: bytes, name: str) -> Mesh:
    """Read an OBJ file. Vertices may have colours; faces may be polygons and may have negative indices."""
    lines = read_lines(name, data, continued=True)
    vertex_lines, face_lines = lines.starting_with("v"), lines.starting_with("f", textured=True)
    if not len(vertex_lines):
        lines.fail(len(lines), "vertex lines v x y z")
    vertices = vertex_lines.parse().leading(3, "at least 3 numbers x y z of a vertex")
    return Mesh(vertices, triangulate(*_polygons(face_lines, vertex_lines)))


def write(mesh: Mesh, colors: NDArray[np.uint8] | None = None) -> bytes:
    """Write an OBJ file; colours follow the positions as three numbers from 0 to 1."""
    if colors is None:
        vertices = format_rows("v %r %r %r\n", mesh.vertices)
    else:
        vertices = format_rows("v %r %r %r %.6g %.6g %.6g\n", np.hstack([mesh.vertices, colors / 255]))
    return vertices + format_rows("f %d %d %d\n", mesh.sound_faces + 1)


def _polygons(lines: TextLines, vertex_lines: TextLines) -> tuple[IntArray, IntArray]:
    """Read the corners of all faces, concatenated, and the number of corners of each."""
    rows = lines.parse()
    rows.require(rows.counts >= 3, "a face of at least 3 corners")
    corners = rows.whole(None, "whole vertex indices")
    return _from_zero(corners, rows, vertex_lines), rows.counts


def _from_zero(corners: IntArray, rows: NumberRows, vertex_lines: TextLines) -> IntArray:
    """Convert to indices from 0; a negative index counts back from the last vertex line before its face."""
    backwards = corners < 0
    if not backwards.any():
        return corners - 1
    read_before = np.searchsorted(vertex_lines.numbers, rows.lines.numbers)
    return np.where(backwards, corners + np.repeat(read_before, rows.counts), corners - 1)
