"""OFF: a header, the counts, one line per vertex, one line per face (the object file format of Geomview, as text)."""

from __future__ import annotations

import re

from isomatch._arrays import IntArray
from isomatch.surfaces.io._polygons import spans, triangulate
from isomatch.surfaces.io._text import TextLines, format_rows, is_count, read_lines
from isomatch.surfaces.mesh import Mesh

# Normals, colours and texture coordinates follow the position on a vertex line, so all variants are read alike.
_HEADER = re.compile(r"\s*(?:ST)?C?N?OFF(?![A-Za-z])\s*(?P<rest>.*)")


def read(data: bytes, name: str) -> Mesh:
    """Read an OFF, COFF, NOFF or STOFF file. Counts may be on the header line; faces may have colours."""
    n_vertices, n_faces, body = _counts(read_lines(name, data))
    total = n_vertices + n_faces
    if len(body) != total:
        body.fail(
            total, f"{n_vertices} vertex lines and {n_faces} face lines as declared", "correct the counts"
        )
    vertices = body[:n_vertices].parse().leading(3, "at least 3 numbers x y z of a vertex")
    return Mesh(vertices, triangulate(*_polygons(body[n_vertices:])))


def write(mesh: Mesh) -> bytes:
    """Write an OFF file."""
    return b"".join(
        [
            f"OFF\n{mesh.n_vertices} {mesh.n_faces} 0\n".encode(),
            format_rows("%r %r %r\n", mesh.vertices),
            format_rows("3 %d %d %d\n", mesh.faces),
        ]
    )


def _polygons(lines: TextLines) -> tuple[IntArray, IntArray]:
    """Read the corners of all faces, concatenated, and the number of corners of each."""
    rows = lines.parse()
    sizes = rows.whole(rows.starts, "the number of corners of a face")
    rows.require(sizes >= 3, "a face of at least 3 corners")
    rows.require(rows.counts > sizes, "the number of corners of a face, then as many vertex indices")
    corners = rows.whole(spans(rows.starts + 1, sizes), "whole vertex indices")
    return corners, sizes


def _counts(lines: TextLines) -> tuple[int, int, TextLines]:
    """Read the number of vertices, the number of faces, and the lines after the header."""
    header = _HEADER.fullmatch(lines.row(0)) if len(lines) else None
    if header is None:
        lines.fail(
            0, "the header OFF (or COFF, NOFF, STOFF) of a text file", "add it or export the file again"
        )
    row = 0 if header["rest"] else 1
    words = header["rest"].split() if row == 0 else (lines.row(1).split() if len(lines) > 1 else [])
    if len(words) not in (2, 3) or not all(map(is_count, words)):
        lines.fail(row, "the number of vertices, of faces and of edges")
    return int(words[0]), int(words[1]), lines[row + 1 :]
