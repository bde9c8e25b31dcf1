"""A mesh whose vertices have places in space: a piecewise linear map, and its inverse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray, read_only
from isomatch._core.cached import cached_property
from isomatch._core.compiled import compiled
from isomatch._core.threads import parallel_map
from isomatch.decimation._collapse import Index, difference, link_corners, other_vertices
from isomatch.surfaces import Mesh, PrecisePoints, nearest_in_triangle

MAX_STARTS = 8  # vertices of a group, at most, that are compared to start a search at the nearest; chosen
# A point is inside a face, and the search ends, if all its barycentric weights exceed the first bound, chosen
# far above rounding, and its squared distance is at most the second, chosen far below the squared size of a
# face. The mesh is scaled to [−1, 1].
MIN_INSIDE_WEIGHT, MAX_SQUARED_DISTANCE = 1e-9, 1e-20
CHUNK_POINTS = 8192  # number of points of one task; chosen, and the same for any number of threads


class VertexGroups(NamedTuple):
    """Vertices in groups: group a has the vertices ``members[start[a]:start[a + 1]]``, increasing."""

    start: AnyArray
    members: AnyArray

    @classmethod
    def of(cls, group: IntArray, n_groups: int) -> VertexGroups:
        """Sort vertices by their group (n,), −1 without a group."""
        order = np.argsort(group, kind="stable")
        start = np.searchsorted(group, np.arange(n_groups + 1), sorter=order)
        return cls(start - start[0], order[start[0] :].astype(np.int32))


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """A mesh and the places (n, 3) of its vertices in space, linear in between."""

    mesh: Mesh
    places: FloatArray  # places in [−1, 1], so that no square overflows or vanishes; nan without a place
    groups: VertexGroups  # groups of the mesh's vertices; a search starts in the groups near a position

    def inverse(self, positions: FloatArray, near: IntArray) -> PrecisePoints:
        """Find the points of the mesh whose places are nearest to positions (m, 3). O(m).

        The search starts at the nearest vertex in groups (m, q) near each position, at least one of
        which has a vertex with a place. It goes to neighbours that are nearer, and then to the
        faces around, so that it never reaches another sheet. The corner of greatest weight comes
        first.
        """
        preimages = PrecisePoints.at_vertices(np.zeros(len(near), dtype=np.int64))
        arguments = positions, near, read_only(self.places), *self.groups, *self._linked_corners
        # Positions of a group follow one another, so that the cache serves them.
        by_group = VertexGroups.of(near[:, 0], len(self.groups.start) - 1).members

        def chunk(first: int) -> None:
            _inverse_image(by_group[first : first + CHUNK_POINTS], *arguments, *preimages)

        parallel_map(chunk, range(0, len(near), CHUNK_POINTS))
        return preimages

    @cached_property
    def _linked_corners(self) -> tuple[AnyArray, AnyArray]:
        """The corners of the faces, listed at each vertex."""
        return linked_corners(self.mesh)


def linked_corners(mesh: Mesh) -> tuple[AnyArray, AnyArray]:
    """List the corners of the faces at each vertex; see `_collapse`."""
    marks = np.empty((mesh.n_vertices, 1), dtype=np.int32)
    corners = np.empty((mesh.faces.size, 2), dtype=np.int32)
    corners[:, 0] = mesh.sound_faces.ravel()
    link_corners(marks, corners)
    return marks, corners


@compiled(error_model="numpy")
def _inverse_image(
    rows: AnyArray,
    queries: FloatArray,
    corners: IntArray,
    places: FloatArray,
    start: AnyArray,
    members: AnyArray,
    marks: AnyArray,
    linked: AnyArray,
    preimage: IntArray,
    weights: FloatArray,
) -> None:
    """Find the points of the fine mesh whose places are nearest to queries near the coarse mesh."""
    for i in rows:
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        nearest, least = np.int64(0), np.inf
        for j in range(corners.shape[1]):
            owner = corners[i, j]
            step = (start[owner + 1] - start[owner]) // MAX_STARTS + 1
            for k in range(start[owner], start[owner + 1], step):
                v = np.int64(members[k])
                squared = (places[v, 0] - qx) ** 2 + (places[v, 1] - qy) ** 2 + (places[v, 2] - qz) ** 2
                if squared < least:
                    nearest, least = v, squared
        centre = np.int64(-1)
        while centre != nearest:
            centre = nearest
            corner = marks[centre, 0]
            while corner >= 0:
                for v in other_vertices(linked, corner):
                    squared = (places[v, 0] - qx) ** 2 + (places[v, 1] - qy) ** 2 + (places[v, 2] - qz) ** 2
                    if squared < least:
                        nearest, least = v, squared
                corner = linked[corner, 1]
        preimage[i, 0] = preimage[i, 1] = preimage[i, 2] = nearest
        for k in range(3):  # around the nearest vertex, then around the other corners of the face found
            a = preimage[i, k]
            px, py, pz = qx - places[a, 0], qy - places[a, 1], qz - places[a, 2]
            corner = marks[a, 0]
            while corner >= 0:
                b, c = other_vertices(linked, corner)
                corner = linked[corner, 1]
                s, t, gain = nearest_in_face(places, a, b, c, px, py, pz)
                squared = px * px + py * py + pz * pz + gain
                if squared < least:
                    least = squared
                    preimage[i, 0], preimage[i, 1], preimage[i, 2] = a, b, c
                    weights[i, 0], weights[i, 1], weights[i, 2] = 1.0 - s - t, s, t
            if (
                least <= MAX_SQUARED_DISTANCE
                and min(weights[i, 0], weights[i, 1], weights[i, 2]) > MIN_INSIDE_WEIGHT
            ):
                break
        sort_corners(preimage, weights, i)


@compiled(error_model="numpy")
def nearest_in_face(
    x: FloatArray, a: Index, b: Index, c: Index, px: float, py: float, pz: float
) -> tuple[float, float, float]:
    """Call `nearest_in_triangle` for a triangle and a point given by its position from a."""
    ux, uy, uz = difference(x, b, a)
    vx, vy, vz = difference(x, c, a)
    return nearest_in_triangle(
        ux * ux + uy * uy + uz * uz,
        ux * vx + uy * vy + uz * vz,
        vx * vx + vy * vy + vz * vz,
        ux * px + uy * py + uz * pz,
        vx * px + vy * py + vz * pz,
    )


@compiled(error_model="numpy")
def sort_corners(corners: IntArray, barycentric: FloatArray, i: int) -> None:
    """Turn the corners of a point so that the one of greatest weight comes first."""
    k = 0
    for j in range(1, 3):
        if barycentric[i, j] > barycentric[i, k]:
            k = j
    a, b, c = corners[i, k], corners[i, (k + 1) % 3], corners[i, (k + 2) % 3]
    r, s, t = barycentric[i, k], barycentric[i, (k + 1) % 3], barycentric[i, (k + 2) % 3]
    corners[i, 0], corners[i, 1], corners[i, 2] = a, b, c
    barycentric[i, 0], barycentric[i, 1], barycentric[i, 2] = r, max(s, 0.0), max(t, 0.0)
