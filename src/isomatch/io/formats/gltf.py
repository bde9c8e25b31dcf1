"""glTF and GLB: meshes in a scene. Only the surfaces are taken out of the document when it is read."""

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
from isomatch.io.attribute import (
    Attribute,
    Kind,
    guess_kind,
    linear_of,
    number_equal_names,
    srgb_of,
    unused_name,
)
from isomatch.io.formats import _gltf_data
from isomatch.io.formats._gltf_data import GltfData, Matrix, extras_of, joint_names, key_names, set_keys
from isomatch.io.formats._reading import reading
from isomatch.io.polygons import Polygons, Renumbering, split_at_seams

# bytes of memory of a part and of a primitive, besides their arrays; measured
_PART_BYTES, _PRIMITIVE_BYTES = 1024, 1024
# name and kind of the attribute of each key of glTF, without its number
_KINDS: dict[str, tuple[str, Kind]] = {
    "NORMAL": ("normal", "normal"),
    "TEXCOORD": ("uv", "uv"),
    "COLOR": ("color", "colour"),
    "TANGENT": ("tangent", "vector"),
}
_BYTE_TOLERANCE = 0.03  # largest difference of 255 × colour from an integer if colours were bytes; chosen
_UNIT_TOLERANCE = 1e-3  # a normal whose length differs more from 1 is scaled to 1; chosen far above rounding
# Value at points that lack an attribute, by its kind; colours are white there, and other kinds are 0.
_MISSING_VALUES = {"uv": np.nan, "scalar": np.nan, "label": -1}
Written = list[tuple[slice, list[dict[str, Any]]]]  # for each part: rows of its points, its primitives


@dataclass(frozen=True)
class GltfDocument:
    """The file without its surfaces, and their places in it."""

    json: dict[str, Any]
    blob: bytes
    places: tuple[tuple[int, int, int], ...]  # for each place: its mesh, primitive and part
    place_of_triangle: IntArray
    polygons: Polygons
    uv_names: Mapping[int, str] = field(default_factory=dict)  # names of uv by their number in materials
    former: object = None  # the document of another format from which this document was made
    coloured: frozenset[tuple[int, str]] = frozenset()  # (mesh, key) of colours, even if all are white

    @property
    def data(self) -> GltfData:
        """A copy of its contents, which may be changed."""
        return GltfData(copy.deepcopy(self.json), bytearray(self.blob))

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> GltfDocument:
        """Keep the places of the remaining triangles, and the parts with points."""
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
        places = tuple((mesh, i, int(part[old])) for mesh, i, old in (self.places[place] for place in kept))
        of_triangle = np.searchsorted(kept, of_triangle)
        place = {"places": places, "place_of_triangle": of_triangle, "polygons": after.polygons}
        return replace(self, **place, former=former)


def read_asset(data: bytes, name: str) -> Asset:
    """Read the triangles of a glTF file, one part after another, with all attributes of their points."""
    with reading(name, "a glTF 2.0 file"):
        gltf = _gltf_data.unpack(data, name)
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
        n_primitives = len(primitives)
        gltf.room.take(_PART_BYTES + _PRIMITIVE_BYTES * n_primitives, f"a part of {n_primitives} primitives")
        points.append(gltf.numbers(keys["POSITION"]))
        n = len(points[-1])
        transform, skin = placed.get(mesh, (None, None))
        of_each = [gltf.triangles(primitive, n) for primitive in primitives]
        faces += [_turn_outward(primitive, transform) + start for primitive in of_each]
        places += [(mesh, i, len(parts)) for i in listed]
        start += n
        parts.append(Part(str(meshes[mesh].get("name", "")), n, sum(map(len, of_each)), transform))
        values.append(_read_values(gltf, keys, names) | _read_weights(gltf, keys, skin))
        targets = zip(key_names(meshes[mesh]), primitives[0].get("targets", []))
        shape_keys.append({})
        for key, target in targets:
            if "POSITION" in target:
                moves = gltf.numbers(target["POSITION"]).astype(np.float32)
                shape_keys[-1][key] = Attribute(key, "point", "key", moves)
    attributes = [
        _join_parts([primitive.get(name) for primitive in of_parts], parts)
        for of_parts in (values, shape_keys)
        for name in dict.fromkeys(name for primitive in of_parts for name in primitive)
    ]
    polygons = Polygons.of_triangles(np.concatenate(faces))
    of_triangle = np.repeat(np.arange(len(places)), [len(primitive) for primitive in faces[1:]])
    for mesh in {mesh for mesh, *_ in places}:
        set_keys(gltf.json, mesh, key_names(meshes[mesh]), {})
    coloured = set[tuple[int, str]]()
    for mesh, i, _ in places:
        primitive = meshes[mesh]["primitives"][i]
        coloured |= {(mesh, key) for key in primitive["attributes"] if key.startswith("COLOR_")}
        primitive["attributes"] = {}
        for key in ("indices", "targets", "mode"):
            primitive.pop(key, None)
    gltf.without_unused()
    held = gltf.json, bytes(gltf.blob), tuple(places), of_triangle, polygons, names
    document = GltfDocument(*held, coloured=frozenset(coloured))
    numbered = number_equal_names(attributes, of_all=True)
    frame = Frame.of_named({name: str(text) for name, text in extras_of(gltf.json["asset"]).items()})
    return Asset(np.concatenate(points), polygons, numbered, tuple(parts), document, frame=frame)


def _named(key: str) -> tuple[str, Kind | None]:
    """Return the name of a key of a primitive and, if the format defines it, its kind."""
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
        extras = extras_of(gltf.json["accessors"][index])
        name = unused_name(str(extras.get("name", name)), attributes)
        values = _encode_colours(gltf.array(index)) if kind == "colour" else gltf.numbers(index)
        if kind == "uv":
            uv_names.setdefault(int(key.rpartition("_")[2]), name)
            values = _flip_v(values)
        words, colors = {}, {}
        if extras.get("kind") == "label" and values.ndim == 1:
            kind, values = "label", np.rint(values).astype(np.int64)
            words = {int(code): word for code, word in extras.get("names", {}).items()}
            colors = {int(code): tuple(color) for code, color in extras.get("colors", {}).items()}
        kind = kind or guess_kind(name, values)
        attributes[name] = Attribute(name, "point", kind, values, names=words, colors=colors)
    return attributes


def _encode_colours(light: AnyArray) -> AnyArray:
    """Encode linear colours as sRGB: bytes if they were made of bytes, otherwise fractions."""
    colours = srgb_of(light / _full(light))
    octets = np.rint(255 * colours)
    is_octets = bool((np.abs(255 * colours - octets) <= _BYTE_TOLERANCE).all() and (octets <= 255).all())
    return octets.astype(np.uint8) if is_octets else colours.astype(np.float32)


def _flip_v(uv: AnyArray) -> AnyArray:
    """Flip texture coordinates: v of glTF starts at the top of the picture, ours at the bottom."""
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


def _join_parts(of_parts: Sequence[Attribute | None], parts: Sequence[Part]) -> Attribute:
    """Join the values of all parts; parts without values get nan, −1, white or 0."""
    present = [attribute for attribute in of_parts if attribute is not None]
    first = present[0]
    if len(of_parts) == 1:
        return first
    is_colour = first.kind == "colour"
    is_mixed = len({attribute.values.dtype for attribute in present}) > 1
    full = 1.0 if is_mixed else _full(first.values)  # colours of different types all become fractions of 1
    widths = [max(sizes) for sizes in zip(*(attribute.values.shape[1:] for attribute in present))]
    columns, joints = [], []
    for attribute, part in zip(of_parts, parts):
        none = full if is_colour else _MISSING_VALUES.get(first.kind, 0)
        values = np.full((part.n_points, *widths), none, first.values.dtype)
        rows = np.zeros(values.shape, dtype=np.int64)
        if attribute is not None:
            missing = [(0, 0), *((0, width - n) for width, n in zip(widths, attribute.values.shape[1:]))]
            own_full = _full(attribute.values) if is_colour else 0
            values = np.pad(attribute.values, missing, constant_values=own_full)
            values = values / own_full if is_colour and own_full != full else values
            rows = rows if attribute.joints is None else np.pad(attribute.joints, missing)
        columns.append(values)
        joints.append(rows)
    joined = None if first.joints is None else np.concatenate(joints)
    return replace(first, values=np.concatenate(columns), joints=joined)


def _full(colors: AnyArray) -> float:
    return 1.0 if colors.dtype.kind == "f" else float(np.iinfo(colors.dtype).max)


def keeps(attribute: Attribute) -> bool:
    """Whether glTF has a place for an attribute; values of corners move to points, split at seams."""
    if attribute.domain == "face":
        return False
    if attribute.kind == "label":
        return bool(np.abs(attribute.coded.values).max(initial=0) <= 2**24)
    has_any_width = attribute.kind in ("weights", "key") or attribute.values.ndim == 1
    return has_any_width or 2 <= attribute.values.shape[1] <= 4


def write(asset: Asset, *, is_glb: bool) -> bytes:
    """Write the document with the present surface; a ``.gltf`` file contains its buffer."""
    asset.require_points()
    document = asset.document
    if not isinstance(document, GltfDocument) or asset.polygons is not document.polygons:
        document = new_document(asset)
        asset = replace(asset.placed, parts=())
        if not len(asset.polygons):
            raise MeshError("glTF files are of triangles, and there is none; write points to a .ply file")
    gltf, middle = document.data, middles(asset)
    for mesh, part in {mesh: part for mesh, _, part in document.places}.items():
        _add_translation(gltf.json, mesh, middle[asset.part_of_point == part][:1])
    numbers = texcoord_numbers(replace(asset, document=document))
    attributes = number_equal_names(asset.attributes, of_all=True)
    split = split_at_seams(asset.polygons, len(asset.points), attributes)
    faces = split.corners[asset.polygons.corner_of_triangle]
    order = np.argsort(document.place_of_triangle, kind="stable")
    bounds = np.searchsorted(document.place_of_triangle[order], np.arange(1, len(document.places)))
    of_place = np.split(order, bounds)
    n_parts = max(len(asset.parts), 1)
    ends = np.searchsorted(asset.part_of_point[split.source], np.arange(n_parts + 1)).tolist()
    of_mesh: dict[int, Written] = {}
    for (part, mesh), group in groupby(zip(document.places, of_place), lambda pair: (pair[0][2], pair[0][0])):
        listed = list(group)
        rows = slice(ends[part], ends[part + 1])
        keys = {"POSITION": _add_positions(gltf, (asset.points - middle)[split.source[rows]])}
        skipped = dict[str, Attribute]()
        for attribute in split.attributes:
            of_part = attribute.at(np.arange(rows.start, rows.stop)) if n_parts > 1 else attribute
            if of_part.kind == "key":
                continue
            key = "" if of_part.kind == "weights" else _key_of(of_part, keys, numbers)
            if n_parts > 1 and _is_missing(of_part) and (mesh, key) not in document.coloured:
                skipped[key] = of_part
            elif of_part.kind == "weights":
                _write_weights(gltf, keys, of_part, mesh)
            else:
                keys[key] = _add_values(gltf, key, of_part)
        for key in _missing_keys(keys):
            white = Attribute("color", "point", "colour", np.ones((rows.stop - rows.start, 3), np.float32))
            nowhere = Attribute("uv", "point", "uv", np.zeros((rows.stop - rows.start, 2), np.float32))
            keys[key] = _add_values(gltf, key, skipped.get(key, white if key[0] == "C" else nowhere))
        shown = [pair for pair in listed if len(pair[1])] or listed[:1]
        transform = asset.parts[part].transform if asset.parts else None
        primitives = [gltf.json["meshes"][mesh]["primitives"][i] for (_, i, _), _ in shown]
        for primitive, (_, held) in zip(primitives, shown):
            indices = _turn_outward(faces[held] - rows.start, transform).ravel().astype(np.uint32)
            primitive |= {"attributes": keys, "indices": gltf.add_array(indices, _gltf_data.INDICES)}
        of_mesh.setdefault(mesh, []).append((rows, primitives))
    shape_keys = {key.name: key.values for key in split.attributes if key.kind == "key"}
    for mesh, parts in of_mesh.items():
        _write_keys(gltf, mesh, parts, shape_keys, still=len(of_mesh) == 1)
    gltf.without_empty_primitives()
    had, named = extras_of(gltf.json["asset"]), asset.frame.named if asset.frame else {}
    others = {name: text for name, text in had.items() if name not in (SPACE, COMMENTS)}
    if others | named != had:
        gltf.json["asset"]["extras"] = others | named
    return _gltf_data.pack(gltf, is_glb)


def _missing_keys(keys: Iterable[str]) -> list[str]:
    """List missing keys with lower numbers: COLOR_1 is only valid together with COLOR_0."""
    found = (re.fullmatch(r"(COLOR|TEXCOORD)_(\d+)", key) for key in keys)
    before = [f"{match[1]}_{i}" for match in found if match for i in range(int(match[2]))]
    return [key for key in dict.fromkeys(before) if key not in {*keys}]


def middles(asset: Asset) -> FloatArray:
    """Find the translations (n, 3) that move from points to nodes if float32 would round points; else 0."""
    middle = np.zeros_like(asset.points)
    if asset.needs_doubles:
        document = asset.document if isinstance(asset.document, GltfDocument) else new_document(asset)
        mesh_of_part = np.array([*{part: mesh for mesh, _, part in document.places}.values()])
        mesh_of_point = mesh_of_part[np.minimum(asset.part_of_point, len(mesh_of_part) - 1)]
        for node in document.json.get("nodes", []):
            rows = mesh_of_point == node.get("mesh")
            if rows.any() and "skin" not in node:  # a mesh with a skin is placed by its joints
                middle[rows] = (asset.points[rows].min(axis=0) + asset.points[rows].max(axis=0)) / 2
    return middle


def _add_translation(document: dict[str, Any], mesh: int, middle: FloatArray) -> None:
    """Add a node below the node of a mesh that translates it by the row of ``middle``, if not 0."""
    nodes = document.get("nodes", [])
    for i, node in enumerate(nodes[:] if middle.any() else ()):
        if node.get("mesh") == mesh:
            node.setdefault("children", []).append(len(nodes))
            moved = {key: node.pop(key) for key in ("mesh", "weights") if key in node}
            nodes.append({**moved, "translation": middle[0].tolist()})
            for animation in document.get("animations", []):
                for target in (channel["target"] for channel in animation["channels"]):
                    if (target.get("node"), target["path"]) == (i, "weights"):
                        target["node"] = len(nodes) - 1


def _is_missing(attribute: Attribute) -> bool:
    """Whether a part has only the values that `_join_parts` fills in."""
    values = attribute.coded.values
    none = _full(values) if attribute.kind == "colour" else _MISSING_VALUES.get(attribute.kind, 0)
    return bool((np.isnan(values) if none != none else values == none).all())


def _add_positions(gltf: GltfData, points: FloatArray) -> int:
    """Append an accessor of positions or displacements, with their bounds; return its index."""
    positions = points.astype(np.float32)
    if not np.isfinite(positions).all():
        remedy = "remove these points with repair(mesh)"
        raise MeshError(f"glTF files hold no positions of nan or infinity; {remedy}")
    bounds = {"min": positions.min(axis=0), "max": positions.max(axis=0)} if len(positions) else {}
    return gltf.add_array(positions, **{name: bound.tolist() for name, bound in bounds.items()})


def _turn_outward(faces: IntArray, transform: Matrix | None) -> IntArray:
    """Turn triangles over if the node mirrors them."""
    mirrored = transform is not None and np.linalg.det(np.array(transform)[:3, :3]) < 0
    return faces[:, [0, 2, 1]] if mirrored else faces


def _add_values(gltf: GltfData, key: str, attribute: Attribute) -> int:
    """Append the accessor of an attribute for a key; return its index."""
    values, kind = attribute.coded.values, attribute.kind
    properties, extras = dict[str, Any](), dict[str, object]()
    if kind == "colour":
        light = np.nan_to_num(linear_of(attribute.fractions.clip(0, 1)), nan=1.0)  # nan becomes white
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
                extras[word] = {str(code): entry for code, entry in of_code.items()}
    else:
        values = np.nan_to_num(_flip_v(values[:, :2])) if kind == "uv" else values
        values = (_unit(values) if key == "NORMAL" else values).astype(np.float32)
    if _named(key)[0] != attribute.name:
        extras["name"] = attribute.name
    if extras:
        properties["extras"] = extras
    return gltf.add_array(values, **properties)


def _unit(normals: AnyArray) -> AnyArray:
    """Scale normals to length 1, which validators require; where there is none, it points upwards."""
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    scaled = np.divide(normals, lengths, out=np.tile([0.0, 1.0, 0.0], (len(normals), 1)), where=lengths > 0)
    return np.where(np.abs(lengths - 1) <= _UNIT_TOLERANCE, normals, scaled)


def _key_of(attribute: Attribute, keys: Mapping[str, object], numbers: Mapping[str, int]) -> str:
    """Choose a key for an attribute that is not among the given keys."""
    if attribute.kind == "uv":
        return f"TEXCOORD_{numbers[attribute.name]}"
    if attribute.kind == "colour":
        number = _number(attribute.name, "color")
        own_keys = [] if number is None else [f"COLOR_{number}"]
        candidates = (*own_keys, *(f"COLOR_{i}" for i in range(len(keys) + 1)))
        return next(key for key in candidates if key not in keys)
    meant = (attribute.name, attribute.kind)
    key = {("normal", "normal"): "NORMAL", ("tangent", "vector"): "TANGENT"}.get(meant)
    return key if key and key not in keys else unused_name(f"_{attribute.name.upper()}", keys)


def _number(name: str, stem: str) -> int | None:
    """Return the number in a name such as uv, uv_1, uv_2."""
    found = re.fullmatch(rf"{stem}(?:_(\d+))?", name)
    return int(found[1] or 0) if found else None


def texcoord_numbers(asset: Asset) -> dict[str, int]:
    """Assign numbers to the attributes of texture coordinates, as they are written."""
    number_of = asset.document.uv_names if isinstance(asset.document, GltfDocument) else {}
    number_of_name = {name: number for number, name in number_of.items()}
    names = [a.name for a in number_equal_names(asset.attributes, of_all=True) if a.kind == "uv"]
    numbers: dict[str, int] = {}
    for name in sorted(names, key=lambda name: name not in number_of_name):
        number = number_of_name.get(name, _number(name, "uv"))
        if number is None or number in numbers.values():
            number = next(i for i in range(len(names) + 1) if i not in numbers.values())
        numbers[name] = number
    return numbers


def _write_weights(gltf: GltfData, keys: dict[str, int], attribute: Attribute, mesh: int) -> None:
    """Write the four largest weights of each point, or all in sets of four."""
    sets = 1 if attribute.joints is None else max(-(-attribute.values.shape[1] // 4), 1)
    joints, weights = attribute.strongest(4 * sets)
    joints = _skin_joints(gltf, attribute, mesh, np.unique(joints[weights > 0]))[joints]
    for i in range(sets):
        columns = slice(4 * i, 4 * i + 4)
        keys[f"JOINTS_{i}"] = gltf.add_array(joints[:, columns].astype(np.uint16))
        keys[f"WEIGHTS_{i}"] = gltf.add_array(weights[:, columns].astype(np.float32))


def _skin_joints(gltf: GltfData, attribute: Attribute, mesh: int, used: IntArray) -> IntArray:
    """Return the number of each joint in the skin of a mesh; add a skin if it lacks used joints."""
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
    # These matrices are the default of glTF, but some readers need them in the file.
    inverse = gltf.add_matrices(np.tile(np.eye(4), (len(joints), 1, 1)))
    number = gltf.append("skins", {"joints": joints, "inverseBindMatrices": inverse})
    for node in users:
        node["skin"] = number
    return np.arange(len(names))


def _write_keys(
    gltf: GltfData, mesh: int, parts: Written, keys: Mapping[str, AnyArray], *, still: bool
) -> None:
    """Write the shape keys of a mesh: those it had, and new ones, only if they move a point unless ``still``."""
    had = key_names(gltf.json["meshes"][mesh])
    moving = [name for name in keys if still or any(keys[name][rows].any() for rows, _ in parts)]
    names = [name for name in dict.fromkeys([*had, *moving]) if name in keys]
    for rows, primitives in parts:
        targets = [{"POSITION": _add_positions(gltf, np.nan_to_num(keys[name][rows]))} for name in names]
        for primitive in primitives if targets else ():
            primitive["targets"] = targets
    set_keys(gltf.json, mesh, names, {})


def open_document(asset: Asset) -> tuple[GltfDocument, GltfData]:
    """Return the glTF document of an asset, or a new one, and a copy of its contents."""
    document = asset.document if isinstance(asset.document, GltfDocument) else new_document(asset)
    return document, document.data


def with_contents(asset: Asset, document: GltfDocument, gltf: GltfData) -> Asset:
    """Replace the contents of the glTF document of an asset."""
    return replace(asset, document=replace(document, json=gltf.json, blob=bytes(gltf.blob)))


def with_key_weights_of(asset: Asset, giver: object) -> Asset:
    """Give the shape keys of an asset the weights of those with the same names in another document."""
    if not isinstance(giver, GltfDocument):
        return asset
    weights: dict[str, float] = {}
    for i, mesh in enumerate(giver.json.get("meshes", [])):
        nodes = [node for node in giver.json.get("nodes", []) if node.get("mesh") == i and "weights" in node]
        weights |= zip(key_names(mesh), [*nodes, mesh][0].get("weights", []))
    document, gltf = open_document(asset)
    for mesh in {mesh for mesh, *_ in document.places}:
        had = key_names(gltf.json["meshes"][mesh])
        set_keys(gltf.json, mesh, had + [name for name in weights if name not in had], weights)
    return with_contents(asset, document, gltf)


def with_skeleton(asset: Asset, places: Mapping[str, FloatArray], parents: Mapping[str, str]) -> Asset:
    """Return an asset as a glTF file with joints at places (3,); parents come before their children."""
    document, gltf = open_document(asset)
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
    return with_contents(asset, document, gltf)


def new_document(asset: Asset) -> GltfDocument:
    """Make a scene with one mesh without points."""
    document = {
        "asset": {"version": "2.0", "generator": "isomatch"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {}}]}],
    }
    of_triangle = np.zeros(int((asset.polygons.sizes - 2).sum()), dtype=np.int64)
    return GltfDocument(document, b"", ((0, 0, 0),), of_triangle, asset.polygons, former=asset.document)
