"""The parts of a glTF file: container, arrays of accessors, nodes, joints and shape keys."""

from __future__ import annotations

import base64
import copy
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from mimetypes import guess_type
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import FormatError, MeshError
from isomatch._core.files import open_file
from isomatch.io.asset import product
from isomatch.io.attribute import unused_names
from isomatch.io.formats._reading import Room, unexpected
from isomatch.io.materials import picture_in
from isomatch.io.polygons import triangles_of_strips

_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"  # bytes that mark a GLB file and its two chunks
# numpy types of the components of an array, by their code in glTF
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_CODES = {np.dtype(kind): code for code, kind in _COMPONENTS.items()}  # codes of glTF by numpy type
# how many numbers an entry of an array has, by its type in glTF
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TYPES = {width: name for name, width in _WIDTHS.items()}  # types of glTF by the numbers in an entry
VERTICES, INDICES = 34962, 34963  # codes of glTF for data of vertices and data of indices
# extensions of glTF that compress data, which cannot be read
_COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression"}
# largest number of bytes of JSON and data in a GLB file: its size has 32 bits, 64 bytes are for headers
_MAX_GLB_BYTES = 2**32 - 64
_ENTRY_BYTES = 24  # bytes of memory for each number of an array, at the peak, when parts are joined; measured
# bytes of memory in Python of an object, a list and a further item of JSON, by its first character; measured
_JSON_BYTES = {b"{": 200, b"[": 88, b",": 32}
_COPY_BYTES = 16  # bytes of memory for each character of JSON that is copied; measured
# what replaces an unused entry of a list, so that other entries keep their numbers
_FREE_ENTRIES: dict[str, Any] = {
    "accessors": {"componentType": 5121, "count": 1, "type": "SCALAR"},
    "bufferViews": {"buffer": 0, "byteLength": 1},
}
_REFERENCES = {  # for two lists of the JSON: keys under which all integers are indices of entries of the list
    "accessors": ("indices", "input", "output", "inverseBindMatrices", "attributes", "targets", "extensions"),
    "bufferViews": ("bufferView", "extensions"),
}
_CUT_SHORT = "it is cut short, copy or export it again"  # the end of messages
Matrix = tuple[tuple[float, ...], ...]  # rows of a matrix (4, 4)
_TRIANGLES, _STRIP, _FAN = 4, 5, 6  # codes of glTF for kinds of primitives: triangles, strips, fans
_POSE_TOLERANCE = 1e-3  # largest difference between entries of alike matrices, over the largest entry; chosen


@dataclass
class GltfData:
    """The JSON of a file and its bytes in one buffer, while it is read or written."""

    json: dict[str, Any]
    blob: bytearray
    # It bounds the memory for arrays and pictures: a small file may refer to the same bytes many times.
    room: Room = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        self.room = self.room or Room(len(self.blob))

    def array(self, index: int) -> AnyArray:
        """Return the stored values of an accessor, (count,) or (count, d); integers stay integers."""
        accessor = self.json["accessors"][index]
        width, code = _WIDTHS[accessor["type"]], accessor["componentType"]
        values = self._rows(accessor, accessor["count"], width, code)
        if sparse := accessor.get("sparse"):
            n, index_place = sparse["count"], sparse["indices"]
            rows = self._rows(index_place, n, 1, index_place["componentType"])[:, 0]
            values[rows] = self._rows(sparse["values"], n, width, code)
        return values[:, 0] if width == 1 else values

    def numbers(self, index: int, *, normalized: bool = False) -> AnyArray:
        """Return the values of an accessor, with normalized integers as fractions."""
        values = self.array(index)
        if values.dtype.kind == "f" or not (normalized or self.json["accessors"][index].get("normalized")):
            return values
        return np.maximum(values / np.iinfo(values.dtype).max, -1).astype(np.float32)

    def _rows(self, place: dict[str, Any], count: int, width: int, code: int) -> AnyArray:
        kind = np.dtype(_COMPONENTS[code])
        self.room.take(_ENTRY_BYTES * count * width, f"an accessor of {count * width} entries")
        if "bufferView" not in place or not count:
            return np.zeros((count, width), kind)
        view = self.json["bufferViews"][place["bufferView"]]
        start = view.get("byteOffset", 0) + place.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        end = start + stride * (count - 1) + kind.itemsize * width
        if start < 0 or stride < 1 or end > len(self.blob):
            raise FormatError(f"an accessor refers to byte {end} of {len(self.blob)}")
        rows = np.ndarray((count, width), kind, bytes(self.blob[start:end]), 0, (stride, kind.itemsize))
        return np.array(rows)

    def bytes_of(self, view: int) -> bytes:
        """Return the bytes of a buffer view."""
        place = self.json["bufferViews"][view]
        start = place.get("byteOffset", 0)
        content = bytes(self.blob[start : start + place["byteLength"]])
        self.room.take(len(content), "a picture")
        return content

    def add_array(self, values: AnyArray, target: int | None = VERTICES, **properties: object) -> int:
        """Append a new accessor, with rows at multiples of 4 bytes; return its index."""
        kind, width = values.dtype.newbyteorder("<"), math.prod(values.shape[1:])
        rows = np.ascontiguousarray(values.reshape(len(values), width), kind)
        octets = rows.view(np.uint8).reshape(len(rows), width * kind.itemsize)
        view: dict[str, object] = {} if target is None else {"target": target}
        # glTF requires that rows of vertex data begin at multiples of 4 bytes; other rows have no gaps
        if octets.shape[1] % 4 and target == VERTICES:
            octets = np.pad(octets, ((0, 0), (0, -octets.shape[1] % 4)))
            view["byteStride"] = octets.shape[1]
        accessor = {"bufferView": self.add_bytes(octets.tobytes(), **view), "componentType": _CODES[kind]}
        return self.append("accessors", accessor | {"count": len(values), "type": _TYPES[width]} | properties)

    def add_matrices(self, matrices: FloatArray) -> int:
        """Append an accessor of (k, 4, 4) matrices; return its index."""
        return self.add_array(matrices.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32), target=None)

    def add_bytes(self, data: bytes, **properties: object) -> int:
        """Append bytes, at a multiple of 4; return the index of their buffer view."""
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **properties}
        self.blob += data
        return self.append("bufferViews", view)

    def append(self, name: str, entry: object) -> int:
        """Append an entry to a list of the JSON, or replace a free one; return its index."""
        listed = self.json.setdefault(name, [])
        free = _FREE_ENTRIES.get(name)
        index: int = listed.index(free) if free in listed else len(listed)
        listed[index : index + 1] = [entry]
        return index

    def without_unused(self) -> None:
        """Free unused accessors and views, and their bytes; the others keep their indices."""
        rest = {key: value for key, value in self.json.items() if key != "accessors"}
        accessors = _numbers_in(rest, _REFERENCES["accessors"])
        listed = self.json.get("accessors", [])
        free = _FREE_ENTRIES["accessors"]
        listed[:] = [accessor if i in accessors else free for i, accessor in enumerate(listed)]
        views = _numbers_in([rest, listed], _REFERENCES["bufferViews"])
        blob = bytearray()
        for i, view in enumerate(self.json.get("bufferViews", [])):
            if i not in views:
                self.json["bufferViews"][i] = _FREE_ENTRIES["bufferViews"]
                continue
            content = self.blob[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
            self.room.take(len(content), "a buffer view")
            blob += b"\0" * (-len(blob) % 4)
            view["byteOffset"] = len(blob)
            blob += content
        self.blob = blob

    def separate_instances(self) -> None:
        """Give each node a mesh of its own, which shares arrays with meshes of other nodes."""
        used, sizes = set[int](), dict[int, int]()
        for node in self.json.get("nodes", []):
            if (mesh := node.get("mesh")) in used:
                if mesh not in sizes:
                    sizes[mesh] = _COPY_BYTES * len(str(self.json["meshes"][mesh]))
                self.room.take(sizes[mesh], f"a node that repeats mesh {mesh}")
                node["mesh"] = self.append("meshes", copy.deepcopy(self.json["meshes"][mesh]))
            elif mesh is not None:
                used.add(mesh)

    def surfaces(self) -> Iterator[tuple[int, int, dict[str, int]]]:
        """Find primitives of triangles, with mesh and keys, in the default scene if it has any mesh."""
        nodes, scenes = self.json.get("nodes", []), self.json.get("scenes", [])
        shown = with_below(nodes, scenes[self.json.get("scene", 0)].get("nodes", []) if scenes else [])
        of_scene = {nodes[i]["mesh"] for i in shown if "mesh" in nodes[i]}
        for mesh, contents in enumerate(self.json.get("meshes", [])):
            for i, primitive in enumerate(contents["primitives"]):
                is_of_triangles = primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN)
                is_shown = not of_scene or mesh in of_scene
                if is_shown and is_of_triangles and "POSITION" in (keys := primitive["attributes"]):
                    yield mesh, i, keys

    def triangles(self, primitive: dict[str, Any], n_points: int) -> IntArray:
        """Return the triangles of a primitive, (m, 3)."""
        index = np.arange(n_points)
        if "indices" in primitive:
            index = self.array(primitive["indices"]).astype(np.int64)
            if index.max(initial=0) >= max(n_points, 1):
                raise ValueError(f"a triangle refers to point {index.max()} of {n_points}")
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _TRIANGLES:
            return index[: len(index) // 3 * 3].reshape(-1, 3)
        if mode == _FAN:
            return np.column_stack([np.repeat(index[:1], max(len(index) - 2, 0)), index[1:-1], index[2:]])
        return triangles_of_strips(index, np.array([len(index)]))[0]

    def transforms(self) -> dict[int, tuple[Matrix | None, int | None]]:
        """Find the matrix and skin of the first node of each mesh."""
        nodes, matrices = self.json.get("nodes", []), node_matrices(self.json)
        placed: dict[int, tuple[Matrix | None, int | None]] = {}
        for i, matrix in matrices.items():
            if "mesh" in nodes[i] and nodes[i]["mesh"] not in placed:
                skin, placement = nodes[i].get("skin"), matrix
                if skin is not None:
                    # The joints place the points, not the node. If joints do not move alike, the shape is
                    # posed, and its points stay where the file has them.
                    bound, placement = self.binding(self.json["skins"][skin], matrices), np.eye(4)
                    if len(bound) and are_alike(bound, bound[0]) and not are_alike(bound, placement):
                        placement = bound[0]
                is_placed = not np.array_equal(placement, np.eye(4))
                rows = tuple(map(tuple, placement.tolist())) if is_placed else None
                placed[nodes[i]["mesh"]] = rows, skin
        return placed

    def binding(self, skin: dict[str, Any], matrices: Mapping[int, FloatArray]) -> FloatArray:
        """Find the matrices (k, 4, 4) by which joints of a skin place bound points; none if undefined."""
        if "inverseBindMatrices" not in skin:
            return np.zeros((0, 4, 4))
        inverse = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        placed: FloatArray = np.array([matrices[joint] for joint in skin["joints"]]).reshape(-1, 4, 4)
        return placed @ inverse[: len(placed)]

    def without_empty_primitives(self) -> None:
        """Remove primitives without points, and meshes without primitives."""
        document, number = self.json, dict[int, int]()
        meshes = document.pop("meshes", [])
        for mesh, contents in enumerate(meshes):
            contents["primitives"] = [part for part in contents["primitives"] if part["attributes"]]
            if contents["primitives"]:
                number[mesh] = len(number)
        if number:
            document["meshes"] = [meshes[mesh] for mesh in number]
        for node in document.get("nodes", []):
            if node.get("mesh") in number:
                node["mesh"] = number[node.pop("mesh")]
            elif "mesh" in node:
                for key in ("mesh", "skin", "weights"):
                    node.pop(key, None)


def _numbers_in(entry: Any, keys: tuple[str, ...], inside: bool = False) -> set[int]:
    """Collect the integers anywhere under some keys."""
    if isinstance(entry, int):
        return {entry} if inside else set()
    numbers: set[int] = set()
    if isinstance(entry, dict):
        for key, value in entry.items():
            numbers |= _numbers_in(value, keys, inside or key in keys)
    for value in entry if isinstance(entry, list) else ():
        numbers |= _numbers_in(value, keys, inside)
    return numbers


def unpack(data: bytes, name: str) -> GltfData:
    """Read a ``.glb`` or ``.gltf`` file and the files it names, as one JSON with one buffer."""
    text, binary = _chunks(data, name) if data[:4] == _MAGIC else (data, b"")
    room = Room(len(data))
    room.take(sum(size * text.count(mark) for mark, size in _JSON_BYTES.items()), "its JSON")
    gltf, folder = GltfData(json.loads(text), bytearray(), room), Path(name).parent
    extensions = [*gltf.json.get("extensionsUsed", []), *gltf.json.get("extensionsRequired", [])]
    if compressed := _COMPRESSED.intersection(extensions):
        raise FormatError(f"{name}: is compressed by {min(compressed)}; export it without compression")
    starts: list[int] = []
    files: set[Path] = set()
    beside = cache(partial(_path_beside, folder.resolve()))  # a cache, as one file may be named many times
    for i, buffer in enumerate(gltf.json.pop("buffers", [])):
        n, uri = buffer["byteLength"], buffer.get("uri")
        path = beside(uri)
        if path is not None:
            with open_file(path) as file:
                room.size += 0 if path in files else min(n, path.stat().st_size)
                files.add(path)
                room.take(2 * n, "a buffer")  # bytes are held twice: as read, and in the common buffer
                content = file.read(n)
        elif uri is None:
            content = binary if i == 0 else b""  # only the first buffer can be the binary chunk of the file
        elif uri.startswith("data:"):
            content = base64.b64decode(uri.partition(",")[2])
        else:
            problem = f"{name}: its data is in {uri!r}, outside of its folder, and is not read"
            raise FormatError(f"{problem}; copy that file beside this one, or export as .glb")
        if not 0 <= n <= len(content):
            raise unexpected(name, f"a buffer of {n} bytes", str(len(content)), _CUT_SHORT)
        gltf.blob += b"\0" * (-len(gltf.blob) % 4)
        starts.append(len(gltf.blob))
        gltf.blob += content[:n]
    for view in gltf.json.get("bufferViews", []):
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
        view["buffer"] = 0
    views: dict[Path, int | None] = {}
    for image in gltf.json.get("images", []):
        path = beside(image.get("uri"))
        if path is not None and path not in views:
            picture = picture_in(path) if path.is_file() else None
            views[path] = None if picture is None else gltf.add_bytes(picture)
        if path is not None and views[path] is not None:
            image.setdefault("name", path.stem)
            image.setdefault("mimeType", guess_type(path, strict=False)[0] or "image/png")
            del image["uri"]
            image["bufferView"] = views[path]
    return gltf


def _path_beside(folder: Path, uri: str | None) -> Path | None:
    """Return the file of a URI, None outside the folder, from which no file may be copied."""
    if uri is None or uri.startswith("data:"):
        return None
    path = (folder / unquote(uri)).resolve()
    return path if path.is_relative_to(folder) else None


def pack(gltf: GltfData, binary: bool) -> bytes:
    """Write a ``.glb`` file, or a ``.gltf`` file that contains its buffer."""
    document, blob = gltf.json, bytes(gltf.blob)
    for name, free in _FREE_ENTRIES.items():
        while document.get(name, [])[-1:] == [free]:
            document[name].pop()
        if not document.get(name, [free]):
            del document[name]
    buffer: dict[str, object] = {"byteLength": len(blob)}
    if not binary:
        buffer["uri"] = f"data:application/octet-stream;base64,{base64.b64encode(blob).decode()}"
    document = document | ({"buffers": [buffer]} if blob else {})
    if not binary:
        return json.dumps(document, indent=1).encode()
    content = json.dumps(document, separators=(",", ":")).encode()
    if (size := len(content) + len(blob)) > _MAX_GLB_BYTES:
        raise MeshError(f"a .glb file holds 4 GiB, and this one would have {size} bytes; write .ply or .gltf")
    chunks = _chunk(_JSON, content, b" ") + (_chunk(_BINARY, blob, b"\0") if blob else b"")
    return _MAGIC + np.array([2, 12 + len(chunks)], "<u4").tobytes() + chunks


def _chunk(kind: bytes, content: bytes, padding: bytes) -> bytes:
    content += padding * (-len(content) % 4)
    return len(content).to_bytes(4, "little") + kind + content


def _chunks(data: bytes, name: str) -> tuple[bytes, bytes]:
    """Return the JSON and the binary chunk of a ``.glb`` file."""
    if (version := int.from_bytes(data[4:8], "little")) != 2:
        raise FormatError(f"{name}: byte 4: expected version 2, found {version}; export it as glTF 2.0")
    chunks, position = dict[bytes, bytes](), 12
    while position + 8 <= len(data):
        size = int.from_bytes(data[position : position + 4], "little")
        content = data[position + 8 : position + 8 + size]
        if len(content) < size:
            place, expected = f"{name}: byte {len(data)}", f"{size} bytes of a chunk"
            raise unexpected(place, expected, str(len(content)), _CUT_SHORT)
        chunks.setdefault(data[position + 4 : position + 8], content)
        position += 8 + size
    if _JSON not in chunks:
        raise unexpected(f"{name}: byte 12", "a chunk of JSON", "none", "export the file again")
    return chunks[_JSON], chunks.get(_BINARY, b"")


def are_alike(matrices: FloatArray, one: FloatArray) -> bool:
    """Whether matrices are equal up to rounding."""
    return bool((np.abs(matrices - one) <= _POSE_TOLERANCE * np.abs(matrices).max(initial=0)).all())


def node_matrices(document: dict[str, Any]) -> dict[int, FloatArray]:
    """Compute the matrix (4, 4) of each node in the scene, parents before children."""
    nodes = document.get("nodes", [])
    below = {child for node in nodes for child in node.get("children", [])}
    matrices: dict[int, FloatArray] = {}
    top: FloatArray = np.eye(4)
    waiting = [(i, top) for i in range(len(nodes)) if i not in below][::-1]
    while waiting:
        i, above = waiting.pop()
        if i not in matrices:
            matrices[i] = product(above, _local(nodes[i]))
            waiting += [(child, matrices[i]) for child in reversed(nodes[i].get("children", []))]
    return matrices


def with_below(nodes: Sequence[dict[str, Any]], starts: Iterable[int]) -> set[int]:
    """Return some nodes and all nodes below them."""
    chosen, waiting = set[int](), list(starts)
    while waiting:
        if (i := waiting.pop()) not in chosen:
            chosen.add(i)
            waiting += nodes[i].get("children", [])
    return chosen


def _local(node: dict[str, Any]) -> FloatArray:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= node.get("scale", (1, 1, 1))
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def joint_names(document: dict[str, Any]) -> dict[int, str]:
    """Return the names of the joints of all skins, by node; equal names are numbered."""
    nodes = dict.fromkeys(node for skin in document.get("skins", []) for node in skin["joints"])
    names = (str(document["nodes"][node].get("name", f"joint_{i}")) for i, node in enumerate(nodes))
    return dict(zip(nodes, unused_names(names)))


def extras_of(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return the extras of an entry: properties outside the format."""
    extras = entry.get("extras")
    return extras if isinstance(extras, dict) else {}


def key_names(mesh: Mapping[str, Any]) -> list[str]:
    """Return the names of the shape keys of a mesh, which most programs write as extras."""
    names_in_file = extras_of(mesh).get("targetNames", [])
    n = max([len(names_in_file), *(len(primitive.get("targets", [])) for primitive in mesh["primitives"])])
    return unused_names(str(names_in_file[i]) if i < len(names_in_file) else f"key_{i}" for i in range(n))


def set_keys(document: dict[str, Any], mesh: int, names: list[str], weights: Mapping[str, float]) -> None:
    """Set the names of the shape keys of a mesh; they keep their weights unless new ones are given."""
    contents = document["meshes"][mesh]
    had, weights_before = key_names(contents), contents.get("weights", [])
    nodes = {i: node for i, node in enumerate(document.get("nodes", [])) if node.get("mesh") == mesh}
    if names != had:  # animations of key weights are removed, as they have a value for each old key

        def has_old_weights(target: dict[str, Any]) -> bool:
            return target.get("path") == "weights" and target.get("node") in nodes

        without_channels(document, has_old_weights)
    for place in (*(node for node in nodes.values() if "weights" in node), contents):
        weight_of = {**dict(zip(had, place.pop("weights", weights_before))), **weights}
        if names:
            place["weights"] = [weight_of.get(name, 0) for name in names]
    extras = {key: text for key, text in extras_of(contents).items() if key != "targetNames"}
    contents.pop("extras", None)
    if extras or names:
        contents["extras"] = extras | ({"targetNames": names} if names else {})


def without_channels(document: dict[str, Any], is_gone: Callable[[dict[str, Any]], bool]) -> None:
    """Remove the channels of targets that are gone, and animations without channels."""
    moving = []
    for animation in document.pop("animations", []):
        channels = animation["channels"]
        animation["channels"] = [channel for channel in channels if not is_gone(channel["target"])]
        moving += [animation] if animation["channels"] else []
    if moving:
        document["animations"] = moving
