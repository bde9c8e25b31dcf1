"""Low-rank forms of the distance matrix from columns: from all, by Nyström, from predicted columns, by interpolation."""

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
from isomatch.spectral.basis import fix_signs
from isomatch.spectral.distance_basis import NULL_VALUE, DistanceBasis, orthonormalised
from isomatch.spectral.laplace_basis import LaplaceBasis, laplace_basis
from isomatch.spectral.laplacian import factorised, stiffness_and_masses
from isomatch.surfaces import Mesh, PointCloud, Surface

RIDGE = 1e-9  # of the mean variance; keeps the system well conditioned when samples nearly coincide
NODES_PER_VECTOR = 12  # predicted columns per basis vector; twice as many lower the error by less than 1 %
FEWEST_NODES = 300
LEAST_AREA = 1e-3  # of the mean; smaller vertex areas count as this, so that they do not attract samples
BLOCK = 4096  # rows of predicted columns held at a time
# μ at unit area
FIDELITY = 1e6  # above 1e4 the interpolant is practically exact at the samples
SPECTRAL_FIDELITY = 1e4  # lower: p functions that follow p values closely oscillate between the samples


def nystrom_basis(sampling: Sampling, weights: FloatArray, rank: int, engine: str) -> DistanceBasis:
    """Build the basis of k vectors from the distance columns of p ≥ k samples, orthonormal in the weights (n,).

    The method of Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, section "Computing the basis"; `match`
    uses it. O(n p k) time. ``engine`` says how the distances were computed.
    """
    # Nyström: let C (n, p) be the columns of D at the samples and U (p, p) their rows at the samples. If D is of rank p
    # and its rows at the samples have full rank too, every other column is a combination of C, and D = C U⁻¹ Cᵀ;
    # otherwise this is an approximation that is exact on the columns of the samples. With the eigenpairs U = V M Vᵀ,
    #   D ≈ C U⁺ Cᵀ = (C V) M⁻¹ (C V)ᵀ = S T Sᵀ,  S = C V,  T = M⁻¹.
    # Only the k eigenpairs of largest magnitude enter the pseudoinverse U⁺: the truncation regularises, since the small
    # ones are mostly discretisation error, which M⁻¹ would magnify. D is indefinite, so that M has both signs.
    columns, samples = sampling.columns, sampling.vertices
    among = columns[:, samples]
    values, vectors = leading_eigenpairs((among + among.T) / 2, rank)
    spread = columns.T @ vectors  # (n, p) (p, k) -> (n, k)
    return orthonormalised(spread, np.diag(1 / values), weights, "nystrom", engine, samples)


def exact_basis(engine: DistanceEngine, weights: FloatArray, rank: int) -> DistanceBasis:
    """Build the optimal basis of k vectors from all n distance columns; its ``samples`` are empty."""
    # Let A = diag(weights). In the norm ‖X‖²_A = ‖A^½ X A^½‖²_F, which weighs d_ij by a_i a_j, the best approximation
    # of rank k of D is, by the theorem of Eckart & Young for the symmetric matrix A^½ D A^½ = V Λ Vᵀ, that of the k
    # eigenvalues of largest magnitude: D ≈ Q Λ Qᵀ with Q = A^(−½) V, QᵀAQ = VᵀV = I. O(n² log n) time for the distances
    # and O(n² k) for the eigenpairs; 16 n² bytes.
    n = engine.n_points
    remedy = "use another method, such as 'nystrom'"
    require_memory(16.0 * n * n, f"the exact distance basis of {n} points", remedy)
    distances = engine.distances_from(np.arange(n))
    if not np.isfinite(distances).all():
        raise MeshError("some points cannot be reached from others; pass one connected component")
    root = np.sqrt(weights)
    weighted = (distances + distances.T) * (0.5 * root[:, None]) * root
    if rank >= n - 1:  # too many for eigsh
        values, vectors = np.linalg.eigh(weighted)
    else:
        start = np.random.default_rng(0).standard_normal(n)
        values, vectors = eigsh(weighted, rank, which="LM", v0=start)
    order = np.argsort(-np.abs(values), kind="stable")[:rank]
    basis = fix_signs(vectors[:, order] / root[:, None], weights)
    return DistanceBasis(basis, values[order], weights, "exact", engine.name, np.zeros(0, dtype=np.int64))


def leading_eigenpairs(symmetric: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Eigenpairs of largest magnitude of a small matrix (m, m): at most ``count`` of them, and none that is null."""
    values, vectors = np.linalg.eigh(symmetric)
    keep = np.argsort(-np.abs(values), kind="stable")[:count]
    keep = keep[np.abs(values[keep]) > NULL_VALUE * np.abs(values).max()]
    return values[keep], vectors[:, keep]


@dataclass(frozen=True, eq=False)
class ColumnPredictor:
    """Distances between any two points, interpolated in both arguments from p measured columns."""

    # The matrix E = D^(3/2), taken entry by entry, is modelled as a sample of a normal distribution whose rows and
    # columns both have the covariance K. Given the columns of E at the samples S, the expectation of a row elsewhere is
    # the combination M = K_·S K_SS⁻¹ of the rows at S (kriging), and so for columns. Interpolated in both arguments,
    #   Ê = M E_S + E_Sᵀ Mᵀ − M E_SS Mᵀ,
    # the blending of Gordon and Coons: with P = M (·)_S, it is (P ⊗ 1 + 1 ⊗ P − P ⊗ P) E = E − (1 − P) ⊗ (1 − P) E, so
    # that the error is the interpolation error applied twice, once in each argument. K is the mean of the products of
    # the measured columns plus the covariance (L + A)⁻¹ A (L + A)⁻¹ of smooth functions, with the Laplacian L at unit
    # area. The power 3/2 smooths the cone at distance 0, which cannot be interpolated, without sharpening the ridges at
    # the cut locus, as the square would.
    interpolant: FloatArray  # (n, p) M
    half: FloatArray  # (n, p) H = E_Sᵀ − ½ M E_SS, so that Ê = M Hᵀ + H Mᵀ
    unit: float  # the mean distance, in which E is measured

    @classmethod
    def fitted(cls, surface: Surface, sampling: Sampling) -> ColumnPredictor:
        """Fit to the columns of p samples: O(n p²) time and a factorisation of the Laplacian; at most 40 n p bytes."""
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
        return np.asarray(self.unit * np.cbrt(np.maximum(power, 0.0)) ** 2)


def predicted_basis(
    surface: Mesh | PointCloud, sampling: Sampling, weights: FloatArray, rank: int, engine: str
) -> DistanceBasis:
    """Build the basis by Nyström's method with r = 12 k columns predicted at many more points than were measured."""
    # The leading eigenfunctions of the operator Q ↦ D̂ A Q, with D̂ of `ColumnPredictor`, are computed on r nodes, each
    # with the weight of the vertices nearest to it (a quadrature of the integral, Nyström's own method), extended to
    # all vertices by D̂, and put in the form Q Λ Qᵀ by one QR decomposition. O(n p (p + r)) time; D̂ is evaluated in
    # blocks and never stored.
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
    """Choose r nodes of a quadrature, the p samples first and each further one farthest from all, and their weights."""
    # The weight of a node is that of the vertices nearest to it. Distances are Euclidean, times the gain (n,) of each
    # vertex: cheap, and accurate enough to place the nodes. O(n r).
    nodes = list(samples)
    nearest = KDTree(points[nodes]).query(points)[0] * gain
    while len(nodes) < min(n_nodes, len(points)):
        nodes.append(first_largest(nearest))
        apart = np.sqrt(((points - points[nodes[-1]]) ** 2).sum(axis=1))
        np.minimum(nearest, apart * gain, out=nearest)
    owner = KDTree(points[nodes]).query(points)[1]
    shares: FloatArray = np.bincount(owner, weights, len(nodes)).astype(np.float64)
    return np.array(nodes, dtype=np.int64), shares


def density_of(surface: Surface, weights: FloatArray) -> FloatArray:
    """Weight per area at each vertex, (n,); areas below 0.1 % of the mean count as that."""
    area = surface.vertex_areas
    return np.asarray(weights / np.maximum(area, LEAST_AREA * area.mean()))


class DensityWeighted:
    """An engine for `farthest_point_sampling` whose samples are denser where the weight per area (n,) is larger."""

    # Distances to the nearest sample are multiplied by the cube root of the density ρ at each point. With h the spacing
    # of the samples, a cell contributes ρ² h⁶ to the squared error of prediction, and there are h⁻² cells per area. For
    # a given number of cells, ∫ ρ² h⁴ + μ h⁻² is stationary in h where 4 ρ² h³ = 2 μ h⁻³: the error is least for h ∝
    # ρ^(−1/3).
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


def fmds_basis(
    surface: Surface, sampling: Sampling, weights: FloatArray, rank: int, engine: str
) -> DistanceBasis:
    """Build the basis by interpolating the rows of the distance matrix from those at the samples: D ≈ ½ (M F + Fᵀ Mᵀ)."""
    interpolant = biharmonic_interpolant(surface, sampling.vertices)
    return _symmetrised(interpolant, sampling, weights, rank, "fmds", engine)


def smds_basis(
    surface: Surface, sampling: Sampling, weights: FloatArray, rank: int, engine: str
) -> DistanceBasis:
    """Build the basis as ``fmds_basis`` does, with interpolants in the span of the first p Laplace eigenfunctions."""
    # after Aflalo & Kimmel, *Spectral multidimensional scaling*, PNAS 2013, with the biharmonic energy in place of theirs
    basis = laplace_basis(surface, len(sampling.vertices), weld=False)
    interpolant = basis.vectors @ spectral_interpolant(basis, sampling.vertices)
    return _symmetrised(interpolant, sampling, weights, rank, "smds", engine)


def biharmonic_interpolant(surface: Surface, samples: IntArray, fidelity: float = FIDELITY) -> FloatArray:
    """Compute the matrix M (n, p) that maps values at p samples to the smoothest function near them."""
    # Shamai, Zibulevsky & Kimmel, *Accelerating the computation of canonical forms for 3D nonrigid objects using
    # multidimensional scaling*, 3DOR 2015 (FMDS): the function u that minimises the biharmonic energy plus μ times the
    # squared difference to the values f at the samples, with B (p, n) their selection,
    #   ‖A^(−½) L u‖² + μ ‖B u − f‖²,
    # has the gradient (L A⁻¹ L + μ BᵀB) u − μ Bᵀ f = 0, so that M = μ (L A⁻¹ L + μ BᵀB)⁻¹ Bᵀ. The area is taken as 1,
    # so that μ has no unit.
    stiffness, masses = stiffness_and_masses(surface)
    masses /= masses.sum()
    selected = np.zeros(len(masses))
    selected[samples] = fidelity
    solve = factorised(csc_array(stiffness @ diags_array(1 / masses) @ stiffness), selected)
    sources = np.zeros((len(masses), len(samples)))
    sources[samples, np.arange(len(samples))] = fidelity
    return solve(sources)


def spectral_interpolant(
    basis: LaplaceBasis, samples: IntArray, fidelity: float = SPECTRAL_FIDELITY
) -> FloatArray:
    """Compute the matrix (min(p, k), p) from values at p samples to coefficients of the smoothest function near them."""
    # The ``biharmonic_interpolant`` in the span of the first p of k eigenfunctions Φ at unit area: for u = Φ c the
    # biharmonic energy is ‖Λ c‖² and B u = Φ_S c, so that c = μ (Λ² + μ Φ_Sᵀ Φ_S)⁻¹ Φ_Sᵀ f
    p, area = len(samples), basis.weights.sum()
    pull = fidelity * area * basis.vectors[samples, :p].T
    normal = np.diag((area * basis.values[:p]) ** 2) + pull @ basis.vectors[samples, :p]
    return np.asarray(cho_solve(cho_factor(normal), pull), dtype=np.float64)


def swapped(p: int) -> FloatArray:
    """T = ½ [[0, I], [I, 0]], (2 p, 2 p), so that [X, Y] T [X, Y]ᵀ = ½ (X Yᵀ + Y Xᵀ)."""
    return np.roll(np.eye(2 * p), p, axis=0) / 2


def _symmetrised(
    interpolant: FloatArray, sampling: Sampling, weights: FloatArray, rank: int, method: str, engine: str
) -> DistanceBasis:
    """½ (M F + Fᵀ Mᵀ) = S T Sᵀ with S = [M, Fᵀ]."""
    middle = swapped(len(sampling.vertices))
    spread = np.hstack([interpolant, sampling.columns.T])
    return orthonormalised(spread, middle, weights, method, engine, sampling.vertices).truncated(rank)
