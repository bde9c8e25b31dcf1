"""Shapes whose geodesic distances or eigenvalues are known in closed form, and meshes in disguise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from isomatch import Correspondence, Mesh
from isomatch.surfaces import nearest_on_surface
from zoo.made import moved, together


def planar_delaunay(n: int, seed: int = 0) -> Mesh:
    """Random points of the unit square, triangulated; the hull is convex, so distances are Euclidean."""
    points = np.random.default_rng(seed).random((n, 2))
    return Mesh(np.pad(points, ((0, 0), (0, 1))), Delaunay(points).simplices)


def flat_grid(rows: int, columns: int, shear: float = 0.0) -> Mesh:
    """A parallelogram of unit steps, x = column + shear · row; a shear makes obtuse triangles."""
    y, x = np.divmod(np.arange(rows * columns), columns)
    a = np.flatnonzero((x < columns - 1) & (y < rows - 1))
    b = a + columns
    faces = np.stack([a, a + 1, b + 1, a, b + 1, b], axis=1).reshape(-1, 3)
    return Mesh(np.column_stack([x + shear * y, y, np.zeros(len(x))]), faces)


def icosphere(level: int) -> Mesh:
    """The unit sphere: an icosahedron, its faces split in four ``level`` times; 10 · 4^level + 2 vertices."""
    golden = (1 + 5**0.5) / 2
    base = [[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array([np.roll(corner, turn) for turn in range(3) for corner in base])
    apart = np.linalg.norm(vertices[:, None] - vertices, axis=2)
    joined = np.abs(apart - 2) < 1e-9
    faces = np.array(
        [
            (i, j, k)
            for i in range(12)
            for j in range(i)
            for k in range(j)
            if joined[i, j] and joined[j, k] and joined[i, k]
        ]
    )
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    sphere = Mesh(vertices, faces)
    for _ in range(level):
        sphere = _unit(split_in_four(_unit(sphere)))
    return _unit(sphere)


def _unit(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True), mesh.faces)


def split_in_four(mesh: Mesh) -> Mesh:
    """The same surface with each face split at the middles of its edges; the old vertices come first."""
    vertices, faces = mesh.vertices, mesh.faces
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, of_face = np.unique(ends, axis=0, return_inverse=True)
    middle = len(vertices) + of_face.reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = faces.T, middle.T
    quarters = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    split = np.concatenate([np.stack(corners, axis=1) for corners in quarters])
    return Mesh(np.vstack([vertices, vertices[edges].mean(axis=1)]), split)


def cylinder(around: int, along: int) -> Mesh:
    """An open prism over a regular polygon of perimeter 1, with square faces cut in two; developable."""
    i, j = np.divmod(np.arange(around * along), along)
    radius = 0.5 / (around * np.sin(np.pi / around))
    angle = 2 * np.pi * i / around
    vertices = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), j / around])
    i, j = i[j < along - 1], j[j < along - 1]
    a, b = i * along + j, (i + 1) % around * along + j
    return Mesh(vertices, np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)]))


def cylinder_distances(around: int, along: int, source: int) -> np.ndarray:
    """Distances on that prism from one vertex to all, by unrolling it."""
    i, j = np.divmod(np.arange(around * along), along)
    steps = np.abs(i - source // along)
    return np.hypot(np.minimum(steps, around - steps), j - source % along) / around


def box(*sizes: int) -> Mesh:
    """A closed box of a × b × c unit squares, each cut in two."""
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        i, j = (k.ravel() for k in np.indices((sizes[u], sizes[v])))
        for side in (0, sizes[axis]):
            corners = np.zeros((len(i), 4, 3), dtype=int)
            corners[:, :, axis] = side
            corners[:, :, u] = i[:, None] + [0, 1, 1, 0]
            corners[:, :, v] = j[:, None] + [0, 0, 1, 1]
            quads.append(corners if side else corners[:, ::-1])
    vertices, number = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    quad = number.reshape(-1, 4)
    return Mesh(vertices.astype(float), np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]))


def two_spheres(level: int, second_radius: float) -> Mesh:
    """A unit sphere and, well apart, a second one: two components."""
    one = icosphere(level)
    return together(one, moved(one, [5, 0, 0], second_radius))


def map_to_nearest(points: np.ndarray, target: Mesh) -> Correspondence:
    """The precise map from points to the nearest points of a surface in the same place."""
    images = nearest_on_surface(target, points)
    nearest = images.corners[np.arange(len(points)), images.barycentric.argmax(axis=1)]
    return Correspondence(nearest, target.n_vertices, *images)


@dataclass(frozen=True)
class Disguised:
    """A mesh that was moved, scaled and relabelled; ``new_vertex[i]`` is what became of vertex i."""

    mesh: Mesh
    new_vertex: np.ndarray


def disguised(mesh: Mesh, seed: int = 0, scale: float = 1.0, rotate: bool = True) -> Disguised:
    """Permute vertices, faces and first corners of faces; rotate, shift, scale: the surface alone is left."""
    rng = np.random.default_rng(seed)
    old_vertex = rng.permutation(mesh.n_vertices)
    new_vertex = np.argsort(old_vertex)
    faces = new_vertex[mesh.faces][rng.permutation(mesh.n_faces)]
    turns = (np.arange(3) + rng.integers(3, size=(len(faces), 1))) % 3
    faces = np.take_along_axis(faces, turns, axis=1)
    vertices = mesh.vertices[old_vertex]
    if rotate:
        vertices = Rotation.random(random_state=seed).apply(vertices) + rng.normal(size=3)
    return Disguised(Mesh(scale * vertices, faces), new_vertex)


def upper_share(mesh, axis=2, share=0.5):
    """What lies above a plane, with a share of the faces."""
    height = mesh.vertices[mesh.faces].mean(axis=1)[:, axis]
    kept, number = np.unique(mesh.faces[height > np.quantile(height, 1 - share)], return_inverse=True)
    return Mesh(mesh.vertices[kept], number.reshape(-1, 3))


def inside_out(mesh):
    """The same mesh with the corners of its faces reversed."""
    return Mesh(mesh.vertices, mesh.faces[:, ::-1])
