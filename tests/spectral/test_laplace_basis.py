"""The Laplace–Beltrami basis: closed forms, orthonormality, residuals, and ARPACK as the second route."""

import subprocess
import sys

import numpy as np
import pytest
import robust_laplacian
from scipy.linalg import eigh
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import eigsh

from isomatch import Mesh, MeshError, NotConvergedError, laplace_basis
from isomatch.decimation import Prolongation, decimate
from isomatch.spectral import refined_laplace_basis
from isomatch.spectral.laplace_basis import smallest_eigenpairs
from isomatch.spectral.laplacian import WIDTH, factorise, factorise_for_threads
from isomatch_lab.procedural import creature
from shapes import cylinder, disguised, icosphere, planar_delaunay
from zoo import specimen, torus


@pytest.fixture(scope="module")
def mesh():
    return creature(2500).mesh


@pytest.fixture(scope="module")
def basis(mesh):
    return laplace_basis(mesh, 100)


def test_sphere():
    """ℓ(ℓ + 1), each 2ℓ + 1 times."""
    values = laplace_basis(icosphere(4), 25).values
    expected = np.concatenate([np.full(2 * degree + 1, degree * (degree + 1.0)) for degree in range(5)])
    assert abs(values[0]) < 1e-6
    np.testing.assert_allclose(values[1:9], expected[1:9], rtol=0.01)
    np.testing.assert_allclose(values[9:], expected[9:], rtol=0.02)


def test_sphere_converges_with_refinement():
    errors = [abs(laplace_basis(icosphere(level), 4).values[1:] - 2).mean() for level in (2, 3, 4)]
    assert errors[0] > 3 * errors[1] > 9 * errors[2]


def test_cylinder():
    """(2π i / perimeter)² + (π j / height)² with free ends; perimeter 1, height 1.2."""
    around, along = 50, 61
    values = laplace_basis(cylinder(around, along), 12).values
    i, j = np.meshgrid(np.arange(-8, 9), np.arange(12), indexing="ij")
    expected = np.sort(((2 * np.pi * i) ** 2 + (np.pi * j / 1.2) ** 2).ravel())[:12]
    np.testing.assert_allclose(values[1:], expected[1:], rtol=0.01)


def test_first_function_is_constant(mesh, basis):
    assert abs(basis.values[0]) < 1e-9 * basis.values[-1]
    np.testing.assert_allclose(np.abs(basis.vectors[:, 0]), basis.weights.sum() ** -0.5, rtol=1e-6)
    assert basis.weights.sum() == pytest.approx(mesh.area, rel=0.01)


@pytest.mark.parametrize(("n", "k"), [(1500, 20), (2500, 200), (800, 373)], ids=["krylov", "many", "dense"])
def test_orthonormal_in_the_areas(n, k):
    basis = laplace_basis(decimate(creature(2500).mesh, n).mesh, k)
    gram = basis.vectors.T @ (basis.weights[:, None] * basis.vectors)
    np.testing.assert_allclose(gram, np.eye(k), atol=1e-8)
    assert (np.diff(basis.values) >= -1e-9 * basis.values[-1]).all()


def test_residuals_are_small(mesh, basis):
    stiffness, mass = robust_laplacian.mesh_laplacian(mesh.vertices, mesh.faces)
    left, right = stiffness @ basis.vectors, mass @ (basis.vectors * basis.values)
    in_dual = 1 / np.sqrt(mass.diagonal())[:, None]
    residual = np.linalg.norm(in_dual * (left - right), axis=0)
    assert residual.max() < 0.03 * basis.values[-1]
    assert np.median(residual) < 1e-4 * basis.values[-1]


def test_agrees_with_arpack(mesh, basis):
    stiffness, mass = robust_laplacian.mesh_laplacian(mesh.vertices, mesh.faces)
    values, vectors = eigsh(stiffness, 100, mass, sigma=-1e-2 / mesh.area, v0=np.ones(mesh.n_vertices))
    np.testing.assert_allclose(basis.values[1:], values[1:], rtol=1e-6)
    overlap = np.abs(basis.vectors.T @ (mass @ vectors))
    projected = np.linalg.norm(overlap[:90], axis=1)  # the last functions may mix with those left out
    np.testing.assert_allclose(projected, 1, atol=1e-4)
    np.testing.assert_allclose(np.diag(overlap)[:30], 1, atol=1e-4)


@pytest.mark.parametrize("name", ["sphere", "torus", "plane"])
def test_a_quarter_of_the_vertices_of_a_small_mesh(name):
    """As `match` needs them for meshes of a few hundred vertices; repeated eigenvalues included."""
    mesh = {"sphere": icosphere(3), "torus": torus(30, 15), "plane": planar_delaunay(700)}[name]
    k = mesh.n_vertices // 4
    basis = laplace_basis(mesh, k)
    stiffness, mass = robust_laplacian.mesh_laplacian(mesh.vertices, mesh.faces)
    expected = eigh(stiffness.toarray(), mass.toarray(), eigvals_only=True)[:k]
    np.testing.assert_allclose(basis.values[1:], expected[1:], rtol=1e-6)


def test_deterministic_and_independent_of_seed_and_threads(mesh, basis, monkeypatch):
    found = laplace_basis(mesh, 100, seed=1)
    np.testing.assert_allclose(found.values[1:], basis.values[1:], rtol=1e-6)
    np.testing.assert_allclose(np.abs(found.vectors[:, :30]), np.abs(basis.vectors[:, :30]), atol=1e-3)
    for threads in ("1", "2"):
        monkeypatch.setenv("ISOMATCH_NUM_THREADS", threads)
        np.testing.assert_array_equal(laplace_basis(mesh, 100).vectors, basis.vectors)


def test_relabelling_moving_and_scaling(mesh, basis):
    copy = disguised(mesh, seed=2, scale=10.0)
    moved = laplace_basis(copy.mesh, 100)
    np.testing.assert_allclose(100 * moved.values[1:], basis.values[1:], rtol=1e-6)
    carried = 10 * moved.vectors[copy.new_vertex, :30]
    np.testing.assert_allclose(carried, basis.vectors[:, :30], atol=1e-3 * np.abs(basis.vectors).max())


def test_signs_follow_the_third_moment(basis):
    assert (basis.weights @ basis.vectors**3 >= 0).all()


def test_low_pass_is_the_projection_on_the_first_functions(basis):
    mixed = basis.vectors[:, [1, 4, 50]].sum(axis=1, keepdims=True)
    low = basis.low_passed(mixed, 10)
    np.testing.assert_allclose(low, basis.vectors[:, [1, 4]].sum(axis=1, keepdims=True), atol=1e-9)
    np.testing.assert_allclose(basis.low_passed(low, 10), low, atol=1e-9)
    assert basis.coefficients(mixed, 10).shape == (10, 1)
    np.testing.assert_allclose(basis.coefficients(mixed).ravel()[[1, 4, 50]], 1)


def test_smallest_eigenpairs_of_a_diagonal_matrix():
    """Clusters and a null space of two, as from two components."""
    values = np.concatenate([[0, 0, 1, 1, 1, 2], np.linspace(3, 500, 2000)])
    order = np.random.default_rng(0).permutation(len(values))
    found, vectors = smallest_eigenpairs(csc_array(diags_array(values[order])), 12)
    np.testing.assert_allclose(found, np.sort(values)[:12], atol=1e-6)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(12), atol=1e-9)


def test_not_converged_is_reported():
    """Thousands of nearly equal eigenvalues: no Krylov space separates the first few at this tolerance."""
    values = 1 + 1e-3 * np.random.default_rng(0).random(4000)
    with pytest.raises(NotConvergedError, match="eigenpairs"):
        smallest_eigenpairs(csc_array(diags_array(values)), 20, tolerance=1e-9)


def test_more_functions_than_vertices():
    with pytest.raises(MeshError, match="13"):
        laplace_basis(icosphere(0), 13)


def test_vertex_without_area():
    with pytest.raises(MeshError, match="vertices"):
        laplace_basis(specimen("unused_vertex").mesh, 5)


@pytest.mark.parametrize("name", ["nan", "out_of_range", "empty", "no_faces"])
def test_unusable_meshes(name):
    with pytest.raises(MeshError):
        laplace_basis(specimen(name).mesh, 3)


@pytest.fixture(scope="module")
def transfer(mesh):
    return Prolongation(mesh, decimate(mesh, 1000))


def refine(transfer, k):
    coarse = transfer.coarse.mesh
    prolongation = transfer.on_coarse.interpolation(coarse.n_vertices)
    return refined_laplace_basis(transfer.fine, laplace_basis(coarse, k), prolongation)


@pytest.mark.parametrize("k", [5, WIDTH, WIDTH + 1, 100])
def test_refined_from_a_coarser_mesh(mesh, transfer, k):
    """The same as if computed directly, except the last tenth; also with less than a block of functions."""
    direct, found = laplace_basis(mesh, k), refine(transfer, k)
    n = 9 * k // 10
    np.testing.assert_allclose(found.values[1:n], direct.values[1:n], rtol=0.01)
    is_larger = found.values[1:] >= direct.values[1:] * (1 - 1e-4)
    assert is_larger.all(), "Rayleigh–Ritz in a smaller space gives larger values"
    assert abs(found.values[0]) < 1e-4 * found.values[-1]
    gram = found.vectors.T @ (found.weights[:, None] * found.vectors)
    np.testing.assert_allclose(gram, np.eye(k), atol=1e-5)
    np.testing.assert_array_equal(found.weights, direct.weights)
    overlap = np.abs(found.vectors.T @ (direct.weights[:, None] * direct.vectors))
    np.testing.assert_allclose(np.linalg.norm(overlap[:n], axis=1), 1, atol=0.02)


def test_refined_from_the_same_mesh_changes_nothing(mesh, basis):
    transfer = Prolongation(mesh, decimate(mesh, mesh.n_vertices))
    found = refine(transfer, 100)
    np.testing.assert_allclose(found.values[1:], basis.values[1:], rtol=1e-3)
    np.testing.assert_allclose(found.vectors[:, :30], basis.vectors[:, :30], atol=1e-3 * basis.vectors.max())


def test_threads_do_not_change_what_is_refined(transfer, monkeypatch):
    found = []
    for threads in ("1", "2"):
        monkeypatch.setenv("ISOMATCH_NUM_THREADS", threads)
        found.append(refine(transfer, 40).vectors)
    np.testing.assert_array_equal(*found)


def test_refined_scales_with_the_mesh(transfer):
    found = refine(transfer, 40)
    fine = Mesh(10 * transfer.fine.vertices, transfer.fine.faces)
    scaled = refine(Prolongation(fine, decimate(fine, 1000)), 40)
    np.testing.assert_allclose(100 * scaled.values[1:], found.values[1:], rtol=1e-4)


@pytest.mark.parametrize("width", [1, 3, WIDTH])
def test_solving_in_both_precisions(width):
    """Against a dense solver and SuperLU."""
    rng = np.random.default_rng(width)
    n = 300
    rows, columns = rng.integers(n, size=(2, 4 * n))
    graph = csc_array((rng.random(4 * n), (rows, columns)), shape=(n, n))
    graph = graph + graph.T
    matrix = csc_array(diags_array(graph.sum(axis=1)) - graph)
    diagonal, right = 0.5 + rng.random(n), rng.normal(size=(n, width))
    given = right.copy()
    dense = np.linalg.solve(matrix.toarray() + np.diag(diagonal), right)
    largest = np.abs(dense).max()
    for dtype, error in ((np.float32, 1e-5), (np.float64, 1e-12)):
        found = factorise_for_threads(matrix, diagonal, dtype)(right)
        assert found.dtype == dtype
        assert found.shape == right.shape
        np.testing.assert_array_equal(right, given)
        np.testing.assert_allclose(found, dense, atol=error * largest)
    np.testing.assert_allclose(factorise(matrix, diagonal)(right), dense, atol=1e-12 * largest)


MEMORY_GROWTH = """
import threading, psutil
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu
from isomatch.spectral import factorise_for_threads, stiffness_and_masses
from isomatch.datasets import example_pair

stiffness, masses = stiffness_and_masses(example_pair()[0].mesh)
kept = []

def resident_after(times):
    for _ in range(times):
        thread = threading.Thread(target=lambda: kept.append(factorise_for_threads(stiffness, masses)))
        thread.start()
        thread.join()
        kept.clear()
    return psutil.Process().memory_info().rss

before = resident_after(10)
size = 12 * splu(csc_array(stiffness + diags_array(masses))).nnz  # bytes
print((resident_after(100) - before) / size)
"""


@pytest.mark.long
def test_factors_that_another_thread_made_give_their_memory_back():
    """In a process of its own, so that its memory has no other cause; SuperLU's own factors would leak each time."""
    run = subprocess.run([sys.executable, "-c", MEMORY_GROWTH], capture_output=True, text=True, check=True)
    assert float(run.stdout) < 30
