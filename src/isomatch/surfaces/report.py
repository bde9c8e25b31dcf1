"""The defects of a mesh, one field each, and what each of them means for matching."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.errors import some

ZERO_AREA_RATIO = 1e-10
"""A face whose smallest altitude is at most this part of its longest edge counts as of zero area."""

SLIVER_RATIO = 1e-3
"""A face of positive area whose smallest altitude is under this part of its longest edge is a sliver."""

_MENDED = "repair(mesh) removes them"

# field: (what, why it matters and what to do); the table of the report has the same rows in the same order
_FATAL = {
    "non_finite_vertices": (
        "vertices with NaN or infinite coordinates",
        f"no distance is defined there; {_MENDED} with their faces",
    ),
    "out_of_range_faces": (
        "faces with a vertex index out of range",
        f"the surface is undefined there; {_MENDED}, or export the file again",
    ),
}
_SURVIVABLE = {
    "repeated_index_faces": ("faces with a repeated vertex", f"they have no area and no normal; {_MENDED}"),
    "duplicate_faces": (
        "faces with the vertices of an earlier face",
        f"they count area twice and make edges non-manifold; {_MENDED}",
    ),
    "zero_area_faces": (
        "faces of zero area",
        "distances through them are less exact; remesh if there are many",
    ),
    "sliver_faces": ("sliver faces", "distances through them are less exact; remesh if there are many"),
    "unused_vertices": (
        "finite vertices that no sound face uses",
        f"they are at infinite distance from all others and get no match; {_MENDED}",
    ),
    "coincident_vertices": (
        "vertices at the position of an earlier vertex",
        "the surface may be cut there, so that distances go round; repair(mesh) welds them",
    ),
    "non_manifold_edges": (
        "edges of more than two faces",
        "fronts branch there and distances may be short-cut; separate the sheets in a mesh editor",
    ),
    "non_manifold_vertices": (
        "vertices where several fans of faces meet",
        "surfaces touch at one point there and distances pass through it; split them in a mesh editor",
    ),
    "inconsistent_edges": (
        "edges whose two faces have opposite winding",
        "normals and left–right orientation are unreliable; repair(mesh) makes the winding consistent, "
        "unless the surface is one-sided",
    ),
    "inward_components": (
        "closed components whose faces look inward",
        "left and right are exchanged; repair(mesh) turns them outward",
    ),
}


@dataclass(frozen=True, eq=False, repr=False)
class MeshReport:
    """The defects of a mesh, and its topology.

    A *sound* face has three different vertices, in range and finite, and is no duplicate. Areas and
    topology (edges, vertex fans, components, Euler number) are those of the sound faces, so that each
    defect is reported once.

    Parameters
    ----------
    n_vertices, n_faces : int
        Size of the mesh.
    euler_number : int
        Used vertices - edges + faces.
    component_vertices : (c,) array of int
        Number of vertices of each connected component, the one of largest area first.
    component_shares : (c,) array of float
        Share of each component in the total area.
    boundary_edges : (b, 2) array of int
        Edges of one face only.
    boundary_lengths : (l,) array of float
        Length of each boundary loop, longest first, in mesh units; loops that share a vertex count as one.
    non_finite_vertices, unused_vertices, coincident_vertices, non_manifold_vertices : (d,) array of int
        Vertices with the defect. A coincident vertex has the exact position of an earlier one.
    out_of_range_faces, repeated_index_faces, duplicate_faces, zero_area_faces, sliver_faces : (d,) array of
    int
        Faces with the defect; see `ZERO_AREA_RATIO` and `SLIVER_RATIO`.
    non_manifold_edges, inconsistent_edges : (d, 2) array of int
        Edges of more than two faces; edges that two faces traverse in the same direction.
    inward_components : (d,) array of int
        Closed, consistently wound components of negative volume.
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
        """Defects with which geodesic distances cannot be computed at all, one sentence each."""
        found = self._sentences(_FATAL)
        if self.n_faces == 0:
            found.append("no faces: there is no surface to measure on; give a mesh, not a set of points")
        elif not self.component_shares.any():
            found.append(
                "no sound face of positive area: there is no surface to measure on; export the file again"
            )
        return tuple(found)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Defects that matter but can be lived with, one sentence each."""
        found = self._sentences(_SURVIVABLE)
        if self.n_components > 1:
            shares = ", ".join(f"{share:.1%}" for share in self.component_shares[:5])
            found.append(
                f"{self.n_components} components with {shares}{', …' * (self.n_components > 5)} of the area: "
                "distances between them are infinite; keep the one you mean with mesh.submesh, or join them"
            )
        return tuple(found)

    @property
    def ok(self) -> bool:
        """Whether there is neither a fatal defect nor a warning."""
        return not self.fatal and not self.warnings

    def to_dict(self) -> dict[str, Any]:
        """Return all fields and sentences as numbers, strings and lists, ready for JSON."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        plain = {
            name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()
        }
        return plain | {"ok": self.ok, "fatal": list(self.fatal), "warnings": list(self.warnings)}

    def __repr__(self) -> str:
        return (
            f"MeshReport({self.n_vertices} vertices, {self.n_faces} faces, "
            f"{len(self.fatal)} fatal defects, {len(self.warnings)} warnings)"
        )

    def __str__(self) -> str:
        lengths = ", ".join(f"{length:.4g}" for length in self.boundary_lengths[:5])
        rows = [
            ("vertices", self.n_vertices, ""),
            ("faces", self.n_faces, ""),
            ("components", self.n_components, f"vertices: {some(self.component_vertices)}"),
            ("Euler number", self.euler_number, ""),
            ("boundary loops", self.n_boundary_loops, f"lengths: {lengths}" if lengths else ""),
            *(
                (what, len(getattr(self, name)), _where(getattr(self, name)))
                for name, (what, _) in (_FATAL | _SURVIVABLE).items()
            ),
        ]
        table = [f"{what:<45} {count:>9}  {where}".rstrip() for what, count, where in rows]
        verdict = [f"fatal: {sentence}" for sentence in self.fatal]
        verdict += [f"warning: {sentence}" for sentence in self.warnings]
        return "\n".join(table + (verdict or ["no defects"]))

    def _sentences(self, defects: dict[str, tuple[str, str]]) -> list[str]:
        found = ((getattr(self, name), what, advice) for name, (what, advice) in defects.items())
        return [f"{what} ({_where(where)}): {advice}" for where, what, advice in found if len(where)]


def _where(found: IntArray) -> str:
    """Write at most five vertices, faces or edges, and the count."""
    if found.ndim == 1:
        return some(found)
    head = ", ".join(f"{i}–{j}" for i, j in found[:5].tolist())
    return head if len(found) <= 5 else f"{head}, … ({len(found)} in all)"
