"""Images inside triangles, against brute force."""

import numpy as np
import pytest

from isomatch.correspondence import nearest_points
from isomatch.datasets import example_pair
from shapes import flat_grid


def test_points_of_a_plane_are_met_exactly():
    sheet = flat_grid(9, 11)
    rng = np.random.default_rng(0)
    low, high = sheet.vertices.min(axis=0), sheet.vertices.max(axis=0)
    points = rng.uniform(low, high, (300, 3))
    vertex = ((points[:, None] - sheet.vertices) ** 2).sum(axis=2).argmin(axis=1)
    corners, weights = nearest_points(sheet.vertices, points, sheet.faces, vertex)
    found = (weights[:, :, None] * sheet.vertices[corners]).sum(axis=1)
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    np.testing.assert_allclose(found[:, :2], points[:, :2], atol=1e-12)


def test_no_sampled_point_of_the_faces_around_is_nearer():
    """In seven dimensions, where triangles are flat but the surface is not."""
    mesh = example_pair()[0].mesh
    rng = np.random.default_rng(1)
    places = mesh.vertices @ rng.standard_normal((3, 7)) + 0.02 * rng.standard_normal((mesh.n_vertices, 7))
    vertex = rng.integers(mesh.n_vertices, size=40)
    points = places[vertex] + 0.2 * rng.standard_normal((40, 7))
    corners, weights = nearest_points(places, points, mesh.faces, vertex)
    found = np.linalg.norm((weights[:, :, None] * places[corners]).sum(axis=1) - points, axis=1)
    assert weights.min() > -1e-15
    share = rng.dirichlet(np.ones(3), 400)
    for i, v in enumerate(vertex):
        around = mesh.faces[(mesh.faces == v).any(axis=1)]
        samples = np.einsum("sc,fcd->fsd", share, places[around])
        assert found[i] <= np.linalg.norm(samples - points[i], axis=2).min() + 1e-12
        assert found[i] <= np.linalg.norm(places[v] - points[i]) + 1e-12


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_units_do_not_matter(scale):
    mesh = example_pair()[0].mesh
    rng = np.random.default_rng(2)
    points = mesh.vertices + 0.02 * rng.standard_normal(mesh.vertices.shape)
    rows = np.arange(mesh.n_vertices)
    corners, weights = nearest_points(mesh.vertices, points, mesh.faces, rows)
    again, scaled = nearest_points(scale * mesh.vertices, scale * points, mesh.faces, rows)
    assert (weights > 0).all(axis=1).mean() > 0.1
    np.testing.assert_array_equal(again, corners)
    np.testing.assert_allclose(scaled, weights, atol=1e-9)


@pytest.mark.long
def test_a_vertex_stays_where_it_is():
    mesh = example_pair()[0].mesh
    rows = np.arange(mesh.n_vertices)
    corners, weights = nearest_points(mesh.vertices, mesh.vertices, mesh.faces, rows)
    assert (corners[:, 0] == rows).all()
    assert (weights == [1.0, 0.0, 0.0]).all()
