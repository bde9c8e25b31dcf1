"""A template bent onto a target from where a map puts it: triangles keep their shape, and sheets stay apart."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch.correspondence.nearest import nearest_points, squared_distance
from isomatch.correspondence.poses import nearest_rotation
from isomatch.correspondence.registration import ROTATED, with_normals
from isomatch.correspondence.rigid_energy import RigidEnergy
from isomatch.decimation import Prolongation, decimate
from isomatch.surfaces import Mesh, PrecisePoints

N_COARSE = 3000  # vertices of the template that is bent to where the map puts it
MAP_LENGTHS = (0.1, 0.07, 0.05, 0.035)  # over which it resists being stretched there, in √area of the target
LENGTHS = (0.025, 0.017, 0.012)  # the same of all vertices, which are drawn to the nearest points
LEAST_EDGES = 1.5  # of the median, that a length has at least, so that edges resist noise
NORMAL_UNIT = 0.03  # in √area; from 0.1 on, the two sides of thin walls are confused
LEAST_COSINE = 0.3  # between the normals of a vertex and of the point that it is drawn to
REACH = 0.025  # a boundary so near is met, in √area, and what is farther from it is beyond the target
BOUNDARY_PULL = 4.0  # to a point of the boundary, beside that to other points
KEPT = 0.02  # the pull of a vertex to where it is, beside that to its point
RELEASED_RINGS = 2  # around faces that are turned over, which are drawn nowhere
ROUNDS, REFITTED = 60, 10  # of turning back; rounds after which rotations are fitted again
TURNED_WEIGHT = 30.0  # of a face that is turned over, beside the others at its corners
ON_EDGE = 1e-6  # barycentric coordinate below which a point of a triangle lies on an edge


class BentTemplate(NamedTuple):
    """Where the vertices of a template are on a target."""

    positions: FloatArray  # (n, 3) in the units of the target
    beyond: BoolArray  # (n,) vertices for which the target has nothing: without an image, or over an opening
    turned: BoolArray  # (m,) faces of the template that remain turned over, as in `turned_faces`


def bend_template(
    template: Mesh,  # every vertex belongs to a face
    target: Mesh,
    images: FloatArray,  # (n, 3) of the template's vertices; where they are not trusted, a guess
    trusted: BoolArray,  # (n,) which images the template is bent to at first
    matched: BoolArray,  # (n,) which vertices are drawn to nearest points afterwards
) -> BentTemplate:
    """Bend a template onto a target as rigidly as possible, from where a map puts its vertices."""
    # In √area of the target, with points p_i, areas a, weights w and rotations R_i, each step lowers
    #   Σ_i a_i |y_i − p_i|² + ½ ℓ² Σ_i Σ_j w_ij |(y_i − y_j) − R_i (x_i − x_j)|²
    # alternately in R and y, see `RigidEnergy`. First the template is decimated, and its vertices are drawn to the mean
    # images of those merged into them, as the length ℓ decreases; the scale of x is fitted too. Then the vertices of
    # the template follow these rigidly, and are drawn to nearest points, by position and normal. These are sought along
    # the surface from those before, so that no step leads to another sheet. Vertices of the boundary are drawn to that
    # of the target, if it is near. A vertex is drawn nowhere if it has no image, if its point faces elsewhere or lies
    # on a boundary, and where faces are turned over: there the template is completed as rigidly as possible. What
    # remains turned over in the end are slivers, see `turned_back`. Time and memory are linear in the vertices of both,
    # but for a search tree of the target: 50 µs a vertex.
    centre, unit = target.vertices.mean(axis=0), np.sqrt(target.area)
    onto = _Target(target.moved((target.vertices - centre) / unit))
    images = (images - centre) / unit
    rest = template.moved((template.vertices - template.vertices.mean(axis=0)) / np.sqrt(template.area))
    coarse = _Coarse(rest, images, trusted)
    if is_mirrored(coarse.mesh, coarse.moved):
        coarse = coarse.mirrored()
    bending, moved = coarse.followed()
    rest = bending.rest
    near = coarse.nearest(onto, rest.moved(moved))
    beyond = np.zeros(len(moved), dtype=bool)
    for length in LENGTHS:
        (positions, pull, beyond), near = onto.points(rest.moved(moved), near)
        moved = bending.step(moved, positions, pull * (matched & ~bending.released(moved)), length)
    moved, turned = turned_back(rest, moved, bending.scale)
    return BentTemplate(moved * unit + centre, ~matched | beyond, turned)


class _Bending:
    """Steps of a surface at rest, ``scale`` times as large, whose rotations are remembered."""

    def __init__(
        self, rest: Mesh, moved: FloatArray, scale: float = 1.0, turn: FloatArray | None = None
    ) -> None:
        self.rest, self.scale = rest, scale
        self._energy = RigidEnergy.of_edges(rest)
        self.turn = self._energy.pulled(rest.vertices, moved, None)[1] if turn is None else turn
        self._shortest = LEAST_EDGES * float(np.median(rest.edge_lengths))

    def step(
        self,
        moved: FloatArray,
        wanted: FloatArray,
        drawn: BoolArray | FloatArray,
        length: float,
        scales: bool = False,
    ) -> FloatArray:
        """Move the vertices to a lower energy; those that are ``drawn`` (n,) nowhere are pulled to where they are."""
        # ∇E = 0 over ℓ², see `RigidRegistration`, with κ = KEPT, which keeps the matrix definite:
        #   (L + diag(d)) y = (a / ℓ²) (drawn p + κ y_before) + Σ_j w_ij ½ (R_i + R_j) (x_i − x_j),
        #   d = (a / ℓ²) (drawn + κ)
        # With ``scales``, x is enlarged by the factor that lowers the energy most.
        energy = self._energy
        pull = energy.areas * (1 / max(length / self.scale, self._shortest)) ** 2
        pulled_to = pull[:, None] * (drawn[:, None] * wanted + KEPT * moved)
        diagonal = pull * (drawn + KEPT)
        for _ in range(ROTATED):
            before = self.scale * self.rest.vertices
            pulled, self.turn = energy.pulled(before, moved, self.turn)
            if scales:
                grown = energy.scale(before, moved, pulled)
                self.scale *= grown
                pulled *= grown
            moved = energy.solved(diagonal, pulled_to + pulled, moved)
        return moved

    def released(self, moved: FloatArray) -> BoolArray:
        """(n,) vertices around faces that are turned over."""
        faces = self.rest.faces
        near = np.zeros(len(moved), dtype=bool)
        near[faces[turned_faces(self.rest, moved, self.turn)]] = True
        for _ in range(RELEASED_RINGS):
            near[faces[np.logical_or.reduce(near[faces.T])]] = True
        return near


class _Coarse:
    """The template at a lower resolution: means of the vertices merged into one, at rest and of their images."""

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

    def mirrored(self) -> _Coarse:
        """Return the same with the mirror image of the template."""
        other = copy(self)
        other.rest, other.mesh = (m.moved(m.vertices * [-1.0, 1.0, 1.0]) for m in (self.rest, self.mesh))
        return other

    def followed(self) -> tuple[_Bending, FloatArray]:
        """Bend it to its images; what then bends the template itself, and where that is."""
        bending, images = _Bending(self.mesh, self.moved), self.moved
        for length in MAP_LENGTHS:
            drawn = self.trusted & ~bending.released(self.moved)
            self.moved = bending.step(self.moved, images, drawn, length, scales=True)
        # A vertex at Σ_k b_k c_k + offset of the coarse triangle c goes where the rotations at its corners carry it, as
        # in linear blend skinning: Σ_k b_k (y_k + R_k (x − c_k))
        turn, places = bending.turn, self._places
        moved = np.zeros_like(self.rest.vertices)
        for corner, weight in zip(places.corners.T, places.barycentric.T):
            offsets = bending.scale * (self.rest.vertices - self.mesh.vertices[corner])
            carried = self.moved[corner] + np.einsum("nij,nj->ni", turn[corner], offsets)
            moved += weight[:, None] * carried
        return _Bending(self.rest, moved, bending.scale, turn[places.corners[:, 0]]), moved

    def nearest(self, onto: _Target, bent: Mesh) -> IntArray:
        """(n,) vertices of the target near those of the bent template: the best of those nearest to coarse ones."""
        near = onto.nearest(self.mesh.moved(self.moved))[self._places.corners]  # (n, 3)
        apart = onto.coordinates[near] - onto.queries(bent)[:, None]
        best = np.einsum("nkd,nkd->nk", apart, apart).argmin(axis=1)
        return np.asarray(near[np.arange(len(near)), best])


class _Points(NamedTuple):
    """Points of a target (n, 3), how strongly vertices are drawn there (n,), and which are beyond the target (n,)."""

    positions: FloatArray
    pull: FloatArray
    beyond: BoolArray


class _Target:
    """A target of area 1, with the normals of its vertices beside their positions."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self._side = mesh, 1.0
        self.coordinates = with_normals(mesh, NORMAL_UNIT)
        self._rim = Boundary(mesh)
        ends = np.concatenate([mesh.edges, mesh.edges[:, ::-1]])
        ends = ends[np.argsort(ends[:, 0], kind="stable")]
        self._around = np.searchsorted(ends[:, 0], np.arange(mesh.n_vertices + 1)), ends[:, 1].copy()

    def queries(self, bent: Mesh) -> FloatArray:
        """(n, 6) positions and normals of a bent template, on the side of the target's."""
        return with_normals(bent, self._side * NORMAL_UNIT)

    def nearest(self, bent: Mesh) -> IntArray:
        """(n,) nearest vertices of all, after finding out whether the faces of both are wound alike."""
        tree, searches = cKDTree(self.coordinates), []
        for side in (1.0, -1.0):
            self._side = side
            searches.append((*tree.query(self.queries(bent)), side))
        _, nearest, self._side = min(searches, key=lambda search: float(search[0].mean()))
        return np.asarray(nearest, dtype=np.int64)

    def points(self, bent: Mesh, near: IntArray) -> tuple[_Points, IntArray]:
        """Find the points to which the vertices of a bent template are drawn, and the vertices (n,) nearest to these."""
        queries = self.queries(bent)
        near = near.copy()
        _descend(self.coordinates, queries, *self._around, near)
        points = nearest_points(self.coordinates, queries, self.mesh.faces, near)
        positions = points.interpolated(self.mesh.vertices)
        normals = points.interpolated(self.coordinates[:, 3:])
        lengths = np.maximum(NORMAL_UNIT * np.linalg.norm(normals, axis=1), 1e-12)
        cosines = np.einsum("ni,ni->n", normals, queries[:, 3:]) / lengths
        own_rim = Boundary.vertices_of(bent)
        over = self._rim.holds(points) & ~own_rim
        pull = ((cosines > LEAST_COSINE) & ~over).astype(np.float64)
        beyond = np.asarray(over & (np.linalg.norm(positions - bent.vertices, axis=1) > REACH))
        rows = np.flatnonzero(own_rim)
        if len(rows) and len(self.mesh.boundary_edges):
            on_rim = self._rim.nearest(bent.vertices[rows])
            close = np.linalg.norm(on_rim - bent.vertices[rows], axis=1) < REACH
            positions[rows[close]], pull[rows[close]] = on_rim[close], BOUNDARY_PULL
        return _Points(positions, pull, beyond), near


@compiled()
def _descend(
    coordinates: FloatArray, queries: FloatArray, start: IntArray, neighbours: IntArray, near: IntArray
) -> None:
    """Go from each vertex to the neighbour that is nearest to its query, as long as one is nearer."""
    for i in range(len(queries)):
        here = near[i]
        least = squared_distance(coordinates, here, queries, i)
        before = np.int64(-1)
        while before != here:
            before = here
            for at in range(start[before], start[before + 1]):
                apart = squared_distance(coordinates, neighbours[at], queries, i)
                if apart < least:
                    here, least = neighbours[at], apart
        near[i] = here


def turned_faces(mesh: Mesh, moved: FloatArray, rotations: FloatArray | None = None) -> BoolArray:
    """Find the faces (m,) that are turned over against the rotations (n, 3, 3) of the surface around their vertices."""
    # Where a thin wall has two sides, the nearest point of another surface may belong to either. So a face is not
    # compared with that surface, but with its own neighbourhood: its normal at rest, turned as its first corner is,
    # against its normal now.
    if rotations is None:
        rotations = _rotations(mesh, moved, _two_rings(mesh))
    return _are_turned(mesh, mesh.faces, moved, rotations)


def is_mirrored(mesh: Mesh, moved: FloatArray) -> bool:
    """Whether a deformation is more like a mirror image than like a rotation around most vertices."""
    # With the singular values s₁ ≥ s₂ ≥ s₃ of the covariance of a neighbourhood, the best rotation fits to s₁ + s₂ ±
    # s₃, with the sign of its determinant, and the best mirror image with the other sign (Kabsch). The sum of ± s₃
    # decides; what is flat does not count.
    covariances = _covariances(mesh, moved, _two_rings(mesh))
    least = np.linalg.svd(covariances, compute_uv=False)[:, 2]
    return bool((np.sign(np.linalg.det(covariances)) * least).sum() < 0)


def turned_back(mesh: Mesh, moved: FloatArray, scale: float) -> tuple[FloatArray, BoolArray]:
    """Move the corners of faces that are turned over, by about an edge, until few are; also which faces (m,) are then."""
    # Each face would lie around its centre as it lies at rest, ``scale`` times as large, but for the rotation of its
    # neighbourhood. Corners move to the mean of where their faces would have them, in which faces that are turned over
    # count thirty times: the global step of Bouaziz et al., *Projective Dynamics*, SIGGRAPH 2014, by Jacobi iteration,
    # for few vertices. Most such faces are slivers, which turn over for any noise.
    moved, around = moved.copy(), _two_rings(mesh)
    rotations = _rotations(mesh, moved, around)
    moving = np.zeros(mesh.n_vertices, dtype=bool)
    moving[mesh.faces[turned_faces(mesh, moved, rotations)]] = True
    for i in range(1, ROUNDS + 1):
        corners = mesh.faces[np.logical_or.reduce(moving[mesh.faces.T])]
        over = _are_turned(mesh, corners, moved, rotations)
        if not over.any():
            break
        moving[corners[over]] = True
        rows, local = np.unique(corners, return_inverse=True)
        weight = np.where(over, TURNED_WEIGHT, 1.0)
        before, after = mesh.vertices[corners], moved[corners]  # (f, 3 corners, 3)
        offsets = scale * (before - before.mean(axis=1, keepdims=True))
        wanted = np.einsum("fij,fkj->fki", rotations[corners[:, 0]], offsets)
        wanted += after.mean(axis=1, keepdims=True)
        total, *sums = (
            np.bincount(local.ravel(), np.repeat(weight, 3) * values)
            for values in (np.ones(corners.size), *wanted.reshape(-1, 3).T)
        )
        held = moving[rows]
        moved[rows[held]] = np.stack(sums, axis=1)[held] / total[held, None]
        if i % REFITTED == 0:
            rotations[rows] = _rotations(mesh, moved, around[rows])
    return moved, turned_faces(mesh, moved, _rotations(mesh, moved, around))


def _are_turned(mesh: Mesh, faces: IntArray, moved: FloatArray, rotations: FloatArray) -> BoolArray:
    expected = np.einsum("fij,fj->fi", rotations[faces[:, 0]], Mesh(mesh.vertices, faces).face_cross)
    return np.asarray(np.einsum("fi,fi->f", expected, Mesh(moved, faces).face_cross) < 0)


def _two_rings(mesh: Mesh) -> csr_array:
    """(n, n) ones where vertices are at most two edges apart."""
    ends = mesh.edges
    both = np.ones(2 * len(ends)), (ends.ravel(), ends[:, ::-1].ravel())
    ring = csr_array(both, shape=(mesh.n_vertices,) * 2) + eye_array(mesh.n_vertices)
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
    """Which points of a surface lie on its boundary, and which of the boundary are nearest to others.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> Boundary(square).nearest(np.array([[0.3, 0.2, 0.5]]))
    array([[0.3, 0. , 0. ]])
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._of_rim = self.vertices_of(mesh)

    @staticmethod
    def vertices_of(mesh: Mesh) -> BoolArray:
        """(n,) whether each vertex of a mesh is on its boundary."""
        of_rim = np.zeros(mesh.n_vertices, dtype=bool)
        of_rim[mesh.boundary_edges] = True
        return of_rim

    def holds(self, points: PrecisePoints) -> BoolArray:
        """(m,) whether points of the surface lie on its boundary."""
        return np.asarray((self._of_rim[points.corners] | (points.barycentric < ON_EDGE)).all(axis=1))

    def nearest(self, positions: FloatArray) -> FloatArray:
        """Nearest points (m, 3) of the boundary, on the edges at the nearest of its vertices."""
        x, ends = self._mesh.vertices, self._mesh.boundary_edges
        rim = np.flatnonzero(self._of_rim)
        nearest = rim[cKDTree(x[rim]).query(positions)[1]]
        points = np.array(x[nearest])
        least = np.linalg.norm(points - positions, axis=1)
        order = np.argsort(ends.ravel(), kind="stable")
        first = np.searchsorted(ends.ravel()[order], nearest)
        for at in (first, first + 1):  # a vertex of the boundary has two edges there, and rarely more
            edge = ends[order[np.minimum(at, len(order) - 1)] // 2]
            start, along = x[edge[:, 0]], x[edge[:, 1]] - x[edge[:, 0]]
            squares = np.maximum(np.einsum("ni,ni->n", along, along), 1e-30)
            share = np.einsum("ni,ni->n", positions - start, along) / squares
            there = start + np.clip(share, 0.0, 1.0)[:, None] * along
            apart = np.linalg.norm(there - positions, axis=1)
            points[apart < least] = there[apart < least]
            least = np.minimum(least, apart)
        return points
