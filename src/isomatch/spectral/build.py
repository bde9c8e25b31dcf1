"""Build the distance basis of a surface: samples, distance columns, method, and an estimate of the error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import DTypeLike

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import NotConvergedError, SettingError
from isomatch._core.settings import generator, require_one_of
from isomatch._core.threads import in_background, serial_blas
from isomatch.geodesics import (
    DistanceEngine,
    MetricSpace,
    Sampling,
    farthest_point_sampling,
    metric_space,
    peripheral_vertex,
)
from isomatch.io import SurfaceLike
from isomatch.repair import Repair, without_seams
from isomatch.spectral.basis import BasisMethod, Weighting, basis_domain, shared_weights
from isomatch.spectral.distance_basis import DistanceBasis
from isomatch.spectral.laplacian import require_mesh_or_points
from isomatch.spectral.low_rank import (
    DensityWeighted,
    density_of,
    exact_basis,
    interpolated_basis,
    nystrom_basis,
    predicted_basis,
)
from isomatch.surfaces import Mesh, PointCloud

MAX_COLUMNS = 800  # distance columns with which a tolerance must be reached, or an error is raised; chosen


def distance_basis(
    surface: MetricSpace | SurfaceLike,
    k: int = 50,
    p: int = 100,
    method: BasisMethod | None = None,
    weights: Weighting = "area",
    seed: int = 0,
    engine: str | None = None,
    tolerance: float | None = None,
    dtype: DTypeLike = np.float64,
    held_out: int = 10,
    *,
    weld: bool = True,
) -> DistanceBasis:
    """Compute the geodesic distance basis of a surface.

    Parameters
    ----------
    surface : Mesh, PointCloud or other metric space
        Anything that `distance_engine` takes, of one component and n points; every vertex of a mesh
        belongs to a face.
    k : int
        Rank, at most p.
    p : int
        Number of distance columns, from farthest point samples; 2 k is a good choice. Ignored by
        "exact".
    method : {"predicted", "nystrom", "fmds", "smds", "exact"}, optional
        "predicted", the default on meshes and point clouds: Nyström's method with many more
        columns, predicted from the p measured ones. "nystrom", the default on everything else: from
        the p columns alone. "fmds", "smds": interpolated by smooth functions, all or the span of p
        Laplace eigenfunctions. "exact": from all n columns; the optimum, for small n and as a
        reference.
    weights : {"area", "uniform"}
        Inner product in which the basis is orthonormal and the error is least: by area, or with all
        vertices alike. No difference for a matrix or a function, which have no areas.
    seed : int
        Draws the start of the sampling and the held-out columns.
    engine : str, optional
        How distances are computed, one of ``engine_names(type(surface))``; by default the first of
        them.
    tolerance : float, optional
        Largest estimated relative error. It chooses the first p of 50, 100, 200, … 800 that
        suffices, and then the smallest k ≤ p / 2; the arguments k and p are ignored.
    dtype : float64 or float32
        Precision of the stored vectors.
    held_out : int
        Number of further columns, computed only to estimate the error; see
        `DistanceBasis.error_estimate`.
    weld : bool
        Whether vertices of a mesh at exactly the same position are one point of the surface; they
        share its weight.

    Returns
    -------
    DistanceBasis

    Raises
    ------
    SettingError
        If a setting is not one of those above, or k is not in 1…p.
    MeshError
        If the surface has several components or fewer vertices than samples, or a vertex has no
        area.
    MissingDependencyError
        If the engine needs an extra that is not installed.
    MemoryBudgetError
        If the exact basis would need more memory than allowed.
    NotConvergedError
        If the tolerance is not reached with 800 columns.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, section "Computing the basis",
    which is "nystrom". `match` uses it, with k = 50 and p = 100 columns by default (see `Config`).
    The default here is "predicted", because it is nearer to the optimum for a given number of
    columns: a relative error of 0.0071 instead of 0.0084 on the wolf of ``docs/dev/lab/benchmarks.md``,
    at k = 50 and p = 100. It takes longer: in the same time, "nystrom" with more columns can be
    better.

    The columns take O(p n log n) time; "nystrom" adds O(n p k) and 8 n p bytes, "predicted" O(n p
    (p + 12 k)), a factorisation of the Laplacian and 40 n p bytes.

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
    surface, seams = without_seams(metric_space(surface), weld)
    if method is None:
        method = "predicted" if isinstance(surface, Mesh | PointCloud) else "nystrom"
    require_one_of("method", method, BasisMethod)
    if k < 1 or (method != "exact" and k > p):
        raise SettingError(f"k = {k} must lie in 1…p = {p}: the rank cannot exceed the number of columns")
    if np.dtype(dtype) not in (np.float32, np.float64):
        raise SettingError(f"dtype = {np.dtype(dtype)} is not float32 or float64")

    def compute() -> DistanceBasis:
        with serial_blas():
            n_columns = p if tolerance is None and method != "exact" else 1
            distances, measure = basis_domain(surface, weights, engine, n_columns)
            start = peripheral_vertex(surface, distances, seed)
            build = partial(_build_basis, surface, distances, start, method, measure)
            if tolerance is not None:
                return _build_within(tolerance, build, distances, seed, max(held_out, 10))
            return _with_held_out(build(k, p), distances, seed, held_out)

    basis = in_background(compute)
    return (_unwelded(basis, seams) if seams else basis).astype(dtype)


def _unwelded(basis: DistanceBasis, seams: Repair) -> DistanceBasis:
    """Carry the basis of a welded mesh to the vertices of the user."""
    point, vertex, held_out = seams.new_index, seams.vertex_index, basis.held_out
    return replace(
        basis,
        vectors=basis.vectors[point],
        weights=shared_weights(basis.weights, point),
        samples=vertex[basis.samples],
        held_out=held_out and Sampling(vertex[held_out.vertices], held_out.columns[:, point]),
        notes=seams.changes,
    )


def _build_basis(
    surface: MetricSpace,
    engine: DistanceEngine,
    start: int,
    method: BasisMethod,
    measure: FloatArray,
    rank: int,
    n_columns: int,
) -> DistanceBasis:
    """Build the basis by one method."""
    if method == "exact":
        return exact_basis(engine, measure, rank)
    if method == "nystrom":
        return nystrom_basis(farthest_point_sampling(engine, n_columns, start), measure, rank, engine.name)
    shape = require_mesh_or_points(surface)
    if method == "predicted":
        dense_engine = DensityWeighted(engine, density_of(shape, measure))
        sampling = farthest_point_sampling(dense_engine, n_columns, start)
        return predicted_basis(shape, sampling, measure, rank, engine.name)
    sampling = farthest_point_sampling(engine, n_columns, start)
    return interpolated_basis(shape, sampling, measure, rank, method, engine.name)


def _with_held_out(basis: DistanceBasis, engine: DistanceEngine, seed: int, count: int) -> DistanceBasis:
    """Add columns that were not used, drawn with probability ∝ weight; used columns if too few are left."""
    if count < 1:
        return basis
    share = basis.weights.copy()
    if len(basis.samples) + count <= len(share):
        share[basis.samples] = 0.0
    count = min(count, len(share))
    vertices = generator(seed, 1).choice(len(share), count, replace=False, p=share / share.sum())
    return replace(basis, held_out=Sampling(vertices, engine.distances_from(vertices)))


def _build_within(
    tolerance: float,
    build: Callable[[int, int], DistanceBasis],
    engine: DistanceEngine,
    seed: int,
    count: int,
) -> DistanceBasis:
    """Double the number of columns until the error is small enough, then drop vectors not needed."""
    if not tolerance > 0:
        raise SettingError(f"tolerance = {tolerance} is not a positive relative error")
    n, n_columns, best = engine.n_points, 25, np.inf
    while n_columns < min(MAX_COLUMNS, n):
        n_columns = min(2 * n_columns, n)
        basis = _with_held_out(build(max(n_columns // 2, 1), n_columns), engine, seed, count)
        errors = basis.error_estimates()
        if errors.min() <= tolerance:
            return basis.truncated(int((errors <= tolerance).argmax()) + 1)
        best = min(best, float(errors.min()))
    raise NotConvergedError(
        f"the estimated error is {best:.2%} with {n_columns} columns, not {tolerance:.2%}: the distances of the "
        "engine have errors of their own; allow a larger tolerance"
    )
