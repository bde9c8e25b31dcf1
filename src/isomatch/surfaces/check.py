"""Examine a mesh for defects. All operations are on whole arrays, which may contain anything."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import BoolArray, FloatArray, IntArray
from isomatch.surfaces._coincident import first_equal
from isomatch.surfaces._edges import EdgeTable, edge_table, fans, linked
from isomatch.surfaces._faces import unsound_faces
from isomatch.surfaces._winding import faces_to_rewind
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.report import SLIVER_RATIO, ZERO_AREA_RATIO, MeshReport


def check(mesh: Mesh) -> MeshReport:
    """Report every defect of a mesh that affects distances or matching.

    Parameters
    ----------
    mesh : Mesh
        Any mesh; its arrays may contain anything.

    Returns
    -------
    MeshReport
        ``fatal``, ``warnings`` and ``ok`` summarise it; ``print(report)`` shows a table.

    Notes
    -----
    O(n log n) time and O(n) memory: 0.4 s for 100 000 vertices.

    Examples
    --------
    A tetrahedron and a vertex that no face uses:

    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 5]]
    >>> report = check(Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    >>> report.euler_number, report.unused_vertices.tolist(), report.ok
    (2, [4], False)
    """
    bad = unsound_faces(mesh.vertices, mesh.faces)
    sound = np.flatnonzero(~bad.any)
    faces = mesh.faces[sound]
    edges = edge_table(faces, mesh.n_vertices)
    inconsistent = edges.edge_of_meeting[edges.is_pair & edges.same_direction]
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[faces] = True
    finite = np.isfinite(mesh.vertices).all(axis=1)
    # Dividing by the largest coordinate keeps squares and products from overflowing.
    scale = float(np.abs(mesh.vertices[used]).max(initial=0.0)) or 1.0
    points = np.where(used[:, None], mesh.vertices, 0.0) / scale
    areas, flatness = _areas_and_flatness(points, faces)
    components = _Components.of(faces, edges, inconsistent, used, areas, points)
    return MeshReport(
        n_vertices=mesh.n_vertices,
        n_faces=mesh.n_faces,
        euler_number=int(used.sum()) - len(edges.ends) + len(faces),
        component_vertices=components.n_vertices,
        component_shares=components.shares,
        boundary_edges=edges.ends[edges.n_faces == 1],
        boundary_lengths=_boundary_lengths(points, edges.ends[edges.n_faces == 1], scale),
        non_finite_vertices=np.flatnonzero(~finite),
        out_of_range_faces=np.flatnonzero(bad.out_of_range),
        repeated_index_faces=np.flatnonzero(bad.repeated_index),
        duplicate_faces=np.flatnonzero(bad.duplicate),
        zero_area_faces=sound[flatness <= ZERO_AREA_RATIO],
        sliver_faces=sound[(flatness > ZERO_AREA_RATIO) & (flatness < SLIVER_RATIO)],
        unused_vertices=np.flatnonzero(finite & ~used),
        coincident_vertices=np.flatnonzero(
            finite & (first_equal(mesh.vertices) != np.arange(mesh.n_vertices))
        ),
        non_manifold_edges=edges.ends[edges.n_faces > 2],
        non_manifold_vertices=np.flatnonzero(fans(faces, edges, mesh.n_vertices) > 1),
        inconsistent_edges=edges.ends[inconsistent],
        inward_components=components.inward,
    )


@dataclass(frozen=True)
class _Components:
    n_vertices: IntArray
    shares: FloatArray
    inward: IntArray

    @classmethod
    def of(
        cls,
        faces: IntArray,
        edges: EdgeTable,
        inconsistent: IntArray,
        used: BoolArray,
        areas: FloatArray,
        points: FloatArray,
    ) -> _Components:
        """Measure the connected components that have faces, largest area first."""
        _, label = linked(edges.ends, len(points))
        names, label_used = np.unique(label[used], return_inverse=True)
        sizes = np.bincount(label_used, minlength=len(names))
        of_vertex = np.zeros(len(points), dtype=np.int64)
        of_vertex[used] = label_used
        of_face = of_vertex[faces[:, 0]]
        area = np.bincount(of_face, areas, len(names))
        inward = np.zeros(len(names), dtype=bool)
        inward[of_face[faces_to_rewind(points, faces)]] = True
        inward[of_vertex[edges.ends[inconsistent, 0]]] = False
        order = np.lexsort([-sizes, -area])
        total = area.sum()
        shares = area[order] / total if total > 0 else np.zeros(len(names))
        return cls(sizes[order], shares, np.flatnonzero(inward[order]))


def _areas_and_flatness(points: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Compute the area of each face, and the ratio of its smallest altitude to its longest edge, both (m,).

    The ratio is 0 if all three corners coincide. It is twice the area over the square of the longest edge.
    """
    a, b, c = (points[faces[:, i]] for i in range(3))
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    flatness = np.divide(doubled, longest, out=np.zeros(len(faces)), where=longest > 0)
    return np.where(flatness > ZERO_AREA_RATIO, doubled / 2, 0.0), flatness


def _boundary_lengths(points: FloatArray, boundary: IntArray, scale: float) -> FloatArray:
    """Compute the length of each connected piece of the boundary, longest first.

    The points are in units of ``scale``, the lengths are not.
    """
    vertices, ends = np.unique(boundary, return_inverse=True)
    ends = ends.reshape(-1, 2)
    count, label = linked(ends, len(vertices))
    lengths = np.linalg.norm(points[boundary[:, 0]] - points[boundary[:, 1]], axis=1)
    loops: FloatArray = np.bincount(label[ends[:, 0]], lengths, count).astype(np.float64)
    with np.errstate(over="ignore"):  # lengths beyond the largest float become infinite
        return np.sort(loops)[::-1] * scale
