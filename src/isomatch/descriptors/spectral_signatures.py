"""Wave and heat kernel signatures: intrinsic descriptors of the vertices from the Laplace–Beltrami basis."""

from __future__ import annotations

import numpy as np

from isomatch.bases import LaplaceBasis
from isomatch.runtime.threads import row_product
from isomatch.values.arrays import FloatArray


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
        Probability density of a particle of that energy at each vertex, in 1 / squared mesh units.

    Notes
    -----
    Aubry, Schlickewei & Cremers, *The Wave Kernel Signature*, ICCV Workshops 2011, equation 5: Σ_i g_e(λ_i) φ_i(x)², with
    the filter g_e a normal distribution of log λ about the energy e, of sum 1. O(n k n_energies).

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
    signature: FloatArray = row_product(np.square(basis.vectors[:, 1:k]), filters)  # (n, k) (k, e) -> (n, e)
    return signature


def wave_kernel_map(
    basis: LaplaceBasis, vertex: int, n_energies: int = 100, bandwidth: float = 7.0, k: int | None = None
) -> FloatArray:
    """Wave kernel between one vertex, such as a landmark, and all vertices.

    Parameters
    ----------
    basis, n_energies, bandwidth, k
        As for `wave_kernel_signature`.
    vertex : int
        The vertex.

    Returns
    -------
    (n, n_energies) array of float
        Σ g_e(λ_i) φ_i(x) φ_i(y), with g_e the filter of energy e; its value at the vertex itself is the wave kernel
        signature there.

    Notes
    -----
    Ovsjanikov et al., *Functional Maps*, SIGGRAPH 2012, after the heat kernel map of Ovsjanikov, Mérigot,
    Mémoli & Guibas, *One Point Isometric Matching with the Heat Kernel*, SGP 2010. O(n k n_energies).
    """
    filters = _wave_filters(basis.values[1:k], n_energies, bandwidth)
    kernel: FloatArray = basis.vectors[:, 1:k] @ (basis.vectors[vertex, 1:k, None] * filters)
    return kernel


def _wave_filters(values: FloatArray, n_energies: int, bandwidth: float) -> FloatArray:
    """Compute normal distributions over the logarithms of positive eigenvalues, (k, n_energies); columns sum to 1."""
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
        Heat that remains at a vertex after each time, in 1 / squared mesh units; each column is divided by its integral
        over the surface, the heat trace.

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
    scale = 4 * np.log(10)
    times = np.geomspace(scale / values[-1], scale / values[1], n_times)
    decay = np.exp(-values[:, None] * times)  # (k, t)
    signature: FloatArray = squares @ (decay / decay.sum(axis=0))
    return signature
