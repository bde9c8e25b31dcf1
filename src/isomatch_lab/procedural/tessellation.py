"""Triangulations of an implicit surface of genus 0, a different one for each seed."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import SettingError
from isomatch._core.first_use import package
from isomatch._core.settings import generator
from isomatch.surfaces import Mesh
from isomatch_lab.procedural.implicit import Skin

# largest number of vertices by marching cubes; larger meshes are subdivided; chosen
MAX_GRID_VERTICES = 60_000
# Grid steps: lower absolute values of the field at grid points are raised to this, so that no triangle is tiny; chosen.
MIN_CROSSING = 0.4
logger = logging.getLogger(__name__)


def tessellate(skin: Skin, n_vertices: int, seed: int) -> Mesh:
    """Triangulate a skin with about n vertices: closed, manifold, oriented outward, connected, of genus 0."""
    # We run marching cubes on a grid that the seed rotates, shifts and rescales; then rounds of Delaunay edge flips and
    # tangential smoothing; then, for large meshes, midpoint subdivision. After every step, vertices are projected onto
    # the surface. Vertices and faces are in random order; the number of vertices differs from n by up to 5 %.
    rng = generator(seed)
    levels = max(0, int(np.ceil(np.log(n_vertices / MAX_GRID_VERTICES) / np.log(4))))
    n_grid_vertices = n_vertices * rng.uniform(0.98, 1.02) / 4**levels
    for _ in range(8):
        vertices, faces = _marching_cubes(skin, n_grid_vertices, rng)
        if _is_sphere(vertices, faces):
            break
        logger.debug("marching cubes gave the wrong topology; trying another grid")
    else:
        raise SettingError(
            f"n_vertices = {n_vertices} is too coarse: no grid of that size resolves thin limbs; ask for more vertices"
        )
    vertices = skin.project(vertices)
    for _ in range(10):
        faces = _flip_edges(vertices, faces)
        vertices = _smooth_vertices(skin, vertices, faces, rounds=2)
    for _ in range(4):
        faces = _flip_edges(vertices, faces)
    for _ in range(levels):
        vertices, faces = _subdivide(vertices, faces)
        vertices = _smooth_vertices(skin, skin.project(vertices, steps=2), faces, rounds=1)
    return _shuffle_vertices(skin.project(vertices), faces, rng)


def _marching_cubes(skin: Skin, n_vertices: float, rng: np.random.Generator) -> tuple[FloatArray, IntArray]:
    """Run marching cubes on a random grid whose step gives about the number of vertices wanted."""
    march = _skimage_marching_cubes()
    turn = Rotation.random(random_state=rng).as_matrix()
    shift = rng.uniform(0, 1, 3)
    step = 0.04
    while True:
        volume, origin = _sample_skin(skin, step, turn, shift)
        n_crossings = sum(np.count_nonzero(np.diff(volume < 0, axis=axis)) for axis in range(3))
        if abs(n_crossings / n_vertices - 1) < 0.015:
            break
        step *= np.sqrt(n_crossings / n_vertices)
    values = np.copysign(np.clip(np.abs(volume) / step, MIN_CROSSING, 1), volume)
    vertices, faces, _, _ = march(values, 0.0, gradient_direction="descent")
    return (origin + vertices * step) @ turn.T, faces.astype(np.int64)


def _sample_skin(
    skin: Skin, step: float, turn: FloatArray, shift: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Sample the field on a grid in rotated axes around the surface; also give the grid's origin in these axes."""
    ends = skin.cones[:, :6].reshape(-1, 3) @ turn
    margin = skin.cones[:, 6:].max() + 0.1
    origin = ends.min(axis=0) - margin - shift * step
    shape = np.ceil((ends.max(axis=0) + margin - origin) / step).astype(int) + 1
    volume = np.zeros(shape, dtype=np.float32)
    plane = np.stack(np.meshgrid(*map(np.arange, shape[1:]), indexing="ij"), axis=-1).reshape(-1, 2)
    for i in range(shape[0]):
        points = origin + step * np.c_[np.full(len(plane), i), plane]
        volume[i] = skin.field(points @ turn.T)[:, 0].reshape(shape[1:])
    return volume, origin


def _skimage_marching_cubes() -> Any:
    return package("skimage.measure", "creatures", "making a creature").marching_cubes


def _is_sphere(vertices: FloatArray, faces: IntArray) -> bool:
    mesh = Mesh(vertices, faces)
    closed = 3 * mesh.n_faces == 2 * len(mesh.edges)
    return closed and mesh.n_vertices - len(mesh.edges) + mesh.n_faces == 2 and mesh.components.max() == 0


def _flip_edges(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Flip, all at once, edges that are not Delaunay and share no triangle."""
    n = len(vertices)
    tail, head, opposite = (np.roll(faces, -i, axis=1).ravel() for i in range(3))
    keys = np.minimum(tail, head) * n + np.maximum(tail, head)
    order = np.argsort(keys, kind="stable")
    one, two = order[::2], order[1::2]  # the two half-edges of each edge

    to_tail, to_head = vertices[tail] - vertices[opposite], vertices[head] - vertices[opposite]
    cross = np.cross(to_tail, to_head)
    cotangent = np.einsum("ij,ij->i", to_tail, to_head) / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)
    badness = -(cotangent[one] + cotangent[two])  # positive where the opposite angles add up to more than π

    a, b, c, d = tail[one], head[one], opposite[one], opposite[two]
    fresh = np.minimum(c, d) * n + np.maximum(c, d)
    sorted_keys = keys[one]
    is_edge = sorted_keys[np.minimum(np.searchsorted(sorted_keys, fresh), len(sorted_keys) - 1)] == fresh
    normal = cross[one] + cross[two]
    flat = np.ones(len(one), dtype=bool)
    for triangle in ((a, d, c), (d, b, c)):
        p, q, r = (vertices[corner] for corner in triangle)
        new = np.cross(q - p, r - p)
        cosine = np.einsum("ij,ij->i", new, normal) / np.maximum(np.linalg.norm(new, axis=1), 1e-300)
        flat &= cosine > 0.8 * np.linalg.norm(normal, axis=1)
    wanted = np.flatnonzero((badness > 1e-6) & ~is_edge & flat)
    wanted = wanted[np.argsort(-badness[wanted], kind="stable")]
    wanted = wanted[np.sort(np.unique(fresh[wanted], return_index=True)[1])]

    rank = np.arange(len(wanted))
    best = np.full(len(faces), len(wanted))
    np.minimum.at(best, one[wanted] // 3, rank)
    np.minimum.at(best, two[wanted] // 3, rank)
    chosen = wanted[(best[one[wanted] // 3] == rank) & (best[two[wanted] // 3] == rank)]

    flipped = faces.copy()
    a, b, c, d = a[chosen], b[chosen], c[chosen], d[chosen]
    flipped[one[chosen] // 3] = np.column_stack([a, d, c])
    flipped[two[chosen] // 3] = np.column_stack([d, b, c])
    return flipped


def _smooth_vertices(skin: Skin, vertices: FloatArray, faces: IntArray, rounds: int) -> FloatArray:
    """Move each vertex towards the mean of its neighbours, along the surface."""
    n = len(vertices)
    i, j = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    neighbours = coo_array((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    degree = np.bincount(i, minlength=n)[:, None]
    for _ in range(rounds):
        step = neighbours @ vertices / degree - vertices
        normals = Mesh(vertices, faces).vertex_normals
        step -= np.einsum("ij,ij->i", step, normals)[:, None] * normals
        vertices = skin.project(vertices + 0.7 * step, steps=1)
    return vertices


def _subdivide(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Split each triangle into four at the midpoints of its edges."""
    n = len(vertices)
    tail, head = faces, np.roll(faces, -1, axis=1)
    keys, middle = np.unique(np.minimum(tail, head) * n + np.maximum(tail, head), return_inverse=True)
    midpoints = 0.5 * (vertices[keys // n] + vertices[keys % n])
    (a, b, c), (ab, bc, ca) = faces.T, n + middle.reshape(faces.shape).T
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([vertices, midpoints]), np.concatenate([np.column_stack(q) for q in quarters])


def _shuffle_vertices(vertices: FloatArray, faces: IntArray, rng: np.random.Generator) -> Mesh:
    """Put vertices, faces and the corners of each face in random order, so that the order reveals nothing."""
    order = rng.permutation(len(vertices))
    position = np.argsort(order)
    faces = position[faces[rng.permutation(len(faces))]]
    corners = (np.arange(3) + rng.integers(0, 3, len(faces))[:, None]) % 3
    return Mesh(vertices[order], np.take_along_axis(faces, corners, axis=1))
