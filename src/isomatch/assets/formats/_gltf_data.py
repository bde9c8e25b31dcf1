"""The JSON and the bytes of a glTF file: its container, and the arrays that accessors describe."""

from __future__ import annotations

import base64
import json
import math
from dataclasses import dataclass
from functools import cache, partial
from mimetypes import guess_type
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from isomatch.assets.formats._reading import Room
from isomatch.assets.materials import picture_in
from isomatch.errors import FormatError, MeshError
from isomatch.storage.files import opened
from isomatch.values.arrays import AnyArray, FloatArray

_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_CODES = {np.dtype(kind): code for code, kind in _COMPONENTS.items()}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TYPES = {width: name for name, width in _WIDTHS.items()}
_COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression"}
_LARGEST_GLB = 2**32 - 64  # bytes of JSON and data; their sizes have 32 bits
_ENTRY = 24  # bytes that an entry of an array takes while parts are joined, measured
_OBJECT, _LIST, _ITEM = 200, 88, 32  # bytes that these take in Python when JSON is read


_FREE: dict[str, Any] = {  # what may be replaced
    "accessors": {"componentType": 5121, "count": 1, "type": "SCALAR"},
    "bufferViews": {"buffer": 0, "byteLength": 1},
}
_REFERENCES = {
    "accessors": ("indices", "input", "output", "inverseBindMatrices"),
    "views": ("bufferView",),
}
_HOLDERS: dict[str, tuple[str, ...]] = {"accessors": ("attributes", "targets"), "views": ()}


@dataclass
class GltfData:
    """The JSON of a file and its bytes, in one buffer, while it is read or written."""

    json: dict[str, Any]
    blob: bytearray
    room: Room = None  # type: ignore[assignment]
    """Memory that arrays and pictures may take, as a small file may refer to the same bytes again and again."""

    def __post_init__(self) -> None:
        self.room = self.room or Room(len(self.blob))

    def array(self, index: int) -> AnyArray:
        """Return the values of an accessor, (count,) or (count, d), as they are stored; integers stay integers."""
        accessor = self.json["accessors"][index]
        count, width = accessor["count"], _WIDTHS[accessor["type"]]
        kind = np.dtype(_COMPONENTS[accessor["componentType"]])
        values = self._rows(accessor, count, width, kind)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            index_kind = np.dtype(_COMPONENTS[sparse["indices"]["componentType"]])
            values = values.copy()
            values[self._rows(sparse["indices"], sparse["count"], 1, index_kind)[:, 0]] = self._rows(
                sparse["values"], sparse["count"], width, kind
            )
        return values[:, 0] if width == 1 else values

    def numbers(self, index: int) -> AnyArray:
        """Return the values of an accessor in the units that they stand for: normalized integers as fractions."""
        values = self.array(index)
        if values.dtype.kind == "f" or not self.json["accessors"][index].get("normalized"):
            return values
        return np.maximum(values / np.iinfo(values.dtype).max, -1).astype(np.float32)

    def _rows(self, place: dict[str, Any], count: int, width: int, kind: np.dtype[Any]) -> AnyArray:
        if "bufferView" not in place:
            self.room.take(_ENTRY * count * width, f"an accessor of {count * width} entries")
            return np.zeros((count, width), kind)
        view = self.json["bufferViews"][place["bufferView"]]
        start = view.get("byteOffset", 0) + place.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        end = start + stride * (count - 1) + kind.itemsize * width
        if count < 0 or start < 0 or stride < 1 or (count and end > len(self.blob)):
            raise FormatError(f"an accessor refers to byte {end} of {len(self.blob)}")
        if not count:
            return np.zeros((0, width), kind)
        self.room.take(_ENTRY * count * width, f"an accessor of {count * width} entries")
        rows = np.ndarray((count, width), kind, bytes(self.blob[start:end]), 0, (stride, kind.itemsize))
        return np.array(rows)

    def bytes_of(self, view: int) -> bytes:
        """Return the bytes of a buffer view."""
        place = self.json["bufferViews"][view]
        start = place.get("byteOffset", 0)
        content = bytes(self.blob[start : start + place["byteLength"]])
        self.room.take(len(content), "a picture")
        return content

    def add_array(self, values: AnyArray, **properties: object) -> int:
        """Append the values of a new accessor, whose rows start at multiples of 4 bytes; return its index."""
        kind = values.dtype.newbyteorder("<")
        rows = np.ascontiguousarray(values.reshape(len(values), math.prod(values.shape[1:])), kind)
        width = rows.shape[1] if rows.ndim == 2 else 1
        octets = rows.view(np.uint8).reshape(len(rows), width * kind.itemsize)
        view: dict[str, object] = {}
        if octets.shape[1] % 4 and "target" not in properties:  # indices are packed
            octets = np.pad(octets, ((0, 0), (0, -octets.shape[1] % 4)))
            view["byteStride"] = octets.shape[1]
        target = properties.pop("target", 34962)
        accessor = {
            "bufferView": self.add_bytes(octets.tobytes(), target=target, **view),
            "componentType": _CODES[kind],
            "count": len(values),
            "type": _TYPES[width],
            **properties,
        }
        return self.append("accessors", accessor)

    def add_matrices(self, matrices: FloatArray) -> int:
        """Append a new accessor of (k, 4, 4) matrices; return its index."""
        columns = np.ascontiguousarray(matrices.transpose(0, 2, 1), "<f4")
        accessor = {
            "bufferView": self.add_bytes(columns.tobytes()),
            "componentType": 5126,
            "count": len(columns),
            "type": "MAT4",
        }
        return self.append("accessors", accessor)

    def add_bytes(self, data: bytes, **properties: object) -> int:
        """Append bytes, at a multiple of 4; return the index of their buffer view."""
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **properties}
        self.blob += data
        return self.append("bufferViews", view)

    def append(self, name: str, entry: object) -> int:
        """Append an entry to a list of the JSON, or put it where one is free; return its index."""
        listed = self.json.setdefault(name, [])
        free = _FREE.get(name)
        if free in listed:
            index: int = listed.index(free)
            listed[index] = entry
            return index
        listed.append(entry)
        return len(listed) - 1

    def without_unused(self) -> None:
        """Free the accessors and views that nothing refers to, and their bytes; what is left keeps its number."""
        document = self.json
        rest = {key: value for key, value in document.items() if key != "accessors"}
        accessors, views = _numbers_in(rest, "accessors"), _numbers_in(rest, "views")
        listed = document.get("accessors", [])
        listed[:] = [each if i in accessors else _FREE["accessors"] for i, each in enumerate(listed)]
        views |= _numbers_in(listed, "views")
        blob = bytearray()
        for i, view in enumerate(document.get("bufferViews", [])):
            if i not in views:
                document["bufferViews"][i] = _FREE["bufferViews"]
                continue
            content = self.blob[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
            self.room.take(len(content), "a buffer view")
            blob += b"\0" * (-len(blob) % 4)
            view["byteOffset"] = len(blob)
            blob += content
        self.blob = blob


def unpacked(data: bytes, name: str) -> GltfData:
    """Read a ``.glb`` or ``.gltf`` file and the files that it names, as one JSON with one buffer."""
    text, binary = _chunks(data, name) if data[:4] == _MAGIC else (data, b"")
    room = Room(len(data))
    counts = ((_OBJECT, b"{"), (_LIST, b"["), (_ITEM, b","))
    room.take(sum(size * text.count(mark) for size, mark in counts), "its JSON")
    found = json.loads(text)
    compressed = _COMPRESSED.intersection(found.get("extensionsRequired", ()))
    if compressed:
        raise FormatError(f"{name}: is compressed by {min(compressed)}; export it without compression")
    folder = Path(name).parent
    beside = cache(partial(_beside, folder=folder))
    buffers = found.pop("buffers", [])
    longest: dict[Path, int] = {}  # of the buffers in the same file, which is read once
    for buffer in buffers:
        path = beside(buffer.get("uri", "data:"))
        if path is not None:
            longest[path] = max(longest.get(path, 0), buffer["byteLength"])
    blob, starts, start_of = bytearray(), [], dict[Path, int]()
    for i, buffer in enumerate(buffers):
        n, uri = buffer["byteLength"], buffer.get("uri")
        path = beside(uri or "data:")
        if path in start_of:
            starts.append(start_of[path])
            continue
        if path is not None:
            content = _start_of(path, longest[path])
            n = longest[path]
            room.size += len(content)
        elif uri is None:
            content = binary if i == 0 else b""  # only the first may be inside the file
        elif uri.startswith("data:"):
            content = base64.b64decode(uri.partition(",")[2])
        else:
            raise FormatError(
                f"{name}: its data is in {uri!r}, outside of its folder, and is not read; "
                "copy that file beside this one, or export as .glb"
            )
        if not 0 <= n <= len(content):
            raise FormatError(
                f"{name}: byte {len(data)}: expected a buffer of {n} bytes, found {len(content)}; "
                "it is cut short, copy or export it again"
            )
        blob += b"\0" * (-len(blob) % 4)
        starts.append(len(blob))
        blob += content[:n]
        if path is not None:
            start_of[path] = starts[-1]
    _without_compression(found)
    for view in found.get("bufferViews", []):
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
        view["buffer"] = 0
    gltf = GltfData(found, blob, room)
    views: dict[Path, int | None] = {}
    for image in found.get("images", []):
        path = beside(image.get("uri", "data:"))
        if path is None or not path.is_file():
            continue
        if path not in views:
            picture = picture_in(path)
            views[path] = None if picture is None else gltf.add_bytes(picture)
        if views[path] is not None:
            image.setdefault("name", path.stem)
            image.setdefault("mimeType", guess_type(path, strict=False)[0] or "image/png")
            del image["uri"]
            image["bufferView"] = views[path]
    return gltf


def _numbers_in(entry: Any, kind: str, all_of_them: bool = False) -> set[int]:
    """Numbers of accessors or views that are referred to; in extensions, of which nothing is known, any number."""
    found: set[int] = set()
    if isinstance(entry, dict):
        for key, value in entry.items():
            everything = all_of_them or key in ("extensions", *_HOLDERS[kind])
            if isinstance(value, int) and (everything or key in _REFERENCES[kind]):
                found.add(value)
            elif isinstance(value, dict | list):
                found |= _numbers_in(value, kind, everything)
    for value in entry if isinstance(entry, list) else ():
        found |= {value} if all_of_them and isinstance(value, int) else _numbers_in(value, kind, all_of_them)
    return found


def _without_compression(document: dict[str, Any]) -> None:
    """Leave out the compressed twins of arrays that are there without compression too, and are read and written."""
    primitives = [primitive for mesh in document.get("meshes", []) for primitive in mesh["primitives"]]
    for entry in [*primitives, *document.get("bufferViews", []), *document.get("buffers", [])]:
        for name in _COMPRESSED:
            entry.get("extensions", {}).pop(name, None)
    used = document.get("extensionsUsed", [])
    used[:] = [name for name in used if name not in _COMPRESSED]


def packed(gltf: GltfData, binary: bool) -> bytes:
    """Write a ``.glb`` file, or a ``.gltf`` file that contains its buffer."""
    blob = bytes(gltf.blob)
    for name, free in _FREE.items():
        listed = gltf.json.get(name, [])
        while listed and listed[-1] == free:
            listed.pop()
        if not listed:
            gltf.json.pop(name, None)
    buffer: dict[str, object] = {"byteLength": len(blob)}
    if not binary:
        buffer["uri"] = f"data:application/octet-stream;base64,{base64.b64encode(blob).decode()}"
    document = {**gltf.json, **({"buffers": [buffer]} if blob else {})}
    text = json.dumps(
        document, separators=(",", ":") if binary else None, indent=None if binary else 1
    ).encode()
    if not binary:
        return text
    size = len(text) + len(blob)
    if size > _LARGEST_GLB:
        raise MeshError(f"a .glb file holds 4 GiB, and this one would have {size} bytes; write .ply or .gltf")
    chunks = _chunk(_JSON, text, b" ") + (_chunk(_BINARY, blob, b"\0") if blob else b"")
    return _MAGIC + np.array([2, 12 + len(chunks)], "<u4").tobytes() + chunks


def _chunk(kind: bytes, content: bytes, padding: bytes) -> bytes:
    content += padding * (-len(content) % 4)
    return len(content).to_bytes(4, "little") + kind + content


def _chunks(data: bytes, name: str) -> tuple[bytes, bytes]:
    """Return the JSON and the binary chunk of a ``.glb`` file."""
    if data[4:8] != (2).to_bytes(4, "little"):
        raise FormatError(
            f"{name}: byte 4: expected version 2 of glTF, found {int.from_bytes(data[4:8], 'little')}; "
            "export it as glTF 2.0"
        )
    found: dict[bytes, bytes] = {}
    position = 12
    while position + 8 <= len(data):
        size, kind = (
            int.from_bytes(data[position : position + 4], "little"),
            data[position + 4 : position + 8],
        )
        content = data[position + 8 : position + 8 + size]
        if len(content) < size:
            raise FormatError(
                f"{name}: byte {len(data)}: expected {size} bytes of a chunk, found {len(content)}; "
                "it is cut short, copy or export it again"
            )
        found.setdefault(kind, content)
        position += 8 + size
    if _JSON not in found:
        raise FormatError(f"{name}: byte 12: expected a chunk of JSON, found none; export the file again")
    return found[_JSON], found.get(_BINARY, b"")


def _beside(uri: str, folder: Path) -> Path | None:
    """Return the file that a URI names; None unless it lies in the folder or below: no other file may be copied."""
    path = (folder / unquote(uri)).resolve()
    return path if not uri.startswith("data:") and path.is_relative_to(folder.resolve()) else None


def _start_of(path: Path, n: int) -> bytes:
    with opened(path) as file:
        return file.read(min(n, path.stat().st_size)) if n > 0 else b""
