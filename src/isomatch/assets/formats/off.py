"""OFF: a header, the counts, one line per vertex, one line per face (the object file format of Geomview, as text)."""

from __future__ import annotations

import re

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute, Kind
from isomatch.assets.formats._text import (
    NumberRows,
    TextLines,
    format_rows,
    interleaved_lines,
    is_count,
    numbered,
    read_lines,
)
from isomatch.assets.fans import spans
from isomatch.assets.polygons import Polygons
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray

# Normals, colours and texture coordinates follow the position on a vertex line, so all variants are read alike.
_HEADER = re.compile(r"\s*(?:ST)?(?P<color>C?)(?P<normal>N?)OFF(?![A-Za-z])\s*(?P<rest>.*)")


def read(data: bytes, name: str) -> Mesh:
    """Read an OFF, COFF, NOFF or STOFF file. Counts may be on the header line; faces may have colours."""
    rows, (corners, sizes) = _tables(read_lines(name, data))
    points = _positions(rows)
    return Mesh(points, Polygons(corners, sizes, points).triangles)


def read_asset(data: bytes, name: str) -> Asset:
    """Read an OFF file with the colours and normals of its vertices."""
    lines = read_lines(name, data)
    rows, polygons = _tables(lines)
    header = _HEADER.fullmatch(lines.row(0))
    start, attributes = 3, []
    for kind in ("normal", "color"):
        if header is None or not header[kind]:
            continue
        if not (rows.counts >= start + 3).all():
            break
        values = rows.leading(start + 3, "")[:, start:]
        start += 3
        if kind == "color" and values.max(initial=0) > 1 and (values == np.rint(values) % 256).all():
            values = values.astype(np.uint8)
        attributes.append(Attribute(kind, "point", "normal" if kind == "normal" else "colour", values))
    return Asset(_positions(rows), Polygons(*polygons), tuple(attributes))


def keeps(attribute: Attribute) -> bool:
    """Whether OFF has a place for an attribute."""
    return attribute.domain == "point" and attribute.kind in ("normal", "colour")


def write(asset: Asset) -> bytes:
    """Write an OFF file."""
    letters, template, columns = "", "%r %r %r", [asset.points]
    letter_of: dict[Kind, str] = {"normal": "N", "colour": "C"}
    for kind, letter in letter_of.items():
        for attribute in asset.of_kind(kind):
            letters = letter + letters
            values = attribute.values[:, :3]
            if kind == "colour":
                octets = np.rint(255 * attribute.fractions[:, :3])
                whole = values.dtype.kind != "f" and octets.max(initial=0) > 1  # if not, read as fractions
                values = octets if whole else attribute.fractions[:, :3]
            template += " %d %d %d" if kind == "colour" and whole else " %r %r %r"
            columns.append(values)
    sizes = asset.polygons.sizes
    if (sizes == 3).all():
        faces = format_rows("3 %d %d %d\n", asset.polygons.corners.reshape(-1, 3))
    else:
        once = np.ones(len(sizes), dtype=np.int64)
        words = [(once, numbered(sizes)), (sizes, numbered(asset.polygons.corners))]
        faces = interleaved_lines(words, len(sizes))
    head = f"{letters}OFF\n{len(asset.points)} {len(sizes)} 0\n".encode()
    return head + format_rows(f"{template}\n", np.hstack(columns)) + faces


def _tables(lines: TextLines) -> tuple[NumberRows, tuple[IntArray, IntArray]]:
    """Read the numbers of the vertices, and the corners and sizes of the faces."""
    n_vertices, n_faces, body = _counts(lines)
    total = n_vertices + n_faces
    if len(body) != total:
        body.fail(
            total, f"{n_vertices} vertex lines and {n_faces} face lines as declared", "correct the counts"
        )
    return body[:n_vertices].parse(), _polygons(body[n_vertices:])


def _positions(rows: NumberRows) -> FloatArray:
    return rows.leading(3, "at least 3 numbers x y z of a vertex")


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
