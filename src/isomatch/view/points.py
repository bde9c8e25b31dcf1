"""Points without faces as something that can be drawn: triangles between nearest neighbours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch.surfaces import Graph, Mesh, Surface

NEIGHBOURS = 8  # of each point, between which triangles are drawn
WIDEST = 2.6  # radians, about 150°: a wider angle between two neighbours is a hole or a border


def drawable(surface: Surface) -> Mesh:
    """Return a mesh with the same vertices that looks like a surface.

    Parameters
    ----------
    surface : Mesh or PointCloud
        A mesh is returned as it is.

    Returns
    -------
    Mesh
        Of points: each with its nearest neighbours, in turn around it in the plane that fits them best. Triangles overlap
        and face away from the middle, so that they are good for nothing but a picture. O(n log n).

    Raises
    ------
    TypeError
        If it is a graph, which has no positions.

    Examples
    --------
    >>> import isomatch
    >>> grid = np.array([[x, y, 0.0] for x in range(5) for y in range(5)])
    >>> drawn = drawable(isomatch.PointCloud(grid))
    >>> drawn.n_vertices, bool(drawn.area > 16)
    (25, True)
    """
    if isinstance(surface, Mesh):
        return surface
    if isinstance(surface, Graph):
        raise TypeError(f"{surface!r} has no positions to draw")
    points, n = surface.vertices, surface.n_vertices
    k = min(NEIGHBOURS, n - 1)
    near = cKDTree(points).query(points, k + 1)[1][:, 1:]
    offsets = points[near] - points[:, None]  # (n, k, 3)
    axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1]  # the last two span the plane
    flat = np.einsum("nki,nij->nkj", offsets, axes[:, :, 1:])
    angles = np.arctan2(flat[..., 1], flat[..., 0])
    order = angles.argsort(axis=1)
    near, angles = (np.take_along_axis(each, order, axis=1) for each in (near, angles))
    gaps = np.mod(np.roll(angles, -1, axis=1) - angles, 2 * np.pi)
    faces = np.stack(
        [np.broadcast_to(np.arange(n)[:, None], near.shape), near, np.roll(near, -1, axis=1)], axis=2
    )
    faces = faces[gaps < WIDEST]
    faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
    a, b, c = (points[faces[:, i]] for i in range(3))
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces)
