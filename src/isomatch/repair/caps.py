"""Caps: every hole of a mesh closed by rings of new triangles that shrink to a point."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.surfaces import Mesh


def close_holes_at(mesh: Mesh, marked: BoolArray) -> tuple[Mesh, IntArray]:
    """Close the holes with at least half of their vertices marked (n,); return also the nearest old vertex."""
    closed = _close_rims(mesh, [rim for rim in boundary_loops(mesh) if marked[rim].mean() >= 0.5])
    all_vertices, n = np.arange(mesh.n_vertices), closed.n_vertices
    if n == mesh.n_vertices:
        return closed, all_vertices
    graph = coo_array((closed.edge_lengths, tuple(closed.edges.T)), shape=(n, n)).tocsr()
    sought = {"indices": all_vertices, "min_only": True, "return_predecessors": True}
    return closed, dijkstra(graph, directed=False, **sought)[2].astype(np.int64)


def close_holes(mesh: Mesh, chords: Iterable[IntArray] = ()) -> Mesh:
    """Close every hole of an oriented mesh by a cone over its rim, cut into rings as wide as edges are long.

    Paths across a cap are then about as long as on the surface that was there. The vertices and faces
    of the mesh come first, and caps have no more vertices than it. A chord (2,) joins two vertices of
    a rim by a straight line that splits the hole in two, such as a slit between limbs.
    O(n + new vertices).
    """
    vertices, n = [mesh.vertices], mesh.n_vertices
    rims = boundary_loops(mesh)
    for first, last in chords:
        if any(np.isin([first, last], rim).all() for rim in rims):
            points = _points_between(mesh, first, last)
            rims = [part for rim in rims for part in _split_rim(rim, first, last, n + np.arange(len(points)))]
            vertices.append(points)
            n += len(points)
    return _close_rims(Mesh(np.concatenate(vertices), mesh.faces), rims)


def _close_rims(mesh: Mesh, rims: list[IntArray]) -> Mesh:
    vertices, faces, n = [mesh.vertices], [mesh.faces], mesh.n_vertices
    # A cap has enough rings that each is about as wide as an edge is long.
    offsets = (mesh.vertices[rim] - mesh.vertices[rim].mean(axis=0) for rim in rims)
    radii = [np.linalg.norm(from_centre, axis=1).mean() for from_centre in offsets]
    wanted = [max(int(np.round(radius / mesh.edge_lengths.mean())) - 1, 0) for radius in radii]
    most = mesh.n_vertices / max(sum(len(rim) * count for rim, count in zip(rims, wanted)), 1)
    for rim, count in zip(rims, wanted):
        corners = mesh.vertices[rim]
        centre = corners.mean(axis=0)
        n_rings = int(count * min(most, 1.0))
        ring = rim
        for share in np.arange(1, n_rings + 1) / (n_rings + 1):
            inner = n + np.arange(len(rim))
            vertices.append(corners + share * (centre - corners))
            following, inner_following = np.roll(ring, -1), np.roll(inner, -1)
            faces.append(np.column_stack([following, ring, inner]))
            faces.append(np.column_stack([following, inner, inner_following]))
            ring, n = inner, n + len(rim)
        vertices.append(centre[None])
        faces.append(np.column_stack([np.roll(ring, -1), ring, np.full(len(rim), n)]))
        n += 1
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def _points_between(mesh: Mesh, first: int, last: int) -> FloatArray:
    """Place points (q, 3) on the line between two vertices, one edge length apart."""
    ends = mesh.vertices[[first, last]]
    count = int(np.linalg.norm(ends[1] - ends[0]) / mesh.edge_lengths.mean())
    share = np.arange(1, count + 1)[:, None] / (count + 1)
    return np.asarray((1 - share) * ends[0] + share * ends[1])


def _split_rim(rim: IntArray, first: int, last: int, between: IntArray) -> list[IntArray]:
    """Split a rim along a line of vertices between two of its vertices; without both it stays whole."""
    if not np.isin([first, last], rim).all():
        return [rim]
    from_first = np.roll(rim, -int(np.flatnonzero(rim == first)[0]))
    position = int(np.flatnonzero(from_first == last)[0])
    forward = np.concatenate([from_first[: position + 1], between[::-1]])
    backward = np.concatenate([from_first[position:], [first], between])
    return [part for part in (forward, backward) if len(part) > 2]


def boundary_loops(mesh: Mesh) -> list[IntArray]:
    """List the vertices along each boundary loop, in the direction of the faces, none twice in a loop."""
    faces = mesh.sound_faces
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = np.sort(mesh.boundary_edges, axis=1)
    keys = sides.min(axis=1) * mesh.n_vertices + sides.max(axis=1)
    open_sides = sides[np.isin(keys, ends[:, 0] * mesh.n_vertices + ends[:, 1])]
    onward: dict[int, list[int]] = {}
    for start, end in sorted(map(tuple, open_sides.tolist()), reverse=True):
        onward.setdefault(start, []).append(end)
    loops = []
    for first in sorted(onward):
        path, place = [first], {first: 0}
        while onward.get(path[-1]):
            following = onward[path[-1]].pop()
            if following in place:
                loop = path[place[following] :]
                if len(loop) > 2:
                    loops.append(np.array(loop))
                for vertex in loop[1:]:
                    del place[vertex]
                del path[place[following] + 1 :]
            else:
                place[following] = len(path)
                path.append(following)
    return loops
