"""Laplace–Beltrami eigenpairs against ARPACK's shift and invert with the same factorisation, in one run."""

import time

import numpy as np
import pytest
import robust_laplacian
from scipy.sparse import csc_array
from scipy.sparse.linalg import LinearOperator, eigsh, splu
from threadpoolctl import threadpool_limits

from isomatch import laplace_basis


def arpack(mesh, k):
    """Smallest k eigenpairs by scipy's eigsh, its inverse applied by SuperLU in symmetric mode."""
    stiffness, mass = robust_laplacian.mesh_laplacian(mesh.vertices, mesh.faces)
    shift = -1e-2 / mesh.area
    factor = splu(
        csc_array(stiffness - shift * mass),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    inverse = LinearOperator(stiffness.shape, factor.solve, dtype=float)
    start = np.random.default_rng(0).standard_normal(mesh.n_vertices)
    return eigsh(stiffness, k, mass, sigma=shift, OPinv=inverse, v0=start)


@pytest.mark.parametrize("k", [100, 200])
def bench_against_arpack(benchmark, large_mesh, k):
    """Ratio of times and largest relative difference of eigenvalues."""
    started = time.perf_counter()
    with threadpool_limits(1, "blas"):  # as ours runs; ARPACK stalls where its small products use threads
        values, _ = arpack(large_mesh, k)
    theirs = time.perf_counter() - started
    started = time.perf_counter()
    basis = laplace_basis(large_mesh, k)
    ours = time.perf_counter() - started
    difference = float(np.abs(basis.values[1:] / values[1:] - 1).max())
    benchmark.extra_info.update(ratio=theirs / ours, largest_relative_difference=difference)
    print(
        f"\n{large_mesh}, k = {k}: {ours:.2f} s, ARPACK {theirs:.2f} s, {theirs / ours:.1f} times as fast; "
        f"eigenvalues differ by at most {difference:.1e}"
    )
    benchmark.pedantic(laplace_basis, (large_mesh, k), rounds=1)
