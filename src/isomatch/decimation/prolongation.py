"""Points carried between a mesh and the coarser one made of it by `decimate`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, Float32Array, FloatArray, IntArray, single
from isomatch._core.cached import cached_property
from isomatch._core.compiled import compiled
from isomatch._core.errors import MeshError
from isomatch._core.threads import parallel_map
from isomatch.decimation._collapse import FIRST, Index, other_vertices
from isomatch.decimation.decimation import Decimated, normalised
from isomatch.decimation.placed import (
    CHUNK_POINTS,
    PlacedMesh,
    VertexGroups,
    linked_corners,
    nearest_in_face,
    sort_corners,
)
from isomatch.surfaces import Mesh, PrecisePoints, vertex_normals

# Least cosine between the normals of a fine vertex and of a coarse face that suits it (60°). If the cosine is
# less, the squared distance of the face grows by NORMAL_WEIGHT × area of the coarse vertex × missing cosine;
# chosen.
MIN_FACING_COSINE, NORMAL_WEIGHT = 0.5, 0.2
# Length added to the radius of each face's bounding ball, so that rounding excludes no face, where positions lie
# in [−1, 1]; chosen above their rounding, 6e-8.
MAX_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Prolongation:
    """Carries points from a fine mesh to its decimation by `decimate`, and back, along the surface.

    Another finger, or the other lip, is no image, even if it is near in space: the search stays
    near the vertices that the decimation has merged, and normals distinguish the two sides of a
    thin wall.
    """

    fine: Mesh
    coarse: Decimated

    def __post_init__(self) -> None:
        if len(self.coarse.owner) != self.fine.n_vertices:
            raise MeshError(
                f"the coarse mesh was made of one with {len(self.coarse.owner)} vertices, but the fine mesh has "
                f"{self.fine.n_vertices}; give decimate(fine, n_vertices)"
            )

    def __repr__(self) -> str:
        return f"Prolongation({self.fine.n_vertices} → {self.coarse.mesh.n_vertices} vertices)"

    @cached_property
    def on_coarse(self) -> PrecisePoints:
        """The place (n points) of each fine vertex on the coarse mesh, its corner of greatest weight first."""
        # The place is the nearest point of the coarse faces around the owner and its neighbours, about 25 for
        # each vertex. Faces around the owner come first, so that most others can be passed over.
        points, _, _ = normalised(self.fine.vertices)
        normals = vertex_normals(points, self.fine.sound_faces)
        coarse = self._coarse
        start, near = _faces_near(coarse)
        tolerance = NORMAL_WEIGHT * coarse.vertex_areas
        tables = coarse.vertices, tolerance, coarse.faces, *_frames(coarse), start, near
        places = PrecisePoints.at_vertices(self.coarse.owner)

        def chunk(first: int) -> None:
            last = min(first + CHUNK_POINTS, len(points))
            _nearest_on_coarse(first, last, points, normals, *tables, *places)

        parallel_map(chunk, range(0, self.fine.n_vertices, CHUNK_POINTS))
        return places

    @cached_property
    def nearest_members(self) -> IntArray:
        """(n_coarse,) the nearest fine vertex among those merged into each coarse vertex."""
        nearest = np.full(self.coarse.mesh.n_vertices, -1, dtype=np.int64)
        _fill_nearest(self.fine.vertices, self.coarse.mesh.vertices, self.coarse.owner, nearest)
        return nearest

    def near_fine(self, positions: FloatArray, corners: IntArray) -> PrecisePoints:
        """Carry positions (m, 3) on or near the coarse mesh to the fine one, the inverse of `on_coarse`. O(m).

        The search starts at the fine vertices merged into corners (m, q), coarse vertices near each
        position. It finds the nearest point in fine triangles whose corners are at their places on
        the coarse mesh: exact where the fine triangles lie in coarse ones, and otherwise off by
        less than a fine triangle. The corner of greatest weight comes first.
        """
        _, centre, size = normalised(self.fine.vertices)
        return self._placed.inverse((positions - centre) / size, corners)

    @cached_property
    def _coarse(self) -> Mesh:
        """The coarse mesh in units in which squares neither overflow nor underflow."""
        _, centre, size = normalised(self.fine.vertices)
        return Mesh((self.coarse.mesh.vertices - centre) / size, self.coarse.mesh.faces)

    @cached_property
    def _placed(self) -> PlacedMesh:
        """The fine mesh with its vertices at their places on the coarse one."""
        places = self.on_coarse.interpolated(self._coarse.vertices)
        return PlacedMesh(self.fine, places, VertexGroups.of(self.coarse.owner, self.coarse.mesh.n_vertices))


def _faces_near(mesh: Mesh) -> tuple[AnyArray, AnyArray]:
    """Faces around each vertex a, then those around its neighbours: ``near[start[a]:start[a + 1]]``."""
    marks, corners = linked_corners(mesh)
    start = np.zeros(mesh.n_vertices + 1, dtype=np.int64)
    last_seen_by = np.full(mesh.n_faces, -1, dtype=np.int32)
    _list_near(marks, corners, last_seen_by, start, np.empty(0, dtype=np.int32))
    near = np.empty(start[-1], dtype=np.int32)
    last_seen_by[:] = -1
    _list_near(marks, corners, last_seen_by, start, near)
    return start, near


@compiled()
def _list_near(
    marks: AnyArray, corners: AnyArray, last_seen_by: AnyArray, start: IntArray, near: AnyArray
) -> None:
    """List the faces near each vertex; only count them if ``near`` is empty."""
    count = 0
    for v in range(len(marks)):
        corner = marks[v, FIRST]
        while corner >= 0:
            count = _list_face(corner // 3, v, last_seen_by, near, count)
            corner = corners[corner, 1]
        corner = marks[v, FIRST]
        while corner >= 0:
            for w in other_vertices(corners, corner):
                around = marks[w, FIRST]
                while around >= 0:
                    count = _list_face(around // 3, v, last_seen_by, near, count)
                    around = corners[around, 1]
            corner = corners[corner, 1]
        start[v + 1] = count


@compiled(inline="always")
def _list_face(face: Index, v: Index, last_seen_by: AnyArray, near: AnyArray, count: int) -> int:
    """List a face that v has not yet seen."""
    if last_seen_by[face] == v:
        return count
    last_seen_by[face] = v
    if len(near):
        near[count] = face
    return count + 1


def _frames(mesh: Mesh) -> tuple[Float32Array, FloatArray]:
    """Balls (m, 4) that contain the faces, and a frame of each face, (m, 15); nan without area."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    centre = (a + b + c) / 3
    radius = np.sqrt(np.max([((x - centre) ** 2).sum(axis=1) for x in (a, b, c)], axis=0)) + MAX_ROUNDING
    cross = mesh.face_cross
    squared = (cross**2).sum(axis=1)
    squared[squared == 0] = np.nan
    gradient_b = np.cross(c - a, cross) / squared[:, None]  # gradient of the barycentric weight of b
    gradient_c = np.cross(cross, b - a) / squared[:, None]
    # squared distance along which each weight changes by 1
    heights = [1 / (g**2).sum(axis=1) for g in (gradient_b + gradient_c, gradient_b, gradient_c)]
    frames = np.column_stack([centre, cross / np.sqrt(squared)[:, None], gradient_b, gradient_c, *heights])
    return single(np.column_stack([centre, radius])), frames


@compiled(error_model="numpy")
def _nearest_on_coarse(
    first: int,
    last: int,
    points: FloatArray,
    normals: FloatArray,
    x: FloatArray,
    tolerance: FloatArray,
    faces: IntArray,
    balls: Float32Array,
    frames: FloatArray,
    start: AnyArray,
    near: AnyArray,
    corners: IntArray,
    barycentric: FloatArray,
) -> None:
    """Replace the owners in ``corners`` by the nearest points in faces near them, nearest corner first."""
    for i in range(first, last):
        owner = corners[i, 0]
        best = reach = np.inf
        for k in range(start[owner], start[owner + 1]):
            f = near[k]
            px, py, pz = points[i, 0] - balls[f, 0], points[i, 1] - balls[f, 1], points[i, 2] - balls[f, 2]
            if px * px + py * py + pz * pz >= (reach + balls[f, 3]) ** 2:
                continue
            px, py, pz = points[i, 0] - frames[f, 0], points[i, 1] - frames[f, 1], points[i, 2] - frames[f, 2]
            height = px * frames[f, 3] + py * frames[f, 4] + pz * frames[f, 5]
            s = px * frames[f, 6] + py * frames[f, 7] + pz * frames[f, 8] + 1 / 3
            t = px * frames[f, 9] + py * frames[f, 10] + pz * frames[f, 11] + 1 / 3
            r = 1.0 - s - t
            cost = height * height
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            if not (r >= 0.0 and s >= 0.0 and t >= 0.0):  # beyond an edge: no nearer than its line
                outside = 0.0
                if r < 0.0:
                    outside = r * r * frames[f, 12]
                if s < 0.0:
                    outside = max(outside, s * s * frames[f, 13])
                if t < 0.0:
                    outside = max(outside, t * t * frames[f, 14])
                if cost + outside >= best:
                    continue
                px, py, pz = points[i, 0] - x[a, 0], points[i, 1] - x[a, 1], points[i, 2] - x[a, 2]
                s, t, gain = nearest_in_face(x, a, b, c, px, py, pz)
                r = 1.0 - s - t
                cost = px * px + py * py + pz * pz + gain
            if cost >= best:
                continue
            facing = (
                frames[f, 3] * normals[i, 0] + frames[f, 4] * normals[i, 1] + frames[f, 5] * normals[i, 2]
            )
            if not facing <= MIN_FACING_COSINE:  # ``<=`` is false for nan, the cosine of a face without area
                facing = MIN_FACING_COSINE if facing > MIN_FACING_COSINE else 0.0
            cost += tolerance[owner] * (MIN_FACING_COSINE - facing)
            if cost < best:
                best, reach = cost, np.sqrt(max(cost, 0.0))
                corners[i, 0], corners[i, 1], corners[i, 2] = a, b, c
                barycentric[i, 0], barycentric[i, 1], barycentric[i, 2] = r, s, t
        sort_corners(corners, barycentric, i)


@compiled()
def _fill_nearest(fine: FloatArray, coarse: FloatArray, owner: IntArray, nearest: IntArray) -> None:
    """Find the nearest fine vertex that each coarse vertex owns."""
    least = np.full(len(coarse), np.inf)
    for v in range(len(fine)):
        w = owner[v]
        squared = (
            (fine[v, 0] - coarse[w, 0]) ** 2
            + (fine[v, 1] - coarse[w, 1]) ** 2
            + (fine[v, 2] - coarse[w, 2]) ** 2
        )
        if squared <= least[w]:
            nearest[w], least[w] = v, squared
