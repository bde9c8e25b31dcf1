"""STL: a list of triangles with three positions each, as text or binary."""

from __future__ import annotations

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.formats._text import TextLines, format_rows, read_lines
from isomatch.errors import FormatError, MeshError
from isomatch.surfaces import Mesh, welded
from isomatch.values.arrays import FloatArray

_HEADER_SIZE = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read(data: bytes, name: str) -> Mesh:
    """Read an STL file; corners at exactly the same position become one vertex, in order of first appearance."""
    # Many binary files start with "solid" too, so the size is compared first.
    declared = int.from_bytes(data[80:84], "little")
    size = _HEADER_SIZE + _TRIANGLE.itemsize * declared
    if len(data) >= _HEADER_SIZE and len(data) == size:
        with np.errstate(invalid="ignore"):  # which a signalling nan sets
            corners: FloatArray = np.frombuffer(data, _TRIANGLE, offset=_HEADER_SIZE)["corners"].astype(
                np.float64
            )
    elif data.lstrip()[:5].lower() == b"solid":
        corners = _read_text(read_lines(name, data, lower=True))
    elif len(data) < _HEADER_SIZE:
        raise FormatError(
            f"{name}: byte {len(data)}: expected 'solid' or {_HEADER_SIZE} bytes of header, found the end of "
            "the file; it is cut short or not STL, copy or export it again"
        )
    else:
        raise FormatError(
            f"{name}: byte {min(len(data), size)}: expected {size} bytes for the {declared} "
            f"triangles declared at byte 80, found {len(data)}; the file is damaged, copy or export it again"
        )
    points = corners.reshape(-1, 3)
    kept, vertex = welded(points)
    return Mesh(points[kept], vertex.reshape(-1, 3))


def write(asset: Asset, binary: bool = True) -> bytes:
    """Write an STL file, binary in single precision, or text with all digits."""
    mesh = Mesh(asset.points, asset.polygons.triangles)
    corners = mesh.vertices[mesh.sound_faces]  # (m, 3, 3)
    lengths = np.linalg.norm(mesh.face_cross, axis=1, keepdims=True)
    normals = np.divide(mesh.face_cross, lengths, out=np.zeros_like(mesh.face_cross), where=lengths > 0)
    if not binary:
        template = "facet normal %r %r %r\nouter loop\n" + "vertex %r %r %r\n" * 3 + "endloop\nendfacet\n"
        return (
            b"solid\n" + format_rows(template, np.hstack([normals, corners.reshape(-1, 9)])) + b"endsolid\n"
        )
    if (np.abs(corners[np.isfinite(corners)]) > np.finfo(np.float32).max).any():
        raise MeshError("coordinates exceed the float32 range of binary STL; write text with binary=False")
    triangles = np.zeros(mesh.n_faces, _TRIANGLE)
    triangles["normal"], triangles["corners"] = normals, corners
    return b"binary STL".ljust(80) + mesh.n_faces.to_bytes(4, "little") + triangles.tobytes()


def _read_text(lines: TextLines) -> FloatArray:
    """Read the corners of each triangle, (m, 3, 3)."""
    if not len(lines) or not lines.row(len(lines) - 1).startswith("endsolid"):
        lines.fail(len(lines), "endsolid")
    corners = lines.starting_with("vertex")
    loop_ends = lines.starting_with("endloop").numbers
    # At the end of triangle t, counted from 0, 3 (t + 1) corners must have been read.
    read = np.searchsorted(corners.numbers, loop_ends)
    wrong = np.flatnonzero(read != 3 * np.arange(1, len(loop_ends) + 1))
    if len(wrong):
        lines.fail(
            int(np.searchsorted(lines.numbers, loop_ends[wrong[0]])), "3 vertex lines before each endloop"
        )
    if len(corners) != 3 * len(loop_ends):
        lines.fail(len(lines) - 1, "an endloop after every 3 vertex lines")
    return corners.parse().leading(3, "3 numbers x y z after vertex").reshape(-1, 3, 3)
