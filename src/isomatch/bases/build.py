"""From a surface to its distance basis: samples, columns, method, and how good it is."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import DTypeLike

from isomatch._arrays import FloatArray
from isomatch._threads import serial_blas
from isomatch.bases.distance_basis import DistanceBasis, Weighting, measure_of
from isomatch.bases.interpolation import fmds_basis, smds_basis
from isomatch.bases.laplacian import require_surface
from isomatch.bases.nystrom import exact_basis, nystrom_basis
from isomatch.bases.prediction import DensityWeighted, density_of, predicted_basis
from isomatch.errors import NotConvergedError, SettingError
from isomatch.geodesics import (
    DistanceEngine,
    MetricSpace,
    Sampling,
    distance_engine,
    farthest_point_sampling,
    peripheral_vertex,
)
from isomatch.surfaces import Mesh, PointCloud

BasisMethod = Literal["predicted", "nystrom", "fmds", "smds", "exact"]

FINEST_COLUMNS = 800  # tried for a tolerance


def distance_basis(
    surface: MetricSpace,
    k: int = 50,
    p: int = 100,
    method: BasisMethod | None = None,
    weights: Weighting = "area",
    seed: int = 0,
    engine: str | None = None,
    tolerance: float | None = None,
    dtype: DTypeLike = np.float64,
    held_out: int = 10,
) -> DistanceBasis:
    """Compute the geodesic distance basis of a surface.

    Parameters
    ----------
    surface : Mesh, PointCloud or other metric space
        What `distance_engine` takes, of one component and n points; every vertex of a mesh used by a face.
    k : int
        Rank; at most p.
    p : int
        Distance columns to compute, from farthest point samples; 2 k is a good choice. Ignored by "exact".
    method : {"predicted", "nystrom", "fmds", "smds", "exact"}, optional
        "predicted": Nyström with many more columns, predicted from the p that are measured; the nearest to the
        optimum and the default on meshes and point clouds, which have a Laplacian. "nystrom": from the p columns
        alone, the paper's choice and the default elsewhere. "fmds", "smds": interpolation by smooth functions.
        "exact": from all n columns, the optimum, for small n and as a reference.
    weights : {"area", "uniform"}
        What the basis is orthonormal in and what it approximates best: the surface, or its vertices. The same for
        a matrix or a function, which knows no areas.
    seed : int
        Draws where the sampling starts, and the held-out columns.
    engine : str, optional
        How distances are computed; see `distance_engine`.
    tolerance : float, optional
        Choose k and p instead: the first p of 50, 100, 200 … and the smallest k ≤ p / 2 whose estimated error is
        no larger.
    dtype : float64 or float32
        Precision of the stored vectors.
    held_out : int
        Columns computed besides the p only to estimate the error; see `DistanceBasis.error_estimate`.

    Returns
    -------
    DistanceBasis

    Raises
    ------
    SettingError
        If a setting is not one of those above, or k is not in 1…p.
    MeshError
        If the surface has several components, or fewer vertices than samples.
    MemoryBudgetError
        If the exact basis would need more memory than allowed.
    NotConvergedError
        If the tolerance is not reached with 800 columns.

    Notes
    -----
    Shamai & Kimmel, Geodesic Distance Descriptors, CVPR 2017, section "Computing the basis". The columns take
    O(p n log n) time; "nystrom" adds O(n p k) and 8 n p bytes, "predicted" O(n p (p + 12 k)), a factorisation of
    the Laplacian and 40 n p bytes. Errors of all methods are in ``docs/benchmarks.md``.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), -1).reshape(-1, 2)
    >>> quad = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    >>> faces = np.concatenate([quad[:, None] + [0, 1, 7], quad[:, None] + [0, 7, 6]])
    >>> basis = distance_basis(Mesh(np.pad(grid, ((0, 0), (0, 1))), faces), k=20, p=30)
    >>> bool(abs(basis.distance(0, 35) - 5 * 2**0.5) < 0.05)
    True
    >>> bool(basis.error_estimate() < 0.05)
    True
    """
    if method is None:
        method = "predicted" if isinstance(surface, Mesh | PointCloud) else "nystrom"
    if method not in get_args(BasisMethod):
        raise SettingError(f"method = {method!r} is not one of {', '.join(map(repr, get_args(BasisMethod)))}")
    if k < 1 or (method != "exact" and k > p):
        raise SettingError(f"k = {k} must lie in 1…p = {p}: the rank cannot exceed the number of columns")
    if np.dtype(dtype) not in (np.float32, np.float64):
        raise SettingError(f"dtype = {np.dtype(dtype)} is not float32 or float64")
    with serial_blas():
        distances = distance_engine(surface, engine)
        measure = measure_of(surface, weights, distances.n_points)
        start = peripheral_vertex(surface, distances, seed)
        if tolerance is not None:
            basis = _within(tolerance, surface, distances, start, method, measure, seed, max(held_out, 10))
        else:
            basis = _basis(surface, distances, start, method, measure, k, p)
            basis = _checked(basis, distances, seed, held_out)
    return basis.astype(dtype)


def _basis(
    surface: MetricSpace,
    engine: DistanceEngine,
    start: int,
    method: BasisMethod,
    measure: FloatArray,
    k: int,
    p: int,
) -> DistanceBasis:
    """Build the basis by one method."""
    if method == "exact":
        return exact_basis(engine, measure, k)
    if method == "nystrom":
        return nystrom_basis(farthest_point_sampling(engine, p, start), measure, k, engine.name)
    body = require_surface(surface)
    if method == "predicted":
        denser = DensityWeighted(engine, density_of(body, measure))
        return predicted_basis(body, farthest_point_sampling(denser, p, start), measure, k, engine.name)
    interpolated = fmds_basis if method == "fmds" else smds_basis
    return interpolated(body, farthest_point_sampling(engine, p, start), measure, k, engine.name)


def _checked(basis: DistanceBasis, engine: DistanceEngine, seed: int, n_columns: int) -> DistanceBasis:
    """Add columns that took no part, drawn with probability ∝ weight; where all did, any."""
    share = basis.weights.copy()
    if len(basis.samples) + n_columns <= len(share):
        share[basis.samples] = 0.0
    if n_columns < 1:
        return basis
    rng = np.random.default_rng([seed, 1])
    drawn = rng.choice(len(share), min(n_columns, len(share)), replace=False, p=share / share.sum())
    columns = engine.distances_from(drawn)
    return replace(basis, held_out=Sampling(drawn, columns))


def _within(
    tolerance: float,
    surface: MetricSpace,
    engine: DistanceEngine,
    start: int,
    method: BasisMethod,
    measure: FloatArray,
    seed: int,
    held_out: int,
) -> DistanceBasis:
    """Double the columns until the estimated error is small enough, then drop vectors that are not needed."""
    if not tolerance > 0:
        raise SettingError(f"tolerance = {tolerance} is not a positive relative error")
    n, p, best = engine.n_points, 25, np.inf
    while p < min(FINEST_COLUMNS, n):
        p = min(2 * p, n)
        basis = _basis(surface, engine, start, method, measure, max(p // 2, 1), p)
        basis = _checked(basis, engine, seed, held_out)
        errors = basis.error_estimates()
        if errors.min() <= tolerance:
            return basis.truncated(int((errors <= tolerance).argmax()) + 1)
        best = min(best, float(errors.min()))
    raise NotConvergedError(
        f"the estimated error is {best:.2%} with {p} columns, not {tolerance:.2%}: distances of the engine "
        "are not exact themselves; allow a larger tolerance"
    )
