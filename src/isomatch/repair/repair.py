"""Repair: defects of a mesh removed, with index maps both ways and the attributes of an asset."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar, cast

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError, SettingError
from isomatch.io import Asset, SurfaceLike, asset_from, mesh_from, read_asset, read_mesh
from isomatch.repair.carried import carried
from isomatch.repair.check import MENDED, OPENING, MeshReport, has_any
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
    part_limbs,
    tell_winding,
    wind,
)
from isomatch.surfaces import Mesh, PointCloud, first_equal

T = TypeVar("T")


@dataclass(frozen=True, eq=False, repr=False)
class Repair:
    """A mended mesh, and the relation of its indices to those of the original.

    Parameters
    ----------
    mesh : Mesh
        The mended mesh; the original object if nothing was changed.
    vertex_index : (n_new,) array of int
        Original vertex of each new vertex: ``mesh.vertices == original.vertices[vertex_index]``, but where limbs were
        parted.
    new_index : (n_old,) array of int
        New vertex of each original vertex: for a welded vertex the one it was welded onto, for a removed vertex -1, for
        one that became several one of them: of two, that with more faces.
    face_index : (m_new,) array of int
        Original face of each new face.
    changes : tuple of str
        What was changed, with counts, one phrase for each kind of change; empty if nothing was changed.
    asset : Asset, optional
        Unless a mesh was given: what was, mended, with all its values and the rest of its document. A polygon that loses
        a triangle, or of which some are turned over, becomes its triangles.
    polygon_index : (p_new,) array of int, optional
        Original polygon of each of its polygons.
    contacts : tuple of (s,) array of int
        Original vertices at which limbs were parted, of each place where they had been merged.
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
    opening: float = OPENING,
    without_base: bool = False,
    report: MeshReport | None = None,
) -> Repair:
    """Mend a mesh: weld, remove faces and vertices that are not part of a surface, and orient the faces outward.

    The steps are, in this order:

    1. Vertices at the same position, or as near as is asked for, are welded onto the first of them; vertices on the
       middle of an edge of the boundary (T-junctions) are inserted into it.
    2. Faces are removed that have an index out of range, a non-finite or a repeated vertex, or the vertices of an
       earlier face.
    3. Non-finite vertices, and vertices that no face uses, are removed.
    4. Each orientable piece is wound consistently: outward if it is closed, or if flat discs with the lengths of its
       boundary loops have at most a tenth of its area; otherwise as most of its faces were, as is a void: a closed piece
       that looks inward, inside a solid.
    5. Vertices at which limbs that touch were merged by distance become two, each with the faces of one limb, and move
       apart by a quarter of the mean edge length. The second ones follow the others; holes that the merge left remain.
    6. If asked for, only the outermost surface is kept, and what is above the rim of a base.

    Of points without faces, those far from all others are removed.

    Vertices and faces keep their order, and no other vertex moves. A second repair changes nothing but, perhaps,
    chambers, and edges on which parted vertices have come to lie.

    Parameters
    ----------
    mesh : Mesh, Asset, path_like, tuple or object
        An asset, or anything that `mesh_from` takes; its arrays may contain anything.
    weld : bool or float
        Whether to weld coincident vertices, such as the seams of texture maps; or a distance, in mesh units, within which
        vertices are one, see `MeshReport.weld_tolerance`. Two sheets that touch at a vertex are
        joined there. Of values that differ the first is kept, but texture coordinates become those of corners. The parts
        of an asset stay apart.
    remove_duplicates : bool
        Whether to remove faces with the vertices of an earlier face. Where sheets are glued together, such faces are of
        both sheets; see `separate_sheets`.
    remove_unused : bool
        Whether to remove finite vertices that no face uses.
    orient : bool
        Whether to make the winding of the faces consistent.
    unmerge : float
        How far apart limbs that were merged are along the surface at least, in √area; infinity leaves them merged. Only
        where faces are oriented, and not of an asset of several parts.
    outer : bool
        Whether to remove chambers, closed or with small openings, and their walls: the inside of skulls and shells. What
        can be reached from outside stays, such as armpits and ears.
    opening : float
        The smallest opening through which a chamber counts as outside: the diameter of a ball that can be rolled in, in
        √area.
    without_base : bool
        Whether to cut off the largest planar piece along its rim, with what is below: a plate that a scan has grown into.
    report : MeshReport, optional
        What `check` found on this mesh. If there is nothing to mend, nothing is computed again.

    Notes
    -----
    O(n log n) time and O(n) memory, as `check`. Faces of zero area with three different positions are kept, because
    removing them would tear the surface. Non-manifold edges and vertices, holes and one-sided surfaces are left as they
    are; `check` reports them.

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
    _require_options(weld, orient, unmerge, outer)
    asset, lost = _asset_of(mesh)
    whole = mesh_from(mesh) if asset is None else Mesh(asset.placed_points, asset.polygons.triangles)
    given, parts = Draft.of(whole, asset), asset.parts if asset else ()
    plain = isinstance(weld, bool) and unmerge >= SHEET_DISTANCE and not (outer or without_base)
    if report and plain and not has_any(report, MENDED):
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
    # rewound faces that were cut off do not count
    told = tell_winding(replace(cut, notes=mended.notes))
    notes = (*told.notes, *cut.notes[len(mended.notes) :])
    if cut.asset is None or not notes:
        return _repair_of(cut, lost + notes, asset)
    after, polygon_index, kept = carried(cut.asset, cut, onto=closed.trace.current)
    return _repair_of(cut, (*lost, *notes, *kept), after, polygon_index)


def _require_options(weld: bool | float, orient: bool, unmerge: float, outer: bool) -> None:
    """Raise `SettingError` for options that make no sense."""
    if not (isinstance(unmerge, int | float) and unmerge >= 0):
        raise SettingError(f"unmerge = {unmerge!r} is not a distance; give 0 or more, in √area, or infinity")
    if outer and not orient:
        raise SettingError("outer needs faces that look outward; leave orient at True")
    if not (isinstance(weld, bool) or (isinstance(weld, int | float) and 0 <= weld < np.inf)):
        raise SettingError(
            f"weld = {weld!r} is no distance; give True, False, or 0 or more in the units of the mesh"
        )


def _repair_of(
    draft: Draft, changes: tuple[str, ...], asset: Asset | None, polygon_index: IntArray | None = None
) -> Repair:
    """Report a draft; the polygons of an asset are the given ones unless others are named."""
    faces, trace = draft.given_face[draft.faces], draft.trace
    if asset and polygon_index is None:
        polygon_index = np.arange(len(asset.polygons))
    return Repair(
        draft.mesh, trace.given, trace.current, faces, changes, asset, polygon_index, draft.contacts
    )


def _asset_of(surface: SurfaceLike) -> tuple[Asset | None, tuple[str, ...]]:
    """Return what has attributes, None for bare meshes; and what is lost of a file whose attributes cannot be read."""
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
    """Weld the vertices of a mesh at exactly the same position, and change nothing else; returns also how.

    The surface itself and None if no two vertices coincide, if it is no mesh, or if it has coordinates that are not
    finite or faces without vertices, which `check` reports. Faces that vanish or double are left out. O(n log n) time,
    in which only hashes are sorted.
    """
    if not (weld and isinstance(surface, Mesh)):
        return surface, None
    first, faces = first_equal(surface.vertices), surface.faces
    is_sound = np.isfinite(surface.vertices).all() and ((faces >= 0) & (faces < surface.n_vertices)).all()
    if (first[1:] > first[:-1]).all() or not is_sound:
        return surface, None
    seams = repair(surface, remove_unused=False, orient=False)
    return cast(T, seams.mesh), seams
