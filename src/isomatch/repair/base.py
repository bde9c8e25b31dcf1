"""A base: a large planar piece, such as a plate or a floor that a scan has grown into, and its cut along the rim."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.surfaces import Mesh, linked

N_TRIED, N_VOTING = 200, 20_000  # planes of faces that are tried, and faces that are compared with them
PLANE = 0.01  # √area: distance up to which a face lies in a plane, and how far above it the rim is cut
ALONG = 0.9  # cosine of the normals of a plane and its faces, at least
LARGE = 0.1  # share of the area from which a planar piece is told


class Base(NamedTuple):
    """The largest connected planar piece: its share of the area, its faces (m,), and those below its rim."""

    share: float
    faces: BoolArray
    below: BoolArray


def base_of(mesh: Mesh) -> Base:
    """Find the largest planar piece, and what lies in its plane or on the side of it with less of the other area."""
    nothing = np.zeros(mesh.n_faces, dtype=bool)
    area = mesh.area
    if not 0 < area < np.inf:
        return Base(0.0, nothing, nothing)
    areas, size = mesh.face_areas / area, np.sqrt(area)
    corners = mesh.vertices[mesh.faces] / size
    normals = mesh.face_cross / np.maximum(np.linalg.norm(mesh.face_cross, axis=1, keepdims=True), 1e-300)
    until = np.cumsum(areas)

    def spread(count: int) -> IntArray:
        return np.unique(np.searchsorted(until, (np.arange(count) + 0.5) / count).clip(0, mesh.n_faces - 1))

    def in_plane(normal: FloatArray, offset: float, rows: IntArray | slice) -> BoolArray:
        near = (np.abs(corners[rows] @ normal - offset) <= PLANE).all(axis=1)
        return np.asarray(near & (np.abs(normals[rows] @ normal) >= ALONG))

    voting = spread(N_VOTING)
    planes = [(normals[face], float(corners[face, 0] @ normals[face])) for face in spread(N_TRIED)]
    normal, offset = max(planes, key=lambda plane: int(in_plane(plane[0], plane[1], voting).sum()))
    for _ in range(2):  # of the faces in it, the plane that fits best
        inside = in_plane(normal, offset, slice(None))
        if not inside.any():
            return Base(0.0, nothing, nothing)
        centres, weights = corners[inside].mean(axis=1), areas[inside]
        middle = np.average(centres, axis=0, weights=weights)
        apart = (centres - middle) * np.sqrt(weights)[:, None]
        normal = np.linalg.eigh(apart.T @ apart)[1][:, 0]
        offset = float(middle @ normal)
    faces = _largest_piece(mesh, in_plane(normal, offset, slice(None)), areas)
    height = corners @ normal - offset
    if areas[height.mean(axis=1) < -PLANE].sum() > areas[height.mean(axis=1) > PLANE].sum():
        height = -height
    return Base(float(areas[faces].sum()), faces, (height <= PLANE).all(axis=1))


def _largest_piece(mesh: Mesh, inside: BoolArray, areas: FloatArray) -> BoolArray:
    faces = mesh.faces[inside]
    _, label = linked(mesh.n_vertices, (faces[:, 0], faces[:, 1]), (faces[:, 1], faces[:, 2]))
    of_face = label[mesh.faces[:, 0]]
    sizes = np.bincount(of_face[inside], areas[inside], of_face.max(initial=0) + 1)
    return np.asarray(inside & (of_face == sizes.argmax()))
