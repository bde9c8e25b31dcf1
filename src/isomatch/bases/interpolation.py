"""Bases from columns interpolated by smooth functions: FMDS and spectral MDS."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_array, diags_array

from isomatch.bases.distance_basis import DistanceBasis, orthonormalised
from isomatch.bases.laplace_basis import LaplaceBasis, laplace_basis
from isomatch.bases.laplacian import factorised, stiffness_and_masses
from isomatch.geodesics import Sampling
from isomatch.surfaces import Surface
from isomatch.values.arrays import FloatArray, IntArray

# μ at unit area
FIDELITY = 1e6  # above 1e4 the interpolant is practically exact at the samples
SPECTRAL_FIDELITY = 1e4  # lower: p functions that follow p values closely oscillate between the samples


def fmds_basis(
    surface: Surface,
    sampling: Sampling,
    weights: FloatArray,
    rank: int,
    engine: str,
    fidelity: float = FIDELITY,
) -> DistanceBasis:
    """Build the basis by interpolating the rows of the distance matrix from those at the samples: D ≈ ½ (M F + Fᵀ Mᵀ).

    Parameters
    ----------
    surface : Mesh, PointCloud or Graph
        The surface, n vertices.
    sampling : Sampling
        The p samples and their distance columns F (p, n).
    weights : (n,) array of float
        Weights of the points, in which the basis is orthonormal.
    rank : int
        Number of basis vectors, at most 2 p.
    engine : str
        How the distances were computed.
    fidelity : float
        μ of ``biharmonic_interpolant``, which computes M.

    Returns
    -------
    DistanceBasis

    Notes
    -----
    Shamai, Zibulevsky & Kimmel, *Accelerating the computation of canonical forms for 3D nonrigid objects using
    multidimensional scaling*, 3DOR 2015. O(n p) memory and a factorisation of the squared Laplacian.
    """
    interpolant = biharmonic_interpolant(surface, sampling.vertices, fidelity)
    return _symmetrised(interpolant, sampling, weights, rank, "fmds", engine)


def smds_basis(
    surface: Surface,
    sampling: Sampling,
    weights: FloatArray,
    rank: int,
    engine: str,
    fidelity: float = SPECTRAL_FIDELITY,
) -> DistanceBasis:
    """Build the basis as `fmds_basis` does, with interpolants in the span of the first p Laplace eigenfunctions.

    Parameters
    ----------
    surface, sampling, weights, rank, engine
        As for `fmds_basis`.
    fidelity : float
        μ of `spectral_interpolant`.

    Returns
    -------
    DistanceBasis

    Notes
    -----
    After Aflalo & Kimmel, *Spectral multidimensional scaling*, PNAS 2013, with the biharmonic energy in place of theirs.
    """
    basis = laplace_basis(surface, len(sampling.vertices), weld=False)
    interpolant = basis.vectors @ spectral_interpolant(basis, sampling.vertices, fidelity)
    return _symmetrised(interpolant, sampling, weights, rank, "smds", engine)


def biharmonic_interpolant(surface: Surface, samples: IntArray, fidelity: float = FIDELITY) -> FloatArray:
    """Compute the matrix M (n, p) that maps values at p samples to the smoothest function near them.

    M = μ (L A⁻¹ L + μ BᵀB)⁻¹ Bᵀ, with B the selection of the samples: M f minimises the biharmonic energy plus μ times
    the squared difference to f at the samples. The area is taken as 1, so that μ has no unit.
    """
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
    """Compute the matrix that maps values at p samples to coefficients of the smoothest function near them.

    μ (Λ² + μ Φ_SᵀΦ_S)⁻¹ Φ_Sᵀ, the ``biharmonic_interpolant`` in the span of eigenfunctions Φ at unit area.

    Parameters
    ----------
    basis : LaplaceBasis
        Φ and Λ; the first p functions are used, or all if there are fewer.
    samples : (p,) array of int
        Vertices.
    fidelity : float
        μ.

    Returns
    -------
    (min(p, k), p) array of float
        For a basis of k functions.
    """
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
