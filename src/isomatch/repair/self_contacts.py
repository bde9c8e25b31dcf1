"""Self-contacts: limbs that touch and are fused, as in a scan; their handles and creases, and the paths to cut along."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra, minimum_spanning_tree

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch.repair.caps import boundary_loops, capped
from isomatch.surfaces import Mesh, corner_links, joined, linked, meetings

# What a length counts along an edge at which the surface bends by so many degrees, negative where concave: the cut
# path of a self-contact is sharp and concave, while the other loops around the same handle lie across convex limbs
BENDS = (-60.0, -30.0, 0.0, 40.0)
COSTS = (0.1, 0.5, 1.0, 2.0)

# no settings: they decide where cut paths are looked for, ``preparation.self_contact_concavity`` which loop is one,
# and the handles of the shapes how many are cut
CONCAVE = -30.0  # degrees, of an edge whose ends are roots of trees
MOST_ROOTS = 100  # one near each cut path is enough
REACH = 0.4  # cost, in √area, of the longest path from a root: half that of the longest cut path
LOOPS_OF_ROOT = 4  # shortest loops that are kept of each root
TINY = 0.06  # length, in √area, that each cut path has at least: the surface need not be concave where these are points


@dataclass(frozen=True, eq=False, repr=False)
class Cut:
    """A mesh that was cut along the paths of self-contacts."""

    mesh: Mesh  # the vertices of the mesh as it was; copies of some of them, at the same positions, follow
    vertex_index: IntArray  # (n_new,) vertex of the mesh as it was of each vertex
    cut_paths: tuple[IntArray, ...]  # vertices (s,) around each cut path, of the mesh as it was

    def __repr__(self) -> str:
        return f"Cut({self.mesh!r}, {len(self.cut_paths)} cut paths)"


def handles(mesh: Mesh) -> int:
    """Count the handles of a mesh whose holes are closed, its genus: 0 of a body, 1 of a ring. O(n).

    A hand that touches a thigh, and is fused with it, makes a handle.
    """
    mesh, _ = opened(mesh, mesh.edge_table.n_faces > 2, np.arange(mesh.n_vertices))
    pieces = len(np.unique(mesh.components[mesh.faces[:, 0]]))
    # 2 − 2 g = V − E + F of each piece, with a face for each hole
    euler = len(np.unique(mesh.faces)) - len(mesh.edges) + mesh.n_faces + len(boundary_loops(mesh))
    return max((2 * pieces - euler) // 2, 0)


def cut_self_contacts(mesh: Mesh, most: int, concavity: float = 0.5) -> Cut:
    """Cut limbs that are fused with what they touch, along the paths of at most so many self-contacts, cheapest first.

    The mesh is one component, wound outward. A cut path costs, at most, its length times the concavity: sharp concave
    edges cost 0.1 of their length, flat ones 1 and convex ones up to 2. Erickson & Whittlesey, *Greedy Optimal Homotopy
    and Homology Generators*, SODA 2005; O(r n log n) for r = 100 roots at concave edges, of which only the
    neighbourhoods are searched; about 0.3 s a self-contact at 10 000 vertices.
    """
    # the cut path of a self-contact is a loop of sharp concave edges that does not separate the surface; the loops
    # around the limb are convex. So where concave edges count little, the shortest loop that does not separate the
    # surface is a cut path
    index, cut_paths = np.arange(mesh.n_vertices), list[IntArray]()
    for _ in range(most):  # one by one, as the next cut path may lie along a rim of the last cut
        apart, vertex = opened(mesh, mesh.edge_table.n_faces > 2, np.arange(mesh.n_vertices))
        cut_path = _cut_path(capped(apart), apart.n_vertices, concavity)
        if cut_path is None:
            break
        loop = vertex[cut_path]
        cut_paths.append(index[loop])
        mesh, copied = opened(mesh, are_among(mesh.edges, _around(loop)), loop)
        index = index[copied]
    return Cut(mesh, index, tuple(cut_paths))


def opened(mesh: Mesh, cut: BoolArray, at: IntArray) -> tuple[Mesh, IntArray]:
    """Cut a mesh along edges, (e,), with a copy of some vertices for each fan; returns also the old number of each."""
    met = meetings(mesh.edge_table, mesh.faces)
    kept = ~cut[met.edge]
    here, there = met.sides[kept].T
    count, fan = linked(mesh.faces.size, *corner_links(here, there, met.same_direction[kept]))
    vertex = np.zeros(count, dtype=np.int64)
    vertex[fan] = mesh.faces.ravel()
    return copied(mesh, fan.reshape(-1, 3), vertex, np.isin(np.arange(mesh.n_vertices), at))


def copied(mesh: Mesh, fan: IntArray, vertex: IntArray, of: BoolArray) -> tuple[Mesh, IntArray]:
    """Give some vertices, (n,), a copy for each further fan of the corners (m, 3); returns also the old numbers."""
    numbers = np.arange(len(vertex))
    first = np.zeros(mesh.n_vertices, dtype=np.int64)
    first[vertex[::-1]] = numbers[::-1]
    is_copy = of[vertex] & (first[vertex] != numbers)
    number = np.where(is_copy, mesh.n_vertices + np.cumsum(is_copy) - 1, vertex)
    index = np.concatenate([np.arange(mesh.n_vertices), vertex[is_copy]])
    return Mesh(mesh.vertices[index], number[fan]), index


def are_among(ends: IntArray, edges: IntArray) -> BoolArray:
    """Which edges, with sorted ends (e, 2), are among others (s, 2), (e,)."""
    unit = [int(ends.max(initial=0)) + 1, 1]
    return np.isin(ends @ unit, np.sort(edges, axis=1) @ unit)


def _around(loop: IntArray) -> IntArray:
    """Edges (s, 2) around a loop of vertices."""
    return np.column_stack([loop, np.roll(loop, -1)])


def inner_edges(mesh: Mesh) -> tuple[IntArray, IntArray]:
    """List the edges at which exactly two faces meet: their ends (e, 2), and these faces (e, 2)."""
    met = meetings(mesh.edge_table, mesh.faces)
    return mesh.edges[met.edge[met.is_pair]], met.sides[met.is_pair] // 3


class _Closed:
    """A mesh whose holes are closed by vertices from some number on, and their faces."""

    def __init__(self, mesh: Mesh, n_real: int) -> None:
        self.mesh, self.n_real = mesh, n_real
        self.ends, self.beside = inner_edges(mesh)
        is_real = np.all(mesh.faces < n_real, axis=1)
        self.is_real: BoolArray = is_real[self.beside].all(axis=1)

    def separates(self, loop: IntArray) -> bool:
        """Whether a loop cuts what is real into more pieces."""
        cut = self.is_real & ~are_among(self.ends, _around(loop))
        before, after = (
            linked(self.mesh.n_faces, tuple(self.beside[kept].T))[0] for kept in (self.is_real, cut)
        )
        return after > before


def bends_and_costs(mesh: Mesh, ends: IntArray, beside: IntArray) -> tuple[FloatArray, FloatArray]:
    """Angle in degrees by which a surface bends at inner edges, (e,), negative where it is concave; and their costs."""
    normals = face_normals(mesh)
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    here, there = beside.T
    cosine = np.einsum("ij,ij->i", normals[here], normals[there])
    rises = np.einsum("ij,ij->i", centres[there] - centres[here], normals[here]) > 0
    angles: FloatArray = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    bends = np.where(rises, -angles, angles)
    lengths = np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)
    return bends, lengths * np.interp(bends, BENDS, COSTS)


def face_normals(mesh: Mesh) -> FloatArray:
    """Compute unit normals (m, 3) of the faces, 0 where they have no area."""
    cross = mesh.face_cross
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), np.finfo(float).tiny))


def _cut_path(mesh: Mesh, n_real: int, concavity: float) -> IntArray | None:
    """Find the cheapest concave loop of a closed mesh that does not separate what is real of it."""
    closed = _Closed(mesh, n_real)
    least = TINY * np.sqrt(mesh.area)
    concave = [
        (cost, loop) for cost, length, loop in _loops(closed) if cost <= concavity * max(length, least)
    ]
    loops = (loop for _, loop in sorted(concave, key=itemgetter(0)))
    return next((loop for loop in loops if not closed.separates(loop)), None)


def _loops(closed: _Closed) -> Iterator[tuple[float, float, IntArray]]:
    """Yield the shortest loops near concave edges that do not separate a closed mesh: cost, length and vertices."""
    mesh, ends, n = closed.mesh, closed.ends, closed.mesh.n_vertices
    bends, costs = bends_and_costs(mesh, ends, closed.beside)
    concave = np.unique(ends[(bends < CONCAVE) & (ends < closed.n_real).all(axis=1)])
    spread = np.linspace(0, len(concave) - 1, MOST_ROOTS).astype(int)
    roots = concave[np.unique(spread)] if len(concave) else []
    graph = coo_array((costs, tuple(ends.T)), shape=(n, n)).tocsr()
    reach = REACH * np.sqrt(mesh.area)
    for root in roots:
        asked = {"indices": root, "return_predecessors": True, "limit": reach}
        distance, before = dijkstra(graph, directed=False, **asked)
        closing, totals = _closing_edges(distance, before, ends, closed.beside, costs, mesh.n_faces)
        for k in np.argsort(totals, kind="stable")[:LOOPS_OF_ROOT]:
            loop, first = _loop(before, *ends[closing[k]])
            if (loop < closed.n_real).all() and len(loop) > 2:
                sides = mesh.vertices[loop] - mesh.vertices[np.roll(loop, -1)]
                cost = totals[k] - 2 * distance[first]  # without the way to the loop and back
                yield float(cost), float(np.linalg.norm(sides, axis=1).sum()), loop


def _loop(before: AnyArray, *ends: int) -> tuple[IntArray, int]:
    """Vertices along the loop that an edge closes in a tree, and the one that is nearest to the root."""
    here, there = (path_to_root(before, vertex) for vertex in ends)
    while len(here) > 1 and len(there) > 1 and here[-2] == there[-2]:
        here.pop()
        there.pop()
    return np.array(here + there[-2::-1]), here[-1]


def path_to_root(before: AnyArray, vertex: int) -> list[int]:
    """Vertices from one of a tree to its root."""
    path = [int(vertex)]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path


@compiled()
def _closing_edges(
    distance: FloatArray, before: AnyArray, ends: IntArray, beside: IntArray, costs: FloatArray, n_faces: int
) -> tuple[IntArray, FloatArray]:
    """Edges that close loops of a tree that do not separate a closed mesh, and the costs of the ways around them."""
    # the shortest loops through a root that do not separate the surface are closed by the edges that are neither in its
    # tree of shortest paths nor in the spanning tree of the faces whose edges close the longest loops (Erickson &
    # Whittlesey 2005). Faces are joined across the edges that are not in the tree, those of the longest loops first; an
    # edge whose faces have been joined before closes a loop that a path of faces crosses once
    parent = np.arange(n_faces)
    total = np.empty(len(ends))
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        in_tree = before[a] == b or before[b] == a
        total[e] = -1.0 if in_tree else distance[a] + distance[b] + costs[e]
        if total[e] == np.inf:
            joined(parent, beside[e, 0], beside[e, 1])
    near = np.flatnonzero((total >= 0) & (total < np.inf))
    closes = np.zeros(len(near), dtype=np.bool_)
    for k in np.argsort(-total[near]):
        closes[k] = not joined(parent, beside[near[k], 0], beside[near[k], 1])
    return near[closes], total[near[closes]]


# no settings: a crease is a hypothesis only, which the map closes again where it is a fold; and
# ``preparation.self_contact_concavity`` = 0 rules all of them out
SHARP = -45.0  # degrees, of the edges that make a crease
GAP = 0.03  # cost, in √area, of the paths that join pieces of a crease
LEAST = 0.12  # length, in √area, of a crease


def creases(mesh: Mesh) -> IntArray:
    """Find the edges (s, 2) of sharp concave creases, in disjoint paths. O(n log n)."""
    # sharp edges make pieces; those near one another are joined by shortest paths in a metric in which concave edges are
    # cheap; and of each piece the longest path of a spanning tree is kept, for a surface without holes that is cut along
    # disjoint paths remains connected
    ends, beside = inner_edges(mesh)
    bends, costs = bends_and_costs(mesh, ends, beside)
    n, size = mesh.n_vertices, np.sqrt(mesh.area)
    sharp = bends < SHARP
    count, piece = linked(n, tuple(ends[sharp].T))
    sharp_ends = np.flatnonzero(np.bincount(piece, minlength=count)[piece] > 1)
    if not len(sharp_ends):
        return np.zeros((0, 2), dtype=np.int64)
    graph = coo_array((costs, tuple(ends.T)), shape=(n, n)).tocsr()
    asked = {"indices": sharp_ends, "min_only": True, "return_predecessors": True, "limit": GAP * size}
    near, before, owner = dijkstra(graph, directed=False, **asked)
    i, j = ends.T
    gaps = near[i] + near[j] + costs
    bridges = np.flatnonzero(gaps <= GAP * size)
    chosen, joined = [ends[sharp]], np.arange(count)
    for edge in bridges[np.argsort(gaps[bridges], kind="stable")]:
        one, other = joined[piece[owner[ends[edge]]]]
        if one != other:
            joined[joined == other] = one
            chosen.append(ends[edge][None])
            chosen += [edges_to_root(before, vertex) for vertex in ends[edge]]
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
    return np.asarray(ends[np.argsort(path[ends], kind="stable")].reshape(-1, 2))


def edges_to_root(before: AnyArray, vertex: int) -> IntArray:
    """Edges (q, 2) of the path from a vertex to the root of its tree."""
    along = np.array(path_to_root(before, vertex))
    return np.column_stack([along[:-1], along[1:]])


def _longest_paths(mesh: Mesh, edges: IntArray, least: float) -> IntArray:
    """Keep, of each connected set of edges, the longest path of a spanning tree, if it has a length."""
    n = mesh.n_vertices
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    # the tree has indices of this kind; dijkstra of scipy 1.15 takes no longer ones
    ends = tuple(edges.T.astype(np.int32))
    tree = minimum_spanning_tree(coo_array((lengths, ends), shape=(n, n)).tocsr())
    _, piece = connected_components(tree, directed=False)
    kept = [np.zeros((0, 2), dtype=np.int64)]
    for vertices in (np.flatnonzero(piece == each) for each in np.unique(piece[edges[:, 0]])):
        end = vertices[0]
        for _ in range(2):  # from anywhere to one end of the longest path, and from there to the other
            far, before = dijkstra(tree, directed=False, indices=end, return_predecessors=True)
            end = vertices[far[vertices].argmax()]
        if far[end] >= least:
            kept.append(edges_to_root(before, end))
    return np.concatenate(kept)
