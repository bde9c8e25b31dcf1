"""The skin of one glTF file, put into another: joints with what is above them, and how the surface is bound to them."""

from __future__ import annotations

import copy
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

    Joints that it had before are left out, with animations that moved them, unless another mesh is bound to them.
    `DescriptorError` for a joint that is scaled to nothing.
    """
    given = giver.document
    if not isinstance(given, GltfDocument) or not given.json.get("skins"):
        return receiver
    document, gltf = opened_document(receiver)
    other = copy.deepcopy(given.json)
    meshes = {mesh for part in document.primitives for mesh, _, _ in part}
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
    """Leave out skins that no node has, and their joints with what else is empty around them."""
    nodes, skins = document["nodes"], document.get("skins", [])
    used = sorted({node["skin"] for node in nodes if "skin" in node})
    gone = {joint for i, skin in enumerate(skins) if i not in used for joint in skin["joints"]}
    document["skins"] = [skins[i] for i in used]
    for node in nodes:
        if "skin" in node:
            node["skin"] = used.index(node["skin"])
    if not document["skins"]:
        del document["skins"]
    _without_nodes(document, _empty_nodes(document, gone))


def _empty_nodes(document: dict[str, Any], joints: set[int]) -> set[int]:
    """Return the joints and the nodes above and below them that hold nothing any more."""
    nodes = document["nodes"]
    above = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
    around = set(joints)
    for joint in joints:
        at = above.get(joint)
        while at is not None and at not in around:
            around.add(at)
            at = above.get(at)
    waiting = list(joints)
    while waiting:
        below = [child for child in nodes[waiting.pop()].get("children", []) if child not in around]
        around.update(below)
        waiting += below
    held = {i for i in range(len(nodes)) if i not in around or any(key in nodes[i] for key in _MESH)}
    for skin in document.get("skins", []):
        held.update([*skin["joints"], *([skin["skeleton"]] if "skeleton" in skin else [])])
    for i in list(held):
        at = above.get(i)
        while at is not None and at not in held:
            held.add(at)
            at = above.get(at)
    return around - held


def _without_nodes(document: dict[str, Any], gone: set[int]) -> None:
    """Leave out nodes; the others, and what refers to them, are numbered anew."""
    kept = [i for i in range(len(document["nodes"])) if i not in gone]
    new = {old: i for i, old in enumerate(kept)}
    document["nodes"] = [document["nodes"][i] for i in kept]
    for place in (*document["nodes"], *document.get("scenes", [])):
        for key in ("children", "nodes"):
            if key in place:
                place[key] = [new[i] for i in place[key] if i in new]
        if place.get("children") == []:
            del place["children"]
    for skin in document.get("skins", []):
        skin["joints"] = [new[i] for i in skin["joints"]]
        if "skeleton" in skin:
            skin["skeleton"] = new[skin["skeleton"]]
    without_channels(document, lambda target: "node" in target and target["node"] not in new)
    for target in (each["target"] for one in document.get("animations", []) for each in one["channels"]):
        if "node" in target:
            target["node"] = new[target["node"]]
