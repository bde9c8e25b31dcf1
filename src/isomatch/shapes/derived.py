"""Shapes prepared from a prepared one: with its holes closed, and its components; made once, and kept with it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from isomatch.errors import MeshError, NotConvergedError
from isomatch.mending import capped, cut_contacts
from isomatch.runtime.stage_timer import StageTimer
from isomatch.shapes.body import LEFT_UNMATCHED, sound_body
from isomatch.shapes.prepare import prepared_body
from isomatch.shapes.prepared_shape import PreparedShape
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import IntArray
from isomatch.values.cached import cached_method

OF_BODY = "functions", "index", "signatures", "curvature"  # what is kept of a body alone


@cached_method
def capped_shape(shape: PreparedShape) -> PreparedShape:
    """Close the holes of a body: a shape of its own, of which its vertices are the first. If one is long, all are closed.

    A body without a long boundary is taken as it is.
    """
    everything = np.arange(shape.body.n_vertices)
    if shape.triangles is not None and shape.longest_boundary > shape.config.parts.long_boundary:
        return _closed(shape, shape.triangles, everything)
    alone = replace(
        shape, surface=shape.body, body_vertex=everything, user_vertex=everything, scale=1.0, notes=()
    )
    alone = replace(alone, others=(), detail=None, finer=None, refining=None, origin=everything)
    kept = OF_BODY if shape.config.preparation.distance_unit == "user" else (*OF_BODY, "symmetries")
    alone.__dict__.update({name: getattr(shape, name) for name in kept})
    return alone


@cached_method
def cut_shape(shape: PreparedShape, most: int) -> PreparedShape | None:
    """Cut a body along the seams of so many contacts, and close all holes; its vertices are the first.

    None if there is no seam.
    """
    cut = cut_contacts(shape.mesh_body, most, shape.config.preparation.contact_concavity)
    return _closed(shape, cut.mesh, cut.vertex_index) if cut.seams else None


def _closed(shape: PreparedShape, mesh: Mesh, origin: IntArray) -> PreparedShape:
    """Prepare the body of a shape, perhaps cut, with all holes closed, given the vertex of the body of each of its."""
    closed = capped(mesh)
    config = replace(shape.requested, resolution="full")
    made = prepared_body(closed, sound_body(closed), config, shape.seed, StageTimer())
    on_caps = np.full(closed.n_vertices - mesh.n_vertices, -1)
    return replace(made, origin=np.concatenate([origin, on_caps]))


@cached_method
def mirror_image(shape: PreparedShape) -> PreparedShape:
    """Return the mirror image of a mesh in space; faces keep their orientation, and by itself it tells the same."""
    found = replace(shape, body=reflected(shape.mesh_body))
    kept = (*OF_BODY, "points", "balls", "symmetries")
    found.__dict__.update({name: value for name, value in vars(shape).items() if name in kept})
    return found


@cached_method
def components_of(shape: PreparedShape) -> tuple[PreparedShape, ...]:
    """Prepare the body and the further components, each as a shape of the same surface that leaves nothing out.

    Those that cannot be prepared are missing.
    """
    notes = tuple(note for note in shape.notes if LEFT_UNMATCHED not in note)
    found = [replace(shape, left_out=0.0, notes=notes, others=())]
    for body in shape.others:
        with suppress(MeshError, NotConvergedError):
            found.append(prepared_body(shape.surface, body, shape.requested, shape.seed, StageTimer()))
    return tuple(found)
