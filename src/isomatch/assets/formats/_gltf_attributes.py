"""The attributes of glTF primitives: their names, and their values read from accessors and written to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from isomatch.assets.attribute import Attribute, Kind
from isomatch.assets.attribute_names import guessed_kind, unused_name
from isomatch.assets.formats._gltf_data import GltfData
from isomatch.assets.formats._gltf_scene import joint_names, transforms
from isomatch.assets.parts import Part
from isomatch.values.arrays import AnyArray, IntArray

_KINDS: dict[str, tuple[str, Kind]] = {
    "NORMAL": ("normal", "normal"),
    "TEXCOORD": ("uv", "uv"),
    "COLOR": ("color", "colour"),
    "TANGENT": ("tangent", "vector"),
}
_SEMANTICS = {name: semantic for semantic, (name, _) in _KINDS.items()}
_MISSING = {"uv": np.nan, "scalar": np.nan, "label": -1}


def named(gltf: GltfData, keys: dict[str, int]) -> dict[str, tuple[str, Kind | None]]:
    """Return the name and, where the format tells it, the kind of the attribute that each key of a primitive makes."""
    found: dict[str, tuple[str, Kind | None]] = {}
    for key, index in keys.items():
        name, kind = _named(key)
        if kind != "weights":
            name = str(_extras(gltf, index).get("name", name))
            name = unused_name(name, [other for other, _ in found.values()])
        found[key] = name, kind
    return found


def _named(key: str) -> tuple[str, Kind | None]:
    if key.startswith("_"):
        return key[1:].lower(), None
    semantic, _, number = key.partition("_")
    if semantic in ("JOINTS", "WEIGHTS"):
        return "weights", "weights"
    name, kind = _KINDS.get(semantic, (semantic.lower(), None))
    return (name if number in ("", "0") else f"{name}_{number}"), kind


def _extras(gltf: GltfData, index: int) -> dict[str, Any]:
    said = gltf.json["accessors"][index].get("extras")
    return said if isinstance(said, dict) else {}


def read_values(gltf: GltfData, keys: dict[str, int]) -> dict[str, Attribute]:
    found = {}
    for key, (name, kind) in named(gltf, keys).items():
        index = keys[key]
        if key == "POSITION" or kind == "weights":
            continue
        values = gltf.array(index) if kind == "colour" else gltf.numbers(index)
        if kind == "uv":
            values = _upside_down(values)
        said = _extras(gltf, index)
        if said.get("kind") == "label" and values.ndim == 1:
            kind, values = "label", np.rint(values).astype(np.int64)
        else:
            said = {}
        found[name] = Attribute(
            name,
            "point",
            kind or guessed_kind(name, values),
            values,
            names={int(code): word for code, word in said.get("names", {}).items()},
            colors={int(code): tuple(color) for code, color in said.get("colors", {}).items()},
        )
    return found


def _upside_down(uv: AnyArray) -> AnyArray:
    """Turn texture coordinates over: those of glTF start at the top of the picture, ours at the bottom."""
    turned = np.array(uv)
    turned[:, 1] = 1 - turned[:, 1]
    return turned


def read_weights(gltf: GltfData, keys: dict[str, int], skin: int | None) -> dict[str, Attribute]:
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


def joined(found: list[Attribute | None], parts: list[Part]) -> Attribute:
    """Join the values of all parts; parts without them have nan, -1, white or 0."""
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
            values[:] = _full(values) if one.kind == "colour" else _MISSING.get(one.kind, 0)
        else:
            values = each.values
        if one.kind == "colour":
            full = _full(values)
            values = np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=full)
            values = values / full if mixed else values
        elif width is not None:
            values = np.pad(values, ((0, 0), (0, width - values.shape[1])))
        columns.append(values)
        if each is None or each.joints is None:
            joints.append(np.zeros(shape, dtype=np.int64))
        else:
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


def _full(colors: AnyArray) -> float:
    return 1.0 if colors.dtype.kind == "f" else float(np.iinfo(colors.dtype).max)


def gather(gltf: GltfData, keys: dict[str, int], rows: IntArray) -> None:
    """Replace accessors by ones of other rows."""
    for key, index in keys.items():
        accessor = gltf.json["accessors"][index]
        kept = {
            name: accessor[name]
            for name in ("normalized", "min", "max", "name", "extras")
            if name in accessor
        }
        keys[key] = gltf.add_array(gltf.array(index)[rows], **kept)


def write_values(gltf: GltfData, keys: dict[str, int], attribute: Attribute, mesh: int) -> None:
    """Add the accessors of an attribute to the keys of a part."""
    if attribute.kind == "weights":
        _write_weights(gltf, keys, attribute, mesh)
        return
    key, values = key_of(attribute, keys), attribute.coded.values
    properties: dict[str, object] = {}
    extras: dict[str, object] = {}
    if attribute.kind == "colour":
        if values.dtype.kind not in "u" or values.dtype.itemsize > 2:
            values = np.nan_to_num(attribute.fractions.astype(np.float32), nan=1.0)  # white is none
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
        extras = {
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
    if _named(key)[0] != attribute.name:
        extras["name"] = attribute.name
    if extras:
        properties["extras"] = extras
    keys[key] = gltf.add_array(values, **properties)


def key_of(attribute: Attribute, keys: Mapping[str, object]) -> str:
    """Return the key under which an attribute is written beside others."""
    name, _, number = attribute.name.rpartition("_")
    if not (number.isdecimal() and name in _SEMANTICS):
        name, number = attribute.name, "0"
    semantic = _SEMANTICS.get(name, "")
    if semantic and _KINDS[semantic][1] == attribute.kind:
        key = semantic if name in ("normal", "tangent") else f"{semantic}_{number}"
        if key not in keys:
            return key
    if attribute.kind in ("uv", "colour"):
        semantic = {"uv": "TEXCOORD", "colour": "COLOR"}[attribute.kind]
        return next(key for i in range(len(keys) + 1) if (key := f"{semantic}_{i}") not in keys)
    return unused_name(f"_{attribute.name.upper()}", keys)


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
    document = gltf.json
    nodes = document["nodes"]
    names = [attribute.names.get(i, f"joint_{i}") for i in range(attribute.n_joints)]
    users = [node for node in nodes if node.get("mesh") == mesh]
    node_of = {name: node for node, name in joint_names(document).items()}
    for node in users:
        if "skin" in node:
            place = {joint: i for i, joint in enumerate(document["skins"][node["skin"]]["joints"])}
            found: IntArray = np.array([place.get(node_of.get(name, -1), -1) for name in names])
            if (found[used] >= 0).all():
                return np.maximum(found, 0)
    placed = transforms(gltf).get(mesh, (None, None))[0]
    matrix = {} if placed is None else {"matrix": np.array(placed).T.ravel().tolist()}
    joints = [len(nodes) + i for i in range(len(names))]
    nodes += [{"name": name, **matrix} for name in names]
    for scene in document.get("scenes", [])[:1]:
        scene.setdefault("nodes", []).extend(joints)
    at_rest = np.tile(
        np.eye(4), (len(joints), 1, 1)
    )  # what is also meant without it, but some readers need it
    skin = {"joints": joints, "inverseBindMatrices": gltf.add_matrices(at_rest)}
    number = gltf.append("skins", skin)
    for node in users:
        node["skin"] = number
    return np.arange(len(names))
