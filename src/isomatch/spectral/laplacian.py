"""The Laplacian of meshes, point clouds and graphs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import robust_laplacian
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, tril
from scipy.sparse.linalg import splu

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.errors import MeshError, SettingError
from isomatch.geodesics import MetricSpace
from isomatch.spectral.basis import require_areas
from isomatch.surfaces import Graph, Mesh, PointCloud, Surface

WIDTH = 16  # number of right-hand sides solved for at once; chosen: a row in single precision has 64 bytes


def stiffness_and_masses(surface: Surface) -> tuple[csc_array, FloatArray]:
    """Compute the stiffness matrix L (n, n), semidefinite and without unit, and the lumped masses (n,).

    Meshes and point clouds have the tufted intrinsic Delaunay Laplacian of Sharp & Crane, *A
    Laplacian for Nonmanifold Triangle Meshes*, SGP 2020. `MeshError` if the area of a vertex is
    zero or not finite.
    """
    if isinstance(surface, Graph):
        return _graph_laplacian(surface), surface.vertex_areas
    if isinstance(surface, Mesh):
        stiffness, mass = robust_laplacian.mesh_laplacian(surface.vertices, surface.faces)
    else:
        stiffness, mass = robust_laplacian.point_cloud_laplacian(surface.vertices)
    return csc_array(stiffness), require_areas(np.asarray(mass.diagonal(), dtype=np.float64))


def _graph_laplacian(graph: Graph) -> csc_array:
    # The weight of an edge is the geometric mean of the masses at its ends, divided by its squared length and
    # multiplied by 4 / degree. On a square grid with edges of length h, masses are h² and the degree is 4:
    # weights are 1, and L is the five-point Laplacian.
    i, j = graph.edges.T
    # lengths are raised to a millionth of their mean, so that none is 0
    lengths = np.maximum(graph.edge_lengths, 1e-6 * graph.edge_lengths.mean())
    degree = 2 * len(i) / graph.n_vertices  # average number of neighbours, 4 on a square grid
    conductance = 4 / degree * np.sqrt(graph.vertex_areas[i] * graph.vertex_areas[j]) / lengths**2
    adjacency = coo_array((conductance, (i, j)), shape=(graph.n_vertices,) * 2)
    adjacency = adjacency + adjacency.T
    return csc_array(diags_array(adjacency.sum(axis=1)) - adjacency)


def factorise(stiffness: csc_array, diagonal: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Factorise H + diag(d), symmetric and definite, and return the function that solves with it."""
    return cast(Callable[[FloatArray], FloatArray], _factors(stiffness, diagonal).solve)


def factorise_for_threads(
    stiffness: csc_array, diagonal: FloatArray, dtype: type[np.floating[Any]] = np.float64
) -> Callable[[FloatArray], AnyArray]:
    """As ``factorise``, for up to WIDTH right-hand sides; single precision takes half the time.

    Several threads may keep and use the result. SuperLU's own factors would leak if another thread
    than the one that made them released them.
    """
    factors = _factors(stiffness, diagonal)  # factors of H + diag(d) = Pᵀ L D Lᵀ P
    rows = csr_array(tril(factors.L, -1))
    columns = csc_array(rows)
    by_row, by_column = (
        (lower.indptr, lower.indices, np.asarray(lower.data, dtype)) for lower in (rows, columns)
    )
    inverse, place, n = np.asarray(1 / factors.U.diagonal(), dtype), factors.perm_c.copy(), len(diagonal)

    def solve(right: FloatArray) -> AnyArray:
        q = right.shape[1]
        x = np.zeros((n, WIDTH), dtype)
        x[place, :q] = right
        _solve(*by_row, *by_column, inverse, x, np.zeros(WIDTH, dtype))
        return np.asarray(x[place, :q])

    return solve


def _factors(stiffness: csc_array, diagonal: FloatArray) -> Any:
    matrix, options = csc_array(stiffness + diags_array(diagonal)), {"SymmetricMode": True}
    try:
        return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:
        raise MeshError(
            f"the Laplacian cannot be factorised ({error}): some vertices nearly coincide, or triangles are nearly "
            "flat; merge such vertices"
        ) from error


@compiled(fastmath={"contract", "nsz", "reassoc"})
def _solve(
    row_start: IntArray,
    column: IntArray,
    row_value: AnyArray,
    column_start: IntArray,
    row: IntArray,
    column_value: AnyArray,
    inverse: AnyArray,
    x: AnyArray,
    sums: AnyArray,
) -> None:
    """Solve L D Lᵀ x = b in place, given D⁻¹ and the rows and columns of L below its unit diagonal."""
    # L y = b forwards: y_i = b_i − Σ_{j<i} L_ij y_j. Then Lᵀ x = D⁻¹ y backwards: x_j = y_j / d_j −
    # Σ_{i>j} L_ij x_i. Both directions gather values, because scattering them takes 1.5 times as
    # long. ``sums`` are WIDTH zeros.
    n = len(inverse)
    for i in range(n):
        for e in range(row_start[i], row_start[i + 1]):
            j, value = column[e], row_value[e]
            for c in range(WIDTH):
                sums[c] += value * x[j, c]
        for c in range(WIDTH):
            x[i, c] -= sums[c]
            sums[c] = 0.0
    for j in range(n - 1, -1, -1):
        for e in range(column_start[j], column_start[j + 1]):
            i, value = row[e], column_value[e]
            for c in range(WIDTH):
                sums[c] += value * x[i, c]
        for c in range(WIDTH):
            x[j, c] = x[j, c] * inverse[j] - sums[c]
            sums[c] = 0.0


def require_mesh_or_points(surface: MetricSpace) -> Mesh | PointCloud:
    """Return a mesh or a point cloud as it is; `SettingError` for everything else."""
    if isinstance(surface, Mesh | PointCloud):
        return surface
    raise SettingError(
        f"this method needs the Laplacian of a Mesh or PointCloud, not a {type(surface).__name__}; use method='nystrom'"
    )
