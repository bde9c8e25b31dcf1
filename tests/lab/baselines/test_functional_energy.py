"""The energy of a functional map: its minimum by another route, and operators in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import LaplaceBasis, MemoryBudgetError, Mesh, laplace_basis
from isomatch_lab.baselines.functional_maps import FunctionalEnergy, orientations, products
from shapes import disguised, flat_grid


def test_minimum_is_that_of_stacked_least_squares():
    """Every residual as a row in the entries of F, solved by QR."""
    rng = np.random.default_rng(0)
    k_s, k_t, q = 4, 5, 3
    a, b = rng.normal(size=(k_s, 9)), rng.normal(size=(k_t, 9))
    of_source, of_target = rng.normal(size=(q, k_s, k_s)), rng.normal(size=(q, k_t, k_t))
    penalties = rng.random((k_s, k_t))
    energy = FunctionalEnergy(k_s, k_t)
    energy.preserve(a, b, 2.0)
    energy.commute(of_source, of_target, 3.0)
    energy.penalise(penalties, 0.5)

    def residuals(entries):
        f = entries.reshape(k_s, k_t)
        return np.concatenate(
            [
                np.sqrt(2 / 9) * (f @ b - a).ravel(),
                np.sqrt(3 / q) * (f @ of_target - of_source @ f).ravel(),
                np.sqrt(0.5 * penalties).ravel() * entries,
            ]
        )

    constant = residuals(np.zeros(k_s * k_t))
    design = np.column_stack([residuals(unit) - constant for unit in np.eye(k_s * k_t)])
    expected = np.linalg.lstsq(design, -constant, rcond=None)[0].reshape(k_s, k_t)
    np.testing.assert_allclose(energy.minimiser(), expected, atol=1e-6)


def test_memory_is_asked_for_first(monkeypatch):
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.1")
    with pytest.raises(MemoryBudgetError, match="functional"):
        FunctionalEnergy(100, 100)


def test_orientation_of_plane_coordinates():
    """On a sheet ⟨∇x × ∇y, n⟩ = 1; with x, y the columns of the "basis", its integral is the area."""
    sheet = flat_grid(4, 6, shear=0.3)
    basis = LaplaceBasis(
        np.column_stack([np.ones(24), sheet.vertices[:, :2]]), np.zeros(3), sheet.vertex_areas
    )
    along_x = orientations(basis, sheet, np.eye(3)[:, 1:2])[0]
    np.testing.assert_allclose(along_x[0], [0, 0, sheet.area], atol=1e-12)
    turned = Mesh(sheet.vertices, sheet.faces[:, ::-1])
    np.testing.assert_allclose(orientations(basis, turned, np.eye(3)[:, 1:2])[0], -along_x, atol=1e-12)


@pytest.fixture(scope="module")
def isometry(example):
    """One animal and its relabelled, moved copy: basis, mesh, and the functional map of the truth."""
    mesh, other = example[0].mesh, disguised(example[0].mesh, seed=4)
    source, target = laplace_basis(mesh, 30), laplace_basis(other.mesh, 30)
    return source, mesh, target, other.mesh, source.coefficients(target.vectors[other.new_vertex])


def test_operators_commute_with_an_isometry(isometry):
    source, mesh, target, other, f = isometry
    np.testing.assert_allclose(f @ f.T, np.eye(30), atol=1e-3)
    function = np.random.default_rng(1).normal(size=(30, 2))
    for a, b in (
        (products(source, f @ function), products(target, function)),
        (orientations(source, mesh, f @ function), orientations(target, other, function)),
    ):
        scale = np.abs(b).max()
        assert np.abs(f @ b - a @ f).max() < 1e-3 * scale
        assert np.abs(f @ b + a @ f).max() > 0.1 * scale


def test_product_with_one_is_the_identity(isometry):
    basis = isometry[0]
    one = basis.coefficients(np.ones((len(basis.vectors), 1)))
    np.testing.assert_allclose(products(basis, one)[0], np.eye(30), atol=1e-9)


def test_isometry_is_the_minimum(isometry):
    """From few descriptors, whatever the signs of the eigenfunctions."""
    source, _, target, _, f = isometry
    flips = np.random.default_rng(2).choice([-1.0, 1.0], 30)
    source, f = replace(source, vectors=source.vectors * flips), flips[:, None] * f
    function = np.random.default_rng(1).normal(size=(30, 3))
    energy = FunctionalEnergy(30, 30)
    energy.preserve(f @ function, function, 1.0)
    energy.commute(products(source, f @ function), products(target, function), 1.0)
    np.testing.assert_allclose(energy.minimiser(), f, atol=1e-2)
