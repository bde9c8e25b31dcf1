"""Repair: defects of a mesh removed, with index maps both ways and the attributes of an asset."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar, cast

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, IntArray
from isomatch._core.errors import FormatError, SettingError
from isomatch.io import (
    Asset,
    Attribute,
    Polygons,
    Renumbering,
    SurfaceLike,
    asset_from,
    mesh_from,
    read_asset,
    read_mesh,
)
from isomatch.repair._winding import wound_outward
from isomatch.repair.base import base_of
from isomatch.repair.check import OPENING, MeshReport
from isomatch.repair.gaps import first_within, without_t_junctions
from isomatch.repair.merged import unmerged
from isomatch.repair.outliers import outliers
from isomatch.repair.sheets import SHEET_DISTANCE
from isomatch.surfaces import Mesh, PointCloud, UnsoundFaces, first_equal, unsound_faces

T = TypeVar("T")
MENDED = (
    *("non_finite_vertices", "out_of_range_faces", "repeated_index_faces", "duplicate_faces"),
    *("unused_vertices", "coincident_vertices", "inconsistent_edges", "inward_components"),
    *("merged_vertices", "t_junctions", "outliers"),
)
"""Fields of `MeshReport` with defects that a repair removes."""


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
    if not (isinstance(unmerge, int | float) and unmerge >= 0):
        raise SettingError(f"unmerge = {unmerge!r} is not a distance; give 0 or more, in √area, or infinity")
    if outer and not orient:
        raise SettingError("outer needs faces that look outward; leave orient at True")
    if not (isinstance(weld, bool) or (isinstance(weld, int | float) and 0 <= weld < np.inf)):
        raise SettingError(
            f"weld = {weld!r} is no distance; give True, False, or 0 or more in the units of the mesh"
        )
    asset, lost = _asset_of(mesh)
    mesh = mesh_from(mesh) if asset is None else Mesh(asset.placed_points, asset.polygons.triangles)
    identity = np.arange(mesh.n_vertices)
    if (
        report
        and not (outer or without_base)
        and isinstance(weld, bool)
        and unmerge >= SHEET_DISTANCE
        and not any(len(getattr(report, defect)) for defect in MENDED)
    ):
        same = None if asset is None else np.arange(len(asset.polygons))
        return Repair(mesh, identity, identity, np.arange(mesh.n_faces), lost, asset, same)
    places = mesh.vertices
    if asset is not None and len(asset.parts) > 1:
        places = np.column_stack([places, asset.part_of_point])
    survivor = identity
    if not isinstance(weld, bool):
        survivor = first_within(places, weld)
    elif weld:
        survivor = first_equal(places)
    original, of_triangle = asset, np.arange(mesh.n_faces)
    faces, bad = _welded_faces(mesh, survivor)
    polygons = Polygons.of_triangles(mesh.faces) if asset is None else asset.polygons
    is_sound = np.bincount(polygons.of_triangle, ~bad.any, len(polygons)) > 0
    on_sides = np.zeros(mesh.n_vertices, dtype=bool)
    known = report if weld is True else None
    if (asset is None or not asset.parts) and (known is None or len(known.t_junctions)):
        given = Asset(mesh.vertices, polygons) if asset is None else asset
        whole, on_sides = without_t_junctions(given, survivor, is_sound)
    if on_sides.any():
        # triangles of a polygon with a further corner come from its first one
        of_triangle = np.searchsorted(polygons.of_triangle, whole.polygons.of_triangle)
        mesh, asset = Mesh(mesh.vertices, whole.polygons.triangles), asset and whole
        faces, bad = _welded_faces(mesh, survivor)
    face_index = np.flatnonzero(~bad.any | (bad.duplicate & (not remove_duplicates)))
    faces = faces[face_index]

    finite = np.isfinite(mesh.vertices).all(axis=1)
    welded = survivor != identity
    unused = np.bincount(faces.ravel(), minlength=mesh.n_vertices) == 0
    unused &= finite & ~welded & remove_unused & bool(mesh.n_faces)
    stray = np.zeros(mesh.n_vertices, dtype=bool)
    if not mesh.n_faces and remove_unused:
        stray[finite & ~welded] = outliers(mesh.vertices[finite & ~welded])
    kept = finite & ~welded & ~unused & ~stray
    vertex_index = np.flatnonzero(kept)
    new_index = np.where(kept, np.cumsum(kept) - 1, -1)[survivor]

    mended = Mesh(mesh.vertices[vertex_index], new_index[faces])
    mended, rewound = wound_outward(mended) if orient else (mended, np.zeros(len(faces), dtype=bool))

    contacts: tuple[IntArray, ...] = ()
    if orient and unmerge < np.inf and (asset is None or len(asset.parts) < 2):
        limbs = unmerged(mended, unmerge)
        contacts = tuple(vertex_index[seam] for seam in limbs.seams)
        mended, vertex_index = limbs.mesh, vertex_index[limbs.vertex_index]
        # the winding stopped where limbs were merged, as more than two faces met at an edge there
        if contacts:
            mended, again = wound_outward(mended)
            rewound ^= again

    cut: tuple[str, ...] = ()
    removals: list[tuple[str, Callable[[Mesh], BoolArray]]] = []
    if outer:
        from isomatch.repair.outer import inner_faces  # imports scipy.ndimage, which is slow

        removals.append(("chambers", lambda mesh: inner_faces(mesh, opening)))
    if without_base:
        removals.append(("a base and below its rim", lambda mesh: base_of(mesh).below))
    for what, found in removals:
        gone = found(mended)
        if not gone.any():
            continue
        share = float(mended.face_areas[gone].sum() / mended.area)
        cut += (f"removed {_count(int(gone.sum()), 'face')} of {what}, {share:.1%} of the area",)
        lined = np.setdiff1d(mended.faces[gone], mended.faces[~gone])
        stays = np.ones(mended.n_vertices, dtype=bool)
        stays[lined] = False
        place = np.append(np.where(stays, np.cumsum(stays) - 1, -1), -1)
        mended = Mesh(mended.vertices[stays], place[mended.faces[~gone]])
        vertex_index, new_index = vertex_index[stays], place[new_index]
        face_index, rewound = face_index[~gone], rewound[~gone]

    at = "at the same position" if isinstance(weld, bool) else f"within {weld:g}"
    counted = (
        (f"welded {{}} onto an earlier vertex {at}", "vertex", welded),
        ("inserted {} into edges that they lie on", "vertex", on_sides),
        ("removed {} with a vertex index out of range", "face", bad.out_of_range),
        ("removed {} with a non-finite vertex", "face", bad.non_finite),
        ("removed {} with a repeated vertex", "face", bad.repeated_index),
        ("removed {} with the vertices of an earlier face", "face", bad.duplicate & remove_duplicates),
        ("removed {} with non-finite coordinates", "vertex", ~finite),
        ("removed {} that no face used", "vertex", unused),
        ("removed {} far from all others", "point", stray),
        ("rewound {}", "face", rewound),
    )
    changes = lost + tuple(
        sentence.format(_count(int(mask.sum()), noun)) for sentence, noun, mask in counted if mask.any()
    )
    changes += ((parted_described(contacts),) if contacts else ()) + cut
    if asset is None or not changes:
        same = None if asset is None else np.arange(len(asset.polygons))
        mended = mended if changes else mesh
        face_index = of_triangle[face_index]
        return Repair(mended, vertex_index, new_index, face_index, changes, original, same, contacts)
    apart = welded_apart(asset, survivor)
    rows = Renumbering.of(asset.polygons, vertex_index, new_index, face_index, rewound, mended.faces)
    whole = turned_over(kept_at_corners(asset, apart).renumbered(rows), asset, rows, face_index[rewound])
    if contacts:
        whole = _with_normals(
            whole.placed_at(mended.vertices), mended, np.isin(vertex_index, np.concatenate(contacts))
        )
    told = tuple(_told(asset, name, n) for name, n in apart.items())
    changes += told
    face_index = of_triangle[face_index]
    return Repair(mended, vertex_index, new_index, face_index, changes, whole, rows.polygon_index, contacts)


def _welded_faces(mesh: Mesh, survivor: IntArray) -> tuple[IntArray, UnsoundFaces]:
    """Return the faces between vertices that are one, and which of them are unsound."""
    in_range = ((mesh.faces >= 0) & (mesh.faces < mesh.n_vertices)).all(axis=1)
    faces = mesh.faces.copy()
    faces[in_range] = survivor[faces[in_range]]
    return faces, unsound_faces(mesh.vertices, faces)


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


def _told(asset: Asset, name: str, n: int) -> str:
    welded = _count(n, "welded vertex")
    if goes_to_corners(asset, asset.attribute(name, "point")):
        return f"kept {name} at corners, as it differs at {welded}"
    return f"kept the first value of {name} at {welded} where it differs"


def _with_normals(asset: Asset, mesh: Mesh, rows: BoolArray) -> Asset:
    """Give some points (n,) the normals of a mesh: at merged points those of both limbs had been averaged."""
    if asset.parts:
        return asset
    attributes = []
    for each in asset.attributes:
        if each.kind == "normal" and each.domain == "point":
            values = np.where(rows[:, None], mesh.vertex_normals, each.values).astype(each.values.dtype)
            each = replace(each, values=values)
        attributes.append(each)
    return replace(asset, attributes=tuple(attributes))


def parted_described(contacts: tuple[IntArray, ...]) -> str:
    """Say where limbs were parted, given the vertices of each contact."""
    largest, count = max(contacts, key=len), sum(map(len, contacts))
    return (
        f"parted limbs that were merged at {_count(count, 'vertex')}, in {_count(len(contacts), 'contact')}; the largest "
        f"has {len(largest)}, one of them vertex {largest[len(largest) // 2]}"
    )


def _count(number: int, noun: str) -> str:
    several = noun.replace("vertex", "vertices") if noun.endswith("vertex") else f"{noun}s"
    return f"{number} {noun if number == 1 else several}"


def welded_surface(surface: object) -> Repair | None:
    """Weld the vertices of a mesh at exactly the same position, as `repair` does, and change nothing else.

    None if no two vertices coincide, if it is no mesh, or if it has coordinates that are not finite or faces without
    vertices, which `check` reports. Faces that vanish or double are left out. O(n log n) time, in which only hashes are
    sorted.
    """
    if not isinstance(surface, Mesh):
        return None
    first = first_equal(surface.vertices)
    if (first[1:] > first[:-1]).all():
        return None
    faces = surface.faces
    if not np.isfinite(surface.vertices).all() or ((faces < 0) | (faces >= surface.n_vertices)).any():
        return None
    return repair(surface, remove_unused=False, orient=False)


def without_seams(surface: T, weld: bool = True) -> tuple[T, Repair | None]:
    """Return the welded mesh, and how it was welded; or the surface as it is and None, if there is nothing to weld."""
    seams = welded_surface(surface) if weld else None
    return (cast(T, seams.mesh), seams) if seams else (surface, None)


def welded_apart(asset: Asset, survivor: IntArray) -> dict[str, int]:
    """Count, for each attribute of points, those that are welded onto a point with another value."""
    rows = np.flatnonzero(survivor != np.arange(len(survivor)))
    counts = {}
    for attribute in asset.attributes:
        if attribute.domain != "point" or not len(rows):
            continue
        differ = _differ(attribute.values, rows, survivor[rows])
        if attribute.joints is not None:
            differ |= _differ(attribute.joints, rows, survivor[rows])
        if differ.any():
            counts[attribute.name] = int(differ.sum())
    return counts


def _differ(values: AnyArray, rows: IntArray, others: IntArray) -> BoolArray:
    one, other = values[rows].reshape(len(rows), -1), values[others].reshape(len(rows), -1)
    differ = np.not_equal(one, other)
    if values.dtype.kind == "f":
        differ &= ~(np.isnan(one) & np.isnan(other))
    return np.asarray(differ.any(axis=1))


def goes_to_corners(asset: Asset, attribute: Attribute) -> bool:
    """Whether values of points that differ at welded ones are kept at corners."""
    # texture coordinates of one side of a seam would smear the texture. Normals too have two sides at a sharp edge, and
    # glTF, whose files have parts, splits points for them again
    directed = attribute.kind == "normal" or attribute.is_tangent
    is_free = all((a.name, a.domain) != (attribute.name, "corner") for a in asset.attributes)
    return is_free and (attribute.kind == "uv" or (directed and bool(asset.parts)))


def kept_at_corners(asset: Asset, apart: dict[str, int]) -> Asset:
    """Return the asset before it is welded, with these attributes of points at corners where that keeps both sides."""
    corners = asset.polygons.corners
    inside = np.where((corners >= 0) & (corners < len(asset.points)), corners, 0)
    attributes = tuple(
        a.at(inside, "corner") if a.domain == "point" and a.name in apart and goes_to_corners(asset, a) else a
        for a in asset.attributes
    )
    return replace(asset, attributes=attributes)


def turned_over(asset: Asset, before: Asset, rows: Renumbering, rewound: IntArray) -> Asset:
    """Turn normals over where all faces were, given as the triangles before, unless they agree with them now."""
    if not asset.of_kind("normal") or not len(rewound):
        return asset
    of_face = np.isin(rows.polygon_index, before.polygons.of_triangle[rewound])
    polygons = asset.polygons
    of_corner = of_face[polygons.of_corner]
    corners, n = polygons.corners, len(asset.points)
    n_turned, n_all = (np.bincount(each, minlength=n) for each in (corners[of_corner], corners))
    turned = {"face": of_face, "corner": of_corner, "point": (n_turned > 0) & (n_turned == n_all)}
    mesh = Mesh(asset.placed_points, polygons.triangles)
    first = np.unique(polygons.of_triangle, return_index=True)[1]
    at_points = mesh.vertex_normals
    now = {"face": mesh.face_cross[first], "corner": at_points[polygons.corners], "point": at_points}

    def right(attribute: Attribute) -> Attribute:
        if attribute.kind != "normal":
            return attribute
        placed = asset.placed.attribute(attribute.name, attribute.domain).values
        against = (placed * now[attribute.domain]).sum(axis=1) < 0
        sign = np.where(turned[attribute.domain] & against, -1, 1).astype(attribute.values.dtype)
        return attribute.with_values(attribute.values * sign[:, None]) if (sign < 0).any() else attribute

    return replace(asset, attributes=tuple(map(right, asset.attributes)))
