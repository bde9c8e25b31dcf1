"""Carry parts of a glTF file to another: materials with textures, skins and joints."""

from __future__ import annotations

import base64
import copy
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import cos, sin
from typing import Any

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import DescriptorError
from isomatch.io.asset import Asset
from isomatch.io.attribute import linear_of, srgb_of
from isomatch.io.formats import _gltf_data
from isomatch.io.formats._gltf_data import GltfData, joint_names, node_matrices
from isomatch.io.formats.gltf import GltfDocument, open_document, texcoord_numbers, with_contents
from isomatch.io.materials import (
    IN_PLACE,
    UNTINTED,
    Layer,
    Look,
    Looks,
    Picture,
    Wrap,
    as_png,
    unreadable_pictures,
)

_MATERIAL_LISTS = ("images", "samplers", "textures", "materials")  # lists of the JSON that describe materials
# what happens beyond the border of a picture, by the code of glTF
_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_WRAP_CODES = {wrap: code for code, wrap in _WRAPS.items()}  # the same codes, by what happens
_NEAREST = 9728  # code of glTF for the filter that takes the nearest pixel
# Names of extensions of materials.
_TRANSFORM, _VARIANTS = "KHR_texture_transform", "KHR_materials_variants"
_GLOSSINESS, _EMISSIVE_STRENGTH = "KHR_materials_pbrSpecularGlossiness", "KHR_materials_emissive_strength"
_NOT_OF_JOINTS = ("mesh", "skin", "camera", "extensions", "weights")  # keys of nodes that are no plain joints


def materials_of(document: GltfDocument) -> Looks | None:
    """Return the materials of a file, None without any."""
    if not document.json.get("materials"):
        return None
    gltf = GltfData(document.json, bytearray(document.blob))
    of_triangle, used = _used_materials(document)
    looks = tuple(_look(gltf, material, document.uv_names) for material in used)
    return Looks(of_triangle, looks, tinted=True)


def with_materials_of(receiver: Asset, giver: GltfDocument, giver_triangle: IntArray) -> Asset:
    """Give the receiver the materials of a glTF file whose texture coordinates it has, see `take_looks`."""
    document, gltf, starts, number_of = _open_for_materials(receiver)
    giver_data = giver.data
    other, views = giver_data.json, dict[int, int]()
    for image in other.get("images", []):
        view = image.get("bufferView", -1)
        if view >= 0:
            image["bufferView"] = views[view] if view in views else gltf.add_bytes(giver_data.bytes_of(view))
            views[view] = image["bufferView"]
    for texture in other.get("textures", []):
        for place in (texture, *texture.get("extensions", {}).values()):
            for key, name in (("source", "images"), ("sampler", "samplers")):
                if key in place:
                    place[key] += starts[name]
    of_triangle, used = _used_materials(giver)
    numbers = {number: number_of[name] for number, name in giver.uv_names.items() if name in number_of}
    other["materials"] = [other["materials"][material] for material in used]
    _shift_textures(other["materials"], starts["textures"], numbers)
    for name in _MATERIAL_LISTS:
        for entry in other.get(name, []):
            gltf.append(name, entry)
    for name in ("extensionsUsed", "extensionsRequired"):
        _use_extensions(gltf, name, other.get(name, []))
    painted = _assign_materials(document, gltf, take_looks(of_triangle, giver_triangle), starts["materials"])
    return with_contents(receiver, painted, gltf)


def with_materials(receiver: Asset, materials: Looks) -> Asset:
    """Return the receiver as a glTF file with a material for each of its triangles."""
    document, gltf, starts, number_of = _open_for_materials(receiver)
    for look in materials.looks:
        base = {"metallicFactor": 0.0, **_add_layer(gltf, look.base, number_of, "baseColor", UNTINTED)}
        entry = {"name": look.name, "pbrMetallicRoughness": base}
        if min(look.base.tint[3:], default=1.0) < 1:
            entry["alphaMode"] = "BLEND"
        if look.emitted:
            entry |= _add_layer(gltf, look.emitted, number_of, "emissive", (0.0, 0.0, 0.0))
        gltf.append("materials", entry)
    document = _assign_materials(document, gltf, materials.of_triangle, starts["materials"])
    return with_contents(receiver, document, gltf)


def take_looks(of_triangle: IntArray, giver_triangle: IntArray) -> IntArray:
    """Take the look of a triangle of the giver, or the most frequent look where that is −1."""
    held = of_triangle[giver_triangle]
    votes = np.bincount(held[giver_triangle >= 0] + 1, minlength=1)
    return np.where(giver_triangle >= 0, held, votes.argmax() - 1)


def _used_materials(document: GltfDocument) -> tuple[IntArray, list[int]]:
    """Return the used material of each triangle, (m,), −1 without one, and the used materials."""
    n, number_of = len(document.json.get("materials", [])), dict[int, int]()
    of_place = []
    for mesh, i, _ in document.places:
        material = document.json["meshes"][mesh]["primitives"][i].get("material", -1)
        of_place.append(number_of.setdefault(material, len(number_of)) if 0 <= material < n else -1)
    return np.array(of_place, dtype=np.int64)[document.place_of_triangle], list(number_of)


def _look(gltf: GltfData, index: int, names: Mapping[int, str]) -> Look:
    material = gltf.json["materials"][index]
    extensions = material.get("extensions", {})
    words, place = ("baseColorFactor", "baseColorTexture"), material.get("pbrMetallicRoughness", {})
    if _GLOSSINESS in extensions:
        words, place = ("diffuseFactor", "diffuseTexture"), extensions[_GLOSSINESS]
    factor = srgb_of(place.get(words[0], UNTINTED))
    base = _layer(gltf, place.get(words[1]), tuple(factor.tolist()), names)
    strength = extensions.get(_EMISSIVE_STRENGTH, {}).get("emissiveStrength", 1.0)
    glow = (*srgb_of(strength * np.array(material.get("emissiveFactor", (0, 0, 0)))).tolist(), 1.0)
    emitted = _layer(gltf, material.get("emissiveTexture"), glow, names) if max(glow[:3]) > 0 else None
    return Look(str(material.get("name", f"material_{index}")), base, emitted)


def _layer(
    gltf: GltfData, info: dict[str, Any] | None, tint: tuple[float, ...], names: Mapping[int, str]
) -> Layer:
    if info is None:
        return Layer(tint)
    transform = info.get("extensions", {}).get(_TRANSFORM, {})
    number, index = transform.get("texCoord", info.get("texCoord", 0)), info.get("index", -1)
    sampler = _entry(gltf, "samplers", _entry(gltf, "textures", index).get("sampler", -1))
    wraps: list[Wrap] = [_WRAPS.get(sampler.get(key, 0), "repeat") for key in ("wrapS", "wrapT")]
    # Texture coordinates are scaled, turned anticlockwise in the picture (v points down), and shifted.
    (sx, sy), (x, y) = transform.get("scale", (1, 1)), transform.get("offset", (0, 0))
    c, s = cos(transform.get("rotation", 0)), sin(transform.get("rotation", 0))
    matrix = (c * sx, s * sy, x), (-s * sx, c * sy, y)
    uv = names.get(number, f"uv_{number}" if number else "uv")
    is_nearest = sampler.get("magFilter") == _NEAREST
    return Layer(tint, _picture(gltf, index), uv, matrix, (wraps[0], wraps[1]), is_nearest)


def _picture(gltf: GltfData, index: int) -> Picture:
    """Return the first picture of a texture that can be read, or the first one."""
    texture = _entry(gltf, "textures", index)
    places = [*texture.get("extensions", {}).values(), texture]
    pictures = [_image(gltf, place["source"]) for place in places if "source" in place]
    lost = unreadable_pictures(pictures)
    pictures = [picture for picture in pictures if picture not in lost] or pictures
    return pictures[0] if pictures else Picture(f"of texture {index}", missing="the texture names no image")


def _image(gltf: GltfData, index: int) -> Picture:
    image = _entry(gltf, "images", index)
    uri = str(image.get("uri", ""))
    name = str(image.get("name") or (uri if uri and not uri.startswith("data:") else f"image {index}"))
    if "bufferView" in image:
        return Picture(name, gltf.bytes_of(image["bufferView"]))
    if not uri:
        return Picture(name, missing="it is not in the file")
    if not uri.startswith("data:"):
        return Picture(name, missing="there is no such file in the folder of the mesh")
    try:
        return Picture(name, base64.b64decode(uri.partition(",")[2]))
    except ValueError:
        return Picture(name, missing="its base64 text is damaged")


def _entry(gltf: GltfData, name: str, index: int) -> dict[str, Any]:
    """Return an entry of a list, empty if the index is outside."""
    listed = gltf.json.get(name, [])
    return listed[index] if 0 <= index < len(listed) else {}


def _open_for_materials(asset: Asset) -> tuple[GltfDocument, GltfData, dict[str, int], dict[str, int]]:
    """Open a document without materials that only its surface uses.

    Return also the lengths of the lists of materials, and the numbers of texture coordinates.
    """
    document, gltf = open_document(asset)
    places = {place[:2] for place in document.places}
    has_others = any(
        "material" in primitive and (mesh, i) not in places
        for mesh, contents in enumerate(gltf.json["meshes"])
        for i, primitive in enumerate(contents["primitives"])
    )
    if not has_others:
        for name in _MATERIAL_LISTS:
            gltf.json.pop(name, None)
        gltf.without_unused()
    starts = {name: len(gltf.json.get(name, [])) for name in _MATERIAL_LISTS}
    return document, gltf, starts, texcoord_numbers(replace(asset, document=document))


def _assign_materials(
    document: GltfDocument, gltf: GltfData, look_of_triangle: IntArray, start: int
) -> GltfDocument:
    """Assign materials, numbered from ``start``, to triangles; primitives with several are split."""
    places: list[tuple[int, int, int]] = []
    of_triangle = np.zeros(len(look_of_triangle), dtype=np.int64)
    for number, (mesh, i, part) in enumerate(document.places):
        primitives = gltf.json["meshes"][mesh]["primitives"]
        plain = primitives[i]
        plain.pop("material", None)
        plain.get("extensions", {}).pop(_VARIANTS, None)
        held = document.place_of_triangle == number
        for k, material_number in enumerate(np.unique(look_of_triangle[held]).tolist() or [-1]):
            index = len(primitives) if k else i
            material = {"material": start + material_number} if material_number >= 0 else {}
            primitives[index : index + 1] = [{**copy.deepcopy(plain), **material}]
            of_triangle[held & (look_of_triangle == material_number)] = len(places)
            places.append((mesh, index, part))
    return replace(document, places=tuple(places), place_of_triangle=of_triangle)


def _add_layer(
    gltf: GltfData, layer: Layer, number_of: Mapping[str, int], name: str, default: tuple[float, ...]
) -> dict[str, Any]:
    """Add the picture of a layer; return its entries of a material."""
    tint = tuple(linear_of(layer.tint).tolist())[: len(default)]
    material: dict[str, Any] = {f"{name}Factor": list(tint)} if tint != default else {}
    if picture := layer.picture:
        image: dict[str, object] = {"uri": picture.name}
        if not picture.missing:
            data, kind = as_png(picture.data)
            image = {"bufferView": gltf.add_bytes(data), "mimeType": f"image/{kind}"}
        texture: dict[str, Any] = {"source": gltf.append("images", image)}
        wraps = [(f"wrap{axis}", wrap) for axis, wrap in zip("ST", layer.wrap) if wrap != "repeat"]
        sampler = {key: _WRAP_CODES[wrap] for key, wrap in wraps}
        if sampler:
            texture["sampler"] = gltf.append("samplers", sampler)
        info: dict[str, Any] = {"index": gltf.append("textures", texture)}
        if number_of.get(layer.uv):
            info["texCoord"] = number_of[layer.uv]
        if layer.matrix != IN_PLACE:
            (sx, _, x), (_, sy, y) = layer.matrix
            info["extensions"] = {_TRANSFORM: {"scale": [sx, sy], "offset": [x, y]}}
            _use_extensions(gltf, "extensionsUsed", [_TRANSFORM])
        material[f"{name}Texture"] = info
    return material


def _use_extensions(gltf: GltfData, name: str, extensions: list[str]) -> None:
    if union := dict.fromkeys([*gltf.json.get(name, []), *extensions]):
        gltf.json[name] = list(union)


def _shift_textures(entry: Any, by: int, numbers: Mapping[int, int]) -> None:
    """Shift the index of every texture of a material, and renumber its texture coordinates."""
    for part in entry if isinstance(entry, list) else ():
        _shift_textures(part, by, numbers)
    for key, value in entry.items() if isinstance(entry, dict) else ():
        if key.lower().endswith("texture") and isinstance(value, dict) and "index" in value:
            value["index"] += by
            for place in (value, value.get("extensions", {}).get(_TRANSFORM, {})):
                number = place.get("texCoord", 0 if place is value else -1)
                if numbers.get(number, number) != number:
                    place["texCoord"] = numbers[number]
        _shift_textures(value, by, numbers)


def with_skin_of(receiver: Asset, giver: Asset) -> Asset:
    """Bind the receiver to the joints of the giver, a glTF file, in their present positions.

    Its former joints become empty nodes, and animations of them are removed, unless another mesh is
    bound to them. `DescriptorError` for a joint that is scaled to nothing.
    """
    giver_document = giver.document
    if not isinstance(giver_document, GltfDocument) or not giver_document.json.get("skins"):
        return receiver
    document, gltf = open_document(receiver)
    giver_json, nodes = copy.deepcopy(giver_document.json), gltf.json["nodes"]
    meshes, placed = {mesh for mesh, *_ in document.places}, gltf.transforms()
    users = [node for node in nodes if node.get("mesh") in meshes]
    bound = [(node, np.array(placed[node["mesh"]][0] or np.eye(4))) for node in users]
    for node in users:
        node.pop("skin", None)
    _remove_unused_skins(gltf.json)
    new, joints = _append_joints(gltf.json, giver_json), joint_names(giver_json)
    matrices = node_matrices(giver_json)
    for joint, name in joints.items():
        if np.linalg.det(matrices[joint]) == 0:
            problem = f"nothing can be bound to joint {name!r}, which its node scales to nothing"
            raise DescriptorError(f"{problem}; give it a size, or carry all but the weights")
    bind_matrices, skins = {matrix.tobytes(): matrix for _, matrix in bound}, []
    for matrix in bind_matrices.values():
        number = gltf.add_matrices(np.stack([np.linalg.inv(matrices[joint]) @ matrix for joint in joints]))
        skins.append({"joints": [new[joint] for joint in joints], "inverseBindMatrices": number})
    for node in nodes:  # the new skins come first in the list, so that joints keep their names
        if "skin" in node:
            node["skin"] += len(skins)
    gltf.json["skins"] = skins + gltf.json.get("skins", [])
    for node, matrix in bound:
        node["skin"] = list(bind_matrices).index(matrix.tobytes())
    return with_contents(receiver, document, gltf)


def is_posed(asset: Asset) -> bool:
    """Whether joints of a glTF file have moved, in different ways, since its surface was bound."""
    document = asset.document
    if not isinstance(document, GltfDocument):
        return False
    gltf, matrices = GltfData(document.json, bytearray(document.blob)), node_matrices(document.json)
    bindings = [gltf.binding(skin, matrices) for skin in document.json.get("skins", [])]
    return any(len(binding) > 0 and not _gltf_data.are_alike(binding, binding[0]) for binding in bindings)


def animation_channels(asset: Asset) -> int:
    """Count the channels of the animations of a glTF file."""
    animations = asset.document.json.get("animations", []) if isinstance(asset.document, GltfDocument) else []
    return sum(len(animation["channels"]) for animation in animations)


def _with_above(nodes: list[dict[str, Any]], starts: Iterable[int]) -> set[int]:
    """Return some nodes and all nodes above them."""
    above = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
    chosen: set[int] = set()
    for start in starts:
        current: int | None = start
        while current is not None and current not in chosen:
            chosen.add(current)
            current = above.get(current)
    return chosen


def _append_joints(document: dict[str, Any], other: dict[str, Any]) -> dict[int, int]:
    """Append the joints of another file and all nodes above them; return their new numbers."""
    kept, start = sorted(_with_above(other["nodes"], joint_names(other))), len(document["nodes"])
    new = {old: start + i for i, old in enumerate(kept)}
    below: set[int] = set()
    for old in kept:
        node = {key: value for key, value in other["nodes"][old].items() if key not in _NOT_OF_JOINTS}
        if children := [new[child] for child in node.pop("children", []) if child in new]:
            node["children"] = children
        below.update(children)
        document["nodes"].append(node)
    if document.get("scenes"):
        scene = document["scenes"][document.get("scene", 0)]
        scene.setdefault("nodes", []).extend(number for number in new.values() if number not in below)
    return new


def _remove_unused_skins(document: dict[str, Any]) -> None:
    """Remove unused skins; their joints, and empty nodes around them, become empty nodes."""
    nodes, skins = document["nodes"], document.pop("skins", [])
    used = sorted({node["skin"] for node in nodes if "skin" in node})
    for node in nodes:
        if "skin" in node:
            node["skin"] = used.index(node["skin"])
    if used:
        document["skins"] = [skins[i] for i in used]
    needed = [i for i, node in enumerate(nodes) if any(key in node for key in _NOT_OF_JOINTS)]
    for skin in document.get("skins", []):
        needed += [*skin["joints"], skin.get("skeleton", skin["joints"][0])]
    gone = _with_above(nodes, (joint for skin in skins for joint in skin["joints"]))
    gone -= _with_above(nodes, needed)
    gone = _gltf_data.with_below(nodes, gone)
    for place in (*nodes, *document.get("scenes", [])):
        for key in place.keys() & {"children", "nodes"}:
            place[key] = [i for i in place[key] if i not in gone]
            if not place[key] and key == "children":
                del place[key]
    for i in gone:
        nodes[i] = {}
    _gltf_data.without_channels(document, lambda target: target.get("node") in gone)
