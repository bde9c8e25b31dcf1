"""Matches of two objects: planned, kept until another file is loaded, and used."""

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from . import landmarks, meshes
from .job import Job
from .meshes import Refused

COLOURS, ERRORS = meshes.SHOWING_PREFIX + "map", meshes.SHOWING_PREFIX + "error"
LARGE_ERROR = 0.05  # The ramp is brightest at this expected error, in √area, where the confidence is ½.
# The ramp leads from dark blue by grey to yellow, in linear light.
RAMP = np.array([[0.01, 0.03, 0.09], [0.18, 0.18, 0.16], [0.85, 0.70, 0.06]])
MAX_SCALE_RATIO = 1.01  # An object with a larger ratio of scales is named.


@dataclass(frozen=True)
class Kept:
    """A result, and whether it is of the objects with their modifiers."""

    result: Any
    with_modifiers: bool


running: Job | None = None
_kept: dict[tuple[int, int], Kept] = {}


def _key(source: bpy.types.Object, target: bpy.types.Object) -> tuple[int, int]:
    return source.data.session_uid, target.data.session_uid


def keep(source: bpy.types.Object, target: bpy.types.Object, result, with_modifiers: bool) -> None:
    """Keep the result of a match until another file is loaded."""
    _kept[_key(source, target)] = Kept(result, with_modifiers)


def kept(source: bpy.types.Object | None, target: bpy.types.Object | None) -> Kept | None:
    """Return what was kept of two objects."""
    return _kept.get(_key(source, target)) if source and target else None


@persistent
def _forget(*_) -> None:
    _kept.clear()


def register() -> None:
    """Forget maps when another file is loaded."""
    bpy.app.handlers.load_post.append(_forget)


def unregister() -> None:
    """Undo `register`, and end a match that is under way."""
    global running
    if running:
        running.cancel()
        running = None
    bpy.app.handlers.load_post.remove(_forget)
    _forget()


def surface_of(asset):
    """Return the surface of an asset whose vertices are those of Blender."""
    from isomatch import Mesh

    return Mesh(asset.points, asset.polygons.triangles)


def planned(source: bpy.types.Object, target: bpy.types.Object, settings) -> tuple[tuple, list[str]]:
    """Read two objects and return what a `Job` is made of, and what is to be known of the match.

    Raises
    ------
    Refused
        If the objects or their landmarks cannot be used.
    """
    from isomatch import Config, nearest_landmarks

    with_modifiers = settings.modifiers == "APPLY"
    notes = [note for obj in (source, target) for note in notes_of(obj, with_modifiers)]
    surfaces = [surface_of(meshes.asset_of(obj, with_modifiers)) for obj in (source, target)]
    pairs = None
    if settings.use_landmarks:
        both = landmarks.shared(*(landmarks.marks_of(obj, with_modifiers) for obj in (source, target)))
        if len(both) < 3:
            raise Refused(
                f"{source.name} and {target.name} share {len(both)} landmarks; give both at least three of the same "
                "names, as child empties or vertex groups of one vertex, or match without"
            )
        sides = list(zip(*both))
        for obj, surface, marks in zip((source, target), surfaces, sides):
            landmarks.require_near(obj, surface, list(marks))
        pairs = nearest_landmarks(*surfaces, *([mark.position for mark in side] for side in sides))
        notes.append(f"{len(both)} landmarks used")
    config = Config(
        orientation="any" if settings.either_side else "preserve",
        pin=0.0 if settings.use_landmarks and settings.hold_landmarks else None,
    )
    return (*surfaces, pairs, config), notes


def notes_of(obj: bpy.types.Object, with_modifiers: bool) -> list[str]:
    """Return what a match does not see of an object."""
    notes = []
    hidden = [modifier.name for modifier in obj.modifiers if modifier.show_viewport]
    if hidden and not with_modifiers:
        notes.append(f"{obj.name} is matched without its modifiers ({', '.join(hidden)})")
    scales = np.abs(obj.matrix_world.to_scale())
    if scales.max() > MAX_SCALE_RATIO * scales.min():
        notes.append(f"{obj.name} is scaled unevenly, which is not seen: apply the scale")
    return notes


@dataclass(frozen=True)
class Pair:
    """Two objects with the map between them, as they are now.

    Parameters
    ----------
    source, target : bpy.types.Object
        The objects.
    result : isomatch.MatchResult
        Source → target.
    with_modifiers : bool
        Whether it is of the objects with their modifiers.
    """

    source: bpy.types.Object
    target: bpy.types.Object
    result: Any
    with_modifiers: bool

    @classmethod
    def of(cls, source: bpy.types.Object, target: bpy.types.Object) -> "Pair":
        """Take what was kept of two objects; `Refused` if there is nothing, or the meshes have changed."""
        found = kept(source, target)
        if found is None:
            raise Refused(f"there is no map from {source.name} to {target.name} yet; match them first")
        pair = cls(source, target, found.result, found.with_modifiers)
        hashes = found.result.map.source_hash, found.result.map.target_hash
        for obj, matched in zip((source, target), hashes):
            if surface_of(pair.asset(obj)).content_hash != matched:
                raise Refused(f"the mesh of {obj.name} has changed since it was matched; match again")
        return pair

    def asset(self, obj: bpy.types.Object, data: frozenset[str] = frozenset()):
        """Return the asset of one of the two."""
        return meshes.asset_of(obj, self.with_modifiers, data)

    def show(self, what: str) -> list[bpy.types.Object]:
        """Write colours that correspond to both meshes, or the expected error to the source; return where."""
        from isomatch.visualization import position_colours

        if what == "ERROR":
            shares = np.clip(self.result.expected_error / LARGE_ERROR, 0, 1)
            stops = np.linspace(0, 1, len(RAMP))
            colours = {self.source: np.column_stack([np.interp(shares, stops, RAMP[:, i]) for i in range(3)])}
        else:
            own = position_colours(surface_of(self.asset(self.target)))
            colours = {self.source: self.result.map.pull_back(own), self.target: own}
        name = ERRORS if what == "ERROR" else COLOURS
        for obj, values in colours.items():
            self.require_writable(obj)
            meshes.write_colours(obj.data, name, values)
            layers = obj.data.color_attributes
            layers.active_color = layers[name]
            layers.render_color_index = layers.find(name)
        return list(colours)

    def carry(
        self, to: str, data: frozenset[str], replace_landmarks: bool = False
    ) -> tuple[list[str], list[str]]:
        """Carry data from one of the two objects to the other.

        Parameters
        ----------
        to : {"SOURCE", "TARGET"}
            Which one receives.
        data : set of str
            Kinds of data, as for `meshes.asset_of`, and "LANDMARKS".
        replace_landmarks : bool
            Whether landmarks that are there already are placed anew.

        Returns
        -------
        list of str, list of str
            What was carried, and what is to be known of it.

        Raises
        ------
        Refused, isomatch.IsomatchError
            If there is nothing to carry, or it cannot be written.
        """
        from isomatch import Landmarks, carry_attributes, carry_landmarks

        side = to.lower()
        receiver, giver = (self.source, self.target) if to == "SOURCE" else (self.target, self.source)
        self.require_writable(receiver)
        assets = {receiver: self.asset(receiver), giver: self.asset(giver, data)}
        ends = assets[self.source], assets[self.target]
        found = None
        if assets[giver].attributes:
            meshes.require_room(receiver, assets[giver])
            found = carry_attributes(self.result.map, *ends, to=side, numbers_as="values")
        marks = landmarks.marks_of(giver, self.with_modifiers) if "LANDMARKS" in data else []
        if marks:
            landmarks.require_near(giver, surface_of(assets[giver]), marks)
            given = Landmarks([mark.position for mark in marks], [mark.name for mark in marks])
            carried = carry_landmarks(self.result, *ends, given, to=side)
        done, notes = [], []  # nothing is written before
        if found:
            with meshes.mesh_of(giver, self.with_modifiers) as mesh:
                groups = [group.name for group in meshes.many_vertex_groups(giver, mesh)]
            done += meshes.write(receiver, found.asset, giver, data, groups)
            notes += found.notes
            notes += [f"vertices without image: {found.unmatched}"] if found.unmatched else []
        if marks:
            n, stayed, nowhere = landmarks.place(
                receiver, surface_of(assets[receiver]), marks, carried, replace_landmarks
            )
            done += [meshes.counted(n, "landmark")] if n else []
            notes += [f"landmarks that were there stay: {', '.join(stayed)}"] if stayed else []
            notes += [f"landmarks without image: {', '.join(nowhere)}"] if nowhere else []
        if not done and not notes:
            raise Refused(f"{giver.name} has nothing of what is chosen; {receiver.name} stays as it is")
        return done, notes

    def morph(self) -> bpy.types.ShapeKey:
        """Make a shape key of the source that is the target's surface, in the coordinates of the target."""
        self.require_writable(self.source)
        ends = (surface_of(self.asset(obj)) for obj in (self.source, self.target))
        vertices = self.result.as_mesh(*ends).vertices
        if not self.source.data.shape_keys:
            self.source.shape_key_add(name="Basis", from_mix=False)
        key = self.source.shape_key_add(name=self.target.name, from_mix=False)
        key.data.foreach_set("co", vertices.astype(np.float32).ravel())
        return key

    def require_writable(self, obj: bpy.types.Object) -> None:
        """Raise `Refused` if the mesh of an object cannot be written, or has other vertices than were matched."""
        if not obj.data.is_editable:
            raise Refused(f"the mesh of {obj.name} is linked from another file; make it local")
        if obj.mode != "OBJECT":
            raise Refused(f"{obj.name} is in {obj.mode.lower()} mode in another scene; leave that mode")
        with meshes.mesh_of(obj, self.with_modifiers) as mesh:
            counts = [(len(each.vertices), len(each.loops)) for each in (mesh, obj.data)]
        if counts[0] != counts[1]:
            raise Refused(
                f"modifiers change the vertices of {obj.name}, which is to receive; apply them, or match without "
                "modifiers"
            )
