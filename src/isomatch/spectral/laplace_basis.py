"""The Laplace–Beltrami basis: the smoothest functions on a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.linalg import eigh, solve_triangular
from scipy.sparse import csc_array, csr_array

from isomatch._core.arrays import AnyArray, FloatArray, single
from isomatch._core.errors import MeshError, NotConvergedError, some
from isomatch._core.memory import require_memory
from isomatch._core.settings import generator, require_one_of
from isomatch._core.threads import row_product, serial_blas
from isomatch.io import SurfaceLike, surface_from
from isomatch.repair import without_seams
from isomatch.spectral.basis import PlottedBasis, fix_signs, require_one_component, shared_weights
from isomatch.spectral.laplacian import WIDTH, factorise, factorise_for_threads, stiffness_and_masses
from isomatch.surfaces import Mesh, Surface

Precision = Literal["double", "single"]

# number of vectors of the Krylov space that are computed at once in double precision; chosen: larger blocks
# need more vectors to converge, smaller ones more time to solve
BLOCK_VECTORS = 8
# residual over eigenvalue up to which an eigenpair has converged, by precision: see decisions.md, refinement
# cost
MAX_RESIDUAL: dict[Precision, float] = {"double": 1e-4, "single": 0.025}
# Number of vectors of the Krylov space for each function sought, before the first test of convergence. With
# 2.4, the finest signatures of a shape and of its relabelled copy differ by up to 0.6 standard deviations,
# with 2.6 by 0.07.
MIN_VECTORS_PER_FUNCTION = 2.6
VECTORS_PER_TEST = 48  # vectors between two tests of convergence; chosen: a multiple of both block widths
MAX_DENSE_VERTICES = 1000  # number of vertices up to which a dense solver is faster than a Krylov space
# Number added to the operator of the refined basis, over the last eigenvalue of the coarse basis; chosen so
# large that inverse iteration favours no single function.
SHIFT_RATIO = 0.1
# Numbers that are added to all eigenvalues of a surface of area 1, in double and in single precision. The
# first makes the singular Laplacian definite. The second is near the second eigenvalue: if it were smaller,
# rounding of the largest part of the inverse would hide the other parts.
SHIFT, SINGLE_SHIFT = 1e-2, 10.0


@dataclass(frozen=True, eq=False, repr=False)
class LaplaceBasis(PlottedBasis):
    """The first eigenfunctions of the Laplace–Beltrami operator.

    Parameters
    ----------
    vectors : (n, k) array of float
        Φ, orthonormal in the areas: ΦᵀAΦ = I. The first is constant. Single or double precision, as
        computed.
    values : (k,) array of float
        Eigenvalues, increasing from 0, in 1 / squared mesh units.
    weights : (n,) array of float
        The diagonal of A: vertex areas, in squared mesh units.
    notes : tuple of str
        Number of vertices that were welded.

    Examples
    --------
    The first function is constant, so that it alone reproduces a constant.

    >>> wedge = Mesh([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> basis = laplace_basis(wedge, k=3)
    >>> bool(np.allclose(basis.vectors.T @ (basis.weights[:, None] * basis.vectors), np.eye(3)))
    True
    >>> basis.low_passed(np.full((4, 1), 7.0), k=1).ravel().round(6)
    array([7., 7., 7., 7.])
    """

    vectors: FloatArray
    values: FloatArray
    weights: FloatArray
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        n, k = self.vectors.shape
        return f"LaplaceBasis({n} points, {k} functions)"

    def coefficients(self, functions: FloatArray, k: int | None = None) -> FloatArray:
        """Coefficients of (n, q) functions in the first k basis functions, all by default: ΦᵀA f, (k, q)."""
        weighted = (self.weights[:, None] * functions).astype(self.vectors.dtype)
        return (self.vectors[:, :k].T @ weighted).astype(np.float64)

    def low_passed(self, functions: FloatArray, k: int) -> FloatArray:
        """Project (n, q) functions on the span of the first k basis functions: Φ ΦᵀA f, (n, q)."""
        return row_product(self.vectors[:, :k], self.coefficients(functions, k))


def laplace_basis(
    surface: SurfaceLike, k: int = 200, seed: int = 0, precision: Precision = "double", *, weld: bool = True
) -> LaplaceBasis:
    """Compute the first k eigenpairs of the Laplacian, L φ = λ A φ.

    Parameters
    ----------
    surface : Mesh, PointCloud, Graph, or what `surface_from` takes
        A surface of one component and n vertices; every vertex of a mesh belongs to a face.
    k : int
        Number of functions, at most n.
    seed : int
        Draws the start of the eigensolver; eigenvalues do not depend on it beyond the tolerance.
    precision : {"double", "single"}
        Precision of the eigensolver. Single precision takes 0.6 of the time; the relative error of
        the last eigenvalues is up to 0.001.
    weld : bool
        Whether vertices of a mesh at exactly the same position are one point of the surface; they
        share its weight.

    Returns
    -------
    LaplaceBasis

    Raises
    ------
    MeshError
        If a vertex has no area, the surface has several components, or there are fewer than k
        vertices.
    MemoryBudgetError
        If the eigensolver would need more memory than allowed.
    NotConvergedError
        If the eigenpairs do not converge.

    Notes
    -----
    L and A are the tufted intrinsic Delaunay Laplacian of Sharp & Crane, *A Laplacian for
    Nonmanifold Triangle Meshes*, SGP 2020 (package robust_laplacian); for graphs ``laplacian``. The
    eigenpairs come from a block Krylov space of the shifted inverse with full reorthogonalisation;
    it solves for a few vectors at once and projects by matrix products, which is about twice as
    fast as ARPACK. O(n k²) time, about 24 n k bytes.

    Examples
    --------
    >>> tetrahedron = Mesh(np.eye(4)[:, :3], [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    >>> laplace_basis(tetrahedron, k=2)
    LaplaceBasis(4 points, 2 functions)
    """
    surface, seams = without_seams(surface_from(surface), weld)
    if k > surface.n_vertices:
        raise MeshError(f"cannot compute {k} eigenfunctions of a surface of {surface.n_vertices} vertices")
    require_one_of("precision", precision, Precision)
    operator, weights = _unit_operator(surface)
    with serial_blas():
        values, vectors = smallest_eigenpairs(operator, k, seed, MAX_RESIDUAL[precision], np.dtype(precision))
    basis = _basis(values, vectors, weights)
    if seams:
        weights = shared_weights(weights, seams.new_index)
        return LaplaceBasis(basis.vectors[seams.new_index], basis.values, weights, seams.changes)
    return basis


def refined_laplace_basis(surface: Surface, coarse: LaplaceBasis, prolongation: csr_array) -> LaplaceBasis:
    """Compute k eigenpairs of a surface from the basis of a coarser one; the last tenth is less accurate.

    ``prolongation`` (n, n_c) interpolates values at the vertices of the coarser surface to the
    vertices of the finer one. Errors as for `laplace_basis`.
    """
    # Two levels of the hierarchical subspace iteration of Nasikun & Hildebrandt, *The Hierarchical Subspace
    # Iteration Method for Laplace–Beltrami Eigenproblems*, 2021: one step of inverse iteration V = (H + σ)⁻¹
    # A^½ P Φ_c from the functions Φ_c of the coarse basis, which P prolongs to the surface. It damps
    # components above the k-th eigenvalue. Then the Rayleigh–Ritz method in the span of V,
    #   VᵀHV c = λ VᵀV c.
    # It takes k solves in single precision, where `laplace_basis` takes some 2.5 k. The shift σ is well
    # inside the spectrum, so that no single function dominates.
    operator, weights = _unit_operator(surface)
    k, area = len(coarse.values), weights.sum()
    with serial_blas():
        start = single(np.sqrt(weights)[:, None] * (prolongation @ coarse.vectors))
        shift = SHIFT_RATIO * float(coarse.values[-1] * area)
        solve = factorise_for_threads(operator, np.full(len(weights), shift), np.float32)
        vectors = np.empty_like(start)
        for first in range(0, k, WIDTH):
            block = solve(start[:, first : first + WIDTH])
            vectors[:, first : first + WIDTH] = block / np.linalg.norm(block, axis=0)
        gram = vectors.T @ vectors
        energies = vectors.T @ (operator.astype(np.float32) @ vectors)
        values, mix = eigh((energies + energies.T).astype(np.float64) / 2, gram.astype(np.float64))
        return _basis(values, row_product(vectors, mix), weights)


def _unit_operator(surface: Surface) -> tuple[csc_array, FloatArray]:
    """Return the Laplacian at unit area, whose eigenvectors are orthonormal, and the masses."""
    if isinstance(surface, Mesh):
        unused = np.flatnonzero(np.bincount(surface.sound_faces.ravel(), minlength=surface.n_vertices) == 0)
        if len(unused):
            raise MeshError(
                f"vertices {some(unused)} belong to no face, so the Laplacian is undefined there; call repair(mesh)"
            )
    require_one_component(surface)
    stiffness, weights = stiffness_and_masses(surface)
    # L φ = λ A φ with φ = A^(−½) u is H u = λ u with the symmetric H = A^(−½) L A^(−½). H is multiplied by
    # the area of the surface, which makes its eigenvalues those of a surface of area 1.
    scale, operator = np.sqrt(weights.sum() / weights), csc_array(stiffness)
    operator.data *= scale[operator.indices] * np.repeat(scale, np.diff(operator.indptr))
    return operator, weights


def _basis(values: FloatArray, vectors: FloatArray, weights: FloatArray) -> LaplaceBasis:
    """Make a basis in the units of the surface from eigenpairs at area 1."""
    if not (np.isfinite(values).all() and np.isfinite(vectors).all()):
        raise NotConvergedError(
            "the Laplace eigenpairs are not finite: some vertices nearly coincide, or areas differ too much; merge such "
            "vertices, or remesh"
        )
    vectors = fix_signs(vectors / np.sqrt(weights).astype(vectors.dtype)[:, None], weights)
    return LaplaceBasis(vectors, np.maximum(values, 0.0) / weights.sum(), weights)


def smallest_eigenpairs(
    operator: csc_array,
    k: int,
    seed: int = 0,
    tolerance: float = 1e-4,
    dtype: np.dtype[Any] = np.dtype(np.float64),  # noqa: B008
) -> tuple[FloatArray, AnyArray]:
    """Compute the smallest k eigenpairs of a sparse semidefinite matrix H: values (k,), vectors (n, k)."""
    # Rayleigh–Ritz for B = (H + σ)⁻¹ on the block Krylov space spanned by X, B X, B² X, … with a random block
    # X (n, w) (Grimes, Lewis & Simon, *A shifted block Lanczos algorithm*, SIMAX 1994): the smallest
    # eigenvalues λ of H give the largest eigenvalues 1 / (λ + σ) of B, which are far from all others of B, so
    # that they converge first.
    # With the space Q = [Q_1 … Q_j], orthonormal,
    #   B Q_j = Σ_i Q_i T_ij + Q_{j+1} R_{j+1},  T = Qᵀ B Q,
    # each new block Q_{j+1} R_{j+1} is the remainder of B Q_j, made orthonormal. In exact arithmetic, T is
    # block tridiagonal, and a new block need be made orthogonal only to the two blocks before it. It is then
    # made orthogonal to all blocks, because rounding brings converged directions back. ``tolerance`` bounds
    # the residual of an eigenpair of B over its eigenvalue; the relative error of the eigenvalue is at most
    # of the order of tolerance². ``dtype`` is the type of the space and the vectors.
    n = operator.shape[0]
    if n <= max(MAX_DENSE_VERTICES, k + 20 * BLOCK_VECTORS):
        values, vectors = np.linalg.eigh(operator.toarray())
        return values[:k], vectors[:, :k]
    in_double = dtype == np.float64
    width, shift = (BLOCK_VECTORS, SHIFT) if in_double else (WIDTH, SINGLE_SHIFT)
    diagonal = np.full(n, shift)
    solve = (
        factorise(operator, diagonal) if in_double else factorise_for_threads(operator, diagonal, np.float32)
    )
    limit = (min(n - width, 6 * k + 20 * width) // width) * width
    what = f"the Krylov space of {k} functions on {n} vertices"
    require_memory(float(dtype.itemsize) * n * limit, what, "ask for fewer functions")
    space = np.zeros((limit, n), dtype)
    projected = np.zeros((limit, limit))  # the matrix T; the vectors of Q are the rows of ``space``
    space[:width] = _orthonormal_columns(generator(seed).standard_normal((n, width)))[0].T
    size = width
    while True:
        last = slice(size - width, size)
        image = np.ascontiguousarray(solve(space[last].T).T)
        for first in (max(0, size - 2 * width), 0):  # orthogonal to the last two blocks, then to all blocks
            part = space[first:size]
            overlap = part @ image.T
            image -= overlap.T @ part
            projected[first:size, last] += overlap
        block, coupling = _orthonormal_columns(image.T.astype(np.float64))
        full = size + width > limit
        if full or (size >= MIN_VECTORS_PER_FUNCTION * k and size % VECTORS_PER_TEST == 0):
            # Ritz pairs T s = θ s give (θ, Q s). As B Q − Q T is Q_{j+1} R_{j+1} in the last block alone, the
            # residual ‖B Q s − θ Q s‖ is ‖R_{j+1} s_last‖, without another product with B. λ = 1 / θ − σ.
            values, mix = np.linalg.eigh(projected[:size, :size], UPLO="U")
            values, mix = values[: -k - 1 : -1], mix[:, : -k - 1 : -1]
            residual = np.linalg.norm(coupling @ mix[last], axis=0) / values
            if residual.max() < tolerance:
                return 1 / values - shift, space[:size].T @ mix.astype(dtype)
            if full:
                raise NotConvergedError(
                    f"{int((residual >= tolerance).sum())} of {k} Laplace eigenpairs did not converge "
                    f"(residual {residual.max():.1e}); ask for fewer functions, or repair(mesh) if it has degenerate "
                    "faces"
                )
        space[size : size + width] = block.T
        size += width


def _orthonormal_columns(block: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cholesky QR, repeated once for accuracy: block (n, b) = q r with qᵀq = I, if well-conditioned."""
    q, r = block, np.eye(block.shape[1])
    for _ in range(2):
        # qᵀq = UᵀU, so that (q U⁻¹)ᵀ (q U⁻¹) = I. The error of qᵀq grows with the square of the
        # condition number; the second round removes it (Yamamoto et al., *Roundoff error analysis
        # of the CholeskyQR2 algorithm*, ETNA 2015).
        upper = np.linalg.cholesky(q.T @ q).T
        q = q @ solve_triangular(upper, np.eye(len(upper)), check_finite=False)
        r = upper @ r
    return q, r
