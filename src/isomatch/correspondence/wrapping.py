"""The target's surface in the source's topology: images of its vertices, and inverted faces mended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from isomatch._arrays import BoolArray, FloatArray, IntArray
from isomatch.assets import SurfaceLike, mesh_from
from isomatch.correspondence.correspondence import Correspondence
from isomatch.correspondence.welding import welded_map
from isomatch.errors import MapError
from isomatch.resolution import PlacedMesh, VertexGroups, normalised
from isomatch.surfaces import Mesh, PrecisePoints, first_equal

ROUNDS = 60  # of mending; most pairs have no inverted face after fewer
RINGS = 2  # of vertices around inverted faces, that move with them: a region
MOST_RINGS = 12  # of a region that fewer do not help
STEPS = 12  # of the minimisation in each round, before images go back to the surface; more in a wider region
LONGEST = 0.5  # of the median edge, that an image moves in a round; more in a wider region
SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)  # of it, tried until the energy is less; the last is made anyway
N_GUIDES = 30  # vertices with an image, with which a component without any moves
FLAT = 1e-3  # times the area that a face should have: a face with less is mended too


@dataclass(frozen=True, eq=False)
class Wrapped:
    """What `wrap` returns.

    Parameters
    ----------
    mesh : Mesh
        The faces of the source between points of the target.
    inverted_before, inverted : int
        Faces whose normal was against that of the target, and that remain so after mending.
    extended : int
        Vertices without an image, placed by those around them.
    """

    mesh: Mesh
    inverted_before: int
    inverted: int
    extended: int


def wrap(correspondence: Correspondence, source: SurfaceLike, target: SurfaceLike) -> Wrapped:
    """Draw the target's surface with the vertices and faces of the source.

    Vertices are at their precise images. Around faces that are turned over or without area, images move on the target's
    surface until none is left, or no move helps. Vertices without an image do not lie on the target: they continue the
    surface around them harmonically, and a component without any image moves rigidly with the nearest that have one.

    Parameters
    ----------
    correspondence : Correspondence
        Source → target.
    source, target : Mesh, or what `mesh_from` takes
        Its surfaces. Vertices at the same position, as at seams, stay together.

    Returns
    -------
    Wrapped

    Raises
    ------
    MapError
        If it is a map of other surfaces, or gives no vertex an image.

    Notes
    -----
    The mending minimises distortion of the faces around, for which inversion is a large but finite cost that grows from
    round to round: V. Garanzha et al., *Foldover-free Maps in 50 Lines of Code*, SIGGRAPH 2021, here in the tangent
    planes of the target. Each round is linear in the faces that take part. Where the target is folded as sharply as its
    own triangles, a few may remain.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> wrap(Correspondence([1, 2, 3, 0], n_target=4), square, square).mesh.vertices[0].tolist()
    [1.0, 0.0, 0.0]
    """
    source, target = mesh_from(source), mesh_from(target)
    correspondence.check_fits(source, target)
    if not correspondence.matched.any():
        raise MapError(
            f"{correspondence!r} gives no vertex an image, so there is nothing to wrap; match again"
        )
    (whole, vertex), (onto, onto_vertex) = _welded(source), _welded(target)
    found = welded_map(correspondence, vertex, onto_vertex)
    matched = found.matched
    faces = whole.faces[matched[whole.faces].all(axis=1)]
    images = PrecisePoints(np.maximum(found.faces, 0), np.array(found.barycentric))
    before = after = 0
    if len(faces) and onto.n_faces:
        mending = _Mending(faces, whole, onto, images)
        before, after = mending.run()
    positions = images.interpolated(onto.vertices)
    if not matched.all() and matched.any():
        positions = _extended(whole, positions, matched)
    return Wrapped(source.moved(positions[vertex]), before, after, int((~matched[vertex]).sum()))


def _welded(mesh: Mesh) -> tuple[Mesh, IntArray]:
    """Close seams: join boundary vertices at the same position; also the vertex of each. Collapsed faces are left out."""
    first, rim = np.arange(mesh.n_vertices), np.unique(mesh.boundary_edges)
    first[rim] = rim[first_equal(mesh.vertices[rim])]
    kept, vertex = np.unique(first, return_inverse=True)
    faces = vertex[mesh.sound_faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Mesh(mesh.vertices[kept], faces[whole]), vertex


class _Mending:
    """Images of vertices on a surface, that move until no face is turned over. The images given are changed."""

    def __init__(self, faces: IntArray, source: Mesh, target: Mesh, images: PrecisePoints) -> None:
        places = normalised(target.vertices)[0]
        self.faces, self.images, self.places = faces, images, places
        used = np.zeros(source.n_vertices, dtype=bool)
        used[faces] = True
        groups = VertexGroups.of(np.arange(target.n_vertices), target.n_vertices)
        self.walk = PlacedMesh(target, places, groups)
        shape = source.moved(normalised(source.vertices)[0])
        self.inverse_shape = _inverse_shapes(
            shape.vertices * np.sqrt(target.moved(places).area / max(shape.area, 1e-12)), faces
        )
        ends = source.edges[used[source.edges].all(axis=1)]
        both = np.ones(2 * len(ends)), (ends.ravel(), ends[:, ::-1].ravel())
        self.adjacent = csr_array(both, shape=(source.n_vertices,) * 2)
        self.normals = target.vertex_normals
        self.x, self.n = images.interpolated(places), images.interpolated(self.normals)
        self.edge = np.median(np.linalg.norm(self.x[ends[:, 0]] - self.x[ends[:, 1]], axis=1))
        if np.median(self._determinants()) < 0:  # a mirror image: its faces should all be turned over
            self.normals = -self.normals
            self.n = -self.n

    def _determinants(self) -> FloatArray:
        """(m,) signed area of each face over the area it should have."""
        found: FloatArray = np.linalg.det(
            _jacobians(self.x, self.faces, _planes(self.n, self.faces), self.inverse_shape)
        )
        return found

    def run(self) -> tuple[int, int]:
        """Mend; the numbers of inverted faces before and after."""
        share = self._determinants()
        before = int((share <= 0).sum())
        best = before, self.images.corners.copy(), self.images.barycentric.copy()
        moving, rings = np.zeros(len(self.x), dtype=bool), np.full(len(self.x), RINGS)
        for _ in range(ROUNDS):
            bad = self.faces[share <= FLAT]
            if not len(bad):
                break
            for n in np.unique(rings[bad]):
                around = np.zeros(len(self.x), dtype=bool)
                around[bad[rings[bad].max(axis=1) == n]] = True
                for _ in range(n):
                    around |= self.adjacent @ around > 0
                moving |= around
            for rows, near in self._regions(moving, np.unique(bad)):
                width = rings[rows].max()
                if not self._round(rows, near, share, width / RINGS):
                    rings[rows] = min(width + 1, MOST_RINGS)
            share = self._determinants()
            if (share <= 0).sum() < best[0]:
                best = int((share <= 0).sum()), self.images.corners.copy(), self.images.barycentric.copy()
        self.images.corners[:], self.images.barycentric[:] = best[1:]
        return before, best[0]

    def _regions(self, moving: BoolArray, bad: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Group moving vertices (m,) into connected regions with bad ones; each with the faces that have any of them."""
        rows = np.flatnonzero(moving)
        _, region = connected_components(self.adjacent[rows][:, rows])
        number = np.full(len(moving), -1)
        number[rows] = region
        of_face = number[self.faces].max(axis=1)
        return [(rows[region == each], np.flatnonzero(of_face == each)) for each in np.unique(number[bad])]

    def _round(self, rows: IntArray, near: IntArray, share: FloatArray, wider: float) -> bool:
        """Move some vertices to a lower energy of the faces near them; False if that is not lower."""
        members, faces = np.unique(self.faces[near], return_inverse=True)
        faces, inverse = faces.reshape(-1, 3), self.inverse_shape[near]
        here, up, moved = self.x[members], self.n[members], np.searchsorted(members, rows)
        soft = np.sqrt(1e-4 + 0.04 * min(share[near].min(), 0.0) ** 2)
        planes = _planes(up, faces)
        normal = self.n[rows] / np.maximum(np.linalg.norm(self.n[rows], axis=1, keepdims=True), 1e-12)

        def cost(z: FloatArray) -> tuple[float, FloatArray]:
            x = here.copy()
            x[moved] = z.reshape(-1, 3)
            value, slope = _energy(x, faces, planes, inverse, soft)
            along = slope[moved] - (slope[moved] * normal).sum(axis=1, keepdims=True) * normal
            return value, along.ravel()

        start = here[moved]
        steps, longest = int(STEPS * (1 + wider) / 2), wider * LONGEST * self.edge
        found = minimize(cost, start.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": steps})
        move = found.x.reshape(-1, 3) - start
        move *= np.minimum(1, longest / np.maximum(np.linalg.norm(move, axis=1), 1e-12))[:, None]
        least = _energy(here, faces, planes, inverse, soft)[0]
        improved = False
        for part in SHARES:
            there = self.walk.inverse(start + part * move, self.images.corners[rows])
            here[moved], up[moved] = there.interpolated(self.places), there.interpolated(self.normals)
            improved = _energy(here, faces, _planes(up, faces), inverse, soft)[0] < least
            if improved:
                break
        self.x[rows], self.n[rows] = here[moved], up[moved]
        self.images.corners[rows], self.images.barycentric[rows] = there
        return improved


def _planes(normals: FloatArray, faces: IntArray) -> FloatArray:
    """(m, 2, 3) orthonormal bases of the planes across the mean normal of each face."""
    up = normals[faces].sum(axis=1)
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
    other = np.where(np.abs(up[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(up, other)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(up, first)], axis=1)


def _inverse_shapes(x: FloatArray, faces: IntArray) -> FloatArray:
    """(m, 2, 2) inverse of the edges of each face in its own plane; slivers count as if they were less thin."""
    a, b, c = (x[faces[:, k]] for k in range(3))
    length = np.maximum(np.linalg.norm(b - a, axis=1), 1e-9)
    along = ((c - a) * (b - a)).sum(axis=1) / length
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / length
    height = np.maximum(height, 0.05 * np.maximum(length, np.hypot(along, height)))
    inverse = np.zeros((len(faces), 2, 2))
    inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 1] = 1 / length, -along / (length * height), 1 / height
    return inverse


def _jacobians(x: FloatArray, faces: IntArray, planes: FloatArray, inverse: FloatArray) -> FloatArray:
    """(m, 2, 2) derivative of the map on each face, projected to its plane."""
    a, b, c = (x[faces[:, k]] for k in range(3))
    found: FloatArray = planes @ np.stack([b - a, c - a], axis=2) @ inverse
    return found


def _energy(
    x: FloatArray, faces: IntArray, planes: FloatArray, inverse: FloatArray, soft: float
) -> tuple[float, FloatArray]:
    """Σ (|J|² + det² + 1) / (2 χ), χ = (det + √(det² + soft²)) / 2, Garanzha et al.; and its derivative (n, 3)."""
    jacobian = _jacobians(x, faces, planes, inverse)
    (p, q), (r, s) = np.moveaxis(jacobian, 0, 2)
    det = p * s - q * r
    root = np.sqrt(det * det + soft * soft)
    chi = np.where(det > 0, det + root, soft * soft / (root - np.minimum(det, 0.0))) / 2
    size = ((jacobian**2).sum(axis=(1, 2)) + det * det + 1) / 2
    cofactors = np.moveaxis(np.array([[s, -r], [-q, p]]), 2, 0)
    by_det = det / chi - size * (1 + det / root) / (2 * chi**2)
    slope = jacobian / chi[:, None, None] + cofactors * by_det[:, None, None]
    by_edges = planes.transpose(0, 2, 1) @ slope @ inverse.transpose(0, 2, 1)  # (m, 3, 2)
    by_corner = np.stack([-by_edges.sum(axis=2), by_edges[:, :, 0], by_edges[:, :, 1]], axis=1).reshape(-1, 3)
    return float((size / chi).sum()), _sums(by_corner, faces.ravel(), len(x))


def _extended(mesh: Mesh, positions: FloatArray, known: BoolArray) -> FloatArray:
    """Place the other vertices: harmonic where linked to known ones, else rigid with the nearest known ones."""
    placed = positions.copy()
    linked = np.isin(mesh.components, mesh.components[known])
    ends = mesh.edges
    weight = 1 / np.maximum(mesh.edge_lengths, 1e-12 * mesh.edge_lengths.max(initial=0.0))
    both = np.tile(weight, 2), (ends.T.ravel(), ends[:, ::-1].T.ravel())
    links = csr_array(both, shape=(mesh.n_vertices,) * 2)
    laplacian = (diags_array(links.sum(axis=1)) - links).tocsr()
    unknown = np.flatnonzero(~known & linked)
    if len(unknown):
        side = -(laplacian[unknown][:, known] @ positions[known])
        placed[unknown] = spsolve(laplacian[unknown][:, unknown].tocsc(), side).reshape(-1, 3)
    rows = np.flatnonzero(~linked)
    _, component, sizes = np.unique(mesh.components[rows], return_inverse=True, return_counts=True)
    centres = _sums(mesh.vertices[rows], component, len(sizes)) / sizes[:, None]
    guides = np.flatnonzero(known)
    nearest = cKDTree(mesh.vertices[guides]).query(centres, range(1, min(N_GUIDES, len(guides)) + 1))[1]
    here, there = (x[guides[nearest]] for x in (mesh.vertices, positions))  # (components, guides, 3)
    middles = here.mean(axis=1), there.mean(axis=1)
    here, there = here - middles[0][:, None], there - middles[1][:, None]
    u, _, vt = np.linalg.svd(here.transpose(0, 2, 1) @ there)
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    turned = (mesh.vertices[rows] - middles[0][component])[:, None] @ (u @ vt)[component]
    placed[rows] = turned[:, 0] + middles[1][component]
    return placed


def _sums(values: FloatArray, group: IntArray, n_groups: int) -> FloatArray:
    """Sum values (m, q) within groups: (n_groups, q)."""
    return np.stack([np.bincount(group, column, n_groups) for column in values.T], axis=1)
