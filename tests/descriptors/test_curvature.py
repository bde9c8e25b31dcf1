"""Signed mean curvature: closed form on the sphere, sign, and invariance."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Mesh, laplace_basis
from isomatch.descriptors import mean_curvature
from shapes import disguised, flat_grid, icosphere


def curvature(mesh, k=60):
    return mean_curvature(mesh, laplace_basis(mesh, k), k)


@pytest.mark.parametrize("radius", [0.5, 1.0, 20.0])
def test_a_sphere_of_radius_r_has_curvature_1_over_r(radius):
    sphere = icosphere(4)
    large = Mesh(radius * sphere.vertices, sphere.faces)
    np.testing.assert_allclose(curvature(large, 16), 1 / radius, rtol=0.01)


def test_a_flat_sheet_has_none():
    sheet = flat_grid(12, 12)
    np.testing.assert_allclose(curvature(sheet, 30), 0, atol=1e-9)


def test_flipping_the_faces_changes_the_sign(example):
    mesh = example[0].mesh
    inward = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    np.testing.assert_allclose(curvature(inward), -curvature(mesh), atol=1e-6 * np.abs(curvature(mesh)).max())


def test_a_mirror_image_seen_from_its_outside_has_the_same_curvature(example):
    mesh = example[0].mesh
    mirrored = Mesh(mesh.vertices * [-1, 1, 1], mesh.faces[:, ::-1])
    plain = curvature(mesh)
    np.testing.assert_allclose(curvature(mirrored), plain, atol=1e-6 * np.abs(plain).max())


def test_rigid_motion_changes_nothing_and_scale_divides(example):
    mesh = example[0].mesh
    other = disguised(mesh, seed=3, scale=4.0)
    plain = curvature(mesh)
    moved = curvature(other.mesh)[other.new_vertex]
    np.testing.assert_allclose(4 * moved, plain, atol=1e-3 * np.abs(plain).max())


def test_signs_of_eigenfunctions_do_not_matter(example):
    mesh = example[0].mesh
    basis = laplace_basis(mesh, 40)
    flipped = replace(basis, vectors=basis.vectors * np.random.default_rng(0).choice([-1.0, 1.0], 40))
    plain = mean_curvature(mesh, basis, 40)
    np.testing.assert_allclose(mean_curvature(mesh, flipped, 40), plain, atol=1e-9 * np.abs(plain).max())


def test_outward_bumps_are_positive_and_dents_negative():
    """A sphere with a bump at one pole and a dent at the other."""
    sphere = icosphere(4)
    height = sphere.vertices[:, 2]
    radius = 1 + 0.4 * np.exp(-20 * (1 - height)) - 0.4 * np.exp(-20 * (1 + height))
    values = curvature(Mesh(radius[:, None] * sphere.vertices, sphere.faces), 150)
    assert values[height.argmax()] > 1.5
    assert values[height.argmin()] < -0.2
