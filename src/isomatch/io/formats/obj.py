"""OBJ: vertices, texture coordinates, normals, faces with groups and materials; MTL, its libraries."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch._core.texts import decode_text, encoding_of
from isomatch.io.asset import Asset
from isomatch.io.attribute import Attribute, Kind
from isomatch.io.formats import _text
from isomatch.io.formats._reading import content_beside
from isomatch.io.formats._text import NumberRows, TextLines
from isomatch.io.materials import Layer, Look, Picture, Wrap, picture_in
from isomatch.io.polygons import Polygons, Renumbering
from isomatch.surfaces import Mesh, weld_points

_STATEMENTS = {"object": "o", "group": "g", "material": "usemtl", "smoothing": "s"}
"""Keyword of the statement that gives an attribute to the faces after it, by the name of the attribute."""
_INDEXED: tuple[tuple[str, str, Kind, int], ...] = (("vt", "uv", "uv", 2), ("vn", "normal", "normal", 3))
"""Keyword, name, kind and width of the further indices of faces, in order."""
_NAME_KEYWORDS = ("mtllib", "o", "g", "usemtl")
"""Keywords that a name follows, up to the end of the line."""
_COLOUR_BLOCK = re.compile(rb"(?m)^#MRGB[ \t]+((?:[0-9A-Fa-f]{8})+)[ \t]*$")
"""Colours of ZBrush in comments: mask, red, green and blue of each vertex, in hexadecimal digits."""
_NUMBER_OPTIONS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2}
"""Options of a picture, with the largest number of numbers after each."""
_WORD_OPTIONS = ("-blendu", "-blendv", "-bm", "-boost", "-cc", "-clamp", "-imfchan", "-texres", "-type")
"""Options of a picture with one word after each."""
_UDIM = re.compile("<udim>", re.IGNORECASE)  # stands for the UDIM number of a tile in the name of a picture
TILES = range(1001, 1101)
"""Numbers of tiles by the UDIM convention: coordinates u from i to i + 1, v from j to j + 1 are tile 1001 + i + 10 j."""
# beginnings of the keywords after which a material library names a picture
_PICTURE_KEYWORDS = ("map_", "bump", "disp", "decal", "norm", "refl")


@dataclass(frozen=True)
class ObjDocument:
    """Names of material libraries, elements that are no faces, encoding of names, and files."""

    libraries: tuple[str, ...] = ()
    elements: tuple[str, ...] = ()
    encoding: str = "utf-8"
    files: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def library_names(self) -> tuple[str, ...]:
        """Possible names of libraries: whole lines, as names may have blanks, and their words."""
        return tuple(dict.fromkeys(name for line in self.libraries for name in (line, *line.split())))

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> ObjDocument:
        """Renumber lines and points; those that lose a point are left out."""
        kept = []
        for element in self.elements:
            keyword, *words = element.split()
            numbers = np.array(words, dtype=np.int64) - 1
            inside = (numbers >= 0) & (numbers < len(rows.new_point))
            new_numbers = rows.new_point[numbers[inside]] + 1
            if inside.all() and new_numbers.all():
                kept.append(" ".join([keyword, *map(str, new_numbers.tolist())]))
        return replace(self, elements=tuple(kept))

    def with_renamed_files(self, names: Mapping[str, str]) -> ObjDocument:
        """Refer to libraries by other names."""
        lines = [
            names.get(line)
            or (" ".join(names.get(word, word) for word in words) if names.keys() & set(words) else line)
            for line, words in ((line, line.split()) for line in self.libraries)
        ]
        return replace(self, libraries=tuple(lines))


def read(data: bytes, name: str) -> Mesh:
    """Read the faces of an OBJ file, which may be polygons with negative indices."""
    _, points, corners, sizes = _geometry(_text.read_lines(name, data, continued=True))
    return Mesh(points, Polygons(corners, sizes, points).triangles)


def read_asset(data: bytes, name: str) -> Asset:
    """Read an OBJ file with colours of vertices, texture coordinates and normals of corners, groups and materials."""
    lines = _text.read_lines(name, data, continued=True, named=_NAME_KEYWORDS)
    vertices, points, corners, sizes = _geometry(lines)
    attributes, notes = read_colours(vertices, data)
    face_lines = lines.starting_with("f")
    for i, (keyword, attribute, kind, width) in enumerate(_INDEXED):
        if len(table_lines := lines.starting_with(keyword)):
            values = _indexed(table_lines, keyword, width, face_lines, i + 1)
            attributes += [] if np.isnan(values).all() else [Attribute(attribute, "corner", kind, values)]
    statements = {keyword: lines.starting_with(keyword) for keyword in ("mtllib", *_STATEMENTS.values())}
    encoding = encoding_of(b"".join(statement.data.tobytes() for statement in statements.values()))
    for attribute, keyword in _STATEMENTS.items():
        if len(statements[keyword]):
            attributes.append(_labels(attribute, statements[keyword], face_lines, encoding))
    libraries = tuple(text.decode(encoding) for text in statements["mtllib"].texts)
    elements = tuple(
        f"{keyword} {text.decode()}"
        for keyword in "pl"
        for text in lines.starting_with(keyword).texts
        if text.replace(b" ", b"").isdigit()
    )
    document = ObjDocument(libraries, elements, encoding)
    document = replace(document, files=_read_libraries(document, Path(name).parent))
    polygons, frame = Polygons(corners, sizes), _text.frame_in_comments(data)
    return Asset(points, polygons, tuple(attributes), document=document, notes=notes, frame=frame)


def keeps(attribute: Attribute) -> bool:
    """Whether OBJ has a place for an attribute."""
    if attribute.domain == "face":
        return attribute.kind == "label" and attribute.name in _STATEMENTS
    return attribute.kind in ("uv", "normal") or (attribute.domain, attribute.kind) == ("point", "colour")


def write(asset: Asset) -> bytes:
    """Write an OBJ file; colours follow the positions as three numbers from 0 to 1."""
    document = asset.document if isinstance(asset.document, ObjDocument) else ObjDocument()
    if not len(asset.points):
        raise MeshError("there are no points, and an OBJ file without any cannot be read; write a .ply file")
    asset.require_points()
    encoding = document.encoding
    names = [name for a in asset.attributes if a.name in _STATEMENTS for name in a.coded.names.values()]
    try:
        "".join([*document.libraries, *names]).encode(encoding)
    except UnicodeEncodeError:  # the encoding of the file lacks letters of a name
        encoding = "utf-8"
    libraries = "".join(f"mtllib {library}\n" for library in document.libraries)
    head = _text.frame_comments(asset.frame) + libraries
    lines, indices = [head.encode(encoding, "backslashreplace"), _vertices(asset)], [asset.polygons.corners]
    for keyword, _, kind, width in _INDEXED:
        table, index = _table(asset, kind, width)
        lines.append(_text.format_rows(f"{keyword}{' %r' * width}\n", table))
        indices.append(index)
    lines.append(_faces(asset, indices, encoding))
    lines += [f"{element}\n".encode() for element in document.elements]
    return b"".join(lines)


def _vertices(asset: Asset) -> bytes:
    colours = asset.of_kind("colour")
    if not colours:
        return _text.format_rows("v %r %r %r\n", asset.points)
    colors = colours[0].fractions[:, :3]
    template = "v %r %r %r" + (" %r %r %r" if colours[0].values.dtype.kind == "f" else " %.6g %.6g %.6g")
    rows, is_coloured = np.hstack([asset.points, colors]), ~np.isnan(colors.sum(axis=1))
    lines = np.full(len(rows), b"", dtype=object)
    lines[~is_coloured] = _text.format_rows("v %r %r %r\n", rows[~is_coloured, :3]).splitlines(keepends=True)
    lines[is_coloured] = _text.format_rows(f"{template}\n", rows[is_coloured]).splitlines(keepends=True)
    return b"".join(lines)


def _table(asset: Asset, kind: Kind, width: int) -> tuple[AnyArray, IntArray]:
    """Return the different values of an attribute, and the index of each corner, −1 without a value."""
    corners, attributes = asset.polygons.corners, asset.of_kind(kind)
    if not attributes:
        return np.zeros((0, width)), np.full(len(corners), -1)
    values, of_points = attributes[0].values[:, :width].astype(np.float64), attributes[0].domain == "point"
    rows = np.flatnonzero(~np.isnan(values).any(axis=1))
    kept, place = (np.arange(len(rows)),) * 2 if of_points else weld_points(values[rows])
    index = np.full(len(values), -1)
    index[rows] = place
    return values[rows[kept]], index[corners] if of_points else index


def _faces(asset: Asset, indices: list[IntArray], encoding: str) -> bytes:
    sizes, (vertex, texture, normal) = asset.polygons.sizes, indices
    statements = [a for name in _STATEMENTS for a in asset.attributes if (a.name, a.domain) == (name, "face")]
    plain = (texture < 0).all() and (normal < 0).all()
    if plain and not statements and (sizes == 3).all():
        return _text.format_rows("f %d %d %d\n", vertex.reshape(-1, 3) + 1)
    words = np.zeros(len(vertex), dtype=object)
    for template, rows, used in (
        ("%d", (texture < 0) & (normal < 0), [vertex]),
        ("%d/%d", (texture >= 0) & (normal < 0), [vertex, texture]),
        ("%d//%d", (texture < 0) & (normal >= 0), [vertex, normal]),
        ("%d/%d/%d", (texture >= 0) & (normal >= 0), indices),
    ):
        table = np.stack([index[rows] + 1 for index in used], axis=1)
        words[rows] = _text.format_rows(f"{template} ", table).decode().split()
    keyword = np.ones(len(sizes), dtype=np.int64), np.full(len(sizes), "f", object)
    columns = [*map(_label_statements, statements), keyword, (sizes, words)]
    return _text.interleave_lines(columns, len(sizes), encoding)


def _indexed(table_lines: TextLines, keyword: str, width: int, words: TextLines, which: int) -> FloatArray:
    """Read the rows that a field of the corners refers to, (c, width), nan without a reference."""
    numbers = table_lines.parse()
    least = 1 if keyword == "vt" else width  # a texture coordinate may lack its last numbers, which are 0
    numbers.require(numbers.counts >= least, f"at least {least} numbers after {keyword}")
    table = np.full((len(table_lines) + 1, width), np.nan)
    table[:-1] = numbers.columns(0, width)
    table[:-1][np.arange(width) >= numbers.counts[:, None]] = 0.0
    rows = words.fields(which).parse()
    raw = rows.whole(None, f"whole indices of {keyword}")
    index = _from_zero(raw, rows, table_lines)
    inside = (index >= np.where(raw == 0, -1, 0)) & (index < len(table_lines))
    if not inside.all():
        row = int(np.searchsorted(np.cumsum(rows.counts), np.argmin(inside), side="right"))
        words.fail(row, f"indices of the {len(table_lines)} {keyword} lines")
    return table[index]


def _label_statements(attribute: Attribute) -> tuple[IntArray, AnyArray]:
    """Return the statements before faces with a new label, and their number, 0 or 1, for each face."""
    coded = attribute.coded
    codes, keyword = coded.values, _STATEMENTS[attribute.name]
    new = np.ones(len(codes), dtype=bool)
    new[1:] = codes[1:] != codes[:-1]
    texts = [f"{keyword} {coded.names.get(code, str(code))}\n" for code in codes[new].tolist()]
    if texts and texts[0] == f"{keyword} \n":  # the first faces have an empty name, which needs no statement
        texts, new[0] = texts[1:], False
    return new.astype(np.int64), np.array(texts, dtype=object)


def _labels(name: str, statements: TextLines, face_lines: TextLines, encoding: str) -> Attribute:
    """Label each face by the last statement before it."""
    words = ["", *(text.decode(encoding) for text in statements.texts)]
    codes = {word: code for code, word in enumerate(dict.fromkeys(words))}
    code_of = np.array([codes[word] for word in words])
    values = code_of[np.searchsorted(statements.numbers, face_lines.numbers)]
    return Attribute(name, "face", "label", values, names={code: word for word, code in codes.items()})


def _geometry(lines: TextLines) -> tuple[NumberRows, FloatArray, IntArray, IntArray]:
    """Read vertex lines, positions, concatenated corners of all faces, and sizes of the faces."""
    vertex_lines = lines.starting_with("v")
    if not len(vertex_lines):
        lines.fail(len(lines), "vertex lines v x y z")
    vertices = vertex_lines.parse()
    points = vertices.leading(3, "at least 3 numbers x y z of a vertex")
    rows = lines.starting_with("f").fields(0).parse()
    rows.require(rows.counts >= 3, "a face of at least 3 corners")
    corners = rows.whole(None, "whole vertex indices")
    return vertices, points, _from_zero(corners, rows, vertex_lines), rows.counts


def _from_zero(corners: IntArray, rows: NumberRows, vertex_lines: TextLines) -> IntArray:
    """Convert indices to count from 0; negative ones count back from the last vertex before the face."""
    backwards = corners < 0
    if not backwards.any():
        return corners - 1
    read_before = np.searchsorted(vertex_lines.numbers, rows.lines.numbers)
    return np.where(backwards, corners + np.repeat(read_before, rows.counts), corners - 1)


def read_colours(vertices: NumberRows, data: bytes) -> tuple[list[Attribute], tuple[str, ...]]:
    """Read colours after the positions, ``r g b`` or ``r g b a``, or in comments; return also notes."""
    counts, n, notes = vertices.counts, len(vertices.counts), []
    coloured = counts >= 6
    if n_weights := int((counts == 4).sum()):
        notes.append(f"{n_weights} vertices have a weight after the position, which is left out")
    if coloured.any():
        values = vertices.columns(3, 4 if (counts > 6).any() else 3)
        values[~coloured] = np.nan
        colours = _text.bytes_or_floats(values)
    else:
        blocks = _COLOUR_BLOCK.finditer(data.replace(b"\r", b"\n")) if b"#MRGB" in data else ()
        digits = b"".join(block[1] for block in blocks).decode()
        octets = np.frombuffer(bytes.fromhex(digits), np.uint8).reshape(-1, 4)  # mask, red, green, blue
        if not len(octets):
            return [], tuple(notes)
        if len(octets) > n:
            notes.append(f"{len(octets) - n} colours in comments are left out: there are only {n} vertices")
        if (octets[:, 0] != octets[0, 0]).any():
            notes.append("the mask in the comments with colours is left out")
        colours = octets[:n, 1:]
        if len(octets) < n:
            colours = np.vstack([colours, np.full((n - len(octets), 3), np.nan)])
    attribute = Attribute("color", "point", "colour", colours)
    return [attribute], tuple(filter(None, [*notes, attribute.note_of_missing]))


def _read_libraries(document: ObjDocument, folder: Path) -> dict[str, bytes]:
    """Read the libraries of a document and their pictures, by name."""
    libraries, pictures = dict[str, bytes](), dict[str, bytes]()
    for name in document.library_names:
        content = content_beside(name, folder)
        if content is not None and "newmtl" in dict(_statements(content)):  # only libraries are copied
            libraries[name] = content
    for library in libraries.values():
        for keyword, rest in _statements(library):
            for name in tiles_of(_options(rest)[1]) if keyword.startswith(_PICTURE_KEYWORDS) else ():
                if (content := content_beside(name, folder, picture_in)) is not None:
                    pictures[name] = content
    return libraries | pictures


def materials_of(document: ObjDocument) -> dict[str, Look]:
    """Return the look of each material by name."""
    statements_of: dict[str, dict[str, str]] = {}
    for library in document.library_names:
        of_material: dict[str, str] = {}
        for keyword, rest in _statements(document.files.get(library, b"")):
            if keyword == "newmtl":
                of_material = statements_of.setdefault(rest, {})
            else:
                of_material[keyword] = rest
    return {name: _look(name, statements, document.files) for name, statements in statements_of.items()}


def library_of(layers: Mapping[str, Layer], pictures: Mapping[Picture, str], encoding: str) -> bytes:
    """Write a library of named layers; pictures have new names or keep their own."""
    lines = []
    for name, layer in layers.items():
        lines += [f"newmtl {name}", "Kd " + " ".join(f"{x:.6g}" for x in layer.tint[:3])]
        if len(layer.tint) > 3 and layer.tint[3] < 1:
            lines.append(f"d {layer.tint[3]:.6g}")
        if layer.picture:
            lines.append(f"map_Kd {pictures.get(layer.picture, layer.picture.name)}")
    return _encode("".join(f"{line}\n" for line in lines), encoding)


def rename_pictures(library: bytes, names: Mapping[str, str]) -> bytes:
    """Replace the names of pictures in a library."""
    lines = []
    for line in _lines(library):
        keyword, _, rest = line.strip().replace("\t", " ").partition(" ")
        name = _options(rest.strip())[1]
        tiles = dict(zip(map(str, TILES), tiles_of(name)))
        known = [(tile, names[picture]) for tile, picture in tiles.items() if picture in names]
        if keyword.lower().startswith(_PICTURE_KEYWORDS) and known and name in line:
            (tile, new), is_tiled = known[0], len(tiles) > 1
            line = f"{line[: line.rindex(name)]}{'<UDIM>'.join(new.rsplit(tile, 1)) if is_tiled else new}"
        lines.append(line)
    return _encode("\n".join(lines), encoding_of(library))


def tiles_of(name: str) -> list[str]:
    """List the names of the pictures of all tiles if the name has <UDIM>, otherwise only the name."""
    parts = _UDIM.split(name)
    return [str(tile).join(parts) for tile in TILES] if len(parts) > 1 else [name]


def _encode(text: str, encoding: str) -> bytes:
    """Encode a text, in UTF-8 if the encoding lacks some of its letters."""
    with suppress(UnicodeEncodeError):
        return text.encode(encoding)
    return text.encode(errors="backslashreplace")


def _look(name: str, statements: Mapping[str, str], files: Mapping[str, bytes]) -> Look:
    kd = _numbers(statements.get("kd", ""), 3) or [1.0, 1.0, 1.0]
    if "map_kd" in statements and max(kd) == 0:  # some programs write black if a picture has the colours
        kd = [1.0, 1.0, 1.0]
    clear = _numbers(statements.get("tr", ""), 1)
    opacity = _numbers(statements.get("d", ""), 1) or [1 - x for x in clear] or [1.0]
    ke = _numbers(statements.get("ke", ""), 3) or [1.0 if "map_ke" in statements else 0.0] * 3
    emitted = _layer(statements.get("map_ke", ""), (*ke, 1.0), files) if max(ke) > 0 else None
    return Look(name, _layer(statements.get("map_kd", ""), (*kd, *opacity), files), emitted)


def _layer(text: str, tint: tuple[float, ...], files: Mapping[str, bytes]) -> Layer:
    if not text:
        return Layer(tint)
    options, name = _options(text)
    sx, sy = [*_numbers(" ".join(options.get("-s", [])), 1, 2), 1.0, 1.0][:2]
    x, y = [*_numbers(" ".join(options.get("-o", [])), 1, 2), 0.0, 0.0][:2]
    matrix = (sx, 0.0, x), (0.0, sy, 1 - sy - y)  # v points up in OBJ, and down here
    wrap: Wrap = "clamp" if options.get("-clamp") == ["on"] else "repeat"
    return Layer(tint, Picture.among(files, name), matrix=matrix, wrap=(wrap, wrap))


def _options(text: str) -> tuple[dict[str, list[str]], str]:
    """Split the rest of the line of a picture into its options and its name, which may have blanks."""
    words = text.split(" ")
    options: dict[str, list[str]] = {}
    while len(words) > 1 and (words[0] in _NUMBER_OPTIONS or words[0] in _WORD_OPTIONS or not words[0]):
        option = words.pop(0)
        taken = options[option] = list[str]()
        while len(words) > 1 and len(taken) < _NUMBER_OPTIONS.get(option, 1 if option else 0):
            if option not in _WORD_OPTIONS and not _numbers(words[0], 1):
                break
            taken.append(words.pop(0))
    return options, " ".join(words)


def _numbers(text: str, least: int, most: int = 3) -> list[float]:
    """Return the numbers of a text; a single one is repeated; fewer than ``least`` give none."""
    try:
        numbers = [float(word) for word in text.split()[:most]]
    except ValueError:
        return []
    numbers *= least if len(numbers) == 1 else 1
    return numbers if len(numbers) >= least else []


def _statements(library: bytes) -> Iterator[tuple[str, str]]:
    for line in _lines(library):
        keyword, _, rest = line.strip().replace("\t", " ").partition(" ")
        if keyword and not keyword.startswith("#"):
            yield keyword.lower(), rest.strip()


def _lines(library: bytes) -> list[str]:
    return decode_text(library).replace("\r\n", "\n").replace("\r", "\n").split("\n")
