"""Damage that keeps the whole surface: noise, welds, fewer vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from isomatch import decimation
from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch.geodesics import distance_engine, euclidean_farthest_points, peripheral_vertex
from isomatch.surfaces import Mesh
from isomatch_lab.damage.damaged import SHARE_RANGE, Damaged, require_usable, with_faces

MIN_LIMB_DISTANCE = 0.5  # √area along the surface; more than half a torso's girth, so other limbs are glued
GAP_RANGE = (0.0, MIN_LIMB_DISTANCE)  # allowed gaps, in √area; chosen
MIN_FOLD_DISTANCE = 0.2  # √area along the surface; facing vertices that are nearer lie in one fold; chosen
N_PATCHES = 60  # number of patches of the surface, each of them a start to search far parts; chosen
DISTANCE_RANGE = (0.0, 10.0)  # allowed distances, in mean edge lengths; chosen


def noise(mesh: Mesh, share: float = 0.3, *, seed: int = 0) -> Damaged:
    """Add Gaussian noise to every coordinate of every vertex.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    share : float
        Standard deviation of each coordinate, as a share of the mean edge length; at most 10.
    seed : int
        Draws the noise.

    Returns
    -------
    Damaged
        The same faces and vertices, moved.

    Raises
    ------
    SettingError
        If the share is out of range.
    MeshError
        If the mesh is no surface.
    """
    require_usable(mesh, "share", share, DISTANCE_RANGE)
    steps = np.random.default_rng(seed).standard_normal(mesh.vertices.shape)
    vertices = mesh.vertices + share * mesh.edge_lengths.mean() * steps
    return Damaged(mesh, Mesh(vertices, mesh.faces), np.arange(mesh.n_vertices))


def weld(mesh: Mesh, gap: float = 0.02, *, seed: int = 0) -> Damaged:
    """Glue together limbs that touch: vertices near in space but far along the surface are merged, as in a fused scan.

    Pairs of vertices are merged, the nearest first, each into one vertex halfway between them.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    gap : float
        Largest distance across which vertices are merged, in √area, between 0 and 0.5. Of a human, whose skin has about
        2 m², 0.01 is 1.4 cm, a coarse voxel of a scan that is fused from depth images.
    seed : int
        Draws where the search begins.

    Returns
    -------
    Damaged
        With a ``twin`` for each merged vertex. All faces remain, so that the mesh is not manifold there.

    Raises
    ------
    SettingError
        If the gap is out of range.
    MeshError
        If no two parts are so near, or the mesh is no surface.

    Notes
    -----
    The two vertices of a pair are at least 0.5 √area apart along the surface, or in different components: more than the
    way around a limb, so that opposite sides of one limb are not merged. Costs 60 distance columns.
    """
    require_usable(mesh, "gap", gap, GAP_RANGE)
    partner = _nearest_far_vertex(mesh, seed)
    vertices = np.flatnonzero(partner >= 0)
    pairs = np.column_stack([vertices, partner[vertices]])
    widths = np.linalg.norm(mesh.vertices[pairs[:, 0]] - mesh.vertices[pairs[:, 1]], axis=1)
    order = widths.argsort(kind="stable")
    free = np.ones(mesh.n_vertices, dtype=bool)
    merged: list[IntArray] = []
    for pair in pairs[order[widths[order] <= gap * np.sqrt(mesh.area)]]:
        if free[pair].all():
            free[pair] = False
            merged.append(pair)
    if not merged:
        nearest = (
            f"; the nearest are {widths.min() / np.sqrt(mesh.area):.3f} √area apart" if len(widths) else ""
        )
        raise MeshError(
            f"no limbs of {mesh!r} are as near as {gap:g} √area{nearest}; give a larger gap, or a pose in "
            "which limbs touch"
        )
    return _merge_pairs(mesh, np.array(merged))


def merge(mesh: Mesh, distance: float = 1.5, *, seed: int = 0) -> Damaged:
    """Merge by distance, with one that is too large: facing vertices of limbs that touch become one.

    Pairs of vertices whose normals are opposed are merged, where each is the nearest such vertex of the other.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    distance : float
        Largest distance across which vertices are merged, in mean edge lengths; at most 10.
    seed : int
        Not used; nothing is drawn.

    Returns
    -------
    Damaged
        With a ``twin`` for each merged vertex, without the triangles whose three corners were merged.

    Raises
    ------
    SettingError
        If the distance is out of range.
    MeshError
        If no limbs are so near, or the mesh is no surface.

    Notes
    -----
    The two vertices of a pair are more than 0.2 √area apart along edges, or in different components.
    """
    require_usable(mesh, "distance", distance, DISTANCE_RANGE)
    pairs = _facing_pairs(mesh, distance * mesh.edge_lengths.mean())
    if not len(pairs):
        raise MeshError(
            f"no limbs of {mesh!r} that face each other are as near as {distance:g} mean edge lengths; give a larger "
            "distance, or a pose in which limbs touch"
        )
    glued = _merge_pairs(mesh, pairs)
    assert glued.twin is not None
    faces = glued.mesh.faces
    gone = (glued.twin[faces] >= 0).all(axis=1) | (np.diff(np.sort(faces, axis=1)) == 0).any(axis=1)
    if gone.all():
        raise MeshError(f"all corners of {mesh!r} would be merged, and nothing left; give a smaller distance")
    left = with_faces(glued.mesh, faces[~gone])
    return Damaged(mesh, left.mesh, glued.original[left.original], glued.twin[left.original])


def _facing_pairs(mesh: Mesh, distance: float) -> IntArray:
    """Pairs (q, 2) of vertices that face each other, are far along the surface, and mutually nearest."""
    normals, n = mesh.vertex_normals, mesh.n_vertices
    pairs = KDTree(mesh.vertices).query_pairs(distance, output_type="ndarray").astype(np.int64)
    pairs = pairs[np.einsum("ij,ij->i", *normals[pairs.T]) < 0]
    graph = coo_array((mesh.edge_lengths, tuple(mesh.edges.T)), shape=(n, n)).tocsr()
    limit = MIN_FOLD_DISTANCE * np.sqrt(mesh.area)
    is_far = np.ones(len(pairs), dtype=bool)
    for vertex in np.unique(pairs[:, 0]):
        rows = np.flatnonzero(pairs[:, 0] == vertex)
        is_far[rows] = dijkstra(graph, directed=False, indices=vertex, limit=limit)[pairs[rows, 1]] > limit
    pairs = pairs[is_far]
    both = np.concatenate([pairs, pairs[:, ::-1]])
    widths = np.linalg.norm(mesh.vertices[both[:, 0]] - mesh.vertices[both[:, 1]], axis=1)
    both = both[np.lexsort([widths, both[:, 0]])]
    nearest = np.full(n, -1)
    nearest[both[::-1, 0]] = both[::-1, 1]
    first = np.flatnonzero((nearest >= 0) & (nearest[nearest] == np.arange(n)))
    return np.column_stack([first, nearest[first]])[first < nearest[first]]


def _nearest_far_vertex(mesh: Mesh, seed: int) -> IntArray:
    """Find the nearest vertex in space among those that are far away along the surface, (n,); −1 if there is none."""
    # patch by patch: a vertex at distance r from the centre of its patch is at least d − r away from one at distance d
    body, index = mesh.submesh(mesh.vertex_areas > 0)
    start = int(np.random.default_rng(seed).integers(body.n_vertices))
    centres = euclidean_farthest_points(body.vertices, min(N_PATCHES, body.n_vertices), start)
    columns = distance_engine(body).distances_from(centres)
    patch = np.where(np.isfinite(columns.min(axis=0)), columns.argmin(axis=0), -1)
    partner = np.full(mesh.n_vertices, -1, dtype=np.int64)
    for i in np.unique(patch[patch >= 0]):  # where vertices coincide, a centre has no patch of its own
        column = columns[i]
        inside = np.flatnonzero(patch == i)
        if not len(inside):  # two centres at one position
            continue
        far = np.flatnonzero(column - column[inside].max() >= MIN_LIMB_DISTANCE * np.sqrt(mesh.area))
        if len(far):
            nearest = KDTree(body.vertices[far]).query(body.vertices[inside])[1]
            partner[index[inside]] = index[far[nearest]]
    return partner


def _merge_pairs(mesh: Mesh, pairs: IntArray) -> Damaged:
    """Merge each (first, second) of (q, 2) disjoint pairs into one vertex halfway between them."""
    first, second = pairs.T
    vertices, twin = mesh.vertices.copy(), np.full(mesh.n_vertices, -1, dtype=np.int64)
    vertices[first] = (mesh.vertices[first] + mesh.vertices[second]) / 2
    twin[first] = second
    original = np.delete(np.arange(mesh.n_vertices), second)
    renumber = np.zeros(mesh.n_vertices, dtype=np.int64)
    renumber[original] = np.arange(len(original))
    renumber[second] = renumber[first]
    return Damaged(mesh, Mesh(vertices[original], renumber[mesh.faces]), original, twin[original])


DENSITY_RATIO_RANGE = (1.0, 1000.0)  # allowed ratios of densities; chosen


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
    `isomatch.decimation.decimate` in place. O(n).
    """
    require_usable(mesh, "share", share, SHARE_RANGE)
    return _thin(mesh, share)


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
    `isomatch.decimation.decimate` in place, with the square of the density as weights. O(n), and one distance map.
    """
    require_usable(mesh, "ratio", ratio, DENSITY_RATIO_RANGE)
    engine = distance_engine(mesh)
    distance = engine.distances_from(np.array([peripheral_vertex(mesh, engine, seed)]))[0]
    farthest = distance[np.isfinite(distance)].max()
    density = ratio ** -np.minimum(distance / farthest, 1.0)
    return _thin(mesh, float(density.mean()), density**2)


def _thin(mesh: Mesh, share: float, weights: FloatArray | None = None) -> Damaged:
    """Merge vertices in place until a share of those in use is left."""
    n_unused = mesh.n_vertices - len(np.unique(mesh.sound_faces))
    wanted = max(round(share * (mesh.n_vertices - n_unused)), 4) + n_unused
    coarse = decimation.decimate(mesh, wanted, in_place=True, weights=weights)
    moved = np.linalg.norm(mesh.vertices - coarse.mesh.vertices[coarse.owner], axis=1)
    order = np.lexsort((moved, coarse.owner))  # vertices sorted by owner, the least moved first
    kept = order[np.unique(coarse.owner[order], return_index=True)[1]]
    damaged = with_faces(mesh, kept[coarse.mesh.faces])
    return replace(damaged, stand_in=damaged.damaged_vertex[kept[coarse.owner]])
