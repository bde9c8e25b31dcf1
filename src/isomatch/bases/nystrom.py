"""Bases from distance columns alone: from all of them (the optimum), or from some (Nyström)."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import eigsh

from isomatch.bases.distance_basis import NULL_VALUE, DistanceBasis, orthonormalised
from isomatch.bases.signs import fix_signs
from isomatch.errors import MeshError
from isomatch.geodesics import DistanceEngine, Sampling
from isomatch.runtime.memory import require_memory
from isomatch.values.arrays import FloatArray


def nystrom_basis(sampling: Sampling, weights: FloatArray, rank: int, engine: str) -> DistanceBasis:
    """Build the basis from the distance columns of p samples: D ≈ C U⁺ Cᵀ.

    Parameters
    ----------
    sampling : Sampling
        The p samples and their distances to all n points.
    weights : (n,) array of float
        Weights of the points, in which the basis is orthonormal.
    rank : int
        Number k of basis vectors, at most p.
    engine : str
        How the distances were computed.

    Returns
    -------
    DistanceBasis

    Notes
    -----
    C (n, p) holds the columns, U (p, p) the distances among the samples. Only the k eigenpairs of U of largest
    magnitude enter the pseudoinverse U⁺: the truncation regularises, since the small ones are mostly discretisation
    error. One QR decomposition then gives the form Q Λ Qᵀ. O(n p k) time. Shamai & Kimmel, *Geodesic Distance
    Descriptors*, CVPR 2017, section "Computing the basis"; `match` uses this basis.
    """
    columns, samples = sampling.columns, sampling.vertices
    among = columns[:, samples]
    values, vectors = leading_eigenpairs((among + among.T) / 2, rank)
    spread = columns.T @ vectors  # (n, p) (p, k) -> (n, k)
    return orthonormalised(spread, np.diag(1 / values), weights, "nystrom", engine, samples)


def exact_basis(engine: DistanceEngine, weights: FloatArray, rank: int) -> DistanceBasis:
    """Build the optimal basis of a given rank from all n distance columns.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of n points.
    weights : (n,) array of float
        Weights of the points, in which the basis is orthonormal.
    rank : int
        Number k of basis vectors, at most n.

    Returns
    -------
    DistanceBasis
        Its ``samples`` are empty.

    Raises
    ------
    MemoryBudgetError
        If the distance matrix would take more memory than allowed.
    MeshError
        If some points cannot be reached from others.

    Notes
    -----
    The k eigenpairs of A^½ D A^½ of largest magnitude, D symmetrised; optimal in the Frobenius norm with weights A by
    the theorem of Eckart & Young. O(n² log n) time for the distances and O(n² k) for the eigenpairs; 16 n² bytes.
    """
    n = engine.n_points
    require_memory(
        16.0 * n * n, f"the exact distance basis of {n} points", "use another method, such as 'nystrom'"
    )
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
