"""The edges of a list of triangles and the faces that meet at them, as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray, read_only
from isomatch._core.compiled import compiled
from isomatch.surfaces._faces import sort_lists


@dataclass(frozen=True)
class EdgeTable:
    """The e edges of m faces. Side 3 f + i of face f goes from its corner i to its corner i + 1."""

    ends: IntArray  # (e, 2) vertices of each edge, the smaller first, in lexicographic order
    n_faces: AnyArray  # (e,) how many faces meet at the edge
    sides: AnyArray  # (3 m,) all sides, sorted by edge, then by number
    opposite: AnyArray  # (3 m,) the other side at the edge of each side, −1 where not exactly two faces meet
    # (e,) whether exactly two faces meet at the edge, with sides of one direction: wound inconsistently
    clash: BoolArray


@dataclass(frozen=True)
class Meetings:
    """The k pairs of faces that meet at edges; the r sides of an edge form a chain of r - 1 pairs."""

    sides: IntArray  # (k, 2) two sides on the same edge
    edge: IntArray  # (k,) number of the edge
    is_pair: BoolArray  # (k,) whether exactly two faces meet at the edge
    same_direction: BoolArray  # (k,) whether the two sides have one direction: wound inconsistently


def edge_table(faces: IntArray, n_vertices: int) -> EdgeTable:
    """Group the sides of faces with valid indices into edges: O(n + m) time, O(k^1.5) for k at one vertex."""
    faces = read_only(faces)
    start, keys = np.zeros(n_vertices + 2, dtype=np.int64), np.empty(faces.size, dtype=np.int64)
    sides, opposite = np.empty(faces.size, dtype=np.int32), np.empty(faces.size, dtype=np.int32)
    _list_sides(faces, start, keys, sides)
    sort_lists(start, keys, sides)
    is_first = np.ones(faces.size + 1, dtype=bool)  # whether each side is the first at its edge
    np.not_equal(keys[1:], keys[:-1], out=is_first[1:-1])
    is_first[start[:-2]] = True
    n_edges = int(np.count_nonzero(is_first[:-1]))
    ends, n_faces = np.empty((n_edges, 2), dtype=np.int64), np.zeros(n_edges, dtype=np.int32)
    clash = np.zeros(n_edges, dtype=bool)
    _group_sides(faces, start, keys, sides, is_first, ends, n_faces, opposite, clash)
    return EdgeTable(ends, n_faces, sides, opposite, clash)


@compiled()
def _list_sides(faces: IntArray, start: IntArray, keys: IntArray, sides: AnyArray) -> None:
    """List the sides by their smaller vertex; the key of each is its other vertex."""
    for f in range(len(faces)):
        b = faces[f, 2]
        for i in range(3):
            a, b = b, faces[f, i]
            start[min(a, b) + 2] += 1
    for v in range(len(start) - 2):
        start[v + 2] += start[v + 1]
    for f in range(len(faces)):
        a = faces[f, 0]
        for i in range(3):
            b = faces[f, i + 1 if i < 2 else 0]
            row = start[min(a, b) + 1]
            keys[row], sides[row] = max(a, b), 3 * f + i
            start[min(a, b) + 1] = row + 1
            a = b


@compiled()
def _group_sides(
    faces: IntArray,
    start: IntArray,
    keys: IntArray,
    sides: AnyArray,
    is_first: BoolArray,
    ends: IntArray,
    n_faces: AnyArray,
    opposite: AnyArray,
    clash: BoolArray,
) -> None:
    """Fill the table of edges from the sorted sides."""
    edge = -1
    for v in range(len(start) - 2):
        for row in range(start[v], start[v + 1]):
            if is_first[row]:
                edge += 1
                ends[edge, 0] = v
                ends[edge, 1] = keys[row]
            n_faces[edge] += 1
            side = sides[row]
            opposite[side] = -1
            if n_faces[edge] == 2:
                other = sides[row - 1]
                opposite[side] = other
                opposite[other] = side
                clash[edge] = faces[side // 3, side % 3] == faces[other // 3, other % 3]
            elif n_faces[edge] == 3:
                opposite[sides[row - 1]] = opposite[sides[row - 2]] = -1
                clash[edge] = False


def lengths(points: FloatArray, ends: IntArray) -> FloatArray:
    """Lengths of edges (e, 2) between points (n, 3)."""
    with np.errstate(over="ignore"):  # a length beyond the largest float becomes infinite
        x, y, z = (points[ends[:, 0]] - points[ends[:, 1]]).T
        return np.asarray(np.hypot(np.hypot(x, y), z))  # squares would overflow or underflow


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
    is_root = label == np.arange(n_nodes)
    while not np.array_equal(root := label[label], label):
        label = root
    return int(np.count_nonzero(is_root)), (np.cumsum(is_root) - 1)[label]


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


@compiled(inline="always")
def find_root(parent: IntArray, i: int) -> int:
    """Find the root of the tree of a node, and shorten the path to it."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@compiled(inline="always")
def join_trees(parent: IntArray, i: int, j: int) -> bool:
    """Join the trees of two nodes; the root is the smallest node. False if they were one tree."""
    i, j = find_root(parent, i), find_root(parent, j)
    if i < j:
        parent[j] = i
    else:
        parent[i] = j
    return i != j


def count_fans(faces: IntArray, edges: EdgeTable, n_vertices: int) -> IntArray:
    """Count the fans of faces around each vertex, (n,): 1 on a manifold, 0 for a vertex without faces.

    Two corners at a vertex are in the same fan if their faces share an edge of that vertex.
    """
    count = np.zeros(n_vertices, dtype=np.int64)
    if (edges.n_faces <= 2).all():
        _count_fans(read_only(faces), edges.opposite, np.zeros(faces.size, dtype=bool), count)
        return count
    met = meetings(edges, faces)
    links = corner_links(met.sides[:, 0], met.sides[:, 1], met.same_direction)
    n_fans, labels = label_components(faces.size, *links)
    vertex_of_fan = np.zeros(n_fans, dtype=np.int64)
    vertex_of_fan[labels] = faces.ravel()
    return np.bincount(vertex_of_fan, minlength=n_vertices)


@compiled()
def _count_fans(faces: IntArray, opposite: AnyArray, seen: BoolArray, count: IntArray) -> None:
    """Walk around each vertex, both ways from a corner, from face to face across common sides."""
    # ``at_start`` tells at which end of the side the vertex is, since opposite sides have the same direction
    # where faces are wound inconsistently.
    for corner in range(faces.size):
        if seen[corner]:
            continue
        seen[corner] = True
        count[faces[corner // 3, corner % 3]] += 1
        for way in range(2):
            at_start = way == 0
            side = corner if at_start else _before(corner)
            while opposite[side] >= 0:
                next_side = opposite[side]
                at_start ^= faces[next_side // 3, next_side % 3] != faces[side // 3, side % 3]
                next_corner = next_side if at_start else _after(next_side)
                if seen[next_corner]:
                    break
                seen[next_corner] = True
                side, at_start = _before(next_corner) if at_start else next_corner, not at_start


@compiled(inline="always")
def _after(corner: int) -> int:
    return corner - 2 if corner % 3 == 2 else corner + 1


@compiled(inline="always")
def _before(corner: int) -> int:
    return corner + 2 if corner % 3 == 0 else corner - 1


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
