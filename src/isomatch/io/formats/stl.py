"""STL: a list of triangles with three positions each, as text or binary."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray
from isomatch.io.asset import Asset, Frame
from isomatch.io.attribute import Attribute
from isomatch.io.formats._reading import unexpected
from isomatch.io.formats._text import TextLines, format_rows, read_lines
from isomatch.io.polygons import Polygons
from isomatch.surfaces import Mesh, weld_points

TITLE_BYTES, _HEADER_BYTES = 80, 84  # bytes of the title, and of title plus number of triangles
# numbers that programs write as the number of triangles if they do not know it when they begin to write
_UNKNOWN_COUNTS = (0, 2**32 - 1)
# numpy type of a triangle in a binary file
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_asset(data: bytes, name: str) -> Asset:
    """Read an STL file with colours of triangles; corners at the same position become one vertex."""
    is_text = data.removeprefix(b"\xef\xbb\xbf").lstrip()[:5].lower() in (b"solid", b"facet")
    # a binary file might start with "solid", too, but has zero bytes
    if is_text and b"\0" not in data[: _HEADER_BYTES + _TRIANGLE.itemsize]:
        (corners, notes), attributes = _read_text(read_lines(name, data.lower())), list[Attribute]()
    else:
        triangles, notes = _triangles(data, name)
        with np.errstate(invalid="ignore"):  # a signalling nan, as files may have, would warn
            corners = triangles["corners"].astype(np.float64)
        attributes, left = _colours(data[:80], triangles["attribute"])
        notes += left
    points = corners.reshape(-1, 3)
    kept, vertex = weld_points(points)
    polygons = Polygons.of_triangles(vertex.reshape(-1, 3))
    head = data[:TITLE_BYTES]
    title = head.partition(b"\n")[0].partition(b" ")[2] if is_text else head.partition(b"\0")[0]
    frame = Frame.of_lines(title.decode(errors="replace"))
    return Asset(points[kept], polygons, tuple(attributes), notes=tuple(notes), frame=frame)


def write(asset: Asset, binary: bool | None = None) -> bytes:
    """Write an STL file: binary in single precision, or text with all digits, by default if needed."""
    mesh = Mesh(asset.points, asset.polygons.triangles)
    corners = mesh.vertices[mesh.sound_faces]  # (m, 3, 3)
    lengths = np.linalg.norm(mesh.face_cross, axis=1, keepdims=True)
    normals = np.divide(mesh.face_cross, lengths, out=np.zeros_like(mesh.face_cross), where=lengths > 0)
    title = asset.frame.title(TITLE_BYTES) if asset.frame else ""
    if asset.needs_doubles if binary is None else not binary:
        template = "facet normal %r %r %r\nouter loop\n" + "vertex %r %r %r\n" * 3 + "endloop\nendfacet\n"
        table = np.hstack([normals, corners.reshape(-1, 9)])
        return f"solid {title}".strip().encode() + b"\n" + format_rows(template, table) + b"endsolid\n"
    triangles = np.zeros(mesh.n_faces, _TRIANGLE)
    triangles["normal"], triangles["corners"] = normals, corners
    header = (title or "binary STL").encode().ljust(TITLE_BYTES) + mesh.n_faces.to_bytes(4, "little")
    return header + triangles.tobytes()


def _triangles(data: bytes, name: str) -> tuple[AnyArray, list[str]]:
    """Read the triangles of a binary file; some programs write a count of 0 or −1, or bytes after the triangles."""
    if len(data) < _HEADER_BYTES:
        expected = f"'solid' or {_HEADER_BYTES} bytes of header"
        raise unexpected(f"{name}: byte {len(data)}", expected, "the end", "copy it again")
    declared = int.from_bytes(data[80:84], "little")
    present, rest = divmod(len(data) - _HEADER_BYTES, _TRIANGLE.itemsize)
    size = _HEADER_BYTES + _TRIANGLE.itemsize * declared
    n, notes = declared, []
    if declared in _UNKNOWN_COUNTS and present and not rest:
        n = present
        notes = [f"the header says {'−1' if declared else 0} triangles; the {present} that follow are read"]
    elif declared > 0 and size < len(data):
        notes = [f"{len(data) - size} bytes after the triangles are left out"]
    elif len(data) != size:
        place = f"{name}: byte {min(len(data), size)}"
        expected = f"{size} bytes for the {declared} triangles declared at byte 80"
        raise unexpected(place, expected, str(len(data)), "the file is damaged, copy or export it again")
    return np.frombuffer(data, _TRIANGLE, n, _HEADER_BYTES), notes


def _colours(header: bytes, words: AnyArray) -> tuple[list[Attribute], list[str]]:
    """Read colours of 15 bits of the triangles, as Materialise Magics writes them, or VisCAM and SolidView."""
    fifths = np.stack([words & 31, words >> 5 & 31, words >> 10 & 31], axis=1)
    octets = np.rint(fifths * (255 / 31))
    marked = words >= 2**15
    mark = header.find(b"COLOR=")
    if mark >= 0 and len(header) >= mark + 10:
        # a marked triangle has the header's colour, but MeshLab marks all triangles, whatever their colours
        if not marked.all() or (words == words[:1]).all():
            octets[marked] = list(header[mark + 6 : mark + 9])
        return [Attribute("color", "face", "colour", octets.astype(np.uint8))], []
    if not marked.any():
        return [], ["the two bytes after each triangle are left out"] if words.any() else []
    octets = octets[:, ::-1]
    octets[~marked] = np.nan
    color = Attribute("color", "face", "colour", octets.astype(np.uint8) if marked.all() else octets)
    return [color], [color.note_of_missing] if not marked.all() else []


def _read_text(lines: TextLines) -> tuple[FloatArray, list[str]]:
    """Read the corners of each triangle, (m, 3, 3)."""
    ends = np.append(lines.starting_with("endsolid").numbers, lines.starting_with("end").numbers)
    notes = [] if len(ends) else ["there is no endsolid; the file may be cut short"]
    if after := int((lines.numbers > ends.max()).sum()) if len(ends) else 0:
        notes.append(f"{after} lines after the last endsolid are left out")
    corners = lines.starting_with("vertex")
    loop_ends = lines.starting_with("endloop").numbers
    # After triangle t, counted from 0, 3 (t + 1) corners must have been read.
    read = np.searchsorted(corners.numbers, loop_ends)
    wrong = np.flatnonzero(read != 3 * np.arange(1, len(loop_ends) + 1))
    if len(wrong):
        row = int(np.searchsorted(lines.numbers, loop_ends[wrong[0]]))
        lines.fail(row, "3 vertex lines before each endloop")
    if len(corners) != 3 * len(loop_ends):
        lines.fail(len(lines) - 1, "an endloop after every 3 vertex lines")
    return corners.parse().leading(3, "3 numbers x y z after vertex").reshape(-1, 3, 3), notes
