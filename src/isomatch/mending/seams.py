"""Seams: points that a file repeats at one position, as along the borders of a texture, are one point of the surface."""

from __future__ import annotations

from typing import TypeVar, cast

import numpy as np

from isomatch.mending.repair import Repair, repair
from isomatch.surfaces import Mesh, first_equal

T = TypeVar("T")


def welded_surface(surface: object) -> Repair | None:
    """Weld the vertices of a mesh at exactly the same position, as `repair` does, and change nothing else.

    Parameters
    ----------
    surface : Mesh or object
        Any mesh; what is no mesh has no seams.

    Returns
    -------
    Repair or None
        The welded mesh without the faces that vanish or double, and index maps both ways; None if no two vertices
        coincide, or if the mesh has coordinates that are not finite or faces without vertices, which `check` reports.

    Notes
    -----
    O(n log n) time, in which only hashes are sorted.

    Examples
    --------
    Two triangles whose common edge has separate vertices for each of them:

    >>> points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    >>> seam = welded_surface(Mesh(points, [[0, 1, 2], [4, 3, 5]]))
    >>> seam.mesh.faces.tolist(), seam.new_index.tolist(), seam.vertex_index.tolist()
    ([[0, 1, 2], [2, 1, 3]], [0, 1, 2, 1, 2, 3], [0, 1, 2, 5])
    """
    if not isinstance(surface, Mesh):
        return None
    first = first_equal(surface.vertices)
    if (first[1:] > first[:-1]).all():
        return None
    faces = surface.faces
    if not np.isfinite(surface.vertices).all() or ((faces < 0) | (faces >= surface.n_vertices)).any():
        return None
    return repair(surface, remove_unused=False, orient=False)


def without_seams(surface: T, weld: bool = True) -> tuple[T, Repair | None]:
    """Return the welded mesh, and how it was welded; or the surface as it is and None, if there is nothing to weld.

    Parameters
    ----------
    surface : Mesh or object
        As for `welded_surface`.
    weld : bool
        Whether to weld at all.

    Returns
    -------
    surface : Mesh or object
    seams : Repair or None

    Examples
    --------
    >>> mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> without_seams(mesh)[0].n_vertices, without_seams(mesh, weld=False)
    (3, (Mesh(4 vertices, 1 faces), None))
    """
    seams = welded_surface(surface) if weld else None
    return (cast(T, seams.mesh), seams) if seams else (surface, None)
