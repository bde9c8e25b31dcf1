"""The steps of a repair: each takes a draft and returns the next, the same if nothing changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch._core.arrays import BoolArray, IntArray
from isomatch.io import Asset
from isomatch.repair._winding import faces_to_rewind, rewind_faces
from isomatch.repair.base import base_of
from isomatch.repair.draft import Draft, VertexTrace, describe_places
from isomatch.repair.gaps import first_within, insert_t_junctions
from isomatch.repair.merged import part_merged_limbs
from isomatch.repair.outliers import find_outliers
from isomatch.surfaces import Mesh, first_equal, unsound_faces


def close_gaps(draft: Draft, weld: bool | float = True, insert: bool = True) -> Draft:
    """Weld vertices at one place, or within a distance, and insert vertices into sides they lie on."""
    # Welded vertices stay until `drop_welded`, so that an asset keeps its numbers. Vertices of different
    # parts are not welded.
    n, places = draft.mesh.n_vertices, draft.mesh.vertices
    if draft.asset and len(draft.asset.parts) > 1:
        places = np.column_stack([places, draft.asset.part_of_point])
    onto, where = np.arange(n), "at the same position"
    if not isinstance(weld, bool):
        onto, where = first_within(places, weld), f"within {weld:g}"
    elif weld:
        onto = first_equal(places)
    welded = onto != np.arange(n)
    draft = draft.counted(f"welded {{}} onto an earlier vertex {where}", "vertex", welded)
    draft = _insert_on_sides(draft, onto) if insert else draft
    if not welded.any():
        return draft
    mesh = Mesh(draft.mesh.vertices, _renumbered(draft.mesh.faces, onto))
    return draft.made_into(mesh, VertexTrace(np.arange(n), onto))


def _renumbered(faces: IntArray, number: IntArray) -> IntArray:
    """Renumber the corners of faces by ``number`` (n,); faces out of range stay."""
    in_range = ((faces >= 0) & (faces < len(number))).all(axis=1)
    renumbered = faces.copy()
    renumbered[in_range] = number[faces[in_range]]
    return renumbered


def _insert_on_sides(draft: Draft, onto: IntArray) -> Draft:
    """Insert vertices into the sides of polygons that they lie on (T-junctions)."""
    given = draft.asset or Asset.of_mesh(draft.mesh)
    bad = unsound_faces(draft.mesh.vertices, _renumbered(draft.mesh.faces, onto))
    is_sound = np.bincount(given.polygons.of_triangle, ~bad.any, len(given.polygons)) > 0
    whole, inserted = insert_t_junctions(given, onto, is_sound)
    if not inserted.any():
        return draft
    # All triangles of a polygon with a new corner count as made from its first triangle.
    origin = np.searchsorted(given.polygons.of_triangle, whole.polygons.of_triangle)
    return replace(
        draft,
        mesh=Mesh(draft.mesh.vertices, whole.polygons.triangles),
        asset=draft.asset and whole,
        faces=np.arange(len(origin)),
        given_face=draft.given_face[draft.faces][origin],
        rewound=draft.rewound[origin],
    ).counted("inserted {} into edges that they lie on", "vertex", inserted)


def drop_unsound_faces(draft: Draft, keep_duplicates: bool = False) -> Draft:
    """Remove faces that cannot be part of a surface."""
    bad = unsound_faces(draft.mesh.vertices, draft.mesh.faces)
    kinds = {
        "a vertex index out of range": bad.out_of_range,
        "a non-finite vertex": bad.non_finite,
        "a repeated vertex": bad.repeated_index,
        "the vertices of an earlier face": bad.duplicate & (not keep_duplicates),
    }
    for what, faces in kinds.items():
        draft = draft.counted(f"removed {{}} with {what}", "face", faces)
    return draft.without_faces(np.logical_or.reduce([*kinds.values()]))


def drop_non_finite(draft: Draft) -> Draft:
    """Remove vertices with non-finite coordinates."""
    nowhere = np.any(~np.isfinite(draft.mesh.vertices), axis=1)
    return draft.without_vertices(nowhere, "removed {} with non-finite coordinates")


def drop_welded(draft: Draft) -> Draft:
    """Remove vertices that were welded onto others, so that no given vertex has become them."""
    welded = np.ones(draft.mesh.n_vertices + 1, dtype=bool)
    welded[draft.trace.current] = False  # removed vertices have index −1, the last row
    return draft.without_vertices(welded[:-1])


def drop_unused(draft: Draft) -> Draft:
    """Remove vertices that no face uses."""
    unused = np.bincount(draft.mesh.faces.ravel(), minlength=draft.mesh.n_vertices) == 0
    return draft.without_vertices(unused, "removed {} that no face used")


def drop_outliers(draft: Draft) -> Draft:
    """Remove points far from all others, of points without faces."""
    stray = find_outliers(draft.mesh.vertices)
    return draft.without_vertices(stray, "removed {} far from all others", "point")


def wind(draft: Draft) -> Draft:
    """Wind the faces consistently, and outward where the outside is known."""
    rewound = faces_to_rewind(draft.mesh)
    mesh = rewind_faces(draft.mesh, rewound) if rewound.any() else draft.mesh
    return replace(draft, mesh=mesh, rewound=draft.rewound ^ rewound)


def part_limbs(draft: Draft, least_distance: float) -> Draft:
    """Part limbs that were merged by distance, if they are far apart along the surface, in √area."""
    if least_distance == np.inf or not (limbs := part_merged_limbs(draft.mesh, least_distance)).seams:
        return draft
    trace = VertexTrace(limbs.vertex_index, np.arange(draft.mesh.n_vertices))
    contacts = tuple(draft.trace.given[seam] for seam in limbs.seams)
    # The faces are wound again, because more than two faces met at merged edges before.
    return wind(replace(draft.made_into(limbs.mesh, trace), contacts=contacts))


def drop_chambers(draft: Draft, opening: float) -> Draft:
    """Remove chambers and their walls; the outermost surface is left."""
    from isomatch.repair.outer import inner_faces  # imports scipy.ndimage, which is slow

    return _cut_off(draft, "chambers", inner_faces(draft.mesh, opening))


def drop_base(draft: Draft) -> Draft:
    """Remove the largest planar piece, and what is below its rim."""
    return _cut_off(draft, "a base and below its rim", base_of(draft.mesh).below)


def _cut_off(draft: Draft, what: str, gone: BoolArray) -> Draft:
    """Remove faces (m,) and the vertices that only they use, and note the share of the area."""
    if not gone.any():
        return draft
    mesh, alone = draft.mesh, np.zeros(draft.mesh.n_vertices, dtype=bool)
    alone[np.setdiff1d(mesh.faces[gone], mesh.faces[~gone])] = True
    share = float(mesh.face_areas[gone].sum() / mesh.area)
    noted = draft.counted(f"removed {{}} of {what}, {share:.1%} of the area", "face", gone)
    return noted.without_faces(gone).without_vertices(alone)


def note_winding(draft: Draft) -> Draft:
    """Note how many faces were rewound, and where limbs were parted."""
    draft = draft.counted("rewound {}", "face", draft.rewound)
    where = describe_places(draft.contacts, "contact") if draft.contacts else ""
    return draft.noted(f"parted limbs that were merged {where}") if where else draft
