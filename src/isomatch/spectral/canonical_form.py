"""Canonical forms: points in Euclidean space whose distances approximate geodesic distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh
from scipy.spatial.distance import cdist

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import SettingError
from isomatch._core.settings import require_one_of
from isomatch._core.threads import serial_blas
from isomatch.geodesics import MetricSpace, Sampling, farthest_point_sampling, metric_space, peripheral_vertex
from isomatch.io import SurfaceLike
from isomatch.repair import without_seams
from isomatch.spectral.basis import Weighting, basis_domain
from isomatch.spectral.distance_basis import orthonormalise
from isomatch.spectral.laplacian import require_mesh_or_points
from isomatch.spectral.low_rank import (
    all_distances,
    biharmonic_interpolant,
    interpolated_factors,
    nystrom_factors,
)

EmbeddingMethod = Literal["nystrom", "exact", "fmds"]


@dataclass(frozen=True, eq=False)
class CanonicalForm:
    """A surface embedded in a Euclidean space.

    Parameters
    ----------
    points : (n, dim) array of float
        Coordinates in mesh units, centred, axes in decreasing order of extent; only distances
        between points have a meaning.
    values : (dim,) array of float
        Eigenvalues of −½ J D² J for the axes, decreasing.
    stress : float
        √(Σ w_i (‖x_i − x_j‖ − d_ij)² / Σ w_i d_ij²), summed over the measured columns j and all i:
        the part of the distances that a Euclidean space of this dimension cannot reproduce.
    notes : tuple of str
        Number of vertices that were welded.

    Examples
    --------
    A flat square is its own canonical form. The four corners of a tetrahedron are equally far from
    each other, which no four points of the plane are.

    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> flat = canonical_form(square, dim=2, method="exact")
    >>> float(np.linalg.norm(flat.points[0] - flat.points[2]).round(3)), round(flat.stress, 3)
    (1.414, 0.0)
    >>> tetrahedron = Mesh(np.eye(4)[:, :3], [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    >>> canonical_form(tetrahedron, dim=2, method="exact").stress > 0.1
    True
    """

    points: FloatArray
    values: FloatArray
    stress: float
    notes: tuple[str, ...] = ()


def canonical_form(
    surface: MetricSpace | SurfaceLike,
    dim: int = 3,
    method: EmbeddingMethod = "nystrom",
    p: int = 100,
    weights: Weighting = "area",
    seed: int = 0,
    engine: str | None = None,
    *,
    weld: bool = True,
) -> CanonicalForm:
    """Embed a surface by classical scaling of its geodesic distances, so that poses of one body look alike.

    Parameters
    ----------
    surface : Mesh, PointCloud or other metric space
        Anything that `distance_engine` takes, of one component and n points; "fmds" needs a mesh or
        a point cloud.
    dim : int
        Dimension of the space.
    method : {"nystrom", "exact", "fmds"}
        From p columns of squared distances, by Nyström's method or by smooth interpolation, or from
        all n.
    p : int
        Number of distance columns; ignored by "exact".
    weights : {"area", "uniform"}
        Whether points count by area or all alike for the centre and the axes.
    seed : int
        Draws the start of the sampling.
    engine : str, optional
        How distances are computed, one of ``engine_names(type(surface))``; by default the first of
        them.
    weld : bool
        Whether vertices of a mesh at exactly the same position are one point of the surface.

    Returns
    -------
    CanonicalForm

    Raises
    ------
    SettingError
        If there are fewer than ``dim`` positive eigenvalues, or a setting is unknown.
    MeshError
        If the surface has several components.
    MemoryBudgetError
        If "exact" would need more memory than allowed.

    Notes
    -----
    Elad & Kimmel, *On bending invariant signatures for surfaces*, PAMI 2003, with the low-rank
    forms of Shamai, Zibulevsky & Kimmel, 3DOR 2015: D² ≈ S T Sᵀ, J S is centred, and one QR
    decomposition gives the eigenpairs of −½ J S T Sᵀ J. O(p n log n) time and 8 n p bytes; 24 n²
    bytes for "exact".

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> canonical_form(square, dim=2, method="exact").points.shape
    (4, 2)
    """
    require_one_of("method", method, EmbeddingMethod)
    surface, seams = without_seams(metric_space(surface), weld)
    distances, measure = basis_domain(surface, weights, engine)
    n = distances.n_points
    with serial_blas():
        if method == "exact":
            sampling = Sampling(np.arange(n), all_distances(distances, 24.0, "the exact canonical form"))
            points, values = classical_scaling(sampling.columns**2, measure, dim)
        else:
            start = peripheral_vertex(surface, distances, seed)
            sampling = farthest_point_sampling(distances, min(p, n), start)
            points, values = _low_rank_scaling(surface, sampling, measure, dim, method)
    if len(values) < dim or not (values > 0).all():
        raise SettingError(
            f"only {int((values > 0).sum())} of {dim} eigenvalues are positive: the distances fit no space of that "
            "dimension; ask for a smaller dim"
        )
    residual = cdist(points[sampling.vertices], points) - sampling.columns
    stress = float(np.sqrt((residual**2 @ measure).sum() / (sampling.columns**2 @ measure).sum()))
    if seams:
        return CanonicalForm(points[seams.new_index], values, stress, seams.changes)
    return CanonicalForm(points, values, stress)


def classical_scaling(squares: FloatArray, measure: FloatArray, dim: int) -> tuple[FloatArray, FloatArray]:
    """Place n points in a Euclidean space by all their squared distances (n, n), which are made symmetric.

    Returns coordinates (n, min(dim, n)), centred, in decreasing order of spread, 0 along axes whose
    eigenvalue is not positive; and the eigenvalues, decreasing. ``measure`` (n,), positive, weights
    the points. O(n³).

    Examples
    --------
    >>> squares = np.array([[0.0, 1, 9], [1, 0, 4], [9, 4, 0]])
    >>> points, values = classical_scaling(squares, np.ones(3), dim=1)
    >>> abs(points[:2] - points[1:]).round(6).ravel()
    array([1., 2.])
    """
    # Torgerson, *Multidimensional scaling: I. Theory and method*, Psychometrika 1952, with weights a_i. If
    # d_ij² = ‖x_i − x_j‖² and Σ a_i x_i = 0, then
    #   d_ij² = ‖x_i‖² − 2 x_i · x_j + ‖x_j‖²,
    # and the terms with a single index vanish by centring on both sides with J = I − 1 aᵀ / Σ a: B = −½ J D²
    # Jᵀ = X Xᵀ. So X is the best root of rank dim of B in the weights A = diag(a): with the eigenpairs A^½ B
    # A^½ = V Λ Vᵀ, X = A^(−½) V Λ^½.
    share = measure / measure.sum()
    # B_ij = −½ (d_ij² − m_i − m_j + m), with the weighted means m_i of row i of D² and m of the whole D²
    inner = -0.25 * (squares + squares.T)
    mean = inner @ share
    inner += share @ mean - mean - mean[:, None]
    root = np.sqrt(measure)
    n = len(root)
    values, vectors = eigh(inner * root * root[:, None], subset_by_index=[max(n - dim, 0), n - 1])
    points: FloatArray = vectors[:, ::-1] * np.sqrt(np.maximum(values[::-1], 0.0)) / root[:, None]
    return points, values[::-1]


def _low_rank_scaling(
    surface: MetricSpace, sampling: Sampling, measure: FloatArray, dim: int, method: EmbeddingMethod
) -> tuple[FloatArray, FloatArray]:
    """Classical scaling of D² ≈ S T Sᵀ: eigenpairs of −½ (J S) T (J S)ᵀ by one QR decomposition."""
    # Shamai, Zibulevsky & Kimmel, 3DOR 2015. Centring acts on S alone, J (S T Sᵀ) Jᵀ = (J S) T (J
    # S)ᵀ, so that ``orthonormalise`` gives the form Q Λ Qᵀ of −½ J D² Jᵀ, and X = Q Λ^½ for the
    # largest, positive eigenvalues.
    squares, samples = sampling.columns**2, sampling.vertices
    if method == "fmds":
        interpolant = biharmonic_interpolant(require_mesh_or_points(surface), samples)
        outer, middle = interpolated_factors(interpolant, squares)
    else:
        rank = (len(samples) + 1) // 2  # half the number of columns, as a full rank would fit errors
        outer, middle = nystrom_factors(squares, samples, rank)
    outer -= measure @ outer / measure.sum()
    form = orthonormalise(outer, -0.5 * middle, measure, method, "", samples)
    leading = np.argsort(-form.values, kind="stable")[:dim]
    values = form.values[leading]
    return form.vectors[:, leading] * np.sqrt(np.maximum(values, 0.0)), values
