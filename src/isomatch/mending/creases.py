"""Creases: sharp concave edges along which limbs may be fused without a handle, as an arm along the trunk."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra, minimum_spanning_tree

from isomatch.mending.contacts import are_among, bends_and_costs, inner_edges, opened, path_to_root
from isomatch.surfaces import Mesh, linked
from isomatch.values.arrays import AnyArray, IntArray

# no settings: a crease is a hypothesis only, which the map closes again where it is a fold; and
# ``preparation.contact_concavity`` = 0 rules all of them out
SHARP = -45.0  # degrees, of the edges that make a crease
GAP = 0.03  # cost, in √area, of the paths that join pieces of a crease
LEAST = 0.12  # length, in √area, of a crease


def creases(mesh: Mesh) -> IntArray:
    """Find the edges (s, 2) of sharp concave creases.

    Edges at which the surface bends sharply inward make pieces. Pieces that are near one another are joined by shortest
    paths in a metric in which concave edges are cheap. Of each piece, a path is kept: the longest in a spanning tree.

    Notes
    -----
    A surface without holes that is cut along disjoint paths remains connected. O(n log n).
    """
    ends, beside = inner_edges(mesh)
    bends, costs = bends_and_costs(mesh, ends, beside)
    n, size = mesh.n_vertices, np.sqrt(mesh.area)
    sharp = bends < SHARP
    count, piece = linked(n, tuple(ends[sharp].T))
    known = np.flatnonzero(np.bincount(piece, minlength=count)[piece] > 1)
    if not len(known):
        return np.zeros((0, 2), dtype=np.int64)
    near, before, owner = dijkstra(
        coo_array((costs, tuple(ends.T)), shape=(n, n)).tocsr(),
        directed=False,
        indices=known,
        min_only=True,
        return_predecessors=True,
        limit=GAP * size,
    )
    i, j = ends.T
    gaps = near[i] + near[j] + costs
    bridges = np.flatnonzero(gaps <= GAP * size)
    chosen, joined = [ends[sharp]], np.arange(count)
    for edge in bridges[np.argsort(gaps[bridges], kind="stable")]:
        one, other = joined[piece[owner[ends[edge]]]]
        if one != other:
            joined[joined == other] = one
            chosen.append(ends[edge][None])
            chosen += [_path(before, vertex) for vertex in ends[edge]]
    edges = np.unique(np.sort(np.concatenate(chosen), axis=1), axis=0)
    is_cut = are_among(ends, _longest_paths(mesh, edges, LEAST * size))
    # next to a hole, a path may cut off a piece
    _, part = linked(mesh.n_faces, tuple(beside[~is_cut].T))
    aside = (part[beside] != np.bincount(part).argmax()).any(axis=1)
    kept: IntArray = ends[is_cut & ~aside]
    return kept


def cut_along(mesh: Mesh, edges: IntArray) -> tuple[Mesh, IntArray]:
    """Cut a mesh along paths of edges (s, 2); returns also the vertex of the mesh of each vertex, the old ones first."""
    return opened(mesh, are_among(mesh.edges, edges), np.unique(edges))


def ends_of(edges: IntArray) -> IntArray:
    """First and last vertex (q, 2) of each of some disjoint paths of edges (s, 2)."""
    n = int(edges.max()) + 1
    _, path = linked(n, tuple(edges.T))
    ends = np.flatnonzero(np.bincount(edges.ravel(), minlength=n) == 1)
    found: IntArray = ends[np.argsort(path[ends], kind="stable")].reshape(-1, 2)
    return found


def _path(before: AnyArray, vertex: int) -> IntArray:
    """Edges (q, 2) of the path from a vertex to the root of its tree."""
    along = np.array(path_to_root(before, vertex))
    return np.column_stack([along[:-1], along[1:]])


def _longest_paths(mesh: Mesh, edges: IntArray, least: float) -> IntArray:
    """Keep, of each connected set of edges, the longest path of a spanning tree, if it has a length."""
    n = mesh.n_vertices
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    tree = minimum_spanning_tree(coo_array((lengths, tuple(edges.T)), shape=(n, n)).tocsr())
    _, piece = connected_components(tree, directed=False)
    kept = [np.zeros((0, 2), dtype=np.int64)]
    for vertices in (np.flatnonzero(piece == each) for each in np.unique(piece[edges[:, 0]])):
        end = vertices[0]
        for _ in range(2):  # from anywhere to one end of the longest path, and from there to the other
            far, before = dijkstra(tree, directed=False, indices=end, return_predecessors=True)
            end = vertices[far[vertices].argmax()]
        if far[end] >= least:
            kept.append(_path(before, end))
    return np.concatenate(kept)
