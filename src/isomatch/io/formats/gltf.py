"""glTF and GLB: meshes in a scene. Surfaces are taken out of the document when it is read; all else stays as it is."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch.io.asset import COMMENTS, SPACE, Asset, Frame, Part, RenumberedDocument
from isomatch.io.attribute import Attribute, Kind, guessed_kind, linear_of, srgb_of, told_apart, unused_name
from isomatch.io.formats import _gltf_data
from isomatch.io.formats._gltf_data import GltfData, Matrix, extras_of, joint_names, key_names, set_keys
from isomatch.io.formats._reading import reading
from isomatch.io.polygons import Polygons, Renumbering, split_at_seams

_PART, _PRIMITIVE = 1024, 1024  # bytes that these take beside their arrays, measured
_KINDS: dict[str, tuple[str, Kind]] = {
    "NORMAL": ("normal", "normal"),
    "TEXCOORD": ("uv", "uv"),
    "COLOR": ("color", "colour"),
    "TANGENT": ("tangent", "vector"),
}
_OCTET = 0.03  # of a byte: rounding of what was made of bytes, to 16 bits or floats
# for points of parts without values; 0 and white of others
_NONE = {"uv": np.nan, "scalar": np.nan, "label": -1}
# of each part of a mesh, the rows of its points, and its primitives
Written = list[tuple[slice, list[dict[str, Any]]]]


@dataclass(frozen=True)
class GltfDocument:
    """The file without its surfaces, and where these belong."""

    json: dict[str, Any]
    blob: bytes
    places: tuple[tuple[int, int, int], ...]  # mesh, primitive and part of the asset that triangles are in
    place_of_triangle: IntArray
    polygons: Polygons
    uv_names: Mapping[int, str] = field(default_factory=dict)  # by the numbers that materials look them up by
    former: object = None  # the document of another format that the asset had before
    coloured: frozenset[tuple[int, str]] = (
        frozenset()
    )  # meshes with the keys of their colours, which may be white

    @property
    def data(self) -> GltfData:
        """Its contents, which may be changed."""
        return GltfData(copy.deepcopy(self.json), bytearray(self.blob))

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> GltfDocument:
        """Keep the places of the triangles that are left, and the parts that have points."""
        former = self.former
        if isinstance(former, RenumberedDocument):
            former = former.renumbered(before, after, rows)
        if before.polygons is not self.polygons:
            return replace(self, former=former)
        n_triangles = before.polygons.sizes - 2
        first = np.cumsum(n_triangles) - n_triangles
        of_triangle = self.place_of_triangle[first[rows.polygon_index[after.polygons.of_triangle]]]
        has_points = np.bincount(before.part_of_point[rows.point_index], minlength=len(before.parts)) > 0
        part = np.cumsum(has_points) - 1
        kept = [i for i, place in enumerate(self.places) if has_points[place[2]]]
        places = tuple((mesh, i, int(part[old])) for mesh, i, old in (self.places[each] for each in kept))
        of_triangle = np.searchsorted(kept, of_triangle)
        place = {"places": places, "place_of_triangle": of_triangle, "polygons": after.polygons}
        return replace(self, **place, former=former)


def read_asset(data: bytes, name: str) -> Asset:
    """Read the triangles of a glTF file, one part after another, with all attributes of their points."""
    with reading(name, "a glTF 2.0 file"):
        gltf = _gltf_data.unpacked(data, name)
        gltf.separate_instances()
        return _read(gltf)


def _read(gltf: GltfData) -> Asset:
    placed, meshes = gltf.transforms(), gltf.json.get("meshes", [])
    points: list[AnyArray] = [np.zeros((0, 3), np.float32)]
    faces: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
    parts: list[Part] = []
    values: list[dict[str, Attribute]] = []
    shape_keys: list[dict[str, Attribute]] = []
    places: list[tuple[int, int, int]] = []
    names: dict[int, str] = {}
    start = 0
    for (mesh, keys), same in groupby(gltf.surfaces(), itemgetter(0, 2)):
        listed = [i for _, i, _ in same]
        primitives = [meshes[mesh]["primitives"][i] for i in listed]
        gltf.room.take(_PART + _PRIMITIVE * len(primitives), f"a part of {len(primitives)} primitives")
        points.append(gltf.numbers(keys["POSITION"]))
        n = len(points[-1])
        transform, skin = placed.get(mesh, (None, None))
        of_each = [gltf.triangles(primitive, n) for primitive in primitives]
        faces += [_outwards(each, transform) + start for each in of_each]
        places += [(mesh, i, len(parts)) for i in listed]
        start += n
        parts.append(Part(str(meshes[mesh].get("name", "")), n, sum(map(len, of_each)), transform))
        values.append(_read_values(gltf, keys, names) | _read_weights(gltf, keys, skin))
        targets = zip(key_names(meshes[mesh]), primitives[0].get("targets", []))
        moves = {key: gltf.numbers(each["POSITION"]) for key, each in targets if "POSITION" in each}
        moves = {key: each.astype(np.float32) for key, each in moves.items()}
        shape_keys.append({key: Attribute(key, "point", "key", each) for key, each in moves.items()})
    attributes = [
        _joined([each.get(name) for each in of_parts], parts)
        for of_parts in (values, shape_keys)
        for name in dict.fromkeys(name for each in of_parts for name in each)
    ]
    polygons = Polygons.of_triangles(np.concatenate(faces))
    of_triangle = np.repeat(np.arange(len(places)), [len(each) for each in faces[1:]])
    for mesh in {mesh for mesh, *_ in places}:
        set_keys(gltf.json, mesh, key_names(meshes[mesh]), {})
    coloured = set[tuple[int, str]]()
    for mesh, i, _ in places:
        coloured |= {
            (mesh, key) for key in meshes[mesh]["primitives"][i]["attributes"] if key.startswith("COLOR_")
        }
        primitive = meshes[mesh]["primitives"][i]
        primitive["attributes"] = {}
        for key in ("indices", "targets", "mode"):
            primitive.pop(key, None)
    gltf.without_unused()
    blob, told = bytes(gltf.blob), frozenset(coloured)
    document = GltfDocument(gltf.json, blob, tuple(places), of_triangle, polygons, names, coloured=told)
    numbered = told_apart(attributes, of_all=True)
    frame = Frame.of_named({name: str(text) for name, text in extras_of(gltf.json["asset"]).items()})
    return Asset(np.concatenate(points), polygons, numbered, tuple(parts), document, frame=frame)


def _named(key: str) -> tuple[str, Kind | None]:
    """Return the name and, where the format tells it, the kind of what a key of a primitive holds."""
    if key.startswith("_"):
        return key[1:].lower(), None
    semantic, _, number = key.partition("_")
    name, kind = _KINDS.get(semantic, (semantic.lower(), None))
    return (name if number in ("", "0") else f"{name}_{number}"), kind


def _read_values(gltf: GltfData, keys: Mapping[str, int], uv_names: dict[int, str]) -> dict[str, Attribute]:
    attributes: dict[str, Attribute] = {}
    for key, index in keys.items():
        if key == "POSITION" or key.startswith(("JOINTS_", "WEIGHTS_")):
            continue
        name, kind = _named(key)
        said = extras_of(gltf.json["accessors"][index])
        name = unused_name(str(said.get("name", name)), attributes)
        values = _encoded(gltf.array(index)) if kind == "colour" else gltf.numbers(index)
        if kind == "uv":
            uv_names.setdefault(int(key.rpartition("_")[2]), name)
            values = _upside_down(values)
        words, colors = {}, {}
        if said.get("kind") == "label" and values.ndim == 1:
            kind, values = "label", np.rint(values).astype(np.int64)
            words = {int(code): word for code, word in said.get("names", {}).items()}
            colors = {int(code): tuple(color) for code, color in said.get("colors", {}).items()}
        kind = kind or guessed_kind(name, values)
        attributes[name] = Attribute(name, "point", kind, values, names=words, colors=colors)
    return attributes


def _encoded(light: AnyArray) -> AnyArray:
    """Encode linear colours as sRGB: as bytes if they were made of bytes, or else as fractions."""
    colours = srgb_of(light / _full(light))
    octets = np.rint(255 * colours)
    is_octets = bool((np.abs(255 * colours - octets) <= _OCTET).all() and (octets <= 255).all())
    return octets.astype(np.uint8) if is_octets else colours.astype(np.float32)


def _upside_down(uv: AnyArray) -> AnyArray:
    """Turn texture coordinates over: those of glTF start at the top of the picture, ours at the bottom."""
    return np.column_stack([uv[:, :1], 1 - uv[:, 1:2], uv[:, 2:]])


def _read_weights(gltf: GltfData, keys: Mapping[str, int], skin: int | None) -> dict[str, Attribute]:
    sets = [i for i in range(len(keys)) if f"JOINTS_{i}" in keys and f"WEIGHTS_{i}" in keys]
    if not sets:
        return {}
    joints = np.hstack([gltf.array(keys[f"JOINTS_{i}"]) for i in sets]).astype(np.int64)
    weights = np.hstack([gltf.numbers(keys[f"WEIGHTS_{i}"], normalized=True) for i in sets])
    names = joint_names(gltf.json)
    if skin is not None:
        number = {node: i for i, node in enumerate(names)}
        joints = np.array([number[node] for node in gltf.json["skins"][skin]["joints"]])[joints]
    named = dict(enumerate(names.values()))
    return {"weights": Attribute("weights", "point", "weights", weights, joints, named)}


def _joined(of_parts: Sequence[Attribute | None], parts: Sequence[Part]) -> Attribute:
    """Join the values of all parts; parts without them have nan, -1, white or 0."""
    present = [each for each in of_parts if each is not None]
    one = present[0]
    if len(of_parts) == 1:
        return one
    is_colour, is_mixed = one.kind == "colour", len({each.values.dtype for each in present}) > 1
    full = 1.0 if is_mixed else _full(one.values)  # mixed ones are fractions
    widths = [max(each) for each in zip(*(each.values.shape[1:] for each in present))]
    columns, joints = [], []
    for each, part in zip(of_parts, parts):
        none = full if is_colour else _NONE.get(one.kind, 0)
        values = np.full((part.n_points, *widths), none, one.values.dtype)
        rows = np.zeros(values.shape, dtype=np.int64)
        if each is not None:
            missing = [(0, 0), *((0, width - n) for width, n in zip(widths, each.values.shape[1:]))]
            own = _full(each.values) if is_colour else 0
            values = np.pad(each.values, missing, constant_values=own)
            values = values / own if is_colour and own != full else values
            rows = rows if each.joints is None else np.pad(each.joints, missing)
        columns.append(values)
        joints.append(rows)
    joined = None if one.joints is None else np.concatenate(joints)
    return replace(one, values=np.concatenate(columns), joints=joined)


def _full(colors: AnyArray) -> float:
    return 1.0 if colors.dtype.kind == "f" else float(np.iinfo(colors.dtype).max)


def keeps(attribute: Attribute) -> bool:
    """Whether glTF has a place for an attribute; values of corners go to points, which are split at seams."""
    if attribute.domain == "face":
        return False
    if attribute.kind == "label":
        return bool(np.abs(attribute.coded.values).max(initial=0) <= 2**24)
    has_any_width = attribute.kind in ("weights", "key") or attribute.values.ndim == 1
    return has_any_width or 2 <= attribute.values.shape[1] <= 4


def write(asset: Asset, *, is_glb: bool) -> bytes:
    """Write the file that was read, with the surface as it is now; a ``.gltf`` file contains its buffer."""
    asset.require_points()
    document = asset.document
    if not isinstance(document, GltfDocument) or asset.polygons is not document.polygons:
        document = new_document(asset)
        asset = replace(asset.placed, parts=())
        if not len(asset.polygons):
            raise MeshError("glTF files are of triangles, and there is none; write points to a .ply file")
    gltf, middle = document.data, middles(asset)
    for mesh, part in {mesh: part for mesh, _, part in document.places}.items():
        _move(gltf.json, mesh, middle[asset.part_of_point == part][:1])
    numbers = texcoord_numbers(replace(asset, document=document))
    attributes = told_apart(asset.attributes, of_all=True)
    split = split_at_seams(asset.polygons, len(asset.points), attributes)
    faces = split.corners[asset.polygons.corner_of_triangle]
    order = np.argsort(document.place_of_triangle, kind="stable")
    bounds = np.searchsorted(document.place_of_triangle[order], np.arange(1, len(document.places)))
    of_place = np.split(order, bounds)
    n_parts = max(len(asset.parts), 1)
    ends = np.searchsorted(asset.part_of_point[split.source], np.arange(n_parts + 1)).tolist()
    of_mesh: dict[int, Written] = {}
    for (part, mesh), group in groupby(zip(document.places, of_place), lambda each: (each[0][2], each[0][0])):
        listed = list(group)
        rows = slice(ends[part], ends[part + 1])
        keys = {"POSITION": _add_positions(gltf, (asset.points - middle)[split.source[rows]])}
        skipped = dict[str, Attribute]()
        for attribute in split.attributes:
            here = attribute.at(np.arange(rows.start, rows.stop)) if n_parts > 1 else attribute
            if here.kind == "key":
                continue
            key = "" if here.kind == "weights" else _key_of(here, keys, numbers)
            if n_parts > 1 and _is_missing(here) and (mesh, key) not in document.coloured:
                skipped[key] = here
            elif here.kind == "weights":
                _write_weights(gltf, keys, here, mesh)
            else:
                keys[key] = _add_values(gltf, key, here)
        for key in _keys_before(keys):
            white = Attribute("color", "point", "colour", np.ones((rows.stop - rows.start, 3), np.float32))
            nowhere = Attribute("uv", "point", "uv", np.zeros((rows.stop - rows.start, 2), np.float32))
            keys[key] = _add_values(gltf, key, skipped.get(key, white if key[0] == "C" else nowhere))
        shown = [each for each in listed if len(each[1])] or listed[:1]
        transform = asset.parts[part].transform if asset.parts else None
        primitives = [gltf.json["meshes"][mesh]["primitives"][i] for (_, i, _), _ in shown]
        for primitive, (_, held) in zip(primitives, shown):
            indices = _outwards(faces[held] - rows.start, transform).ravel().astype(np.uint32)
            primitive |= {"attributes": keys, "indices": gltf.add_array(indices, _gltf_data.INDICES)}
        of_mesh.setdefault(mesh, []).append((rows, primitives))
    shape_keys = {each.name: each.values for each in split.attributes if each.kind == "key"}
    for mesh, parts in of_mesh.items():
        _write_keys(gltf, mesh, parts, shape_keys, still=len(of_mesh) == 1)
    gltf.without_empty_primitives()
    had, named = extras_of(gltf.json["asset"]), asset.frame.named if asset.frame else {}
    others = {name: text for name, text in had.items() if name not in (SPACE, COMMENTS)}
    if others | named != had:
        gltf.json["asset"]["extras"] = others | named
    return _gltf_data.packed(gltf, is_glb)


def _keys_before(keys: Iterable[str]) -> list[str]:
    """List the keys of lower numbers that colours and texture coordinates need: COLOR_1 is valid beside COLOR_0 alone."""
    found = (re.fullmatch(r"(COLOR|TEXCOORD)_(\d+)", key) for key in keys)
    before = [f"{each[1]}_{i}" for each in found if each for i in range(int(each[2]))]
    return [key for key in dict.fromkeys(before) if key not in {*keys}]


def middles(asset: Asset) -> FloatArray:
    """(n, 3) what is taken from the points of a mesh and given to its node, where floats would round them; else 0."""
    middle = np.zeros_like(asset.points)
    if asset.needs_doubles:
        document = asset.document if isinstance(asset.document, GltfDocument) else new_document(asset)
        mesh_of_part = np.array([*{part: mesh for mesh, _, part in document.places}.values()])
        mesh_of_point = mesh_of_part[np.minimum(asset.part_of_point, len(mesh_of_part) - 1)]
        for node in document.json.get("nodes", []):
            rows = mesh_of_point == node.get("mesh")
            if rows.any() and "skin" not in node:  # a mesh with a skin is put by its joints
                middle[rows] = (asset.points[rows].min(axis=0) + asset.points[rows].max(axis=0)) / 2
    return middle


def _move(document: dict[str, Any], mesh: int, middle: FloatArray) -> None:
    """Put a mesh into a node of its own below its node, which moves it by the row of ``middle``, if that is not 0."""
    nodes = document.get("nodes", [])
    for i, node in enumerate(nodes[:] if middle.any() else ()):
        if node.get("mesh") == mesh:
            node.setdefault("children", []).append(len(nodes))
            own = {key: node.pop(key) for key in ("mesh", "weights") if key in node}
            nodes.append({**own, "translation": middle[0].tolist()})
            for animation in document.get("animations", []):
                for target in (channel["target"] for channel in animation["channels"]):
                    if (target.get("node"), target["path"]) == (i, "weights"):
                        target["node"] = len(nodes) - 1


def _is_missing(attribute: Attribute) -> bool:
    """Whether a part has no values, as `_joined` fills them in."""
    values = attribute.coded.values
    none = _full(values) if attribute.kind == "colour" else _NONE.get(attribute.kind, 0)
    return bool((np.isnan(values) if none != none else values == none).all())


def _add_positions(gltf: GltfData, points: FloatArray) -> int:
    """Append the accessor of positions or how far they move, with their bounds; return its index."""
    positions = points.astype(np.float32)
    if not np.isfinite(positions).all():
        remedy = "remove these points with repair(mesh)"
        raise MeshError(f"glTF files hold no positions of nan or infinity; {remedy}")
    bounds = {"min": positions.min(axis=0), "max": positions.max(axis=0)} if len(positions) else {}
    return gltf.add_array(positions, **{name: bound.tolist() for name, bound in bounds.items()})


def _outwards(faces: IntArray, transform: Matrix | None) -> IntArray:
    """Turn triangles over where the node is mirrored: those of the file are seen from the other side there."""
    mirrored = transform is not None and np.linalg.det(np.array(transform)[:3, :3]) < 0
    return faces[:, [0, 2, 1]] if mirrored else faces


def _add_values(gltf: GltfData, key: str, attribute: Attribute) -> int:
    """Append the accessor of an attribute that is written under a key; return its index."""
    values, kind = attribute.coded.values, attribute.kind
    properties, extras = dict[str, Any](), dict[str, object]()
    if kind == "colour":
        light = np.nan_to_num(linear_of(attribute.fractions), nan=1.0)  # white is none
        is_fine = values.dtype.kind == "f" or values.dtype.itemsize > 1
        values = light.astype(np.float32) if is_fine else np.rint(light * 65535).astype(np.uint16)
        if not is_fine:
            properties["normalized"] = True
            values = np.pad(values, ((0, 0), (0, 4 - values.shape[1])), constant_values=65535)
    elif kind == "label":
        low, high = values.min(initial=0), values.max(initial=0)
        fits = [kind for kind in (np.uint8, np.uint16) if low >= 0 and high <= np.iinfo(kind).max]
        values = values.astype(fits[0] if fits else np.float32)
        extras["kind"] = "label"
        for word, of_code in (("names", attribute.coded.names), ("colors", attribute.colors)):
            if of_code:
                extras[word] = {str(code): each for code, each in of_code.items()}
    else:
        values = np.nan_to_num(_upside_down(values[:, :2])) if kind == "uv" else values
        values = values.astype(np.float32)
    if _named(key)[0] != attribute.name:
        extras["name"] = attribute.name
    if extras:
        properties["extras"] = extras
    return gltf.add_array(values, **properties)


def _key_of(attribute: Attribute, keys: Mapping[str, object], numbers: Mapping[str, int]) -> str:
    """Return the key under which an attribute is written beside others."""
    if attribute.kind == "uv":
        return f"TEXCOORD_{numbers[attribute.name]}"
    if attribute.kind == "colour":
        number = _number(attribute.name, "color")
        own = [] if number is None else [f"COLOR_{number}"]
        return next(key for key in (*own, *(f"COLOR_{i}" for i in range(len(keys) + 1))) if key not in keys)
    meant = (attribute.name, attribute.kind)
    key = {("normal", "normal"): "NORMAL", ("tangent", "vector"): "TANGENT"}.get(meant)
    return key if key and key not in keys else unused_name(f"_{attribute.name.upper()}", keys)


def _number(name: str, stem: str) -> int | None:
    """Return the number of a name such as uv, uv_1, uv_2."""
    found = re.fullmatch(rf"{stem}(?:_(\d+))?", name)
    return int(found[1] or 0) if found else None


def texcoord_numbers(asset: Asset) -> dict[str, int]:
    """Return the number that each attribute of texture coordinates has when a glTF file is written."""
    said = asset.document.uv_names if isinstance(asset.document, GltfDocument) else {}
    own = {name: number for number, name in said.items()}
    names = [each.name for each in told_apart(asset.attributes, of_all=True) if each.kind == "uv"]
    numbers: dict[str, int] = {}
    for name in sorted(names, key=lambda name: name not in own):
        number = own.get(name, _number(name, "uv"))
        if number is None or number in numbers.values():
            number = next(i for i in range(len(names) + 1) if i not in numbers.values())
        numbers[name] = number
    return numbers


def _write_weights(gltf: GltfData, keys: dict[str, int], attribute: Attribute, mesh: int) -> None:
    """Write the four largest weights of each point, or as many fours as it has."""
    sets = 1 if attribute.joints is None else max(-(-attribute.values.shape[1] // 4), 1)
    joints, weights = attribute.strongest(4 * sets)
    joints = _skin_joints(gltf, attribute, mesh, np.unique(joints[weights > 0]))[joints]
    for i in range(sets):
        columns = slice(4 * i, 4 * i + 4)
        keys[f"JOINTS_{i}"] = gltf.add_array(joints[:, columns].astype(np.uint16))
        keys[f"WEIGHTS_{i}"] = gltf.add_array(weights[:, columns].astype(np.float32))


def _skin_joints(gltf: GltfData, attribute: Attribute, mesh: int, used: IntArray) -> IntArray:
    """Return the number of each joint in the skin of a mesh; a skin is added unless one has all that are used."""
    nodes = gltf.json["nodes"]
    names = attribute.joint_names
    users = [node for node in nodes if node.get("mesh") == mesh]
    node_of = {name: node for node, name in joint_names(gltf.json).items()}
    for node in users:
        if "skin" in node:
            place = {joint: i for i, joint in enumerate(gltf.json["skins"][node["skin"]]["joints"])}
            places: IntArray = np.array([place.get(node_of.get(name, -1), -1) for name in names])
            if (places[used] >= 0).all():
                return np.maximum(places, 0)
    placed = gltf.transforms().get(mesh, (None, None))[0]
    matrix = {} if placed is None else {"matrix": np.array(placed).T.ravel().tolist()}
    joints = [len(nodes) + i for i in range(len(names))]
    nodes += [{"name": name, **matrix} for name in names]
    for scene in gltf.json.get("scenes", [])[:1]:
        scene.setdefault("nodes", []).extend(joints)
    # identities are also meant without them, but some readers need them
    inverse = gltf.add_matrices(np.tile(np.eye(4), (len(joints), 1, 1)))
    number = gltf.append("skins", {"joints": joints, "inverseBindMatrices": inverse})
    for node in users:
        node["skin"] = number
    return np.arange(len(names))


def _write_keys(
    gltf: GltfData, mesh: int, parts: Written, keys: Mapping[str, AnyArray], *, still: bool
) -> None:
    """Write the keys of a mesh: those it had, and of others those that move it, or all if ``still``."""
    had = key_names(gltf.json["meshes"][mesh])
    moving = [name for name in keys if still or any(keys[name][rows].any() for rows, _ in parts)]
    names = [name for name in dict.fromkeys([*had, *moving]) if name in keys]
    for rows, primitives in parts:
        targets = [{"POSITION": _add_positions(gltf, np.nan_to_num(keys[name][rows]))} for name in names]
        for primitive in primitives if targets else ():
            primitive["targets"] = targets
    set_keys(gltf.json, mesh, names, {})


def opened_document(asset: Asset) -> tuple[GltfDocument, GltfData]:
    """Return the glTF document of an asset, or a new one, and its contents, which may be changed."""
    document = asset.document if isinstance(asset.document, GltfDocument) else new_document(asset)
    return document, document.data


def edited(asset: Asset, document: GltfDocument, gltf: GltfData) -> Asset:
    """Return an asset with a glTF document of other contents."""
    return replace(asset, document=replace(document, json=gltf.json, blob=bytes(gltf.blob)))


def with_key_weights_of(asset: Asset, giver: object) -> Asset:
    """Return an asset whose shape keys are shown as far as those of these names in another glTF document."""
    if not isinstance(giver, GltfDocument):
        return asset
    weights: dict[str, float] = {}
    for i, mesh in enumerate(giver.json.get("meshes", [])):
        nodes = [node for node in giver.json.get("nodes", []) if node.get("mesh") == i and "weights" in node]
        weights |= zip(key_names(mesh), [*nodes, mesh][0].get("weights", []))
    document, gltf = opened_document(asset)
    for mesh in {mesh for mesh, *_ in document.places}:
        had = key_names(gltf.json["meshes"][mesh])
        set_keys(gltf.json, mesh, had + [name for name in weights if name not in had], weights)
    return edited(asset, document, gltf)


def with_skeleton(asset: Asset, places: Mapping[str, FloatArray], parents: Mapping[str, str]) -> Asset:
    """Return an asset as a glTF file with joints at places (3,); parents come before their children."""
    document, gltf = opened_document(asset)
    nodes, start = gltf.json["nodes"], len(gltf.json["nodes"])
    number = {name: start + i for i, name in enumerate(places)}
    for name, place in places.items():
        above = parents.get(name)
        offset = np.subtract(place, places[above] if above else 0.0)
        nodes.append({"name": name, "translation": offset.tolist()})
        siblings = (
            gltf.json["scenes"][0]["nodes"]
            if above is None
            else nodes[number[above]].setdefault("children", [])
        )
        siblings.append(number[name])
    inverse = np.tile(np.eye(4), (len(places), 1, 1))
    inverse[:, :3, 3] = -np.array(list(places.values()))
    skin = gltf.append(
        "skins", {"joints": [*number.values()], "inverseBindMatrices": gltf.add_matrices(inverse)}
    )
    for node in nodes[:start]:
        if "mesh" in node:
            node["skin"] = skin
    return edited(asset, document, gltf)


def new_document(asset: Asset) -> GltfDocument:
    """Make a scene of one mesh without any points."""
    document = {
        "asset": {"version": "2.0", "generator": "isomatch"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {}}]}],
    }
    of_triangle = np.zeros(int((asset.polygons.sizes - 2).sum()), dtype=np.int64)
    return GltfDocument(document, b"", ((0, 0, 0),), of_triangle, asset.polygons, former=asset.document)
