"""Points carried between a mesh and the coarser one made of it by `decimate`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from isomatch.errors import MeshError
from isomatch.loading.compiled import compiled
from isomatch.resolution._collapse import difference
from isomatch.resolution.decimation import Decimated, normalised
from isomatch.resolution.placed import CHUNK, PlacedMesh, VertexGroups, nearest_in_face, sort_corners
from isomatch.runtime.threads import parallel_map
from isomatch.surfaces import Mesh, PrecisePoints, vertex_normals
from isomatch.values.arrays import AnyArray, FloatArray, IntArray
from isomatch.values.cached import cached_property

LEAST_COSINE = 0.5  # between the normals of a vertex and of a face; what is missing costs, NORMAL_WEIGHT
NORMAL_WEIGHT = 0.2  # times the area of a coarse vertex, beside squared distances


@dataclass(frozen=True, eq=False, repr=False)
class Prolongation:
    """Carries points from a fine mesh to a coarse one, and back, along the surface.

    Another finger, or the other lip, is no image, however near in space: points are only sought where the decimation
    has merged vertices with those around it, and normals tell apart the two sides of what is thin.

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
    >>> from isomatch.resolution import decimate
    >>> turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    >>> points = [[np.cos(t), np.sin(t), z] for t in turn for z in (0.0, 0.2)]
    >>> faces = [face for i in range(0, 40, 2) for face in ((i, i + 2, i + 1), (i + 1, i + 2, i + 3))]
    >>> fine = Mesh(points, np.array(faces) % 40)
    >>> prolongation = Prolongation(fine, decimate(fine, 20))
    >>> places = prolongation.on_coarse
    >>> positions = places.interpolated(prolongation.coarse.mesh.vertices)
    >>> there_and_back = prolongation.near_fine(positions, places.corners)
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
        return f"Prolongation({self.fine.n_vertices} → {self.coarse.mesh.n_vertices} vertices)"

    @cached_property
    def on_coarse(self) -> PrecisePoints:
        """The place of each fine vertex on the coarse mesh, n points; the corner of greatest weight comes first.

        This is the nearest point of the coarse faces around its owner and the neighbours of that. A face counts as
        farther away if its normal differs by more than 60° from that of the vertex. About 25 n faces.
        """
        points, _, _ = normalised(self.fine.vertices)
        normals = vertex_normals(points, self.fine.sound_faces)
        coarse = self._coarse
        start, near = _faces_near(coarse)
        places = PrecisePoints.at_vertices(self.coarse.owner)
        by_owner = self._groups.members

        def chunk(first: int) -> None:
            _nearest_on_coarse(
                by_owner[first : first + CHUNK],
                points,
                normals,
                coarse.vertices,
                NORMAL_WEIGHT * coarse.vertex_areas,
                coarse.faces,
                start,
                near,
                *places,
            )

        parallel_map(chunk, range(0, self.fine.n_vertices, CHUNK))
        return places

    @cached_property
    def nearest_members(self) -> IntArray:
        """(n_coarse,) the nearest of the fine vertices merged into each coarse one."""
        owner = self.coarse.owner
        apart = ((self.fine.vertices - self.coarse.mesh.vertices[owner]) ** 2).sum(axis=1)
        nearest = np.zeros(self.coarse.mesh.n_vertices, dtype=np.int64)
        farthest_first = np.argsort(-apart, kind="stable")
        nearest[owner[farthest_first]] = farthest_first  # of several, the last one stays
        return nearest

    def near_fine(self, positions: FloatArray, corners: IntArray) -> PrecisePoints:
        """Carry m positions on or near the coarse mesh to the fine one: the inverse of `on_coarse`.

        Parameters
        ----------
        positions : (m, 3) array of float
            In the units of the meshes.
        corners : (m, q) array of int
            Coarse vertices near each position: the search starts at the fine vertices merged into them.

        Returns
        -------
        PrecisePoints
            m points of the fine mesh; the corner of greatest weight comes first. Of all points in its triangles, whose
            corners are taken at their places on the coarse mesh, the nearest. So it is exact where the fine triangles lie
            in coarse ones, and otherwise off by less than a fine triangle.

        Notes
        -----
        The nearest vertex is sought among those merged into the corners, and from there by steps to neighbours that are
        nearer; the point, in the faces around it. O(m).
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
        places: FloatArray = self.on_coarse.interpolation(self._coarse.n_vertices) @ self._coarse.vertices
        return PlacedMesh(self.fine, places, self._groups)

    @cached_property
    def _groups(self) -> VertexGroups:
        return VertexGroups.of(self.coarse.owner, self.coarse.mesh.n_vertices)


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
    rows: AnyArray,
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
    for i in rows:
        owner = corners[i, 0]
        best = np.inf
        for at in range(start[owner], start[owner + 1]):
            a, b, c = faces[near[at], 0], faces[near[at], 1], faces[near[at], 2]
            px, py, pz = points[i, 0] - x[a, 0], points[i, 1] - x[a, 1], points[i, 2] - x[a, 2]
            s, t, gain = nearest_in_face(x, a, b, c, px, py, pz)
            cost = px * px + py * py + pz * pz + gain
            if cost >= best:
                continue
            ux, uy, uz = difference(x, b, a)
            vx, vy, vz = difference(x, c, a)
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            facing = nx * normals[i, 0] + ny * normals[i, 1] + nz * normals[i, 2]
            facing /= max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
            cost += tolerance[owner] * max(0.0, LEAST_COSINE - facing)
            if cost < best:
                best = cost
                corners[i, 0], corners[i, 1], corners[i, 2] = a, b, c
                barycentric[i, 0], barycentric[i, 1], barycentric[i, 2] = 1.0 - s - t, s, t
        sort_corners(corners, barycentric, i)
