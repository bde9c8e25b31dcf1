"""Shapes that move: area, volume, thickness of walls, displacement and strain of the shapes of a series, by region."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from isomatch.errors import MeshError
from isomatch.loading.compiled import compiled
from isomatch.runtime.threads import parallel_map
from isomatch.storage.texts import natural_order
from isomatch.surfaces import Mesh
from isomatch.values.arrays import AnyArray, FloatArray

BLOCK = 64  # faces that a ray passes by at once
CHUNK = 2048  # rays at once
INSIDE = -1e-9  # least weight of a corner, so that no ray slips through an edge


class SurfaceStrain(NamedTuple):
    """How each of f faces is stretched: principal Green–Lagrange strains, the larger one first; growth of the area."""

    first: FloatArray
    second: FloatArray
    area: FloatArray  # 0.1: a tenth larger than before


def surface_strain(reference: Mesh, deformed: Mesh) -> SurfaceStrain:
    """Compute the strain of each face, from the reference to the deformed mesh, which has the same faces.

    E = ½ (FᵀF − I) in the plane of the face in the reference; F is constant there. A length that grows by the factor s
    has the strain (s² − 1) / 2. Motions give none. Nan where the reference has no area. O(f).

    Examples
    --------
    >>> flat = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> strain = surface_strain(flat, flat.moved(flat.vertices * [2.0, 1.0, 1.0]))
    >>> strain.first.item(), strain.second.item(), strain.area.item()
    (1.5, 0.0, 1.0)
    """
    if not np.array_equal(reference.faces, deformed.faces):
        raise MeshError("strain is that between two meshes with the same faces; these have others")
    # In an orthonormal frame whose first axis is along the edge u of a face, its edges are the columns of
    # D = [p q; 0 h]. Deformed, they have the inner products G = (F D)ᵀ (F D), so that FᵀF = D⁻ᵀ G D⁻¹.
    u, v = _edges(reference)
    p = np.linalg.norm(u, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        q, h = _dot(u, v) / p, 2 * reference.face_areas / p
        a, b = _edges(deformed)
        aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
        along = aa / p**2
        mixed = (ab - q / p * aa) / (p * h)
        across = (bb - 2 * q / p * ab + (q / p) ** 2 * aa) / h**2
        mean, half = (along + across) / 2, np.hypot((along - across) / 2, mixed)
        growth = deformed.face_areas / reference.face_areas - 1
    strains = (mean + half - 1) / 2, (mean - half - 1) / 2, growth
    return SurfaceStrain(*(np.where(reference.face_areas > 0, each, np.nan) for each in strains))


def _edges(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    first, second, third = (mesh.vertices[mesh.sound_faces[:, i]] for i in range(3))
    return second - first, third - first


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", a, b))


def is_closed(mesh: Mesh) -> bool:
    """Whether a mesh has faces, at least two of them at each edge."""
    return mesh.n_faces > 0 and bool((mesh.edge_table.n_faces > 1).all())


def wall_thickness(mesh: Mesh) -> FloatArray:
    """Measure how thick a solid is behind each face of its surface (f,).

    It is the distance from the middle of the face, along its inward normal, to the next face that looks away: of a ball
    the diameter, at the rim of a plate its width. Between walls at an angle it is longer than the shortest way to the
    other one, by 1 / cos. Nan where no face is met, and for surfaces that are not closed. About f² / 64 operations.

    Examples
    --------
    >>> corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, -1).T
    >>> faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6]]
    >>> box = Mesh(corners * [1.0, 1.0, 0.2], [*faces, [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    >>> wall_thickness(box).round(6)
    array([1. , 1. , 1. , 1. , 1. , 1. , 1. , 1. , 0.2, 0.2, 0.2, 0.2])
    """
    thickness = np.full(mesh.n_faces, np.nan)
    used = np.flatnonzero(mesh.face_areas > 0)
    if not is_closed(mesh) or not len(used):
        return thickness
    corners = (mesh.vertices - mesh.vertices.mean(axis=0))[mesh.sound_faces[used]]  # (f, 3, 3)
    corners = corners if mesh.volume > 0 else corners[:, ::-1]
    middles = corners.mean(axis=1)
    order = cKDTree(
        middles
    ).indices  # near each other on the surface: a ray passes by the balls around most blocks
    corners, middles = corners[order], middles[order]
    first = np.arange(0, len(order), BLOCK)
    low, high = (
        np.minimum.reduceat(corners.min(axis=1), first),
        np.maximum.reduceat(corners.max(axis=1), first),
    )
    balls = np.column_stack([low + high, np.linalg.norm(high - low, axis=1)]) / 2
    # x is on the face (a, b, c), with the edges u and v at a and n = u × v, if n·(x − a) = 0 and no weight is negative:
    # (v × n)·(x − a) / n² of b, (n × u)·(x − a) / n² of c, and what is left to 1 of a
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = np.cross(u, v)
    square = _dot(n, n)[:, None]
    rows = np.stack([n / np.sqrt(square), np.cross(v, n) / square, np.cross(n, u) / square], axis=1)
    levels = np.einsum("fkd,fd->fk", rows, a)
    lengths = np.empty(len(order))

    def chunk(begin: int) -> None:
        rays = slice(begin, begin + CHUNK)
        _cast(middles[rays], -rows[rays, 0], rows, levels, balls, lengths[rays])

    parallel_map(chunk, range(0, len(order), CHUNK))
    thickness[used[order]] = np.where(np.isfinite(lengths), lengths, np.nan)
    return thickness


@compiled(inline="always")
def _product(rows: AnyArray, f: int, k: int, x: AnyArray, i: int) -> Any:
    return rows[f, k, 0] * x[i, 0] + rows[f, k, 1] * x[i, 1] + rows[f, k, 2] * x[i, 2]


@compiled()
def _cast(
    starts: FloatArray,
    directions: FloatArray,
    rows: FloatArray,
    levels: FloatArray,
    balls: FloatArray,
    lengths: FloatArray,
) -> None:
    """Find the length of each ray up to the first face whose normal is within 90° of it; infinite without any."""
    for i in range(len(starts)):
        lengths[i] = np.inf
        for block in range(len(balls)):
            along = square = 0.0
            for d in range(3):
                away = balls[block, d] - starts[i, d]
                along += away * directions[i, d]
                square += away * away
            radius = balls[block, 3]
            if along < -radius or along - radius > lengths[i] or square - along * along > radius * radius:
                continue
            for f in range(block * BLOCK, min((block + 1) * BLOCK, len(rows))):
                slope = _product(rows, f, 0, directions, i)
                if slope <= 0:
                    continue
                length = (levels[f, 0] - _product(rows, f, 0, starts, i)) / slope
                if not 0 < length < lengths[i]:
                    continue
                b = (
                    _product(rows, f, 1, starts, i)
                    - levels[f, 1]
                    + length * _product(rows, f, 1, directions, i)
                )
                c = (
                    _product(rows, f, 2, starts, i)
                    - levels[f, 2]
                    + length * _product(rows, f, 2, directions, i)
                )
                if min(b, c, 1 - b - c) >= INSIDE:
                    lengths[i] = length


class VertexMotion(NamedTuple):
    """What moved, at each of n vertices."""

    thickness: FloatArray
    displacement: FloatArray
    first_strain: FloatArray
    second_strain: FloatArray
    area_strain: FloatArray


def vertex_motion(mesh: Mesh, reference: Mesh) -> VertexMotion:
    """Measure a moved mesh at its vertices: means over the faces around each, weighted by their areas.

    They are those of `wall_thickness`, of how far the vertex is from where it was, and of `surface_strain`. Nan where
    nothing is known.

    Examples
    --------
    >>> flat = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> vertex_motion(flat.moved(flat.vertices + [0.0, 0.0, 3.0]), flat).displacement
    array([3., 3., 3.])
    """
    strain = surface_strain(reference, mesh)
    moved = np.linalg.norm(mesh.vertices - reference.vertices, axis=1)
    first, second, growth = (_at_vertices(reference, each) for each in strain)
    return VertexMotion(_at_vertices(mesh, wall_thickness(mesh)), moved, first, second, growth)


def _at_vertices(mesh: Mesh, values: FloatArray) -> FloatArray:
    shares = np.repeat(np.where(np.isnan(values), 0.0, mesh.face_areas), 3)
    corners, n = mesh.sound_faces.ravel(), mesh.n_vertices
    with np.errstate(invalid="ignore"):
        sums = np.bincount(corners, shares * np.repeat(np.nan_to_num(values), 3), n)
        return np.asarray(sums / np.bincount(corners, shares, n))


def motion_by_region(
    mesh: Mesh, reference: Mesh, motion: VertexMotion, regions: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """Sum up a moved mesh: a row for ``all``, and one for each region, given its name at each vertex, "" for none.

    A row has ``region``, ``area``, ``volume``, which is nan of regions and of surfaces that are not closed, and the means
    of what `vertex_motion` gave, weighted by area: thickness by that of the mesh, the others by that of the reference, so
    that ``area_strain`` is the growth of the region. A face at a border counts a third for each corner.

    Examples
    --------
    >>> flat = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> rows = motion_by_region(flat, flat, vertex_motion(flat, flat), ["left", "right", "left"])
    >>> [(row["region"], round(row["area"], 3), row["area_strain"]) for row in rows]
    [('all', 0.5, 0.0), ('left', 0.333, 0.0), ('right', 0.167, 0.0)]
    """
    of = np.array(regions, dtype=str)
    inside = {"all": np.ones(mesh.n_vertices, dtype=bool)}
    inside |= {name: of == name for name in sorted({*of.tolist()} - {""}, key=natural_order)}
    rows = []
    for name, vertices in inside.items():
        volume = abs(mesh.volume) if name == "all" and is_closed(mesh) else np.nan
        row = {"region": name, "area": float(mesh.vertex_areas[vertices].sum()), "volume": volume}
        for measure, values in motion._asdict().items():
            known = vertices & np.isfinite(values)
            weights = (mesh if measure == "thickness" else reference).vertex_areas[known]
            row[measure] = float(weights @ values[known] / weights.sum()) if weights.any() else np.nan
        rows.append(row)
    return rows
