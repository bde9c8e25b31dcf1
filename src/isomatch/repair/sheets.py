"""Separate sheets that were glued together, such as limbs that touch in a scan."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.repair.self_contacts import copy_at_fans, edges_to_root, face_normals
from isomatch.surfaces import (
    EdgeTable,
    Mesh,
    corner_links,
    count_fans,
    edge_table,
    first_equal,
    label_components,
    meetings,
    unsound_faces,
)

# √area; copies of a vertex that are farther apart along the surface are on two sheets: decisions.md,
# separated sheets
SHEET_DISTANCE = 0.1
# Largest number of vertices of a seam, evenly chosen, for which the distance between their copies, one on each
# sheet, is measured along edges; chosen.
PROBES_PER_SEAM = 8


@dataclass(frozen=True, eq=False, repr=False)
class Separation:
    """A mesh whose sheets were separated."""

    mesh: Mesh  # vertices are the glued ones, then copies of some
    vertex_index: IntArray  # the vertex of the glued mesh that each vertex comes from, (n_new,)
    seams: tuple[IntArray, ...]  # separated vertices (s,) of the glued mesh, for each connected seam

    @property
    def is_manifold(self) -> bool:
        """Whether at most two faces meet at an edge, and one fan at a vertex."""
        return not crowded_vertices(self.mesh).any()

    def __repr__(self) -> str:
        return f"Separation({self.mesh!r}, {len(self.seams)} seams)"


def crowded_vertices(mesh: Mesh) -> BoolArray:
    """Find the vertices (n,) of edges with more than two faces, or with several fans."""
    edges = mesh.edge_table
    several: BoolArray = np.greater(count_fans(mesh.faces, edges, mesh.n_vertices), 1)
    several[edges.ends[edges.n_faces > 2]] = True
    return several


def separate_sheets(mesh: Mesh, least_distance: float = SHEET_DISTANCE) -> Separation:
    """Separate sheets that are glued together at vertices, edges or faces, if they are far apart.

    Where more than two faces meet at an edge, the faces of one sheet traverse it in opposite directions
    and have the most similar normals. Around a vertex, the faces of one sheet form a fan. Each fan
    gets a vertex of its own, at the same position.

    The faces are wound consistently, inward or outward; coincident vertices count as different. Sheets
    are separated if copies of a vertex of the seam are farther apart along edges than the least
    distance, in √area: a pinch between neighbours shortens no path. Copies are at one position, so
    distances between them need ``weld=False``. Pieces that would become components of their own stay
    glued, or are left out if they have no vertices of their own. O(n log n) time, and about 0.1 ms
    for each edge of more than two faces.
    """
    whole = Separation(mesh, np.arange(mesh.n_vertices), ())
    faces = _restore_layers(mesh.vertices, mesh.faces)
    used = np.zeros((mesh.n_vertices, 1), dtype=bool)
    used[faces] = True
    points = np.where(used, mesh.vertices, 0.0)
    points /= np.abs(points).max(initial=0.0) or 1.0  # scaled, so that squares do not overflow
    partners = _Partners(points, faces)
    partners.heal()
    fan, vertex = partners.fans()
    if (np.bincount(vertex, minlength=1) < 2).all():
        return whole
    fan, vertex = _drop_islands(mesh, fan, vertex)
    separated = Mesh(points[vertex], fan)
    distant = far_copies(separated, vertex, _seams(faces, vertex), least_distance)
    if not distant:
        return whole
    are_copied = np.isin(np.arange(mesh.n_vertices), np.concatenate(distant))
    return Separation(*copy_at_fans(mesh, fan, vertex, are_copied), tuple(distant))


def _restore_layers(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Return the sound faces, (m, 3), without repeated ones, and with coinciding layers put back."""
    # Where sheets coincide, faces traverse each edge equally often in both directions. A face that is listed
    # twice traverses its edges once too often. If one of two layers of a patch was removed as duplicate, each
    # edge of the rim of the patch lacks a traversal, in the same direction all around.
    unsound = unsound_faces(vertices, faces)
    faces = faces[~(unsound.any & ~unsound.duplicate)]
    edges = edge_table(faces, len(vertices))
    side, edge, direction = sides_by_edge(edges, faces)
    # for each edge: traversals from the smaller to the larger vertex, minus those back
    surplus = np.bincount(edge, direction, len(edges.ends))
    lowest = faces.argmin(axis=1)[:, None]
    turned = np.take_along_axis(faces, (lowest + np.arange(3)) % 3, axis=1)
    too_often = np.bincount(side // 3, surplus[edge] * direction > 0) == 3
    is_repeated = (first_equal(turned) != np.arange(len(faces))) & too_often
    if is_repeated.any():
        return _restore_layers(vertices, faces[~is_repeated])
    if not surplus[edges.n_faces > 2].any():
        return faces
    met = meetings(edges, faces)
    plain = met.sides[met.is_pair & ~met.same_direction]
    n_pieces, piece = label_components(len(faces), tuple(plain.T // 3))
    is_rim = np.ones(faces.size, dtype=bool)
    is_rim[plain] = False
    rim = side[is_rim[side]]
    edge_of, direction_of = edge[is_rim[side]], direction[is_rim[side]]
    owner = piece[rim // 3]
    signs = surplus[edge_of] * direction_of * (edges.n_faces[edge_of] > 1)
    one_sign = np.abs(np.bincount(owner, np.sign(signs), n_pieces)) == np.bincount(owner, minlength=n_pieces)
    area = np.bincount(piece, Mesh(vertices, faces).face_areas, n_pieces)
    layers = [faces]
    rim_of = np.argsort(owner, kind="stable")
    start = np.searchsorted(owner[rim_of], np.arange(n_pieces + 1))
    faces_of = split_by(piece)
    # Smaller pieces get their layer first: a wall before the rooms beside it.
    for i in np.flatnonzero(one_sign)[area[one_sign].argsort(kind="stable")]:
        rim_rows = rim_of[start[i] : start[i + 1]]
        sign = np.sign(surplus[edge_of[rim_rows]] * direction_of[rim_rows])
        if len(rim_rows) and abs(sign.sum()) == len(rim_rows):
            np.subtract.at(surplus, edge_of[rim_rows], sign * direction_of[rim_rows])
            layers.append(faces[faces_of[i]][:, :: -int(sign[0])])
    return np.concatenate(layers)


def _drop_islands(mesh: Mesh, fan: IntArray, vertex: IntArray) -> tuple[IntArray, IntArray]:
    """Remove components without a vertex of their own, and rejoin the others: fans (m, 3), vertices."""
    # The largest piece of each component of the mesh keeps its fans. Other pieces with vertices of their
    # own, such as rooms with a common wall, are joined with the largest at the vertices they share.
    label = Mesh(mesh.vertices[vertex], fan).components
    origin = mesh.components[vertex]
    by_size = np.bincount(label)[label].argsort(kind="stable")
    main = np.zeros(origin.max() + 1, dtype=np.int64)
    main[origin[by_size]] = label[by_size]  # the last assignment wins: the largest component
    is_main = main[origin] == label
    order = np.lexsort([~is_main, vertex])[::-1]
    first = np.zeros(mesh.n_vertices, dtype=np.int64)
    first[vertex[order]] = order  # the last assignment wins: the main component, if any
    has_own = np.bincount(label, ~is_main[first[vertex]]) > 0
    kept = is_main | has_own[label]
    joined, number = np.unique(np.where(is_main, np.arange(len(vertex)), first[vertex]), return_inverse=True)
    return number.ravel()[fan[kept[fan[:, 0]]]], vertex[joined]


def _seams(faces: IntArray, vertex: IntArray) -> list[IntArray]:
    """List the connected sets of vertices with several fans, given the vertex of each fan."""
    glued = np.flatnonzero(np.bincount(vertex, minlength=int(faces.max()) + 1) > 1)
    number = np.full(int(faces.max()) + 1, -1, dtype=np.int64)
    number[glued] = np.arange(len(glued))
    ends = number[np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])]
    _, label = label_components(len(glued), tuple(ends[(ends >= 0).all(axis=1)].T))
    return [glued[rows] for rows in split_by(label)]


def far_copies(
    separated: Mesh, vertex: IntArray, seams: list[IntArray], least_distance: float
) -> list[IntArray]:
    """Select the seams with copies of a vertex that are far apart along edges; ``vertex`` is sorted."""
    is_near = _near_along_edges(separated, least_distance)

    def is_far(seam: IntArray) -> bool:
        probed = seam[np.unique(np.linspace(0, len(seam) - 1, PROBES_PER_SEAM).astype(int))]
        firsts, ends = (np.searchsorted(vertex, probed, side=side) for side in ("left", "right"))
        return any(not is_near(first)[first + 1 : end].all() for first, end in zip(firsts, ends))

    return [seam for seam in seams if is_far(seam)]


def welds_neighbours(mesh: Mesh, least_distance: float) -> bool:
    """Whether all vertices at one position are within the least distance along edges, in √area.

    Welding them then merges no sheets. The mesh must be manifold and sound. O(n + s log s) time for each
    vertex at the position of an earlier one, where s vertices are within the distance.
    """
    first = first_equal(mesh.vertices)
    copies = np.flatnonzero(first != np.arange(mesh.n_vertices))
    scaled = mesh.moved(mesh.vertices / (np.abs(mesh.vertices).max(initial=0.0) or 1.0))
    is_near = _near_along_edges(scaled, least_distance)
    return all(is_near(int(copy))[first[copy]] for copy in copies)


def _near_along_edges(mesh: Mesh, distance: float) -> Callable[[int], BoolArray]:
    """Return a function that tells which vertices are within a distance, in √area, of one along edges."""
    lengths = coo_array((mesh.edge_lengths, tuple(mesh.edges.T)), shape=(mesh.n_vertices,) * 2).tocsr()
    limit = distance * np.sqrt(mesh.area)
    return lambda vertex: np.asarray(dijkstra(lengths, directed=False, indices=vertex, limit=limit) <= limit)


# largest loss, see `_Partners`, at which partners are exchanged; chosen: an exchange between two flat sheets
# that touch loses 2
MAX_LIKENESS_LOSS = 1.95
HEALING_ROUNDS = 3  # rounds in which wrong choices of partners are exchanged; chosen
# largest number of faces of an edge that are paired, as the time is quadratic; chosen: edges at which sheets
# touch have 4 or 6 faces
MAX_PAIRED_FACES = 100
# largest number of vertices with one fan, in connected crowded edges, that are paired, as all pairs are
# compared; chosen
MAX_PAIRED_VERTICES = 1000


class _Partners:
    """The sides of m faces that continue one another on a sheet."""

    # Side 3 f + i of face f goes from its corner i to the next. partner (3 m,) is the side that continues
    # each side, or −1. _chained (k, 2) pairs the sides that stay together: of edges of two faces, of edges
    # with more than MAX_PAIRED_FACES, and of edges with unequal numbers of sides in both directions. The
    # likeness of two faces is ((1 + cos a) / 2)², where a is the angle between their normals. For each other
    # edge, change has the least loss, the likeness of two pairs minus that after they exchange partners, and
    # the two sides that exchange them.
    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        self._faces, self._n = faces, len(vertices)
        edges = edge_table(faces, len(vertices))
        side, edge, direction = sides_by_edge(edges, faces)
        balanced = (np.bincount(edge, direction, len(edges.ends)) == 0) & (edges.n_faces <= MAX_PAIRED_FACES)
        met = meetings(edges, faces)
        self._chained = met.sides[met.is_pair | ~balanced[met.edge]]
        self.partner = np.full(faces.size, -1, dtype=np.int64)
        self.change: dict[tuple[int, int], tuple[float, int, int]] = {}
        normals = face_normals(Mesh(vertices, faces))
        first = np.cumsum(edges.n_faces) - edges.n_faces
        for e in np.flatnonzero(balanced & (edges.n_faces > 2)):
            rows = slice(first[e], first[e] + edges.n_faces[e])
            along, against = (side[rows][direction[rows] == sign] for sign in (1, -1))
            likeness = (1 + normals[along // 3] @ normals[against // 3].T) ** 2 / 4
            _, chosen = scipy.optimize.linear_sum_assignment(likeness, maximize=True)
            self.partner[along], self.partner[against[chosen]] = against[chosen], along
            kept = likeness[:, chosen]
            loss = np.diag(kept)[:, None] + np.diag(kept) - kept - kept.T
            loss[np.diag_indices(len(loss))] = np.inf
            i, j = divmod(int(loss.argmin()), len(loss))
            low, high = edges.ends[e].tolist()
            self.change[low, high] = max(float(loss[i, j]), 0.0), int(along[i]), int(along[j])

    def fans(self) -> tuple[IntArray, IntArray]:
        """Return the fan of each corner, (m, 3), and the vertex of each fan, sorted."""
        paired = np.flatnonzero(self.partner > np.arange(len(self.partner)))
        side, other_side = np.concatenate([self._chained, np.column_stack([paired, self.partner[paired]])]).T
        start = self._faces.ravel()
        links = corner_links(side, other_side, start[side] == start[other_side])
        n_fans, fan = label_components(len(start), *links)
        vertex = np.zeros(n_fans, dtype=np.int64)
        vertex[fan] = start
        order = np.argsort(vertex, kind="stable")
        number = np.argsort(order)
        return number[fan].reshape(-1, 3), vertex[order]

    def heal(self) -> None:
        """Exchange partners along paths between vertices of crowded edges that have only one fan."""
        # A wrong choice of partners at an edge joins the fans at both of its ends; wrong choices along a
        # path join the fans at its ends. So vertices with only one fan are connected by the paths along
        # which exchanges lose least.
        usable = [edge for edge, (loss, _, _) in self.change.items() if loss <= MAX_LIKENESS_LOSS]
        if not usable:
            return
        ends = np.array(usable)
        losses = np.array([self.change[edge][0] for edge in usable])
        _, net = label_components(self._n, tuple(ends.T))
        nets = [(ends[rows], losses[rows]) for rows in split_by(net[ends[:, 0]])]
        for _ in range(HEALING_ROUNDS):
            n_fans = np.bincount(self.fans()[1], minlength=self._n)
            changes = [edge for net in nets for edge in _healing_paths(*net, n_fans)]
            if not changes:
                return
            for edge in changes:
                _, p, q = self.change[edge]
                of_p, of_q = self.partner[[p, q]]
                self.partner[[p, of_q, q, of_p]] = of_q, p, of_p, q


def _healing_paths(ends: IntArray, losses: FloatArray, n_fans: IntArray) -> Iterator[tuple[int, int]]:
    """Yield the edges of paths between vertices with one fan, nearest pairs first; none if there are too many.

    The paths run along connected edges (e, 2), and their length is the loss (e,) by a change at each.
    """
    vertices, local = np.unique(ends, return_inverse=True)
    single = np.flatnonzero(n_fans[vertices] == 1)
    if not 2 <= len(single) <= MAX_PAIRED_VERTICES:
        return
    entries = losses + 1e-3, tuple(local.reshape(-1, 2).T)
    graph = coo_array(entries, shape=(len(vertices),) * 2).tocsr()
    lengths, before = dijkstra(graph, directed=False, indices=single, return_predecessors=True)
    for i, j in _nearest_pairs(lengths[:, single]):
        for edge in np.sort(edges_to_root(before[i], int(single[j])), axis=1):
            low, high = vertices[edge].tolist()
            yield low, high


def split_by(label: IntArray) -> list[IntArray]:
    """Return the indices of each label, in order."""
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(label) else []


def sides_by_edge(edges: EdgeTable, faces: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the sides, (3 m,), sorted by edge, the edge of each, and its direction.

    The direction is 1 from the smaller vertex to the larger one, otherwise −1.
    """
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    edge = np.repeat(np.arange(len(edges.ends)), edges.n_faces)
    return edges.sides, edge, np.where(start < end, 1, -1)[edges.sides]


def _nearest_pairs(lengths: FloatArray) -> Iterator[tuple[int, int]]:
    """Pair rows of a symmetric matrix, nearest first; rows without a path to another stay alone."""
    lengths[np.tril_indices(len(lengths))] = np.inf
    met: set[int] = set()
    for flat in lengths.argsort(axis=None, kind="stable"):
        i, j = divmod(int(flat), len(lengths))
        if lengths[i, j] == np.inf:
            return
        if i not in met and j not in met:
            met |= {i, j}
            yield i, j
