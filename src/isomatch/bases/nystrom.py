"""Bases from distance columns alone: from all of them, the optimum, or from some (Nyström)."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import eigsh

from isomatch._arrays import FloatArray
from isomatch._memory import require_memory
from isomatch.bases.distance_basis import NULL_VALUE, DistanceBasis, orthonormalised
from isomatch.bases.signs import fix_signs
from isomatch.errors import MeshError
from isomatch.geodesics import DistanceEngine, Sampling


def nystrom_basis(sampling: Sampling, weights: FloatArray, k: int, engine: str) -> DistanceBasis:
    """Build the basis from the columns C (n × p) of p samples: D ≈ C U⁺ Cᵀ with U the distances among the samples.

    Only the k eigenpairs of U of largest magnitude enter U⁺: the truncation is the regulariser, since the small ones
    are mostly discretisation error. Then D ≈ S T Sᵀ is put in the form Q Λ Qᵀ by one QR decomposition.
    """
    columns, samples = sampling.columns, sampling.vertices
    among = columns[:, samples]
    values, vectors = leading_eigenpairs((among + among.T) / 2, k)
    spread = columns.T @ vectors  # (n, p) (p, k) -> (n, k)
    return orthonormalised(spread, np.diag(1 / values), weights, "nystrom", engine, samples)


def exact_basis(engine: DistanceEngine, weights: FloatArray, k: int) -> DistanceBasis:
    """Build the optimal basis of rank k, from all n columns: O(n² log n) time, 16 n² bytes."""
    n = engine.n_points
    require_memory(
        16.0 * n * n, f"the exact distance basis of {n} points", "use another method, such as 'nystrom'"
    )
    distances = engine.distances_from(np.arange(n))
    if not np.isfinite(distances).all():
        raise MeshError("some points cannot be reached from others; pass one connected component")
    root = np.sqrt(weights)
    weighted = (distances + distances.T) * (0.5 * root[:, None]) * root
    if k >= n - 1:
        values, vectors = np.linalg.eigh(weighted)
    else:
        start = np.random.default_rng(0).standard_normal(n)
        values, vectors = eigsh(weighted, k, which="LM", v0=start)
    order = np.argsort(-np.abs(values), kind="stable")[:k]
    basis = fix_signs(vectors[:, order] / root[:, None], weights)
    return DistanceBasis(basis, values[order], weights, "exact", engine.name, np.zeros(0, dtype=np.int64))


def leading_eigenpairs(symmetric: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
    """Eigenpairs of largest magnitude of a small matrix, at most k of them and none that is null."""
    values, vectors = np.linalg.eigh(symmetric)
    keep = np.argsort(-np.abs(values), kind="stable")[:k]
    keep = keep[np.abs(values[keep]) > NULL_VALUE * np.abs(values).max()]
    return values[keep], vectors[:, keep]
