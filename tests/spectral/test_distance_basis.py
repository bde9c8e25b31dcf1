"""The geodesic distance basis: orthonormal, optimal for its rank when exact, near the optimum when sampled."""

import itertools

import numpy as np
import pytest

from isomatch import (
    DistanceBasis,
    MemoryBudgetError,
    Mesh,
    MeshError,
    distance_basis,
    geodesic_distances,
    laplace_basis,
)
from isomatch.geodesics import distance_engine, farthest_point_sampling
from isomatch.spectral import nystrom_basis
from isomatch_lab.procedural import creature
from shapes import disguised, flat_grid, icosphere, planar_delaunay, two_spheres
from zoo import specimen

METHODS, WEIGHTS = ("predicted", "nystrom", "fmds", "smds", "exact"), ("area", "uniform")


@pytest.fixture(scope="module")
def bases(mesh):
    return {(m, w): distance_basis(mesh, 50, 100, method=m, weights=w) for m in METHODS for w in WEIGHTS}


def dense(basis: DistanceBasis):
    return (basis.vectors * basis.values) @ basis.vectors.T


def weighted_norm(matrix, weights):
    """Frobenius norm of A^½ M A^½, which the truncation in weights A minimises."""
    root = np.sqrt(weights)
    return np.linalg.norm(root[:, None] * matrix * root)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("weights", WEIGHTS)
def test_orthonormal_in_the_weights(mesh, bases, method, weights):
    basis = bases[method, weights]
    expected = mesh.vertex_areas if weights == "area" else np.ones(mesh.n_vertices)
    np.testing.assert_array_equal(basis.weights, expected)
    gram = basis.vectors.T @ (expected[:, None] * basis.vectors)
    np.testing.assert_allclose(gram, np.eye(50), atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("weights", WEIGHTS)
def test_values_decrease_in_magnitude_and_few_are_positive(bases, method, weights):
    values = bases[method, weights].values
    assert (np.diff(np.abs(values)) <= 0).all()
    assert values[0] > 0, "the first is the near-constant function"
    assert 1 <= (values > 0).sum() < 10


@pytest.mark.parametrize("weights", WEIGHTS)
def test_exact_basis_is_the_optimum(weights):
    """Eckart & Young: the error is the norm of the eigenvalues left out; no other basis of this rank is better."""
    patch = planar_delaunay(400)
    distances = geodesic_distances(patch, np.arange(400))
    distances = (distances + distances.T) / 2
    exact = distance_basis(patch, 20, method="exact", weights=weights)
    root = np.sqrt(exact.weights)
    spectrum = np.sort(np.abs(np.linalg.eigvalsh(root[:, None] * distances * root)))[::-1]
    least = np.linalg.norm(spectrum[20:])
    assert weighted_norm(dense(exact) - distances, exact.weights) == pytest.approx(least, rel=1e-6)
    for method, other in itertools.product(METHODS, WEIGHTS):
        if (method, other) != ("exact", weights):
            worse = distance_basis(patch, 20, 40, method, other)
            assert weighted_norm(dense(worse) - distances, exact.weights) > least


@pytest.mark.long
def test_nystrom_is_near_the_optimum_and_the_laplace_basis_is_not(mesh, bases, all_distances):
    exact, nystrom = bases["exact", "uniform"], bases["nystrom", "uniform"]
    best, sampled = (np.linalg.norm(dense(basis) - all_distances) for basis in (exact, nystrom))
    assert sampled < 1.9 * best
    smooth = np.linalg.qr(laplace_basis(mesh, 50).vectors)[0]
    projected = np.linalg.norm(smooth @ (smooth.T @ all_distances) - all_distances)
    assert projected > 1.5 * sampled, "even one-sided, with freely chosen coefficients"


@pytest.mark.long
@pytest.mark.parametrize("method", ["predicted", "nystrom", "fmds"])
@pytest.mark.parametrize("weights", WEIGHTS)
def test_more_columns_and_higher_rank_fit_better(mesh, all_distances, method, weights):
    errors = [
        np.linalg.norm(dense(distance_basis(mesh, p // 2, p, method, weights)) - all_distances)
        for p in (20, 40, 80, 160)
    ]
    assert (np.diff(errors) < 0).all(), errors
    assert errors[-1] < errors[0] / 3


@pytest.mark.parametrize("weights", WEIGHTS)
def test_sampled_rows_are_reproduced_where_nothing_is_truncated(mesh, weights):
    """With k = p the Nyström form C U⁻¹ Cᵀ has the columns C themselves, up to the asymmetry of U."""
    basis = distance_basis(mesh, 30, 30, "nystrom", weights)
    columns = geodesic_distances(mesh, basis.samples)
    assert np.abs(basis.row(basis.samples) - columns).mean() < 0.005 * columns.mean()


def test_symmetric_columns_are_reproduced_to_rounding():
    """On a flat square, where fast marching is exact and symmetric."""
    sheet = flat_grid(7, 9)
    basis = distance_basis(sheet, 30, 30, "nystrom", weights="uniform")
    np.testing.assert_allclose(basis.row(basis.samples), geodesic_distances(sheet, basis.samples), atol=1e-4)


def test_rows_differ_by_the_eigenvalues_truncated(mesh):
    engine = distance_engine(mesh)
    sampling = farthest_point_sampling(engine, 60, start=0)
    among = sampling.columns[:, sampling.vertices]
    lost = np.sort(np.abs(np.linalg.eigvalsh((among + among.T) / 2)))[: 60 - 30]
    basis = nystrom_basis(sampling, np.ones(mesh.n_vertices), 30, "fast_marching")
    rows = basis.row(sampling.vertices)[:, sampling.vertices]
    assert np.linalg.norm(rows - (among + among.T) / 2) == pytest.approx(np.linalg.norm(lost), rel=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_distance_row_and_product_agree(bases, method):
    basis = bases[method, "area"]
    matrix = dense(basis)
    i, j = np.array([0, 5, 700]), np.array([3, 3, 1200])
    np.testing.assert_allclose(basis.distance(i, j), matrix[i, j])
    np.testing.assert_allclose(basis.distance(i[:, None], j), matrix[np.ix_(i, j)])
    assert basis.distance(0, 3) == pytest.approx(matrix[0, 3])
    np.testing.assert_allclose(basis.row(7), matrix[7], atol=1e-10)
    np.testing.assert_allclose(basis.row(i), matrix[i], atol=1e-10)
    values = np.random.default_rng(0).normal(size=(len(matrix), 2))
    np.testing.assert_allclose(basis @ values, matrix @ values, atol=1e-8)
    np.testing.assert_allclose(basis @ values[:, 0], matrix @ values[:, 0], atol=1e-8)


def test_truncated_basis_is_the_leading_part(bases):
    basis = bases["nystrom", "area"]
    part = basis.truncated(7)
    assert part.rank == 7
    np.testing.assert_array_equal(part.vectors, basis.vectors[:, :7])
    np.testing.assert_array_equal(part.values, basis.values[:7])


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("weights", WEIGHTS)
def test_relabelling_and_moving_give_the_same_distances(method, weights):
    mesh = icosphere(3) if method == "exact" else creature(1500, pose=1).mesh
    copy = disguised(mesh, seed=4)
    k = 11  # on the sphere: complete multiplets 1 + 3 + 7, because a cut through one is arbitrary
    plain = distance_basis(mesh, k, 40, method=method, weights=weights)
    moved = distance_basis(copy.mesh, k, 40, method=method, weights=weights)
    np.testing.assert_allclose(moved.values, plain.values, rtol=1e-4)
    rows = [0, 100, 333]
    expected = plain.row(rows)
    computed = moved.row(copy.new_vertex[rows])[:, copy.new_vertex]
    tolerance = 0.02 if method == "exact" else 1e-4  # eigenvalues that differ by meshing only mix freely
    np.testing.assert_allclose(computed, expected, atol=tolerance * expected.max())


def test_values_scale_with_area_and_length(mesh):
    """D is a length and A an area, so Λ, the spectrum of A^½ D A^½, scales with the third power."""
    large = Mesh(10 * mesh.vertices, mesh.faces)
    plain, scaled = (distance_basis(surface, 20, 40) for surface in (mesh, large))
    np.testing.assert_allclose(scaled.values, 1000 * plain.values, rtol=1e-4)


def test_repr_shows_size_and_method(bases):
    assert "rank 50, nystrom, 100 columns, fast_marching" in repr(bases["nystrom", "area"])


def test_exact_basis_over_the_memory_budget(mesh, monkeypatch):
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.001")
    with pytest.raises(MemoryBudgetError, match="distance"):
        distance_basis(mesh, method="exact")
    assert distance_basis(mesh, 20, 40, "nystrom").rank == 20, "the alternative that the message names works"


@pytest.mark.parametrize("k", [0, -1, 41])
def test_rank_outside_the_number_of_columns(mesh, k):
    with pytest.raises(ValueError, match=f"k = {k}"):
        distance_basis(mesh, k, 40)


@pytest.mark.parametrize("method", METHODS)
def test_two_components(method):
    with pytest.raises(MeshError, match="component"):
        distance_basis(two_spheres(2, 0.5), 10, 20, method=method)


def test_fewer_vertices_than_samples():
    with pytest.raises(MeshError, match="vertices"):
        distance_basis(icosphere(0), 10, 20)


def test_vertex_without_area():
    with pytest.raises(MeshError, match="vertices"):
        distance_basis(specimen("unused_vertex").mesh, 3, 6)
