"""glTF and GLB: meshes in a scene, with skins, materials and images, which are kept as they are."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from isomatch._arrays import AnyArray, FloatArray, IntArray
from isomatch.surfaces.attribute import Attribute, Kind, guessed_kind
from isomatch.surfaces.contents import Contents, Part
from isomatch.surfaces.io._gltf_data import GltfData, packed, unpacked
from isomatch.surfaces.io._reading import reading
from isomatch.surfaces.polygons import Polygons
from isomatch.surfaces.seams import split_at_seams

Matrix = tuple[tuple[float, ...], ...]
TRIANGLES, STRIP, FAN = 4, 5, 6
_KINDS: dict[str, tuple[str, Kind]] = {
    "NORMAL": ("normal", "normal"),
    "TEXCOORD": ("uv", "uv"),
    "COLOR": ("color", "colour"),
    "TANGENT": ("tangent", "vector"),
}
_SEMANTICS = {name: semantic for semantic, (name, _) in _KINDS.items()}
_MISSING = {"uv": np.nan, "scalar": np.nan, "vector": np.nan, "colour": 1, "label": -1}


@dataclass(frozen=True)
class GltfDocument:
    """The file as it was read, and what was made of it."""

    json: dict[str, Any]
    blob: bytes
    primitives: tuple[tuple[tuple[int, int, int], ...], ...]
    """Mesh, primitive and number of triangles of those that share the points of each part."""
    points: FloatArray
    polygons: Polygons
    attributes: tuple[Attribute, ...]


def read_contents(data: bytes, name: str) -> Contents:
    """Read the triangles of a glTF file, one part after another, with all attributes of their points."""
    with reading(name, "a glTF 2.0 file"):
        return _read(unpacked(data, name))


def _read(gltf: GltfData) -> Contents:
    placed = _transforms(gltf.json)
    points: list[AnyArray] = [np.zeros((0, 3), np.float32)]
    faces: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
    parts, found, primitives = [], [], []
    start = 0
    for _, places in groupby(_surfaces(gltf.json), lambda place: (place[0], _keys(gltf.json, place))):
        same = list(places)
        mesh = same[0][0]
        keys = _keys(gltf.json, same[0])
        points.append(gltf.array(keys["POSITION"]))
        n = len(points[-1])
        triangles = [_triangles(gltf, gltf.json["meshes"][mesh]["primitives"][i], n) for mesh, i in same]
        faces += [each + start for each in triangles]
        start += n
        transform, skin = placed.get(mesh, (None, None))
        parts.append(
            Part(str(gltf.json["meshes"][mesh].get("name", "")), n, sum(map(len, triangles)), transform)
        )
        found.append(_read_attributes(gltf, keys) | _read_weights(gltf, keys, skin))
        primitives.append(tuple((mesh, i, len(each)) for (mesh, i), each in zip(same, triangles)))
    names = dict.fromkeys(name for each in found for name in each)
    attributes = tuple(_joined([each.get(name) for each in found], parts) for name in names)
    polygons = Polygons.of_triangles(np.concatenate(faces))
    contents = Contents(np.concatenate(points), polygons, attributes, tuple(parts))
    return replace(
        contents,
        document=GltfDocument(
            gltf.json, bytes(gltf.blob), tuple(primitives), contents.points, polygons, attributes
        ),
    )


def _keys(document: dict[str, Any], place: tuple[int, int]) -> dict[str, int]:
    mesh, i = place
    return dict(document["meshes"][mesh]["primitives"][i]["attributes"])


def _upside_down(uv: AnyArray) -> AnyArray:
    """Turn texture coordinates over: those of glTF start at the top of the picture, ours at the bottom."""
    turned = np.array(uv)
    turned[:, 1] = 1 - turned[:, 1]
    return turned


def keeps(attribute: Attribute) -> bool:
    """Whether glTF has a place for an attribute; values of corners go to points, which are split at seams."""
    if attribute.domain == "face":
        return False
    if attribute.kind == "label":
        return bool(np.abs(attribute.coded.values).max(initial=0) <= 2**24)
    return attribute.kind == "weights" or attribute.values.ndim == 1 or 2 <= attribute.values.shape[1] <= 4


def write_glb(contents: Contents) -> bytes:
    """Write a ``.glb`` file: the one that was read, with what is new or different."""
    return packed(_written(contents), binary=True)


def write_gltf(contents: Contents) -> bytes:
    """Write a ``.gltf`` file that contains its buffer, otherwise like `write_glb`."""
    return packed(_written(contents), binary=False)


def _written(contents: Contents) -> GltfData:
    document = contents.document
    if not isinstance(document, GltfDocument) or contents.polygons is not document.polygons:
        document = new_document(len(contents.polygons.corner_of_triangle))
        contents = Contents(contents.placed_points, contents.polygons, contents.attributes)
    gltf = GltfData(copy.deepcopy(document.json), bytearray(document.blob))
    new = [a for a in contents.attributes if not any(a is given for given in document.attributes)]
    removed = {a.name for a in document.attributes} - {a.name for a in contents.attributes}
    split = split_at_seams(contents.polygons, len(contents.points), new)
    is_new = not len(document.points)
    is_split = len(split.source) > len(contents.points)
    is_moved = not np.array_equal(contents.points, document.points)
    triangles = split.corners[contents.polygons.corner_of_triangle]
    part_of_point = contents.part_of_point[split.source]
    first_point = first_triangle = stop = 0
    for part, places in enumerate(document.primitives):
        start, stop = stop, int(np.searchsorted(part_of_point, part, side="right"))
        rows = split.source[start:stop]
        primitives = [gltf.json["meshes"][mesh]["primitives"][i] for mesh, i, _ in places]
        keys = {key: i for key, i in primitives[0]["attributes"].items() if _named(key)[0] not in removed}
        if is_split:
            _gather(gltf, keys, rows - first_point)
        if is_moved:
            position = contents.points[rows].astype(np.float32)
            bounds = (
                {"min": position.min(axis=0).tolist(), "max": position.max(axis=0).tolist()}
                if len(rows)
                else {}
            )
            keys["POSITION"] = gltf.add_array(position, **bounds)
        for attribute in split.attributes:
            _write_attribute(gltf, keys, attribute.at(np.arange(start, stop)), places[0][0])
        for primitive, (_, _, n_triangles) in zip(primitives, places):
            primitive["attributes"] = keys
            if is_split or is_new:
                for target in primitive.get("targets", []):
                    _gather(gltf, target, rows - first_point)
                indices = triangles[first_triangle : first_triangle + n_triangles] - start
                primitive["indices"] = gltf.add_array(indices.ravel().astype(np.uint32), target=34963)
                primitive["mode"] = TRIANGLES
            first_triangle += n_triangles
        first_point += int((contents.part_of_point == part).sum())
    return gltf


def new_document(n_triangles: int) -> GltfDocument:
    """Make a scene of one mesh without any points."""
    document = {
        "asset": {"version": "2.0", "generator": "isomatch"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {}}]}],
    }
    return GltfDocument(document, b"", (((0, 0, n_triangles),),), np.zeros((0, 3)), Polygons([], []), ())


def _surfaces(document: dict[str, Any]) -> Iterator[tuple[int, int]]:
    """Meshes and primitives that are made of triangles."""
    for mesh, each in enumerate(document.get("meshes", [])):
        for i, primitive in enumerate(each["primitives"]):
            if (
                primitive.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN)
                and "POSITION" in primitive["attributes"]
            ):
                yield mesh, i


def _triangles(gltf: GltfData, primitive: dict[str, Any], n_points: int) -> IntArray:
    """Return the triangles of a primitive, (m, 3)."""
    index = np.arange(n_points)
    if "indices" in primitive:
        index = gltf.array(primitive["indices"]).astype(np.int64)
        if index.max(initial=0) >= max(n_points, 1):
            raise ValueError(f"a triangle refers to point {index.max()} of {n_points}")
    mode = primitive.get("mode", TRIANGLES)
    if mode == TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    later = np.stack([index[1:-1], index[2:]], axis=1)
    if mode == FAN:
        return np.column_stack([np.repeat(index[:1], len(later)), later])
    strip = np.column_stack([index[:-2], later])
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip


def _transforms(document: dict[str, Any]) -> dict[int, tuple[Matrix | None, int | None]]:
    """Find matrix and skin of the first node of each mesh; the points of a skin are put by joints, not by the node."""
    found: dict[int, tuple[Matrix | None, int | None]] = {}
    for i, matrix in node_matrices(document).items():
        node = document["nodes"][i]
        if "mesh" in node and node["mesh"] not in found:
            placed = "skin" not in node and not np.array_equal(matrix, np.eye(4))
            found[node["mesh"]] = (_as_tuples(matrix) if placed else None, node.get("skin"))
    return found


def node_matrices(document: dict[str, Any]) -> dict[int, FloatArray]:
    """(4, 4) where the scene puts each node, parents before their children."""
    nodes = document.get("nodes", [])
    below = {child for node in nodes for child in node.get("children", [])}
    found: dict[int, FloatArray] = {}
    top: FloatArray = np.eye(4)
    waiting = [(i, top) for i in range(len(nodes)) if i not in below][::-1]
    while waiting:
        i, above = waiting.pop()
        if i not in found:
            found[i] = above @ _local(nodes[i])
            waiting += [(child, found[i]) for child in reversed(nodes[i].get("children", []))]
    return found


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


def _as_tuples(matrix: FloatArray) -> Matrix:
    return tuple(tuple(row) for row in matrix.tolist())


def _named(key: str) -> tuple[str, Kind | None]:
    """Return the name and, where the format tells it, the kind of the attribute that a key of a primitive makes."""
    if key.startswith("_"):
        return key[1:].lower(), None
    semantic, _, number = key.partition("_")
    if semantic in ("JOINTS", "WEIGHTS"):
        return "weights", "weights"
    name, kind = _KINDS.get(semantic, (semantic.lower(), None))
    return (name if number in ("", "0") else f"{name}_{number}"), kind


def _read_attributes(gltf: GltfData, keys: dict[str, int]) -> dict[str, Attribute]:
    found = {}
    for key, index in keys.items():
        name, kind = _named(key)
        if key == "POSITION" or kind == "weights":
            continue
        accessor = gltf.json["accessors"][index]
        values = gltf.array(index)
        if kind in ("uv", "normal", "vector") and values.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(values.dtype).max, -1).astype(np.float32)
        if kind == "uv":
            values = _upside_down(values)
        said = accessor.get("extras")
        said = said if isinstance(said, dict) else {}
        kind = said.get("kind") or kind or guessed_kind(name, values)
        if kind == "label":
            values = np.rint(values).astype(np.int64)
        found[name] = Attribute(
            name,
            "point",
            kind,
            values,
            names={int(code): word for code, word in said.get("names", {}).items()},
            colors={int(code): tuple(color) for code, color in said.get("colors", {}).items()},
        )
    return found


def _read_weights(gltf: GltfData, keys: dict[str, int], skin: int | None) -> dict[str, Attribute]:
    sets = [i for i in range(len(keys)) if f"JOINTS_{i}" in keys and f"WEIGHTS_{i}" in keys]
    if not sets:
        return {}
    joints = np.hstack([gltf.array(keys[f"JOINTS_{i}"]) for i in sets]).astype(np.int64)
    columns = [gltf.array(keys[f"WEIGHTS_{i}"]) for i in sets]
    weights = np.hstack(
        [c if c.dtype.kind == "f" else (c / np.iinfo(c.dtype).max).astype(np.float32) for c in columns]
    )
    names = joint_names(gltf.json)
    if skin is not None:
        order = list(names)
        in_all = np.array([order.index(node) for node in gltf.json["skins"][skin]["joints"]])
        joints = in_all[joints]
    return {
        "weights": Attribute(
            "weights", "point", "weights", weights, joints, names=dict(enumerate(names.values()))
        )
    }


def joint_names(document: dict[str, Any]) -> dict[int, str]:
    """Names of the joints of all skins, by their nodes, in the order of the skins."""
    nodes = dict.fromkeys(node for skin in document.get("skins", []) for node in skin["joints"])
    return {node: str(document["nodes"][node].get("name", f"joint_{i}")) for i, node in enumerate(nodes)}


def _joined(found: list[Attribute | None], parts: list[Part]) -> Attribute:
    """Join the values of all parts; parts without them have nan, -1, 1 or 0, as their kind has it."""
    given = [each for each in found if each is not None]
    one = given[0]
    if len(given) == len(parts) == 1:
        return one
    mixed = len({each.values.dtype for each in given}) > 1
    width = max(each.values.shape[1] for each in given) if one.values.ndim == 2 else None
    columns, joints = [], []
    for each, part in zip(found, parts):
        shape = (part.n_points,) if width is None else (part.n_points, width)
        if each is None:
            values = np.zeros(shape, one.values.dtype)
            values[:] = _MISSING.get(one.kind, 0)
            joints.append(np.zeros(shape, dtype=np.int64))
            columns.append(values)
            continue
        values = each.values
        if one.kind == "colour":
            full = 1.0 if values.dtype.kind == "f" else np.iinfo(values.dtype).max
            values = np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=full)
            values = values / full if mixed else values
        elif width is not None:
            values = np.pad(values, ((0, 0), (0, width - values.shape[1])))
        columns.append(values)
        if each.joints is not None:
            joints.append(np.pad(each.joints, ((0, 0), (0, width - each.joints.shape[1]))))
    return Attribute(
        one.name,
        "point",
        one.kind,
        np.concatenate(columns),
        None if one.joints is None else np.concatenate(joints),
        one.names,
        one.colors,
    )


def _gather(gltf: GltfData, keys: dict[str, int], rows: IntArray) -> None:
    """Replace accessors by ones of other rows."""
    for key, index in keys.items():
        accessor = gltf.json["accessors"][index]
        kept = {
            name: accessor[name]
            for name in ("normalized", "min", "max", "name", "extras")
            if name in accessor
        }
        keys[key] = gltf.add_array(gltf.array(index)[rows], **kept)


def _write_attribute(gltf: GltfData, keys: dict[str, int], attribute: Attribute, mesh: int) -> None:
    """Add the accessors of an attribute to the keys of a part."""
    if attribute.kind == "weights":
        _write_weights(gltf, keys, attribute, mesh)
        return
    key, values = _key_of(attribute, keys), attribute.coded.values
    properties: dict[str, object] = {}
    if attribute.kind == "colour":
        if values.dtype.kind == "f" or values.dtype.itemsize > 2:
            values = values.astype(np.float32)
        else:
            properties["normalized"] = True
            if values.shape[1] == 3:
                values = np.pad(values, ((0, 0), (0, 1)), constant_values=np.iinfo(values.dtype).max)
    elif attribute.kind == "label":
        coded = attribute.coded
        fits = [
            kind
            for kind in (np.uint8, np.uint16)
            if 0 <= values.min(initial=0) <= values.max(initial=0) <= np.iinfo(kind).max
        ]
        values = values.astype(fits[0] if fits else np.float32)
        properties["extras"] = {
            "kind": "label",
            **({"names": {str(code): word for code, word in coded.names.items()}} if coded.names else {}),
            **(
                {"colors": {str(code): color for code, color in coded.colors.items()}} if coded.colors else {}
            ),
        }
    else:
        if attribute.kind == "uv":
            values = np.nan_to_num(_upside_down(values[:, :2]))
        values = values.astype(np.float32)
    keys[key] = gltf.add_array(values, **properties)


def _key_of(attribute: Attribute, keys: dict[str, int]) -> str:
    name, _, number = attribute.name.rpartition("_")
    if not (number.isdecimal() and name in _SEMANTICS):
        name, number = attribute.name, "0"
    if name in ("normal", "tangent"):
        return name.upper()
    if name in _SEMANTICS:
        return f"{_SEMANTICS[name]}_{number}"
    if attribute.kind in ("uv", "colour"):
        semantic = {"uv": "TEXCOORD", "colour": "COLOR"}[attribute.kind]
        return next(key for i in range(len(keys) + 1) if (key := f"{semantic}_{i}") not in keys)
    return f"_{attribute.name.upper()}"


def _write_weights(gltf: GltfData, keys: dict[str, int], attribute: Attribute, mesh: int) -> None:
    """Write the four largest weights of each point, or as many fours as the points of this part had."""
    sets = sum(key.startswith("JOINTS_") for key in keys) or 1
    joints, weights = attribute.strongest(4 * sets)
    joints = _skin_joints(gltf.json, attribute, mesh)[joints]
    for i in range(sets):
        columns = slice(4 * i, 4 * i + 4)
        keys[f"JOINTS_{i}"] = gltf.add_array(joints[:, columns].astype(np.uint16))
        keys[f"WEIGHTS_{i}"] = gltf.add_array(weights[:, columns].astype(np.float32))


def _skin_joints(document: dict[str, Any], attribute: Attribute, mesh: int) -> IntArray:
    """Return the number of each joint in the skin of a mesh; a skin is added unless one has joints of these names."""
    nodes = document["nodes"]
    names = [attribute.names.get(i, f"joint_{i}") for i in range(attribute.n_joints)]
    users = [node for node in nodes if node.get("mesh") == mesh]
    for node in users:
        if "skin" in node:
            of_skin = [joint_names(document)[joint] for joint in document["skins"][node["skin"]]["joints"]]
            if set(names) <= set(of_skin):
                return np.array([of_skin.index(name) for name in names])
    placed = _transforms(document).get(mesh, (None, None))[0]
    matrix = {} if placed is None else {"matrix": np.array(placed).T.ravel().tolist()}
    joints = [len(nodes) + i for i in range(len(names))]
    nodes += [{"name": name, **matrix} for name in names]
    for scene in document.get("scenes", [])[:1]:
        scene.setdefault("nodes", []).extend(joints)
    document.setdefault("skins", []).append({"joints": joints})
    for node in users:
        node["skin"] = len(document["skins"]) - 1
    return np.arange(len(names))
