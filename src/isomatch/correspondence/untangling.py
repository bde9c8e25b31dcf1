"""Images of a surface's faces on another surface, moved until none is turned over."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from isomatch.loading.compiled import compiled
from isomatch.resolution import PlacedMesh, VertexGroups, normalised
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

ROUNDS = 100  # of mending; most pairs have no inverted face after fewer
RINGS = 2  # of vertices around inverted faces, that move with them: a region
MOST_RINGS = 12  # of a region that fewer do not help
STEPS = 24  # of the minimisation in each round, before images go back to the surface; more in a wider region
LONGEST = 0.5  # of the median edge, that an image moves in a round; more in a wider region
SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)  # of it, tried until the energy is less; the last is made anyway
FLAT = 1e-3  # times the area that a face should have: a face with less is mended too


class Untangling:
    """Images of vertices on a surface, that move until no face is turned over. The images given are changed."""

    def __init__(self, faces: IntArray, source: Mesh, target: Mesh, images: PrecisePoints) -> None:
        places = normalised(target.vertices)[0]
        self.faces, self.images, self.places = faces, images, places
        used = np.zeros(source.n_vertices, dtype=bool)
        used[faces] = True
        groups = VertexGroups.of(np.arange(target.n_vertices), target.n_vertices)
        self.walk = PlacedMesh(target, places, groups)
        shape = source.moved(normalised(source.vertices)[0])
        # the shapes that faces should have are those of the source, at the target's area
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
        determinants: FloatArray = np.linalg.det(
            _jacobians(self.x, self.faces, _planes(self.n, self.faces), self.inverse_shape)
        )
        return determinants

    def run(self) -> tuple[int, int]:
        """Mend; the numbers of inverted faces before and after."""
        share = self._determinants()
        before = _wrong(share)
        best = before, self.images.corners.copy(), self.images.barycentric.copy()
        moving, rings = np.zeros(len(self.x), dtype=bool), np.full(len(self.x), RINGS)
        for _ in range(ROUNDS):
            bad = self.faces[share <= FLAT]
            if not len(bad):
                break
            for n in np.unique(rings[bad]):  # a face moves with as many rings as the widest of its corners
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
            if _wrong(share) < best[0]:
                best = _wrong(share), self.images.corners.copy(), self.images.barycentric.copy()
        self.images.corners[:], self.images.barycentric[:] = best[1:]
        return before[0], best[0][0]

    def _regions(self, moving: BoolArray, bad: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Group moving vertices (m,) into connected regions with bad ones; each with the faces that have any of them."""
        rows = np.flatnonzero(moving)
        _, region = connected_components(self.adjacent[rows][:, rows])
        number = np.full(len(moving), -1)
        number[rows] = region
        # moving corners of a face are adjacent, so in one region, and the others have −1: the maximum is that region
        of_face = number[self.faces].max(axis=1)
        return [(rows[region == label], np.flatnonzero(of_face == label)) for label in np.unique(number[bad])]

    def _round(self, rows: IntArray, near: IntArray, share: FloatArray, wider: float) -> bool:
        """Move some vertices to a lower energy of the faces near them; False if that is not lower."""
        members, faces = np.unique(self.faces[near], return_inverse=True)
        faces, inverse = faces.reshape(-1, 3), self.inverse_shape[near]
        here, up, moved = self.x[members], self.n[members], np.searchsorted(members, rows)
        # ε of Garanzha et al., larger for worse inversions: χ(det) stays positive, and the energy finite
        soft = np.sqrt(1e-4 + 0.04 * min(share[near].min(), 0.0) ** 2)
        planes = _planes(up, faces)
        normal = self.n[rows] / np.maximum(np.linalg.norm(self.n[rows], axis=1, keepdims=True), 1e-12)

        def cost(z: FloatArray) -> tuple[float, FloatArray]:
            x = here.copy()
            x[moved] = z.reshape(-1, 3)
            slope = np.zeros_like(x)
            value = _energy(x, faces, planes, inverse, soft, slope)
            # (I − n nᵀ) ∇E: images move in the tangent planes
            along = slope[moved] - (slope[moved] * normal).sum(axis=1, keepdims=True) * normal
            return value, along.ravel()

        start = here[moved]
        steps, longest = int(STEPS * (1 + wider) / 2), wider * LONGEST * self.edge
        minimum = minimize(cost, start.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": steps})
        move = minimum.x.reshape(-1, 3) - start
        move *= np.minimum(1, longest / np.maximum(np.linalg.norm(move, axis=1), 1e-12))[:, None]
        least = _energy(here, faces, planes, inverse, soft, np.zeros_like(here))
        improved = False
        for part in SHARES:
            there = self.walk.inverse(start + part * move, self.images.corners[rows])
            here[moved], up[moved] = there.interpolated(self.places), there.interpolated(self.normals)
            improved = _energy(here, faces, _planes(up, faces), inverse, soft, np.zeros_like(here)) < least
            if improved:
                break
        self.x[rows], self.n[rows] = here[moved], up[moved]
        self.images.corners[rows], self.images.barycentric[rows] = there
        return improved


def _wrong(share: FloatArray) -> tuple[int, int]:
    """Count faces that are turned over, and those that are turned over or flat."""
    return int((share <= 0).sum()), int((share <= FLAT).sum())


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
    # edges b − a = (length, 0) and c − a = (along, height) are the columns of an upper triangular matrix
    inverse = np.zeros((len(faces), 2, 2))
    inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 1] = 1 / length, -along / (length * height), 1 / height
    return inverse


def _jacobians(x: FloatArray, faces: IntArray, planes: FloatArray, inverse: FloatArray) -> FloatArray:
    """(m, 2, 2) derivative of the map on each face, projected to its plane."""
    a, b, c = (x[faces[:, k]] for k in range(3))
    # (m, 2, 3) (m, 3, 2) (m, 2, 2) -> (m, 2, 2)
    jacobians: FloatArray = planes @ np.stack([b - a, c - a], axis=2) @ inverse
    return jacobians


@compiled()
def _energy(
    x: FloatArray, faces: IntArray, planes: FloatArray, inverse: FloatArray, soft: float, slope: FloatArray
) -> float:
    """Σ (|J|² + det² + 1) / (2 χ), χ = (det + √(det² + soft²)) / 2, Garanzha et al.; its derivative is added to slope."""
    total = 0.0
    for f in range(len(faces)):
        a, b, c = faces[f]
        up, vp, uq, vq = 0.0, 0.0, 0.0, 0.0  # edges b − a and c − a in the two axes of the plane
        for d in range(3):
            first, second = x[b, d] - x[a, d], x[c, d] - x[a, d]
            up += planes[f, 0, d] * first
            vp += planes[f, 1, d] * first
            uq += planes[f, 0, d] * second
            vq += planes[f, 1, d] * second
        i00, i01, i10, i11 = inverse[f, 0, 0], inverse[f, 0, 1], inverse[f, 1, 0], inverse[f, 1, 1]
        # J = (p q; r s), projected edges times the inverse shape
        p, q = up * i00 + uq * i10, up * i01 + uq * i11
        r, s = vp * i00 + vq * i10, vp * i01 + vq * i11
        det = p * s - q * r
        root = np.sqrt(det * det + soft * soft)
        chi = (det + root if det > 0 else soft * soft / (root - det)) / 2  # det + root cancels where det < 0
        size = (p * p + q * q + r * r + s * s + det * det + 1) / 2
        total += size / chi
        # E = size / χ: ∂E/∂det = det / χ − size χ' / χ² with χ' = (1 + det / root) / 2; ∂det/∂J = (s −r; −q p)
        by_det = det / chi - size * (1 + det / root) / (2 * chi * chi)
        dp, dq = p / chi + s * by_det, q / chi - r * by_det
        dr, ds = r / chi - q * by_det, s / chi + p * by_det
        # ∂E/∂edges = ∂E/∂J · inverseᵀ, then planesᵀ back to space; a is in both edges, with the sign −1
        u_first, v_first = dp * i00 + dq * i01, dr * i00 + ds * i01
        u_second, v_second = dp * i10 + dq * i11, dr * i10 + ds * i11
        for d in range(3):
            by_first = planes[f, 0, d] * u_first + planes[f, 1, d] * v_first
            by_second = planes[f, 0, d] * u_second + planes[f, 1, d] * v_second
            slope[a, d] -= by_first + by_second
            slope[b, d] += by_first
            slope[c, d] += by_second
    return total
