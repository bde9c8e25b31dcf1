"""PLY: named elements with named properties, as text or binary (the Stanford polygon format)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isomatch._arrays import AnyArray, FloatArray, IntArray
from isomatch.errors import FormatError, MeshError
from isomatch.surfaces.io._ply_body import Table, read_tables
from isomatch.surfaces.io._ply_header import read_header
from isomatch.surfaces.io._polygons import triangulate
from isomatch.surfaces.io._text import format_rows, is_whole
from isomatch.surfaces.mesh import Mesh

_INDEX_LISTS = ("vertex_indices", "vertex_index")
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def read(data: bytes, name: str) -> Mesh:
    """Read a PLY file; properties and elements other than positions and faces are ignored."""
    tables = read_tables(data, name, read_header(data, name))
    if "tristrips" in tables:
        raise FormatError(
            f"{name}:1: expected triangles in element 'face', found 'tristrips'; export faces instead"
        )
    vertices = _positions(tables, name)
    if "face" not in tables:
        return Mesh(vertices, np.zeros((0, 3), dtype=np.int64))
    return Mesh(vertices, _triangles(tables["face"], name))


def write(mesh: Mesh, binary: bool = True, colors: NDArray[np.uint8] | None = None) -> bytes:
    """Write a PLY file, binary (little endian) or text, with positions in double precision."""
    if mesh.n_faces and np.abs(mesh.faces).max() >= 2**31:
        raise MeshError("face indices exceed the 32 bits of PLY; remove the faces with repair(mesh)")
    header = "\n".join(
        [
            "ply",
            f"format {'binary_little_endian' if binary else 'ascii'} 1.0",
            f"element vertex {mesh.n_vertices}",
            *(f"property double {axis}" for axis in "xyz"),
            *(f"property uchar {color}" for color in ("red", "green", "blue") if colors is not None),
            f"element face {mesh.n_faces}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
    ).encode()
    return header + (_binary_body(mesh, colors) if binary else _text_body(mesh, colors))


def _positions(tables: dict[str, Table], name: str) -> FloatArray:
    columns = tables["vertex"].columns if "vertex" in tables else {}
    missing = [axis for axis in "xyz" if axis not in columns or (columns[axis].counts != 1).any()]
    if missing:
        raise FormatError(
            f"{name}:1: expected an element 'vertex' with numbers x, y, z, found no {', '.join(missing)}; "
            "export the file again with positions"
        )
    return np.stack([columns[axis].values.ravel() for axis in "xyz"], axis=1, dtype=np.float64)


def _triangles(table: Table, name: str) -> IntArray:
    lists = [table.columns[key] for key in _INDEX_LISTS if key in table.columns]
    if not lists:
        raise FormatError(
            f"{name}:1: expected the list {' or '.join(_INDEX_LISTS)} of the faces, found "
            f"{', '.join(table.columns) or 'none'}; rename it or export the file again"
        )
    corners, counts = lists[0].values.ravel(), lists[0].counts
    _require(counts >= 3, table, "a face of at least 3 corners")
    if corners.dtype.kind == "f":
        whole = np.logical_and.reduceat(is_whole(corners), np.cumsum(counts) - counts)
        _require(whole, table, "whole vertex indices")
        corners = corners.astype(np.int64)
    return triangulate(corners, counts)


def _require(good: AnyArray, table: Table, expected: str) -> None:
    if not good.all():
        row = int(np.argmin(good))
        raise FormatError(
            f"{table.place(row)}: expected {expected}, face {row} has none; export the file again"
        )


def _binary_body(mesh: Mesh, colors: NDArray[np.uint8] | None) -> bytes:
    vertices = np.zeros(
        mesh.n_vertices, [("position", "<f8", 3), ("color", "u1", 0 if colors is None else 3)]
    )
    vertices["position"] = mesh.vertices
    if colors is not None:
        vertices["color"] = colors
    faces = np.zeros(mesh.n_faces, _FACE)
    faces["count"], faces["corners"] = 3, mesh.faces
    return vertices.tobytes() + faces.tobytes()


def _text_body(mesh: Mesh, colors: NDArray[np.uint8] | None) -> bytes:
    if colors is None:
        vertices = format_rows("%r %r %r\n", mesh.vertices)
    else:
        vertices = format_rows("%r %r %r %d %d %d\n", np.hstack([mesh.vertices, colors]))
    return vertices + format_rows("3 %d %d %d\n", mesh.faces)
