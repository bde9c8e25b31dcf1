"""Energies of maps of the plane whose derivatives are known."""

import numpy as np
import pytest

from isomatch import Correspondence, MapError, Mesh
from isomatch_lab.evaluation import dirichlet_energy
from shapes import disguised, flat_grid, icosphere, planar_delaunay


def identity(mesh):
    return Correspondence(np.arange(mesh.n_vertices), mesh.n_vertices)


@pytest.mark.parametrize("surface", [planar_delaunay(200), icosphere(2)], ids=["sheet", "sphere"])
def test_an_isometry_and_a_scaling_keep_the_energy(surface):
    moved = disguised(surface, seed=1, scale=5.0)
    found = Correspondence(moved.new_vertex, surface.n_vertices)
    assert dirichlet_energy(surface, moved.mesh, found) == pytest.approx(1)


def test_a_linear_map_has_the_energy_of_its_matrix():
    sheet, (a, b) = planar_delaunay(200), (3.0, 0.5)
    stretched = Mesh(sheet.vertices * [a, b, 1], sheet.faces)
    assert dirichlet_energy(sheet, stretched, identity(sheet)) == pytest.approx((a / b + b / a) / 2)


def test_a_constant_map_has_no_energy():
    sheet = planar_delaunay(50)
    constant = Correspondence(np.full(50, 7), 50)
    assert dirichlet_energy(sheet, sheet, constant) == 0


def test_a_fold_is_smooth():
    grid = flat_grid(5, 9)  # columns x = 0…8 folded about x = 4
    x, y = grid.vertices[:, :2].T.astype(int)
    fold = Correspondence(9 * y + np.abs(x - 4) + 4, grid.n_vertices)
    assert dirichlet_energy(grid, grid, fold) == pytest.approx(1)


def test_a_jump_has_much_energy():
    grid = flat_grid(4, 8)
    x = grid.vertices[:, 0].astype(int)
    shifted = Correspondence(np.arange(32) - x + (x + 4) % 8, 32)
    assert dirichlet_energy(grid, grid, shifted) > 3


def test_precise_images_are_smoother_than_vertices():
    """Halving every step towards one corner: between vertices, only precise images can do it."""
    grid = flat_grid(5, 5)
    x, y = grid.vertices[:, :2].T.astype(int)
    low = 5 * (y // 2) + x // 2
    corners = np.column_stack([low + 0, low + 5 * (y % 2) + x % 2, low])
    halved = Correspondence(low, 25, corners, np.tile([0.5, 0.5, 0.0], (25, 1)))
    np.testing.assert_allclose(halved @ grid.vertices, grid.vertices / 2)
    assert dirichlet_energy(grid, grid, halved) == pytest.approx(1 / 4)
    assert dirichlet_energy(grid, grid, Correspondence(low, 25)) > 1 / 4


def test_faces_without_images_or_area_are_left_out():
    grid = flat_grid(3, 3)
    image = np.arange(9)
    image[0] = -1
    assert dirichlet_energy(grid, grid, Correspondence(image, 9)) == pytest.approx(3 / 4)
    needle = Mesh(np.vstack([grid.vertices, grid.vertices[:1]]), np.vstack([grid.faces, [0, 1, 9]]))
    assert dirichlet_energy(needle, needle, identity(needle)) == pytest.approx(1)


def test_a_map_of_other_shapes_is_reported():
    with pytest.raises(MapError, match="does not fit"):
        dirichlet_energy(flat_grid(3, 3), flat_grid(3, 4), identity(flat_grid(3, 3)))
