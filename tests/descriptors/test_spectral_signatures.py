"""Wave and heat kernel signatures."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Mesh, heat_kernel_signature, laplace_basis, wave_kernel_signature
from isomatch.descriptors import wave_kernel_map
from shapes import disguised, icosphere

SIGNATURES = (heat_kernel_signature, wave_kernel_signature)


@pytest.fixture(scope="module")
def basis(example):
    return laplace_basis(example[0].mesh, 60)


@pytest.mark.parametrize("signature", SIGNATURES)
def test_shape_and_sign(basis, signature):
    values = signature(basis, 17)
    assert values.shape == (len(basis.vectors), 17)
    assert (values > 0).all()


@pytest.mark.parametrize("signature", SIGNATURES)
def test_columns_integrate_to_one(basis, signature):
    """Both are densities: ∫ Σ w_i φ_i² with Σ w_i = 1."""
    np.testing.assert_allclose(basis.weights @ signature(basis, 30), 1, rtol=1e-6)


@pytest.mark.parametrize("signature", SIGNATURES)
def test_signs_of_functions_do_not_matter(basis, signature):
    flips = np.random.default_rng(0).choice([-1.0, 1.0], basis.vectors.shape[1])
    flipped = replace(basis, vectors=basis.vectors * flips)
    np.testing.assert_array_equal(signature(flipped), signature(basis))


@pytest.mark.parametrize("signature", SIGNATURES)
def test_scale_covariance(example, basis, signature):
    """Energies and times follow the spectrum: a shape ten times as large has a hundredth of the density."""
    mesh = example[0].mesh
    large = laplace_basis(Mesh(10 * mesh.vertices, mesh.faces), 60)
    np.testing.assert_allclose(100 * signature(large), signature(basis), rtol=1e-5)


@pytest.mark.parametrize("signature", SIGNATURES)
def test_relabelling_and_moving(example, basis, signature):
    other = disguised(example[0].mesh, seed=7)
    moved = signature(laplace_basis(other.mesh, 60))[other.new_vertex]
    np.testing.assert_allclose(moved, signature(basis), rtol=1e-3)


@pytest.mark.parametrize("signature", SIGNATURES)
def test_constant_on_a_sphere(signature):
    """Every vertex looks alike; 16 functions are complete multiplets."""
    values = signature(laplace_basis(icosphere(4), 16), 10)
    np.testing.assert_allclose(values, 1 / (4 * np.pi), rtol=0.02)


def test_heat_kernel_in_closed_form(basis):
    """At the first and the last time."""
    signature = heat_kernel_signature(basis, 2)
    for column, time in enumerate(4 * np.log(10) / basis.values[[-1, 1]]):
        decay = np.exp(-basis.values * time)
        expected = (basis.vectors**2 * decay).sum(axis=1) / decay.sum()
        np.testing.assert_allclose(signature[:, column], expected)


@pytest.mark.parametrize("signature", SIGNATURES)
def test_first_functions_only(basis, signature):
    part = replace(basis, vectors=basis.vectors[:, :20], values=basis.values[:20])
    np.testing.assert_allclose(signature(basis, 9, k=20), signature(part, 9))


def test_wave_kernel_of_a_landmark(basis):
    """Symmetric, equal to the signature at the landmark itself, and independent of the signs of functions."""
    from_7, from_90 = (wave_kernel_map(basis, vertex, 9) for vertex in (7, 90))
    np.testing.assert_allclose(from_7[90], from_90[7])
    np.testing.assert_allclose(from_7[7], wave_kernel_signature(basis, 9)[7])
    flips = np.random.default_rng(0).choice([-1.0, 1.0], basis.vectors.shape[1])
    flipped = replace(basis, vectors=basis.vectors * flips)
    np.testing.assert_allclose(wave_kernel_map(flipped, 7, 9), from_7)
