"""Prepare a mesh for matching: repair it, and take apart sheets that were glued or merged."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from isomatch._core.errors import MeshError
from isomatch.decimation import normalised
from isomatch.repair._winding import seems_inside_out
from isomatch.repair.caps import close_holes_at
from isomatch.repair.check import REPAIRED_DEFECTS, check, has_any
from isomatch.repair.draft import Draft, VertexTrace, describe_places, run
from isomatch.repair.sheets import separate_sheets, welds_neighbours
from isomatch.repair.steps import (
    close_gaps,
    drop_non_finite,
    drop_unsound_faces,
    drop_unused,
    drop_welded,
    note_winding,
    part_limbs,
    wind,
)
from isomatch.surfaces import Mesh, in_spatial_order

LARGE_MESH = 2**16  # vertices; a mesh with more is sorted in space, as it does not fit into a cache; chosen
# Fields of `MeshReport` with defects of a mesh whose sheets might be merged, and whose sheets might be glued.
SIGNS_OF_MERGES = ("non_manifold_edges", "non_manifold_vertices", "duplicate_faces")
SIGNS_OF_SHEETS = (*SIGNS_OF_MERGES, "coincident_vertices")
# coincident vertices; up to this number, comparing them along edges is faster than separating sheets; chosen
MAX_WELDED = 64
KEEP_TOGETHER = "if they belong together, set preparation.sheet_distance = inf"  # the remedy in notes
INSIDE_OUT = (  # text of a note
    "it seems to be inside out, and its openings are too large to turn it over unasked; with a shape that does not, "
    "`match` tries both windings of its faces"
)


def prepare_for_matching(mesh: Mesh, sheet_distance: float) -> Draft:
    """Repair a mesh as `repair` does, and take apart sheets that were glued together or merged.

    The arrays may contain anything; `MeshError` if the mesh has fatal defects. Sheets come apart if
    copies of a vertex where they meet are farther apart along edges than the sheet distance, in √area.
    The draft has the mesh, the trace of its vertices, and notes on what was changed. Copies of a
    vertex come from it, vertices of the caps at parted limbs from the nearest vertex.
    """
    draft = order_in_memory(Draft.of(mesh))
    report = check(draft.mesh, wall=0.0)
    if report.fatal:
        raise MeshError("; ".join(report.fatal))
    # A face with a repeated vertex might have an edge that the surface lacks, so the mesh is no manifold.
    is_manifold = not has_any(report, (*SIGNS_OF_MERGES, "repeated_index_faces"))
    few = is_manifold and len(report.coincident_vertices) <= MAX_WELDED
    has_sheets = has_any(report, SIGNS_OF_SHEETS) and not (
        few and welds_neighbours(draft.mesh, sheet_distance)
    )
    separated = take_sheets_apart(draft, sheet_distance) if has_sheets else None
    if separated:
        draft = separated
    elif has_any(report, REPAIRED_DEFECTS):
        draft = mend(draft, insert=len(report.t_junctions) > 0)
    if len(report.close_vertices):
        draft = draft.noted(
            f"{len(report.close_vertices)} vertices nearly coincide with others, and the surface falls apart there; if "
            f"they belong together: isomatch repair --weld {report.weld_tolerance:.2g}"
        )
    return draft.noted(INSIDE_OUT) if seems_inside_out(draft.mesh) else draft


def order_in_memory(draft: Draft) -> Draft:
    """Put the vertices and faces of a large mesh in spatial order, if they are sound."""
    mesh = draft.mesh
    if mesh.n_vertices <= LARGE_MESH or not mesh.n_faces:
        return draft
    within = mesh.faces.min() >= 0 and mesh.faces.max() < mesh.n_vertices
    if not within or not np.isfinite(mesh.vertices).all():
        return draft
    _, faces, order = in_spatial_order(normalised(mesh.vertices)[0], mesh.faces)
    order = order.astype(np.int64)
    return draft.then(
        Draft.of(Mesh(mesh.vertices[order], faces), trace=VertexTrace(order, np.argsort(order)))
    )


def take_sheets_apart(draft: Draft, sheet_distance: float) -> Draft | None:
    """Part merged limbs, or separate glued sheets; None if there are neither."""
    keep_layers = partial(drop_unsound_faces, keep_duplicates=True)
    glued = run(draft, close_gaps, keep_layers, drop_non_finite, drop_welded, drop_unused)
    sheets = separate_sheets(glued.mesh, sheet_distance)
    if not sheets.is_manifold:  # triangles are missing, as a merge of their corners removed them
        limbs_parted = mend(draft, least_distance=sheet_distance)
        if limbs_parted.contacts:
            # Holes that the merge left are closed, as they are no openings of the shape.
            at_contacts = np.isin(limbs_parted.trace.given, np.concatenate(limbs_parted.contacts))
            closed, nearest = close_holes_at(limbs_parted.mesh, at_contacts)
            trace = VertexTrace(nearest, np.arange(limbs_parted.mesh.n_vertices))
            *earlier, note = limbs_parted.notes
            capped = limbs_parted.then(Draft.of(closed, trace=trace))
            return replace(capped, notes=(*earlier, f"{note}; {KEEP_TOGETHER}"))
    if not sheets.seams:
        return None
    trace = VertexTrace(sheets.vertex_index, np.arange(glued.mesh.n_vertices))
    separated = mend(glued.then(Draft.of(sheets.mesh, trace=trace)), weld=False)
    where = describe_places(tuple(glued.trace.given[seam] for seam in sheets.seams), "seam")
    return separated.noted(f"separated sheets that were glued together {where}; {KEEP_TOGETHER}")


def mend(draft: Draft, weld: bool = True, insert: bool = True, least_distance: float = np.inf) -> Draft:
    """Repair the mesh of a draft, in steps that take its vertices, copies included, as the given ones."""
    close = partial(close_gaps, weld=weld, insert=insert)
    part = partial(part_limbs, least_distance=least_distance)
    steps = close, drop_unsound_faces, drop_non_finite, drop_welded, drop_unused, wind, part
    return note_winding(draft.then(run(Draft.of(draft.mesh), *steps)))
