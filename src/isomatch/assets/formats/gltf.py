"""glTF and GLB: meshes in a scene, with skins, materials and images, which are kept as they are."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from isomatch.assets.asset import Asset, RenumberedDocument
from isomatch.assets.attribute import Attribute
from isomatch.assets.attribute_names import told_apart
from isomatch.assets.formats._gltf_attributes import (
    gather,
    joined,
    key_of,
    named,
    read_values,
    read_weights,
    write_values,
)
from isomatch.assets.formats._gltf_data import GltfData, packed, unpacked
from isomatch.assets.formats._gltf_keys import key_weights, read_keys, with_key_weights, write_keys
from isomatch.assets.formats._gltf_scene import (
    TRIANGLES,
    Matrix,
    Place,
    separate_instances,
    surfaces,
    transforms,
    triangles,
    without_primitives,
)
from isomatch.assets.formats._reading import reading
from isomatch.assets.parts import Part
from isomatch.assets.polygons import Polygons, Renumbering
from isomatch.assets.seams import split_at_seams
from isomatch.errors import MeshError
from isomatch.values.arrays import AnyArray, FloatArray, IntArray

_PART, _PRIMITIVE = 1024, 1024  # bytes that these take beside their arrays, measured


@dataclass(frozen=True)
class GltfDocument:
    """The file as it was read, and what was made of it."""

    json: dict[str, Any]
    blob: bytes
    primitives: tuple[tuple[tuple[int, int, int], ...], ...]
    """Mesh, primitive and number of triangles of those that share the points of each part."""
    points: FloatArray
    polygons: Polygons
    attributes: tuple[Attribute, ...]
    order: IntArray | None = None
    """The triangle of the asset at each place in the primitives; None if they have the same order."""
    former: object = None
    """The document of another format that the asset had before."""

    def in_order(self, values: IntArray) -> IntArray:
        """Return values of the triangles of the primitives in the order of the asset."""
        if self.order is None:
            return values
        found = np.empty_like(values)
        found[self.order] = values
        return found

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> GltfDocument:
        """Take the same rows of all that belongs to points, and the triangles that are left."""
        if before.polygons is not self.polygons:
            return self
        gltf = GltfData(copy.deepcopy(self.json), bytearray(self.blob))
        order, triangles_of = self._triangles_left(before, after, rows)
        n_points = np.bincount(
            before.part_of_point[rows.point_index], minlength=len(self.primitives)
        ).tolist()
        left: list[list[tuple[Place, int]]] = []
        emptied: set[Place] = set()
        old_point = point = 0
        for part, n, places in zip(before.parts or (None,), n_points, self.primitives):
            all_places = [place[:2] for place in places]
            kept = [place for place in all_places if len(triangles_of[place])] or all_places[:1]
            kept = kept if n else []
            emptied.update(place for place in all_places if place not in kept)
            left.append([(place, len(triangles_of[place])) for place in kept])
            if part and len(self.points):
                index = rows.point_index[point : point + n] - old_point
                keys = dict(_keys(gltf.json, all_places[0]))
                gather(gltf, keys, index)
                keys["POSITION"] = _add_positions(gltf, after.points[point : point + n])
                for mesh, i in kept:
                    primitive = gltf.json["meshes"][mesh]["primitives"][i]
                    for target in primitive.get("targets", []):
                        gather(gltf, target, index)
                    faces = after.polygons.triangles[triangles_of[mesh, i]] - point
                    primitive["attributes"] = keys
                    primitive["indices"] = _add_faces(gltf, faces, part.transform)
                    primitive["mode"] = TRIANGLES
                old_point += part.n_points
            point += n
        place_of = without_primitives(gltf.json, emptied)
        primitives = [tuple((*place_of[place], n) for place, n in each) for each in left if each]
        new = {id(old): attribute for old, attribute in zip(before.attributes, after.attributes)}
        former = self.former
        return replace(
            self,
            json=gltf.json,
            blob=bytes(gltf.blob),
            primitives=tuple(primitives),
            points=after.points if len(self.points) else self.points,
            polygons=after.polygons,
            attributes=tuple(new.get(id(attribute), attribute) for attribute in self.attributes),
            order=order if self.order is not None else None,
            former=former.renumbered(before, after, rows)
            if isinstance(former, RenumberedDocument)
            else former,
        )

    def _triangles_left(
        self, before: Asset, after: Asset, rows: Renumbering
    ) -> tuple[IntArray, dict[Place, IntArray]]:
        """Return the new triangles in the order of the primitives, and those of each; a polygon stays in one."""
        places = [place for part in self.primitives for place in part]
        held = self.in_order(
            np.repeat(np.arange(len(places)), np.array([n for *_, n in places], dtype=np.int64))
        )
        n_triangles = before.polygons.sizes - 2
        first = np.cumsum(n_triangles) - n_triangles
        held = held[first[rows.polygon_index[after.polygons.of_triangle]]]
        order = np.argsort(held, kind="stable")
        of_each = np.split(order, np.searchsorted(held[order], np.arange(1, len(places))))
        return order, {(mesh, i): triangles for (mesh, i, _), triangles in zip(places, of_each)}


def read_asset(data: bytes, name: str) -> Asset:
    """Read the triangles of a glTF file, one part after another, with all attributes of their points."""
    with reading(name, "a glTF 2.0 file"):
        gltf = unpacked(data, name)
        separate_instances(gltf)
        return _read(gltf)


def _read(gltf: GltfData) -> Asset:
    placed = transforms(gltf)
    points: list[AnyArray] = [np.zeros((0, 3), np.float32)]
    faces: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
    parts, found, shape_keys, primitives = [], [], [], []
    start = 0
    for _, places in groupby(surfaces(gltf.json), lambda place: (place[0], _keys(gltf.json, place))):
        same = list(places)
        mesh = same[0][0]
        gltf.room.take(_PART + _PRIMITIVE * len(same), f"a part of {len(same)} primitives")
        keys = _keys(gltf.json, same[0])
        points.append(gltf.numbers(keys["POSITION"]))
        n = len(points[-1])
        of_each = [triangles(gltf, gltf.json["meshes"][mesh]["primitives"][i], n) for mesh, i in same]
        transform, skin = placed.get(mesh, (None, None))
        faces += [_outwards(each, transform) + start for each in of_each]
        start += n
        parts.append(
            Part(str(gltf.json["meshes"][mesh].get("name", "")), n, sum(map(len, of_each)), transform)
        )
        found.append(read_values(gltf, keys) | read_weights(gltf, keys, skin))
        shape_keys.append(read_keys(gltf, mesh, gltf.json["meshes"][mesh]["primitives"][same[0][1]]))
        primitives.append(tuple((mesh, i, len(each)) for (mesh, i), each in zip(same, of_each)))
    attributes = told_apart(
        (
            joined([each.get(name) for each in of_parts], parts)
            for of_parts in (found, shape_keys)
            for name in dict.fromkeys(name for each in of_parts for name in each)
        ),
        of_all=True,
    )
    polygons = Polygons.of_triangles(np.concatenate(faces))
    asset = Asset(np.concatenate(points), polygons, attributes, tuple(parts))
    return replace(
        asset,
        document=GltfDocument(
            gltf.json, bytes(gltf.blob), tuple(primitives), asset.points, polygons, attributes
        ),
    )


def _keys(document: dict[str, Any], place: tuple[int, int]) -> dict[str, int]:
    mesh, i = place
    return dict(document["meshes"][mesh]["primitives"][i]["attributes"])


def keeps(attribute: Attribute) -> bool:
    """Whether glTF has a place for an attribute; values of corners go to points, which are split at seams."""
    if attribute.domain == "face":
        return False
    if attribute.kind == "label":
        return bool(np.abs(attribute.coded.values).max(initial=0) <= 2**24)
    return (
        attribute.kind in ("weights", "key")
        or attribute.values.ndim == 1
        or 2 <= attribute.values.shape[1] <= 4
    )


def write_glb(asset: Asset) -> bytes:
    """Write a ``.glb`` file: the one that was read, with what is new or different."""
    return packed(_written(asset), binary=True)


def write_gltf(asset: Asset) -> bytes:
    """Write a ``.gltf`` file that contains its buffer, otherwise like `write_glb`."""
    return packed(_written(asset), binary=False)


def _written(asset: Asset) -> GltfData:
    asset.require_points()
    document = asset.document
    if not isinstance(document, GltfDocument) or asset.polygons is not document.polygons:
        document = new_document(len(asset.polygons.corner_of_triangle))
        asset = replace(asset.placed, parts=())
        if not len(asset.polygons):
            raise MeshError("glTF files are of triangles, and there is none; write points to a .ply file")
    gltf = GltfData(copy.deepcopy(document.json), bytearray(document.blob))
    new, changed = _changes(asset, document)
    split = split_at_seams(asset.polygons, len(asset.points), new)
    is_new = not len(document.points)
    is_split = len(split.source) > len(asset.points)
    is_moved = not np.array_equal(asset.points, document.points)
    faces = split.corners[asset.polygons.corner_of_triangle]
    faces = faces if document.order is None else faces[document.order]
    part_of_point = asset.part_of_point[split.source]
    parts_of: dict[int, list[tuple[list[dict[str, Any]], dict[str, AnyArray]]]] = {}
    first_point = first_triangle = stop = 0
    for part, places in enumerate(document.primitives):
        start, stop = stop, int(np.searchsorted(part_of_point, part, side="right"))
        rows = split.source[start:stop]
        primitives = [gltf.json["meshes"][mesh]["primitives"][i] for mesh, i, _ in places]
        given = primitives[0]["attributes"]
        names = named(gltf, given)
        keys = {key: i for key, i in given.items() if names[key][0] not in changed}
        if is_split:
            gather(gltf, keys, rows - first_point)
        if is_moved:
            keys["POSITION"] = _add_positions(gltf, asset.points[rows])
        moves = {}
        for attribute in split.attributes:
            of_part = attribute.at(np.arange(start, stop))
            if attribute.kind == "key":
                moves[attribute.name] = of_part.values
            else:
                write_values(gltf, keys, of_part, places[0][0])
        parts_of.setdefault(places[0][0], []).append((primitives, moves))
        for primitive, (_, _, n_triangles) in zip(primitives, places):
            primitive["attributes"] = keys
            if is_split or is_new or document.order is not None:
                for target in primitive.get("targets", []):
                    gather(gltf, target, rows - first_point)
                indices = faces[first_triangle : first_triangle + n_triangles] - start
                transform = asset.parts[part].transform if asset.parts else None
                primitive["indices"] = _add_faces(gltf, indices, transform)
                primitive["mode"] = TRIANGLES
            first_triangle += n_triangles
        first_point += int((asset.part_of_point == part).sum())
    gone = [attribute for attribute in document.attributes if attribute.name in changed]
    if any(attribute.kind == "key" for attribute in (*gone, *new)):
        for mesh, parts in parts_of.items():
            write_keys(gltf, mesh, parts, changed, still=len(parts_of) == 1)
    return gltf


def _add_positions(gltf: GltfData, points: FloatArray) -> int:
    """Append the accessor of the points of a part, with their bounds; return its index."""
    positions = points.astype(np.float32)
    if not np.isfinite(positions).all():
        raise MeshError(
            "glTF files hold no positions of nan or infinity; remove these points with repair(mesh)"
        )
    if not len(positions):
        return gltf.add_array(positions)
    return gltf.add_array(positions, min=positions.min(axis=0).tolist(), max=positions.max(axis=0).tolist())


def _add_faces(gltf: GltfData, faces: IntArray, transform: Matrix | None) -> int:
    """Append the accessor of the triangles of a primitive; return its index."""
    return gltf.add_array(_outwards(faces, transform).ravel().astype(np.uint32), target=34963)


def _outwards(faces: IntArray, transform: Matrix | None) -> IntArray:
    """Turn triangles over where the node is mirrored: those of the file are seen from the other side there."""
    mirrored = transform is not None and np.linalg.det(np.array(transform)[:3, :3]) < 0
    return faces[:, [0, 2, 1]] if mirrored else faces


def opened_document(asset: Asset) -> tuple[GltfDocument, GltfData]:
    """Return the glTF document of an asset, or a new one, and its contents, which may be changed."""
    document = asset.document
    if not isinstance(document, GltfDocument):
        new = new_document(len(asset.polygons.corner_of_triangle))
        document = replace(new, polygons=asset.polygons, former=document)
    return document, GltfData(copy.deepcopy(document.json), bytearray(document.blob))


def edited(asset: Asset, document: GltfDocument, gltf: GltfData) -> Asset:
    """Return an asset with a glTF document of other contents."""
    return replace(asset, document=replace(document, json=gltf.json, blob=bytes(gltf.blob)))


def with_key_weights_of(asset: Asset, giver: object) -> Asset:
    """Return an asset whose shape keys are shown as far as those of these names in another glTF document."""
    if not isinstance(giver, GltfDocument):
        return asset
    document, gltf = opened_document(asset)
    meshes = {mesh for part in document.primitives for mesh, _, _ in part}
    with_key_weights(gltf.json, meshes, key_weights(giver.json))
    return edited(asset, document, gltf)


def texcoord_numbers(asset: Asset) -> dict[str, int]:
    """Return the number that each attribute of texture coordinates of a glTF file has when it is written."""
    document = asset.document
    if not isinstance(document, GltfDocument) or not document.primitives:
        return {}
    new, changed = _changes(asset, document)
    given = _keys(document.json, document.primitives[0][0][:2])
    names = named(GltfData(document.json, bytearray()), given)
    keys = {key: name for key, (name, _) in names.items() if name not in changed}
    for attribute in new:
        if attribute.kind == "uv":
            keys[key_of(attribute, keys)] = attribute.name
    return {name: int(key.rpartition("_")[2]) for key, name in keys.items() if key.startswith("TEXCOORD_")}


def _changes(asset: Asset, document: GltfDocument) -> tuple[list[Attribute], set[str]]:
    """Return the attributes that the file does not have, and the names of those in it that the asset has no more."""
    attributes = told_apart(asset.attributes, of_all=True)
    new = [a for a in attributes if not any(a is given for given in document.attributes)]
    return new, {a.name for a in document.attributes if not any(a is each for each in attributes)}


def new_document(n_triangles: int) -> GltfDocument:
    """Make a scene of one mesh without any points."""
    document = {
        "asset": {"version": "2.0", "generator": "isomatch"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {}}]}],
    }
    return GltfDocument(document, b"", (((0, 0, n_triangles),),), np.zeros((0, 3)), Polygons([], []), ())
