"""PLY: named elements with named properties, as text or binary (the Stanford polygon format).

The package plyfile 1.1 takes 4 to 30 times as long, has no integers of 64 bits, and ignores bytes at the end.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import cast

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import FormatError, MeshError
from isomatch._core.texts import encoding_of
from isomatch.io.asset import Asset, Frame
from isomatch.io.attribute import Attribute, Domain, Kind, guess_kind, number_equal_names, unused_names
from isomatch.io.formats import _text
from isomatch.io.formats._reading import content_beside, unexpected
from isomatch.io.formats._text import TextLines
from isomatch.io.materials import picture_in
from isomatch.io.polygons import Polygons, Renumbering, spans, triangles_of_strips
from isomatch.surfaces import Mesh

_TYPES = {  # numpy types by their names in PLY
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4",
    "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_COUNT_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4")  # numpy types that the length of a list may have
_LETTERS = {kind: letters for letters, kind in reversed(_TYPES.items())}  # name in PLY of each numpy type
# numpy's sign of the order of bytes, by the name of the file's encoding; empty for text
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER_BYTES = 2**18  # largest number of bytes of a header; chosen
_MAX_DECLARED = 1000  # most elements and properties in a header; chosen: real ones have fewer than 100
_MAX_ROW_BYTES = 2**31 - 1  # largest number of bytes in a row of an element: numpy's types hold no more
_INDEX_LISTS = ("vertex_indices", "vertex_index")  # names of the property with the vertices of a face
_POINT_PROPERTIES = ("vertex1", "vertex2", *_INDEX_LISTS)  # properties that hold numbers of points
# name, kind and properties of each attribute that several properties make up
_GROUPS: tuple[tuple[str, Kind, tuple[str, ...]], ...] = (
    ("normal", "normal", ("nx", "ny", "nz")),
    ("color", "colour", ("red", "green", "blue", "alpha")),
    ("color", "colour", ("red", "green", "blue")),
    ("color", "colour", ("r", "g", "b")),
    ("color", "colour", ("diffuse_red", "diffuse_green", "diffuse_blue")),
    ("uv", "uv", ("s", "t")),
    ("uv", "uv", ("u", "v")),
    ("uv", "uv", ("texture_u", "texture_v")),
)
_NO_BYTE = re.compile("[\ud800-\udc7f\udd00-\udfff]")
"""Matches surrogates that stand for no byte; Python decodes bytes that are not UTF-8 to the others."""
_CORNER_UV = "texcoord"  # property of faces with the texture coordinates of their corners
TEXTURE_NUMBER = "texnumber"
"""The property of faces with the number of their picture."""
_TEXTURE = "comment TextureFile {}"  # line of the header that names a picture
_JOINT = re.compile(r"joint (\S+) (\S+) ?(.*)")
"""Text of a comment that names an attribute of weights, one of its properties, and the joint to which it belongs."""


@dataclass(frozen=True)
class Column:
    """A property of an element: declaration, values of all rows, and for lists their lengths."""

    name: str
    type: np.dtype[np.generic]
    count_type: np.dtype[np.generic] | None = None
    values: AnyArray = field(default_factory=lambda: np.zeros(0))
    counts: IntArray | None = None

    @classmethod
    def of(cls, name: str, values: AnyArray, counts: IntArray | None = None) -> Column:
        """Make a column with the smallest type of PLY that holds the values."""
        count_type = None if counts is None else np.dtype("u1" if counts.max(initial=0) < 256 else "i4")
        return cls(name, _type_of(values), count_type, values.ravel(), counts)

    def at(self, rows: IntArray) -> Column:
        """Select rows, in the given order."""
        if self.counts is None:
            return replace(self, values=self.values[rows])
        index = spans((np.cumsum(self.counts) - self.counts)[rows], self.counts[rows])
        return replace(self, values=self.values[index], counts=self.counts[rows])

    @property
    def typed(self) -> AnyArray:
        """The values in the declared type, unless values of a text file do not fit it."""
        if self.type.kind != "f" and self.values.dtype.kind == "f":
            limits = np.iinfo(self.type.str)
            is_whole = _text.is_whole(self.values).all()
            if not is_whole or (self.values < limits.min).any() or (self.values > limits.max).any():
                return self.values
        with np.errstate(over="ignore"):
            return self.values.astype(self.type.newbyteorder("="))


@dataclass(frozen=True)
class Element:
    """A table of the file, such as ``vertex``, with its place for messages."""

    columns: tuple[Column, ...] = ()
    n_rows: int = 0
    place: str = ""

    def renumbered(self, new_point: IntArray) -> Element:
        """Renumber the points of edges; those that lose a point are left out."""
        kept, changed = np.ones(self.n_rows, dtype=bool), []
        for column in self.columns:
            if column.name in _POINT_PROPERTIES and column.type.kind in "iu":
                points = column.values.astype(np.int64)
                points = np.where((points >= 0) & (points < len(new_point)), points, len(new_point))
                new = np.append(new_point, -1)[points]
                row = np.repeat(np.arange(self.n_rows), 1 if column.counts is None else column.counts)
                kept[row[new < 0]] = False
                column = replace(column, values=np.maximum(new, 0).astype(column.values.dtype))
            changed.append(column)
        rows = np.flatnonzero(kept)
        return replace(self, columns=tuple(column.at(rows) for column in changed), n_rows=len(rows))


Names = Mapping[tuple[str, Domain], tuple[str, ...]]  # names of the properties of each attribute
Declared = Mapping[str, tuple[int, list[Column]]]  # the number of rows and the columns of each element


@dataclass(frozen=True)
class PlyDocument:
    """Contents of a PLY file beside points, polygons and attributes, and how it is written."""

    byte_order: str = "<"
    encoding: str = "utf-8"  # the encoding of the names of properties
    comments: tuple[str, ...] = ()
    positions: str = "f8"
    index_list: str = "vertex_indices"
    names: Names = field(default_factory=dict)
    of_points: tuple[Column, ...] = ()
    of_faces: tuple[Column, ...] = ()
    elements: Mapping[str, Element] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)  # the bytes of each picture by name

    @property
    def textures(self) -> tuple[str, ...]:
        """Names of the pictures, in the order of their numbers."""
        return tuple(name for name in map(_texture_of, self.comments) if name)

    def with_textures(self, files: Mapping[str, bytes]) -> PlyDocument:
        """Return the same with other pictures."""
        others = (comment for comment in self.comments if not _texture_of(comment))
        return replace(self, comments=(*others, *map(_TEXTURE.format, files)), files=files)

    def with_renamed_files(self, names: Mapping[str, str]) -> PlyDocument:
        """Rename pictures; those that were not found keep their names."""
        names_without_blanks = ((comment, names.get(_texture_of(comment))) for comment in self.comments)
        comments = tuple(_TEXTURE.format(name) if name else comment for comment, name in names_without_blanks)
        return replace(self, comments=comments)

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> PlyDocument:
        """Select the rows of lists, and renumber the points of edges."""
        return replace(
            self,
            of_points=tuple(part.at(rows.point_index) for part in self.of_points),
            of_faces=tuple(part.at(rows.polygon_index) for part in self.of_faces),
            elements={name: part.renumbered(rows.new_point) for name, part in self.elements.items()},
        )


def with_names_of(asset: Asset, giver: object) -> Asset:
    """Give new attributes of a PLY file the names of properties in another PLY document."""
    if not (isinstance(asset.document, PlyDocument) and isinstance(giver, PlyDocument)):
        return asset
    document = asset.document
    taken = {name for members in document.names.values() for name in members}
    taken |= {column.name for column in document.of_points}
    more = {key: members for key, members in giver.names.items() if taken.isdisjoint(members)}
    return replace(asset, document=replace(document, names={**more, **document.names}))


def names_without_blanks(asset: Asset) -> list[Attribute]:
    """Return the attributes whose names lose blanks, with names that say so."""
    kept_names = asset.document.names if isinstance(asset.document, PlyDocument) else {}
    new = [a for a in asset.attributes if (a.name, a.domain) not in kept_names]
    lost = [a for a in new if re.search(r"[\x00-\x20]", a.name)]
    return [replace(attribute, name=f"the blanks in the name {attribute.name}") for attribute in lost]


def read(data: bytes, name: str) -> Mesh:
    """Read the positions and faces of a PLY file."""
    elements = _elements(data, name)[0]
    points = _positions(elements, name)
    return Mesh(points, Polygons(*_polygons(elements, name)[:2], points).triangles)


def read_asset(data: bytes, name: str) -> Asset:
    """Read a PLY file with all properties of its vertices and faces, and its other elements."""
    elements, order, comments, encoding = _elements(data, name)
    points, (corners, sizes, index_list) = _positions(elements, name), _polygons(elements, name)
    vertex, face = elements.pop("vertex"), elements.pop("face", Element())
    elements.pop("tristrips", None)
    joints = _joints_of(comments)
    of_points, point_names, point_lists = _attributes(vertex, "point", "xyz", sizes, joints)
    of_faces, face_names, face_lists = _attributes(face, "face", (index_list,), sizes, joints)
    single = {texture.type.str[1:] for texture in vertex.columns if texture.name == "x"} == {"f4"}
    names, positions = {**point_names, **face_names}, "f4" if single else "f8"
    document = PlyDocument(
        order, encoding, comments, positions, index_list, names, point_lists, face_lists, elements
    )
    folder, files = Path(name).parent, dict[str, bytes]()
    for texture in document.textures:
        if (picture := content_beside(texture, folder, picture_in)) is not None:
            files[texture] = picture
    document = replace(document, files=files)
    frame = Frame.of_lines(*map(_text_of, comments))
    return Asset(points, Polygons(corners, sizes), of_points + of_faces, document=document, frame=frame)


def keeps(attribute: Attribute) -> bool:
    """Whether PLY has a place for an attribute: properties, or a list for the corners of each face."""
    values = attribute.coded.values
    if values.dtype.kind not in "biuf" or _type_of(values).str[1:] in ("i8", "u8"):
        return False
    return attribute.domain != "corner" or attribute.kind == "uv" or attribute.values.ndim == 1


def write(asset: Asset, binary: bool | None = None, single: bool = False) -> bytes:
    """Write a PLY file, by default as it was read; a new one is little endian and has doubles.

    If ``single``, it has no doubles, which some programs cannot read.
    """
    document = asset.document if isinstance(asset.document, PlyDocument) else PlyDocument()
    byte_order = document.byte_order if binary is None else (document.byte_order or "<") if binary else ""
    is_single = document.positions == "f4" and not asset.needs_doubles
    polygons, kind = asset.polygons, np.dtype("f4" if is_single else "f8")
    if np.abs(polygons.corners).max(initial=0) >= 2**31:
        raise MeshError("face indices exceed the 32 bits of PLY; remove the faces with repair(mesh)")
    positions = tuple(Column(axis, kind, None, column) for axis, column in zip("xyz", asset.points.T))
    corners = Column.of(document.index_list, polygons.corners.astype(np.int32), polygons.sizes)
    vertex, joints = _properties(asset, "point", positions, document.of_points, document.names)
    face, _ = _properties(asset, "face", (corners,), document.of_faces, document.names)
    elements = {"vertex": Element(vertex, len(asset.points)), "face": Element(face, len(polygons))}
    elements |= document.elements
    if single:
        for name, element in elements.items():
            columns = (
                replace(c, type=np.dtype("f4")) if c.type.str[1:] == "f8" else c for c in element.columns
            )
            elements[name] = Element((*columns,), element.n_rows)
    encoding = next(word for word, order in _BYTE_ORDERS.items() if order == byte_order)
    comments = [comment for comment in document.comments if not _JOINT.fullmatch(_text_of(comment))]
    comments += joints
    lines = asset.frame.lines if asset.frame else ()
    frame = Frame.of_lines(*map(_text_of, comments)) or Frame()
    if frame.words != lines:
        others = (comment for comment in comments if _text_of(comment) not in frame.words)
        comments = [*others, *(f"comment {line}" for line in lines)]
    header = ["ply", f"format {encoding} 1.0", *comments]
    for name, element in elements.items():
        header.append(f"element {name} {element.n_rows}")
        for column in element.columns:
            count = "" if column.count_type is None else f"list {_LETTERS[column.count_type.str[1:]]} "
            header.append(f"property {count}{_LETTERS[column.type.str[1:]]} {column.name}")
    body = [_rows(element, byte_order) for element in elements.values()]
    return b"".join([*_encode_header([*header, "end_header"], document.encoding), *body])


def _encode_header(header: list[str], encoding: str) -> list[bytes]:
    """Encode a header as it was read, or in UTF-8 if the encoding lacks some letters; keep comments."""
    try:
        "".join(line for line in header if not _is_comment(line)).encode(encoding)
    except UnicodeEncodeError:
        encoding = "utf-8"
    lines = (_NO_BYTE.sub(lambda found: ascii(found[0])[1:-1], line) for line in header)
    encodings = ((line, "utf-8" if _is_comment(line) else encoding) for line in lines)
    return [line.encode(chosen, "surrogateescape") + b"\n" for line, chosen in encodings]


def _is_comment(line: str) -> bool:
    return line.startswith(("comment", "obj_info"))


def _text_of(comment: str) -> str:
    return comment.partition(" ")[2].strip()


def _texture_of(comment: str) -> str:
    """Return the name of the picture in a comment, empty for other comments."""
    keyword, _, name = _text_of(comment).partition(" ")
    return name.strip() if keyword.lower() == "texturefile" else ""


def _joints_of(comments: tuple[str, ...]) -> dict[str, dict[str, str]]:
    """Read the joint of each property of weights from comments, by the name of the attribute."""
    joints = dict[str, dict[str, str]]()
    for found in filter(None, (_JOINT.fullmatch(_text_of(comment)) for comment in comments)):
        joints.setdefault(found[1], {})[found[2]] = found[3]
    return joints


def _elements(data: bytes, name: str) -> tuple[dict[str, Element], str, tuple[str, ...], str]:
    """Read all elements, the byte order (empty for text), comments, and the encoding of names."""
    # The header is in UTF-8 or another encoding. Only ASCII blanks separate words. The last word is the rest
    # of the line, as names of Blender's groups have blanks.
    lines, n_bytes = _header_lines(data, name)
    named = [text for text in lines.texts if not text.startswith((b"comment", b"obj_info"))]
    encoding = encoding_of(b"\n".join(named))
    words = lines.row(1).split() if len(lines) > 1 else []
    if len(words) != 3 or words[0] != "format" or words[1] not in _BYTE_ORDERS:
        lines.fail(1, f"'format' and one of {', '.join(_BYTE_ORDERS)}")
    order = _BYTE_ORDERS[words[1]]
    declared: dict[str, tuple[int, list[Column]]] = {}
    columns: list[Column] = []
    comments: list[str] = []
    for i in range(2, len(lines) - 1):
        text = lines[i : i + 1].texts[0]
        most = 4 if text.split()[1:2] == [b"list"] else 2
        match [word.strip().decode(encoding, "replace") for word in text.split(None, most)]:
            case ["comment" | "obj_info", *_]:
                comments.append(text.decode("utf-8", "surrogateescape"))
            case ["element", element, n_rows] if _text.is_count(n_rows) and element not in declared:
                columns = []
                declared[element] = int(n_rows), columns
            case ["property", "list", number, kind, column] if (
                declared and kind in _TYPES and _TYPES.get(number) in _COUNT_TYPES
            ):
                count_type = np.dtype(order + _TYPES[number])
                columns.append(Column(column, np.dtype(order + _TYPES[kind]), count_type))
            case ["property", kind, column] if declared and kind in _TYPES:
                columns.append(Column(column, np.dtype(order + _TYPES[kind])))
            case _:
                properties = "'property TYPE NAME' or 'property list TYPE TYPE NAME'"
                lines.fail(i, f"'element NAME COUNT' of a new name, {properties}")
        if i - len(comments) > _MAX_DECLARED:
            lines.fail(i, f"at most {_MAX_DECLARED} elements and properties", "remove those not needed")
    read_body = _read_binary if order else _read_text
    return read_body(data, name, n_bytes, len(lines), declared), order, tuple(comments), encoding


def _header_lines(data: bytes, name: str) -> tuple[TextLines, int]:
    """Return the lines up to ``end_header``, and their length in bytes."""
    mark = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    if data[mark : mark + 3].lower() != b"ply" or data[mark + 3 : mark + 4] not in (b"\n", b"\r", b" "):
        raise unexpected(f"{name}:1", "'ply'", repr(data[:10]), "give a PLY file, or rename this one")
    mark = data.find(b"end_header", 0, _MAX_HEADER_BYTES)
    end = data.find(b"\r" if b"\n" not in data[:mark] else b"\n", mark)
    if mark < 0 or end < 0:
        raise unexpected(f"{name}:1", "'end_header' within 256 KiB", "none", "copy the file again")
    text = data[:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n").rstrip(b"\n") + b"\n"
    return TextLines(name, np.frombuffer(text, np.uint8), np.arange(1, text.count(b"\n") + 1)), end + 1


def _read_text(data: bytes, name: str, n_bytes: int, n_lines: int, declared: Declared) -> dict[str, Element]:
    lines, elements, start = _text.read_lines(name, data[n_bytes:], before=n_lines), dict[str, Element](), 0
    for element, (n_rows, columns) in declared.items():
        stop = start + (n_rows if columns else 0)
        if stop > len(lines):
            lines.fail(len(lines), f"{n_rows} lines of element {element}, not {len(lines) - start}")
        rows = lines[start:stop].parse()
        expected = f"{element}: " + " ".join(f"{'count ' * bool(c.count_type)}{c.name}" for c in columns)
        cursor, ends, held = rows.starts, rows.starts + rows.counts, []
        for column in columns:
            rows.require(cursor < ends, expected)
            counts, where = None, cursor
            if column.count_type is not None:
                counts = rows.whole(cursor, expected)
                rows.require((counts >= 0) & (counts < ends - cursor), expected)
                where = spans(cursor + 1, counts)
            held.append(replace(column, values=rows.values[where], counts=counts))
            cursor = cursor + 1 + (0 if counts is None else counts)
        rows.require((cursor == ends) | (not columns), expected)
        place = f"{name}:{lines.numbers[start] if stop > start else 1}"
        elements[element], start = Element(tuple(held), n_rows, place), stop
    if start != len(lines):
        expected = "no line after the elements declared in the header"
        lines.fail(start, expected, "correct the counts in the header")
    return elements


def _read_binary(data: bytes, name: str, position: int, _: int, declared: Declared) -> dict[str, Element]:
    elements = dict[str, Element]()
    for element, (n_rows, columns) in declared.items():
        declaration = columns, n_rows, data, position
        held, end = _read_uniform(*declaration) or _read_mixed(*declaration)
        if end > len(data):
            place, expected = f"{name}: byte {len(data)}", f"{n_rows} rows of element {element}"
            remedy = "it is cut short or damaged, copy or export it again"
            raise unexpected(place, expected, "the end of the file", remedy)
        elements[element], position = Element(tuple(held), n_rows, f"{name}: byte {position}"), end
    if data[position:].strip():
        place, found = f"{name}: byte {position}", f"{len(data) - position} more bytes"
        remedy = "the counts in the header do not fit the data, export the file again"
        raise unexpected(place, "the end of the file", found, remedy)
    return elements


def _read_uniform(
    columns: list[Column], n_rows: int, data: bytes, start: int
) -> tuple[list[Column], int] | None:
    """Read all rows at once; None if their lists have different lengths."""
    fields: list[tuple[object, ...]] = []
    position, counts = start, []
    for i, column in enumerate(columns):
        count = 1
        if column.count_type is not None:
            first = data[position : position + column.count_type.itemsize]
            position += column.count_type.itemsize
            count = int(np.frombuffer(first, column.count_type)[0]) if position <= len(data) else -1
            fields.append((f"count{i}", column.count_type))
        position += count * column.type.itemsize
        if count < 0 or position > min(len(data), start + _MAX_ROW_BYTES):
            return None
        counts.append(count)
        fields.append((f"{i}", column.type, (count,)))
    if not n_rows or position == start or (end := start + n_rows * (position - start)) > len(data):
        return None
    rows, held = np.frombuffer(data, np.dtype(fields), n_rows, start), []
    for i, (column, count) in enumerate(zip(columns, counts)):
        if column.count_type is not None and (rows[f"count{i}"] != count).any():
            return None
        counts_of_rows = None if column.count_type is None else np.broadcast_to(np.int64(count), n_rows)
        held.append(replace(column, values=rows[f"{i}"].ravel(), counts=counts_of_rows))
    return held, end


def _read_mixed(columns: list[Column], n_rows: int, data: bytes, start: int) -> tuple[list[Column], int]:
    """Read rows of different lengths; the returned end exceeds the data if they are cut short."""
    too_far, end, n_rows = len(data) + 1, start, n_rows if columns else 0
    sizes = [column.type.itemsize for column in columns]
    types = [column.count_type or np.dtype("V0") for column in columns]
    if n_rows * sum(kind.itemsize or size for kind, size in zip(types, sizes)) > len(data) - start:
        return [], too_far
    orders = ["big" if kind.byteorder == ">" else "little" for kind in types]
    plan = list(zip([kind.itemsize for kind in types], orders, [kind.kind == "i" for kind in types], sizes))
    counts_read: list[int] = []  # length of each list, row by row
    for _ in range(n_rows):
        for n_bytes, order, is_signed, size in plan:
            count = 1
            if n_bytes:
                count = int.from_bytes(data[end : end + n_bytes], order, signed=is_signed)  # type: ignore[arg-type]
                end += n_bytes
            end += count * size
            if count < 0 or end > len(data):
                return [], too_far
            counts_read.append(count)
    counts = np.array(counts_read, dtype=np.int64).reshape(n_rows, len(columns))
    lengths = counts * sizes + [kind.itemsize for kind in types]
    first = start + np.cumsum(lengths.sum(axis=1)) - lengths.sum(axis=1)
    octets, held = np.frombuffer(data, np.uint8), []
    for i, column in enumerate(columns):
        where = spans(first + types[i].itemsize, counts[:, i] * sizes[i])
        counts_of_rows = None if column.count_type is None else counts[:, i].copy()
        held.append(replace(column, values=octets[where].view(column.type), counts=counts_of_rows))
        first = first + lengths[:, i]
    return held, end


def _positions(elements: Mapping[str, Element], name: str) -> FloatArray:
    vertex = elements.get("vertex", Element())
    values_of = {column.name: column.values for column in vertex.columns if column.counts is None}
    if missing := [axis for axis in "xyz" if axis not in values_of]:
        expected, remedy = "an element 'vertex' with numbers x, y, z", "export the file again with positions"
        raise unexpected(f"{name}:1", expected, f"no {', '.join(missing)}", remedy)
    return np.stack([values_of[axis] for axis in "xyz"], axis=1, dtype=np.float64)


def _polygons(elements: Mapping[str, Element], name: str) -> tuple[IntArray, IntArray, str]:
    """Read the concatenated corners of all faces, their numbers, and the name of the list."""
    if "face" not in elements and "tristrips" in elements:
        lists = [column for column in elements["tristrips"].columns if column.counts is not None]
        if not lists or not _text.is_whole(lists[0].values).all():
            expected = "a list of whole numbers of points in element 'tristrips'"
            raise unexpected(f"{name}:1", expected, "none", "export faces instead")
        corners = lists[0].values.astype(np.int64)
        starts = np.cumsum(np.append(0, cast(IntArray, lists[0].counts))) - 0.5
        ends = np.union1d(np.flatnonzero(corners < 0), starts)
        strip = np.searchsorted(ends, np.arange(len(corners)), side="right")
        sizes = np.bincount(strip[corners >= 0], minlength=1)
        triangles, _ = triangles_of_strips(corners[corners >= 0], sizes)
        return triangles.ravel(), np.full(len(triangles), 3), _INDEX_LISTS[0]
    face = elements.get("face", Element())
    if not face.columns and not face.n_rows:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), _INDEX_LISTS[0]
    lists = [column for key in _INDEX_LISTS for column in face.columns if column.name == key]
    if not lists or lists[0].counts is None:
        names = ", ".join(column.name for column in face.columns) or "none"
        expected = f"the list {' or '.join(_INDEX_LISTS)} of the faces"
        raise unexpected(f"{name}:1", expected, names, "rename it or export the file again")
    corners, counts = lists[0].values, lists[0].counts
    small, broken = np.flatnonzero(counts < 3), counts[:0]
    if corners.dtype.kind == "f":
        broken = np.repeat(np.arange(len(counts)), counts)[~_text.is_whole(corners)]
    for rows, expected in ((small, "a face of at least 3 corners"), (broken, "whole vertex indices")):
        if len(rows):
            raise FormatError(
                f"{face.place}: expected {expected}, face {rows[0]} from here on has none; export the file again"
            )
    return corners.astype(np.int64), counts, lists[0].name


def _attributes(
    element: Element,
    domain: Domain,
    used: Collection[str],
    sizes: IntArray,
    joints: Mapping[str, Mapping[str, str]],
) -> tuple[tuple[Attribute, ...], Names, tuple[Column, ...]]:
    """Make attributes of unused columns; return also their properties, and the columns that make none."""
    left = {column.name: column for column in element.columns if column.name not in used}
    single = {name: column for name, column in left.items() if column.count_type is None}
    pairs: list[tuple[Attribute, tuple[str, ...]]] = []

    def add(name: str, kind: Kind | None, members: tuple[str, ...], words: Iterable[str] = ()) -> None:
        values = np.stack([single.pop(member).typed for member in members], axis=1)
        kind = kind or guess_kind(name, values)
        pairs.append((Attribute(name, domain, kind, values, names=dict(enumerate(words))), members))

    for name, joint_of in joints.items():
        if joint_of.keys() <= single.keys():
            add(name, "weights", tuple(joint_of), joint_of.values())
    for name, kind, members in _GROUPS:
        types = {single[member].type if member in single else None for member in members}
        if len(types) == 1 and (dtype := types.pop()) and (kind == "colour" or dtype.kind == "f"):
            add(name, kind, members)
    for first in [name for name in single if name.endswith("_0")]:
        stem = first[:-2]
        members = tuple(takewhile(single.__contains__, (f"{stem}_{i}" for i in range(len(single)))))
        if len(members) > 1 and len({single[member].type for member in members}) == 1:
            add(stem, None, members)
    for name, column in single.items():
        pairs.append((Attribute(name, domain, guess_kind(name, column.typed), column.typed), (name,)))
    listed = [column for column in left.values() if column.counts is not None]
    lists = {column.name: _corner_attribute(column, sizes) for column in listed}
    pairs += [(corner, (name,)) for name, corner in lists.items() if corner is not None and domain == "face"]
    pairs.sort(key=lambda pair: list(left).index(pair[1][0]))
    attributes = number_equal_names(attribute for attribute, _ in pairs)
    names = {(a.name, a.domain): members for a, (_, members) in zip(attributes, pairs)}
    made = {member for members in names.values() for member in members}
    return attributes, names, tuple(left[name] for name in lists if name not in made)


def _corner_attribute(column: Column, sizes: IntArray) -> Attribute | None:
    """Make an attribute of a list with one value per corner, or two or none for texture coordinates."""
    width, values = 2 if column.name == _CORNER_UV else 1, column.typed
    if column.counts is None or len(column.counts) != len(sizes):
        return None
    is_full = column.counts == width * sizes
    if not is_full.any() or not (is_full | ((column.counts == 0) & (width == 2))).all():
        return None
    if width == 1:
        return Attribute(column.name, "corner", guess_kind(column.name, values), values)
    uv = np.full((int(sizes.sum()), 2), np.nan, values.dtype)
    uv[np.repeat(is_full, sizes)] = values.reshape(-1, 2)
    return Attribute("uv", "corner", "uv", uv)


def _properties(
    asset: Asset, domain: Domain, first_columns: tuple[Column, ...], lists: tuple[Column, ...], names: Names
) -> tuple[tuple[Column, ...], list[str]]:
    """Return the columns of an element, with lists for corners, and comments that name joints."""
    taken = {*_INDEX_LISTS, *(attribute.name for attribute in (*first_columns, *lists))}
    domains = ("face", "corner") if domain == "face" else (domain,)
    attributes = [attribute for attribute in asset.attributes if attribute.domain in domains]
    former = [names.get((attribute.name, attribute.domain), ()) for attribute in attributes]
    for i, (attribute, members) in enumerate(zip(attributes, former)):
        if attribute.domain != "corner" and len(members) != attribute.plain.size // max(len(attribute), 1):
            former[i] = ()
    taken.update(member for members in former for member in members)
    columns, comments = list[Column](), list[str]()
    for attribute, members in zip(attributes, former):
        values = attribute.plain
        if attribute.kind == "colour" and not members and not np.isnan(values).any():
            # many programs read colours only as bytes
            values = np.rint(255 * attribute.fractions.clip(0, 1)).astype(np.uint8)
        members = members or _name_members(attribute, values, taken)
        taken.update(members)
        if attribute.kind == "weights" and attribute.names:
            for member, joint in zip(members, attribute.joint_names):
                joint = re.sub(r"[\x00-\x1f]+", " ", joint)
                comments.append(f"comment joint {_word(attribute.name)} {member} {joint}")
        if attribute.domain == "corner":
            columns.append(_list_of_faces(members[0], values, asset.polygons.sizes))
        else:
            columns += [Column.of(name, column) for name, column in zip(members, np.atleast_2d(values.T))]
    return (*first_columns, *columns, *lists), comments


def _word(name: str) -> str:
    """Return a name without blanks, which most readers do not allow."""
    return re.sub(r"[\x00-\x20\x7f]+", "_", name) or "_"


def _name_members(attribute: Attribute, values: AnyArray, taken: set[str]) -> tuple[str, ...]:
    """Name the properties of a new attribute: usual names, names of joints, or its name with numbers."""
    if attribute.kind == "weights" and attribute.names:
        return tuple(unused_names(map(_word, attribute.joint_names), taken))
    width = values.shape[1] if values.ndim == 2 else 1
    is_corner, kind = attribute.domain == "corner", attribute.kind
    options: list[tuple[str, ...]] = [(_CORNER_UV,)] if is_corner and kind == "uv" else []
    for name, group_kind, members in () if is_corner else _GROUPS:
        if len(members) == width and (name == attribute.name or group_kind == kind == "colour"):
            options.append(members)
    stem = _word(attribute.name)
    while not (free := [members for members in options if taken.isdisjoint(members)]):
        options = [(stem,) if is_corner or values.ndim == 1 else tuple(f"{stem}_{i}" for i in range(width))]
        stem += "_"
    return free[0]


def _list_of_faces(name: str, values: AnyArray, sizes: IntArray) -> Column:
    """Make a list of the values of corners, empty for a face with nan."""
    counts = (values.shape[1] if values.ndim == 2 else 1) * sizes
    if values.dtype.kind == "f" and name == _CORNER_UV:
        missing = np.isnan(values).any(axis=1)
        without = np.add.reduceat(missing, np.cumsum(sizes) - sizes) > 0 if len(sizes) else sizes > 0
        values, counts = values[~np.repeat(without, sizes)], np.where(without, 0, counts)
    return Column.of(name, values, counts)


def _type_of(values: AnyArray) -> np.dtype[np.generic]:
    """Return the smallest type of PLY that holds values; it has no integers of 64 bits."""
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind in "biu" and size in (1, 8):
        for candidate in ("u1", "i1", "i4", "u4") if size == 1 else ("i4", "u4"):
            limits = np.iinfo(candidate)
            if limits.min <= values.min(initial=0) and values.max(initial=0) <= limits.max:
                return np.dtype(candidate)
    return np.dtype("f4" if size == 2 else "f8") if kind == "f" and size not in (4, 8) else values.dtype


def _rows(element: Element, byte_order: str) -> bytes:
    """Write the rows of an element in a byte order, or as text if that is empty."""
    n_rows = element.n_rows
    once = np.ones(n_rows, dtype=np.int64)
    fields: list[tuple[IntArray, AnyArray, str]] = []  # for each property: counts, numbers, type
    for column in element.columns:
        if column.counts is not None and column.count_type is not None:
            fields.append((once, column.counts, column.count_type.str[1:]))
        fields.append((once if column.counts is None else column.counts, column.values, column.type.str[1:]))
    if not byte_order:
        formats = {"f4": "%.9g", "f8": "%r"}
        words = [_text.words_of_numbers(values, formats.get(kind, "%d")) for _, values, kind in fields]
        return _text.interleave_lines([*zip((counts for counts, *_ in fields), words)], n_rows)
    if all((counts == counts[:1]).all() for counts, _, _ in fields):
        row = [(f"{i}", byte_order + kind, (counts[:1].sum(),)) for i, (counts, _, kind) in enumerate(fields)]
        rows = np.zeros(n_rows, row)
        for i, (_, values, _) in enumerate(fields):
            rows[f"{i}"] = values.reshape(rows[f"{i}"].shape)
        return rows.tobytes()
    octets = [
        (counts * int(kind[1:]), np.ascontiguousarray(values, byte_order + kind).view(np.uint8))
        for counts, values, kind in fields
    ]
    return _text.interleave(octets, n_rows, np.uint8).tobytes()
