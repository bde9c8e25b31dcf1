"""Coarse surfaces with rounded triangles, for pictures: an outline of a thousand vertices is no polygon."""

from __future__ import annotations

import numpy as np

from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray

ENOUGH_FACES = 50_000  # a surface with more than a quarter of it is drawn as it is
ROUNDING = 0.75  # Boubekeur & Alexa, Phong Tessellation, 2008
TINY = 1e-300
SHARPEST = (
    0.0  # cosine of the angle between normals, below which an edge is sharp; at 0.5 thin limbs get lumps
)


def finer(mesh: Mesh, values: FloatArray) -> tuple[Mesh, FloatArray, FloatArray]:
    """Cut triangles into four, whose new corners are moved towards the tangent planes at the ends of their edges.

    The outline becomes round; the given vertices, and the shading, stay as they are. Edges at borders and sharp ones
    stay straight.

    Parameters
    ----------
    mesh : Mesh
        The surface.
    values : (n, q) array of float
        Values at its vertices, which are interpolated.

    Returns
    -------
    Mesh, (n', q) array of float, (n', 3) array of float
        With at most `ENOUGH_FACES` faces, the values, and the normals of the given mesh, interpolated; a surface with
        more than a quarter of these faces is returned as it is.
    """
    normals = mesh.vertex_normals
    while 0 < 4 * mesh.n_faces <= ENOUGH_FACES:
        mesh, columns = _cut(mesh, normals, np.hstack([normals, values]))
        normals, values = columns[:, :3], columns[:, 3:]
    return mesh, values, normals


def _cut(mesh: Mesh, normals: FloatArray, columns: FloatArray) -> tuple[Mesh, FloatArray]:
    """Cut each triangle once; return the columns (n, q) with those of the new vertices, too."""
    edges = mesh.edge_table
    ends = i, j = edges.ends.T
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), TINY)
    middle = (mesh.vertices[i] + mesh.vertices[j]) / 2
    heights = [((middle - mesh.vertices[end]) * unit[end]).sum(axis=1, keepdims=True) for end in ends]
    bent = (edges.n_faces == 2) & ((unit[i] * unit[j]).sum(axis=1) > SHARPEST)
    middle[bent] -= ROUNDING / 2 * sum(h * unit[end] for h, end in zip(heights, ends))[bent]
    new = np.empty(3 * mesh.n_faces, dtype=np.int64)  # the vertex on each side
    new[edges.sides] = mesh.n_vertices + np.repeat(np.arange(len(i)), edges.n_faces)
    (a, b, c), (ab, bc, ca) = mesh.faces.T, new.reshape(-1, 3).T
    cut = (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)
    faces = np.concatenate([np.column_stack(corners) for corners in cut])
    return (
        Mesh(np.concatenate([mesh.vertices, middle]), faces),
        np.concatenate([columns, (columns[i] + columns[j]) / 2]),
    )
