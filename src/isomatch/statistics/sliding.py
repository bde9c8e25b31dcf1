"""Semilandmarks, slid along curves and surfaces so that thin-plate splines from the mean shape bend least."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.spatial.distance import cdist

from isomatch.errors import LandmarkError
from isomatch.landmarks import Curve, drawn_curve, nearest_on_surface
from isomatch.runtime.memory import require_memory
from isomatch.runtime.threads import parallel_map, serial_blas
from isomatch.statistics.procrustes import centroid_sizes, generalised_procrustes
from isomatch.surfaces import Mesh, PointCloud, PrecisePoints, vertex_normals
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

AT_ONCE = 10  # specimens in one product: 30 columns
AFFINE = 0.01  # m times the mean distance; with 1, twice as many iterations
RIDGE = 1e-10  # of the mean distance, so that two curves may end in one point
MOST_ITERATIONS = 25  # of a round; on skulls, 20 gain 99 % of what there is to gain
CLOSE = 0.01  # of the first residual
SHARES = 1.0, 0.5, 0.25  # of a step that are tried


@dataclass(frozen=True, eq=False)
class SlidSemilandmarks:
    """Landmarks of s specimens, after semilandmarks have slid.

    Parameters
    ----------
    positions : (s, m, 3) array of float
        nan where there was no place.
    moved : (s, m) array of float
        Distance of each from where it was.
    energy_before, energy_after : (s,) array of float
        Bending energy from the mean shape, in the first round and after the last; of shapes of centroid size 1, without
        the factor 8π.
    """

    positions: FloatArray
    moved: FloatArray
    energy_before: FloatArray
    energy_after: FloatArray


def slid_semilandmarks(
    positions: FloatArray,
    surfaces: Sequence[Mesh | PointCloud],
    curves: Sequence[Curve] = (),
    patch: Sequence[int] = (),
    *,
    tolerance: float = 0.02,
    most_rounds: int = 5,
) -> SlidSemilandmarks:
    """Slide semilandmarks along curves and surfaces so that thin-plate splines from the mean shape bend least.

    Parameters
    ----------
    positions : (s, m, 3) array of float
        Corresponding points of s ≥ 2 specimens; nan where one has no place.
    surfaces : sequence of Mesh or PointCloud
        That of each specimen; a mesh if there is a patch.
    curves : sequence of Curve
        Their points slide, but for the ends of an open curve and the first point of a closed one.
    patch : sequence of int
        Points that slide on the surface. All others are fixed.
    tolerance : float
        The last round is the one that gains less than this share of the bending energy.
    most_rounds : int

    Returns
    -------
    SlidSemilandmarks
        Points are on their surfaces, and near the curves drawn through them at first. The result does not depend on the
        order, places, orientations and sizes of the specimens.

    Raises
    ------
    LandmarkError
        If there are fewer than two specimens, surfaces are missing, or a patch is on points.
    MemoryBudgetError
        If there are too many points.

    Notes
    -----
    Bookstein, *Landmark methods for forms without landmarks*, 1997; Gunz, Mitteroecker & Bookstein, *Semilandmarks in three
    dimensions*, 2005. A round takes the mean of a Procrustes analysis, finds the steps along tangents that minimise the
    energy, by conjugate gradients, and moves points back to curves and surfaces. A point whose normal would turn by more
    than a right angle takes a half or a quarter of its step, or none; a specimen that would bend more stays. One without
    a place moves freely, so that it does not count.

    20 m² bytes. With 7,500 points, a round takes 5 s and 1 s for each specimen.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> marks = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 0.0]])
    >>> other = marks + np.eye(5)[:, 4:] * [1, 0, 0]
    >>> slid_semilandmarks(np.stack([marks, other]), [square] * 2, patch=[4]).positions[:, 4].round(1)
    array([[2.5, 2. , 0. ],
           [2.5, 2. , 0. ]])
    """
    if len(surfaces) != len(positions) or len(positions) < 2:
        raise LandmarkError(
            f"{len(positions)} specimens with {len(surfaces)} surfaces; give two or more, each with its surface"
        )
    placed: BoolArray = np.asarray(np.isfinite(positions).all(axis=2))
    common = np.asarray(placed.all(axis=0), dtype=np.float64)
    first = now = _completed(positions, placed, common)
    sizes, rows = centroid_sizes(now)[:, None, None], np.array(patch, dtype=np.int64)
    given = list(zip(surfaces, now, placed))
    specimens = parallel_map(lambda each: _Specimen(*each, curves, rows), given)
    energies: list[FloatArray] = []
    with serial_blas():
        for _ in range(most_rounds):
            bending = BendingEnergy.of(generalised_procrustes(now, common, "remove").mean)
            steps = bending.least(now, np.stack([each.tangents() for each in specimens]))
            moved = parallel_map(lambda each: each[0].moved(each[1]), list(zip(specimens, steps)))
            before, after = (
                bending.of_each(each / sizes) for each in (now, np.stack([at for at, _ in moved]))
            )
            for specimen, own, is_better in zip(specimens, moved, after < before):
                if is_better:
                    specimen.positions, specimen.normals = own
            now = np.stack([each.positions for each in specimens])
            energies += [before, np.minimum(before, after)]
            if energies[-1].sum() >= (1 - tolerance) * before.sum():
                break
    apart = np.linalg.norm(now - first, axis=2) * placed
    return SlidSemilandmarks(np.where(placed[:, :, None], now, np.nan), apart, energies[0], energies[-1])


def _completed(positions: FloatArray, placed: BoolArray, common: FloatArray) -> FloatArray:
    """Put points without a place where the mean has them, after alignment by those that no specimen lacks."""
    known = np.where(placed[:, :, None], positions, 0.0)
    if placed.all():
        return known
    now = generalised_procrustes(known, common, "remove")
    mean = np.einsum("sm,smi->mi", placed, now.aligned) / np.maximum(placed.sum(axis=0), 1)[:, None]
    back = (mean - now.translations[:, None]) @ now.rotations / now.scales[:, None, None]
    return np.where(placed[:, :, None], positions, back)


@dataclass(frozen=True, eq=False)
class BendingEnergy:
    """Bending energy of the thin-plate splines that take values at m points, as a matrix, and its inverse."""

    affine: (
        FloatArray  # (m, 4) orthonormal; spans the constants and the coordinates. (m, 3) of points in a plane
    )
    factor: FloatArray  # (m, m) Cholesky factor of the inverse, below the diagonal
    inverse: FloatArray  # (m, m) in single precision

    @classmethod
    def of(cls, points: FloatArray) -> BendingEnergy:
        """Take the splines at points (m, 3), as if their centroid size were 1."""
        m = len(points)
        require_memory(20.0 * m**2, f"the bending energy of {m} points", "use fewer points")
        centred = points - points.mean(axis=0)
        centred /= np.linalg.norm(centred)
        # The spline Σ wᵢ |x − pᵢ| + affine has Qᵀw = 0 and the energy −wᵀKw, K = (|pᵢ − pⱼ|), where Q spans the affine
        # functions. With P = I − QQᵀ, w is the pseudoinverse of PKP times the values, so that the energy is of the matrix
        # B = (−PKP)⁺ = P (a QQᵀ − PKP)⁻¹ P. What is inverted is positive definite: −(K + QWᵀ + WQᵀ) with
        # W = Q (QᵀKQ − a I) / 2 − KQ.
        kernel = cdist(centred, centred)
        mean = kernel.mean()
        q = scipy.linalg.orth(np.column_stack([np.ones(m), centred]))
        w = q @ (q.T @ kernel @ q - AFFINE * m * mean * np.eye(q.shape[1])) / 2 - kernel @ q
        kernel += np.hstack([q, w]) @ np.hstack([w, q]).T
        np.negative(kernel, out=kernel)
        kernel.flat[:: m + 1] += RIDGE * mean
        inverse = kernel.astype(np.float32)
        factor = scipy.linalg.cholesky(kernel.T, lower=True, overwrite_a=True, check_finite=False)
        return cls(q, factor, inverse)

    def __matmul__(self, values: FloatArray) -> FloatArray:
        columns = values.reshape(len(values), -1)
        columns = columns - self.affine @ (self.affine.T @ columns)
        columns = scipy.linalg.cho_solve((self.factor, True), columns, check_finite=False)
        return np.asarray(columns - self.affine @ (self.affine.T @ columns)).reshape(values.shape)

    def of_each(self, shapes: FloatArray) -> FloatArray:
        """(s,) energy of the splines to each of the shapes (s, m, 3), summed over the coordinates."""
        values = shapes.transpose(1, 0, 2)
        return np.asarray(np.einsum("msi,msi->s", values, self @ values))

    def least(
        self, shapes: FloatArray, tangents: FloatArray, close: float = CLOSE, most: int = MOST_ITERATIONS
    ) -> FloatArray:
        """Find the steps (s, m, 3), each in the image of a projector (s, m, 3, 3), after which shapes bend least."""
        groups = [slice(start, start + AT_ONCE) for start in range(0, len(shapes), AT_ONCE)]
        parts = [(shapes[each], tangents[each], close, most) for each in groups]
        return np.concatenate(parallel_map(lambda part: self._least(*part), parts))

    def _least(self, shapes: FloatArray, tangents: FloatArray, close: float, most: int) -> FloatArray:
        # With the projectors U, the step t = Ut minimises (y + t)ᵀ B (y + t), so UBU t = −UBy. UB⁻¹U is a near inverse of
        # UBU: exact where B and U commute, as they nearly do for what varies faster than the normals.
        def tangential(values: FloatArray) -> FloatArray:
            return np.asarray(np.einsum("smij,msj->msi", tangents, values))

        def products(a: FloatArray, b: FloatArray) -> FloatArray:
            return np.asarray(np.maximum(np.einsum("msi,msi->s", a, b), np.finfo(float).tiny))[:, None]

        residual = -tangential(self @ shapes.transpose(1, 0, 2))
        step, direction, last = np.zeros_like(residual), np.zeros_like(residual), np.inf
        for iteration in range(most):
            flat = residual.reshape(len(residual), -1).astype(np.float32)
            nearly = tangential((self.inverse @ flat).astype(np.float64).reshape(residual.shape))
            size = products(residual, nearly)
            enough = enough if iteration else close**2 * size
            if (size <= enough).all():
                break
            direction = nearly + size / last * direction
            image = tangential(self @ direction)
            share = np.where(size > enough, size / products(direction, image), 0.0)
            step, residual, last = step + share * direction, residual - share * image, size
        return step.transpose(1, 0, 2)


class _Specimen:
    """Points on a surface, and the curves through some of them."""

    def __init__(
        self,
        surface: Mesh | PointCloud,
        positions: FloatArray,  # (m, 3)
        placed: BoolArray,
        curves: Sequence[Curve],
        patch: IntArray,
    ) -> None:
        if len(patch) and not (isinstance(surface, Mesh) and surface.n_faces):
            raise LandmarkError("a patch slides on triangles, and there are none; give meshes")
        self.surface, self.positions = surface, positions
        self._free, self._patch = ~placed, patch[placed[patch]]
        self._normals = np.zeros((surface.n_vertices, 3))
        if isinstance(surface, Mesh):
            self._normals = vertex_normals(surface.vertices, surface.faces)
        self.normals = self._normals_at(nearest_on_surface(surface, positions[self._patch]))
        self._tracks = []  # of each curve: points that slide, those before and after them, and the polyline
        for name, of, closed in curves:
            rows = np.array(of)
            if placed[rows].all() and len(rows) > 2:
                inner = rows[1:] if closed else rows[1:-1]
                after = np.append(rows, rows[0])[2 : 2 + len(inner)]
                path = drawn_curve(surface, positions[rows], closed, name)
                self._tracks.append((inner, rows[: len(inner)], after, path))

    def _normals_at(self, points: PrecisePoints) -> FloatArray:
        return _unit(points.interpolated(self._normals))

    def tangents(self) -> FloatArray:
        """(m, 3, 3) projectors onto the directions in which each point may move."""
        allowed = np.zeros((len(self.positions), 3, 3))
        for inner, before, after, _ in self._tracks:
            along = _unit(self.positions[after] - self.positions[before])
            allowed[inner] = along[:, :, None] * along[:, None]
        allowed[self._patch] = np.eye(3) - self.normals[:, :, None] * self.normals[:, None]
        allowed[self._free] = np.eye(3)
        return allowed

    def moved(self, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Move points by steps (m, 3) and back to curves and the surface; return their positions and normals."""
        after, normals, vertices = self.positions.copy(), self.normals.copy(), self.surface.vertices
        after[self._free] += steps[self._free]
        for inner, _, _, path in self._tracks:
            on_curve = _nearest_on_path(path, after[inner] + steps[inner])
            after[inner] = nearest_on_surface(self.surface, on_curve).interpolated(vertices)
        left = np.arange(len(self._patch))
        for share in SHARES:
            rows = self._patch[left]
            near = nearest_on_surface(self.surface, self.positions[rows] + share * steps[rows])
            there = self._normals_at(near)
            is_near = (there * normals[left]).sum(
                axis=1
            ) > 0  # not beyond an edge or on the other side of a wall
            after[rows[is_near]] = near.interpolated(vertices)[is_near]
            normals[left[is_near]], left = there[is_near], left[~is_near]
        return after, normals


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300))


def _nearest_on_path(path: FloatArray, points: FloatArray) -> FloatArray:
    """Points (k, 3) of a polyline (n, 3) nearest to given ones (k, 3)."""
    edges = np.diff(path, axis=0)
    lengths = np.maximum((edges**2).sum(axis=1), 1e-300)
    along = np.clip(((points[:, None] - path[:-1]) * edges).sum(axis=2) / lengths, 0.0, 1.0)
    near = path[:-1] + along[:, :, None] * edges  # (k, n − 1, 3)
    best = ((near - points[:, None]) ** 2).sum(axis=2).argmin(axis=1)
    return np.asarray(near[np.arange(len(points)), best])
