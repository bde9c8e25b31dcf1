"""Self-contacts: limbs that touch and are fused in a scan; their handles, creases and cut paths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra, minimum_spanning_tree

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch.repair.caps import boundary_loops, close_holes
from isomatch.surfaces import Mesh, corner_links, join_trees, label_components, meetings

# Degrees by which the surface bends at an edge, negative where it is concave; LENGTH_COSTS has the cost for
# each, and costs in between are interpolated. The cut path of a self-contact is sharp and concave, while
# other loops around its handle cross convex limbs; chosen.
COST_ANGLES = (-60.0, -30.0, 0.0, 40.0)
LENGTH_COSTS = (0.1, 0.5, 1.0, 2.0)  # cost of an edge over its length, for each of COST_ANGLES; chosen

# The next constants say where cut paths are sought; ``preparation.self_contact_concavity`` decides which
# loop is a cut path, and the numbers of handles of the shapes decide how many are cut.
ROOT_ANGLE = -30.0  # degrees; loops begin at roots, ends of edges that bend more sharply inward; chosen
MAX_ROOTS = 100  # largest number of roots; chosen: one root near each cut path is enough
MAX_PATH_COST = 0.4  # √area; largest cost of a path from a root; chosen: half the longest cut path's cost
LOOPS_PER_ROOT = 4  # number of cheapest loops through a root that are tried; chosen
# √area; the largest cost of a cut path grows with its length, but shorter paths are taken as this long, because
# some of their edges might not be concave; chosen
MIN_CUT_PATH_LENGTH = 0.06


@dataclass(frozen=True, eq=False, repr=False)
class Cut:
    """A mesh that was cut along the paths of self-contacts."""

    mesh: Mesh  # vertices are the given ones, then copies of some, at the same positions
    vertex_index: IntArray  # the given vertex that each vertex comes from, (n_new,)
    cut_paths: tuple[IntArray, ...]  # closed loops of vertices (s,) of the given mesh, in order

    def __repr__(self) -> str:
        return f"Cut({self.mesh!r}, {len(self.cut_paths)} cut paths)"


def count_handles(mesh: Mesh) -> int:
    """Count the handles of a mesh whose holes are closed, its genus: 0 of a body, 1 of a ring. O(n).

    A hand that touches a thigh, and is fused with it, makes a handle.
    """
    mesh, _ = cut_edges(mesh, mesh.edge_table.n_faces > 2, np.arange(mesh.n_vertices))
    pieces = len(np.unique(mesh.components[mesh.faces[:, 0]]))
    # A piece of genus g with V vertices, E edges, F faces and one more for each hole has V − E + F = 2 − 2 g.
    euler = len(np.unique(mesh.faces)) - len(mesh.edges) + mesh.n_faces + len(boundary_loops(mesh))
    return max((2 * pieces - euler) // 2, 0)


def cut_self_contacts(mesh: Mesh, most: int, concavity: float = 0.5) -> Cut:
    """Cut fused limbs apart along the cut paths of at most ``most`` self-contacts, the cheapest first.

    The mesh is one component, wound outward. A cut path costs at most its length times the concavity:
    sharp concave edges cost 0.1 of their length, flat ones 1 and convex ones up to 2. Erickson &
    Whittlesey, *Greedy Optimal Homotopy and Homology Generators*, SODA 2005. O(r n log n) time for
    r = 100 roots at concave edges, around which loops are sought; about 0.3 s for each self-contact
    at 10 000 vertices.
    """
    # The cut path of a self-contact is a loop of sharp concave edges that does not separate the
    # surface; the loops around the limb are convex. With concave edges cheap, the shortest loop that
    # does not separate the surface is a cut path.
    index, cut_paths = np.arange(mesh.n_vertices), list[IntArray]()
    for _ in range(most):  # one by one, as a cut path may lie along the rim of the last cut
        opened, vertex = cut_edges(mesh, mesh.edge_table.n_faces > 2, np.arange(mesh.n_vertices))
        path = _cut_path(close_holes(opened), opened.n_vertices, concavity)
        if path is None:
            break
        rim_loop = vertex[path]
        cut_paths.append(index[rim_loop])
        mesh, vertex = cut_edges(mesh, are_among(mesh.edges, _around(rim_loop)), rim_loop)
        index = index[vertex]
    return Cut(mesh, index, tuple(cut_paths))


def cut_edges(mesh: Mesh, cut: BoolArray, copied_at: IntArray) -> tuple[Mesh, IntArray]:
    """Cut a mesh along edges, (e,); some vertices get a copy for each fan. Return also the old numbers."""
    met = meetings(mesh.edge_table, mesh.faces)
    kept = ~cut[met.edge]
    side, other_side = met.sides[kept].T
    count, fan = label_components(mesh.faces.size, *corner_links(side, other_side, met.same_direction[kept]))
    vertex = np.zeros(count, dtype=np.int64)
    vertex[fan] = mesh.faces.ravel()
    return copy_at_fans(mesh, fan.reshape(-1, 3), vertex, np.isin(np.arange(mesh.n_vertices), copied_at))


def copy_at_fans(mesh: Mesh, fan: IntArray, vertex: IntArray, are_copied: BoolArray) -> tuple[Mesh, IntArray]:
    """Copy some vertices, (n,), for each further fan of the corners (m, 3); return also the old numbers."""
    numbers = np.arange(len(vertex))
    first = np.zeros(mesh.n_vertices, dtype=np.int64)
    first[vertex[::-1]] = numbers[::-1]
    is_copy = are_copied[vertex] & (first[vertex] != numbers)
    number = np.where(is_copy, mesh.n_vertices + np.cumsum(is_copy) - 1, vertex)
    index = np.concatenate([np.arange(mesh.n_vertices), vertex[is_copy]])
    return Mesh(mesh.vertices[index], number[fan]), index


def are_among(ends: IntArray, edges: IntArray) -> BoolArray:
    """Find the edges, with sorted ends (e, 2), that are among others (s, 2): a mask (e,)."""
    unit = [int(ends.max(initial=0)) + 1, 1]
    return np.isin(ends @ unit, np.sort(edges, axis=1) @ unit)


def _around(loop: IntArray) -> IntArray:
    """List the edges (s, 2) around a loop of vertices."""
    return np.column_stack([loop, np.roll(loop, -1)])


def inner_edges(mesh: Mesh) -> tuple[IntArray, IntArray]:
    """List the edges at which exactly two faces meet: their ends (e, 2), and these faces (e, 2)."""
    met = meetings(mesh.edge_table, mesh.faces)
    return mesh.edges[met.edge[met.is_pair]], met.sides[met.is_pair] // 3


def bends_and_costs(mesh: Mesh, ends: IntArray, beside: IntArray) -> tuple[FloatArray, FloatArray]:
    """Measure the angles at inner edges, (e,), in degrees, negative where concave, and their costs."""
    normals = face_normals(mesh)
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    face, neighbour = beside.T
    cosine = np.einsum("ij,ij->i", normals[face], normals[neighbour])
    rises = np.einsum("ij,ij->i", centres[neighbour] - centres[face], normals[face]) > 0
    angles: FloatArray = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    bends = np.where(rises, -angles, angles)
    lengths = np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)
    return bends, lengths * np.interp(bends, COST_ANGLES, LENGTH_COSTS)


def face_normals(mesh: Mesh) -> FloatArray:
    """Compute unit normals (m, 3) of the faces, 0 where they have no area."""
    cross = mesh.face_cross
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), np.finfo(float).tiny))


def _cut_path(mesh: Mesh, n_real: int, concavity: float) -> IntArray | None:
    """Find the cheapest concave loop that does not separate the real faces, those of the first n_real vertices."""
    least = MIN_CUT_PATH_LENGTH * np.sqrt(mesh.area)
    ends, beside = inner_edges(mesh)
    loops = _nonseparating_loops(mesh, n_real, ends, beside)
    concave = ((cost, loop) for cost, length, loop in loops if cost <= concavity * max(length, least))
    joined = np.all(np.all(mesh.faces < n_real, axis=1)[beside], axis=1)
    n_pieces, _ = label_components(mesh.n_faces, tuple(beside[joined].T))
    for _, loop in sorted(concave, key=itemgetter(0)):
        remaining = beside[joined & ~are_among(ends, _around(loop))]
        if label_components(mesh.n_faces, tuple(remaining.T))[0] <= n_pieces:
            return loop
    return None


def _nonseparating_loops(
    mesh: Mesh, n_real: int, ends: IntArray, beside: IntArray
) -> Iterator[tuple[float, float, IntArray]]:
    """Yield short loops near concave edges that do not separate a closed mesh: cost, length, vertices."""
    n = mesh.n_vertices
    bends, costs = bends_and_costs(mesh, ends, beside)
    concave = np.unique(ends[(bends < ROOT_ANGLE) & (ends < n_real).all(axis=1)])
    spread = np.linspace(0, len(concave) - 1, MAX_ROOTS).astype(int)
    roots = concave[np.unique(spread)] if len(concave) else []
    graph = coo_array((costs, tuple(ends.T)), shape=(n, n)).tocsr()
    reach = MAX_PATH_COST * np.sqrt(mesh.area)
    for root in roots:
        asked = {"indices": root, "return_predecessors": True, "limit": reach}
        distance, before = dijkstra(graph, directed=False, **asked)
        closing, totals = _closing_edges(distance, before, ends, beside, costs, mesh.n_faces)
        for k in np.argsort(totals, kind="stable")[:LOOPS_PER_ROOT]:
            loop, first = _closed_loop(before, *ends[closing[k]])
            if (loop < n_real).all() and len(loop) > 2:
                sides = mesh.vertices[loop] - mesh.vertices[np.roll(loop, -1)]
                cost = totals[k] - 2 * distance[first]  # minus the path from the root to the loop, and back
                yield float(cost), float(np.linalg.norm(sides, axis=1).sum()), loop


def _closed_loop(before: AnyArray, *ends: int) -> tuple[IntArray, int]:
    """List the vertices along the loop that an edge closes in a tree; return also the nearest to the root."""
    from_first, from_second = (_path_to_root(before, vertex) for vertex in ends)
    while len(from_first) > 1 and len(from_second) > 1 and from_first[-2] == from_second[-2]:
        from_first.pop()
        from_second.pop()
    return np.array(from_first + from_second[-2::-1]), from_first[-1]


def _path_to_root(before: AnyArray, vertex: int) -> list[int]:
    """List the vertices of a tree from one of them to the root."""
    path = [int(vertex)]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path


@compiled()
def _closing_edges(
    distance: FloatArray, before: AnyArray, ends: IntArray, beside: IntArray, costs: FloatArray, n_faces: int
) -> tuple[IntArray, FloatArray]:
    """Find edges that close nonseparating loops of a tree in a closed mesh, and the costs of the loops."""
    # Erickson & Whittlesey 2005: the shortest nonseparating loops through a root are closed by edges
    # that are neither in its tree of shortest paths nor in the spanning tree of faces across the edges
    # of the longest loops. Faces are joined across edges outside the tree, longest loops first; an
    # edge whose faces are joined already closes a loop that a path of faces crosses once.
    parent = np.arange(n_faces)
    total = np.empty(len(ends))
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        in_tree = before[a] == b or before[b] == a
        total[e] = -1.0 if in_tree else distance[a] + distance[b] + costs[e]
        if total[e] == np.inf:
            join_trees(parent, beside[e, 0], beside[e, 1])
    near = np.flatnonzero((total >= 0) & (total < np.inf))
    closes = np.zeros(len(near), dtype=np.bool_)
    for k in np.argsort(-total[near]):
        closes[k] = not join_trees(parent, beside[near[k], 0], beside[near[k], 1])
    return near[closes], total[near[closes]]


# Bounds of creases. That surfaces touch at a crease is only a hypothesis; if it is a fold, the map closes the
# cut. With ``preparation.self_contact_concavity`` = 0 there are no creases.
CREASE_ANGLE = -45.0  # degrees; edges that bend more sharply inward form creases; chosen
MAX_BRIDGE_COST = 0.03  # √area; largest cost of a path that joins two pieces of a crease; chosen
MIN_CREASE_LENGTH = 0.12  # √area; least length of a crease; chosen


def find_creases(mesh: Mesh) -> IntArray:
    """Find the edges (s, 2) of sharp concave creases, in disjoint paths. O(n log n)."""
    # Sharp edges form pieces. Pieces near one another are joined by shortest paths, on which concave edges are
    # cheap. Each piece is reduced to the longest path of a spanning tree, because a surface without holes that
    # is cut along disjoint paths remains connected.
    ends, beside = inner_edges(mesh)
    bends, costs = bends_and_costs(mesh, ends, beside)
    n, size = mesh.n_vertices, np.sqrt(mesh.area)
    sharp = bends < CREASE_ANGLE
    count, piece = label_components(n, tuple(ends[sharp].T))
    sharp_ends = np.flatnonzero(np.bincount(piece, minlength=count)[piece] > 1)
    if not len(sharp_ends):
        return np.zeros((0, 2), dtype=np.int64)
    graph = coo_array((costs, tuple(ends.T)), shape=(n, n)).tocsr()
    limit = MAX_BRIDGE_COST * size
    asked = {"indices": sharp_ends, "min_only": True, "return_predecessors": True, "limit": limit}
    near, before, owner = dijkstra(graph, directed=False, **asked)
    i, j = ends.T
    gaps = near[i] + near[j] + costs
    bridges = np.flatnonzero(gaps <= limit)
    chosen, crease_of = [ends[sharp]], np.arange(count)
    for edge in bridges[np.argsort(gaps[bridges], kind="stable")]:
        one, other = crease_of[piece[owner[ends[edge]]]]
        if one != other:
            crease_of[crease_of == other] = one
            chosen.append(ends[edge][None])
            chosen += [edges_to_root(before, vertex) for vertex in ends[edge]]
    edges = np.unique(np.sort(np.concatenate(chosen), axis=1), axis=0)
    is_cut = are_among(ends, _longest_paths(mesh, edges, MIN_CREASE_LENGTH * size))
    # A path next to a hole may cut off a piece of the surface; the edges of such a path are left out.
    _, part = label_components(mesh.n_faces, tuple(beside[~is_cut].T))
    aside = (part[beside] != np.bincount(part).argmax()).any(axis=1)
    kept: IntArray = ends[is_cut & ~aside]
    return kept


def cut_along(mesh: Mesh, edges: IntArray) -> tuple[Mesh, IntArray]:
    """Cut a mesh along paths of edges (s, 2); return also the old number of each vertex."""
    return cut_edges(mesh, are_among(mesh.edges, edges), np.unique(edges))


def ends_of(edges: IntArray) -> IntArray:
    """Find the first and last vertex (q, 2) of each of some disjoint paths of edges (s, 2)."""
    n = int(edges.max()) + 1
    _, path = label_components(n, tuple(edges.T))
    ends = np.flatnonzero(np.bincount(edges.ravel(), minlength=n) == 1)
    return np.asarray(ends[np.argsort(path[ends], kind="stable")].reshape(-1, 2))


def edges_to_root(before: AnyArray, vertex: int) -> IntArray:
    """List the edges (q, 2) of the path from a vertex to the root of its tree."""
    along = np.array(_path_to_root(before, vertex))
    return np.column_stack([along[:-1], along[1:]])


def _longest_paths(mesh: Mesh, edges: IntArray, least: float) -> IntArray:
    """Keep the longest path of a spanning tree of each connected set of edges, if it is long enough."""
    n = mesh.n_vertices
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    # The indices have 32 bits, because dijkstra of scipy 1.15 takes no trees with longer ones.
    ends = tuple(edges.T.astype(np.int32))
    tree = minimum_spanning_tree(coo_array((lengths, ends), shape=(n, n)).tocsr())
    _, piece = connected_components(tree, directed=False)
    kept = [np.zeros((0, 2), dtype=np.int64)]
    for vertices in (np.flatnonzero(piece == label) for label in np.unique(piece[edges[:, 0]])):
        end = vertices[0]
        for _ in range(2):  # from any vertex to an end of the longest path, and from there to its other end
            far, before = dijkstra(tree, directed=False, indices=end, return_predecessors=True)
            end = vertices[far[vertices].argmax()]
        if far[end] >= least:
            kept.append(edges_to_root(before, end))
    return np.concatenate(kept)
