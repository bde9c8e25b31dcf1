"""Repair of a mesh without moving vertices, with index maps for every vertex and face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.assets import SurfaceLike, mesh_from
from isomatch.mending._winding import faces_to_rewind
from isomatch.mending.report import MeshReport
from isomatch.surfaces import Mesh, first_equal, unsound_faces
from isomatch.values.arrays import IntArray

MENDED = (
    "non_finite_vertices",
    "out_of_range_faces",
    "repeated_index_faces",
    "duplicate_faces",
    "unused_vertices",
    "coincident_vertices",
    "inconsistent_edges",
    "inward_components",
)
"""Fields of `MeshReport` with defects that a repair removes."""


@dataclass(frozen=True, eq=False, repr=False)
class Repair:
    """A mended mesh, and the relation of its indices to those of the original.

    Parameters
    ----------
    mesh : Mesh
        The mended mesh; the original object if nothing was changed.
    vertex_index : (n_new,) array of int
        Original vertex of each new vertex: ``mesh.vertices == original.vertices[vertex_index]``.
    new_index : (n_old,) array of int
        New vertex of each original vertex: for a welded vertex the one it was welded onto, for a removed vertex -1.
    face_index : (m_new,) array of int
        Original face of each new face.
    changes : tuple of str
        What was changed, with counts, one phrase for each kind of change; empty if nothing was changed.
    """

    mesh: Mesh
    vertex_index: IntArray
    new_index: IntArray
    face_index: IntArray
    changes: tuple[str, ...]

    def __repr__(self) -> str:
        return f"Repair({self.mesh!r}, changes={list(self.changes)})"


def repair(
    mesh: SurfaceLike,
    *,
    weld: bool = True,
    remove_duplicates: bool = True,
    remove_unused: bool = True,
    orient: bool = True,
    report: MeshReport | None = None,
) -> Repair:
    """Mend a mesh: weld, remove faces and vertices that are not part of a surface, and orient the faces outward.

    The steps are, in this order:

    1. Vertices at exactly the same position are welded onto the first of them.
    2. Faces are removed that have an index out of range, a non-finite or a repeated vertex, or the vertices of an
       earlier face.
    3. Non-finite vertices, and vertices that no face uses, are removed.
    4. Each orientable piece is wound consistently: outward if it is closed, or if flat discs with the lengths of its
       boundary loops have at most a tenth of its area; otherwise as most of its faces were.

    Vertices and faces keep their order, and no vertex moves. A second repair changes nothing.

    Parameters
    ----------
    mesh : Mesh, path_like, tuple or object
        Anything that `mesh_from` takes; its arrays may contain anything.
    weld : bool
        Whether to weld coincident vertices, such as the seams of texture maps. Two sheets that touch at a vertex are
        joined there.
    remove_duplicates : bool
        Whether to remove faces with the vertices of an earlier face. Where sheets are glued together, such faces are of
        both sheets; see `separate_sheets`.
    remove_unused : bool
        Whether to remove finite vertices that no face uses.
    orient : bool
        Whether to make the winding of the faces consistent.
    report : MeshReport, optional
        What `check` found on this mesh. If there is nothing to mend, nothing is computed again.

    Returns
    -------
    Repair
        The mended mesh, index maps both ways, and the changes.

    Raises
    ------
    MeshError, FormatError
        As for `check`.

    Notes
    -----
    O(n log n) time and O(n) memory, as `check`. Faces of zero area with three different positions are kept, because
    removing them would tear the surface. Non-manifold edges and vertices, holes and one-sided surfaces are left as they
    are; `check` reports them.

    Examples
    --------
    Two triangles whose common edge has separate vertices for each of them, the second one wound the other way:

    >>> points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    >>> mended = repair(Mesh(points, [[0, 1, 2], [3, 4, 5]]))
    >>> mended.mesh.faces.tolist(), mended.new_index.tolist()
    ([[0, 1, 2], [1, 3, 2]], [0, 1, 2, 1, 2, 3])
    >>> mended.changes
    ('welded 2 vertices onto an earlier vertex at the same position', 'rewound 1 face')
    """
    mesh = mesh_from(mesh)
    identity = np.arange(mesh.n_vertices)
    if report and not any(len(getattr(report, defect)) for defect in MENDED):
        return Repair(mesh, identity, identity, np.arange(mesh.n_faces), ())
    survivor = first_equal(mesh.vertices) if weld else identity
    in_range = ((mesh.faces >= 0) & (mesh.faces < mesh.n_vertices)).all(axis=1)
    faces = mesh.faces.copy()
    faces[in_range] = survivor[faces[in_range]]

    bad = unsound_faces(mesh.vertices, faces)
    face_index = np.flatnonzero(~bad.any | (bad.duplicate & (not remove_duplicates)))
    faces = faces[face_index]

    finite = np.isfinite(mesh.vertices).all(axis=1)
    welded = survivor != identity
    unused = np.bincount(faces.ravel(), minlength=mesh.n_vertices) == 0
    unused &= finite & ~welded & remove_unused
    kept = finite & ~welded & ~unused
    vertex_index = np.flatnonzero(kept)
    new_index = np.where(kept, np.cumsum(kept) - 1, -1)[survivor]

    mended = Mesh(mesh.vertices[vertex_index], new_index[faces])
    rewound = faces_to_rewind(mended) if orient else np.zeros(len(faces), dtype=bool)
    if rewound.any():
        faces = mended.faces.copy()
        faces[rewound] = faces[rewound][:, [0, 2, 1]]
        mended = Mesh(mended.vertices, faces)

    counted = (
        ("welded {} onto an earlier vertex at the same position", "vertex", welded),
        ("removed {} with a vertex index out of range", "face", bad.out_of_range),
        ("removed {} with a non-finite vertex", "face", bad.non_finite),
        ("removed {} with a repeated vertex", "face", bad.repeated_index),
        ("removed {} with the vertices of an earlier face", "face", bad.duplicate & remove_duplicates),
        ("removed {} with non-finite coordinates", "vertex", ~finite),
        ("removed {} that no face used", "vertex", unused),
        ("rewound {}", "face", rewound),
    )
    changes = tuple(
        sentence.format(_count(int(mask.sum()), noun)) for sentence, noun, mask in counted if mask.any()
    )
    return Repair(mended if changes else mesh, vertex_index, new_index, face_index, changes)


def _count(number: int, noun: str) -> str:
    plural = {"vertex": "vertices", "face": "faces"}
    return f"{number} {noun if number == 1 else plural[noun]}"
