"""The numbers of the paper's comparison of bases: a wolf of 4344 vertices, rank 50, uniform weights."""

import numpy as np
import pytest

from data import tosca
from isomatch import distance_basis, geodesic_distances, laplace_basis


@pytest.fixture(scope="module")
def wolf():
    return tosca("wolf0")


@pytest.fixture(scope="module")
def all_distances(wolf):
    full = geodesic_distances(wolf, np.arange(wolf.n_vertices))
    return (full + full.T) / 2


def relative_error(approximate, distances):
    return np.linalg.norm(approximate - distances) / np.linalg.norm(distances)


@pytest.mark.long
def test_exact(wolf, all_distances):
    basis = distance_basis(wolf, 50, method="exact", weights="uniform")
    assert relative_error(basis.row(np.arange(wolf.n_vertices)), all_distances) < 0.0042
    assert (basis.values > 0).sum() == 4


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_nystrom(wolf, all_distances, seed):
    basis = distance_basis(wolf, 50, 100, "nystrom", "uniform", seed)
    assert relative_error(basis.row(np.arange(wolf.n_vertices)), all_distances) < 0.0075


@pytest.mark.long
@pytest.mark.parametrize(("p", "error"), [(100, 0.0053), (200, 0.0046)])
def test_predicted_on_a_tenth_of_the_rows(wolf, p, error):
    rows = np.arange(0, wolf.n_vertices, 10)
    basis = distance_basis(wolf, 50, p, "predicted", "uniform")
    assert relative_error(basis.row(rows), geodesic_distances(wolf, rows)) < error


@pytest.mark.long
def test_laplace_basis(wolf, all_distances):
    """The best that 50 smooth functions can do when each column is projected on them."""
    smooth = np.linalg.qr(laplace_basis(wolf, 50).vectors)[0]
    error = relative_error(smooth @ (smooth.T @ all_distances), all_distances)
    assert error == pytest.approx(0.018, abs=0.001)
