"""Interpolated bases: exactness at the samples, two routes to one matrix, the published order of methods."""

import numpy as np
import pytest

from data import tosca
from isomatch import distance_basis, geodesic_distances
from isomatch.geodesics import distance_engine, farthest_point_sampling
from isomatch.spectral.laplacian import stiffness_and_masses
from isomatch.spectral.low_rank import (
    ColumnPredictor,
    DensityWeighted,
    biharmonic_interpolant,
    choose_nodes,
    interpolated_basis,
)


@pytest.fixture(scope="module")
def sampling(mesh):
    return farthest_point_sampling(distance_engine(mesh), 40, start=0)


def test_interpolant_reproduces_values_constants_and_the_dense_solution(mesh, sampling):
    interpolant = biharmonic_interpolant(mesh, sampling.vertices)
    np.testing.assert_allclose(interpolant[sampling.vertices], np.eye(40), atol=5e-3)
    np.testing.assert_allclose(interpolant.sum(axis=1), 1, atol=1e-3)
    stiffness, masses = stiffness_and_masses(mesh)
    selection = np.eye(mesh.n_vertices)[sampling.vertices]
    fidelity = 100.0
    energy = (stiffness / (masses / masses.sum())) @ stiffness
    direct = np.linalg.solve(energy.toarray() + fidelity * selection.T @ selection, fidelity * selection.T)
    np.testing.assert_allclose(biharmonic_interpolant(mesh, sampling.vertices, fidelity), direct, atol=1e-6)


def test_interpolant_does_not_depend_on_scale(mesh, sampling):
    large = type(mesh)(100 * mesh.vertices, mesh.faces)
    np.testing.assert_allclose(
        biharmonic_interpolant(large, sampling.vertices, 10.0),
        biharmonic_interpolant(mesh, sampling.vertices, 10.0),
        atol=1e-6,
    )


def test_low_rank_form_is_the_average_of_both_interpolations(mesh, sampling):
    weights = np.ones(mesh.n_vertices)
    basis = interpolated_basis(mesh, sampling, weights, 80, "fmds", "fast_marching")
    one_sided = biharmonic_interpolant(mesh, sampling.vertices) @ sampling.columns
    expected = (one_sided + one_sided.T) / 2
    np.testing.assert_allclose(basis.row(np.arange(mesh.n_vertices)), expected, atol=1e-8 * expected.max())


def test_predicted_columns_are_the_measured_ones_at_the_samples(mesh, sampling):
    predictor = ColumnPredictor.fit(mesh, sampling)
    predicted = predictor.distances(sampling.vertices, np.arange(mesh.n_vertices))
    assert np.abs(predicted - sampling.columns).mean() < 0.002 * sampling.columns.mean()


def test_predicted_columns_are_nearer_than_interpolated_ones(mesh, sampling):
    rows = np.arange(5, mesh.n_vertices, 50)
    truth = geodesic_distances(mesh, rows)
    predicted = ColumnPredictor.fit(mesh, sampling).distances(rows, np.arange(mesh.n_vertices))
    interpolated = biharmonic_interpolant(mesh, sampling.vertices)[rows] @ sampling.columns
    assert np.linalg.norm(predicted - truth) < 0.5 * np.linalg.norm(interpolated - truth)


def test_samples_are_denser_where_the_weight_is_larger(mesh):
    engine = distance_engine(mesh)
    left = mesh.vertices[:, 0] < np.median(mesh.vertices[:, 0])
    even, uneven = (
        farthest_point_sampling(DensityWeighted(engine, density), 60, 0)
        for density in (np.ones(mesh.n_vertices), np.where(left, 27.0, 1.0))
    )
    np.testing.assert_array_equal(even.vertices, farthest_point_sampling(engine, 60, 0).vertices)
    assert left[uneven.vertices].sum() > 1.4 * left[even.vertices].sum()
    np.testing.assert_array_equal(uneven.columns, engine.distances_from(uneven.vertices))


def test_weights_of_the_nodes_sum_to_the_whole(mesh, sampling):
    gain = np.ones(mesh.n_vertices)
    nodes, weights = choose_nodes(mesh.vertices, sampling.vertices, mesh.vertex_areas, gain, 300)
    assert len(set(nodes)) == 300
    assert weights.sum() == pytest.approx(mesh.area)
    assert (weights > 0).all()


@pytest.mark.long
@pytest.mark.parametrize("weights", ["area", "uniform"])
def test_predicted_is_nearest_to_the_optimum(mesh, all_distances, weights):
    root = np.sqrt(distance_basis(mesh, 1, 2, weights=weights).weights)

    def error(basis):
        return np.linalg.norm(root[:, None] * (basis.row(np.arange(len(root))) - all_distances) * root)

    exact = distance_basis(mesh, 50, method="exact", weights=weights)
    for k in (5, 20, 50):
        best = error(exact.truncated(k))
        predicted, nystrom = (
            error(distance_basis(mesh, k, 2 * k, name, weights)) for name in ("predicted", "nystrom")
        )
        assert best < predicted < 1.4 * best
        assert predicted < nystrom


@pytest.mark.long
@pytest.mark.parametrize("pose", ["wolf0", "cat0", "centaur0"])
def test_published_order_of_methods(pose):
    """Spectral MDS is no better than FMDS, which is worse than Nyström; the predicted columns are better than all."""
    mesh = tosca(pose)
    rows = np.arange(0, mesh.n_vertices, mesh.n_vertices // 200)
    truth = geodesic_distances(mesh, rows)
    errors = [
        np.linalg.norm(distance_basis(mesh, 50, 100, method, "uniform").row(rows) - truth)
        for method in ("predicted", "nystrom", "fmds", "smds")
    ]
    assert (np.diff(errors[:3]) > 0).all(), errors
    assert errors[3] > 0.98 * errors[2]  # on a cat they tie
