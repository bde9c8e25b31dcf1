"""Gradient fields in closed form, eigenfunctions matched through signs, order and mirror images, bounds on creatures."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Mesh, geodesic_distances, prepare
from isomatch.datasets import ground_truth
from isomatch.matching import prepare_pair
from isomatch_lab.baselines import GradientFieldsConfig, spectral_gradient_fields
from isomatch_lab.baselines.eigenfunction_matching import signed_permutation
from isomatch_lab.baselines.spectral_gradient_fields import gradient_fields, invariants
from isomatch_lab.procedural import creature
from shapes import disguised, flat_grid, icosphere


@pytest.fixture(scope="module")
def shape():
    return prepare(creature(1500).mesh)


def test_linear_functions_on_a_sheet():
    """⟨∇x, ∇y⟩ = 0, ⟨∇x × ∇y, N⟩ = 1, whatever the triangles; turned over, −1."""
    sheet = flat_grid(5, 6, shear=0.4)
    x, y, _ = sheet.vertices.T
    functions = np.column_stack([x, y, 2 * x + y])
    for side, faces in ((1, sheet.faces), (-1, sheet.faces[:, ::-1])):
        found = invariants(gradient_fields(Mesh(sheet.vertices, faces), functions), np.ones(3))
        np.testing.assert_allclose(found, np.tile([0, 1, side, -2 * side], (30, 1)), atol=1e-12)


def test_coordinates_of_a_sphere():
    """⟨∇x, ∇y⟩ = −x y and ⟨∇x × ∇y, N⟩ = z."""
    sphere = icosphere(4)
    x, y, z = sphere.vertices.T
    found = invariants(gradient_fields(sphere, sphere.vertices[:, :2]), np.ones(2))
    np.testing.assert_allclose(found, np.column_stack([-x * y, z]), atol=0.01)


def test_invariants_of_a_moved_copy(shape):
    mesh = shape.body
    moved = disguised(mesh, seed=2)
    functions = shape.laplace.vectors[:, 1:6]
    of_moved = np.zeros_like(functions)
    of_moved[moved.new_vertex] = functions
    here = invariants(gradient_fields(mesh, functions), shape.laplace.values[1:6])
    there = invariants(gradient_fields(moved.mesh, of_moved), shape.laplace.values[1:6])
    np.testing.assert_allclose(there[moved.new_vertex], here, atol=1e-9)


def disordered(shape, order, signs):
    """The same shape with its leading eigenfunctions, the constant apart, in another order and with other signs."""
    vectors, values = shape.laplace.vectors.copy(), shape.laplace.values.copy()
    vectors[:, 1 : len(order) + 1] = vectors[:, 1 + np.asarray(order)] * signs
    values[1 : len(order) + 1] = values[1 + np.asarray(order)]
    return replace(shape, laplace=replace(shape.laplace, vectors=vectors, values=values))


def test_signs_and_order_are_found(shape):
    order, signs = [0, 2, 1, 3, 4, 5, 7, 6, 8, 9, 11, 10], np.random.default_rng(0).choice([-1.0, 1.0], 12)
    found = signed_permutation(prepare_pair(shape, disordered(shape, order, signs)), 12, 1.0)
    expected = np.zeros((13, 13))
    expected[0, 0] = 1
    expected[1 + np.array(order), np.arange(12) + 1] = signs
    np.testing.assert_array_equal(found, expected)


@pytest.mark.long
def test_sides_of_a_symmetric_animal():
    """Only the pseudo-scalars tell; the wanted side decides between a map and its mirror image."""
    animal = prepare(creature(1500, symmetric=True, pose=2).mesh)
    found = {side: signed_permutation(prepare_pair(animal, animal), 12, side) for side in (1.0, -1.0)}
    np.testing.assert_array_equal(found[1.0], np.eye(13))
    mirrored = np.diag(found[-1.0])[:9]
    np.testing.assert_array_equal(np.abs(mirrored), 1)
    assert mirrored.min() == -1


@pytest.mark.long
@pytest.mark.parametrize(
    ("settings", "with_priors", "bound"),
    [
        ({}, True, 0.02),
        ({"style": 3}, False, 0.02),
        ({"kind": "biped"}, False, 0.02),
        ({"symmetric": True}, False, 0.03),
    ],
)
def test_poses_of_creatures(settings, with_priors, bound):
    made = (
        creature(1500, pose=1, triangulation=1, **settings),
        creature(2000, pose=5, triangulation=2, **settings),
    )
    source, target = (prepare(one.mesh) for one in made)
    truth = ground_truth(*made).vertices
    vertices = source.user_vertex[source.column_vertices[:5]]
    priors = {"landmarks": np.column_stack([vertices, truth[vertices]])} if with_priors else {}
    found = spectral_gradient_fields(source, target, **priors)
    assert found.origin == ("landmarks" if with_priors else "eigenfunctions")
    columns = geodesic_distances(target.surface, truth[::15]) / np.sqrt(target.surface.area)
    assert columns[np.arange(len(columns)), found.map.vertices[::15]].mean() < bound
    assert found.quality.orientation > 0.8


def test_without_gradients(shape):
    config = GradientFieldsConfig(n_functions=30, n_gradients=0)
    found = spectral_gradient_fields(shape, shape, config=config)
    assert (found.map.vertices == np.arange(shape.surface.n_vertices)).mean() > 0.99
