"""The edges of a list of triangles and the faces that meet at them, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from isomatch.loading.compiled import compiled
from isomatch.values.arrays import AnyArray, BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class EdgeTable:
    """The edges of m faces. Side 3 f + i of face f goes from its corner i to its corner i + 1.

    Parameters
    ----------
    ends : (e, 2) array of int
        Vertices of each edge, the smaller index first, in lexicographic order.
    n_faces : (e,) array of int
        Number of faces that meet at each edge.
    sides : (3 m,) array of int
        The sides of all edges, edge after edge; those of an edge in ascending order.
    """

    ends: IntArray
    n_faces: IntArray
    sides: AnyArray


@dataclass(frozen=True)
class Meetings:
    """Pairs of faces that meet at an edge. The r sides of an edge form a chain of r - 1 pairs.

    Parameters
    ----------
    sides : (k, 2) array of int
        Sides on the same edge.
    edge : (k,) array of int
        The edge of each pair.
    is_pair : (k,) array of bool
        Which are at an edge of exactly two faces.
    same_direction : (k,) array of bool
        Whether the two sides have the same direction, so that their faces are wound inconsistently.
    """

    sides: IntArray
    edge: IntArray
    is_pair: BoolArray
    same_direction: BoolArray


def edge_table(faces: IntArray, n_vertices: int) -> EdgeTable:
    """Group the sides of faces with valid indices into edges, in O(n + m) time."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = _stable_order(high, n_vertices)
    order = order[_stable_order(low[order], n_vertices)]
    low, high = low[order], high[order]
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    first = np.flatnonzero(is_new)
    return EdgeTable(np.column_stack([low[first], high[first]]), np.diff(first, append=len(order)), order)


def _stable_order(keys: IntArray, n_keys: int) -> AnyArray:
    """Order keys 0…n_keys - 1, stably: a counting sort, which is what the transposition of a sparse matrix does."""
    ones, start = np.ones(len(keys), dtype=np.int8), np.arange(len(keys) + 1)
    one_a_row = scipy.sparse.csr_array((ones, keys, start), shape=(len(keys), n_keys))
    order: AnyArray = one_a_row.tocsc().indices
    return order


def lengths(points: FloatArray, ends: IntArray) -> FloatArray:
    """Lengths of edges (e, 2) between points (n, 3)."""
    x, y, z = (points[ends[:, 0]] - points[ends[:, 1]]).T
    return np.asarray(np.hypot(np.hypot(x, y), z))  # unlike squares, hypot does not overflow or underflow


def meetings(edges: EdgeTable, faces: IntArray) -> Meetings:
    """List the pairs of faces that meet at edges."""
    edge = np.repeat(np.arange(len(edges.ends)), edges.n_faces - 1)
    there = np.ones(len(edges.sides), dtype=bool)
    there[np.cumsum(edges.n_faces) - edges.n_faces] = False
    second = np.flatnonzero(there)
    sides = np.column_stack([edges.sides[second - 1], edges.sides[second]]).astype(np.int64)
    start = faces.ravel()
    return Meetings(sides, edge, edges.n_faces[edge] == 2, start[sides[:, 0]] == start[sides[:, 1]])


def linked(n_nodes: int, *pairs: tuple[IntArray, IntArray]) -> tuple[int, IntArray]:
    """Count the connected components of a graph, given the two nodes of each link, and label its nodes, (n_nodes,).

    Labels are in order of the first node of each component.
    """
    label = np.arange(n_nodes)
    for here, there in pairs:
        _join_all(label, np.ascontiguousarray(here), np.ascontiguousarray(there))
    return _number(label), label


@compiled()
def _join_all(parent: IntArray, here: IntArray, there: IntArray) -> None:
    """Join the trees of the nodes of each link."""
    for k in range(len(here)):
        joined(parent, here[k], there[k])


@compiled()
def joined(parent: IntArray, i: int, j: int) -> bool:
    """Join the trees of two nodes, whose roots are their smallest nodes; False if they were one."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    while parent[j] != j:
        parent[j] = parent[parent[j]]
        j = parent[j]
    if i < j:
        parent[j] = i
    else:
        parent[i] = j
    return i != j


@compiled()
def _number(parent: IntArray) -> int:
    """Replace each node by the number of its tree, and count the trees; a parent comes before its children."""
    count = 0
    for i in range(len(parent)):
        if parent[i] == i:
            parent[i] = count
            count += 1
        else:
            parent[i] = parent[parent[i]]
    return count


def fans(faces: IntArray, met: Meetings, n_vertices: int) -> IntArray:
    """Count the fans of faces around each vertex, (n,): 1 on a manifold, 0 for a vertex without faces.

    Two corners at a vertex are in the same fan if their faces share an edge of that vertex.
    """
    count, labels = linked(faces.size, *corner_links(met.sides[:, 0], met.sides[:, 1], met.same_direction))
    vertex_of_fan = np.zeros(count, dtype=np.int64)
    vertex_of_fan[labels] = faces.ravel()
    return np.bincount(vertex_of_fan, minlength=n_vertices)


def corner_links(
    here: IntArray, there: IntArray, same_direction: BoolArray
) -> tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]:
    """Corners at the same vertex of faces that share an edge, given the sides that meet: pairs at both of its ends.

    Corner 3 f + i is the start of side 3 f + i and the end of the side before it.
    """
    after_here, after_there = _next_corner(here), _next_corner(there)
    return (
        (here, np.where(same_direction, there, after_there)),
        (after_here, np.where(same_direction, after_there, there)),
    )


def _next_corner(corners: IntArray) -> IntArray:
    following: IntArray = corners + np.where(corners % 3 == 2, -2, 1)
    return following
