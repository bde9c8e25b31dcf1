"""The skin of one glTF file, put into another: joints with what is above them, and how the surface is bound to them."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.formats._gltf_data import GltfData
from isomatch.assets.formats._gltf_scene import (
    alike,
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
    other = copy.deepcopy(given.json)
    meshes = {mesh for mesh, *_ in document.places}
    placed = transforms(gltf)
    bound = [
        (node, np.array(placed[node["mesh"]][0] or np.eye(4)))
        for node in gltf.json["nodes"]
        if node.get("mesh") in meshes
    ]
    for node, _ in bound:
        node.pop("skin", None)
    _without_unused_skins(gltf.json)
    new = _appended(gltf.json, other)
    there = node_matrices(other)
    joints = joint_names(other)
    for joint, name in joints.items():
        if np.linalg.det(there[joint]) == 0:
            raise DescriptorError(
                f"nothing can be bound to joint {name!r}, which its node scales to nothing; give it a size, or carry "
                "all but the weights"
            )
    own = {matrix.tobytes(): matrix for _, matrix in bound}
    skins = [
        {
            "joints": [new[joint] for joint in joints],
            "inverseBindMatrices": gltf.add_matrices(
                np.stack([np.linalg.inv(there[joint]) @ matrix for joint in joints])
            ),
        }
        for matrix in own.values()
    ]
    for node in gltf.json["nodes"]:  # the new skins come first, so that the names of their joints stay
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
    return any(len(each) > 0 and not alike(each, each[0]) for each in bindings)


def animation_channels(asset: Asset) -> int:
    """Count what the animations of a glTF file move."""
    animations = asset.document.json.get("animations", []) if isinstance(asset.document, GltfDocument) else []
    return sum(len(animation["channels"]) for animation in animations)


def _appended(document: dict[str, Any], other: dict[str, Any]) -> dict[int, int]:
    """Append the joints of another file and all nodes above them; return the new number of each."""
    start = len(document["nodes"])
    above = {child: i for i, node in enumerate(other["nodes"]) for child in node.get("children", [])}
    kept: set[int] = set()
    for joint in joint_names(other):
        at: int | None = joint
        while at is not None and at not in kept:
            kept.add(at)
            at = above.get(at)
    new = {old: start + i for i, old in enumerate(sorted(kept))}
    for old in new:
        node = {key: value for key, value in other["nodes"][old].items() if key not in _MESH}
        node["children"] = [new[child] for child in node.get("children", []) if child in new]
        if not node["children"]:
            del node["children"]
        document["nodes"].append(node)
    if document.get("scenes"):
        scene = document["scenes"][document.get("scene", 0)]
        scene.setdefault("nodes", []).extend(new[old] for old in new if old not in above)
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
    above = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}

    def with_above(starts: Iterable[int]) -> set[int]:
        found: set[int] = set()
        for at in starts:
            while at is not None and at not in found:
                found.add(at)
                at = above.get(at)  # type: ignore[assignment]
        return found

    bound = {
        each for i in used for each in (*skins[i]["joints"], skins[i].get("skeleton", skins[i]["joints"][0]))
    }
    held = with_above({i for i, node in enumerate(nodes) if any(key in node for key in _MESH)} | bound)
    gone = with_above(joint for skin in skins for joint in skin["joints"])
    gone |= {i for i in range(len(nodes)) if gone & with_above([i]) - held}
    for place in (*nodes, *document.get("scenes", [])):
        for key in ("children", "nodes"):
            if key in place:
                place[key] = [i for i in place[key] if i in held or i not in gone]
                if not place[key] and key == "children":
                    del place[key]
    for i in gone - held:
        nodes[i] = {}
    without_channels(document, lambda target: target.get("node") in gone - held)
