"""Coverage and cycles of maps that can be counted by hand."""

import numpy as np
import pytest

from isomatch import Correspondence, MapError
from isomatch.evaluation import coverage, cycle_errors
from shapes import disguised, flat_grid, icosphere


def test_a_permutation_covers_all_and_its_inverse_undoes_it():
    sphere = icosphere(2)
    moved = disguised(sphere, seed=3)
    there = Correspondence(moved.new_vertex, sphere.n_vertices)
    assert coverage(moved.mesh, there) == pytest.approx(1)
    assert (cycle_errors(sphere, there, there.reversed()) == 0).all()


def test_a_half_is_half():
    grid = flat_grid(9, 41)
    x, y = grid.vertices[:, :2].T.astype(int)
    fold = Correspondence(41 * y + np.abs(x - 20) + 20, grid.n_vertices)
    on_the_fold = 0.5 / 40  # its vertices own area on both sides
    assert coverage(grid, fold) == pytest.approx(0.5 + on_the_fold)
    assert coverage(grid, fold, reach=20.01 / np.sqrt(grid.area)) == pytest.approx(1)
    errors = cycle_errors(grid, fold, fold) * np.sqrt(grid.area)
    np.testing.assert_allclose(errors, 2 * np.maximum(20 - x, 0), atol=1e-9)


def test_a_constant_map_covers_one_vertex():
    sphere = icosphere(1)
    n = sphere.n_vertices
    constant = Correspondence(np.full(n, 4), n)
    assert coverage(sphere, constant) == pytest.approx(sphere.vertex_areas[4] / sphere.area)
    assert coverage(sphere, Correspondence(np.full(n, -1), n)) == 0


def test_no_image_on_either_way_is_infinite():
    grid = flat_grid(3, 3)
    there, back = (Correspondence(np.where(np.arange(9) == hole, -1, np.arange(9)), 9) for hole in (2, 5))
    assert np.flatnonzero(np.isinf(cycle_errors(grid, there, back))).tolist() == [2, 5]
    assert len(cycle_errors(grid, there, back, n_points=4)) == 4


def test_maps_that_do_not_fit_are_reported():
    grid = flat_grid(3, 3)
    with pytest.raises(MapError, match="does not fit"):
        coverage(grid, Correspondence([0], 4))
    with pytest.raises(MapError, match="do not lead from"):
        cycle_errors(grid, Correspondence([0], 4), Correspondence([0, 0, 0, 0], 1))
