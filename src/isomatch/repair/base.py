"""A base: a large planar piece, such as a floor that a scan has grown into, and its cut."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.repair.self_contacts import face_normals
from isomatch.surfaces import Mesh, label_components

# number of faces whose planes are tried, and number of faces that are counted in each plane; chosen
N_PLANES_TRIED, N_VOTING_FACES = 200, 20_000
# √area; a face is in a plane if its corners are at most this far from it; a base is cut off up to this height
# above its plane; chosen
PLANE_DISTANCE = 0.01
MIN_NORMAL_COSINE = 0.9  # least |cosine| of the angle between the normals of a plane and a face in it; chosen
MIN_BASE_SHARE = 0.1  # least share of the surface's area in a planar piece that `check` reports; chosen


class Base(NamedTuple):
    """The largest connected planar piece: its share of the area, its faces (m,), those below its rim."""

    share: float
    faces: BoolArray
    below: BoolArray


def base_of(mesh: Mesh) -> Base:
    """Find the largest planar piece, and the faces in its plane or on its side with less area."""
    nothing = np.zeros(mesh.n_faces, dtype=bool)
    area = mesh.area
    if not 0 < area < np.inf:
        return Base(0.0, nothing, nothing)
    areas, size = mesh.face_areas / area, np.sqrt(area)
    corners = mesh.vertices[mesh.faces] / size
    normals = face_normals(mesh)
    until = np.cumsum(areas)

    def spread(count: int) -> IntArray:
        return np.unique(np.searchsorted(until, (np.arange(count) + 0.5) / count).clip(0, mesh.n_faces - 1))

    def in_plane(normal: FloatArray, offset: float, rows: IntArray | slice) -> BoolArray:
        near = (np.abs(corners[rows] @ normal - offset) <= PLANE_DISTANCE).all(axis=1)
        return np.asarray(near & (np.abs(normals[rows] @ normal) >= MIN_NORMAL_COSINE))

    voting = spread(N_VOTING_FACES)
    planes = [(normals[face], float(corners[face, 0] @ normals[face])) for face in spread(N_PLANES_TRIED)]
    normal, offset = max(planes, key=lambda plane: int(in_plane(plane[0], plane[1], voting).sum()))
    for _ in range(2):  # twice, the plane is fitted to the faces in it
        inside = in_plane(normal, offset, slice(None))
        if not inside.any():
            return Base(0.0, nothing, nothing)
        centres, weights = corners[inside].mean(axis=1), areas[inside]
        middle = np.average(centres, axis=0, weights=weights)
        offsets = (centres - middle) * np.sqrt(weights)[:, None]
        normal = np.linalg.eigh(offsets.T @ offsets)[1][:, 0]
        offset = float(middle @ normal)
    faces = _largest_piece(mesh, in_plane(normal, offset, slice(None)), areas)
    height = corners @ normal - offset
    if areas[height.mean(axis=1) < -PLANE_DISTANCE].sum() > areas[height.mean(axis=1) > PLANE_DISTANCE].sum():
        height = -height
    return Base(float(areas[faces].sum()), faces, (height <= PLANE_DISTANCE).all(axis=1))


def _largest_piece(mesh: Mesh, inside: BoolArray, areas: FloatArray) -> BoolArray:
    faces = mesh.faces[inside]
    _, label = label_components(mesh.n_vertices, (faces[:, 0], faces[:, 1]), (faces[:, 1], faces[:, 2]))
    of_face = label[mesh.faces[:, 0]]
    sizes = np.bincount(of_face[inside], areas[inside], of_face.max(initial=0) + 1)
    return np.asarray(inside & (of_face == sizes.argmax()))
