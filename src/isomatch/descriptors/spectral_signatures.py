"""Descriptors from the Laplace–Beltrami basis: wave and heat kernel signatures, and mean curvature."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.threads import row_product
from isomatch.repair import without_seams
from isomatch.spectral import LaplaceBasis
from isomatch.surfaces import Mesh

CLIPPED_SHARE = 0.02  # share of vertices with clipped curvature at either end: sharp tips are noisy; chosen


def wave_kernel_signature(
    basis: LaplaceBasis, n_energies: int = 100, bandwidth: float = 7.0, k: int | None = None
) -> FloatArray:
    """Wave kernel signature of every vertex.

    Parameters
    ----------
    basis : LaplaceBasis
        At least three functions; the constant one is not used.
    n_energies : int
        Energies, evenly spaced in the logarithm from the first to the last positive eigenvalue.
    bandwidth : float
        Standard deviation of the energy filter, in steps between energies.
    k : int, optional
        Use the first k functions only.

    Returns
    -------
    (n, n_energies) array of float
        Probability density of a particle of each energy at each vertex, in 1 / squared mesh units.

    Notes
    -----
    Aubry, Schlickewei & Cremers, *The Wave Kernel Signature*, ICCV Workshops 2011, equation 5: Σ_i
    g_e(λ_i) φ_i(x)², where the filter g_e is a normal distribution of log λ about the energy e,
    with sum 1. O(n k n_energies).

    Examples
    --------
    >>> from isomatch import Mesh, laplace_basis
    >>> roof = Mesh([[0, 0, 0], [2, 0, 0], [0, 3, 0], [2, 3, 0], [1, 1, 1]], [[0, 1, 4], [1, 3, 4], [3, 2, 4], [2, 0, 4]])
    >>> signature = wave_kernel_signature(laplace_basis(roof, k=5), n_energies=10)
    >>> signature.shape
    (5, 10)

    The corners 0 and 1 are symmetric; 0 and 2 are not.

    >>> bool(np.allclose(signature[0], signature[1])), bool(np.allclose(signature[0], signature[2]))
    (True, False)
    """
    filters = _wave_filters(basis.values[1:k], n_energies, bandwidth)
    return row_product(np.square(basis.vectors[:, 1:k]), filters)  # (n, k) (k, e) -> (n, e)


def wave_kernel_map(
    basis: LaplaceBasis, vertex: int, n_energies: int = 100, bandwidth: float = 7.0, k: int | None = None
) -> FloatArray:
    """Wave kernel between one vertex, such as a landmark, and all vertices, (n, n_energies).

    Parameters as for `wave_kernel_signature`. Ovsjanikov et al., *Functional Maps*, SIGGRAPH 2012,
    after the heat kernel map of Ovsjanikov, Mérigot, Mémoli & Guibas, *One Point Isometric Matching
    with the Heat Kernel*, SGP 2010.
    """
    # The signature of two points x, y at the energy e is Σ_i g_e(λ_i) φ_i(x) φ_i(y).
    filters = _wave_filters(basis.values[1:k], n_energies, bandwidth)
    return np.asarray(basis.vectors[:, 1:k] @ (basis.vectors[vertex, 1:k, None] * filters))


def _wave_filters(values: FloatArray, n_energies: int, bandwidth: float) -> FloatArray:
    """Compute normal distributions of the logarithms of positive eigenvalues, (k, e); columns sum to 1."""
    # Aubry et al. 2011, equation 5: a particle whose log energy is normally distributed about e is
    # at x with the probability density Σ_i g_e(λ_i) φ_i(x)², averaged over all time, as the phases
    # of different eigenvalues cancel; Σ_i g_e(λ_i) = 1. Perturbations of a shape change eigenvalues
    # by factors, hence the logarithm.
    logs = np.log(np.maximum(values, values[-1] * 1e-12))
    energies = np.linspace(logs[0], logs[-1], n_energies)
    sigma = bandwidth * (energies[1] - energies[0]) if n_energies > 1 else 1.0
    filters = np.exp(-0.5 * ((energies - logs[:, None]) / max(sigma, 1e-12)) ** 2)
    return np.asarray(filters / filters.sum(axis=0), dtype=np.float64)


def heat_kernel_signature(basis: LaplaceBasis, n_times: int = 100, k: int | None = None) -> FloatArray:
    """Heat kernel signature of every vertex.

    Parameters
    ----------
    basis : LaplaceBasis
        At least three functions.
    n_times : int
        Times, evenly spaced in the logarithm between 4 ln 10 / λ_k and 4 ln 10 / λ_2.
    k : int, optional
        Use the first k functions only.

    Returns
    -------
    (n, n_times) array of float
        Heat that remains at a vertex after each time, in 1 / squared mesh units; each column is
        divided by its integral over the surface, the heat trace.

    Notes
    -----
    Sun, Ovsjanikov & Guibas, *A Concise and Provably Informative Multi-Scale Signature*, SGP 2009:
    Σ_i exp(−λ_i t) φ_i(x)² / Σ_i exp(−λ_i t). O(n k n_times).

    Examples
    --------
    >>> from isomatch import Mesh, laplace_basis
    >>> roof = Mesh([[0, 0, 0], [2, 0, 0], [0, 3, 0], [2, 3, 0], [1, 1, 1]], [[0, 1, 4], [1, 3, 4], [3, 2, 4], [2, 0, 4]])
    >>> basis = laplace_basis(roof, k=5)
    >>> signature = heat_kernel_signature(basis, n_times=3)
    >>> basis.weights @ signature
    array([1., 1., 1.])
    """
    values, squares = basis.values[:k], basis.vectors[:, :k] ** 2
    # The heat kernel is k_t(x, x) = Σ_i exp(−λ_i t) φ_i(x)². At the first time exp(−λ t) is 10⁻⁴ for the last
    # eigenvalue, at the last time for the second eigenvalue. The kernel is divided by its integral, the heat
    # trace Σ_i exp(−λ_i t), so that all scales count alike.
    scale = 4 * np.log(10)
    times = np.geomspace(scale / values[-1], scale / values[1], n_times)
    decay = np.exp(-values[:, None] * times)  # decay of each function until each time, (k, n_times)
    return np.asarray(squares @ (decay / decay.sum(axis=0)))


def mean_curvature(mesh: Mesh, laplace: LaplaceBasis, k: int, *, weld: bool = True) -> FloatArray:
    """Signed mean curvature (n,) of a mesh smoothed to its first k Laplace eigenfunctions, in 1 / mesh units.

    It is positive where the surface bulges to the side to which its faces are wound, such as
    outward bumps of a closed mesh wound outward. Unlike the other descriptors it is extrinsic: it
    depends on the pose, but not on rigid motion. It is clipped to the 2 % and 98 % quantiles.

    Parameters
    ----------
    mesh : Mesh
        A mesh of n vertices.
    laplace : LaplaceBasis
        Its eigenfunctions Φ and eigenvalues Λ.
    k : int
        Number of eigenfunctions used; fewer give a smoother surface.
    weld : bool
        Whether vertices at exactly the same position are one point of the surface, as they were for
        ``laplace``.
    """
    # The mean curvature normal is −Δ V = 2 H N for the coordinates V of a surface (Meyer et al.,
    # *Discrete Differential-Geometry Operators for Triangulated 2-Manifolds*, 2003). With V_k = Φ_k
    # Φ_kᵀA V the low-passed coordinates (Vallet & Lévy, *Spectral Geometry Processing with Manifold
    # Harmonics*, 2008), −Δ V_k = Φ_k Λ_k Φ_kᵀA V, and with the normals N_k of the smooth surface H
    # = ½ ⟨−Δ V_k, N_k⟩; a sphere of radius r has H = 1 / r.
    coefficients = laplace.coefficients(mesh.vertices, k)
    basis = laplace.vectors[:, :k]
    smooth = row_product(basis, coefficients)
    welded, seams = without_seams(mesh, weld)
    normals = welded.moved(smooth[seams.vertex_index] if seams else smooth).vertex_normals
    normals = normals[seams.new_index] if seams else normals
    bending = row_product(basis, laplace.values[:k, None] * coefficients)  # −Δ of the coordinates
    curvature = 0.5 * np.einsum("ij,ij->i", bending, normals)
    low, high = np.quantile(curvature, [CLIPPED_SHARE, 1 - CLIPPED_SHARE])
    return np.asarray(np.clip(curvature, low, high), dtype=np.float64)


def standardised(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Shift and scale functions (n, q) to mean 0 and variance 1 in the weights (n,), (f − f̄) / σ.

    A function that is constant up to rounding, 1e-12 of the largest of all values, becomes 0.

    Examples
    --------
    >>> standardised(np.array([[1.0, 5.0], [3.0, 5.0]]), np.ones(2))
    array([[-1.,  0.],
           [ 1.,  0.]])
    """
    centred = values - np.average(values, axis=0, weights=weights)
    deviation = np.sqrt(np.average(centred**2, axis=0, weights=weights))
    scale = np.where(deviation > 1e-12 * np.abs(values).max(initial=0.0), deviation, np.inf)
    return np.asarray(centred / scale, dtype=np.float64)
