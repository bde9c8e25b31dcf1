"""Other triangulations with fewer vertices: decimated, or of a density that varies along the body.

Edges are collapsed onto one of their ends, so that every vertex that remains is one of the original.
"""

from __future__ import annotations

import heapq
from dataclasses import replace

import numpy as np

from isomatch.geodesics import distance_engine, peripheral_vertex
from isomatch.lab.damage.damaged import SHARES, Damaged, require_usable, with_faces
from isomatch.loading.compiled import compiled
from isomatch.surfaces import Mesh
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

LENGTH_WEIGHT = (
    1e-3  # of the squared length beside the quadric error, so that flat parts keep a regular triangulation
)
LARGEST_TURN = 0.2  # least cosine of the angle by which a face may turn in one collapse
RATIOS = (1.0, 1000.0)  # of densities


def decimate(mesh: Mesh, share: float = 0.25, *, seed: int = 0) -> Damaged:
    """Decimate by quadric errors.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    share : float
        Share of the vertices to keep, between 0 and 1.
    seed : int
        Without effect, because nothing is drawn.

    Returns
    -------
    Damaged
        The topology and all vertices of boundaries are preserved, and no vertex moves. More vertices remain if no further
        edge can be collapsed. With a ``stand_in`` for each removed vertex: the one it was collapsed onto.

    Raises
    ------
    SettingError
        If the share is not between 0 and 1.
    MeshError
        If the mesh is no surface.

    Notes
    -----
    Garland & Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997, with each edge collapsed onto
    its better end. O(n log n).
    """
    require_usable(mesh, "share", share, SHARES)
    weights = np.full(mesh.n_vertices, LENGTH_WEIGHT * mesh.area / mesh.n_faces)
    return _collapsed(mesh, share, _quadrics(mesh), weights)


def resample(mesh: Mesh, ratio: float = 16.0, *, seed: int = 0) -> Damaged:
    """Thin out the vertices more and more from one end of the body to the other.

    Parameters
    ----------
    mesh : Mesh
        The whole; if it is evenly sampled, the result has the density that is asked for.
    ratio : float
        Density at the dense end, where all vertices are kept, over that at the other end; above 1, at most 1000.
    seed : int
        Draws the vertex from which the dense end is searched.

    Returns
    -------
    Damaged
        The density decreases exponentially with the geodesic distance from the dense end. The topology and all
        vertices of boundaries are preserved, and no vertex moves. With a ``stand_in`` for each removed vertex.

    Raises
    ------
    SettingError
        If the ratio is out of range.
    MeshError
        If the mesh is no surface.

    Notes
    -----
    The shortest edge is collapsed first, lengths being multiplied by the root of the density. O(n log n).
    """
    require_usable(mesh, "ratio", ratio, RATIOS)
    engine = distance_engine(mesh)
    distance = engine.distances_from(np.array([peripheral_vertex(mesh, engine, seed)]))[0]
    farthest = distance[np.isfinite(distance)].max()
    density = ratio ** -np.minimum(distance / farthest, 1.0)
    return _collapsed(mesh, float(density.mean()), np.zeros((mesh.n_vertices, 4, 4)), density)


def _quadrics(mesh: Mesh) -> FloatArray:
    """(n, 4, 4) Q: (p, 1) Q (p, 1)ᵀ sums a third of area × squared distance to p over the planes of a vertex's faces.

    Positions are about the mean of the vertices.
    """
    normals = mesh.face_cross / np.maximum(2 * mesh.face_areas, 1e-300)[:, None]
    offsets = np.einsum("fx,fx->f", normals, _centred(mesh)[mesh.faces[:, 0]])
    planes = np.column_stack([normals, -offsets])
    of_faces = mesh.face_areas[:, None, None] / 3 * planes[:, :, None] * planes[:, None, :]
    quadrics = np.zeros((mesh.n_vertices, 4, 4))
    for corner in range(3):
        np.add.at(quadrics, mesh.faces[:, corner], of_faces)
    return quadrics


def _centred(mesh: Mesh) -> FloatArray:
    """Vertices about their mean, so that quadrics of a shape far from the origin lose no digits."""
    centred: FloatArray = mesh.vertices - mesh.vertices.mean(axis=0)
    return centred


def _collapsed(mesh: Mesh, share: float, quadrics: FloatArray, weights: FloatArray) -> Damaged:
    """Collapse edges, the one of least error + weight × length² first, until a share of the vertices is left."""
    faces = mesh.sound_faces.copy()
    n_used = len(np.unique(faces))
    n_removed = n_used - max(round(share * n_used), 4)
    alive, onto = _collapse(
        _centred(mesh), faces, mesh.edges, quadrics, weights, _at_boundary(mesh), n_removed
    )
    while (onto[onto] != onto).any():
        onto = onto[onto]
    damaged = with_faces(mesh, faces[alive])
    return replace(damaged, stand_in=damaged.damaged_vertex[onto])


def _at_boundary(mesh: Mesh) -> BoolArray:
    """(n,) which vertices end an edge that does not belong to exactly two faces."""
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, counts = np.unique(sides, axis=0, return_counts=True)
    at_boundary = np.zeros(mesh.n_vertices, dtype=bool)
    at_boundary[edges[counts != 2]] = True
    return at_boundary


@compiled()
def _collapse(
    points: FloatArray,
    faces: IntArray,
    edges: IntArray,
    quadrics: FloatArray,
    weights: FloatArray,
    at_boundary: BoolArray,
    n_removed: int,
) -> tuple[BoolArray, IntArray]:
    """Collapse edges u → v in place, in ``faces`` and ``quadrics``; return which faces are left, and v for each u.

    The corners of the faces at a vertex form a linked list, so that v takes over those of u at once. An edge in the heap
    is out of date if either end has taken over another vertex since.
    """
    n, m = len(points), len(faces)
    alive = np.ones(m, dtype=np.bool_)
    first, last = np.full(n, -1), np.full(n, -1)
    following = np.full(3 * m, -1)
    for corner in range(3 * m):
        vertex = faces[corner // 3, corner % 3]
        if first[vertex] < 0:
            first[vertex] = corner
        else:
            following[last[vertex]] = corner
        last[vertex] = corner
    age = np.zeros(n, dtype=np.int64)  # -1: removed
    mark = np.full(n, -1)
    onto = np.arange(n)
    heap = [(0.0, 0, 0, 0, 0) for _ in range(0)]
    for i in range(len(edges)):
        for side in range(2):
            u, v = edges[i, side], edges[i, 1 - side]
            heap.append((_cost(points, quadrics, weights, u, v), u, v, 0, 0))
    heapq.heapify(heap)
    turn = 0
    while n_removed > 0 and len(heap) > 0:
        _, u, v, age_u, age_v = heapq.heappop(heap)
        turn += 2
        if age[u] != age_u or age[v] != age_v or at_boundary[u]:
            continue
        if not _may_collapse(points, faces, alive, first, following, mark, turn, u, v):
            continue
        corner = first[u]
        while corner >= 0:
            face = corner // 3
            if faces[face, 0] == v or faces[face, 1] == v or faces[face, 2] == v:
                alive[face] = False
            else:
                faces[face, corner % 3] = v
            corner = following[corner]
        following[last[v]], last[v] = first[u], last[u]
        for i in range(4):
            for j in range(4):
                quadrics[v, i, j] += quadrics[u, i, j]
        age[u], age[v] = -1, age[v] + 1
        onto[u] = v
        n_removed -= 1
        mark[v] = turn + 1
        corner = first[v]
        while corner >= 0:
            face = corner // 3
            for k in range(3):
                w = faces[face, k]
                if alive[face] and mark[w] != turn + 1:
                    mark[w] = turn + 1
                    heapq.heappush(heap, (_cost(points, quadrics, weights, v, w), v, w, age[v], age[w]))
                    heapq.heappush(heap, (_cost(points, quadrics, weights, w, v), w, v, age[w], age[v]))
            corner = following[corner]
    return alive, onto


@compiled()
def _cost(points: FloatArray, quadrics: FloatArray, weights: FloatArray, u: int, v: int) -> float:
    """Quadric error of u and v at v, plus weight × squared length."""
    p = (points[v, 0], points[v, 1], points[v, 2], 1.0)
    cost = 0.0
    for i in range(4):
        for j in range(4):
            cost += p[i] * (quadrics[u, i, j] + quadrics[v, i, j]) * p[j]
    squared = 0.0
    for x in range(3):
        squared += (points[u, x] - points[v, x]) ** 2
    cost += 0.5 * (weights[u] + weights[v]) * squared
    return float(cost)


@compiled()
def _may_collapse(
    points: FloatArray,
    faces: IntArray,
    alive: BoolArray,
    first: IntArray,
    following: IntArray,
    mark: IntArray,
    turn: int,
    u: int,
    v: int,
) -> bool:
    """Whether u may move onto v: the topology is preserved, and no face turns over.

    The topology is preserved if the common neighbours of u and v are the opposite corners of their common faces.
    """
    n_common_faces = 0
    corner = first[u]
    while corner >= 0:
        face = corner // 3
        if alive[face]:
            for k in range(3):
                mark[faces[face, k]] = turn
            if faces[face, 0] == v or faces[face, 1] == v or faces[face, 2] == v:
                n_common_faces += 1
            elif _turns_over(points, faces[face], corner % 3, v):
                return False
        corner = following[corner]
    n_common = 0
    mark[u] = mark[v] = -1
    corner = first[v]
    while corner >= 0:
        face = corner // 3
        for k in range(3):
            w = faces[face, k]
            if alive[face] and mark[w] == turn:
                mark[w] = -1
                n_common += 1
        corner = following[corner]
    return n_common == n_common_faces


@compiled()
def _turns_over(points: FloatArray, face: IntArray, k: int, v: int) -> bool:
    """Whether a face turns too far, or loses its area, when its corner k moves to v."""
    before_after, before, after = 0.0, 0.0, 0.0  # products of the normals
    a, b, u = face[(k + 1) % 3], face[(k + 2) % 3], face[k]
    for x in range(3):
        y, z = (x + 1) % 3, (x + 2) % 3
        n = _normal(points, u, a, b, y, z)
        m = _normal(points, v, a, b, y, z)
        before_after += n * m
        before += n * n
        after += m * m
    return bool(before_after <= LARGEST_TURN * np.sqrt(before * after))


@compiled(inline="always")
def _normal(points: FloatArray, u: int, a: int, b: int, y: int, z: int) -> float:
    """Coordinate x of (a - u) × (b - u), with y and z the axes after x."""
    first = (points[a, y] - points[u, y]) * (points[b, z] - points[u, z])
    second = (points[a, z] - points[u, z]) * (points[b, y] - points[u, y])
    return float(first - second)
