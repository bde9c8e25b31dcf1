"""The update stencils of fast marching: which pair of vertices may carry a front to which third vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from isomatch._arrays import AnyArray, Float32Array, FloatArray, IntArray
from isomatch.surfaces import Mesh

UNFOLD_STEPS = 40  # faces crossed at most in search of a vertex that splits an obtuse angle

RIGHT_ANGLE = 1e-9  # cosines below this are those of a right angle, which needs and gives no split


@dataclass(frozen=True, eq=False)
class Stencil:
    """Directed updates, grouped by the vertex that triggers them.

    Entry e in ``start[v]:start[v + 1]`` says: once v is known, the pair (v, ``other[e]``) may give the distance of
    ``target[e]``. In the plane of the triangle, v is at the origin, the other vertex at (``shape[e, 0]``, 0) and
    the target at (``shape[e, 1]``, ``shape[e, 2]``) with a positive ordinate, ``shape[e, 3]`` from v.
    """

    start: IntArray  # (n + 1,)
    other: AnyArray  # (e,) int32
    target: AnyArray  # (e,) int32
    shape: Float32Array  # (e, 4)
    curvature: FloatArray  # (n,) Gaussian curvature

    @property
    def arrays(self) -> tuple[IntArray, AnyArray, AnyArray, Float32Array, FloatArray]:
        """All of them, in order, for compiled loops."""
        return self.start, self.other, self.target, self.shape, self.curvature

    @property
    def n_vertices(self) -> int:
        """Number of vertices of the surface."""
        return len(self.start) - 1


def stencil_of(mesh: Mesh) -> Stencil:
    """Build the stencils of a mesh: every corner, and for obtuse corners the unfolded neighbours that split them.

    An obtuse corner c of a face (a, b, c) can be reached by a front before a or b is known. Following Kimmel &
    Sethian (1998), faces beyond the edge (a, b) are unfolded into the plane until a vertex d lies within the range
    in which both angles at c become acute; (a, d) and (d, b) then update c as well.

    Cost: O(faces) time, about 240 bytes a vertex.
    """
    faces = mesh.sound_faces
    opposite = _opposite_corners(faces, mesh.n_vertices)
    extra = _split_obtuse(mesh.vertices, faces.ravel(), opposite)
    # every corner c of every face, with its edge (a, b), as (c, a, b, |ab|, x, y)
    corner = faces.ravel()
    a, b = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel()
    points = mesh.vertices
    plain = np.column_stack([corner, a, b]), _triangle(points[a], points[b], points[corner])
    curvature = _gaussian_curvature(mesh, opposite)
    return _group(np.concatenate([plain[0], extra[0]]), np.concatenate([plain[1], extra[1]]), curvature)


def _gaussian_curvature(mesh: Mesh, opposite: IntArray) -> FloatArray:
    """Angle missing to a full turn over the area of a vertex, (n,); 0 on boundaries and where not manifold."""
    corner = mesh.sound_faces.ravel()
    at, following, before = (
        mesh.vertices[np.roll(mesh.sound_faces, -turn, axis=1).ravel()] for turn in range(3)
    )
    one, two = following - at, before - at
    angles = np.arctan2(np.linalg.norm(np.cross(one, two), axis=1), np.einsum("ij,ij->i", one, two))
    missing = 2 * np.pi - np.bincount(corner, angles, mesh.n_vertices)
    rim = np.flatnonzero(opposite < 0)
    missing[corner[rim - rim % 3 + (rim + 1) % 3]] = 0.0
    missing[corner[rim - rim % 3 + (rim + 2) % 3]] = 0.0
    area = mesh.vertex_areas
    return np.asarray(np.divide(missing, area, out=np.zeros(mesh.n_vertices), where=area > 0))


def _triangle(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Planar shape (|ab|, x, y) of triangles with a at the origin, b on the axis, c at (x, y), y >= 0."""
    ab, ac = b - a, c - a
    length = np.linalg.norm(ab, axis=1)
    safe = np.where(length > 0, length, 1.0)
    x = np.einsum("ij,ij->i", ab, ac) / safe
    y = np.linalg.norm(np.cross(ab, ac), axis=1) / safe
    return np.column_stack([length, x, y])


def _group(corners: IntArray, shape: FloatArray, curvature: FloatArray) -> Stencil:
    """Write each update (c; a, b) once under a and, mirrored, once under b, sorted by trigger."""
    n = len(curvature)
    target, a, b = corners.T
    mirrored = np.column_stack([shape[:, 0], shape[:, 0] - shape[:, 1], shape[:, 2]])
    trigger = np.concatenate([a, b])
    order = np.argsort(trigger, kind="stable")
    shape = np.concatenate([shape, mirrored])[order]
    start = np.zeros(n + 1, dtype=np.int64)
    np.cumsum(np.bincount(trigger, minlength=n), out=start[1:])
    return Stencil(
        start,
        np.concatenate([b, a])[order].astype(np.int32),
        np.concatenate([target, target])[order].astype(np.int32),
        np.column_stack([shape, np.hypot(shape[:, 1], shape[:, 2])]).astype(np.float32),
        curvature,
    )


def _opposite_corners(faces: IntArray, n: int) -> IntArray:
    """For corner h = 3 f + i, the corner across the edge that faces it, or −1 at boundaries and where not manifold."""
    a, b = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel()
    key = np.minimum(a, b) * n + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    pair = first[count == 2]
    opposite = np.full(faces.size, -1, dtype=np.int64)
    opposite[order[pair]] = order[pair + 1]
    opposite[order[pair + 1]] = order[pair]
    return opposite


@numba.njit(cache=True, nogil=True)
def _split_obtuse(
    points: FloatArray, corner_vertex: IntArray, opposite: IntArray
) -> tuple[IntArray, FloatArray]:  # pragma: no cover - compiled
    n_corners = len(corner_vertex)
    limit = 2 * (n_corners // 3)  # a face has at most one obtuse corner, which gives at most two updates
    corners = np.zeros((limit, 3), np.int64)
    shape = np.zeros((limit, 3), np.float64)
    count = 0
    for h in range(n_corners):
        base = h - h % 3
        c = corner_vertex[h]
        a = corner_vertex[base + (h + 1) % 3]
        b = corner_vertex[base + (h + 2) % 3]
        # the plane of the face: c at the origin, a on the positive axis, b above it
        ax = np.sqrt(((points[a] - points[c]) ** 2).sum())
        cb = points[b] - points[c]
        if ax == 0.0:
            continue
        bx = ((points[a] - points[c]) * cb).sum() / ax
        by = np.sqrt(max((cb**2).sum() - bx * bx, 0.0))
        cb_length = np.sqrt(bx * bx + by * by)
        if bx >= -RIGHT_ANGLE * cb_length or by == 0.0:
            continue
        # (lx, ly), (rx, ry): the unfolded edge in front; d must see the angle within 90 degrees of both a and b
        left, lx, ly = a, ax, 0.0
        right, rx, ry = b, bx, by
        gate = opposite[h]
        for _ in range(UNFOLD_STEPS):
            if gate < 0:
                break
            d = corner_vertex[gate]
            ex, ey = rx - lx, ry - ly
            length = np.sqrt(ex * ex + ey * ey)
            if length == 0.0:
                break
            # in space, d relative to the edge (left, right)
            edge = points[right] - points[left]
            to_d = points[d] - points[left]
            along = (edge * to_d).sum() / length
            away = np.sqrt(max((to_d**2).sum() - along * along, 0.0))
            # the side away from c
            nx, ny = ey / length, -ex / length
            if nx * -lx + ny * -ly > 0.0:
                nx, ny = -nx, -ny
            dx = lx + along * ex / length + away * nx
            dy = ly + along * ey / length + away * ny
            slack = RIGHT_ANGLE * np.sqrt(dx * dx + dy * dy)
            acute_to_a = dx >= -slack
            acute_to_b = dx * bx + dy * by >= -slack * cb_length
            if acute_to_a and acute_to_b:
                for side in range(2):
                    e = a if side == 0 else b
                    px = ax if side == 0 else bx
                    py = 0.0 if side == 0 else by
                    span = np.sqrt((dx - px) ** 2 + (dy - py) ** 2)
                    if span == 0.0 or e == d or d == c:
                        continue
                    x = -(px * (dx - px) + py * (dy - py)) / span
                    y = abs(px * (dy - py) - py * (dx - px)) / span
                    corners[count, 0], corners[count, 1], corners[count, 2] = c, e, d
                    shape[count, 0], shape[count, 1], shape[count, 2] = span, x, y
                    count += 1
                break
            # d is outside the range: go on across the edge that the range passes through
            face = gate - gate % 3
            if acute_to_a:  # too far towards a: cross the edge (d, right)
                left_new, right_new = d, right
                lx, ly = dx, dy
            else:
                left_new, right_new = left, d
                rx, ry = dx, dy
            for i in range(3):
                v = corner_vertex[face + i]
                if v != left_new and v != right_new:
                    gate = opposite[face + i]
            left, right = left_new, right_new
    return corners[:count], shape[:count]
