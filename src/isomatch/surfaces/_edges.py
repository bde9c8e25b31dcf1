"""The edges of a list of triangles and the faces that meet at them, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from isomatch._arrays import BoolArray, IntArray


@dataclass(frozen=True)
class EdgeTable:
    """The edges of m sound faces. Side 3 f + i of face f goes from its corner i to its corner i + 1.

    Parameters
    ----------
    ends : (e, 2) array of int
        Vertices of each edge, the smaller index first, in lexicographic order.
    n_faces : (e,) array of int
        Number of faces that meet at each edge.
    meetings : (k, 2) array of int
        Pairs of sides on the same edge. The r sides of an edge form a chain of r - 1 pairs.
    edge_of_meeting : (k,) array of int
        The edge of each pair.
    same_direction : (k,) array of bool
        Whether the two sides have the same direction, so that their faces are wound inconsistently.
    """

    ends: IntArray
    n_faces: IntArray
    meetings: IntArray
    edge_of_meeting: IntArray
    same_direction: BoolArray

    @property
    def is_pair(self) -> BoolArray:
        """(k,) which meetings are at an edge of exactly two faces."""
        pair: BoolArray = self.n_faces[self.edge_of_meeting] == 2
        return pair


def edge_table(faces: IntArray, n_vertices: int) -> EdgeTable:
    """Group the sides of sound faces into edges, in O(m log m) time."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    keys = np.minimum(start, end) * n_vertices + np.maximum(start, end)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    is_new = np.ones(len(keys), dtype=bool)
    is_new[1:] = keys[1:] != keys[:-1]
    first = np.flatnonzero(is_new)
    met = np.flatnonzero(~is_new)
    meetings = np.column_stack([order[met - 1], order[met]])
    return EdgeTable(
        ends=np.column_stack(np.divmod(keys[first], max(n_vertices, 1))),
        n_faces=np.diff(first, append=len(keys)),
        meetings=meetings,
        edge_of_meeting=(np.cumsum(is_new) - 1)[met],
        same_direction=start[meetings[:, 0]] == start[meetings[:, 1]],
    )


def linked(pairs: IntArray, n_nodes: int) -> tuple[int, IntArray]:
    """Count the connected components of a graph given by (k, 2) pairs, and label its nodes, (n_nodes,)."""
    if not n_nodes:
        return 0, np.zeros(0, dtype=np.int64)
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), tuple(pairs.T)), shape=(n_nodes, n_nodes))
    count, labels = connected_components(graph, directed=False)
    return int(count), labels.astype(np.int64)


def fans(faces: IntArray, edges: EdgeTable, n_vertices: int) -> IntArray:
    """Count the fans of faces around each vertex, (n,): 1 on a manifold, 0 for a vertex without faces.

    Two corners at a vertex are in the same fan if their faces share an edge of that vertex.
    """
    here, there = edges.meetings.T
    same = edges.same_direction
    # Corner 3 f + i is the start of side 3 f + i and the end of the side before it.
    links = np.concatenate(
        [
            np.column_stack([here, np.where(same, there, _next_corner(there))]),
            np.column_stack([_next_corner(here), np.where(same, _next_corner(there), there)]),
        ]
    )
    count, labels = linked(links, faces.size)
    vertex_of_fan = np.zeros(count, dtype=np.int64)
    vertex_of_fan[labels] = faces.ravel()
    return np.bincount(vertex_of_fan, minlength=n_vertices)


def _next_corner(corners: IntArray) -> IntArray:
    following: IntArray = corners - corners % 3 + (corners % 3 + 1) % 3
    return following
