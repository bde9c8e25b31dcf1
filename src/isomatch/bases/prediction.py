"""Distance columns predicted from a few measured ones, and the basis made of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import KDTree

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map, serial_blas
from isomatch.bases.distance_basis import DistanceBasis, orthonormalised
from isomatch.bases.laplacian import Surface, factorised, laplacian
from isomatch.bases.nystrom import leading_eigenpairs
from isomatch.geodesics import DistanceEngine, Sampling

RIDGE = 1e-9  # of the mean variance; keeps nearly coincident samples from spoiling the solution
NODES_A_VECTOR = 12  # predicted columns for each vector of the basis; twice as many gain less than 1 %
FEWEST_NODES = 300
LEAST_AREA = 1e-3  # of the mean, below which a vertex attracts no more samples
BLOCK = 4096  # rows of predicted columns held at once


@dataclass(frozen=True, eq=False)
class ColumnPredictor:
    """Distances between any two points, interpolated in both arguments from p measured columns.

    The matrix E = D^(3/2), entry by entry, is taken for a draw of a normal distribution whose rows and columns both
    have the covariance K. Given the columns of E at the samples S, its expectation is

        Ê = M E_S + E_Sᵀ Mᵀ − M E_SS Mᵀ,   M = K_·S K_SS⁻¹,

    the blending of Gordon and Coons: its error is that of interpolating twice, once in each argument. K is the mean
    of the products of the measured columns, plus the covariance (L + A)⁻¹ A (L + A)⁻¹ of smooth functions, with the
    Laplacian L at unit area. The power 3/2 takes the edge off the cone at distance 0, which nothing interpolates,
    without sharpening the ridges at the cut locus as the square would.

    Parameters
    ----------
    interpolant : (n, p) array of float
        M.
    half : (n, p) array of float
        H = E_Sᵀ − ½ M E_SS, so that Ê = M Hᵀ + H Mᵀ.
    unit : float
        The mean distance, in which E is measured.
    """

    interpolant: FloatArray
    half: FloatArray
    unit: float

    @classmethod
    def fitted(cls, surface: Surface, sampling: Sampling) -> ColumnPredictor:
        """Fit to measured columns: O(n p²) time and a factorisation of the Laplacian; 40 n p bytes at most."""
        unit = float(sampling.columns.mean())
        powers = (sampling.columns / unit) ** 1.5
        samples, p = sampling.vertices, len(sampling.vertices)
        stiffness, masses = laplacian(surface)
        masses /= masses.sum()
        solve = factorised(stiffness, masses)
        covariance = powers.T @ (powers[:, samples] / p)  # (n, p) (p, p) -> (n, p)
        for a, sample in enumerate(samples):
            source = np.zeros(len(masses))
            source[sample] = 1.0
            covariance[:, a] += solve(masses * solve(source))
        among = covariance[samples]
        among[np.diag_indices(p)] += RIDGE * among.trace() / p
        interpolant = cho_solve(cho_factor((among + among.T) / 2), covariance.T, overwrite_b=True).T
        among = powers[:, samples]
        half = powers.T - interpolant @ ((among + among.T) / 4)
        return cls(interpolant, half, unit)

    def distances(self, rows: IntArray | slice, columns: IntArray) -> FloatArray:
        """Predicted distances from each of some points to each of others, (r, c), in mesh units. O(r c p)."""
        left = np.hstack([self.interpolant[rows], self.half[rows]])
        power = left @ np.hstack([self.half[columns], self.interpolant[columns]]).T
        predicted: FloatArray = self.unit * np.cbrt(np.maximum(power, 0.0)) ** 2
        return predicted


def predicted_basis(
    surface: Surface, sampling: Sampling, weights: FloatArray, k: int, engine: str
) -> DistanceBasis:
    """Build the basis from columns predicted at many more points than were measured.

    The leading eigenfunctions of Q ↦ D̂ A Q, D̂ of `ColumnPredictor`, are found on r nodes that stand for what is
    nearest to them, extended to all points by D̂ itself, and put in the form Q Λ Qᵀ by one QR decomposition: Nyström with
    r = 12 k columns of which p were measured. O(n p (p + r)) time; D̂ is evaluated in blocks and never held.
    """
    with serial_blas():
        predictor = ColumnPredictor.fitted(surface, sampling)
        gain = np.cbrt(density_of(surface, weights))
        n_nodes = max(NODES_A_VECTOR * k, FEWEST_NODES)
        nodes, shares = representative_points(surface.vertices, sampling.vertices, weights, gain, n_nodes)
        root = np.sqrt(shares)
        among = predictor.distances(nodes, nodes)
        values, vectors = leading_eigenpairs((among + among.T) / 2 * root * root[:, None], k)
        mix = root[:, None] * vectors
        n = len(weights)
        spread = np.zeros((n, len(values)))

        def extend(first: int) -> None:
            rows = slice(first, first + BLOCK)
            spread[rows] = predictor.distances(rows, nodes) @ mix

        parallel_map(extend, range(0, n, BLOCK))
    return orthonormalised(spread, np.diag(1 / values), weights, "predicted", engine, sampling.vertices)


def representative_points(
    points: FloatArray, samples: IntArray, weights: FloatArray, gain: FloatArray, n_nodes: int
) -> tuple[IntArray, FloatArray]:
    """Spread points (n, 3) in space, the samples first, and the weight of what is nearest to each.

    Farthest points as for the samples, but in straight distances, which cost next to nothing; they only place the
    nodes of a quadrature.
    """
    nodes = list(samples)
    nearest = KDTree(points[nodes]).query(points)[0] * gain
    while len(nodes) < min(n_nodes, len(points)):
        nodes.append(int(nearest.argmax()))
        apart = np.sqrt(((points - points[nodes[-1]]) ** 2).sum(axis=1))
        np.minimum(nearest, apart * gain, out=nearest)
    owner = KDTree(points[nodes]).query(points)[1]
    shares: FloatArray = np.bincount(owner, weights, len(nodes)).astype(np.float64)
    return np.array(nodes, dtype=np.int64), shares


def density_of(surface: Surface, weights: FloatArray) -> FloatArray:
    """Weight for each area at each point, (n,); vertices of hardly any area are taken for larger ones."""
    area = surface.vertex_areas
    density: FloatArray = weights / np.maximum(area, LEAST_AREA * area.mean())
    return density


class DensityWeighted:
    """An engine to whose farthest points distance counts by the cube root of the density of weight, (n,).

    With ρ the density and h the spacing, a cell contributes ρ² h⁶ to the squared error of prediction and there are
    h⁻² of them for each area; for a given number of cells, the sum is least for h ∝ ρ^(−1/3).
    """

    def __init__(self, engine: DistanceEngine, density: FloatArray) -> None:
        self._engine = engine
        self._gain = np.cbrt(density)
        self.name = engine.name
        self.n_points = engine.n_points

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances, as they are."""
        return self._engine.distances_from(sources)

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower weighted distances (n,) in place."""
        plain = nearest / self._gain
        column = self._engine.lower(plain, source)
        np.multiply(plain, self._gain, out=nearest)
        return column
