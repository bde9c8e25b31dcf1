"""What the user chooses, kept with the scene."""

import bpy
from bpy.props import BoolProperty, EnumProperty, PointerProperty

from . import meshes


def _is_mesh(_, obj: bpy.types.Object) -> bool:
    return obj.type == "MESH"


class IsomatchSettings(bpy.types.PropertyGroup):
    """The two objects, how they are matched, and what is carried."""

    source: PointerProperty(
        name="Source", type=bpy.types.Object, poll=_is_mesh, description="Object whose points get an image"
    )
    target: PointerProperty(
        name="Target", type=bpy.types.Object, poll=_is_mesh, description="Object that the images lie on"
    )
    use_landmarks: BoolProperty(
        name="Use Landmarks",
        description="Child empties, and vertex groups of one vertex, that have the same name on both lead the match",
    )
    hold_landmarks: BoolProperty(
        name="Hold Exactly",
        description="Each landmark is mapped exactly to its partner, and the map around follows",
    )
    either_side: BoolProperty(
        name="Allow Mirror Image", description="A map may also exchange left and right, if that fits better"
    )
    modifiers: EnumProperty(
        name="Shape",
        items=[
            ("IGNORE", "Without Modifiers", "The mesh before modifiers, at the basis of its shape keys"),
            (
                "APPLY",
                "As Shown",
                "The mesh with its modifiers. They must not change the vertices of the receiver",
            ),
        ],
    )
    show: EnumProperty(
        name="Show",
        items=[
            ("MAP", "Map", "Corresponding points have the same colour"),
            ("ERROR", "Expected Error", "The source is bright where the map is less sure"),
        ],
    )
    receiver: EnumProperty(
        name="Receiver",
        items=[
            ("SOURCE", "To Source", "The source receives what the target has"),
            ("TARGET", "To Target", "The target receives what the source has"),
        ],
    )
    data: EnumProperty(
        name="Data",
        description="Shift-click for several",
        options={"ENUM_FLAG"},
        items=[
            (meshes.GROUPS, "Vertex Groups", "Weights of rigs and masks", "GROUP_VERTEX", 1),
            (meshes.KEYS, "Shape Keys", "Turned with the surface, and scaled with it", "SHAPEKEY_DATA", 2),
            (meshes.UVS, "UV Maps", "With their seams", "GROUP_UVS", 4),
            (meshes.COLOURS, "Colours", "Colour attributes", "GROUP_VCOL", 8),
            (meshes.MATERIALS, "Materials", "They take the place of the receiver's", "MATERIAL", 16),
            ("LANDMARKS", "Landmarks", "Child empties, and vertex groups of one vertex", "EMPTY_AXIS", 32),
        ],
        default={meshes.GROUPS, meshes.KEYS, meshes.UVS, "LANDMARKS"},
    )
    replace_landmarks: BoolProperty(
        name="Replace Landmarks",
        description="Landmarks that the receiver already has by that name are placed anew",
    )
    own_copy: BoolProperty(
        name="Own Copy of Shared Mesh",
        description="An object that shares its mesh with others gets a copy first, so that these stay as they are",
    )


def register() -> None:
    """Add the settings to every scene."""
    bpy.utils.register_class(IsomatchSettings)
    bpy.types.Scene.isomatch = PointerProperty(type=IsomatchSettings)


def unregister() -> None:
    """Undo `register`."""
    del bpy.types.Scene.isomatch
    bpy.utils.unregister_class(IsomatchSettings)
