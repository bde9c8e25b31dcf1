"""Coarse triangles are drawn round."""

import numpy as np
import pytest

from isomatch import Mesh
from isomatch.visualization.surface_image import MAX_FACES, round_outline
from shapes import flat_grid, icosphere


def test_a_sphere_becomes_rounder_and_keeps_its_vertices():
    sphere = icosphere(1)
    fine, values, normals = round_outline(sphere, sphere.vertices)
    n = sphere.n_vertices
    np.testing.assert_array_equal(fine.vertices[:n], sphere.vertices)
    off = np.abs(np.linalg.norm(fine.vertices, axis=1) - 1)
    straight = np.abs(np.linalg.norm(values, axis=1) - 1)  # where points in the triangles are
    assert off.max() < 0.5 * straight.max()
    assert (np.einsum("ij,ij->i", fine.vertex_normals, normals) > 0.9).all()
    assert MAX_FACES / 4 < fine.n_faces <= MAX_FACES


def test_planes_stay_flat_and_borders_straight():
    grid = flat_grid(3, 4)
    fine, values, _ = round_outline(grid, grid.vertices)
    np.testing.assert_allclose(fine.vertices, values, atol=1e-12)
    assert fine.area == pytest.approx(grid.area)
    half = icosphere(2)
    half = Mesh(half.vertices, half.faces[(half.vertices[half.faces][:, :, 2] > -1e-9).all(axis=1)])
    fine, values, _ = round_outline(half, half.vertices)
    border = np.unique(fine.boundary_edges)
    np.testing.assert_allclose(fine.vertices[border], values[border], atol=1e-12)


def test_sharp_edges_stay_straight():
    blade = Mesh([[0, 0, 0], [1, 0, 0], [0.5, 1, 0]], [[0, 1, 2], [0, 2, 1]])
    fine, values, _ = round_outline(blade, blade.vertices)
    np.testing.assert_allclose(fine.vertices, values, atol=1e-12)


def test_fine_surfaces_and_none_are_drawn_as_they_are():
    sphere = icosphere(6)
    assert 4 * sphere.n_faces > MAX_FACES
    assert round_outline(sphere, sphere.vertices)[0] is sphere
    points = Mesh([[0, 0, 0]], np.zeros((0, 3), dtype=int))
    assert round_outline(points, points.vertices)[0] is points
