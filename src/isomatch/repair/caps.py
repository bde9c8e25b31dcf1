"""Caps: every hole of a mesh closed by rings of new triangles that shrink to a point."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.surfaces import Mesh


def capped_at(mesh: Mesh, at: BoolArray) -> tuple[Mesh, IntArray]:
    """Close the holes around which half of the vertices are marked (n,); returns also the old vertex nearest to each."""
    closed = _closed(mesh, [rim for rim in boundary_loops(mesh) if at[rim].mean() >= 0.5])
    everything, n = np.arange(mesh.n_vertices), closed.n_vertices
    if n == mesh.n_vertices:
        return closed, everything
    graph = coo_array((closed.edge_lengths, tuple(closed.edges.T)), shape=(n, n)).tocsr()
    nearest = dijkstra(graph, directed=False, indices=everything, min_only=True, return_predecessors=True)[2]
    return closed, nearest.astype(np.int64)


def capped(mesh: Mesh, chords: Iterable[IntArray] = ()) -> Mesh:
    """Close every hole of an oriented mesh by a cone over its rim, cut into rings as wide as edges are long.

    Paths across a cap are then about as long as on the surface that was there. The first n vertices and the first faces
    are those of the mesh, and caps have no more vertices than it. A chord (2,) of vertices of a rim parts its hole in
    two by a straight line: as of a slit between limbs, both sides of which are closed by themselves. O(n + new
    vertices).
    """
    vertices, n = [mesh.vertices], mesh.n_vertices
    rims = boundary_loops(mesh)
    for first, last in chords:
        if any(np.isin([first, last], rim).all() for rim in rims):
            points = _between(mesh, first, last)
            rims = [part for rim in rims for part in _parted(rim, first, last, n + np.arange(len(points)))]
            vertices.append(points)
            n += len(points)
    return _closed(Mesh(np.concatenate(vertices), mesh.faces), rims)


def _closed(mesh: Mesh, rims: list[IntArray]) -> Mesh:
    vertices, faces, n = [mesh.vertices], [mesh.faces], mesh.n_vertices
    wanted = [_n_rings(mesh, rim) for rim in rims]
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


def _between(mesh: Mesh, first: int, last: int) -> FloatArray:
    """Points (q, 3) on the straight line between two vertices, as far apart as edges are long."""
    ends = mesh.vertices[[first, last]]
    count = int(np.linalg.norm(ends[1] - ends[0]) / mesh.edge_lengths.mean())
    share = np.arange(1, count + 1)[:, None] / (count + 1)
    return np.asarray((1 - share) * ends[0] + share * ends[1])


def _parted(rim: IntArray, first: int, last: int, between: IntArray) -> list[IntArray]:
    """Part a rim in two by a line of vertices from one of its vertices to another; if it has not both, it stays."""
    if not np.isin([first, last], rim).all():
        return [rim]
    from_first = np.roll(rim, -int(np.flatnonzero(rim == first)[0]))
    at = int(np.flatnonzero(from_first == last)[0])
    one = np.concatenate([from_first[: at + 1], between[::-1]])
    other = np.concatenate([from_first[at:], [first], between])
    return [part for part in (one, other) if len(part) > 2]


def _n_rings(mesh: Mesh, rim: IntArray) -> int:
    """Rings of a cap that are as wide as edges are long."""
    corners = mesh.vertices[rim]
    radius = np.linalg.norm(corners - corners.mean(axis=0), axis=1).mean()
    return max(int(np.round(radius / mesh.edge_lengths.mean())) - 1, 0)


def boundary_loops(mesh: Mesh) -> list[IntArray]:
    """Vertices along each loop of the boundary, in the direction of the faces; no loop passes a vertex twice."""
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
