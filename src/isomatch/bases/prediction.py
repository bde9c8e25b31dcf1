"""Distance columns predicted from a few measured ones, and the basis built from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import KDTree

from isomatch.bases.distance_basis import DistanceBasis, orthonormalised
from isomatch.bases.laplacian import factorised, stiffness_and_masses
from isomatch.bases.nystrom import leading_eigenpairs
from isomatch.geodesics import DistanceEngine, Sampling
from isomatch.runtime.threads import parallel_map, serial_blas
from isomatch.surfaces import Mesh, PointCloud, Surface
from isomatch.values.arrays import FloatArray, IntArray

RIDGE = 1e-9  # of the mean variance; keeps the system well conditioned when samples nearly coincide
NODES_PER_VECTOR = 12  # predicted columns per basis vector; twice as many lower the error by less than 1 %
FEWEST_NODES = 300
LEAST_AREA = 1e-3  # of the mean; smaller vertex areas count as this, so that they do not attract samples
BLOCK = 4096  # rows of predicted columns held at a time


@dataclass(frozen=True, eq=False)
class ColumnPredictor:
    """Distances between any two points, interpolated in both arguments from p measured columns.

    The matrix E = D^(3/2), taken entry by entry, is modelled as a sample of a normal distribution whose rows and columns
    both have the covariance K. Given the columns of E at the samples S, its expectation is ::

        Ê = M E_S + E_Sᵀ Mᵀ − M E_SS Mᵀ,   M = K_·S K_SS⁻¹,

    which is the blending of Gordon and Coons: its error is the interpolation error applied twice, once in each argument.
    K is the mean of the products of the measured columns plus the covariance (L + A)⁻¹ A (L + A)⁻¹ of smooth functions,
    with the Laplacian L at unit area. The power 3/2 smooths the cone at distance 0, which cannot be interpolated,
    without sharpening the ridges at the cut locus, as the square would.

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
        """Fit to the measured columns of p samples.

        O(n p²) time and a factorisation of the Laplacian; at most 40 n p bytes.
        """
        unit = float(sampling.columns.mean())
        powers = (sampling.columns / unit) ** 1.5
        samples, p = sampling.vertices, len(sampling.vertices)
        stiffness, masses = stiffness_and_masses(surface)
        masses /= masses.sum()
        solve = factorised(stiffness, masses)
        # K_·S: the mean of products of measured columns, then the covariance of smooth functions, column by column
        covariance = powers.T @ (powers[:, samples] / p)  # (n, p) (p, p) -> (n, p)
        for a, sample in enumerate(samples):
            source = np.zeros(len(masses))
            source[sample] = 1.0
            covariance[:, a] += solve(masses * solve(source))
        among: FloatArray = covariance[samples]  # K_SS
        among[np.diag_indices(p)] += RIDGE * among.trace() / p
        # M = K_·S K_SS⁻¹
        interpolant = cho_solve(cho_factor((among + among.T) / 2), covariance.T, overwrite_b=True).T
        among = powers[:, samples]  # E_SS
        half = powers.T - interpolant @ ((among + among.T) / 4)  # the mean of E_SS and its transpose, halved
        return cls(interpolant, half, unit)

    def distances(self, rows: IntArray | slice, columns: IntArray) -> FloatArray:
        """Predicted distances from r points to c others, (r, c), in mesh units. O(r c p)."""
        left = np.hstack([self.interpolant[rows], self.half[rows]])
        # (M H) (H M)ᵀ = M Hᵀ + H Mᵀ: (r, 2 p) (2 p, c) -> (r, c)
        power = left @ np.hstack([self.half[columns], self.interpolant[columns]]).T
        predicted: FloatArray = self.unit * np.cbrt(np.maximum(power, 0.0)) ** 2
        return predicted


def predicted_basis(
    surface: Mesh | PointCloud, sampling: Sampling, weights: FloatArray, rank: int, engine: str
) -> DistanceBasis:
    """Build the basis from columns predicted at many more points than were measured.

    Parameters
    ----------
    surface : Mesh or PointCloud
        The surface, n vertices.
    sampling : Sampling
        The p samples and their distances to all vertices.
    weights : (n,) array of float
        Weights of the vertices, in which the basis is orthonormal.
    rank : int
        Number k of basis vectors.
    engine : str
        How the distances were computed.

    Returns
    -------
    DistanceBasis

    Notes
    -----
    Nyström's method with r = 12 k predicted columns in place of p measured ones. The leading eigenfunctions of
    Q ↦ D̂ A Q, with D̂ of `ColumnPredictor`, are computed on r nodes, each with the weight of the vertices nearest to it,
    extended to all vertices by D̂, and put in the form Q Λ Qᵀ by one QR decomposition. O(n p (p + r)) time; D̂ is
    evaluated in blocks and never stored.
    """
    with serial_blas():
        predictor = ColumnPredictor.fitted(surface, sampling)
        gain = np.cbrt(density_of(surface, weights))
        n_nodes = max(NODES_PER_VECTOR * rank, FEWEST_NODES)
        nodes, shares = representative_points(surface.vertices, sampling.vertices, weights, gain, n_nodes)
        # W^½ D̂ W^½ v = λ v on the nodes, with their weights W. Extended to all vertices, Q = D̂ W^½ V Λ⁻¹ and Q Λ Qᵀ is
        # S Λ⁻¹ Sᵀ with S = D̂ W^½ V, (n, rank)
        root = np.sqrt(shares)
        among = predictor.distances(nodes, nodes)
        values, vectors = leading_eigenpairs((among + among.T) / 2 * root * root[:, None], rank)
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
    """Choose the nodes of a quadrature and their weights.

    Parameters
    ----------
    points : (n, 3) array of float
        Coordinates of the vertices.
    samples : (p,) array of int
        Vertices that are nodes in any case.
    weights : (n,) array of float
        Weights of the vertices.
    gain : (n,) array of float
        Factors by which the distances of the vertices to the nodes are multiplied.
    n_nodes : int
        Number of nodes, at most n.

    Returns
    -------
    nodes : (r,) array of int
        Vertices, the samples first; each further one is farthest from all before it.
    shares : (r,) array of float
        Total weight of the vertices nearest to each node.

    Notes
    -----
    Distances are Euclidean, which are cheap and accurate enough to place the nodes. O(n r).
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
    """Weight per area at each vertex, (n,); areas below 0.1 % of the mean count as that."""
    area = surface.vertex_areas
    density: FloatArray = weights / np.maximum(area, LEAST_AREA * area.mean())
    return density


class DensityWeighted:
    """An engine for `farthest_point_sampling` whose samples are denser where the weight per area is larger.

    Distances to the nearest sample are multiplied by the cube root of the density ρ at each point. With h the spacing of
    the samples, a cell contributes ρ² h⁶ to the squared error of prediction, and there are h⁻² cells per area; for a
    given number of cells, the sum is least for h ∝ ρ^(−1/3).

    Parameters
    ----------
    engine : DistanceEngine
        Distances of n points.
    density : (n,) array of float
        Positive weights per area.
    """

    def __init__(self, engine: DistanceEngine, density: FloatArray) -> None:
        self._engine = engine
        self._gain = np.cbrt(density)
        self.name = engine.name
        self.n_points = engine.n_points

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances of the engine, not multiplied."""
        return self._engine.distances_from(sources)

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower multiplied distances (n,) in place; return the column of the engine, not multiplied, if it gives one."""
        plain = nearest / self._gain
        column = self._engine.lower(plain, source)
        np.multiply(plain, self._gain, out=nearest)
        return column
