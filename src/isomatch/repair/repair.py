"""Remove defects of a mesh, with index maps both ways, and carry the attributes of an asset."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar, cast

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError, SettingError
from isomatch.io import Asset, SurfaceLike, asset_from, mesh_from, read_asset, read_mesh
from isomatch.repair.carry import carry_asset
from isomatch.repair.check import OPENING_DIAMETER, REPAIRED_DEFECTS, MeshReport, has_any
from isomatch.repair.draft import Draft, Step, run
from isomatch.repair.sheets import SHEET_DISTANCE
from isomatch.repair.steps import (
    close_gaps,
    drop_base,
    drop_chambers,
    drop_non_finite,
    drop_outliers,
    drop_unsound_faces,
    drop_unused,
    drop_welded,
    note_winding,
    part_limbs,
    wind,
)
from isomatch.surfaces import Mesh, PointCloud, first_equal

T = TypeVar("T")


@dataclass(frozen=True, eq=False, repr=False)
class Repair:
    """A repaired mesh, and index maps between it and the original.

    Parameters
    ----------
    mesh : Mesh
        The repaired mesh; the original object if nothing was changed.
    vertex_index : (n_new,) array of int
        Original vertex of each new vertex: ``mesh.vertices == original.vertices[vertex_index]``, except
        where limbs were parted.
    new_index : (n_old,) array of int
        New vertex of each original vertex: the one that it was welded onto, -1 if it was removed, and of
        several copies the one with the most faces.
    face_index : (m_new,) array of int
        Original face of each new face.
    changes : tuple of str
        What was changed, with counts, one phrase for each kind of change; empty if nothing was changed.
    asset : Asset, optional
        The repaired asset, with all values and the rest of its document, unless a mesh was given. A
        polygon that loses triangles, or has some turned over, becomes triangles.
    polygon_index : (p_new,) array of int, optional
        Original polygon of each of its polygons.
    contacts : tuple of (s,) array of int
        Original vertices of each place where merged limbs were parted.
    """

    mesh: Mesh
    vertex_index: IntArray
    new_index: IntArray
    face_index: IntArray
    changes: tuple[str, ...]
    asset: Asset | None = None
    polygon_index: IntArray | None = None
    contacts: tuple[IntArray, ...] = ()

    def __repr__(self) -> str:
        return f"Repair({self.mesh!r}, changes={list(self.changes)})"


def repair(
    mesh: SurfaceLike,
    *,
    weld: bool | float = True,
    remove_duplicates: bool = True,
    remove_unused: bool = True,
    orient: bool = True,
    unmerge: float = SHEET_DISTANCE,
    outer: bool = False,
    opening: float = OPENING_DIAMETER,
    without_base: bool = False,
    report: MeshReport | None = None,
) -> Repair:
    """Repair a mesh: weld it, remove what is not part of a surface, and orient the faces outward.

    The steps are, in this order:

    1. Vertices at the same position, or within a given distance, are welded onto the first of them.
       Vertices on the middle of a boundary edge (T-junctions) are inserted into it.
    2. Faces with an index out of range, a non-finite or repeated vertex, or the vertices of an earlier
       face are removed.
    3. Non-finite vertices, and vertices that no face uses, are removed.
    4. Each orientable piece is wound consistently: outward if it is closed, or if flat discs with the
       lengths of its boundary loops have at most a tenth of its area. Other pieces keep the winding of
       most of their faces, as does a void: a closed piece inside a solid that looks inward.
    5. Vertices where touching limbs were merged by distance become two, one for each limb, and move
       apart by a quarter of the mean edge length. The new vertices come last; holes of the merge remain.
    6. On request, only the outermost surface is kept, or what is above the rim of a base.

    If there are no faces, points far from all others are removed.

    Vertices and faces keep their order, and no other vertex moves. A second repair changes nothing,
    except perhaps chambers, and edges that parted vertices have moved onto.

    Parameters
    ----------
    mesh : Mesh, Asset, path_like, tuple or object
        An asset, or anything that `mesh_from` takes; its arrays may contain anything.
    weld : bool or float
        Whether to weld coincident vertices, such as the seams of texture maps; or a distance, in mesh
        units, within which vertices are welded, see `MeshReport.weld_tolerance`. Two sheets that touch
        at a vertex are joined there. Where values differ, the first one is kept, but texture coordinates
        move to corners. The parts of an asset are not joined.
    remove_duplicates : bool
        Whether to remove faces with the vertices of an earlier face. Where sheets are glued together,
        such faces belong to both sheets; see `separate_sheets`.
    remove_unused : bool
        Whether to remove finite vertices that no face uses.
    orient : bool
        Whether to make the winding of the faces consistent.
    unmerge : float
        Smallest distance along the surface, in √area, between merged limbs that are parted; infinity
        parts none. Needs ``orient``, and an asset of one part.
    outer : bool
        Whether to remove chambers that are closed or have small openings, with their walls: the inside of
        skulls and shells. What can be reached from outside stays, such as armpits and ears.
    opening : float
        Smallest opening, in √area, through which a chamber counts as outside: the diameter of a ball that
        can be rolled in.
    without_base : bool
        Whether to cut off the largest planar piece along its rim, and what is below it: a plate that a
        scan has grown into.
    report : MeshReport, optional
        Result of `check` for this mesh. If there is nothing to repair, nothing is computed again.

    Notes
    -----
    O(n log n) time and O(n) memory, like `check`. Faces of zero area with three different positions are
    kept, because removing them would tear the surface. Non-manifold edges and vertices, holes and
    one-sided surfaces are left as they are; `check` reports them.

    Examples
    --------
    Two triangles whose common edge has separate vertices for each of them, the second one wound the other way:

    >>> points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    >>> mended = repair(Mesh(points, [[0, 1, 2], [3, 4, 5]]))
    >>> mended.mesh.faces.tolist(), mended.new_index.tolist()
    ([[0, 1, 2], [1, 3, 2]], [0, 1, 2, 1, 2, 3])
    >>> mended.changes
    ('welded 2 vertices onto an earlier vertex at the same position', 'rewound 1 face')
    """
    if not (isinstance(unmerge, int | float) and unmerge >= 0):
        raise SettingError(f"unmerge = {unmerge!r} is not a distance; give 0 or more, in √area, or infinity")
    if outer and not orient:
        raise SettingError("outer needs faces that look outward; leave orient at True")
    if not (isinstance(weld, bool) or (isinstance(weld, int | float) and 0 <= weld < np.inf)):
        raise SettingError(
            f"weld = {weld!r} is no distance; give True, False, or 0 or more in the units of the mesh"
        )
    asset, lost = _asset_of(mesh)
    whole = mesh_from(mesh) if asset is None else Mesh(asset.placed_points, asset.polygons.triangles)
    given, parts = Draft.of(whole, asset), asset.parts if asset else ()
    is_plain = isinstance(weld, bool) and unmerge >= SHEET_DISTANCE and not (outer or without_base)
    if report and is_plain and not has_any(report, REPAIRED_DEFECTS):
        return _repair_of(given, lost, asset)
    insert = not parts and (report is None or weld is not True or len(report.t_junctions) > 0)
    closed = close_gaps(given, weld, insert)
    steps: list[Step] = [partial(drop_unsound_faces, keep_duplicates=not remove_duplicates)]
    steps += [drop_non_finite, drop_welded]
    steps += [drop_unused if whole.n_faces else drop_outliers] if remove_unused else []
    steps += [wind] if orient else []
    steps += [partial(part_limbs, least_distance=unmerge)] if orient and len(parts) < 2 else []
    cuts: list[Step] = [partial(drop_chambers, opening=opening)] if outer else []
    cuts += [drop_base] if without_base else []
    mended = run(closed, *steps)
    cut = run(mended, *cuts)
    # Faces that were wound again and then cut off are not counted.
    noted = note_winding(replace(cut, notes=mended.notes))
    notes = (*noted.notes, *cut.notes[len(mended.notes) :])
    if cut.asset is None or not notes:
        return _repair_of(cut, lost + notes, asset)
    after, polygon_index, kept = carry_asset(cut.asset, cut, onto=closed.trace.current)
    return _repair_of(cut, (*lost, *notes, *kept), after, polygon_index)


def _repair_of(
    draft: Draft, changes: tuple[str, ...], asset: Asset | None, polygon_index: IntArray | None = None
) -> Repair:
    """Make the result of a draft; by default, the polygons of the asset are the given ones."""
    faces, trace = draft.given_face[draft.faces], draft.trace
    if asset and polygon_index is None:
        polygon_index = np.arange(len(asset.polygons))
    return Repair(
        draft.mesh, trace.given, trace.current, faces, changes, asset, polygon_index, draft.contacts
    )


def _asset_of(surface: SurfaceLike) -> tuple[Asset | None, tuple[str, ...]]:
    """Return the asset of a surface, None for a bare mesh, and notes on attributes that cannot be read."""
    if isinstance(surface, Asset):
        return surface, ()
    if isinstance(surface, str | os.PathLike):
        try:
            return read_asset(surface, sound=False), ()
        except FormatError as error:
            return Asset.of_mesh(read_mesh(surface)), (f"left out all but points and faces, as {error}",)
    if isinstance(surface, Mesh | PointCloud | tuple):
        return None, ()
    return asset_from(surface, sound=False), ()


def without_seams(surface: T, weld: bool = True) -> tuple[T, Repair | None]:
    """Weld vertices of a mesh at exactly the same position; return also the repair.

    Nothing else changes, but faces that vanish or double are left out. Returns the surface itself and
    None if no two vertices coincide, if it is no mesh, or if it has non-finite coordinates or faces
    without vertices, which `check` reports. O(n log n) time, in which only hashes are sorted.
    """
    if not (weld and isinstance(surface, Mesh)):
        return surface, None
    first, faces = first_equal(surface.vertices), surface.faces
    is_sound = np.isfinite(surface.vertices).all() and ((faces >= 0) & (faces < surface.n_vertices)).all()
    if (first[1:] > first[:-1]).all() or not is_sound:
        return surface, None
    seams = repair(surface, remove_unused=False, orient=False)
    return cast(T, seams.mesh), seams
