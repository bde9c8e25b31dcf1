"""The geodesic distance basis: all pairwise distances of a surface in n × k numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import qr
from scipy.sparse.linalg import eigsh

from isomatch._arrays import FloatArray, IntArray
from isomatch._memory import require_memory
from isomatch.bases.signs import fix_signs
from isomatch.errors import MeshError, SettingError
from isomatch.geodesics import (
    DistanceEngine,
    Sampling,
    distance_engine,
    farthest_point_sampling,
    peripheral_vertex,
)
from isomatch.surfaces import Mesh

BasisMethod = Literal["nystrom", "exact"]
Weighting = Literal["area", "uniform"]

NULL_VALUE = 1e-12  # eigenvalues below this share of the largest carry no distance


@dataclass(frozen=True, eq=False, repr=False)
class DistanceBasis:
    """A low-rank form D ≈ Q Λ Qᵀ of the matrix of all geodesic distances.

    Parameters
    ----------
    vectors : (n, k) array of float
        Q, orthonormal in the weights: QᵀAQ = I.
    values : (k,) array of float
        Λ, decreasing in magnitude, of either sign.
    weights : (n,) array of float
        The diagonal of A: vertex areas in squared mesh units, or ones.
    method, engine : str
        How the basis and the distances were computed.
    samples : (p,) array of int
        Vertices whose distance columns were used; empty for the exact basis.
    """

    vectors: FloatArray
    values: FloatArray
    weights: FloatArray
    method: str
    engine: str
    samples: IntArray

    def __repr__(self) -> str:
        n, k = self.vectors.shape
        return (
            f"DistanceBasis({n} points, rank {k}, {self.method}, {len(self.samples)} columns, {self.engine})"
        )

    @property
    def rank(self) -> int:
        """Number of basis vectors."""
        return len(self.values)

    def distance(self, i: ArrayLike, j: ArrayLike) -> FloatArray:
        """Approximate distances of pairs, in mesh units; ``i`` and ``j`` broadcast. O(k) a pair."""
        left = self.vectors[np.asarray(i)] * self.values
        pairs: FloatArray = np.einsum("...k,...k->...", left, self.vectors[np.asarray(j)])
        return pairs

    def between(self, rows: ArrayLike, columns: ArrayLike) -> FloatArray:
        """Approximate distances from each of some vertices to each of others, (r, c), in mesh units. O(r c k)."""
        block: FloatArray = (self.vectors[np.asarray(rows)] * self.values) @ self.vectors[np.asarray(columns)].T
        return block

    def row(self, i: ArrayLike) -> FloatArray:
        """Approximate distances from vertex (or vertices) i to all, (..., n), in mesh units. O(n k)."""
        distances: FloatArray = (self.vectors[np.asarray(i)] * self.values) @ self.vectors.T
        return distances

    def __matmul__(self, values: ArrayLike) -> FloatArray:
        """Product of the distance matrix with an (n,) or (n, q) array. O(n k q)."""
        x = np.asarray(values, dtype=np.float64)
        product: FloatArray = self.vectors @ ((self.values * (self.vectors.T @ x).T).T)
        return product

    def truncated(self, k: int) -> DistanceBasis:
        """Return the first k vectors: the best rank-k form of this one."""
        return DistanceBasis(
            self.vectors[:, :k], self.values[:k], self.weights, self.method, self.engine, self.samples
        )


def distance_basis(
    surface: Mesh,
    k: int = 50,
    p: int = 100,
    method: BasisMethod = "nystrom",
    weights: Weighting = "area",
    seed: int = 0,
) -> DistanceBasis:
    """Compute the geodesic distance basis of a surface.

    Parameters
    ----------
    surface : Mesh
        One component of n vertices, every vertex used by a face.
    k : int
        Rank; at most p.
    p : int
        Distance columns to compute, from farthest point samples; 2 k is a good choice. Ignored by "exact".
    method : {"nystrom", "exact"}
        From p columns, or from all n of them (the optimum, for small n and as a reference).
    weights : {"area", "uniform"}
        What the basis is orthonormal in and what its truncation is best for: the surface, or its vertices.
    seed : int
        Draws where the sampling starts.

    Returns
    -------
    DistanceBasis

    Raises
    ------
    MeshError
        If the surface has several components, or fewer vertices than samples.
    MemoryBudgetError
        If the exact basis would need more memory than allowed.

    Notes
    -----
    Shamai & Kimmel, Geodesic Distance Descriptors, CVPR 2017, section "Computing the basis". Nyström takes O(p n log n)
    for the columns and O(n p k) for the basis; 8 n p bytes.

    Examples
    --------
    >>> grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), -1).reshape(-1, 2)
    >>> quad = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    >>> faces = np.concatenate([quad[:, None] + [0, 1, 7], quad[:, None] + [0, 7, 6]])
    >>> basis = distance_basis(Mesh(np.pad(grid, ((0, 0), (0, 1))), faces), k=20, p=30)
    >>> bool(abs(basis.distance(0, 35) - 5 * 2**0.5) < 0.05)
    True
    """
    for name, value, allowed in (
        ("method", method, ("nystrom", "exact")),
        ("weights", weights, ("area", "uniform")),
    ):
        if value not in allowed:
            raise SettingError(f"{name} = {value!r} is not one of {', '.join(map(repr, allowed))}")
    if k < 1 or (method == "nystrom" and k > p):
        raise SettingError(f"k = {k} must lie in 1…p = {p}: the rank cannot exceed the number of columns")
    area = surface.vertex_areas
    if weights == "area" and not (area > 0).all():
        raise MeshError(
            f"{int((area <= 0).sum())} vertices have no area, so an area-weighted basis is undefined there; "
            "call repair(mesh), or use weights='uniform'"
        )
    engine = distance_engine(surface)
    measure = area if weights == "area" else np.ones(surface.n_vertices)
    if method == "exact":
        return exact_basis(engine, measure, k)
    sampling = farthest_point_sampling(engine, p, peripheral_vertex(surface, engine, seed))
    return nystrom_basis(sampling, measure, k, engine.name)


def nystrom_basis(sampling: Sampling, weights: FloatArray, k: int, engine: str) -> DistanceBasis:
    """Build the basis from the columns C (n × p) of p samples: D ≈ C U⁺ Cᵀ with U the distances among the samples.

    Only the k eigenpairs of U of largest magnitude enter U⁺: the truncation is the regulariser, since the small ones
    are mostly discretisation error. Then D ≈ S T Sᵀ is put in the form Q Λ Qᵀ by one QR decomposition.
    """
    columns, samples = sampling.columns, sampling.vertices
    among = columns[:, samples]
    values, vectors = np.linalg.eigh((among + among.T) / 2)
    keep = np.argsort(-np.abs(values), kind="stable")[:k]
    keep = keep[np.abs(values[keep]) > NULL_VALUE * np.abs(values).max()]
    spread = columns.T @ vectors[:, keep]  # (n, p) (p, k) -> (n, k)
    return orthonormalised(spread, np.diag(1 / values[keep]), weights, "nystrom", engine, samples)


def exact_basis(engine: DistanceEngine, weights: FloatArray, k: int) -> DistanceBasis:
    """Build the optimal basis of rank k, from all n columns: O(n² log n) time, 16 n² bytes."""
    n = engine.n_points
    require_memory(16.0 * n * n, f"the exact distance basis of {n} points", "use method='nystrom'")
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


def orthonormalised(
    spread: FloatArray, middle: FloatArray, weights: FloatArray, method: str, engine: str, samples: IntArray
) -> DistanceBasis:
    """Put D ≈ S T Sᵀ in the form Q Λ Qᵀ with QᵀAQ = I: QR of A^½ S, then the eigenpairs of R T Rᵀ."""
    root = np.sqrt(weights)[:, None]
    q, r = qr(root * spread, mode="economic", check_finite=True)
    inner = r @ middle @ r.T
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    order = np.argsort(-np.abs(values), kind="stable")
    order = order[np.abs(values[order]) > NULL_VALUE * np.abs(values).max()]
    basis = fix_signs(q @ vectors[:, order] / root, weights)
    return DistanceBasis(basis, values[order], weights, method, engine, samples)
