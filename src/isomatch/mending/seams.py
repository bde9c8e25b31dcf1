"""Seams: points that a file repeats at one position, as along the borders of a texture, are one point of the surface."""

from __future__ import annotations

import numpy as np

from isomatch.mending.repair import Repair, repair
from isomatch.surfaces import Mesh, first_equal


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
