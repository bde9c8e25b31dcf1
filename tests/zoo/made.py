"""How the larger shapes of the zoo are made: bodies, surfaces of every topology, and what can befall a mesh."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from isomatch import Mesh


def blob(n: int) -> Mesh:
    """A closed body without symmetry, wound outward: evenly spread directions, and a radius with four bumps."""
    i = np.arange(n) + 0.5
    height, turn = 1 - 2 * i / n, np.pi * (1 + 5**0.5) * i
    ring = np.sqrt(1 - height**2)
    directions = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
    bumps = np.array([[1, 0, 0, 1.6], [0, 1, 0.3, 0.9], [-0.6, -0.5, 0.7, 0.5], [0.2, -0.4, -1, 1.2]])
    peaks = bumps[:, :3] / np.linalg.norm(bumps[:, :3], axis=1, keepdims=True)
    radius = 1 + np.exp(6 * (directions @ peaks.T - 1)) @ bumps[:, 3]
    faces = ConvexHull(directions).simplices
    a, b, c = (directions[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(directions * radius[:, None], faces)


def sheet(rows: int, columns: int, place: object = None) -> Mesh:
    """A sheet of rows × columns vertices; ``place`` maps (u, v) in the unit square to positions."""
    i, j = np.divmod(np.arange(rows * columns), columns)
    a = np.flatnonzero((i < rows - 1) & (j < columns - 1))
    b, c, d = a + columns, a + columns + 1, a + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    u, v = i / (rows - 1), j / (columns - 1)
    positions = (u, v, 0 * u) if place is None else place(u, v)
    return Mesh(np.column_stack(np.broadcast_arrays(*positions)), faces)


def glued(mesh: Mesh, digits: int = 6) -> Mesh:
    """The mesh with vertices at the same rounded position made one, each face kept."""
    _, first, name = np.unique(
        mesh.vertices.round(digits) + 0.0, axis=0, return_index=True, return_inverse=True
    )
    faces = name.ravel()[mesh.faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Mesh(mesh.vertices[first], faces[whole])


def boxes(cells: object, size: object = (1, 1, 1), inner: bool = False) -> Mesh:
    """The surface of a solid made of boxes, cells (i, j, k) of a grid; with inner walls if ``inner``."""
    filled = {tuple(cell) for cell in cells}
    soup = []
    for cell in sorted(filled):
        for axis in range(3):
            for side in (0, 1):
                step = np.eye(3, dtype=int)[axis] * (2 * side - 1)
                if (inner and side == 1) or tuple(np.array(cell) + step) not in filled:
                    p, q = (np.eye(3)[(axis + k) % 3] for k in (1, 2))
                    corner = np.array(cell) + side * np.eye(3)[axis]
                    square = [corner, corner + p, corner + p + q, corner + q][:: 2 * side - 1]
                    soup += [square[0], square[1], square[2], square[0], square[2], square[3]]
    points = np.array(soup) * np.asarray(size, dtype=float)
    return glued(Mesh(points, np.arange(len(points)).reshape(-1, 3)))


def block(a: int, b: int, c: int) -> list[tuple[int, int, int]]:
    """Cells of a block."""
    return [(i, j, k) for i in range(a) for j in range(b) for k in range(c)]


def mobius_strip(around: int = 40, across: int = 6) -> Mesh:
    """A Möbius strip."""

    def place(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
        angle, w = 2 * np.pi * u, v - 0.5
        r = 2 + w * np.cos(angle / 2)
        return r * np.cos(angle), r * np.sin(angle), w * np.sin(angle / 2)

    return glued(sheet(around + 1, across, place))


def klein_bottle(around: int = 30, across: int = 14) -> Mesh:
    """A Klein bottle: a figure of eight swept around a circle with half a turn; it crosses itself along a circle."""

    def place(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
        angle, w = 2 * np.pi * u, 2 * np.pi * (v + 0.013)  # no vertex where it crosses itself
        x, y = np.sin(w), np.sin(2 * w)
        r = 3 + np.cos(angle / 2) * x - np.sin(angle / 2) * y
        return r * np.cos(angle), r * np.sin(angle), np.sin(angle / 2) * x + np.cos(angle / 2) * y

    grid = sheet(around + 1, across + 1, place)
    i, j = np.divmod(np.arange((around + 1) * (across + 1)), across + 1)
    name = (i % around) * across + np.where(i == around, across - j, j) % across
    vertices = np.zeros((around * across, 3))
    vertices[name[::-1]] = grid.vertices[::-1]
    return Mesh(vertices, name[grid.faces])


def together(*meshes: Mesh) -> Mesh:
    """Several meshes in one."""
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    return Mesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.faces + start for mesh, start in zip(meshes, starts)]),
    )


def moved(mesh: Mesh, by: object = (0, 0, 0), scale: object = 1.0) -> Mesh:
    """The mesh scaled and moved."""
    return Mesh(mesh.vertices * scale + np.asarray(by, dtype=float), mesh.faces)


def placed(mesh: Mesh, positions: dict[int, object]) -> Mesh:
    """The mesh with some vertices elsewhere."""
    vertices = mesh.vertices.copy()
    for vertex, position in positions.items():
        vertices[vertex] = position
    return Mesh(vertices, mesh.faces)


def with_faces(mesh: Mesh, faces: object) -> Mesh:
    """The mesh with further faces."""
    return Mesh(mesh.vertices, np.vstack([mesh.faces, np.asarray(faces, dtype=np.int64).reshape(-1, 3)]))


def with_vertices(mesh: Mesh, vertices: object) -> Mesh:
    """The mesh with further vertices, which no face uses."""
    return Mesh(np.vstack([mesh.vertices, vertices]), mesh.faces)


def without_faces(mesh: Mesh, faces: object) -> Mesh:
    """The mesh without some faces."""
    return Mesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0))


def flipped(mesh: Mesh, faces: object = slice(None)) -> Mesh:
    """The mesh with some faces wound the other way."""
    turned = mesh.faces.copy()
    turned[faces] = turned[faces][:, ::-1]
    return Mesh(mesh.vertices, turned)


def soup(mesh: Mesh) -> Mesh:
    """The mesh with three vertices of its own for each face, as in an STL file."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))


def cut_along(mesh: Mesh, right: np.ndarray) -> Mesh:
    """The mesh with the vertices between the faces ``right`` and the others doubled, as along a seam."""
    shared = np.intersect1d(mesh.faces[right], mesh.faces[~right])
    name = np.arange(mesh.n_vertices)
    name[shared] = mesh.n_vertices + np.arange(len(shared))
    faces = mesh.faces.copy()
    faces[right] = name[faces[right]]
    return Mesh(np.vstack([mesh.vertices, mesh.vertices[shared]]), faces)


def coincident(mesh: Mesh, one: int, other: int) -> Mesh:
    """The mesh with one vertex at the position of another."""
    return placed(mesh, {other: mesh.vertices[one]})


def random_points(n: int, seed: int = 0) -> np.ndarray:
    """Points of a cube."""
    return np.random.default_rng(seed).uniform(-1, 1, (n, 3))
