"""The geodesic distance descriptor."""

import numpy as np
import pytest

from isomatch import distance_basis, geodesic_distance_descriptor


@pytest.fixture(scope="module", params=["area", "uniform"])
def basis(request, example):
    return distance_basis(example[0].mesh, 50, 100, weights=request.param)


def test_inner_products_are_the_distances_of_the_basis(basis):
    descriptor = geodesic_distance_descriptor(basis)
    rows = np.arange(0, 2900, 100)
    expected = basis.row(rows)
    np.testing.assert_allclose(descriptor.coordinates[rows] @ descriptor.inner().T, expected, atol=1e-9)
    np.testing.assert_allclose(descriptor.inner()[rows] @ descriptor.coordinates.T, expected, atol=1e-9)


def test_complex_form_of_the_paper(basis):
    """X = Q Λ^½ with complex roots: D = X Xᵀ without conjugation."""
    x = basis.vectors * np.sqrt(basis.values.astype(complex))
    descriptor = geodesic_distance_descriptor(basis)
    assert set(descriptor.signature) == {1.0, -1.0}
    real = descriptor.coordinates * np.where(descriptor.signature > 0, 1, 1j)
    np.testing.assert_allclose(x, real)
    rows = np.arange(0, 2900, 300)
    np.testing.assert_allclose((x[rows] @ x.T).imag, 0, atol=1e-9)


def test_columns_are_not_normalised(basis):
    """Their squared norm in the weights is |λ|, which decays, so that the leading ones have the largest weight."""
    coordinates = geodesic_distance_descriptor(basis).coordinates
    np.testing.assert_allclose(basis.weights @ coordinates**2, np.abs(basis.values), rtol=1e-9)


def test_first_columns(basis):
    whole, part = geodesic_distance_descriptor(basis), geodesic_distance_descriptor(basis, 6)
    assert part.coordinates.shape == (basis.vectors.shape[0], 6)
    np.testing.assert_array_equal(part.coordinates, whole.coordinates[:, :6])
    np.testing.assert_array_equal(part.signature, whole.signature[:6])
