"""Variants of a prepared shape, each made once: capped, cut, turned over, mirrored; and its components."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from isomatch._core.arrays import BoolArray, IntArray
from isomatch._core.cached import cached_method
from isomatch._core.errors import MeshError, NotConvergedError
from isomatch._core.stage_timer import StageTimer
from isomatch.correspondence import UNMATCHED
from isomatch.repair import Cut, close_holes, cut_along, cut_self_contacts, ends_of, find_creases
from isomatch.settings import Config
from isomatch.shapes.body import LEFT_UNMATCHED, sound_body
from isomatch.shapes.prepare import prepare_body
from isomatch.shapes.prepared_shape import PreparedShape
from isomatch.surfaces import Mesh, Surface, reflected


def _names(*properties: Any) -> tuple[str, ...]:
    return tuple(cached.func.__name__ for cached in properties)


# Names of cached properties that a variant takes over from its original. Other properties are computed anew,
# which is correct, but slower. These are taken over if both shapes have the same body.
OF_BODY = _names(
    PreparedShape.functions, PreparedShape.index, PreparedShape.signatures, PreparedShape.curvature
)
OF_DISTANCES = _names(PreparedShape.symmetries, PreparedShape.symmetry_search)  # if distances are equal
# if only the winding of the faces differs
OF_EITHER_WINDING = _names(PreparedShape.functions, PreparedShape.points, PreparedShape.handles)


def _with_properties_of(shape: PreparedShape, new: PreparedShape, names: tuple[str, ...]) -> PreparedShape:
    """Give a new shape the properties that have been computed for another one."""
    vars(new).update({name: value for name, value in vars(shape).items() if name in names})
    return new


@cached_method
def capped_shape(shape: PreparedShape) -> PreparedShape:
    """Close all holes of a body, if one of them is long; otherwise the body stays the same."""
    everything = np.arange(shape.body.n_vertices)
    if shape.triangles is not None and shape.longest_boundary > shape.config.parts.long_boundary:
        return _variant(shape, close_holes(shape.triangles), everything)
    same = replace(shape, others=(), finer=None, refining=None, origin=everything, original=replace(shape))
    for name in (names := (*OF_BODY, *OF_DISTANCES)):
        getattr(shape, name)  # computes them for the original shape, which needs them, too
    return _with_properties_of(shape, same, names)


@cached_method
def cut_shape(shape: PreparedShape, most: int) -> PreparedShape | None:
    """Cut a body along paths of self-contacts, and close all holes; None without any, or if it falls apart."""
    if most == 0 or shape.triangles is None:
        return None
    cut = _self_contacts(shape, most)
    if not cut.cut_paths:
        return None
    longest, count = max(cut.cut_paths, key=len), len(cut.cut_paths)
    note = (
        f"cut where limbs seem to be fused, along {count} {'path' if count == 1 else 'paths'}; the "
        f"largest has {len(longest)} vertices, one of them vertex {shape.user_vertex[longest[0]]}"
    )
    return _cut_open(shape, lambda: close_holes(cut.mesh), cut.vertex_index, note)


def creased_shape(shape: PreparedShape, most: int, torn: BoolArray | None = None) -> PreparedShape | None:
    """Cut a body along the paths of self-contacts and its creases, and close it; None without creases.

    It uses the creases with an end that is ``torn`` (n_body,), by default all.
    """
    cut, edges = _self_contacts_and_creases(shape, most)
    if torn is not None:
        edges = edges[torn[cut.vertex_index[edges]].any(axis=1)]
    if not len(edges):
        return None
    mesh, index = cut_along(cut.mesh, edges)
    vertex = shape.user_vertex[cut.vertex_index[edges[0, 0]]]
    note = f"cut along {len(edges)} edges of creases where limbs may be fused, one of them at vertex {vertex}"
    return _cut_open(shape, lambda: close_holes(mesh, ends_of(edges)), cut.vertex_index[index], note)


@cached_method
def opened_shape(shape: PreparedShape, most: int) -> PreparedShape | None:
    """Cut a body along paths of self-contacts and creases, and leave the cuts open; None without any."""
    cut, edges = _self_contacts_and_creases(shape, most)
    if not cut.cut_paths and not len(edges):
        return None
    mesh, index = cut_along(cut.mesh, edges)
    note = "cut open where limbs may be fused, along self-contacts and creases"
    return _cut_open(shape, lambda: mesh, cut.vertex_index[index], note)


def region_of(shape: PreparedShape, vertices: IntArray, config: Config) -> PreparedShape:
    """Prepare a connected region of a body, of increasing ``vertices`` (m,), as a separate shape."""
    inside = np.zeros(shape.body.n_vertices, dtype=bool)
    inside[vertices] = True
    mesh, _ = shape.mesh_body.submesh(inside)
    region = _prepare_again(shape, mesh, config)
    return replace(region, scale=region.scale * shape.scale)


@cached_method
def _self_contacts(shape: PreparedShape, most: int) -> Cut:
    """Cut a body along the paths of self-contacts."""
    return cut_self_contacts(shape.mesh_body, most, shape.config.preparation.self_contact_concavity)


@cached_method
def _self_contacts_and_creases(shape: PreparedShape, most: int) -> tuple[Cut, IntArray]:
    """Cut a body along the paths of self-contacts, and find the edges of its creases."""
    cut = _self_contacts(shape, most)
    return cut, find_creases(cut.mesh)


def _cut_open(
    shape: PreparedShape, mesh: Callable[[], Mesh], origin: IntArray, note: str
) -> PreparedShape | None:
    """Prepare a mesh made by cutting the body of a shape; None if a cut parts it."""
    with suppress(MeshError, NotConvergedError):
        remedy = "if nothing is fused, set preparation.self_contact_concavity = 0"
        return _variant(shape, mesh(), origin, f"{note}; {remedy}")
    return None


def _variant(shape: PreparedShape, mesh: Mesh, origin: IntArray, *notes: str) -> PreparedShape:
    """Prepare a mesh made from the body of a shape, whose vertices come first, as a variant of the shape."""
    # ``origin`` is the body vertex of each vertex; vertices of caps, which come last, have none
    variant = _prepare_again(shape, mesh, shape.requested)
    on_caps = np.full(mesh.n_vertices - len(origin), UNMATCHED)
    variant = replace(variant, origin=np.concatenate([origin, on_caps]), original=replace(shape))
    return replace(
        variant,
        surface=shape.surface,
        body_vertex=shape.body_vertex,
        user_vertex=shape.user_vertex[variant.original_vertex],
        detail=shape.detail,
        scale=variant.scale * shape.scale,
        left_out=shape.left_out,
        share=shape.share,
        notes=(*shape.notes, *notes),
    )


def _prepare_again(shape: PreparedShape, mesh: Mesh, config: Config) -> PreparedShape:
    """Prepare a mesh made from the body of a shape, with all its vertices."""
    config = replace(config, resolution="full")
    return prepare_body(mesh, sound_body(mesh), config, shape.seed, StageTimer())


def mirror_image(shape: PreparedShape) -> PreparedShape:
    """Return the mirror image of a mesh in space; faces keep their orientation."""
    return replace(shape, body=reflected(shape.mesh_body))


@cached_method
def turned_over(shape: PreparedShape) -> PreparedShape:
    """Return a mesh with the corners of its faces reversed, so that inside and outside change places."""

    def rewind(surface: Surface) -> Surface:
        return Mesh(surface.vertices, surface.faces[:, ::-1]) if isinstance(surface, Mesh) else surface

    finer = shape.finer and replace(shape.finer, surface=rewind(shape.finer.surface))
    turned = replace(shape, body=rewind(shape.body), finer=finer)
    return _with_properties_of(shape, turned, OF_EITHER_WINDING)


@cached_method
def components_of(shape: PreparedShape) -> tuple[PreparedShape, ...]:
    """Prepare the body and the further components, each as a shape of the same surface.

    Components that cannot be prepared are missing.
    """
    notes = tuple(note for note in shape.notes if LEFT_UNMATCHED not in note)
    components = [replace(shape, left_out=0.0, notes=notes, others=())]
    for body in shape.others:
        with suppress(MeshError, NotConvergedError):
            components.append(prepare_body(shape.surface, body, shape.requested, shape.seed, StageTimer()))
    return tuple(components)
