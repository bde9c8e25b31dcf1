"""A template bent onto a target, starting from a map: triangles keep their shape, and sheets stay apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch.correspondence.nearest import nearest_points, squared_distance
from isomatch.correspondence.poses import nearest_rotation
from isomatch.correspondence.registration import ROTATION_FITS, with_normals
from isomatch.correspondence.rigid_energy import RigidEnergy
from isomatch.decimation import Prolongation, decimate
from isomatch.surfaces import Mesh, PrecisePoints

N_COARSE = 3000  # number of vertices of the coarse template, which images under the map attract first; chosen
# lengths below which the coarse template moves almost rigidly, by step, in √area of the target; chosen
MAP_LENGTHS = (0.1, 0.07, 0.05, 0.035)
# The same for the steps of the full template, in which nearest points of the target attract it; chosen.
NEAREST_LENGTHS = (0.025, 0.017, 0.012)
# shorter lengths are raised to this many median edges, so that the template does not follow noise; chosen
MIN_LENGTH_EDGES = 1.5
# length of a normal appended to a position, in √area of the target; from 0.1 on, sides of walls are confused
NORMAL_UNIT = 0.03
MIN_FACING_COSINE = 0.3  # least cosine of the normals of a vertex and of the point that attracts it; chosen
# Distance in √area of the target: the target's boundary attracts boundary vertices of the template that are
# nearer to it, and any other vertex whose nearest point lies on the target's boundary and is farther away has
# no counterpart; chosen.
BOUNDARY_DISTANCE = 0.025
# weight with which a point of the boundary attracts a vertex, where other points have 1; chosen
BOUNDARY_PULL = 4.0
REST_PULL = 0.02  # weight with which a vertex's present place attracts it, where its new point has 1; chosen
# Vertices of inverted faces, and of this many rings of faces around them, are attracted only by their present
# places, not by images or points of the target, so that they follow the rest as rigidly as possible; chosen.
RELEASED_RINGS = 2
# largest number of rounds of `repair_inverted`, and number of rounds between two fits of rotations; chosen
MAX_ROUNDS, ROUNDS_PER_FIT = 60, 10
# weight of the corner positions that an inverted face wants, where other faces have 1; chosen
INVERTED_WEIGHT = 30.0
MAX_WEIGHT_ON_EDGE = 1e-6  # barycentric coordinate below which a point is on an edge; chosen above rounding


class BentTemplate(NamedTuple):
    """The vertices of a template on a target."""

    positions: FloatArray  # positions (n, 3) in the units of the target
    beyond: BoolArray  # vertices (n,) without a counterpart: without an image, or over an opening
    turned: BoolArray  # which faces (m,) of the template remain inverted, as in `turned_faces`


def bend_template(
    template: Mesh,  # a mesh whose vertices all belong to faces
    target: Mesh,
    images: FloatArray,  # the images (n, 3) of the template's vertices; guesses where they are not trusted
    trusted: BoolArray,  # whether each image (n,) attracts the coarse template
    matched: BoolArray,  # whether nearest points attract each vertex (n,) afterwards
) -> BentTemplate:
    """Bend a template onto a target as rigidly as possible, starting from the images of its vertices."""
    # Lengths are in √area of the target. With the points p_i that attract vertices y_i, areas a_i, weights
    # w_ij and rotations R_i, each step lowers
    #   Σ_i a_i |y_i − p_i|² + ½ ℓ² Σ_i Σ_j w_ij |(y_i − y_j) − R_i (x_i − x_j)|²
    # alternately in R and y, see `RigidEnergy`. First a coarse template is bent: each of its vertices is
    # attracted by the mean image of the vertices merged into it, as the length ℓ decreases; the scale of x is
    # fitted too. Then the vertices of the template follow the coarse ones rigidly, and the nearest points of
    # the target, by position and normal, attract them. Nearest points are sought along the target from the
    # previous ones, so that no step leads to another sheet. The target's boundary attracts boundary vertices
    # near it. No point attracts a vertex without an image, a vertex whose point faces elsewhere or lies on a
    # boundary, or a vertex at inverted faces: there the template is completed as rigidly as possible. The
    # faces that remain inverted in the end are slivers, see `repair_inverted`. Time and memory are linear in
    # the vertices of both meshes, apart from a search tree of the target: 50 µs a vertex.
    centre, unit = target.vertices.mean(axis=0), np.sqrt(target.area)
    onto = _Target(target.moved((target.vertices - centre) / unit))
    images = (images - centre) / unit
    rest = template.moved((template.vertices - template.vertices.mean(axis=0)) / np.sqrt(template.area))
    coarse = _CoarseTemplate(rest, images, trusted)
    if is_mirrored(coarse.mesh, coarse.moved):
        coarse.mirror()
    bending, moved = coarse.bend()
    rest = bending.rest
    near = coarse.nearest(onto, rest.moved(moved))
    beyond = np.zeros(len(moved), dtype=bool)
    for length in NEAREST_LENGTHS:
        positions, pull, beyond, near = onto.points(rest.moved(moved), near)
        moved = bending.step(moved, positions, pull * (matched & ~bending.released(moved)), length)
    moved, turned = repair_inverted(rest, moved, bending.scale)
    return BentTemplate(moved * unit + centre, ~matched | beyond, turned)


class _Bending:
    """Steps that bend a surface, ``scale`` times as large as at rest, and the rotations of the last step."""

    def __init__(
        self, rest: Mesh, moved: FloatArray, scale: float = 1.0, turn: FloatArray | None = None
    ) -> None:
        self.rest, self.scale = rest, scale
        self._energy = RigidEnergy.of_edges(rest)
        self.turn = self._energy.pulls(rest.vertices, moved, None)[1] if turn is None else turn
        self._min_length = MIN_LENGTH_EDGES * float(np.median(rest.edge_lengths))

    def step(
        self,
        moved: FloatArray,
        points: FloatArray,
        strength: BoolArray | FloatArray,
        length: float,
        scales: bool = False,
    ) -> FloatArray:
        """Move vertices to a lower energy; points (n, 3) attract them with a strength (n,), 0 where none does."""
        # ∇E = 0, divided by ℓ², see `RigidRegistration`; κ = REST_PULL makes the matrix positive definite:
        #   (L + diag(d)) y = (a / ℓ²) (strength p + κ y_before) + Σ_j w_ij ½ (R_i + R_j) (x_i − x_j),
        #   d = (a / ℓ²) (strength + κ)
        # With ``scales``, x is enlarged by the factor that lowers the energy most.
        energy = self._energy
        unit = energy.areas * (1 / max(length / self.scale, self._min_length)) ** 2
        attraction = unit[:, None] * (strength[:, None] * points + REST_PULL * moved)
        diagonal = unit * (strength + REST_PULL)
        for _ in range(ROTATION_FITS):
            before = self.scale * self.rest.vertices
            pulls, self.turn = energy.pulls(before, moved, self.turn)
            if scales:
                factor = energy.scale(before, moved, pulls)
                self.scale *= factor
                pulls *= factor
            moved = energy.solve(diagonal, attraction + pulls, moved)
        return moved

    def released(self, moved: FloatArray) -> BoolArray:
        """(n,) whether a vertex is near inverted faces."""
        faces = self.rest.faces
        near = np.zeros(len(moved), dtype=bool)
        near[faces[turned_faces(self.rest, moved, self.turn)]] = True
        for _ in range(RELEASED_RINGS):
            near[faces[np.logical_or.reduce(near[faces.T])]] = True
        return near


class _CoarseTemplate:
    """The template at a lower resolution: mean positions of merged vertices, at rest and of their images."""

    def __init__(self, rest: Mesh, images: FloatArray, trusted: BoolArray) -> None:
        self.rest = rest
        decimated = decimate(rest, N_COARSE)
        self._places = Prolongation(rest, decimated).on_coarse
        owner, mesh = decimated.owner, decimated.mesh
        self.trusted = np.bincount(owner, trusted, mesh.n_vertices) > 0
        counted = (trusted | ~self.trusted[owner]).astype(np.float64)

        def means(values: FloatArray) -> FloatArray:
            sums = [np.bincount(owner, counted * column, mesh.n_vertices) for column in values.T]
            return np.stack(sums, axis=1) / np.bincount(owner, counted, mesh.n_vertices)[:, None]

        self.mesh, self.moved = mesh.moved(means(rest.vertices)), means(images)

    def mirror(self) -> None:
        """Replace the template by its mirror image."""
        self.rest, self.mesh = (m.moved(m.vertices * [-1.0, 1.0, 1.0]) for m in (self.rest, self.mesh))

    def bend(self) -> tuple[_Bending, FloatArray]:
        """Bend it to its images; return a bending of the template itself, and its vertices (n, 3)."""
        bending, images = _Bending(self.mesh, self.moved), self.moved
        for length in MAP_LENGTHS:
            strength = self.trusted & ~bending.released(self.moved)
            self.moved = bending.step(self.moved, images, strength, length, scales=True)
        # Vertex x of the template, with the weights b_k in its coarse triangle, is carried to Σ_k b_k
        # (y_k + R_k (x − c_k)) by the rotations at the corners c_k of that triangle, as in linear blend
        # skinning.
        turn, places = bending.turn, self._places
        moved = np.zeros_like(self.rest.vertices)
        for corner, weight in zip(places.corners.T, places.barycentric.T):
            offsets = bending.scale * (self.rest.vertices - self.mesh.vertices[corner])
            carried = self.moved[corner] + np.einsum("nij,nj->ni", turn[corner], offsets)
            moved += weight[:, None] * carried
        return _Bending(self.rest, moved, bending.scale, turn[places.corners[:, 0]]), moved

    def nearest(self, onto: _Target, bent: Mesh) -> IntArray:
        """Target vertex (n,) near each bent vertex: the nearest of those nearest to its coarse corners."""
        near = onto.nearest(self.mesh.moved(self.moved))[self._places.corners]  # (n, 3)
        offsets = onto.coordinates[near] - onto.queries(bent)[:, None]
        best = np.einsum("nkd,nkd->nk", offsets, offsets).argmin(axis=1)
        return np.asarray(near[np.arange(len(near)), best])


class _Target:
    """A target of area 1, with coordinates of positions and normals."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self._side = mesh, 1.0
        self.coordinates = with_normals(mesh, NORMAL_UNIT)
        self._boundary = Boundary(mesh)
        ends = np.concatenate([mesh.edges, mesh.edges[:, ::-1]])
        ends = ends[np.argsort(ends[:, 0], kind="stable")]
        self._around = np.searchsorted(ends[:, 0], np.arange(mesh.n_vertices + 1)), ends[:, 1].copy()

    def queries(self, bent: Mesh) -> FloatArray:
        """(n, 6) positions and normals of a bent template, on the same side as the target's normals."""
        return with_normals(bent, self._side * NORMAL_UNIT)

    def nearest(self, bent: Mesh) -> IntArray:
        """Nearest target vertices (n,), by the normals or the reversed normals, whichever come nearer."""
        tree, searches = cKDTree(self.coordinates), []
        for side in (1.0, -1.0):
            self._side = side
            searches.append((*tree.query(self.queries(bent)), side))
        _, nearest, self._side = min(searches, key=lambda search: float(search[0].mean()))
        return np.asarray(nearest, dtype=np.int64)

    def points(self, bent: Mesh, near: IntArray) -> tuple[FloatArray, FloatArray, BoolArray, IntArray]:
        """Find the points that attract vertices of a bent template, starting from vertices (n,) near them.

        Return the points (n, 3), the strengths (n,) of their pulls, whether a vertex is beyond the
        target (n,), and the target's vertices nearest to the points (n,).
        """
        queries = self.queries(bent)
        near = near.copy()
        _descend(self.coordinates, queries, *self._around, near)
        points = nearest_points(self.coordinates, queries, self.mesh.faces, near)
        positions = points.interpolated(self.mesh.vertices)
        normals = points.interpolated(self.coordinates[:, 3:])
        lengths = np.maximum(NORMAL_UNIT * np.linalg.norm(normals, axis=1), 1e-12)
        cosines = np.einsum("ni,ni->n", normals, queries[:, 3:]) / lengths
        on_boundary = Boundary.vertices_of(bent)
        is_over = self._boundary.holds(points) & ~on_boundary
        pull = ((cosines > MIN_FACING_COSINE) & ~is_over).astype(np.float64)
        beyond = np.asarray(is_over & (np.linalg.norm(positions - bent.vertices, axis=1) > BOUNDARY_DISTANCE))
        rows = np.flatnonzero(on_boundary)
        if len(rows) and len(self.mesh.boundary_edges):
            nearest = self._boundary.nearest(bent.vertices[rows])
            is_near = np.linalg.norm(nearest - bent.vertices[rows], axis=1) < BOUNDARY_DISTANCE
            positions[rows[is_near]], pull[rows[is_near]] = nearest[is_near], BOUNDARY_PULL
        return positions, pull, beyond, near


@compiled()
def _descend(
    coordinates: FloatArray, queries: FloatArray, start: IntArray, neighbours: IntArray, near: IntArray
) -> None:
    """Go from each vertex to its neighbour nearest to the query, until no neighbour is nearer."""
    for i in range(len(queries)):
        nearest = near[i]
        least = squared_distance(coordinates, nearest, queries, i)
        centre = np.int64(-1)
        while centre != nearest:
            centre = nearest
            for e in range(start[centre], start[centre + 1]):
                squared = squared_distance(coordinates, neighbours[e], queries, i)
                if squared < least:
                    nearest, least = neighbours[e], squared
        near[i] = nearest


def turned_faces(mesh: Mesh, moved: FloatArray, rotations: FloatArray | None = None) -> BoolArray:
    """Find the faces (m,) inverted relative to the rotations (n, 3, 3) of the surface around them."""
    # At a thin wall, the point of the target nearest to a face might belong to either side. So the face is
    # not compared with the target, but with its own neighbourhood: its normal at rest, rotated as its first
    # corner, with its present normal.
    if rotations is None:
        rotations = _rotations(mesh, moved, _two_rings(mesh))
    return _are_inverted(mesh, mesh.faces, moved, rotations)


def is_mirrored(mesh: Mesh, moved: FloatArray) -> bool:
    """Whether a deformation is more like a mirror image than like a rotation around most vertices."""
    # With the singular values s₁ ≥ s₂ ≥ s₃ of the covariance of a neighbourhood, the best rotation attains
    # the trace s₁ + s₂ ± s₃, with the sign of the covariance's determinant, and the best mirror image the
    # trace with the other sign (Kabsch). The sum of ± s₃ over all vertices decides; flat neighbourhoods have
    # s₃ = 0.
    covariances = _covariances(mesh, moved, _two_rings(mesh))
    least = np.linalg.svd(covariances, compute_uv=False)[:, 2]
    return bool((np.sign(np.linalg.det(covariances)) * least).sum() < 0)


def repair_inverted(mesh: Mesh, moved: FloatArray, scale: float) -> tuple[FloatArray, BoolArray]:
    """Move the corners of inverted faces by about an edge until few are inverted; return which (m,) are."""
    # Each face wants its shape at rest, ``scale`` times as large, rotated as its neighbourhood, around its
    # centre. A corner moves to the mean of the positions that its faces want, in which inverted faces weigh
    # INVERTED_WEIGHT times as much: the global step of Bouaziz et al., *Projective Dynamics*, SIGGRAPH 2014,
    # by Jacobi iteration, as few vertices move. Most inverted faces are slivers, which any noise inverts.
    moved, around = moved.copy(), _two_rings(mesh)
    rotations = _rotations(mesh, moved, around)
    moving = np.zeros(mesh.n_vertices, dtype=bool)
    moving[mesh.faces[turned_faces(mesh, moved, rotations)]] = True
    for i in range(1, MAX_ROUNDS + 1):
        corners = mesh.faces[np.logical_or.reduce(moving[mesh.faces.T])]
        inverted = _are_inverted(mesh, corners, moved, rotations)
        if not inverted.any():
            break
        moving[corners[inverted]] = True
        rows, local = np.unique(corners, return_inverse=True)
        weight = np.where(inverted, INVERTED_WEIGHT, 1.0)
        before, after = mesh.vertices[corners], moved[corners]  # (f, 3 corners, 3)
        offsets = scale * (before - before.mean(axis=1, keepdims=True))
        wanted = np.einsum("fij,fkj->fki", rotations[corners[:, 0]], offsets)
        wanted += after.mean(axis=1, keepdims=True)
        total, *sums = (
            np.bincount(local.ravel(), np.repeat(weight, 3) * values)
            for values in (np.ones(corners.size), *wanted.reshape(-1, 3).T)
        )
        is_moving = moving[rows]
        moved[rows[is_moving]] = np.stack(sums, axis=1)[is_moving] / total[is_moving, None]
        if i % ROUNDS_PER_FIT == 0:
            rotations[rows] = _rotations(mesh, moved, around[rows])
    return moved, turned_faces(mesh, moved, _rotations(mesh, moved, around))


def _are_inverted(mesh: Mesh, faces: IntArray, moved: FloatArray, rotations: FloatArray) -> BoolArray:
    """Compare the normals of faces (f, 3) at rest, rotated as their first corners, with the present ones."""
    expected = np.einsum("fij,fj->fi", rotations[faces[:, 0]], Mesh(mesh.vertices, faces).face_cross)
    return np.asarray(np.einsum("fi,fi->f", expected, Mesh(moved, faces).face_cross) < 0)


def _two_rings(mesh: Mesh) -> csr_array:
    """Matrix (n, n) with ones where vertices are at most two edges apart."""
    ends = mesh.edges
    links = np.ones(2 * len(ends)), (ends.ravel(), ends[:, ::-1].ravel())
    ring = csr_array(links, shape=(mesh.n_vertices,) * 2) + eye_array(mesh.n_vertices)
    around = csr_array(ring @ ring)
    around.data[:] = 1.0
    return around


def _rotations(mesh: Mesh, moved: FloatArray, around: csr_array) -> FloatArray:
    """Best rotations (r, 3, 3) of the vertices that each row (r, n) of ones marks."""
    return nearest_rotation(_covariances(mesh, moved, around)).transpose(0, 2, 1)


def _covariances(mesh: Mesh, moved: FloatArray, around: csr_array) -> FloatArray:
    """Covariances (r, 3, 3), Σ_j (x_j − x̄) (y_j − ȳ)ᵀ, of the vertices that each row (r, n) of ones marks."""
    count = around.sum(axis=1)[:, None]
    before, after = mesh.vertices - mesh.vertices.mean(axis=0), moved - moved.mean(axis=0)
    # Σ (x − x̄) (y − ȳ)ᵀ = Σ x yᵀ − (Σ x) (Σ y)ᵀ / count
    products = around @ (before[:, :, None] * after[:, None]).reshape(-1, 9)
    sums = around @ before, around @ after
    return np.asarray(products.reshape(-1, 3, 3) - sums[0][:, :, None] * sums[1][:, None] / count[:, None])


class Boundary:
    """The boundary of a surface: whether points of the surface lie on it, and its points nearest to others.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> Boundary(square).nearest(np.array([[0.3, 0.2, 0.5]]))
    array([[0.3, 0. , 0. ]])
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._on_boundary = self.vertices_of(mesh)

    @staticmethod
    def vertices_of(mesh: Mesh) -> BoolArray:
        """(n,) whether each vertex of a mesh is on its boundary."""
        on_boundary = np.zeros(mesh.n_vertices, dtype=bool)
        on_boundary[mesh.boundary_edges] = True
        return on_boundary

    def holds(self, points: PrecisePoints) -> BoolArray:
        """(m,) whether points of the surface lie on its boundary."""
        on_edge = points.barycentric < MAX_WEIGHT_ON_EDGE
        return np.asarray((self._on_boundary[points.corners] | on_edge).all(axis=1))

    def nearest(self, positions: FloatArray) -> FloatArray:
        """Nearest points (m, 3) of the boundary, on the edges at its nearest vertex."""
        x, ends = self._mesh.vertices, self._mesh.boundary_edges
        vertices = np.flatnonzero(self._on_boundary)
        nearest = vertices[cKDTree(x[vertices]).query(positions)[1]]
        points = np.array(x[nearest])
        least = np.linalg.norm(points - positions, axis=1)
        order = np.argsort(ends.ravel(), kind="stable")
        first = np.searchsorted(ends.ravel()[order], nearest)
        for rows in (first, first + 1):  # a vertex of the boundary has two boundary edges, and rarely more
            edge = ends[order[np.minimum(rows, len(order) - 1)] // 2]
            start, along = x[edge[:, 0]], x[edge[:, 1]] - x[edge[:, 0]]
            squares = np.maximum(np.einsum("ni,ni->n", along, along), 1e-30)
            share = np.einsum("ni,ni->n", positions - start, along) / squares
            on_edge = start + np.clip(share, 0.0, 1.0)[:, None] * along
            distance = np.linalg.norm(on_edge - positions, axis=1)
            is_nearer = distance < least
            points[is_nearer], least[is_nearer] = on_edge[is_nearer], distance[is_nearer]
        return points
