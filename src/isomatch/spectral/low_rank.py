"""Low-rank forms of the distance matrix from all, sampled, predicted or interpolated columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import eigsh
from scipy.spatial import KDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch._core.memory import require_memory
from isomatch._core.threads import parallel_map, serial_blas
from isomatch._core.ties import first_largest
from isomatch.geodesics import DistanceEngine, Sampling
from isomatch.spectral.basis import BasisMethod, fix_signs
from isomatch.spectral.distance_basis import MIN_EIGENVALUE_RATIO, DistanceBasis, orthonormalise
from isomatch.spectral.laplace_basis import LaplaceBasis, laplace_basis
from isomatch.spectral.laplacian import factorise, stiffness_and_masses
from isomatch.surfaces import Mesh, PointCloud, Surface

RIDGE_RATIO = 1e-9  # ridge of kriging over the mean variance, as samples might nearly coincide; chosen
# number of predicted columns per basis vector; twice as many lower the error of the basis by less than 1 %
NODES_PER_VECTOR = 12
MIN_NODES = 300  # least number of predicted columns, for a basis of few vectors; chosen
# areas of vertices are raised to this share of their mean, as tiny ones attract samples; chosen
MIN_AREA_RATIO = 1e-3
BLOCK_ROWS = 4096  # number of rows of predicted columns that a thread computes at once; chosen
# Weights μ, at surface area 1, of the squared errors at the samples, in `biharmonic_interpolant` and in
# `spectral_interpolant`. Above 1e4, the first function is practically exact at the samples. The second has a
# lower weight, because p functions that follow p values closely oscillate between the samples.
FIDELITY, SPECTRAL_FIDELITY = 1e6, 1e4


def nystrom_basis(sampling: Sampling, weights: FloatArray, rank: int, engine: str) -> DistanceBasis:
    """Build the basis of k vectors, orthonormal in the weights (n,), from the columns of p ≥ k samples.

    The method of Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, section "Computing
    the basis"; `match` uses it. O(n p k) time. ``engine`` is the name of the engine of the
    distances.
    """
    factors = nystrom_factors(sampling.columns, sampling.vertices, rank)
    return orthonormalise(*factors, weights, "nystrom", engine, sampling.vertices)


def nystrom_factors(columns: FloatArray, samples: IntArray, rank: int) -> tuple[FloatArray, FloatArray]:
    """Factors S (n, k) and T (k, k) of D ≈ S T Sᵀ from columns (p, n) of a symmetric matrix at the samples."""
    # Nyström: let C (n, p) be the columns of D at the samples and U (p, p) their rows at the
    # samples. If D is of rank p and its rows at the samples have full rank too, every other column
    # is a combination of C, and D = C U⁻¹ Cᵀ; otherwise this is an approximation that is exact on
    # the columns of the samples. With the eigenpairs U = V M Vᵀ,
    #   D ≈ C U⁺ Cᵀ = (C V) M⁻¹ (C V)ᵀ = S T Sᵀ,  S = C V,  T = M⁻¹.
    # Only the k eigenpairs of largest magnitude enter the pseudoinverse U⁺: the truncation
    # regularises, because the small ones are mostly discretisation error, which M⁻¹ would magnify.
    # D is indefinite, so that M has both signs.
    among = columns[:, samples]
    values, vectors = leading_eigenpairs((among + among.T) / 2, rank)
    return columns.T @ vectors, np.diag(1 / values)


def interpolated_factors(interpolant: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Factors S (n, 2 p) and T (2 p, 2 p) of D ≈ ½ (M F + Fᵀ Mᵀ) = S T Sᵀ, from M (n, p) and F (p, n)."""
    # The product M F, made symmetric, is S T Sᵀ with S = [M, Fᵀ] and T = ½ [[0, I], [I, 0]].
    p = len(columns)
    return np.hstack([interpolant, columns.T]), np.roll(np.eye(2 * p), p, axis=0) / 2


def exact_basis(engine: DistanceEngine, weights: FloatArray, rank: int) -> DistanceBasis:
    """Build the optimal basis of k vectors from all n distance columns; its ``samples`` are empty."""
    # Let A = diag(weights). In the norm ‖X‖²_A = ‖A^½ X A^½‖²_F, which weights d_ij by a_i a_j, the theorem
    # of Eckart & Young for the symmetric matrix A^½ D A^½ = V Λ Vᵀ gives the best approximation of rank k of
    # D from the k eigenvalues of largest magnitude: D ≈ Q Λ Qᵀ with Q = A^(−½) V, QᵀAQ = VᵀV = I. O(n² log n)
    # time for the distances and O(n² k) for the eigenpairs; 16 n² bytes.
    n = engine.n_points
    distances = all_distances(engine, 16.0, "the exact distance basis")
    root = np.sqrt(weights)
    operator = (distances + distances.T) * (0.5 * root[:, None]) * root
    if rank >= n - 1:  # eigsh finds at most n − 1 pairs
        values, vectors = np.linalg.eigh(operator)
    else:
        start = np.random.default_rng(0).standard_normal(n)
        values, vectors = eigsh(operator, rank, which="LM", v0=start)
    order = np.argsort(-np.abs(values), kind="stable")[:rank]
    basis = fix_signs(vectors[:, order] / root[:, None], weights)
    return DistanceBasis(basis, values[order], weights, "exact", engine.name, np.zeros(0, dtype=np.int64))


def all_distances(engine: DistanceEngine, bytes_per_pair: float, what: str) -> FloatArray:
    """Compute all n columns (n, n), if there is memory for what is made of them, and all are finite."""
    n = engine.n_points
    require_memory(bytes_per_pair * n * n, f"{what} of {n} points", "use another method, such as 'nystrom'")
    distances = engine.distances_from(np.arange(n))
    if not np.isfinite(distances).all():
        raise MeshError("some points cannot be reached from others; pass one connected component")
    return distances


def leading_eigenpairs(symmetric: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Compute at most ``count`` non-null eigenpairs of largest magnitude of a small matrix (m, m)."""
    values, vectors = np.linalg.eigh(symmetric)
    keep = np.argsort(-np.abs(values), kind="stable")[:count]
    keep = keep[np.abs(values[keep]) > MIN_EIGENVALUE_RATIO * np.abs(values).max()]
    return values[keep], vectors[:, keep]


@dataclass(frozen=True, eq=False)
class ColumnPredictor:
    """Distances between any two points, interpolated in both arguments from p measured columns."""

    # The matrix E = D^(3/2), taken entry by entry, is modelled as a sample of a normal distribution whose
    # rows and columns both have the covariance K. Given the columns of E at the samples S, the expectation of
    # another row is the combination M = K_·S K_SS⁻¹ of the rows at S (kriging), and likewise for columns.
    # Interpolated in both arguments,
    #   Ê = M E_S + E_Sᵀ Mᵀ − M E_SS Mᵀ,
    # the blending of Gordon and Coons. With P = M (·)_S, Ê = (P ⊗ 1 + 1 ⊗ P − P ⊗ P)
    # E = E − (1 − P) ⊗ (1 − P) E: the interpolation error acts twice, once in each argument. K is the mean of
    # the products of the measured columns plus the covariance (L + A)⁻¹ A (L + A)⁻¹ of smooth functions, with
    # the Laplacian L and the vertex areas A of the surface at area 1. The power 3/2 smooths the cone at
    # distance 0, which cannot be interpolated, without sharpening the ridges at the cut locus, as the square
    # would.
    interpolant: FloatArray  # M (n, p)
    half: FloatArray  # H = E_Sᵀ − ½ M E_SS (n, p), so that Ê = M Hᵀ + H Mᵀ
    unit: float  # the mean measured distance, by which D is divided

    @classmethod
    def fit(cls, surface: Surface, sampling: Sampling) -> ColumnPredictor:
        """Fit to the columns of p samples. O(n p²), a factorisation of the Laplacian, 40 n p bytes."""
        unit = float(sampling.columns.mean())
        powers = (sampling.columns / unit) ** 1.5
        samples, p = sampling.vertices, len(sampling.vertices)
        stiffness, masses = stiffness_and_masses(surface)
        masses /= masses.sum()
        solve = factorise(stiffness, masses)
        # K_·S: mean of products of measured columns, plus covariance of smooth functions, column by column
        covariance = powers.T @ (powers[:, samples] / p)  # (n, p) (p, p) -> (n, p)
        for a, sample in enumerate(samples):
            source = np.zeros(len(masses))
            source[sample] = 1.0
            covariance[:, a] += solve(masses * solve(source))
        among: FloatArray = covariance[samples]  # K_SS
        among[np.diag_indices(p)] += RIDGE_RATIO * among.trace() / p
        # M = K_·S K_SS⁻¹
        interpolant = cho_solve(cho_factor((among + among.T) / 2), covariance.T, overwrite_b=True).T
        among = powers[:, samples]  # E_SS
        half = powers.T - interpolant @ ((among + among.T) / 4)  # the mean of E_SS and its transpose, halved
        return cls(interpolant, half, unit)

    def distances(self, rows: IntArray | slice, columns: IntArray) -> FloatArray:
        """Predict distances from r points to c points, (r, c), in mesh units. O(r c p)."""
        left = np.hstack([self.interpolant[rows], self.half[rows]])
        # (M H) (H M)ᵀ = M Hᵀ + H Mᵀ: (r, 2 p) (2 p, c) -> (r, c)
        power = left @ np.hstack([self.half[columns], self.interpolant[columns]]).T
        return np.asarray(self.unit * np.cbrt(np.maximum(power, 0.0)) ** 2)


def predicted_basis(
    surface: Mesh | PointCloud, sampling: Sampling, weights: FloatArray, rank: int, engine: str
) -> DistanceBasis:
    """Build the basis by Nyström's method with r = 12 k columns predicted from p measured ones."""
    # The leading eigenfunctions of the operator Q ↦ D̂ A Q, with D̂ of `ColumnPredictor`, are
    # computed on r nodes, each with the weight of the vertices nearest to it (a quadrature of the
    # integral, Nyström's own method), extended to all vertices by D̂, and put in the form Q Λ Qᵀ by
    # one QR decomposition. O(n p (p + r)) time; D̂ is evaluated in blocks and never stored.
    with serial_blas():
        predictor = ColumnPredictor.fit(surface, sampling)
        gain = np.cbrt(density_of(surface, weights))
        n_nodes = max(NODES_PER_VECTOR * rank, MIN_NODES)
        nodes, node_weights = choose_nodes(surface.vertices, sampling.vertices, weights, gain, n_nodes)
        # W^½ D̂ W^½ v = λ v on the nodes, with their weights W. Extended to all vertices, Q = D̂
        # W^½ V Λ⁻¹ and Q Λ Qᵀ is S Λ⁻¹ Sᵀ with S = D̂ W^½ V, (n, rank).
        root = np.sqrt(node_weights)
        among = predictor.distances(nodes, nodes)
        values, vectors = leading_eigenpairs((among + among.T) / 2 * root * root[:, None], rank)
        mix = root[:, None] * vectors
        outer = np.zeros((len(weights), len(values)))

        def extend(first: int) -> None:
            rows = slice(first, first + BLOCK_ROWS)
            outer[rows] = predictor.distances(rows, nodes) @ mix

        parallel_map(extend, range(0, len(weights), BLOCK_ROWS))
    return orthonormalise(outer, np.diag(1 / values), weights, "predicted", engine, sampling.vertices)


def choose_nodes(
    points: FloatArray, samples: IntArray, weights: FloatArray, gain: FloatArray, n_nodes: int
) -> tuple[IntArray, FloatArray]:
    """Choose r quadrature nodes with weights: the p samples, then each farthest from all before it."""
    # The weight of a node is the sum of the weights of the vertices nearest to it. The distances of each
    # vertex are Euclidean, which is cheap and accurate enough to place nodes, and multiplied by its gain
    # (n,). O(n r).
    nodes = list(samples)
    nearest = KDTree(points[nodes]).query(points)[0] * gain
    while len(nodes) < min(n_nodes, len(points)):
        nodes.append(first_largest(nearest))
        distance = np.sqrt(((points - points[nodes[-1]]) ** 2).sum(axis=1))
        np.minimum(nearest, distance * gain, out=nearest)
    owner = KDTree(points[nodes]).query(points)[1]
    return np.array(nodes, dtype=np.int64), np.bincount(owner, weights, len(nodes)).astype(np.float64)


def density_of(surface: Surface, weights: FloatArray) -> FloatArray:
    """Weight per area at each vertex, (n,); areas are raised to at least 0.1 % of their mean."""
    area = surface.vertex_areas
    return np.asarray(weights / np.maximum(area, MIN_AREA_RATIO * area.mean()))


class DensityWeighted:
    """An engine for `farthest_point_sampling` whose samples are denser where weight per area is larger."""

    # The distance of each point to the nearest sample is multiplied by the cube root of its density ρ. With h
    # the spacing of the samples, a cell contributes ρ² h⁶ to the squared error of prediction, and there are
    # h⁻² cells per area. For a fixed number of cells, with a Lagrange multiplier μ, ∫ ρ² h⁴ + μ h⁻² is
    # stationary in h where 4 ρ² h³ = 2 μ h⁻³: the error is least for h ∝ ρ^(−1/3).
    def __init__(self, engine: DistanceEngine, density: FloatArray) -> None:
        self._engine = engine
        self._gain = np.cbrt(density)
        self.name = engine.name
        self.n_points = engine.n_points

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances of the engine, not multiplied."""
        return self._engine.distances_from(sources)

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower multiplied distances (n,) in place; return the unmultiplied column, if the engine has one."""
        unmultiplied = nearest / self._gain
        column = self._engine.lower(unmultiplied, source)
        np.multiply(unmultiplied, self._gain, out=nearest)
        return column


def interpolated_basis(
    surface: Surface, sampling: Sampling, weights: FloatArray, rank: int, method: BasisMethod, engine: str
) -> DistanceBasis:
    """Build the basis from rows of the distance matrix between the samples, by "fmds" or by "smds"."""
    if method == "fmds":
        interpolant = biharmonic_interpolant(surface, sampling.vertices)
    else:
        # A variant of Aflalo & Kimmel, *Spectral multidimensional scaling*, PNAS 2013, with the biharmonic
        # energy in place of the energy of that paper.
        laplace = laplace_basis(surface, len(sampling.vertices), weld=False)
        interpolant = laplace.vectors @ spectral_interpolant(laplace, sampling.vertices)
    factors = interpolated_factors(interpolant, sampling.columns)
    return orthonormalise(*factors, weights, method, engine, sampling.vertices).truncated(rank)


def biharmonic_interpolant(surface: Surface, samples: IntArray, fidelity: float = FIDELITY) -> FloatArray:
    """Compute the matrix M (n, p) that maps values at p samples to the smoothest function near them."""
    # Shamai, Zibulevsky & Kimmel, *Accelerating the computation of canonical forms for 3D nonrigid objects
    # using multidimensional scaling*, 3DOR 2015 (FMDS): the function u that minimises the biharmonic energy
    # plus μ times the squared difference to the values f at the samples, which the matrix B (p, n) selects,
    #   ‖A^(−½) L u‖² + μ ‖B u − f‖²,
    # has the gradient (L A⁻¹ L + μ BᵀB) u − μ Bᵀ f = 0, so that M = μ (L A⁻¹ L + μ BᵀB)⁻¹ Bᵀ. The
    # area is scaled to 1, so that μ has no unit.
    stiffness, masses = stiffness_and_masses(surface)
    masses /= masses.sum()
    diagonal = np.zeros(len(masses))  # the diagonal of μ BᵀB
    diagonal[samples] = fidelity
    solve = factorise(csc_array(stiffness @ diags_array(1 / masses) @ stiffness), diagonal)
    sources = np.zeros((len(masses), len(samples)))
    sources[samples, np.arange(len(samples))] = fidelity
    return solve(sources)


def spectral_interpolant(
    basis: LaplaceBasis, samples: IntArray, fidelity: float = SPECTRAL_FIDELITY
) -> FloatArray:
    """Compute the matrix (min(p, k), p) from p sampled values to coefficients of the smoothest function."""
    # The ``biharmonic_interpolant`` in the span of the first p of k eigenfunctions Φ at unit area: for u = Φ
    # c the biharmonic energy is ‖Λ c‖² and B u = Φ_S c, so that c = μ (Λ² + μ Φ_Sᵀ Φ_S)⁻¹ Φ_Sᵀ f.
    p, area = len(samples), basis.weights.sum()
    pull = fidelity * area * basis.vectors[samples, :p].T
    normal = np.diag((area * basis.values[:p]) ** 2) + pull @ basis.vectors[samples, :p]
    return np.asarray(cho_solve(cho_factor(normal), pull), dtype=np.float64)
