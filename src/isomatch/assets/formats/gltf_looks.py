"""Materials, textures and skins of one glTF file, put into another."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.formats._gltf_data import GltfData
from isomatch.assets.formats._gltf_scene import joint_names, node_matrices
from isomatch.assets.formats.gltf import GltfDocument, new_document
from isomatch.values.arrays import IntArray

UNTINTED = (1.0, 1.0, 1.0, 1.0)
_LISTS = ("images", "samplers", "textures", "materials")
_MESH = ("mesh", "skin", "camera", "extensions", "weights")  # of a node, what is not of a joint


def with_materials_of(receiver: Asset, giver: Asset, giver_triangle: IntArray) -> Asset:
    """Return the receiver with the materials and textures of the giver, if that is a glTF file.

    A primitive takes the material of most of its triangles: ``giver_triangle`` is that of each of them, −1 for none.
    """
    given = giver.document
    if not isinstance(given, GltfDocument) or not given.json.get("materials"):
        return receiver
    document, gltf = _opened(receiver)
    other = copy.deepcopy(given.json)
    starts = {name: len(gltf.json.get(name, [])) for name in _LISTS}
    for image in other.get("images", []):
        if "bufferView" in image:
            view = other["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            image["bufferView"] = gltf.add_bytes(given.blob[start : start + view["byteLength"]])
        gltf.append("images", image)
    for sampler in other.get("samplers", []):
        gltf.append("samplers", sampler)
    for texture in other.get("textures", []):
        for key, name in (("source", "images"), ("sampler", "samplers")):
            if key in texture:
                texture[key] += starts[name]
        gltf.append("textures", texture)
    for material in other["materials"]:
        _shift_textures(material, starts["textures"])
        gltf.append("materials", material)
    for name in ("extensionsUsed", "extensionsRequired"):
        union = dict.fromkeys([*gltf.json.get(name, []), *other.get(name, [])])
        if union:
            gltf.json[name] = list(union)
    of_triangle = material_of_triangles(given)
    first = 0
    for mesh, i, n in (place for part in document.primitives for place in part):
        primitive = gltf.json["meshes"][mesh]["primitives"][i]
        seen = giver_triangle[first : first + n]
        votes = np.bincount(of_triangle[seen[seen >= 0]] + 1, minlength=1)
        primitive.pop("material", None)
        if votes.argmax() > 0:
            primitive["material"] = int(votes.argmax()) - 1 + starts["materials"]
        first += n
    return _closed(receiver, document, gltf)


def with_skin_of(receiver: Asset, giver: Asset) -> Asset:
    """Return the receiver with the joints of the giver, if that is a glTF file, bound to them as both are now."""
    given = giver.document
    if not isinstance(given, GltfDocument) or not given.json.get("skins"):
        return receiver
    document, gltf = _opened(receiver)
    other = copy.deepcopy(given.json)
    names = joint_names(other)
    start = len(gltf.json["nodes"])
    above = {child: i for i, node in enumerate(other["nodes"]) for child in node.get("children", [])}
    kept: dict[int, None] = {}
    for joint in names:
        at: int | None = joint
        while at is not None and at not in kept:
            kept[at] = None
            at = above.get(at)
    new = {old: start + i for i, old in enumerate(sorted(kept))}
    for old in new:
        node = {key: value for key, value in other["nodes"][old].items() if key not in _MESH}
        node["children"] = [new[child] for child in node.get("children", []) if child in new]
        if not node["children"]:
            del node["children"]
        if old in names:
            node["name"] = names[old]
        gltf.json["nodes"].append(node)
    for scene in gltf.json.get("scenes", [])[:1]:
        scene.setdefault("nodes", []).extend(new[old] for old in new if old not in above)
    there = node_matrices(other)
    meshes = {mesh for part in document.primitives for mesh, _, _ in part}
    here = node_matrices(gltf.json)
    for i, node in enumerate(gltf.json["nodes"][:start]):
        if node.get("mesh") in meshes:
            own = np.eye(4) if "skin" in node else here[i]
            inverse = np.stack([np.linalg.inv(there[joint]) @ own for joint in names])
            skin = {
                "joints": [new[joint] for joint in names],
                "inverseBindMatrices": gltf.add_matrices(inverse),
            }
            node["skin"] = gltf.append("skins", skin)
    return _closed(receiver, document, gltf)


def with_texture(receiver: Asset, png: bytes, tint: Sequence[float] = UNTINTED) -> Asset:
    """Return the receiver as a glTF file with one material of one picture, multiplied by a tint of red to alpha, 0…1."""
    document, gltf = _opened(receiver)
    image = gltf.append("images", {"bufferView": gltf.add_bytes(png), "mimeType": "image/png"})
    texture = gltf.append("textures", {"source": image})
    look: dict[str, Any] = {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0}
    if tuple(tint) != UNTINTED:
        look["baseColorFactor"] = list(tint)
    material = gltf.append("materials", {"name": "baked", "pbrMetallicRoughness": look})
    for mesh, i, _ in (place for part in document.primitives for place in part):
        gltf.json["meshes"][mesh]["primitives"][i]["material"] = material
    return _closed(receiver, document, gltf)


def material_of_triangles(document: GltfDocument) -> IntArray:
    """(m,) the material of each triangle; −1 for none."""
    found = [
        np.full(n, document.json["meshes"][mesh]["primitives"][i].get("material", -1))
        for part in document.primitives
        for mesh, i, n in part
    ]
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])


def base_colours(document: object) -> tuple[IntArray, list[tuple[bytes, list[float]]]] | None:
    """Find the material of each triangle, and of each material its picture (empty if none) and its tint.

    None if it is no glTF file with materials.
    """
    if not isinstance(document, GltfDocument) or not document.json.get("materials"):
        return None
    looks = []
    for material in document.json["materials"]:
        base = material.get("pbrMetallicRoughness", {})
        picture = b""
        if "baseColorTexture" in base:
            texture = document.json["textures"][base["baseColorTexture"]["index"]]
            image = document.json["images"][texture["source"]] if "source" in texture else {}
            if "bufferView" in image:
                view = document.json["bufferViews"][image["bufferView"]]
                start = view.get("byteOffset", 0)
                picture = document.blob[start : start + view["byteLength"]]
        looks.append((picture, base.get("baseColorFactor", list(UNTINTED))))
    return material_of_triangles(document), looks


def _opened(receiver: Asset) -> tuple[GltfDocument, GltfData]:
    document = receiver.document
    if not isinstance(document, GltfDocument):
        document = replace(
            new_document(len(receiver.polygons.corner_of_triangle)), polygons=receiver.polygons
        )
    return document, GltfData(copy.deepcopy(document.json), bytearray(document.blob))


def _closed(receiver: Asset, document: GltfDocument, gltf: GltfData) -> Asset:
    return replace(receiver, document=replace(document, json=gltf.json, blob=bytes(gltf.blob)))


def _shift_textures(entry: Any, by: int) -> None:
    """Raise the index of every texture that a material names, in extensions too."""
    if isinstance(entry, list):
        for each in entry:
            _shift_textures(each, by)
    if isinstance(entry, dict):
        for key, value in entry.items():
            if key.lower().endswith("texture") and isinstance(value, dict) and "index" in value:
                value["index"] += by
            _shift_textures(value, by)
