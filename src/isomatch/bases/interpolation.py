"""Bases from columns interpolated by the smoothest functions: FMDS and spectral MDS."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_array, diags_array

from isomatch._arrays import FloatArray, IntArray
from isomatch.bases.distance_basis import DistanceBasis, orthonormalised
from isomatch.bases.laplace_basis import LaplaceBasis, laplace_basis
from isomatch.bases.laplacian import Surface, factorised, laplacian
from isomatch.geodesics import Sampling

FIDELITY = 1e6  # μ at unit area; above 1e4 the interpolation is as good as hard
SPECTRAL_FIDELITY = (
    1e4  # as many functions as samples cannot follow the values closely without swinging between them
)


def fmds_basis(
    surface: Surface,
    sampling: Sampling,
    weights: FloatArray,
    k: int,
    engine: str,
    fidelity: float = FIDELITY,
) -> DistanceBasis:
    """Interpolate the rows of the distance matrix from those at the samples: D ≈ ½ (M F + Fᵀ Mᵀ).

    F holds the p measured columns and M = μ (L A⁻¹ L + μ BᵀB)⁻¹ Bᵀ, with B the selection of the samples, gives the
    function of least biharmonic energy near given values at the samples. μ is in units of a surface of area 1.

    Notes
    -----
    Shamai, Zibulevsky & Kimmel, *Accelerating the computation of canonical forms for 3D nonrigid objects using
    multidimensional scaling*, 3DOR 2015. O(n p) memory and a factorisation of the squared Laplacian.
    """
    interpolant = biharmonic_interpolant(surface, sampling.vertices, fidelity)
    return _symmetrised(interpolant, sampling, weights, k, "fmds", engine)


def smds_basis(
    surface: Surface,
    sampling: Sampling,
    weights: FloatArray,
    k: int,
    engine: str,
    fidelity: float = SPECTRAL_FIDELITY,
) -> DistanceBasis:
    """Do the same as `fmds_basis` in the span of the first p Laplace eigenfunctions.

    With D's columns in the span of Φ, the energy is least for M = Φ μ (Λ² + μ Φ_SᵀΦ_S)⁻¹ Φ_Sᵀ.

    Notes
    -----
    After Aflalo & Kimmel, *Spectral multidimensional scaling*, PNAS 2013, with the biharmonic energy in place of theirs.
    """
    basis = laplace_basis(surface, len(sampling.vertices))
    interpolant = basis.vectors @ spectral_interpolant(basis, sampling.vertices, fidelity)
    return _symmetrised(interpolant, sampling, weights, k, "smds", engine)


def biharmonic_interpolant(surface: Surface, samples: IntArray, fidelity: float = FIDELITY) -> FloatArray:
    """M (n, p): values at the p samples to the function of least biharmonic energy that is near them."""
    stiffness, masses = laplacian(surface)
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
    """Give the same in the span of p functions Φ, as coefficients (p, p): μ (Λ² + μ Φ_SᵀΦ_S)⁻¹ Φ_Sᵀ at unit area.

    A basis of fewer than p functions is used as it is, of more to p.
    """
    k, area = len(samples), basis.weights.sum()
    pull = fidelity * area * basis.vectors[samples, :k].T
    normal = np.diag((area * basis.values[:k]) ** 2) + pull @ basis.vectors[samples, :k]
    return np.asarray(cho_solve(cho_factor(normal), pull), dtype=np.float64)


def swapped(p: int) -> FloatArray:
    """T = ½ [[0, I], [I, 0]], (2 p, 2 p), so that [X, Y] T [X, Y]ᵀ = ½ (X Yᵀ + Y Xᵀ)."""
    return np.roll(np.eye(2 * p), p, axis=0) / 2


def _symmetrised(
    interpolant: FloatArray, sampling: Sampling, weights: FloatArray, k: int, method: str, engine: str
) -> DistanceBasis:
    """½ (M F + Fᵀ Mᵀ) = S T Sᵀ with S = [M, Fᵀ]."""
    middle = swapped(len(sampling.vertices))
    spread = np.hstack([interpolant, sampling.columns.T])
    return orthonormalised(spread, middle, weights, method, engine, sampling.vertices).truncated(k)
