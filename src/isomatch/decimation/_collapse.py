"""Compiled loops of the decimation: quadrics of vertices, costs of edges and their collapse.

Three arrays hold the state, so that the data of a vertex lies together in memory.

- ``vertices`` (n, 13): position, and the quadric xᵀ A x + 2 bᵀ x + c: the upper triangle of A, b and c.
- ``marks`` (n, 5) of int32: the columns FIRST, KIND, VERSION, MARK, PARENT.
- ``corners`` (3 m, 2) of int32: corner 3 f + k, place k of face f, has a vertex, −1 in a face that has
  vanished, and the next corner in the list at this vertex, which starts at FIRST and ends at −1.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.compiled import compiled

Index: TypeAlias = int | np.int64

FIRST, KIND, VERSION, MARK, PARENT = range(
    5
)  # columns of ``marks``, which has a row of integers for each vertex
INSIDE, BOUNDARY, FIXED = range(3)  # kinds of vertices; a vertex of a higher kind is less free to move
# weight of the plane through a boundary edge, over the edge's squared length, where the weight of the plane of a
# face is the face's area; chosen
BOUNDARY_WEIGHT = 1.0
MIN_TURN_COSINE = 0.2  # least cosine of the angle by which a collapse turns the normal of a face; chosen
# No collapse lowers the quality of a face, 4 √3 area / (sum of squared edges), below this and below half its
# value before; chosen.
SLIVER_SHAPE = 0.2
N_BUCKETS = 128  # number of buckets by which the queue sorts edges by cost; 1024 give no better result


@compiled(error_model="numpy")
def link_corners(marks: AnyArray, corners: AnyArray) -> None:
    """Make the lists of the corners at each vertex, in their order."""
    for v in range(len(marks)):
        marks[v, FIRST] = -1
    for corner in range(len(corners) - 1, -1, -1):
        v = corners[corner, 0]
        corners[corner, 1] = marks[v, FIRST]
        marks[v, FIRST] = corner


@compiled()
def remove_gaps(vertices: FloatArray, marks: AnyArray, corners: AnyArray, owner: AnyArray) -> int:
    """Move the remaining vertices and corners to the front, count the corners, and update the owners."""
    n_left = 0
    for v in range(len(vertices)):
        if marks[v, PARENT] == v:
            for i in range(vertices.shape[1]):
                vertices[n_left, i] = vertices[v, i]
            marks[n_left, KIND] = marks[v, KIND]
            marks[v, VERSION] = n_left
            n_left += 1
        else:
            marks[v, VERSION] = marks[marks[v, PARENT], VERSION]
    for v in range(len(owner)):
        owner[v] = marks[owner[v], VERSION]
    n_corners = 0
    for corner in range(len(corners)):
        if corners[corner, 0] >= 0:
            corners[n_corners, 0] = marks[corners[corner, 0], VERSION]
            n_corners += 1
    return n_corners


@compiled(error_model="numpy")
def describe_vertices(
    vertices: FloatArray, marks: AnyArray, corners: AnyArray, link: AnyArray, point_weight: float
) -> None:
    """Set the kind and the quadric, 0 before, of each vertex; ``link`` (n, 2) is working space."""
    for v in range(len(vertices)):
        kind = marks[v, KIND] = _kind(v, marks, corners, link)
        corner = marks[v, FIRST]
        while corner >= 0:
            b, c = other_vertices(corners, corner)
            px, py, pz = difference(vertices, b, v)
            qx, qy, qz = difference(vertices, c, v)
            x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                x, y, z = x / length, y / length, z / length
                # Each corner has a third of the face's area, which is half the length of the cross product.
                _add_planes(vertices, v, x, y, z, length / 6.0, point_weight * length / 6.0)
                for end in (b, c):
                    if kind == BOUNDARY and link[end, 1] < 0:
                        # The plane through that boundary edge and perpendicular to the face has the normal e
                        # × n, as long as the edge, so that the weight is a third of the square on the edge.
                        ex, ey, ez = difference(vertices, end, v)
                        weight = BOUNDARY_WEIGHT / 3.0
                        _add_planes(
                            vertices, v, ey * z - ez * y, ez * x - ex * z, ex * y - ey * x, weight, 0.0
                        )
            corner = corners[corner, 1]


@compiled(error_model="numpy")
def _kind(v: Index, marks: AnyArray, corners: AnyArray, link: AnyArray) -> int:
    """Kind of vertex v, by whether its faces form a disc; ``link`` joins its neighbours in each face."""
    corner = marks[v, FIRST]
    while corner >= 0:
        for end in other_vertices(corners, corner):
            link[end, 0] = link[end, 1] = -1
        corner = corners[corner, 1]
    n_faces, n_ends, start = 0, 0, np.int64(-1)
    corner = marks[v, FIRST]
    while corner >= 0:
        b, c = other_vertices(corners, corner)
        if link[b, 1] >= 0 or link[c, 1] >= 0:
            return FIXED  # more than two faces meet at an edge of the vertex
        link[b, int(link[b, 0] >= 0)] = c
        link[c, int(link[c, 0] >= 0)] = b
        n_faces, start = n_faces + 1, b
        corner = corners[corner, 1]
    corner = marks[v, FIRST]
    while corner >= 0:
        for end in other_vertices(corners, corner):
            if link[end, 1] < 0:
                n_ends, start = n_ends + 1, end
        corner = corners[corner, 1]
    if n_ends > 2 or n_faces == 0:
        return FIXED
    previous, current = np.int64(-1), start
    for _ in range(n_faces):
        if current < 0 or (current == start and previous >= 0):
            return FIXED  # several fans meet at the vertex
        previous, current = current, np.int64(link[current, int(link[current, 0] == previous)])
    return BOUNDARY if n_ends == 2 else INSIDE


@compiled(error_model="numpy")
def costs_of_edges(vertices: FloatArray, marks: AnyArray, ends: IntArray, in_place: bool) -> FloatArray:
    """Costs of edges (k, 2); infinite if an edge cannot be collapsed."""
    costs = np.empty(len(ends))
    for i in range(len(ends)):
        costs[i] = _placement(vertices, marks, ends[i, 0], ends[i, 1], in_place)[3]
    return costs


@compiled(error_model="numpy")
def collapse_edges(
    vertices: FloatArray,
    marks: AnyArray,
    corners: AnyArray,
    queue: AnyArray,
    scale: float,
    limit: float,
    max_per_block: int,
    block: int,
    in_place: bool,
) -> int:
    """Collapse edges of a cost below the limit, cheapest first, at most ``max_per_block`` in each block."""
    # With several blocks, the working set fits into the cache, and a vertex takes part in one collapse of
    # each block. PARENT of a vertex becomes the vertex into which it was merged, the first of all vertices
    # that were merged into one. A row of the queue is an edge: the next edge in the same bucket, its ends,
    # and the sum of their VERSIONs, which tells that an edge is out of date. The first N_BUCKETS rows start
    # the buckets; the middle bucket has the cost ``scale``. The row after them starts the list of free rows,
    # and holds the number of rows in use and the lowest bucket in use.
    n = len(vertices)
    for w in range(n):
        marks[w, VERSION] = marks[w, MARK] = 0
        marks[w, PARENT] = w
    turn, n_collapsed = 0, 0
    for first in range(0, n, block):
        for i in range(N_BUCKETS + 1):
            queue[i, 0] = -1
        queue[N_BUCKETS, 1] = N_BUCKETS + 1
        for w in range(min(first + block, n) - 1, first - 1, -1):
            if marks[w, PARENT] == w:
                turn += 1
                _enqueue(w, w, vertices, marks, corners, queue, turn, scale, limit, in_place)
        bucket, block_limit = 0, n_collapsed + max_per_block
        while n_collapsed < block_limit:
            while bucket < N_BUCKETS and queue[bucket, 0] < 0:
                bucket += 1
            if bucket == N_BUCKETS:
                break
            edge = queue[bucket, 0]
            queue[bucket, 0] = queue[edge, 0]
            queue[edge, 0] = queue[N_BUCKETS, 0]
            queue[N_BUCKETS, 0] = edge
            u, v = np.int64(queue[edge, 1]), np.int64(queue[edge, 2])
            if (
                marks[u, PARENT] != u
                or marks[v, PARENT] != v
                or queue[edge, 3] != marks[u, VERSION] + marks[v, VERSION]
            ):
                continue
            turn += 2
            if not _preserves_topology(u, v, marks, corners, turn):
                continue
            x, y, z, _ = _placement(vertices, marks, u, v, in_place)
            if _spoils_face(u, v, x, y, z, vertices, marks, corners) or _spoils_face(
                v, u, x, y, z, vertices, marks, corners
            ):
                continue
            # The quadric of the merged vertex is the sum of both, so that it measures the squared distances
            # to the planes of all faces around the vertices that were merged into it (Garland & Heckbert
            # 1997, section 4).
            vertices[u, 0], vertices[u, 1], vertices[u, 2] = x, y, z
            for i in range(3, 13):
                vertices[u, i] += vertices[v, i]
            marks[u, KIND] = max(marks[u, KIND], marks[v, KIND])
            marks[u, VERSION] += 1
            marks[v, PARENT] = u
            n_collapsed += 1
            _merge_corners(u, v, marks, corners)
            turn += 2
            if block == n:
                queue[N_BUCKETS, 2] = bucket
                _enqueue(u, n, vertices, marks, corners, queue, turn, scale, limit, in_place)
                bucket = queue[N_BUCKETS, 2]
    for w in range(n):
        marks[w, PARENT] = marks[marks[w, PARENT], PARENT]  # the parent of w comes before w
    return n_collapsed


@compiled(error_model="numpy")
def _enqueue(
    v: Index,
    end: int,
    vertices: FloatArray,
    marks: AnyArray,
    corners: AnyArray,
    queue: AnyArray,
    turn: int,
    scale: float,
    limit: float,
    in_place: bool,
) -> None:
    """Queue the edges from v to its neighbours before ``end``; without room they wait for the next round."""
    corner = marks[v, FIRST]
    while corner >= 0:
        for w in other_vertices(corners, corner):
            if w >= end or marks[w, MARK] == turn:
                continue
            marks[w, MARK] = turn
            cost = _placement(vertices, marks, v, w, in_place)[3]
            if not cost < limit:
                continue
            edge = queue[N_BUCKETS, 0]
            if edge >= 0:
                queue[N_BUCKETS, 0] = queue[edge, 0]
            else:
                edge = queue[N_BUCKETS, 1]
                if edge == len(queue):
                    return
                queue[N_BUCKETS, 1] += 1
            rank = min(int(N_BUCKETS * (cost / (cost + scale))), N_BUCKETS - 1) if cost > 0.0 else 0
            queue[edge, 0], queue[edge, 1], queue[edge, 2] = queue[rank, 0], min(v, w), max(v, w)
            queue[edge, 3] = marks[v, VERSION] + marks[w, VERSION]
            queue[rank, 0] = edge
            queue[N_BUCKETS, 2] = min(queue[N_BUCKETS, 2], rank)
        corner = corners[corner, 1]


@compiled(error_model="numpy")
def _preserves_topology(u: Index, v: Index, marks: AnyArray, corners: AnyArray, turn: int) -> bool:
    """Whether the topology of the surface stays the same when u and v become one."""
    # The link condition of Dey et al. 1999: the common neighbours of u and v must be the vertices opposite to
    # their edge, Lk u ∩ Lk v = Lk uv. A boundary counts as closed by one more vertex, which two boundary
    # vertices share: so they are merged only along a boundary edge, whose one face must not be a component of
    # its own. MARK is turn at neighbours of u, and turn + 1 at the vertices opposite to the edge.
    opposite = turn + 1
    n_shared, n_around_u = 0, 0
    corner = marks[u, FIRST]
    while corner >= 0:
        b, c = other_vertices(corners, corner)
        if b == v or c == v:
            across = b + c - v
            if marks[across, MARK] == opposite:
                return False  # two faces would have the same three vertices
            marks[across, MARK] = opposite
            n_shared += 1
        elif b >= 0:
            for w in (b, c):
                if marks[w, MARK] != opposite:
                    marks[w, MARK] = turn
        n_around_u += int(b >= 0)
        corner = corners[corner, 1]
    n_around_v, is_closed = 0, False
    corner = marks[v, FIRST]
    while corner >= 0:
        b, c = other_vertices(corners, corner)
        n_around_v += int(b >= 0)
        if b >= 0 and b != u and c != u:
            if marks[b, MARK] == turn or marks[c, MARK] == turn:
                return False
            is_closed |= marks[b, MARK] == opposite and marks[c, MARK] == opposite
        corner = corners[corner, 1]
    if is_closed:
        # Here, a face at v has both vertices opposite to the edge. If a face at u has them, too, as in a
        # tetrahedron, these two faces would coincide.
        corner = marks[u, FIRST]
        while corner >= 0:
            b, c = other_vertices(corners, corner)
            if b >= 0 and marks[b, MARK] == opposite and marks[c, MARK] == opposite:
                return False
            corner = corners[corner, 1]
    if marks[u, KIND] == BOUNDARY and marks[v, KIND] == BOUNDARY:
        return n_shared == 1 and n_around_u + n_around_v > 2
    return n_shared == 2


@compiled(error_model="numpy")
def _spoils_face(
    u: Index, v: Index, x: float, y: float, z: float, vertices: FloatArray, marks: AnyArray, corners: AnyArray
) -> bool:
    """Whether a face at u, without v, turns too far or becomes too thin when u moves to (x, y, z)."""
    corner = marks[u, FIRST]
    while corner >= 0:
        b, c = other_vertices(corners, corner)
        corner = corners[corner, 1]
        if b < 0 or b == v or c == v:
            continue
        ex, ey, ez = difference(vertices, c, b)
        px, py, pz = difference(vertices, u, b)
        qx, qy, qz = x - vertices[b, 0], y - vertices[b, 1], z - vertices[b, 2]
        mx, my, mz = ey * pz - ez * py, ez * px - ex * pz, ex * py - ey * px
        nx, ny, nz = ey * qz - ez * qy, ez * qx - ex * qz, ex * qy - ey * qx
        before = np.sqrt(mx * mx + my * my + mz * mz)
        after = np.sqrt(nx * nx + ny * ny + nz * nz)
        if mx * nx + my * ny + mz * nz < MIN_TURN_COSINE * before * after:
            return True
        # With a = c − b and p the place of u from b, the squared edges of the face sum to
        # |a|² + |p|² + |p − a|² = 2 (|a|² + |p|² − a·p).
        edge = ex * ex + ey * ey + ez * ez
        before /= edge + px * px + py * py + pz * pz - ex * px - ey * py - ez * pz
        after /= edge + qx * qx + qy * qy + qz * qz - ex * qx - ey * qy - ez * qz
        if np.sqrt(3.0) * after < SLIVER_SHAPE and after < 0.5 * before:
            return True
    return False


@compiled(error_model="numpy")
def _merge_corners(u: Index, v: Index, marks: AnyArray, corners: AnyArray) -> None:
    """Remove the faces that u and v share, and give the other faces of v to u."""
    last = -1
    for vertex in (u, v):
        corner = marks[vertex, FIRST]
        while corner >= 0:
            after = corners[corner, 1]
            b, c = other_vertices(corners, corner)
            if b == v or c == v:
                face = corner - corner % 3
                corners[face, 0] = corners[face + 1, 0] = corners[face + 2, 0] = -1
            elif b >= 0:
                corners[corner, 0] = u
                if last < 0:
                    marks[u, FIRST] = corner
                else:
                    corners[last, 1] = corner
                last = corner
            corner = after
    if last >= 0:
        corners[last, 1] = -1


@compiled(error_model="numpy")
def _placement(
    vertices: FloatArray, marks: AnyArray, u: Index, v: Index, in_place: bool
) -> tuple[float, float, float, float]:
    """Place where u and v become one vertex, and the error there; infinite if they cannot."""
    # The error xᵀ A x + 2 bᵀ x + c of the sum of both quadrics is least where its gradient 2 (A x + b)
    # vanishes, at x = −A⁻¹ b, which is computed by cofactors: A is symmetric. If A is nearly singular, as on
    # a plane, x is at v; if one vertex is freer than the other, x is at the less free one. If vertices keep
    # their places, x is at the end of less error.
    p, q = vertices[u], vertices[v]
    xx, xy, xz, yy, yz, zz = p[3] + q[3], p[4] + q[4], p[5] + q[5], p[6] + q[6], p[7] + q[7], p[8] + q[8]
    bx, by, bz = p[9] + q[9], p[10] + q[10], p[11] + q[11]
    quadric = xx, xy, xz, yy, yz, zz, bx, by, bz, p[12] + q[12]
    x, y, z = q[0], q[1], q[2]
    if marks[u, KIND] > marks[v, KIND]:
        x, y, z = p[0], p[1], p[2]
    elif not in_place and marks[u, KIND] == marks[v, KIND]:
        cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        determinant = xx * cx + xy * cy + xz * cz
        if determinant > 1e-12 * xx * yy * zz:
            cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
            x = -(cx * bx + cy * by + cz * bz) / determinant
            y = -(cy * bx + cyy * by + cyz * bz) / determinant
            z = -(cz * bx + cyz * by + czz * bz) / determinant
    cost = _cost_at(quadric, x, y, z)
    if in_place and marks[u, KIND] == marks[v, KIND]:
        cost_at_u = _cost_at(quadric, p[0], p[1], p[2])
        if cost_at_u < cost:
            x, y, z, cost = p[0], p[1], p[2], cost_at_u
    if marks[u, KIND] + marks[v, KIND] > FIXED:
        cost = np.inf
    return x, y, z, cost


@compiled(error_model="numpy")
def _cost_at(quadric: tuple[float, ...], x: float, y: float, z: float) -> float:
    xx, xy, xz, yy, yz, zz, bx, by, bz, constant = quadric
    cost = constant + x * (xx * x + 2.0 * (xy * y + xz * z + bx))
    cost += y * (yy * y + 2.0 * (yz * z + by)) + z * (zz * z + 2.0 * bz)
    return cost


@compiled(error_model="numpy")
def other_vertices(corners: AnyArray, corner: Index) -> tuple[np.int64, np.int64]:
    """Vertices of the other two corners of a face, in its direction."""
    k = corner % 3
    b = corner - 2 if k == 2 else corner + 1
    c = corner + 2 if k == 0 else corner - 1
    return np.int64(corners[b, 0]), np.int64(corners[c, 0])


@compiled(error_model="numpy")
def difference(vertices: FloatArray, a: Index, b: Index) -> tuple[float, float, float]:
    return vertices[a, 0] - vertices[b, 0], vertices[a, 1] - vertices[b, 1], vertices[a, 2] - vertices[b, 2]


@compiled(error_model="numpy")
def _add_planes(
    vertices: FloatArray, v: Index, x: float, y: float, z: float, weight: float, point_weight: float
) -> None:
    """Add the squared distances to the plane through v with normal (x, y, z), and to v itself."""
    # The squared distance of x to the plane through p with the unit normal n is (n·(x − p))² = xᵀ n nᵀ x − 2
    # (n·p) (n·x) + (n·p)², so that A = n nᵀ, b = −(n·p) n and c = (n·p)². The squared distance to the point p
    # has A = I, b = −p and c = p·p. Both are multiplied by their weights.
    px, py, pz = vertices[v, 0], vertices[v, 1], vertices[v, 2]
    d = -weight * (x * px + y * py + z * pz)
    vertices[v, 3] += weight * x * x + point_weight
    vertices[v, 4] += weight * x * y
    vertices[v, 5] += weight * x * z
    vertices[v, 6] += weight * y * y + point_weight
    vertices[v, 7] += weight * y * z
    vertices[v, 8] += weight * z * z + point_weight
    vertices[v, 9] += x * d - point_weight * px
    vertices[v, 10] += y * d - point_weight * py
    vertices[v, 11] += z * d - point_weight * pz
    vertices[v, 12] += -d * (x * px + y * py + z * pz) + point_weight * (px * px + py * py + pz * pz)
