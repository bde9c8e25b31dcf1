"""Points carried between a mesh and the coarser one made of it by `decimate`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from isomatch._arrays import AnyArray, FloatArray, IntArray
from isomatch._compiled import compiled
from isomatch._threads import parallel_map
from isomatch.errors import InputError, MeshError
from isomatch.surfaces._collapse import link_corners, other_vertices
from isomatch.surfaces.decimation import Decimated, normalised
from isomatch.surfaces.mesh import Mesh, vertex_normals
from isomatch.surfaces.precise_points import PrecisePoints, nearest_in_triangle

NORMAL_WEIGHT = (
    0.1  # of 1 − cos of the angle between normals, times the coarse vertex area, beside squared distances
)
CHUNK = 8192  # points at once; fixed, so that results do not depend on the number of threads


@dataclass(frozen=True, eq=False, repr=False)
class Transfer:
    """Carries points from a fine mesh to a coarse one, and back, along the surface.

    A neighbouring sheet, such as another finger or the other lip, is never an image, however near it is in space: a point
    is only sought where the decimation has merged vertices with those around it.

    Parameters
    ----------
    fine : Mesh
        With n vertices.
    coarse : Decimated
        What `decimate` made of it.

    Raises
    ------
    MeshError
        If the decimated mesh was not made of the fine one.

    Examples
    --------
    >>> turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    >>> points = [[np.cos(t), np.sin(t), z] for t in turn for z in (0.0, 0.2)]
    >>> faces = [face for i in range(0, 40, 2) for face in ((i, i + 2, i + 1), (i + 1, i + 2, i + 3))]
    >>> fine = Mesh(points, np.array(faces) % 40)
    >>> transfer = Transfer(fine, decimate(fine, 20))
    >>> there_and_back = transfer.to_fine(transfer.on_coarse)
    >>> bool((there_and_back.corners[:, 0] == np.arange(40)).all())
    True
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
        return f"Transfer({self.fine.n_vertices} → {self.coarse.mesh.n_vertices} vertices)"

    @cached_property
    def on_coarse(self) -> PrecisePoints:
        """The point of the coarse mesh nearest to each fine vertex, n points; the nearest corner comes first.

        Sought on the coarse faces around its owner and the neighbours of that, by position and normal. About 25 n faces.
        """
        coarse = self._coarse
        start, near = _faces_near(coarse)
        found = PrecisePoints.at_vertices(self.coarse.owner)

        def chunk(first: int) -> None:
            rows = slice(first, first + CHUNK)
            _nearest_on_coarse(
                self._points[rows],
                self._normals[rows],
                coarse.vertices,
                self._tolerance,
                coarse.faces,
                start,
                near,
                found.corners[rows],
                found.barycentric[rows],
            )

        parallel_map(chunk, range(0, self.fine.n_vertices, CHUNK))
        return found

    def to_fine(self, points: PrecisePoints) -> PrecisePoints:
        """Find the point of the fine mesh nearest to each of m points of the coarse one.

        The nearest vertex, by position and normal, is sought among those merged into the corners of the coarse face, and
        from there by steps to neighbours that are nearer. Then the nearest point in the faces around it.

        Parameters
        ----------
        points : PrecisePoints
            m points of the coarse mesh.

        Returns
        -------
        PrecisePoints
            m points; the nearest vertex is the first corner.

        Raises
        ------
        InputError
            If a corner is no vertex of the coarse mesh.
        """
        coarse = self.coarse.mesh
        corners = points.corners
        if len(corners) and not 0 <= corners.min() <= corners.max() < coarse.n_vertices:
            raise InputError(
                f"points have corners outside 0…{coarse.n_vertices - 1}, the vertices of the coarse mesh, so they are "
                "points of another one"
            )
        positions, normals = (
            points.interpolated(values) for values in (coarse.vertices, coarse.vertex_normals)
        )
        return self.near_fine(positions, normals, corners)

    def near_fine(self, positions: FloatArray, normals: FloatArray, corners: IntArray) -> PrecisePoints:
        """Find the point of the fine mesh nearest to each of m positions near the coarse one.

        Parameters
        ----------
        positions, normals : (m, 3) arrays of float
            Normals of any length.
        corners : (m, q) array of int
            Coarse vertices near each position: the nearest fine vertex is sought from those merged into them.

        Returns
        -------
        PrecisePoints
            As of `to_fine`.
        """
        _, centre, size = self._normalised
        queries = np.empty((len(positions), 7))  # position, normal × tolerance, tolerance
        queries[:, :3] = (positions - centre) / size
        queries[:, 6] = self._tolerance[corners[:, 0]]
        length = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
        queries[:, 3:6] = normals * (queries[:, 6] / length)[:, None]
        found = PrecisePoints.at_vertices(np.zeros(len(corners), dtype=np.int64))
        (start, members), (marks, linked) = self._members, self._linked_corners

        def chunk(first: int) -> None:
            rows = slice(first, first + CHUNK)
            _nearest_on_fine(
                queries[rows],
                corners[rows],
                self._points,
                self._normals,
                start,
                members,
                marks,
                linked,
                found.corners[rows],
                found.barycentric[rows],
            )

        parallel_map(chunk, range(0, len(corners), CHUNK))
        return found

    @cached_property
    def _normalised(self) -> tuple[FloatArray, FloatArray, float]:
        return normalised(self.fine.vertices)

    @property
    def _points(self) -> FloatArray:
        """(n, 3) fine vertices, in units in which squares neither overflow nor underflow."""
        return self._normalised[0]

    @cached_property
    def _normals(self) -> FloatArray:
        """(n, 3) unit normals of the fine vertices."""
        return vertex_normals(self._points, self.fine.sound_faces)

    @cached_property
    def _coarse(self) -> Mesh:
        """The coarse mesh in the same units."""
        _, centre, size = self._normalised
        return Mesh((self.coarse.mesh.vertices - centre) / size, self.coarse.mesh.faces)

    @cached_property
    def _tolerance(self) -> FloatArray:
        """(n_coarse,) squared distance that weighs as much as a right angle between normals at each coarse vertex."""
        return NORMAL_WEIGHT * self._coarse.vertex_areas

    @cached_property
    def _members(self) -> tuple[AnyArray, AnyArray]:
        """Fine vertices of each owner a: ``members[start[a]:start[a + 1]]``."""
        n, owner = self.fine.n_vertices, self.coarse.owner
        of_owner = csr_array(
            (np.ones(n, dtype=bool), (owner, np.arange(n))), shape=(self.coarse.mesh.n_vertices, n)
        )
        return of_owner.indptr, of_owner.indices

    @cached_property
    def _linked_corners(self) -> tuple[AnyArray, AnyArray]:
        """The corners of the fine faces, listed at each vertex."""
        marks = np.empty((self.fine.n_vertices, 1), dtype=np.int32)
        corners = np.empty((self.fine.faces.size, 2), dtype=np.int32)
        corners[:, 0] = self.fine.sound_faces.ravel()
        link_corners(marks, corners)
        return marks, corners


def _faces_near(mesh: Mesh) -> tuple[AnyArray, AnyArray]:
    """Faces around each vertex a and around its neighbours: ``near[start[a]:start[a + 1]]``."""
    entries = (
        np.ones(mesh.faces.size, dtype=bool),
        (mesh.faces.ravel(), np.repeat(np.arange(mesh.n_faces), 3)),
    )
    around = csr_array(entries, shape=(mesh.n_vertices, mesh.n_faces))
    near = (around @ around.T) @ around
    near.sort_indices()
    return near.indptr, near.indices


@compiled(error_model="numpy")
def _nearest_on_coarse(
    points: FloatArray,
    normals: FloatArray,
    x: FloatArray,
    tolerance: FloatArray,
    faces: IntArray,
    start: AnyArray,
    near: AnyArray,
    corners: IntArray,
    barycentric: FloatArray,
) -> None:
    """Replace the owners in ``corners`` by the nearest points of the faces near them, the nearest corner first."""
    for i in range(len(points)):
        owner = corners[i, 0]
        best = np.inf
        for at in range(start[owner], start[owner + 1]):
            a, b, c = faces[near[at], 0], faces[near[at], 1], faces[near[at], 2]
            ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
            vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
            px, py, pz = points[i, 0] - x[a, 0], points[i, 1] - x[a, 1], points[i, 2] - x[a, 2]
            s, t, gain = nearest_in_triangle(
                ux * ux + uy * uy + uz * uz,
                ux * vx + uy * vy + uz * vz,
                vx * vx + vy * vy + vz * vz,
                ux * px + uy * py + uz * pz,
                vx * px + vy * py + vz * pz,
            )
            cost = px * px + py * py + pz * pz + gain
            if cost >= best:
                continue
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            facing = nx * normals[i, 0] + ny * normals[i, 1] + nz * normals[i, 2]
            cost += tolerance[owner] * (1.0 - facing / max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300))
            if cost < best:
                best = cost
                r = 1.0 - s - t
                if s > r and s >= t:
                    a, b, c, r, s, t = b, c, a, s, t, r
                elif t > r:
                    a, b, c, r, s, t = c, a, b, t, r, s
                corners[i, 0], corners[i, 1], corners[i, 2] = a, b, c
                barycentric[i, 0], barycentric[i, 1], barycentric[i, 2] = r, s, t


@compiled(error_model="numpy")
def _nearest_on_fine(
    queries: FloatArray,
    corners: IntArray,
    x: FloatArray,
    normals: FloatArray,
    start: AnyArray,
    members: AnyArray,
    marks: AnyArray,
    linked: AnyArray,
    found: IntArray,
    weights: FloatArray,
) -> None:
    """Find the nearest points of the fine mesh, see `Transfer.near_fine`."""
    for i in range(len(corners)):
        q = queries[i]
        best, nearest = np.inf, -1
        for k in range(corners.shape[1]):
            owner = corners[i, k]
            if k > 0 and owner == corners[i, 0]:
                continue
            for at in range(start[owner], start[owner + 1]):
                cost = _cost(x, normals, members[at], q)
                if cost < best:
                    best, nearest = cost, members[at]
        before = -1
        while before != nearest:
            before = nearest
            corner = marks[before, 0]
            while corner >= 0:
                for w in other_vertices(linked, corner):
                    cost = _cost(x, normals, w, q)
                    if cost < best:
                        best, nearest = cost, w
                corner = linked[corner, 1]
        found[i, 0] = found[i, 1] = found[i, 2] = a = nearest
        best = 0.0  # squared distance, less that of the vertex
        px, py, pz = q[0] - x[a, 0], q[1] - x[a, 1], q[2] - x[a, 2]
        corner = marks[a, 0]
        while corner >= 0:
            b, c = other_vertices(linked, corner)
            ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
            vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
            s, t, gain = nearest_in_triangle(
                ux * ux + uy * uy + uz * uz,
                ux * vx + uy * vy + uz * vz,
                vx * vx + vy * vy + vz * vz,
                ux * px + uy * py + uz * pz,
                vx * px + vy * py + vz * pz,
            )
            if gain < best:
                best = gain
                found[i, 1], found[i, 2] = b, c
                weights[i, 0], weights[i, 1], weights[i, 2] = 1.0 - s - t, s, t
            corner = linked[corner, 1]


@compiled(error_model="numpy")
def _cost(x: FloatArray, normals: FloatArray, v: int, q: FloatArray) -> float:
    """Squared distance from a vertex to q, plus the tolerance × (1 − cos of the angle between their normals)."""
    dx, dy, dz = x[v, 0] - q[0], x[v, 1] - q[1], x[v, 2] - q[2]
    facing = normals[v, 0] * q[3] + normals[v, 1] * q[4] + normals[v, 2] * q[5]
    return dx * dx + dy * dy + dz * dz + q[6] - facing
