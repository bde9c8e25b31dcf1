"""The edges of a list of triangles and the faces that meet at them, as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled


@dataclass(frozen=True)
class EdgeTable:
    """The e edges of m faces. Side 3 f + i of face f goes from its corner i to its corner i + 1."""

    ends: IntArray  # (e, 2) vertices of each edge, the smaller first, in lexicographic order
    n_faces: AnyArray  # (e,) how many faces meet there
    sides: AnyArray  # (3 m,) all sides, sorted by edge, then by number
    opposite: AnyArray  # (3 m,) the other side at the edge of each side, −1 where not exactly two faces meet
    clash: BoolArray  # (e,) whether the only two sides have one direction: inconsistent winding


@dataclass(frozen=True)
class Meetings:
    """The k pairs of faces that meet at edges; the r sides of an edge form a chain of r - 1 pairs."""

    sides: IntArray  # (k, 2) the sides of both faces at the edge
    edge: IntArray  # (k,) the edge at which they meet
    is_pair: BoolArray  # (k,) whether exactly two faces meet at the edge
    same_direction: BoolArray  # (k,) whether both sides have one direction, as in `EdgeTable.clash`


def edge_table(faces: IntArray, n_vertices: int) -> EdgeTable:
    """Group the sides of faces with valid indices into edges: O(m log m) time."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys = np.minimum(start, end) * n_vertices + np.maximum(start, end)
    sides = np.argsort(keys, kind="stable").astype(np.int32)
    keys = keys[sides]
    is_new = np.append(True, keys[1:] != keys[:-1])[: len(keys)]
    first = np.flatnonzero(is_new)
    n_faces = np.diff(first, append=len(keys)).astype(np.int32)
    pairs = first[n_faces == 2]
    one, other = sides[pairs], sides[pairs + 1]
    opposite = np.full(len(keys), -1, dtype=np.int32)
    opposite[one], opposite[other] = other, one
    clash = np.zeros(len(first), dtype=bool)
    clash[n_faces == 2] = start[one] == start[other]
    ends = np.column_stack(np.divmod(keys[first], max(n_vertices, 1)))
    return EdgeTable(ends, n_faces, sides, opposite, clash)


def lengths(points: FloatArray, ends: IntArray) -> FloatArray:
    """Lengths of edges (e, 2) between points (n, 3)."""
    x, y, z = (points[ends[:, 0]] - points[ends[:, 1]]).T
    return np.asarray(np.hypot(np.hypot(x, y), z))  # unlike squares, hypot does not overflow or underflow


def meetings(edges: EdgeTable, faces: IntArray) -> Meetings:
    """List the pairs of faces that meet at edges."""
    edge = np.repeat(np.arange(len(edges.ends)), edges.n_faces - 1)
    is_second = np.ones(len(edges.sides), dtype=bool)
    is_second[np.cumsum(edges.n_faces) - edges.n_faces] = False
    second = np.flatnonzero(is_second)
    sides = np.column_stack([edges.sides[second - 1], edges.sides[second]]).astype(np.int64)
    start = faces.ravel()
    return Meetings(sides, edge, edges.n_faces[edge] == 2, start[sides[:, 0]] == start[sides[:, 1]])


def label_components(n_nodes: int, *pairs: tuple[IntArray, IntArray]) -> tuple[int, IntArray]:
    """Count the connected components of a graph with links between pairs of nodes; label the nodes.

    Labels (n_nodes,) are in the order of the first node of each component.
    """
    label = np.arange(n_nodes)
    for start, end in pairs:
        _join_links(label, np.ascontiguousarray(start), np.ascontiguousarray(end))
    return _number_trees(label), label


def connected_regions(
    edges: IntArray, inside: BoolArray, areas: FloatArray
) -> Iterator[tuple[IntArray, float]]:
    """Find the regions (m,) of vertices inside that edges connect, with the area of each, the largest first."""
    i, j = edges[inside[edges].all(axis=1)].T
    n, label = label_components(len(inside), (i, j))
    sums = np.bincount(label, inside * areas, n)
    for region in np.argsort(-sums, kind="stable"):
        yield np.flatnonzero((label == region) & inside), float(sums[region])


@compiled()
def _join_links(parent: IntArray, start: IntArray, end: IntArray) -> None:
    """Join the trees of the nodes of each link."""
    for k in range(len(start)):
        join_trees(parent, start[k], end[k])


@compiled()
def find_root(parent: IntArray, i: int) -> int:
    """Find the root of the tree of a node, and shorten the path to it."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@compiled()
def join_trees(parent: IntArray, i: int, j: int) -> bool:
    """Join the trees of two nodes; the root is the smallest node. False if they were one tree."""
    i, j = find_root(parent, i), find_root(parent, j)
    if i < j:
        parent[j] = i
    else:
        parent[i] = j
    return i != j


@compiled()
def _number_trees(parent: IntArray) -> int:
    """Replace each node by the number of its tree, and count the trees; a parent comes before its children."""
    count = 0
    for i in range(len(parent)):
        if parent[i] == i:
            parent[i] = count
            count += 1
        else:
            parent[i] = parent[parent[i]]
    return count


def count_fans(faces: IntArray, edges: EdgeTable, n_vertices: int) -> IntArray:
    """Count the fans of faces around each vertex, (n,): 1 on a manifold, 0 for a vertex without faces.

    Two corners at a vertex are in the same fan if their faces share an edge of that vertex.
    """
    met = meetings(edges, faces)
    links = corner_links(met.sides[:, 0], met.sides[:, 1], met.same_direction)
    n_fans, labels = label_components(faces.size, *links)
    vertex_of_fan = np.zeros(n_fans, dtype=np.int64)
    vertex_of_fan[labels] = faces.ravel()
    return np.bincount(vertex_of_fan, minlength=n_vertices)


def corner_links(
    side: IntArray, other_side: IntArray, same_direction: BoolArray
) -> tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]:
    """Link the corners of faces that share an edge, given the sides that meet: pairs at both ends.

    Corner 3 f + i is the start of side 3 f + i and the end of the side before it.
    """
    after_side, after_other = (side + np.where(side % 3 == 2, -2, 1) for side in (side, other_side))
    return (
        (side, np.where(same_direction, other_side, after_other)),
        (after_side, np.where(same_direction, after_other, other_side)),
    )
