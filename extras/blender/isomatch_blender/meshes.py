"""Blender's meshes as assets of isomatch, and what was carried back into them. Coordinates are those of the object."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

GROUPS, KEYS, UVS, COLOURS, MATERIALS = "GROUPS", "KEYS", "UVS", "COLOURS", "MATERIALS"
MAX_UV_MAPS = 8  # Blender keeps at most this many UV maps of a mesh.


class Refused(Exception):
    """What Blender's data does not allow, in words for the user."""


@contextmanager
def object_mode(context: bpy.types.Context) -> Iterator[None]:
    """Leave edit, sculpt and paint modes, in which meshes cannot be written, and enter them again."""
    active = context.view_layer.objects.active
    mode = active.mode if active else "OBJECT"
    if mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    try:
        yield
    finally:
        if mode != "OBJECT":
            bpy.ops.object.mode_set(mode=mode)


@contextmanager
def mesh_of(obj: bpy.types.Object, with_modifiers: bool) -> Iterator[bpy.types.Mesh]:
    """Give the mesh of an object, as it is shown or before modifiers and shape keys."""
    if obj.mode == "EDIT":
        obj.update_from_editmode()
    if not with_modifiers:
        yield obj.data
        return
    depsgraph = bpy.context.evaluated_depsgraph_get()
    shown = obj.evaluated_get(depsgraph)
    try:
        yield shown.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    finally:
        shown.to_mesh_clear()


def asset_of(obj: bpy.types.Object, with_modifiers: bool = False, data: frozenset[str] = frozenset()):
    """Make an `isomatch.Asset` of a mesh object.

    Parameters
    ----------
    obj : bpy.types.Object
        Its vertices and polygons are those of the asset, in their order.
    with_modifiers : bool
        Whether it is taken as shown; otherwise without modifiers, at the basis of its shape keys.
    data : set of str
        Which kinds of data are read: `GROUPS`, `KEYS`, `UVS`, `COLOURS`, `MATERIALS`. The names of the attributes begin
        with the kind, since Blender's names are unique only within one.

    Raises
    ------
    Refused
        If it has no faces, or shape keys of vertices that modifiers change.
    """
    from isomatch import Asset, Attribute
    from isomatch.io import Polygons

    with mesh_of(obj, with_modifiers) as mesh:
        if not mesh.polygons:
            raise Refused(f"{obj.name} has no faces; choose an object with a surface")
        corners = read(mesh.loops, "vertex_index", 1, np.int32)
        sizes = read(mesh.polygons, "loop_total", 1, np.int32)
        keys = obj.data.shape_keys
        rest = keys.reference_key.data if keys and not with_modifiers else mesh.vertices
        attributes = []
        if GROUPS in data and (chosen := many_vertex_groups(obj, mesh)):
            attributes.append(
                Attribute(GROUPS, "point", "vector", weights_of(mesh, [group.index for group in chosen]))
            )
        if KEYS in data and keys:
            if len(mesh.vertices) != len(obj.data.vertices):
                raise Refused(
                    f"{obj.name}: modifiers change its vertices, and shape keys are not of these; apply the modifiers "
                    "or match without them"
                )
            basis = read(keys.reference_key.data, "co", 3)
            attributes += [
                Attribute(KEYS + key.name, "point", "key", read(key.data, "co", 3) - basis)
                for key in keys.key_blocks
                if key != keys.reference_key
            ]
        if UVS in data:
            attributes += [
                Attribute(UVS + layer.name, "corner", "uv", read(layer.uv, "vector", 2))
                for layer in mesh.uv_layers
            ]
        if COLOURS in data:
            attributes += [
                Attribute(
                    COLOURS + layer.name,
                    "point" if layer.domain == "POINT" else "corner",
                    "vector",  # in linear light, and it may exceed 1
                    read(layer.data, "color", 4),
                )
                for layer in mesh.color_attributes
                if not layer.name.startswith(SHOWING_PREFIX)
            ]
        if MATERIALS in data and obj.material_slots:
            names = {i: slot.name or "none" for i, slot in enumerate(obj.material_slots)}
            index = read(mesh.polygons, "material_index", 1, np.int32)
            attributes.append(Attribute(MATERIALS, "face", "label", index, names=names))
        return Asset(read(rest, "co", 3), Polygons(corners, sizes), tuple(attributes))


# Colour attributes whose names begin so only show a map, and are not carried.
SHOWING_PREFIX = "isomatch "


def read(collection, name: str, width: int, dtype: type = np.float32) -> np.ndarray:
    """Read a property of all items: (n,) or (n, width), floats in double precision."""
    values = np.empty(len(collection) * width, dtype=dtype)
    collection.foreach_get(name, values)
    values = values.astype(np.float64 if dtype is np.float32 else np.int64)
    return values if width == 1 else values.reshape(-1, width)


def members(mesh: bpy.types.Mesh) -> dict[int, list[int]]:
    """Vertices of each vertex group, by its index."""
    found: dict[int, list[int]] = {}
    for vertex in mesh.vertices:
        for group in vertex.groups:
            found.setdefault(group.group, []).append(vertex.index)
    return found


def many_vertex_groups(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> list[bpy.types.VertexGroup]:
    """Vertex groups of more than one vertex; those of one are landmarks."""
    within = members(mesh)
    return [group for group in obj.vertex_groups if len(within.get(group.index, ())) > 1]


def weights_of(mesh: bpy.types.Mesh, groups: list[int]) -> np.ndarray:
    """(n, g) weights of all vertices in vertex groups; 0 outside."""
    weights = np.zeros((len(mesh.vertices), len(groups)))
    column = {group: i for i, group in enumerate(groups)}
    for vertex in mesh.vertices:
        for group in vertex.groups:
            if group.group in column:
                weights[vertex.index, column[group.group]] = group.weight
    return weights


def write(
    obj: bpy.types.Object, asset, giver: bpy.types.Object, data: frozenset[str], giver_groups
) -> list[str]:
    """Write what was carried into the mesh of an object; what has the same name is replaced.

    Parameters
    ----------
    obj : bpy.types.Object
        In object mode.
    asset : isomatch.Asset
        Its asset, with the attributes that `asset_of` read from the giver.
    giver : bpy.types.Object
        Where they come from.
    data : set of str
        Kinds to write.
    giver_groups : sequence of str
        Names of the columns of the vertex groups.

    Returns
    -------
    list of str
        What was written, in words.
    """
    done = []
    by_kind = {kind: [a for a in asset.attributes if a.name.startswith(kind)] for kind in data}
    for attribute in by_kind.get(GROUPS, ()):
        for name, weights in zip(giver_groups, np.nan_to_num(attribute.values).T):
            write_group(obj, name, weights)
        done.append(counted(len(giver_groups), "vertex group"))
    if keys := by_kind.get(KEYS):
        write_keys(obj, keys, giver)
        done.append(counted(len(keys), "shape key"))
    if uvs := by_kind.get(UVS):
        for attribute in uvs:
            write_uv(obj, attribute.name.removeprefix(UVS), at_corners(asset, attribute))
        done.append(counted(len(uvs), "UV map"))
    if colours := by_kind.get(COLOURS):
        for attribute in colours:
            name = attribute.name.removeprefix(COLOURS)
            like = giver.data.color_attributes.get(name)
            domain = like.domain if like else "CORNER"
            values = attribute.values if domain == "POINT" else at_corners(asset, attribute)
            write_colours(obj.data, name, values, domain, like.data_type if like else "FLOAT_COLOR")
        done.append(counted(len(colours), "colour attribute"))
    for attribute in by_kind.get(MATERIALS, ()):
        write_materials(obj, giver, attribute.values)
        done.append(counted(len(giver.material_slots), "material"))
    obj.data.update()
    return done


def require_room(obj: bpy.types.Object, giver) -> None:
    """Raise `Refused` if a mesh would get more UV maps than Blender allows."""
    own = set(obj.data.uv_layers.keys())
    given = {a.name.removeprefix(UVS) for a in giver.attributes if a.name.startswith(UVS)}
    if len(own | given) > MAX_UV_MAPS:
        raise Refused(
            f"{obj.name} would have {len(own | given)} UV maps, and Blender allows {MAX_UV_MAPS}; remove some first"
        )


def counted(n: int, what: str) -> str:
    """Say how many there are."""
    return f"{n} {what}{'s' * (n != 1)}"


def at_corners(asset, attribute) -> np.ndarray:
    """Return values at all corners, of an attribute of corners or points."""
    return attribute.values if attribute.domain == "corner" else attribute.values[asset.polygons.corners]


def write_group(obj: bpy.types.Object, name: str, weights: np.ndarray) -> None:
    """Make a vertex group of the vertices with a positive weight."""
    if old := obj.vertex_groups.get(name):
        obj.vertex_groups.remove(old)
    group = obj.vertex_groups.new(name=name)
    for vertex in np.flatnonzero(weights > 0).tolist():
        group.add((vertex,), float(weights[vertex]), "REPLACE")


def write_keys(obj: bpy.types.Object, keys, giver: bpy.types.Object) -> None:
    """Make shape keys of displacements from the basis, relative to each other as in the giver."""
    if not obj.data.shape_keys:
        obj.shape_key_add(name="Basis", from_mix=False)
    reference = obj.data.shape_keys.reference_key
    basis = read(reference.data, "co", 3)
    given = giver.data.shape_keys
    made = {given.reference_key.name: reference}
    for attribute in keys:
        name = attribute.name.removeprefix(KEYS)
        key = obj.data.shape_keys.key_blocks.get(name)
        if key is None or key == reference:
            key = obj.shape_key_add(name=name, from_mix=False)
        key.data.foreach_set("co", (basis + attribute.values).astype(np.float32).ravel())
        like = given.key_blocks[name]
        key.slider_min, key.slider_max = like.slider_min, like.slider_max
        key.value, key.mute = like.value, like.mute
        made[name] = key
    for name, key in made.items():
        if key != reference:
            key.relative_key = made.get(given.key_blocks[name].relative_key.name, reference)


def write_uv(obj: bpy.types.Object, name: str, values: np.ndarray) -> None:
    """Write a UV map; corners without an image are at (0, 0)."""
    layers = obj.data.uv_layers
    layer = layers.get(name) or layers.new(name=name, do_init=False)
    layer.uv.foreach_set("vector", np.nan_to_num(values).astype(np.float32).ravel())


def write_colours(
    mesh: bpy.types.Mesh,
    name: str,
    colours: np.ndarray,
    domain: str = "POINT",
    data_type: str = "FLOAT_COLOR",
) -> None:
    """Write colours in linear light, (n, 3) or (n, 4), as a colour attribute; grey where they are nan."""
    colours = np.column_stack(
        [colours[:, :3], colours[:, 3] if colours.shape[1] > 3 else np.ones(len(colours))]
    )
    colours = np.where(np.isnan(colours), [UNMATCHED_GREY, UNMATCHED_GREY, UNMATCHED_GREY, 1.0], colours)
    old = mesh.color_attributes.get(name)
    if old and (old.domain, old.data_type) != (domain, data_type):
        mesh.color_attributes.remove(old)
        old = None
    layer = old or mesh.color_attributes.new(name=name, type=data_type, domain=domain)
    layer.data.foreach_set("color", colours.astype(np.float32).ravel())


UNMATCHED_GREY = 0.2  # Vertices without an image have this linear light, a middle grey on the screen.


def write_materials(obj: bpy.types.Object, giver: bpy.types.Object, index: np.ndarray) -> None:
    """Give the materials of the giver in place of the own ones; faces without an image take the first."""
    obj.data.materials.clear()
    for slot in giver.material_slots:
        obj.data.materials.append(slot.material)
    for slot in obj.material_slots:
        slot.link = "DATA"
    obj.data.polygons.foreach_set("material_index", np.maximum(index, 0).astype(np.int32))
