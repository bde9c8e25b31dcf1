"""A template bent onto a target from where a map puts it: triangles keep their shape, and sheets stay apart."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from isomatch.correspondence.boundary import Boundary
from isomatch.correspondence.nearest_points import nearest_points
from isomatch.correspondence.rigid_energy import RigidEnergy
from isomatch.correspondence.rigid_registration import ROTATED, with_normals
from isomatch.correspondence.turned_faces import is_mirrored, turned_back, turned_faces
from isomatch.loading.compiled import compiled
from isomatch.resolution import Prolongation, decimate
from isomatch.surfaces import Mesh
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

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


class BentTemplate(NamedTuple):
    """Where the vertices of a template are on a target.

    Parameters
    ----------
    positions : (n, 3) array of float
        In the units of the target.
    beyond : (n,) array of bool
        Vertices for which the target has nothing: without an image, or over an opening.
    turned : (m,) array of bool
        Faces of the template that remain turned over, as in `turned_faces`.
    """

    positions: FloatArray
    beyond: BoolArray
    turned: BoolArray


def bend_template(
    template: Mesh, target: Mesh, images: FloatArray, trusted: BoolArray, known: BoolArray | None = None
) -> BentTemplate:
    """Bend a template onto a target as rigidly as possible, from where a map puts its vertices.

    Parameters
    ----------
    template, target : Mesh
        The surfaces; every vertex of the template belongs to a face.
    images : (n, 3) array of float
        Images of the template's vertices on the target; where they are not trusted, a guess.
    trusted : (n,) array of bool
        Which images the template is bent to at first.
    known : (n,) array of bool, optional
        Which vertices are drawn to the nearest points afterwards; by default the same.

    Returns
    -------
    BentTemplate

    Notes
    -----
    In √area of the target, with points p_i, areas a, weights w and rotations R_i, each step decreases::

        Σ_i a_i |y_i − p_i|² + ½ ℓ² Σ_i Σ_j w_ij |(y_i − y_j) − R_i (x_i − x_j)|²

    alternately in R and y (Sorkine & Alexa, *As-Rigid-As-Possible Surface Modeling*, SGP 2007). First the template is
    decimated, and its vertices are drawn to the mean images of those merged into them, as the length ℓ decreases; the
    scale of x is fitted too. Then the vertices of the template follow these rigidly, and are drawn to nearest points, by
    position and normal. These are sought along the surface from those before, so that no step leads to another sheet.
    Vertices of the boundary are drawn to that of the target, if it is near. A vertex is drawn nowhere if it has no
    image, if its point faces elsewhere or lies on a boundary, and where faces are turned over: there the template is
    completed as rigidly as possible. What remains turned over in the end are slivers, see `turned_back`.

    Time and memory are linear in the vertices of both, but for a search tree of the target: 50 µs a vertex.

    Examples
    --------
    An octahedron is bent onto itself from images that are its corners: it stays as it is.

    >>> corners = np.concatenate([np.eye(3), -np.eye(3)])
    >>> faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    >>> solid = Mesh(corners, faces)
    >>> bent = bend_template(solid, solid, corners, np.ones(6, dtype=bool))
    >>> bool(np.allclose(bent.positions, corners, atol=1e-3)), bent.beyond.any()
    (True, np.False_)
    """
    centre, unit = target.vertices.mean(axis=0), np.sqrt(target.area)
    onto = _Target(target.moved((target.vertices - centre) / unit))
    images = (images - centre) / unit
    rest = template.moved((template.vertices - template.vertices.mean(axis=0)) / np.sqrt(template.area))
    known = trusted if known is None else known
    coarse = _Coarse(rest, images, trusted)
    if is_mirrored(coarse.mesh, coarse.moved):
        coarse = coarse.mirrored()
    bending, moved = coarse.followed()
    rest = bending.rest
    near = coarse.nearest(onto, rest.moved(moved))
    beyond = np.zeros(len(moved), dtype=bool)
    for length in LENGTHS:
        points, near = onto.points(rest.moved(moved), near)
        beyond = points.beyond
        moved = bending.step(
            moved, points.positions, points.pull * (known & ~bending.released(moved)), length
        )
    moved, turned = turned_back(rest, moved, bending.scale)
    return BentTemplate(moved * unit + centre, ~known | beyond, turned)


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
        """Move the vertices to a lower energy; those that are not ``drawn`` (n,) anywhere are pulled to where they are.

        With ``scales``, the surface at rest is enlarged as fits best.
        """
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

    def __init__(self, rest: Mesh, images: FloatArray, known: BoolArray) -> None:
        self.rest = rest
        decimated = decimate(rest, N_COARSE)
        self._places = Prolongation(rest, decimated).on_coarse
        owner, mesh = decimated.owner, decimated.mesh
        self.known = np.bincount(owner, known, mesh.n_vertices) > 0
        counted = (known | ~self.known[owner]).astype(np.float64)

        def means(values: FloatArray) -> FloatArray:
            sums = [np.bincount(owner, counted * column, mesh.n_vertices) for column in values.T]
            return np.stack(sums, axis=1) / np.bincount(owner, counted, mesh.n_vertices)[:, None]

        self.mesh, self.moved = mesh.moved(means(rest.vertices)), means(images)

    def mirrored(self) -> _Coarse:
        """Return the same with the mirror image of the template."""
        other = copy(self)
        other.rest, other.mesh = (
            mesh.moved(mesh.vertices * [-1.0, 1.0, 1.0]) for mesh in (self.rest, self.mesh)
        )
        return other

    def followed(self) -> tuple[_Bending, FloatArray]:
        """Bend it to its images; what then bends the template itself, and where that is."""
        bending, images = _Bending(self.mesh, self.moved), self.moved
        for length in MAP_LENGTHS:
            drawn = self.known & ~bending.released(self.moved)
            self.moved = bending.step(self.moved, images, drawn, length, scales=True)
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
        nearest: IntArray = near[np.arange(len(near)), best]
        return nearest


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
        queries = with_normals(bent, self._side * NORMAL_UNIT)
        return queries

    def nearest(self, bent: Mesh) -> IntArray:
        """(n,) nearest vertices of all, after finding out whether the faces of both are wound alike."""
        tree, found = cKDTree(self.coordinates), []
        for side in (1.0, -1.0):
            self._side = side
            apart, nearest = tree.query(self.queries(bent))
            found.append((float(apart.mean()), side, nearest))
        _, self._side, nearest = min(found, key=lambda each: each[0])
        return np.asarray(nearest, dtype=np.int64)

    def points(self, bent: Mesh, near: IntArray) -> tuple[_Points, IntArray]:
        """Find the points to which the vertices of a bent template are drawn, and the vertices (n,) nearest to these.

        They are sought by steps along the edges, from the vertices ``near`` (n,).
        """
        queries = self.queries(bent)
        near = near.copy()
        _descend(self.coordinates, queries, *self._around, near)
        found = nearest_points(self.coordinates, queries, self.mesh.faces, near)
        positions = found.interpolated(self.mesh.vertices)
        normals = found.interpolated(self.coordinates[:, 3:])
        cosines = np.einsum("ni,ni->n", normals, queries[:, 3:]) / np.maximum(
            NORMAL_UNIT * np.linalg.norm(normals, axis=1), 1e-12
        )
        own_rim = Boundary.vertices_of(bent)
        over = self._rim.holds(found) & ~own_rim
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
        least = _squared(coordinates, here, queries, i)
        before = np.int64(-1)
        while before != here:
            before = here
            for at in range(start[before], start[before + 1]):
                apart = _squared(coordinates, neighbours[at], queries, i)
                if apart < least:
                    here, least = neighbours[at], apart
        near[i] = here


@compiled(inline="always")
def _squared(coordinates: FloatArray, j: int, queries: FloatArray, i: int) -> float:
    total = 0.0
    for d in range(coordinates.shape[1]):
        total += (coordinates[j, d] - queries[i, d]) ** 2
    return total
