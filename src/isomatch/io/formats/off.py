"""OFF: a header, the counts, one line per vertex, one line per face (the object file format of Geomview, as text)."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch.io.asset import Asset
from isomatch.io.attribute import Attribute, Kind
from isomatch.io.formats import _text
from isomatch.io.formats._text import NumberRows, TextLines
from isomatch.io.polygons import Polygons, spans
from isomatch.surfaces import Mesh

# matches the first line of a file: the letters before OFF, and the text after it
_HEADER = re.compile(r"(?P<letters>(?:ST|[CN4])*)OFF(?![A-Z])\s*(?P<rest>[^#]*)(?:#.*)?", re.IGNORECASE)
_MAP_INDICES = "indices into a colour map"  # name, in messages, of colours that are left out


class _Tables(NamedTuple):
    """The contents of a file."""

    letters: str  # letters before OFF in the first line, which tell what vertices have
    vertices: NumberRows
    points: FloatArray  # (n, 3) positions of the vertices
    faces: NumberRows
    corners: IntArray  # vertices of all faces, one after another
    sizes: IntArray  # the number of corners of each face
    notes: list[str]


def read(data: bytes, name: str) -> Mesh:
    """Read an OFF, COFF, NOFF, 4OFF or STOFF file. Counts may be on the header line; faces may have colours."""
    tables = _read_tables(_text.read_lines(name, data))
    return Mesh(tables.points, Polygons(tables.corners, tables.sizes, tables.points).triangles)


def read_asset(data: bytes, name: str) -> Asset:
    """Read an OFF file with the colours, normals and texture coordinates of its vertices and the colours of its faces.

    Three or four numbers after the positions are colours if possible, whatever the header says.
    """
    tables = _read_tables(_text.read_lines(name, data))
    rows, letters, notes, attributes = tables.vertices, tables.letters, tables.notes, []
    start, n_last = 4 if "4" in letters else 3, 2 if "ST" in letters else 0
    n_normal = 3 if "N" in letters else 0
    n_left = int(rows.counts.max(initial=0)) - start - n_normal - n_last
    normal, colour = start, start + n_normal
    # MeshLab writes colours, as bytes, before normals.
    if n_normal and "C" in letters and _text.are_bytes(rows.columns(start, 3)):
        normal, colour = start + n_left, start
    if n_normal:
        attributes.append(Attribute("normal", "point", "normal", rows.columns(normal, 3)))
    values = rows.columns(colour, min(n_left, 4))
    numbers = values[~np.isnan(values)]
    is_byte = (numbers == np.rint(numbers)).all() and (numbers <= 255).all()
    may_be_colours = (numbers >= 0).all() and (is_byte or (numbers <= 1).all())
    if n_left in (3, 4) and ("C" in letters or may_be_colours):
        attributes.append(Attribute("color", "point", "colour", _text.bytes_or_floats(values)))
    elif n_left > 0:
        what = _MAP_INDICES if "C" in letters and n_left == 1 else f"{n_left} numbers after the positions"
        notes.append(f"{what} of vertices are left out")
    if n_last:
        attributes.append(Attribute("uv", "point", "uv", rows.columns(start + n_normal + max(n_left, 0), 2)))
    n_left = int((tables.faces.counts - tables.sizes).max(initial=1)) - 1
    if n_left in (3, 4):
        values = tables.faces.columns(1 + tables.sizes, n_left)
        attributes.append(Attribute("color", "face", "colour", _text.bytes_or_floats(values)))
    elif n_left > 0:
        what = _MAP_INDICES if n_left == 1 else f"{n_left} numbers after the corners"
        notes.append(f"{what} of faces are left out")
    kept = [attribute for attribute in attributes if not np.isnan(attribute.values).all()]
    notes += [note for attribute in kept if (note := attribute.note_of_missing)]
    polygons = Polygons(tables.corners, tables.sizes)
    frame = _text.frame_in_comments(data)
    return Asset(tables.points, polygons, tuple(kept), notes=tuple(notes), frame=frame)


def keeps(attribute: Attribute) -> bool:
    """Whether OFF has a place for an attribute."""
    kinds = {"point": ("normal", "colour", "uv"), "face": ("colour",)}
    return attribute.kind in kinds.get(attribute.domain, ())


def write(asset: Asset) -> bytes:
    """Write an OFF file."""
    letters, template, columns = "", "%r %r %r", [asset.points]
    letter_of: dict[Kind, str] = {"normal": "N", "colour": "C", "uv": "ST"}
    for kind, letter in letter_of.items():
        for attribute in asset.of_kind(kind):
            if attribute.domain == "point":
                letters = letter + letters
                values, notation = attribute.values[:, : 2 if kind == "uv" else 3], "%r"
                if kind == "colour":
                    values, notation = _colours(attribute)
                template += f" {notation}" * values.shape[1]
                columns.append(values)
    sizes, corners = asset.polygons.sizes, asset.polygons.corners
    colours = [attribute for attribute in asset.of_kind("colour") if attribute.domain == "face"]
    if (sizes == 3).all() and not colours:
        faces = _text.format_rows("3 %d %d %d\n", corners.reshape(-1, 3))
    else:
        once = np.ones(len(sizes), dtype=np.int64)
        words = [(once, _text.words_of_numbers(sizes)), (sizes, _text.words_of_numbers(corners))]
        for values, notation in map(_colours, colours):
            has_colour = ~np.isnan(values).any(axis=1)
            colour_words = _text.words_of_numbers(values[has_colour].ravel(), notation)
            words.append((values.shape[1] * has_colour, colour_words))
        faces = _text.interleave_lines(words, len(sizes))
    head = f"{letters}OFF\n{_text.frame_comments(asset.frame)}{len(asset.points)} {len(sizes)} 0\n".encode()
    return head + _text.format_rows(f"{template}\n", np.hstack(columns)) + faces


def _colours(attribute: Attribute) -> tuple[FloatArray, str]:
    """Return colours as integers up to 255 or fractions, and their template."""
    fractions = attribute.fractions[:, :3]
    octets = np.rint(255 * fractions)
    # If all bytes were 0 or 1, they would be read as fractions, so such colours are written as fractions.
    whole = attribute.values.dtype.kind != "f" and octets.max(initial=0) > 1
    return (octets, "%d") if whole else (fractions, "%r")


def _read_tables(lines: TextLines) -> _Tables:
    """Read the letters before OFF, the counts, on this line or the next, and the vertices and faces."""
    first = lines.row(0).strip() if len(lines) else ""
    words, row, notes = first.split(), 0, []
    header = _HEADER.fullmatch(first)
    if header and "nOFF" not in first:
        row = 0 if header["rest"] else 1
        words = header["rest"].split() if row == 0 else (lines.row(1).split() if len(lines) > 1 else [])
    elif len(words) == 3 and all(map(_text.is_count, words)) and sum(map(int, words[:2])) == len(lines) - 1:
        notes.append("the word OFF is missing in the first line")
    else:
        expected = "the header OFF (or COFF, NOFF, STOFF, 4OFF) of a text file"
        lines.fail(0, expected, "add it or export the file again")
    if len(words) not in (2, 3) or not all(map(_text.is_count, words)):
        lines.fail(row, "the number of vertices, of faces and of edges")
    n_vertices, n_faces, body = int(words[0]), int(words[1]), lines[row + 1 :]
    if len(body) != n_vertices + n_faces:
        expected = f"{n_vertices} vertex lines and {n_faces} face lines as declared"
        body.fail(n_vertices + n_faces, expected, "correct the counts")
    vertices, faces = body[:n_vertices].parse(), body[n_vertices:].parse()
    sizes = faces.whole(faces.starts, "the number of corners of a face")
    faces.require(sizes >= 3, "a face of at least 3 corners")
    faces.require(faces.counts > sizes, "the number of corners of a face, then as many vertex indices")
    letters = header["letters"].upper() if header else ""
    width, names = (4, "x y z w") if "4" in letters else (3, "x y z")
    points = vertices.leading(width, f"at least {width} numbers {names} of a vertex")
    if width == 4:
        with np.errstate(all="ignore"):
            points = points[:, :3] / points[:, 3:]
    corners = faces.whole(spans(faces.starts + 1, sizes), "whole vertex indices")
    return _Tables(letters, vertices, points, faces, corners, sizes, notes)
