"""The scene of a glTF file: its surfaces, where the nodes put them, and their joints."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from isomatch.assets.asset import product
from isomatch.assets.attribute import unused_name
from isomatch.assets.formats._gltf_data import GltfData
from isomatch.values.arrays import FloatArray, IntArray

Matrix = tuple[tuple[float, ...], ...]
TRIANGLES, STRIP, FAN = 4, 5, 6
_COPIED = 16  # bytes that a letter of JSON takes when it is copied, measured
_POSED = 1e-3  # of the largest entry: more than what rounding does to matrices


def separate_instances(gltf: GltfData) -> None:
    """Give each node a mesh of its own, which shares the arrays of the mesh that several nodes had."""
    document = gltf.json
    used: set[int] = set()
    sizes: dict[int, int] = {}
    for node in document.get("nodes", []):
        if node.get("mesh") in used:
            mesh = node["mesh"]
            if mesh not in sizes:
                sizes[mesh] = _COPIED * len(str(document["meshes"][mesh]))
            gltf.room.take(sizes[mesh], f"a node that repeats mesh {mesh}")
            document["meshes"].append(copy.deepcopy(document["meshes"][node["mesh"]]))
            node["mesh"] = len(document["meshes"]) - 1
        if "mesh" in node:
            used.add(node["mesh"])


def surfaces(document: dict[str, Any]) -> Iterator[tuple[int, int]]:
    """Meshes and primitives that are made of triangles, of the default scene if it has any mesh."""
    shown = _meshes_of_scene(document)
    for mesh, each in enumerate(document.get("meshes", [])):
        for i, primitive in enumerate(each["primitives"]):
            if (
                (not shown or mesh in shown)
                and primitive.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN)
                and "POSITION" in primitive["attributes"]
            ):
                yield mesh, i


def _meshes_of_scene(document: dict[str, Any]) -> set[int]:
    scenes = document.get("scenes", [])
    waiting = list(scenes[document.get("scene", 0)].get("nodes", [])) if scenes else []
    seen: set[int] = set()
    while waiting:
        i = waiting.pop()
        if i not in seen:
            seen.add(i)
            waiting += document["nodes"][i].get("children", [])
    return {document["nodes"][i]["mesh"] for i in seen if "mesh" in document["nodes"][i]}


def triangles(gltf: GltfData, primitive: dict[str, Any], n_points: int) -> IntArray:
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


def transforms(gltf: GltfData) -> dict[int, tuple[Matrix | None, int | None]]:
    """Find matrix and skin of the first node of each mesh."""
    document = gltf.json
    there = node_matrices(document)
    found: dict[int, tuple[Matrix | None, int | None]] = {}
    for i, matrix in there.items():
        node = document["nodes"][i]
        if "mesh" in node and node["mesh"] not in found:
            skin = node.get("skin")
            # the points of a skin are put by its joints, not by the node; they stay where they are if these are posed
            own = matrix if skin is None else _rest(binding(gltf, document["skins"][skin], there))
            placed = not np.array_equal(own, np.eye(4))
            found[node["mesh"]] = (_as_tuples(own) if placed else None, skin)
    return found


def binding(gltf: GltfData, skin: dict[str, Any], there: Mapping[int, FloatArray]) -> FloatArray:
    """(k, 4, 4) where each joint of a skin puts what is bound to it; none if the file does not tell how that is bound."""
    if "inverseBindMatrices" not in skin:
        return np.zeros((0, 4, 4))
    inverse = gltf.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    placed: FloatArray = np.array([there[joint] for joint in skin["joints"]]).reshape(-1, 4, 4)
    return placed @ inverse[: len(placed)]


def alike(matrices: FloatArray, one: FloatArray) -> bool:
    """Whether matrices are one and the same, but for what rounding does to them."""
    largest = np.abs(matrices).max(initial=0)
    return bool((np.abs(matrices - one) <= _POSED * largest).all())


def _rest(matrices: FloatArray) -> FloatArray:
    """(4, 4) where joints put a surface that they do not bend; where it is if they do."""
    rest: FloatArray = np.eye(4)
    if len(matrices) and alike(matrices, matrices[0]) and not alike(matrices, rest):
        rest = matrices[0]
    return rest


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
            found[i] = product(above, _local(nodes[i]))
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


def joint_names(document: dict[str, Any]) -> dict[int, str]:
    """Names of the joints of all skins, by their nodes, in the order of the skins; repeated ones are numbered."""
    nodes = dict.fromkeys(node for skin in document.get("skins", []) for node in skin["joints"])
    found: dict[int, str] = {}
    for i, node in enumerate(nodes):
        found[node] = unused_name(str(document["nodes"][node].get("name", f"joint_{i}")), found.values())
    return found


def without_empty_primitives(document: dict[str, Any]) -> None:
    """Remove primitives without points, and meshes that have none left."""
    number: dict[int, int] = {}
    for mesh, each in enumerate(document.get("meshes", [])):
        each["primitives"] = [primitive for primitive in each["primitives"] if primitive["attributes"]]
        if each["primitives"]:
            number[mesh] = len(number)
    document["meshes"] = [each for each in document.pop("meshes", []) if each["primitives"]]
    if not document["meshes"]:
        del document["meshes"]
    for node in document.get("nodes", []):
        if "mesh" in node:
            mesh = node.pop("mesh")
            if mesh in number:
                node["mesh"] = number[mesh]
            else:
                node.pop("skin", None)
                node.pop("weights", None)


def key_names(mesh: Mapping[str, Any]) -> list[str]:
    """Names of the shape keys of a mesh, which glTF itself does not have, but most programs write."""
    said = mesh.get("extras")
    given = said.get("targetNames", []) if isinstance(said, dict) else []
    n = max([len(given), *(len(primitive.get("targets", [])) for primitive in mesh["primitives"])])
    found: list[str] = []
    for i in range(n):
        found.append(unused_name(str(given[i]) if i < len(given) else f"key_{i}", found))
    return found


def set_keys(document: dict[str, Any], mesh: int, names: list[str], weights: Mapping[str, float]) -> None:
    """Set the names of the shape keys of a mesh; they keep their weights, unless there are others."""
    each = document["meshes"][mesh]
    had, own = key_names(each), each.get("weights", [])
    nodes = [node for node in document.get("nodes", []) if node.get("mesh") == mesh and "weights" in node]
    for place in (*nodes, each):
        known = {**dict(zip(had, place.pop("weights", own))), **weights}
        if names:
            place["weights"] = [known.get(name, 0) for name in names]
    said = each.pop("extras", None)
    extras = (
        {key: word for key, word in said.items() if key != "targetNames"} if isinstance(said, dict) else {}
    )
    extras |= {"targetNames": names} if names else {}
    if extras:
        each["extras"] = extras


def without_channels(document: dict[str, Any], is_gone: Callable[[dict[str, Any]], bool]) -> None:
    """Leave out what moves targets that are gone, and animations that move nothing any more."""
    moving = []
    for animation in document.pop("animations", []):
        animation["channels"] = [each for each in animation["channels"] if not is_gone(each["target"])]
        moving += [animation] if animation["channels"] else []
    if moving:
        document["animations"] = moving
