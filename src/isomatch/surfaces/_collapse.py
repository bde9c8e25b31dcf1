"""Compiled loops of the decimation: quadrics of vertices, costs of edges and their collapse.

Corner 3 f + k of a mesh is the place k of face f, and ``at`` (3 m,) the vertex there, −1 in a face that has vanished. The
corners at a vertex are linked: ``first`` (n,) is one, ``following`` (3 m,) the next one, and −1 ends the list. A quadric
is the error xᵀ A x + 2 bᵀ x + c at a point x: the upper triangle of A, b and c.
"""

from __future__ import annotations

import numpy as np

from isomatch._arrays import AnyArray, FloatArray
from isomatch._compiled import compiled

INSIDE, BOUNDARY, FIXED = 0, 1, 2  # kinds of vertices
POINT_WEIGHT = 1e-2  # of squared distances to the merged vertices, beside those to the planes of faces
BOUNDARY_WEIGHT = 1.0  # of a plane through a boundary edge, beside a face as large as the square on that edge
LARGEST_TURN = 0.2  # least cosine of the angle by which a face may turn in one collapse
SLIVER = 0.2  # shape of a face that must not become worse: 4 √3 area / squared edges, 1 if equilateral
N_BUCKETS = 1024  # of costs, in the order of which edges are collapsed
N_SAMPLES = 20_000  # vertices whose edges tell which costs there are


@compiled()
def linked_corners(at: AnyArray, n: int) -> tuple[AnyArray, AnyArray]:
    """Link the corners at each of n vertices, in their order."""
    first = np.full(n, -1, np.int32)
    following = np.empty(len(at), np.int32)
    for corner in range(len(at) - 1, -1, -1):
        following[corner] = first[at[corner]]
        first[at[corner]] = corner
    return first, following


@compiled()
def describe_vertices(
    points: FloatArray, at: AnyArray, first: AnyArray, following: AnyArray
) -> tuple[AnyArray, FloatArray]:
    """Kind of each vertex, (n,), and its quadric, (n, 10)."""
    n = len(points)
    kind = np.empty(n, np.int8)
    quadrics = np.zeros((n, 10))
    link = np.empty((n, 2), np.int32)
    for v in range(n):
        kind[v] = _kind(v, at, first, following, link)
        corner = first[v]
        while corner >= 0:
            b, c = at[_next(corner)], at[_next(_next(corner))]
            x, y, z = _normal(points, v, b, c)
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                x, y, z = x / length, y / length, z / length
                _add_plane(quadrics, v, points, x, y, z, length / 6.0)
                _add_point(quadrics, v, points, POINT_WEIGHT * length / 6.0)
                for end in (b, c):
                    if kind[v] == BOUNDARY and link[end, 1] < 0:
                        _add_wall(quadrics, v, end, points, x, y, z)
            corner = following[corner]
    return kind, quadrics


@compiled()
def _kind(v: int, at: AnyArray, first: AnyArray, following: AnyArray, link: AnyArray) -> int:
    """Whether the faces at v form a disc, inside or at the boundary; ``link`` joins the neighbours that share a face."""
    n_faces, start, n_ends, fits = 0, -1, 0, True
    corner = first[v]
    while corner >= 0:
        for end in (at[_next(corner)], at[_next(_next(corner))]):
            link[end, 0] = link[end, 1] = -1
        n_faces += 1
        corner = following[corner]
    corner = first[v]
    while corner >= 0:
        b, c = at[_next(corner)], at[_next(_next(corner))]
        for one, other in ((b, c), (c, b)):
            if link[one, 0] < 0:
                link[one, 0] = other
            elif link[one, 1] < 0:
                link[one, 1] = other
            else:
                fits = False
        start = b
        corner = following[corner]
    corner = first[v]
    while corner >= 0:
        for end in (at[_next(corner)], at[_next(_next(corner))]):
            if link[end, 1] < 0:
                n_ends += 1
                start = end
        corner = following[corner]
    if not fits or n_faces == 0 or n_ends > 2:
        return FIXED
    before, here, steps = -1, start, 0
    while steps < n_faces:
        after = link[here, 0] if link[here, 0] != before else link[here, 1]
        before, here = here, after
        steps += 1
        if here < 0 or here == start:
            break
    if steps < n_faces:
        return FIXED  # several fans
    return BOUNDARY if n_ends == 2 else INSIDE


@compiled()
def sampled_costs(
    points: FloatArray,
    quadrics: FloatArray,
    kind: AnyArray,
    at: AnyArray,
    first: AnyArray,
    following: AnyArray,
) -> FloatArray:
    """Costs of the edges at some of the vertices; infinite for those that cannot be collapsed."""
    step = len(points) // N_SAMPLES + 1
    n_costs = 0
    for v in range(0, len(points), step):
        corner = first[v]
        while corner >= 0:
            n_costs += 1
            corner = following[corner]
    costs = np.empty(n_costs)
    n_costs = 0
    for v in range(0, len(points), step):
        corner = first[v]
        while corner >= 0:
            costs[n_costs] = _placement(points, quadrics, kind, v, at[_next(corner)])[3]
            n_costs += 1
            corner = following[corner]
    return costs


@compiled()
def collapse_edges(
    points: FloatArray,
    quadrics: FloatArray,
    kind: AnyArray,
    at: AnyArray,
    first: AnyArray,
    following: AnyArray,
    scale: float,
    limit: float,
    most: int,
) -> AnyArray:
    """Collapse edges of a cost below the limit, the cheapest first, until so many vertices are gone.

    The arrays are changed. The queue has buckets of costs; ``scale`` is the cost in the middle of them.

    Returns
    -------
    (n,) array of int
        The vertex into which each was merged, the first of all that were merged with it.
    """
    n = len(points)
    parent = np.arange(n).astype(np.int32)
    version = np.zeros(n, np.int32)
    mark = np.zeros(n, np.int32)
    turn = 0
    bucket = np.full(N_BUCKETS, -1, np.int32)
    # an edge of the queue: the next one, its ends, and the sum of their versions
    queue = np.empty((3 * n + 64, 4), np.int32)
    state = np.array(
        [0, -1, 0]
    )  # number of edges that were ever in the queue at once, a free one, the lowest bucket
    for v in range(n - 1, -1, -1):
        turn += 1
        queue = _enqueue(
            v,
            v,
            points,
            quadrics,
            kind,
            at,
            first,
            following,
            version,
            mark,
            turn,
            bucket,
            queue,
            state,
            scale,
            limit,
        )
    state[2] = 0
    n_gone = 0
    while n_gone < most:
        while state[2] < N_BUCKETS and bucket[state[2]] < 0:
            state[2] += 1
        if state[2] == N_BUCKETS:
            break
        edge = bucket[state[2]]
        bucket[state[2]] = queue[edge, 0]
        queue[edge, 0] = state[1]
        state[1] = edge
        u, v = min(queue[edge, 1], queue[edge, 2]), max(queue[edge, 1], queue[edge, 2])
        if parent[u] != u or parent[v] != v or queue[edge, 3] != version[u] + version[v]:
            continue
        x, y, z, _ = _placement(points, quadrics, kind, u, v)
        turn += 2
        if not _preserves_topology(u, v, kind, at, first, following, mark, turn):
            continue
        if _spoils(u, v, x, y, z, points, at, first, following) or _spoils(
            v, u, x, y, z, points, at, first, following
        ):
            continue
        points[u, 0], points[u, 1], points[u, 2] = x, y, z
        for i in range(10):
            quadrics[u, i] += quadrics[v, i]
        kind[u] = max(kind[u], kind[v])
        version[u] += 1
        parent[v] = u
        n_gone += 1
        _merge_corners(u, v, at, first, following)
        turn += 2
        queue = _enqueue(
            u,
            -1,
            points,
            quadrics,
            kind,
            at,
            first,
            following,
            version,
            mark,
            turn,
            bucket,
            queue,
            state,
            scale,
            limit,
        )
    for v in range(n):
        parent[v] = parent[parent[v]]  # it comes before v
    return parent


@compiled()
def _enqueue(
    v: int,
    above: int,
    points: FloatArray,
    quadrics: FloatArray,
    kind: AnyArray,
    at: AnyArray,
    first: AnyArray,
    following: AnyArray,
    version: AnyArray,
    mark: AnyArray,
    turn: int,
    bucket: AnyArray,
    queue: AnyArray,
    state: AnyArray,
    scale: float,
    limit: float,
) -> AnyArray:
    """Put the edges from v to its neighbours above a number into the queue; return the queue, which may be a longer one."""
    corner = first[v]
    while corner >= 0:
        for w in (at[_next(corner)], at[_next(_next(corner))]):
            if w <= above or mark[w] == turn:
                continue
            mark[w] = turn
            cost = _placement(points, quadrics, kind, v, w)[3]
            if not cost < limit:
                continue
            edge = state[1]
            if edge >= 0:
                state[1] = queue[edge, 0]
            else:
                edge = state[0]
                state[0] += 1
                if edge == len(queue):
                    longer = np.empty((2 * len(queue), 4), np.int32)
                    for i in range(len(queue)):
                        for j in range(4):
                            longer[i, j] = queue[i, j]
                    queue = longer
            rank = min(int(N_BUCKETS * (cost / (cost + scale))), N_BUCKETS - 1) if cost > 0.0 else 0
            queue[edge, 0], queue[edge, 1], queue[edge, 2] = bucket[rank], v, w
            queue[edge, 3] = version[v] + version[w]
            bucket[rank] = edge
            state[2] = min(state[2], rank)
        corner = following[corner]
    return queue


@compiled()
def _preserves_topology(
    u: int,
    v: int,
    kind: AnyArray,
    at: AnyArray,
    first: AnyArray,
    following: AnyArray,
    mark: AnyArray,
    turn: int,
) -> bool:
    """Whether the surface stays the same when u and v become one: Dey et al. 1999.

    Their common neighbours must be the vertices opposite to their edge. At the edge of two boundary vertices there must
    be one face, which is not a component of its own.
    """
    opposite = turn + 1
    n_shared, n_here = 0, 0
    corner = first[u]
    while corner >= 0:
        b, c = at[_next(corner)], at[_next(_next(corner))]
        if b == v or c == v:
            across = c if b == v else b
            if mark[across] == opposite:
                return False  # two faces with the same vertices
            mark[across] = opposite
            n_shared += 1
        elif b >= 0:
            for w in (b, c):
                if mark[w] != opposite:
                    mark[w] = turn
        if b >= 0:
            n_here += 1
        corner = following[corner]
    n_there, closes_there = 0, False
    corner = first[v]
    while corner >= 0:
        b, c = at[_next(corner)], at[_next(_next(corner))]
        if b >= 0:
            n_there += 1
            if b != u and c != u:
                if mark[b] == turn or mark[c] == turn:
                    return False
                closes_there = closes_there or (mark[b] == opposite and mark[c] == opposite)
        corner = following[corner]
    if closes_there:  # would another face come to lie on that one, as in a tetrahedron?
        corner = first[u]
        while corner >= 0:
            b, c = at[_next(corner)], at[_next(_next(corner))]
            if b >= 0 and mark[b] == opposite and mark[c] == opposite:
                return False
            corner = following[corner]
    if kind[u] == BOUNDARY and kind[v] == BOUNDARY:
        return n_shared == 1 and n_here + n_there > 2
    return n_shared == 2


@compiled()
def _spoils(
    u: int,
    v: int,
    x: float,
    y: float,
    z: float,
    points: FloatArray,
    at: AnyArray,
    first: AnyArray,
    following: AnyArray,
) -> bool:
    """Whether a face at u without v turns too far, or becomes too thin, when u moves to (x, y, z)."""
    corner = first[u]
    while corner >= 0:
        b, c = at[_next(corner)], at[_next(_next(corner))]
        corner = following[corner]
        if b < 0 or b == v or c == v:
            continue
        ex, ey, ez = points[c, 0] - points[b, 0], points[c, 1] - points[b, 1], points[c, 2] - points[b, 2]
        px, py, pz = points[u, 0] - points[b, 0], points[u, 1] - points[b, 1], points[u, 2] - points[b, 2]
        qx, qy, qz = x - points[b, 0], y - points[b, 1], z - points[b, 2]
        mx, my, mz = ey * pz - ez * py, ez * px - ex * pz, ex * py - ey * px
        nx, ny, nz = ey * qz - ez * qy, ez * qx - ex * qz, ex * qy - ey * qx
        before = np.sqrt(mx * mx + my * my + mz * mz)
        after = np.sqrt(nx * nx + ny * ny + nz * nz)
        if mx * nx + my * ny + mz * nz < LARGEST_TURN * before * after:
            return True
        edges = ex * ex + ey * ey + ez * ez
        before /= edges + px * px + py * py + pz * pz + (px - ex) ** 2 + (py - ey) ** 2 + (pz - ez) ** 2
        after /= edges + qx * qx + qy * qy + qz * qz + (qx - ex) ** 2 + (qy - ey) ** 2 + (qz - ez) ** 2
        if 2.0 * np.sqrt(3.0) * after < SLIVER and after <= before:
            return True
    return False


@compiled()
def _merge_corners(u: int, v: int, at: AnyArray, first: AnyArray, following: AnyArray) -> None:
    """Remove the faces that u and v share, and give u the others of v."""
    last = -1
    for vertex in (u, v):
        corner = first[vertex]
        while corner >= 0:
            after = following[corner]
            b, c = _next(corner), _next(_next(corner))
            if at[b] == v or at[c] == v:
                at[corner] = at[b] = at[c] = -1
            elif at[corner] >= 0:
                at[corner] = u
                if last < 0:
                    first[u] = corner
                else:
                    following[last] = corner
                last = corner
            corner = after
    if last < 0:
        first[u] = -1
    else:
        following[last] = -1


@compiled()
def _placement(
    points: FloatArray, quadrics: FloatArray, kind: AnyArray, u: int, v: int
) -> tuple[float, float, float, float]:
    """Where u and v go when they become one, and the error there; infinite if at least one must not move."""
    xx, xy, xz = (
        quadrics[u, 0] + quadrics[v, 0],
        quadrics[u, 1] + quadrics[v, 1],
        quadrics[u, 2] + quadrics[v, 2],
    )
    yy, yz, zz = (
        quadrics[u, 3] + quadrics[v, 3],
        quadrics[u, 4] + quadrics[v, 4],
        quadrics[u, 5] + quadrics[v, 5],
    )
    bx, by, bz = (
        quadrics[u, 6] + quadrics[v, 6],
        quadrics[u, 7] + quadrics[v, 7],
        quadrics[u, 8] + quadrics[v, 8],
    )
    constant = quadrics[u, 9] + quadrics[v, 9]
    if kind[u] == kind[v]:
        x, y, z = (
            (points[u, 0] + points[v, 0]) / 2,
            (points[u, 1] + points[v, 1]) / 2,
            (points[u, 2] + points[v, 2]) / 2,
        )
        cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        determinant = xx * cx + xy * cy + xz * cz
        if determinant > 1e-12 * xx * yy * zz:
            cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
            x = -(cx * bx + cy * by + cz * bz) / determinant
            y = -(cy * bx + cyy * by + cyz * bz) / determinant
            z = -(cz * bx + cyz * by + czz * bz) / determinant
    else:
        w = u if kind[u] > kind[v] else v
        x, y, z = points[w, 0], points[w, 1], points[w, 2]
    cost = constant + x * (xx * x + 2.0 * (xy * y + xz * z + bx)) + y * (yy * y + 2.0 * (yz * z + by))
    cost += z * (zz * z + 2.0 * bz)
    if kind[u] + kind[v] > FIXED:
        cost = np.inf
    return x, y, z, cost


@compiled()
def _next(corner: int) -> int:
    """The corner after that one in its face."""
    return corner - 2 if corner % 3 == 2 else corner + 1


@compiled()
def _normal(points: FloatArray, a: int, b: int, c: int) -> tuple[float, float, float]:
    """Cross product of the edges from a to b and c."""
    px, py, pz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    qx, qy, qz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
    return py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx


@compiled()
def _add_plane(
    quadrics: FloatArray, v: int, points: FloatArray, x: float, y: float, z: float, weight: float
) -> None:
    """Add the squared distance to a plane through v with a unit normal."""
    d = -(x * points[v, 0] + y * points[v, 1] + z * points[v, 2])
    quadrics[v, 0] += weight * x * x
    quadrics[v, 1] += weight * x * y
    quadrics[v, 2] += weight * x * z
    quadrics[v, 3] += weight * y * y
    quadrics[v, 4] += weight * y * z
    quadrics[v, 5] += weight * z * z
    quadrics[v, 6] += weight * x * d
    quadrics[v, 7] += weight * y * d
    quadrics[v, 8] += weight * z * d
    quadrics[v, 9] += weight * d * d


@compiled()
def _add_point(quadrics: FloatArray, v: int, points: FloatArray, weight: float) -> None:
    """Add the squared distance to v."""
    _add_plane(quadrics, v, points, 1.0, 0.0, 0.0, weight)
    _add_plane(quadrics, v, points, 0.0, 1.0, 0.0, weight)
    _add_plane(quadrics, v, points, 0.0, 0.0, 1.0, weight)


@compiled()
def _add_wall(
    quadrics: FloatArray, v: int, end: int, points: FloatArray, x: float, y: float, z: float
) -> None:
    """Add the squared distance to the plane through a boundary edge that holds the unit normal of its face."""
    ex, ey, ez = points[end, 0] - points[v, 0], points[end, 1] - points[v, 1], points[end, 2] - points[v, 2]
    squared = ex * ex + ey * ey + ez * ez
    if squared > 0.0:
        length = np.sqrt(squared)
        ex, ey, ez = ex / length, ey / length, ez / length
        nx, ny, nz = ey * z - ez * y, ez * x - ex * z, ex * y - ey * x
        _add_plane(quadrics, v, points, nx, ny, nz, BOUNDARY_WEIGHT * squared / 3.0)
