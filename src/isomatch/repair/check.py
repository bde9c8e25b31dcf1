"""Examine a mesh for defects; the report has a field for each kind."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.errors import some
from isomatch.io import Polygons, SurfaceLike, mesh_from
from isomatch.repair._winding import faces_to_rewind, rewind_faces, shells
from isomatch.repair.base import MIN_BASE_SHARE, base_of
from isomatch.repair.gaps import NO_SIDES, close_vertices, free_sides, t_junctions
from isomatch.repair.merged import part_merged_limbs
from isomatch.repair.outliers import find_outliers
from isomatch.repair.walls import WALL_THICKNESS, double_walled_share
from isomatch.surfaces import Mesh, count_fans, first_equal, unsound_faces


def check(mesh: SurfaceLike, *, wall: float = WALL_THICKNESS) -> MeshReport:
    """Report every defect of a mesh that affects distances or matching.

    Parameters
    ----------
    mesh : Mesh, path_like, tuple or object
        Anything that `mesh_from` takes; its arrays may contain anything.
    wall : float
        Largest thickness, in √area, at which two sheets back to back are a double wall; 0 skips the test.

    Returns
    -------
    MeshReport
        ``fatal``, ``warnings`` and ``ok`` summarise it; ``print(report)`` shows a table.

    Notes
    -----
    O(n log n) time, in which only hashes are sorted, and O(n) memory: 0.1 s for 100 000 vertices,
    1.5 s for a million, and 0.2 to 0.7 s more for the walls.

    Examples
    --------
    A tetrahedron and a vertex that no face uses:

    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 5]]
    >>> report = check(Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    >>> report.euler_number, report.unused_vertices.tolist(), report.ok
    (2, [4], False)
    """
    mesh = mesh_from(mesh)
    bad = unsound_faces(mesh.vertices, mesh.faces)
    sound = np.flatnonzero(~bad.any)
    whole = mesh if len(sound) == mesh.n_faces else Mesh(mesh.vertices, mesh.faces[sound])
    faces, edges = whole.faces, whole.edge_table
    n_fans = count_fans(faces, edges, mesh.n_vertices)
    used = n_fans > 0
    finite = np.logical_and.reduce([np.isfinite(x) for x in mesh.vertices.T])
    points = mesh.vertices if used.all() else np.where(used[:, None], mesh.vertices, 0.0)
    # Coordinates are divided by the largest one, so that squares and products do not overflow.
    scale = float(max(points.max(initial=0.0), -points.min(initial=0.0))) or 1.0
    surface = whole.moved(points / scale)
    flatness = np.zeros(len(faces))
    _fill_flatness(surface.vertices, faces, 2 * surface.face_areas, flatness)
    rewound, first = faces_to_rewind(surface), first_equal(mesh.vertices)
    oriented, is_cloud = rewind_faces(surface, rewound), not mesh.n_faces and finite.all()
    seams, no_vertices = part_merged_limbs(oriented).seams, np.zeros(0, dtype=np.int64)
    return MeshReport(
        n_vertices=mesh.n_vertices,
        n_faces=mesh.n_faces,
        euler_number=int(used.sum()) - len(edges.ends) + len(faces),
        **_components(surface, used, np.where(flatness > ZERO_AREA_RATIO, surface.face_areas, 0.0), rewound),
        **_gaps(surface, first, scale),
        boundary_edges=whole.boundary_edges,
        boundary_lengths=whole.boundary_lengths,
        non_finite_vertices=np.flatnonzero(~finite),
        out_of_range_faces=np.flatnonzero(bad.out_of_range),
        repeated_index_faces=np.flatnonzero(bad.repeated_index),
        duplicate_faces=np.flatnonzero(bad.duplicate),
        zero_area_faces=sound[flatness <= ZERO_AREA_RATIO],
        sliver_faces=sound[(flatness > ZERO_AREA_RATIO) & (flatness < SLIVER_RATIO)],
        unused_vertices=np.flatnonzero(finite & ~used),
        coincident_vertices=np.flatnonzero(finite & (first != np.arange(mesh.n_vertices))),
        non_manifold_edges=edges.ends[edges.n_faces > 2],
        non_manifold_vertices=np.flatnonzero(n_fans > 1),
        inconsistent_edges=edges.ends[edges.clash],
        merged_vertices=np.concatenate([no_vertices, *seams]),
        outliers=np.flatnonzero(find_outliers(mesh.vertices)) if is_cloud else no_vertices,
        double_walled=double_walled_share(oriented, wall) if wall else float("nan"),
        planar=base_of(surface).share if wall else float("nan"),
    )


def _gaps(surface: Mesh, first: IntArray, scale: float) -> dict[str, Any]:
    """Find gaps that are meant to be closed; ``first`` (n,) is the first vertex at the same position."""
    polygons = Polygons.of_triangles(surface.faces)
    # Joining points cannot open a boundary, so a mesh without a boundary has no gaps.
    free = free_sides(polygons, first) if (surface.edge_table.n_faces == 1).any() else NO_SIDES
    parted = t_junctions(surface.vertices, polygons, first, free)
    close, tolerance = close_vertices(surface.vertices, free.ends)
    found = {"t_junctions": np.unique(parted.points), "close_vertices": close}
    return {**found, "weld_tolerance": tolerance * scale}


def _components(surface: Mesh, used: BoolArray, areas: FloatArray, rewound: BoolArray) -> dict[str, Any]:
    """Describe components with faces, largest first: vertices, shares of the area, which are solid."""
    sizes = np.bincount(surface.components, used).astype(np.int64)
    has_faces = sizes > 0
    of_vertex = (np.cumsum(has_faces) - 1)[surface.components]
    sizes = sizes[has_faces]
    of_face = of_vertex[surface.faces[:, 0]]
    area = np.bincount(of_face, areas, len(sizes))
    solid, void = shells(surface)
    inward, *kinds = (np.bincount(of_face[rows], minlength=len(sizes)) > 0 for rows in (rewound, solid, void))
    inward[of_vertex[surface.edges[surface.edge_table.clash][:, 0]]] = False
    order = np.lexsort([-sizes, -area])
    total = area.sum()
    shares = area[order] / total if total > 0 else np.zeros(len(sizes))
    names = "inward_components", "solid_components", "void_components"
    numbers = {name: np.flatnonzero(flags[order]) for name, flags in zip(names, (inward, *kinds))}
    return {"component_vertices": sizes[order], "component_shares": shares, **numbers}


@compiled()
def _fill_flatness(points: FloatArray, faces: IntArray, doubled: FloatArray, flatness: FloatArray) -> None:
    """Compute the smallest altitude over the longest edge of each face: twice its area over that edge squared."""
    for f in range(len(faces)):
        longest = 0.0
        b = faces[f, 2]
        for i in range(3):
            a = faces[f, i]
            x, y, z = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]
            squared = x * x + y * y + z * z
            if squared > longest:
                longest = squared
            b = a
        if longest > 0:
            flatness[f] = doubled[f] / longest


# Smallest altitude of a face over its longest edge: a face is taken to have no area if this ratio is at most
# the first number, and is a sliver if it is below the second; chosen.
ZERO_AREA_RATIO, SLIVER_RATIO = 1e-10, 1e-3
# √area; a chamber of a mesh lies outside if it has an opening of at least this diameter; openings of six mouse
# skulls have 0.08 to 0.1: decisions.md, double walls
OPENING_DIAMETER = 0.1
# least share of the area that has another sheet close behind if the surface is called double-walled; bodies,
# animals, organs and bones have up to 0.23, mouse skulls and shells 0.52 and more: decisions.md, double walls
DOUBLE_WALLED_SHARE = 0.35

# For each field of `MeshReport`, in the order of the printed table: what it counts, and after the colon, why
# that matters and what to do.
_FATAL = {
    "non_finite_vertices": "vertices with NaN or infinite coordinates: no distance is defined there; "
    "repair(mesh) removes them and their faces",
    "out_of_range_faces": "faces with a vertex index out of range: the surface is undefined there; "
    "repair(mesh) removes them, or export the file again",
}
_WARNINGS = {
    "repeated_index_faces": "faces with a repeated vertex: they have no area and no normal; repair(mesh) "
    "removes them",
    "duplicate_faces": "faces with the vertices of an earlier face: their area counts twice and their edges "
    "are non-manifold; repair(mesh) removes them",
    "zero_area_faces": "faces of zero area: distances across them are less accurate; remesh if there are "
    "many",
    "sliver_faces": "sliver faces: distances across them are less accurate; remesh if there are many",
    "unused_vertices": "finite vertices that no sound face uses: their distance to all other vertices is "
    "infinite and they are not matched; repair(mesh) removes them",
    "coincident_vertices": "vertices at the position of an earlier vertex: distances, bases and matches take "
    "them for one point; repair(mesh) welds them",
    "non_manifold_edges": "edges of more than two faces: paths may cross from one sheet to another there, "
    "which makes distances shorter; match separates sheets that are far apart along the surface, others need "
    "a mesh editor",
    "non_manifold_vertices": "vertices where several fans of faces meet: sheets touch at a single point "
    "there, and paths pass through it; match splits those that shorten paths, others need a mesh editor",
    "t_junctions": "vertices on the middle of an edge (T-junctions): paths do not cross there, so distances "
    "are too long; repair(mesh) inserts them into the edges",
    "outliers": "points far from all others: distances run over them; match leaves them out, and repair "
    "removes them",
    "merged_vertices": "vertices where limbs that touch were merged: paths cross from one limb to the other "
    "there, as after a merge by distance with too large a distance; match and repair(mesh) part them",
    "inconsistent_edges": "edges whose two faces have opposite winding: normals are unreliable, and left "
    "cannot be told from right; repair(mesh) makes the winding consistent, unless the surface is one-sided",
    "inward_components": "closed components with faces oriented inward: left and right are exchanged; "
    "repair(mesh) orients them outward",
}
REPAIRED_DEFECTS = (  # fields of `MeshReport` whose defects `repair` removes
    *("non_finite_vertices", "out_of_range_faces", "repeated_index_faces", "duplicate_faces"),
    *("unused_vertices", "coincident_vertices", "inconsistent_edges", "inward_components"),
    *("merged_vertices", "t_junctions", "outliers"),
)


def has_any(report: MeshReport, defects: Iterable[str]) -> bool:
    """Whether a mesh has any of some defects, the fields of its report."""
    return any(len(getattr(report, defect)) for defect in defects)


@dataclass(frozen=True, eq=False, repr=False)
class MeshReport:
    """The defects and the topology of a mesh.

    A *sound* face has three different vertices, all in range and finite, and is not a duplicate. Areas and topology
    (edges, vertex fans, components, Euler number) are those of the sound faces, so that each defect is reported only
    once.

    Parameters
    ----------
    n_vertices, n_faces : int
    euler_number : int
        Number of used vertices, minus edges, plus faces.
    component_vertices, component_shares : (c,) array of int, of float
        Number of vertices and share of the area of each connected component, largest area first.
    boundary_edges : (b, 2) array of int
        Edges of exactly one face.
    boundary_lengths : (l,) array of float
        Length of each boundary loop, longest first, in mesh units. Loops that share a vertex count as one.
    non_finite_vertices, unused_vertices, coincident_vertices, non_manifold_vertices, merged_vertices : (d,) array of int
        Vertices with the defect. A coincident vertex is at exactly the position of an earlier one; merged ones are one
        vertex of two sheets that face each other, far apart along the surface.
    out_of_range_faces, repeated_index_faces, duplicate_faces, zero_area_faces, sliver_faces : (d,) array of int
        Faces with the defect; for the last two, see ``ZERO_AREA_RATIO`` and ``SLIVER_RATIO`` in this file.
    non_manifold_edges, inconsistent_edges : (d, 2) array of int
        Edges of more than two faces; edges that both of their faces traverse in the same direction.
    inward_components : (d,) array of int
        Closed or nearly closed, consistently wound components of negative volume that are no voids; see `repair`.
    solid_components, void_components : (d,) array of int
        Closed or nearly closed components, and those of them that lie in a solid and look inward.
    t_junctions : (d,) array of int
        Vertices of the boundary that lie on the middle of an edge of the boundary.
    close_vertices : (d,) array of int
        Vertices of the boundary that nearly coincide with others, as where a file keeps few digits.
    outliers : (d,) array of int
        Of points without faces, those far from all others.
    weld_tolerance : float
        Distance that tells those from others, in mesh units: for ``repair(mesh, weld=...)``; nan if there are none.
    double_walled : float
        Share of the area that has another sheet close behind it, which faces away, as in skulls and thick shells.
    planar : float
        Share of the area in the largest connected piece that lies in a plane, as a base that a scan has grown into.

    Examples
    --------
    >>> from isomatch import Mesh, check
    >>> report = check(Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [5, 5, 5]], [[0, 1, 2], [0, 0, 1]]))
    >>> report
    MeshReport(4 vertices, 2 faces, 0 fatal defects, 2 warnings)
    >>> report.ok, report.n_boundary_loops, report.unused_vertices, report.repeated_index_faces
    (False, 1, array([3]), array([1]))
    """

    n_vertices: int
    n_faces: int
    euler_number: int
    component_vertices: IntArray
    component_shares: FloatArray
    boundary_edges: IntArray
    boundary_lengths: FloatArray
    non_finite_vertices: IntArray
    out_of_range_faces: IntArray
    repeated_index_faces: IntArray
    duplicate_faces: IntArray
    zero_area_faces: IntArray
    sliver_faces: IntArray
    unused_vertices: IntArray
    coincident_vertices: IntArray
    non_manifold_edges: IntArray
    non_manifold_vertices: IntArray
    inconsistent_edges: IntArray
    inward_components: IntArray
    solid_components: IntArray
    void_components: IntArray
    t_junctions: IntArray
    close_vertices: IntArray
    outliers: IntArray
    merged_vertices: IntArray
    weld_tolerance: float = float("nan")
    double_walled: float = float("nan")
    planar: float = float("nan")

    @property
    def n_components(self) -> int:
        """Number of connected components that have faces."""
        return len(self.component_vertices)

    @property
    def n_boundary_loops(self) -> int:
        """Number of boundary loops; 0 on a closed surface."""
        return len(self.boundary_lengths)

    @property
    def fatal(self) -> tuple[str, ...]:
        """Defects that make geodesic distances impossible to compute, one sentence each."""
        sentences = self._sentences(_FATAL)
        nothing = "so there is no surface to measure distances on"
        if self.n_faces == 0:
            sentences.append(f"no faces, {nothing}; give a mesh with faces")
        elif not self.component_shares.any():
            sentences.append(f"no sound face of positive area, {nothing}; export the file again")
        return tuple(sentences)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Defects that reduce accuracy or leave vertices unmatched, one sentence each."""
        sentences = self._sentences(_WARNINGS)
        if self.n_components - len(self.void_components) > 1:
            shares = ", ".join(f"{share:.1%}" for share in self.component_shares[:5])
            sentences.append(
                f"{self.n_components} components with {shares}{', …' * (self.n_components > 5)} of the area: "
                "distances between them are infinite; keep one of them with mesh.submesh, or connect them"
            )
        if len(self.close_vertices):
            sentences.append(
                f"{len(self.close_vertices)} vertices nearly coincide with others ({_where(self.close_vertices)}): the "
                f"surface falls apart there; repair(mesh, weld={self.weld_tolerance:.2g}) welds them"
            )
        if self.double_walled >= DOUBLE_WALLED_SHARE:
            sentences.append(
                f"double-walled: {self.double_walled:.0%} of the area has another sheet close behind it, so that nearest "
                "points in space may be on the wrong side of the wall; repair(mesh, outer=True) keeps the outermost "
                "surface, if the inside is of no interest; match --as-mesh and wrap bend one shape onto the other, and "
                "so keep the sides apart where images of single vertices do not"
            )
        return tuple(sentences)

    @property
    def ok(self) -> bool:
        """Whether there are no fatal defects and no warnings."""
        return not self.fatal and not self.warnings

    def to_dict(self) -> dict[str, Any]:
        """Return all fields and sentences as numbers, strings and lists, for JSON."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        plain = {name: x.tolist() if isinstance(x, np.ndarray) else x for name, x in values.items()}
        for name in ("double_walled", "planar", "weld_tolerance"):
            plain[name] = None if np.isnan(plain[name]) else plain[name]
        return plain | {"ok": self.ok, "fatal": list(self.fatal), "warnings": list(self.warnings)}

    def __repr__(self) -> str:
        return (
            f"MeshReport({self.n_vertices} vertices, {self.n_faces} faces, "
            f"{len(self.fatal)} fatal defects, {len(self.warnings)} warnings)"
        )

    def __str__(self) -> str:
        texts = (_FATAL | _WARNINGS).items()
        defects = [(text.partition(": ")[0], len(getattr(self, name)), "") for name, text in texts]
        largest = f"largest: {self.component_vertices[0]:,} vertices" if self.n_components > 1 else ""
        longest = f"longest: {self.boundary_lengths[0]:.4g}" if self.n_boundary_loops else ""
        walls = [("double-walled, per cent of the area", round(100 * self.double_walled), "")]
        if self.planar >= MIN_BASE_SHARE:
            advice = "if this is a base: repair(mesh, without_base=True) cuts it off"
            walls.append(("in one plane, per cent of the area", round(100 * self.planar), advice))
        rows = [
            ("vertices", self.n_vertices, ""),
            ("faces", self.n_faces, ""),
            ("components", self.n_components, largest),
            *([("solids", len(self.solid_components), "")] if len(self.solid_components) > 1 else []),
            *([("voids", len(self.void_components), "")] if len(self.void_components) else []),
            ("Euler number", self.euler_number, ""),
            *(walls if self.double_walled >= 0 else []),
            ("boundary loops", self.n_boundary_loops, longest),
            *(defect for defect in defects if defect[1]),
        ]
        table = [f"{what:<45} {count:>7,}  {where}".rstrip() for what, count, where in rows]
        verdict = [f"fatal: {sentence}" for sentence in self.fatal]
        verdict += [f"warning: {sentence}" for sentence in self.warnings]
        return "\n".join(table + (verdict or ["no defects"]))

    def _sentences(self, defects: dict[str, str]) -> list[str]:
        defective = ((getattr(self, name), text) for name, text in defects.items())
        return [text.replace(": ", f" ({_where(where)}): ", 1) for where, text in defective if len(where)]


def _where(defects: IntArray) -> str:
    """Write at most five vertices, faces or edges, and how many there are if there are more."""
    if defects.ndim == 1:
        return f"number {defects[0]}" if len(defects) == 1 else f"numbers {some(defects)}"
    head = ", ".join(f"{i}–{j}" for i, j in defects[:5].tolist())
    return head if len(defects) <= 5 else f"{head}, … ({len(defects)} in all)"
