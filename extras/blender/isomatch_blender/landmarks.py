"""Landmarks in Blender: empties that are children of the object, and its vertex groups of one vertex."""

import re
from typing import NamedTuple

import bpy
import numpy as np

from .meshes import Refused, members, mesh_of, write_group

# A landmark farther from its surface, in √area, is refused, as in landmark files.
MAX_LANDMARK_DISTANCE = 0.1
EMPTY_SIZE = 0.03  # The empties of landmarks are made this large, in √area.


class Mark(NamedTuple):
    """A landmark of an object: its name, its position in the object's coordinates, and whether it is an empty."""

    name: str
    position: np.ndarray
    is_empty: bool


def marks_of(obj: bpy.types.Object, with_modifiers: bool = False) -> list[Mark]:
    """Find the landmarks of an object.

    Raises
    ------
    Refused
        If two of them have the same name, or the object has the scale 0.
    """
    bpy.context.view_layer.update()  # so that matrices are of now
    try:
        to_local = obj.matrix_world.inverted()
    except ValueError:
        raise Refused(f"{obj.name} has the scale 0, so nothing can be placed on it") from None
    marks = [
        Mark(plain(child.name), np.array(to_local @ child.matrix_world.translation), True)
        for child in obj.children
        if child.type == "EMPTY" and child.instance_type == "NONE"
    ]
    with mesh_of(obj, with_modifiers) as mesh:
        within = members(mesh)
        for group in obj.vertex_groups:
            vertices = within.get(group.index, ())
            if len(vertices) == 1:
                marks.append(Mark(group.name, np.array(mesh.vertices[vertices[0]].co), False))
    names = [mark.name for mark in marks]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise Refused(f"{obj.name} has several landmarks named {', '.join(twice)}; rename them")
    return marks


def plain(name: str) -> str:
    """Return a name without the number by which Blender tells objects of the same name apart."""
    return re.sub(r"\.\d{3,}$", "", name)


def shared(source: list[Mark], target: list[Mark]) -> list[tuple[Mark, Mark]]:
    """Pairs of landmarks of the same name, in the order of the source."""
    by_name = {mark.name: mark for mark in target}
    return [(mark, by_name[mark.name]) for mark in source if mark.name in by_name]


def require_near(obj: bpy.types.Object, surface, marks: list[Mark]) -> None:
    """Raise `Refused` if landmarks are far from a surface."""
    from isomatch.surfaces import nearest_on_surface

    positions = np.array([mark.position for mark in marks])
    nearest = nearest_on_surface(surface, positions).interpolated(surface.vertices)
    away = np.linalg.norm(nearest - positions, axis=1) / np.sqrt(surface.area)
    if far := [mark.name for mark, distance in zip(marks, away) if distance > MAX_LANDMARK_DISTANCE]:
        raise Refused(
            f"landmarks of {obj.name} are not on its surface: {', '.join(far)}; move or unparent them"
        )


def place(
    obj: bpy.types.Object, surface, marks: list[Mark], carried, replace: bool
) -> tuple[int, list[str], list[str]]:
    """Put carried landmarks on an object.

    Parameters
    ----------
    obj : bpy.types.Object
        The receiver, in object mode.
    surface : isomatch.Mesh
        Its surface.
    marks : list of Mark
        The landmarks that were carried.
    carried : isomatch.Landmarks
        Where they are now, in the coordinates of the receiver.
    replace : bool
        Whether landmarks that the receiver has by these names are placed anew; otherwise they stay.

    Returns
    -------
    int, list of str, list of str
        How many were placed, the names of those that stayed, and of those that have no place.
    """
    own = {plain(child.name): child for child in obj.children if child.type == "EMPTY"}
    within = members(obj.data)
    groups = {group.name for group in obj.vertex_groups if within.get(group.index)}
    placed, stayed, nowhere = 0, [], []
    for mark, position, error in zip(marks, carried.positions, carried.expected_error):
        there = mark.name in (own if mark.is_empty else groups)
        if there and not replace:
            stayed.append(mark.name)
        elif not np.isfinite(position).all():
            nowhere.append(mark.name)
        elif mark.is_empty:
            put_empty(obj, own.get(mark.name), mark.name, position, EMPTY_SIZE * np.sqrt(surface.area), error)
            placed += 1
        else:
            weights = np.zeros(len(obj.data.vertices))
            weights[np.linalg.norm(surface.vertices - position, axis=1).argmin()] = 1.0
            write_group(obj, mark.name, weights)
            placed += 1
    return placed, stayed, nowhere


def put_empty(
    obj: bpy.types.Object, empty: bpy.types.Object | None, name: str, position, size: float, error: float
) -> None:
    """Place an empty at a position in the coordinates of an object, as its child; its expected error is a property."""
    if empty is None:
        empty = bpy.data.objects.new(name, None)
        empty.empty_display_type, empty.empty_display_size = "SPHERE", size
        for collection in obj.users_collection:
            collection.objects.link(empty)
    empty.parent, empty.parent_type = obj, "OBJECT"
    empty.matrix_parent_inverse.identity()
    empty.location = position
    if np.isfinite(error):
        empty["expected_error"] = float(error)
