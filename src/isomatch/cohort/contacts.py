"""Where structures of a subject touch: points that lie on each other are kept together; gaps and overlaps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import laplacian

from isomatch._core.arrays import BoolArray, FloatArray
from isomatch.cohort.shape_statistics import CorrespondedShapes, slices_of, structure_of
from isomatch.spectral import factorised_for_threads
from isomatch.surfaces import Mesh, PrecisePoints, nearest_on_surface

TOUCHING = 0.1  # √area of the smaller of two structures: points nearer to the other touch it
LEAST_TOUCHING = 0.2  # share of the area of the smaller one that has to touch the other
LEAST_HELD = 0.6  # the same, for points to be kept together: sheets have more, joints that slide less
REACH = 0.1  # √area: how far beyond the contact points are still moved
ROUNDS = 4  # the slip of knee cartilage hardly falls in further ones
SLIPPED = 0.5  # √area of a vertex: a point that still slips by more has no counterpart
MOST_WITHOUT = 0.5  # share of the points that touch: with more, a structure stays as it was matched


class Gap(NamedTuple):
    """How two structures of a subject lie on each other; the lengths are nan where nothing is measured."""

    subject: str
    structure: str
    other: str
    gap_before: float
    overlap_before: float
    slip_before: float
    gap_after: float
    overlap_after: float
    slip_after: float
    without: float  # share of the points that touch which have no counterpart
    note: str  # why nothing was moved


class _Contact(NamedTuple):
    other: str
    points: PrecisePoints  # of the other, nearest to each vertex of a structure
    distances: FloatArray  # (n,) over those of points that touch
    area: float  # of what touches

    @classmethod
    def of(cls, mesh: Mesh, other: str, larger: Mesh) -> _Contact:
        points = nearest_on_surface(larger, mesh.vertices)
        apart = np.linalg.norm(points.interpolated(larger.vertices) - mesh.vertices, axis=1)
        distances = apart / (TOUCHING * np.sqrt(mesh.area))
        return cls(other, points, distances, float(mesh.vertex_areas[distances < 1].sum()))

    @property
    def touches(self) -> BoolArray:
        return self.distances < 1


def beneath(meshes: Mapping[str, Mesh]) -> dict[str, str]:
    """Find the larger structure on which each lies that touches one by 0.6 of its area, as cartilage does its bone.

    The largest of those that lie on another come first.
    """
    contacts = _contacts_of(meshes, LEAST_HELD)
    return {name: max(own, key=lambda each: each.area).other for name, own in contacts.items() if own}


def contacts_kept(
    shapes: CorrespondedShapes, of: str | None = None, *, move: bool = True
) -> tuple[CorrespondedShapes, list[Gap]]:
    """Keep points of structures together that lie on each other in a subject, and measure gap and overlap in all."""
    # that subject is ``of``, by default the first of those with most structures. A structure, such as cartilage, that
    # touches a larger one by 0.6 of its area or more follows that; points beyond its edge have no counterpart: they
    # continue it, and are not measured. A vertex b was nearest to the point p of the larger structure; in each subject
    # it moves by p − q, where q is now nearest to it, then back to its surface, four times. Movements u are smooth: they
    # minimise Σ w ‖u − (p − q)‖² + Σ ‖u_i − u_j‖² + μ Σ ‖u‖², with weights w that fall to 0 at twice the distance that
    # counts as touching, and μ so that u falls off within 0.1 √area. Gaps are of two structures that touch by a fifth of
    # the area of the smaller one: of its points that touch in the template, the largest distances outside and inside the
    # larger one, and the mean distance of its nearest point from the corresponding one.
    parts, vertices, measured = slices_of(shapes.structures), shapes.vertices.copy(), shapes.seen.copy()
    has = {name: np.asarray(measured[:, part].any(axis=1)) for name, part in parts.items()}
    at = int(np.sum([*has.values()], axis=0).argmax()) if of not in shapes.names else shapes.names.index(of)
    meshes = {name: structure_of(shapes.mesh(at), part) for name, part in parts.items() if has[name][at]}
    gaps = list[Gap]()

    def mesh_of(places: FloatArray, i: int, name: str) -> Mesh:
        return meshes[name].moved(places[i, parts[name]])

    for name, touching in _contacts_of(meshes, LEAST_TOUCHING).items():
        sheets = [each for each in touching if each.area >= LEAST_HELD * meshes[name].area]
        held = max(sheets, key=lambda each: each.area, default=None)
        smooth = _smoothing(meshes[name], held) if held else None
        for i in np.flatnonzero(has[name]).tolist():
            own, note = mesh_of(shapes.vertices, i, name), ""
            if move and held and smooth and has[held.other][i] and i != at:
                new, kept = _followed(own, mesh_of(vertices, i, held.other), held, smooth)
                if (without := 1 - kept[held.touches].mean()) > MOST_WITHOUT:
                    note = f"left as matched: {without:.0%} of what touches would have no counterpart"
                else:
                    vertices[i, parts[name]] = new
                    measured[i, parts[name]] &= kept
            for each in touching:
                if has[each.other][i]:
                    counted = each.touches & measured[i, parts[name]]
                    before, after = (
                        _lies(each, mesh_of(places, i, name), mesh_of(places, i, each.other), rows)
                        for places, rows in ((shapes.vertices, each.touches), (vertices, counted))
                    )
                    without = float(1 - counted.sum() / each.touches.sum())
                    gaps.append(Gap(shapes.names[i], name, each.other, *before, *after, without, note))
    return replace(shapes, vertices=vertices, measured=measured), gaps


def _contacts_of(meshes: Mapping[str, Mesh], least: float) -> dict[str, list[_Contact]]:
    """Find where each structure touches a larger one, by a share of its area; largest structures first."""
    ordered = sorted(meshes, key=lambda name: -meshes[name].area)
    found = {a: [_Contact.of(meshes[a], b, meshes[b]) for b in ordered[:i]] for i, a in enumerate(ordered)}
    return {a: [each for each in own if each.area >= least * meshes[a].area] for a, own in found.items()}


def _smoothing(mesh: Mesh, contact: _Contact) -> Callable[[FloatArray], FloatArray]:
    """Return what makes movements (n, 3) of all points of a structure of those of the points that touch."""
    # the minimum of Σ w |u − d|² + Σ |u_i − u_j|² + μ Σ |u|² solves (W + L + μ I) u = W d; along a line u″ = μ u beyond
    # the contact, in edges, and an edge is about as long as the root of the area of a vertex: μ = (edge / reach)²
    links = coo_array(
        (np.ones(len(mesh.edges)), mesh.edges.T), shape=(mesh.n_vertices, mesh.n_vertices)
    ).tocsr()
    fading = np.clip(2 - contact.distances, 0, 1)
    weights = fading**2 * (3 - 2 * fading)
    stiffness = 1 / (mesh.n_vertices * REACH**2)
    solve = factorised_for_threads(csc_array(laplacian(links + links.T)), weights + stiffness)
    return lambda pulls: np.asarray(solve(weights[:, None] * pulls))


def _followed(
    own: Mesh, other: Mesh, contact: _Contact, smooth: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, BoolArray]:
    """Move the points of a structure of a subject along it; and tell which have a counterpart on it."""
    goals, here = contact.points.interpolated(other.vertices), own.vertices
    for _ in range(ROUNDS):
        here = _nearest(own, here + smooth(goals - _nearest(other, here)))
    left = goals - _nearest(other, here)
    is_beyond = contact.touches & (np.linalg.norm(left, axis=1) > SLIPPED * np.sqrt(own.area / len(here)))
    return np.where(is_beyond[:, None], here + left, here), ~is_beyond


def _nearest(mesh: Mesh, positions: FloatArray) -> FloatArray:
    return nearest_on_surface(mesh, positions).interpolated(mesh.vertices)


def _lies(contact: _Contact, own: Mesh, other: Mesh, rows: BoolArray) -> tuple[float, float, float]:
    """Largest gap and overlap, and mean slip, of some points of a contact; nan of none."""
    if not rows.any():
        return np.nan, np.nan, np.nan
    here = own.vertices[rows]
    nearest = nearest_on_surface(other, here)
    away = here - nearest.interpolated(other.vertices)
    outside = np.einsum("ij,ij->i", away, nearest.interpolated(other.vertex_normals)) >= 0
    apart = np.linalg.norm(away, axis=1)
    slip = np.linalg.norm(contact.points.interpolated(other.vertices)[rows] - (here - away), axis=1)
    gap, overlap = (float(apart[side].max(initial=0.0)) for side in (outside, ~outside))
    return gap, overlap, float(slip.mean())
