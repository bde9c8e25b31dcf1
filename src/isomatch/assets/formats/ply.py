"""PLY: named elements with named properties, as text or binary (the Stanford polygon format)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute, Domain
from isomatch.assets.formats._ply_attributes import Columns, read_columns, write_columns
from isomatch.assets.formats._ply_body import Table, read_tables
from isomatch.assets.formats._ply_header import Header, Property, read_header
from isomatch.assets.formats._ply_rows import Cells, cells, holds, write_rows
from isomatch.assets.formats._text import is_whole
from isomatch.assets.frame import Frame
from isomatch.assets.polygons import Polygons, Renumbering
from isomatch.errors import FormatError, MeshError
from isomatch.surfaces import Mesh
from isomatch.values.arrays import AnyArray, FloatArray, IntArray

_INDEX_LISTS = ("vertex_indices", "vertex_index")
_ENDS = ("vertex1", "vertex2", *_INDEX_LISTS)
"""Properties of other elements, such as edges, that are numbers of points."""
_PLACE = re.compile(
    r"\bunits?\s*([:=]|in\b|is\b|are\b|(milli|centi|micro)?met|[mc]?m\b|inch)|\bspace\s*=\s*[rlaips]{3}\b",
    re.I,
)
"""Comments that tell the unit or the space of the coordinates."""


@dataclass(frozen=True)
class PlyDocument:
    """What a PLY file holds beside points, polygons and attributes, and how it is written."""

    byte_order: str = "<"
    comments: tuple[str, ...] = ()
    positions: str = "double"
    index_list: str = "vertex_indices"
    vertex: Columns = field(default_factory=Columns)
    face: Columns = field(default_factory=Columns)
    elements: tuple[tuple[str, tuple[Cells, ...], int], ...] = ()

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> PlyDocument:
        """Take the same rows of lists, and renumber the points of edges, without those that lose one."""
        vertex = replace(self.vertex, others=tuple(each.at(rows.point_index) for each in self.vertex.others))
        face = replace(self.face, others=tuple(each.at(rows.polygon_index) for each in self.face.others))
        elements = tuple(_renumbered(*element, rows.new_point) for element in self.elements)
        return replace(self, vertex=vertex, face=face, elements=elements)


def read(data: bytes, name: str) -> Mesh:
    """Read a PLY file; properties and elements other than positions and faces are ignored."""
    tables = _tables(data, name, read_header(data, name))
    points = _positions(tables, name)
    return Mesh(points, Polygons(*_polygons(tables, name), points).triangles)


def read_asset(data: bytes, name: str) -> Asset:
    """Read a PLY file with all properties of its vertices and faces, and its other elements as they are."""
    header = read_header(data, name)
    tables = _tables(data, name, header)
    points, (corners, sizes) = _positions(tables, name), _polygons(tables, name)
    by_name = {element.name: element for element in header.elements}
    vertex = read_columns(by_name["vertex"], tables["vertex"], "point", "xyz", sizes)
    face = Columns()
    index_list = PlyDocument.index_list
    if "face" in by_name:
        index_list = next(key for key in _INDEX_LISTS if key in tables["face"].columns)
        face = read_columns(by_name["face"], tables["face"], "face", [index_list], sizes)
    others = tuple(
        (
            element.name,
            tuple(
                Cells(each, column.values.ravel(), column.counts if each.count_type else None)
                for each in element.properties
                for column in [tables[element.name].columns[each.name]]
            ),
            element.n_rows,
        )
        for element in header.elements
        if element.name not in ("vertex", "face")
    )
    x = next(each for each in by_name["vertex"].properties if each.name == "x")
    document = PlyDocument(
        header.byte_order,
        header.comments,
        "float" if x.type.str[1:] == "f4" else "double",
        index_list,
        vertex,
        face,
        others,
    )
    words = _of_place(header.comments)
    return Asset(
        points,
        Polygons(corners, sizes),
        vertex.attributes + face.attributes,
        document=document,
        frame=Frame(words=words) if words else None,
    )


def _of_place(comments: Iterable[str]) -> tuple[str, ...]:
    """Return the comments that tell the unit or the space of the coordinates."""
    return tuple(line for line in comments if _PLACE.search(line))


def keeps_frame(frame: Frame) -> bool:
    """Whether PLY can tell a frame: in words."""
    return not frame.has_space


def keeps(attribute: Attribute) -> bool:
    """Whether PLY has a place for an attribute: a property, or a list of numbers of the corners of each face."""
    return holds(attribute.coded.values) and (
        attribute.domain != "corner" or attribute.kind == "uv" or attribute.values.ndim == 1
    )


def write(asset: Asset, binary: bool | None = None) -> bytes:
    """Write a PLY file, binary or text, by default as it was read; a new one little endian, in double precision."""
    document = asset.document if isinstance(asset.document, PlyDocument) else PlyDocument()
    byte_order = document.byte_order if binary is None else (document.byte_order or "<") if binary else ""
    polygons = asset.polygons
    if np.abs(polygons.corners).max(initial=0) >= 2**31:
        raise MeshError("face indices exceed the 32 bits of PLY; remove the faces with repair(mesh)")
    kind = np.dtype("f4" if document.positions == "float" else "f8")
    lists = cells(document.index_list, polygons.corners.astype(np.int32), polygons.sizes)
    positions = [Cells(Property(axis, kind), column) for axis, column in zip("xyz", asset.points.T)]

    def columns(own: list[Cells], used: Iterable[str], known: Columns, domain: Domain) -> tuple[Cells, ...]:
        taken = [*used, *(each.declared.name for each in known.others)]
        new = write_columns(asset.attributes, domain, known.names, polygons.sizes, taken)
        return (*own, *new, *known.others)

    elements = [
        ("vertex", columns(positions, "xyz", document.vertex, "point"), len(asset.points)),
        ("face", columns([lists], _INDEX_LISTS, document.face, "face"), len(polygons)),
        *document.elements,
    ]
    encoding = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[byte_order]
    comments, words = document.comments, asset.frame.words if asset.frame else ()
    if _of_place(comments) != words:
        comments = (*(line for line in comments if line not in _of_place(comments)), *words)
    header = ["ply", f"format {encoding} 1.0", *comments]
    for name, written, n_rows in elements:
        header += [f"element {name} {n_rows}", *(column.declaration for column in written)]
    body = [write_rows(list(written), n_rows, byte_order) for _, written, n_rows in elements]
    return b"".join(["\n".join([*header, "end_header\n"]).encode("latin-1"), *body])


def _renumbered(
    name: str, written: tuple[Cells, ...], n_rows: int, new_point: IntArray
) -> tuple[str, tuple[Cells, ...], int]:
    """Renumber the points of an element; rows that lose one are left out."""
    kept = np.ones(n_rows, dtype=bool)
    changed = []
    for each in written:
        if each.declared.name in _ENDS and each.declared.type.kind in "iu":
            points = each.values.astype(np.int64)
            inside = (points >= 0) & (points < len(new_point))
            new = np.where(inside, new_point[np.where(inside, points, 0)] if len(new_point) else -1, -1)
            row = np.repeat(np.arange(n_rows), 1 if each.counts is None else each.counts)
            kept[row[new < 0]] = False
            each = replace(each, values=np.maximum(new, 0).astype(each.values.dtype))
        changed.append(each)
    rows = np.flatnonzero(kept)
    return name, tuple(each.at(rows) for each in changed), len(rows)


def _tables(data: bytes, name: str, header: Header) -> dict[str, Table]:
    tables = read_tables(data, name, header)
    if "tristrips" in tables:
        raise FormatError(
            f"{name}:1: expected triangles in element 'face', found 'tristrips'; export faces instead"
        )
    return tables


def _positions(tables: dict[str, Table], name: str) -> FloatArray:
    columns = tables["vertex"].columns if "vertex" in tables else {}
    missing = [axis for axis in "xyz" if axis not in columns or (columns[axis].counts != 1).any()]
    if missing:
        raise FormatError(
            f"{name}:1: expected an element 'vertex' with numbers x, y, z, found no {', '.join(missing)}; "
            "export the file again with positions"
        )
    return np.stack([columns[axis].values.ravel() for axis in "xyz"], axis=1, dtype=np.float64)


def _polygons(tables: dict[str, Table], name: str) -> tuple[IntArray, IntArray]:
    """Read the corners of all faces, concatenated, and the number of corners of each."""
    if "face" not in tables:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    table = tables["face"]
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
    return corners, counts


def _require(good: AnyArray, table: Table, expected: str) -> None:
    if not good.all():
        row = int(np.argmin(good))
        raise FormatError(
            f"{table.place(row)}: expected {expected}, face {row} has none; export the file again"
        )
