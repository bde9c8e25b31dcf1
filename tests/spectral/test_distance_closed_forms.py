"""Spectra of distance matrices that are known: the sphere and the flat torus."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre

from isomatch import distance_basis
from shapes import icosphere


def sphere_eigenvalue(degree):
    """Funk & Hecke: 2 π ∫ arccos(t) P_ℓ(t) dt, 2 ℓ + 1 times; 0 for even ℓ > 0."""
    return 2 * np.pi * quad(lambda t: np.arccos(t) * eval_legendre(degree, t), -1, 1)[0]


@pytest.mark.parametrize(
    ("method", "level", "tolerance"), [("exact", 3, 0.01), ("predicted", 4, 0.01), ("nystrom", 4, 0.05)]
)
def test_sphere(method, level, tolerance):
    expected = np.concatenate([np.full(2 * degree + 1, sphere_eigenvalue(degree)) for degree in (0, 1, 3)])
    assert abs(sphere_eigenvalue(2)) < 1e-9
    values = distance_basis(icosphere(level), 11, 120, method).values
    np.testing.assert_allclose(values, expected, rtol=tolerance, atol=tolerance * abs(expected[1]))


@pytest.mark.parametrize("method", ["exact", "nystrom"])
def test_flat_torus(method):
    """On a periodic grid, given as a matrix, plane waves are eigenvectors: the transform of one row is the spectrum."""
    side = 16
    step = np.minimum(np.arange(side), side - np.arange(side))
    row = np.hypot(step[:, None], step)
    x, y = np.divmod(np.arange(side**2), side)
    matrix = row[(x[:, None] - x) % side, (y[:, None] - y) % side]
    spectrum = np.fft.fft2(row).real.ravel()
    n = 1 + 4 + 4 + 4  # complete multiplets
    expected = spectrum[np.argsort(-np.abs(spectrum), kind="stable")][:n]
    basis = distance_basis(matrix, n, side**2, method)
    np.testing.assert_allclose(np.sort(basis.values), np.sort(expected), rtol=1e-6)
    assert basis.engine == "matrix"
