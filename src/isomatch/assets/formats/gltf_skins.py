"""The skin of one glTF file, put into another: joints with what is above them, and how the surface is bound to them."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.formats._gltf_data import (
    GltfData,
    are_alike,
    binding,
    joint_names,
    node_matrices,
    transforms,
    without_channels,
)
from isomatch.assets.formats.gltf import GltfDocument, edited, opened_document
from isomatch.errors import DescriptorError

_MESH = ("mesh", "skin", "camera", "extensions", "weights")  # of a node, what is not of a joint


def with_skin_of(receiver: Asset, giver: Asset) -> Asset:
    """Return the receiver with the joints of the giver, if that is a glTF file, bound to them as both are now.

    Joints that it had before are emptied, and animations that moved them left out, unless another mesh is bound to them.
    `DescriptorError` for a joint that is scaled to nothing.
    """
    given = giver.document
    if not isinstance(given, GltfDocument) or not given.json.get("skins"):
        return receiver
    document, gltf = opened_document(receiver)
    other, nodes = copy.deepcopy(given.json), gltf.json["nodes"]
    meshes, placed = {mesh for mesh, *_ in document.places}, transforms(gltf)
    bound = [
        (node, np.array(placed[node["mesh"]][0] or np.eye(4))) for node in nodes if node.get("mesh") in meshes
    ]
    for node, _ in bound:
        node.pop("skin", None)
    _without_unused_skins(gltf.json)
    new, there, joints = _appended(gltf.json, other), node_matrices(other), joint_names(other)
    for joint, name in joints.items():
        if np.linalg.det(there[joint]) == 0:
            raise DescriptorError(
                f"nothing can be bound to joint {name!r}, which its node scales to nothing; give it a size, or carry "
                "all but the weights"
            )
    own = {matrix.tobytes(): matrix for _, matrix in bound}
    skins = []
    for matrix in own.values():
        inverse = np.stack([np.linalg.inv(there[joint]) @ matrix for joint in joints])
        number = gltf.add_matrices(inverse)
        skins.append({"joints": [new[joint] for joint in joints], "inverseBindMatrices": number})
    for node in nodes:  # the new skins come first, so that the names of their joints stay
        if "skin" in node:
            node["skin"] += len(skins)
    gltf.json["skins"] = skins + gltf.json.get("skins", [])
    for node, matrix in bound:
        node["skin"] = list(own).index(matrix.tobytes())
    return edited(receiver, document, gltf)


def is_posed(asset: Asset) -> bool:
    """Whether the joints of a glTF file are not, or not all in the same way, where its surface was bound to them."""
    document = asset.document
    if not isinstance(document, GltfDocument):
        return False
    gltf, there = GltfData(document.json, bytearray(document.blob)), node_matrices(document.json)
    bindings = [binding(gltf, skin, there) for skin in document.json.get("skins", [])]
    return any(len(each) > 0 and not are_alike(each, each[0]) for each in bindings)


def animation_channels(asset: Asset) -> int:
    """Count what the animations of a glTF file move."""
    animations = asset.document.json.get("animations", []) if isinstance(asset.document, GltfDocument) else []
    return sum(len(animation["channels"]) for animation in animations)


def _with_above(nodes: list[dict[str, Any]], starts: Iterable[int]) -> set[int]:
    """Return some nodes and all that are above them."""
    above = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
    found: set[int] = set()
    for start in starts:
        at: int | None = start
        while at is not None and at not in found:
            found.add(at)
            at = above.get(at)
    return found


def _appended(document: dict[str, Any], other: dict[str, Any]) -> dict[int, int]:
    """Append the joints of another file and all nodes above them; return the new number of each."""
    kept, start = sorted(_with_above(other["nodes"], joint_names(other))), len(document["nodes"])
    new = {old: start + i for i, old in enumerate(kept)}
    below: set[int] = set()
    for old in kept:
        node = {key: value for key, value in other["nodes"][old].items() if key not in _MESH}
        if children := [new[child] for child in node.pop("children", []) if child in new]:
            node["children"] = children
        below.update(children)
        document["nodes"].append(node)
    if document.get("scenes"):
        scene = document["scenes"][document.get("scene", 0)]
        scene.setdefault("nodes", []).extend(each for each in new.values() if each not in below)
    return new


def _without_unused_skins(document: dict[str, Any]) -> None:
    """Leave out skins that no node has; of their joints, with what is empty around them, an empty node is left each."""
    nodes, skins = document["nodes"], document.pop("skins", [])
    used = sorted({node["skin"] for node in nodes if "skin" in node})
    for node in nodes:
        if "skin" in node:
            node["skin"] = used.index(node["skin"])
    if used:
        document["skins"] = [skins[i] for i in used]
    bound = [
        i
        for skin in document.get("skins", [])
        for i in (*skin["joints"], skin.get("skeleton", skin["joints"][0]))
    ]
    held = _with_above(
        nodes, [*bound, *(i for i, node in enumerate(nodes) if any(key in node for key in _MESH))]
    )
    gone = _with_above(nodes, (joint for skin in skins for joint in skin["joints"]))
    gone -= held
    waiting = list(gone)
    while waiting:
        below = [i for i in nodes[waiting.pop()].get("children", []) if i not in gone]
        gone.update(below)
        waiting += below
    for place in (*nodes, *document.get("scenes", [])):
        for key in ("children", "nodes"):
            if key in place:
                place[key] = [i for i in place[key] if i not in gone]
                if not place[key] and key == "children":
                    del place[key]
    for i in gone:
        nodes[i] = {}
    without_channels(document, lambda target: target.get("node") in gone)
