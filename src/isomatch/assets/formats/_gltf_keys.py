"""Shape keys of glTF: the morph targets of meshes, their names and their weights."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from isomatch.assets.attribute import Attribute
from isomatch.assets.attribute_names import unused_name
from isomatch.assets.formats._gltf_data import GltfData
from isomatch.assets.formats._gltf_scene import without_channels
from isomatch.values.arrays import AnyArray


def read_keys(gltf: GltfData, mesh: int, primitive: Mapping[str, Any]) -> dict[str, Attribute]:
    """Read how far each point of a part moves when a key has weight 1."""
    return {
        name: Attribute(name, "point", "key", gltf.numbers(target["POSITION"]).astype(np.float32))
        for name, target in zip(_names(gltf.json["meshes"][mesh]), primitive.get("targets", []))
        if "POSITION" in target
    }


def key_weights(document: Mapping[str, Any]) -> dict[str, float]:
    """Return how far each key is applied where the meshes are shown, by its name."""
    found: dict[str, float] = {}
    for mesh, each in enumerate(document.get("meshes", [])):
        weights = each.get("weights", [])
        for node in _nodes_of(document, mesh):
            weights = node.get("weights", weights)
        found |= zip(_names(each), weights)
    return found


def with_key_weights(document: dict[str, Any], meshes: Iterable[int], weights: Mapping[str, float]) -> None:
    """Set the weights of keys, which the meshes may get later."""
    for mesh in meshes:
        each = document["meshes"][mesh]
        names = [*dict.fromkeys([*_names(each), *weights])]
        if names != _names(each):
            _without_animated_weights(document, mesh)
        _set(document, mesh, names, weights)


def write_keys(
    gltf: GltfData,
    mesh: int,
    parts: Sequence[tuple[list[dict[str, Any]], Mapping[str, AnyArray]]],
    gone: Collection[str],
    *,
    still: bool,
) -> None:
    """Write the keys of a mesh; those it has are kept, with the normals that belong to them, unless they are gone.

    ``parts`` are the primitives of each and how far the new keys move their points. A key that moves none of them is left
    out, unless ``still``.
    """
    all_primitives = gltf.json["meshes"][mesh]["primitives"]
    had = _names(gltf.json["meshes"][mesh])[: max(len(p.get("targets", [])) for p in all_primitives)]
    new = [name for name in parts[0][1] if still or any(moves[name].any() for _, moves in parts)]
    names = [name for name in dict.fromkeys([*had, *new]) if name in new or name not in gone]
    for primitives, moves in parts:
        old = dict(zip(had, primitives[0].get("targets", [])))
        added = {name: {"POSITION": _add(gltf, moves[name])} for name in new}
        targets = [each for name in names if (each := added.get(name, old.get(name)))]
        for primitive in primitives:
            primitive.pop("targets", None)
            if targets:
                primitive["targets"] = targets
    if names != had:
        _without_animated_weights(gltf.json, mesh)
    _set(gltf.json, mesh, names, {})


def _names(mesh: Mapping[str, Any]) -> list[str]:
    """Return the names of the targets of a mesh, which glTF itself does not have, but most programs write."""
    said = mesh.get("extras")
    given = said.get("targetNames", []) if isinstance(said, dict) else []
    n = max([len(given), *(len(primitive.get("targets", [])) for primitive in mesh["primitives"])])
    found: list[str] = []
    for i in range(n):
        found.append(unused_name(str(given[i]) if i < len(given) else f"key_{i}", found))
    return found


def _nodes_of(document: Mapping[str, Any], mesh: int) -> list[dict[str, Any]]:
    return [node for node in document.get("nodes", []) if node.get("mesh") == mesh]


def _set(document: dict[str, Any], mesh: int, names: list[str], weights: Mapping[str, float]) -> None:
    """Set the names of the keys of a mesh; they keep their weights, unless there are others."""
    each = document["meshes"][mesh]
    had, own = _names(each), each.get("weights", [])
    for place in (*(node for node in _nodes_of(document, mesh) if "weights" in node), each):
        known = {**dict(zip(had, place.pop("weights", own))), **weights}
        if names:
            place["weights"] = [known.get(name, 0) for name in names]
    said = each.pop("extras", None)
    extras = (
        {key: value for key, value in said.items() if key != "targetNames"} if isinstance(said, dict) else {}
    )
    if names:
        extras["targetNames"] = names
    if extras:
        each["extras"] = extras


def _add(gltf: GltfData, moves: AnyArray) -> int:
    values = np.nan_to_num(moves).astype(np.float32)
    return gltf.add_array(values, min=values.min(axis=0).tolist(), max=values.max(axis=0).tolist())


def _without_animated_weights(document: dict[str, Any], mesh: int) -> None:
    """Leave out what animates the weights of a mesh, as their number is another."""
    nodes = [i for i, node in enumerate(document["nodes"]) if node.get("mesh") == mesh]
    without_channels(document, lambda each: each.get("path") == "weights" and each.get("node") in nodes)
