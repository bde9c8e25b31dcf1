"""Which sides of faces continue one another where more than two faces meet at an edge."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from isomatch.surfaces import EdgeTable, Mesh, corner_links, edge_table, linked, meetings
from isomatch.values.arrays import FloatArray, IntArray

LARGEST_LOSS = 1.95  # of likeness; a change of partners between two flat sheets loses two
HEALING_ROUNDS = 3
MOST_FACES = 100  # at an edge whose faces are paired; sheets that touch have 4 or 6, and pairing is quadratic
MOST_SINGLE = 1000  # vertices of one fan in a net of crowded edges; all pairs of them are compared


class Partners:
    """Which sides of m faces continue one another on a sheet: ``partner`` (3 m,), −1 where none does.

    Side 3 f + i of face f goes from its corner i to the next. Where directions do not cancel, or more than `MOST_FACES`
    faces meet, all sides of an edge stay together, by ``chained`` (k, 2). ``change`` has, for each crowded edge (vertex,
    vertex), the least loss of likeness, ((1 + cos) / 2)² of the angle between normals, by an exchange of partners, and
    the two sides that exchange theirs.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        self._faces, self._n = faces, len(vertices)
        edges = edge_table(faces, len(vertices))
        side, edge, direction = sides_of(edges, faces)
        balanced = (np.bincount(edge, direction, len(edges.ends)) == 0) & (edges.n_faces <= MOST_FACES)
        met = meetings(edges, faces)
        self._chained = met.sides[met.is_pair | ~balanced[met.edge]]
        self.partner = np.full(faces.size, -1, dtype=np.int64)
        self.change: dict[tuple[int, int], tuple[float, int, int]] = {}
        normals = Mesh(vertices, faces).face_cross
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        first = np.cumsum(edges.n_faces) - edges.n_faces
        for e in np.flatnonzero(balanced & (edges.n_faces > 2)):
            here = slice(first[e], first[e] + edges.n_faces[e])
            along, against = (side[here][direction[here] == sign] for sign in (1, -1))
            likeness = (1 + normals[along // 3] @ normals[against // 3].T) ** 2 / 4
            _, chosen = linear_sum_assignment(likeness, maximize=True)
            self.partner[along], self.partner[against[chosen]] = against[chosen], along
            kept = likeness[:, chosen]
            loss = np.diag(kept)[:, None] + np.diag(kept) - kept - kept.T
            loss[np.diag_indices(len(loss))] = np.inf
            i, j = divmod(int(loss.argmin()), len(loss))
            low, high = edges.ends[e].tolist()
            self.change[low, high] = max(float(loss[i, j]), 0.0), int(along[i]), int(along[j])

    def fans(self) -> tuple[IntArray, IntArray]:
        """Fan of each corner of each face, (m, 3), and the vertex of each fan, in order of the vertices."""
        paired = np.flatnonzero(self.partner > np.arange(len(self.partner)))
        here, there = np.concatenate([self._chained, np.column_stack([paired, self.partner[paired]])]).T
        start = self._faces.ravel()
        n_fans, fan = linked(len(start), *corner_links(here, there, start[here] == start[there]))
        vertex = np.zeros(n_fans, dtype=np.int64)
        vertex[fan] = start
        order = np.argsort(vertex, kind="stable")
        number = np.argsort(order)
        return number[fan].reshape(-1, 3), vertex[order]

    def heal(self) -> None:
        """Change partners along paths between the vertices of crowded edges that have only one fan."""
        usable = [edge for edge, (loss, _, _) in self.change.items() if loss <= LARGEST_LOSS]
        if not usable:
            return
        ends = np.array(usable)
        losses = np.array([self.change[edge][0] for edge in usable])
        nets = [_Net.of(ends[rows], losses[rows]) for rows in _connected(ends)]
        for _ in range(HEALING_ROUNDS):
            n_fans = np.bincount(self.fans()[1], minlength=self._n)
            changes = [edge for net in nets for edge in net.paths(n_fans)]
            if not changes:
                return
            for edge in changes:
                _, p, q = self.change[edge]
                self._exchange(p, q)

    def _exchange(self, p: int, q: int) -> None:
        of_p, of_q = self.partner[[p, q]]
        self.partner[[p, of_q, q, of_p]] = of_q, p, of_p, q


@dataclass(frozen=True)
class _Net:
    """Crowded edges that are connected: their vertices, and the matrix of what a change at each edge loses."""

    vertices: IntArray
    losses: csr_array

    @classmethod
    def of(cls, ends: IntArray, losses: FloatArray) -> _Net:
        vertices, local = np.unique(ends, return_inverse=True)
        shape = (len(vertices),) * 2
        return cls(vertices, coo_array((losses + 1e-3, tuple(local.reshape(-1, 2).T)), shape=shape).tocsr())

    def paths(self, n_fans: IntArray) -> Iterator[tuple[int, int]]:
        """Edges of the paths between vertices of one fan, the nearest two first; none where these are too many."""
        single = np.flatnonzero(n_fans[self.vertices] == 1)
        if not 2 <= len(single) <= MOST_SINGLE:
            return
        lengths, before = dijkstra(self.losses, directed=False, indices=single, return_predecessors=True)
        for i, j in _nearest_pairs(lengths[:, single]):
            for low, high in _path(before[i], int(single[j])):
                yield int(self.vertices[low]), int(self.vertices[high])


def _connected(ends: IntArray) -> list[IntArray]:
    """Rows of the edges of each connected net."""
    vertices, local = np.unique(ends, return_inverse=True)
    local = local.reshape(-1, 2)
    _, label = linked(len(vertices), (local[:, 0], local[:, 1]))
    return split_by(label[local[:, 0]])


def split_by(label: IntArray) -> list[IntArray]:
    """Return the indices of each label, in order."""
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(label) else []


def sides_of(edges: EdgeTable, faces: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """All sides, (3 m,), ordered by edge; the edge of each, and its direction: 1 from the smaller vertex, −1."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    edge = np.repeat(np.arange(len(edges.ends)), edges.n_faces)
    return edges.sides, edge, np.where(start < end, 1, -1)[edges.sides]


def _nearest_pairs(lengths: FloatArray) -> Iterator[tuple[int, int]]:
    """Pair rows of a symmetric matrix, the nearest two first; those without a path to another stay alone."""
    lengths[np.tril_indices(len(lengths))] = np.inf
    met: set[int] = set()
    for flat in lengths.argsort(axis=None, kind="stable"):
        i, j = divmod(int(flat), len(lengths))
        if lengths[i, j] == np.inf:
            return
        if i not in met and j not in met:
            met |= {i, j}
            yield i, j


def _path(before: IntArray, end: int) -> Iterator[tuple[int, int]]:
    """Edges of the path that leads to a vertex, given the vertex before each."""
    while (previous := int(before[end])) >= 0:
        yield min(previous, end), max(previous, end)
        end = previous
