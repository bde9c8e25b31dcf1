"""Metric distortion of maps that change distances in a known way."""

import numpy as np
import pytest

from isomatch import Correspondence, MapError, Mesh, geodesic_distances
from isomatch_lab.evaluation import metric_distortion
from shapes import disguised, flat_grid, planar_delaunay, two_spheres


@pytest.fixture(scope="module")
def sheet():
    return planar_delaunay(300)


def identity(mesh):
    return Correspondence(np.arange(mesh.n_vertices), mesh.n_vertices)


def test_an_isometry_has_none(sheet):
    moved = disguised(sheet, seed=2, scale=3.0)
    found = metric_distortion(
        sheet, moved.mesh, Correspondence(moved.new_vertex, sheet.n_vertices), n_rows=50
    )
    assert found.linf < 1e-6
    assert found.l2 < 1e-12


def test_scaling_counts_in_mesh_units_alone():
    grid = flat_grid(1 + 12, 1 + 16)
    double = Mesh(2 * grid.vertices, grid.faces)
    found = metric_distortion(grid, double, identity(grid), normalised=False)
    distances = geodesic_distances(grid, np.arange(grid.n_vertices))
    assert found.linf == pytest.approx(distances.max() / 2)
    assert found.l2 == pytest.approx((distances**2).mean()), "all vertices are drawn at both ends"
    assert metric_distortion(grid, double, identity(grid)).linf < 1e-12


def test_a_constant_map_loses_every_distance():
    grid = flat_grid(8, 9)
    found = metric_distortion(grid, grid, Correspondence(np.full(72, 5), 72))
    distances = geodesic_distances(grid, np.arange(72)) / np.sqrt(grid.area)
    assert found.linf == pytest.approx(distances.max() / 2)
    assert found.l2 == pytest.approx((distances**2).mean())


def test_truth_is_judged_on_the_same_points(sheet):
    n = sheet.n_vertices
    wide = Mesh(sheet.vertices * [1.3, 1, 1], sheet.faces)
    truth = np.column_stack([np.arange(n), np.arange(n)])[::3]
    found = metric_distortion(sheet, wide, identity(sheet), truth, n_rows=20, n_columns=30, seed=4)
    assert (found.linf, found.l2) == (found.truth.linf, found.truth.l2)
    wrong = metric_distortion(sheet, wide, Correspondence(np.arange(n)[::-1], n), truth, n_rows=20, seed=4)
    assert wrong.l2 > 5 * wrong.truth.l2 > 0


def test_unmatched_points_are_left_out_and_no_map_is_an_error(sheet):
    image = np.arange(sheet.n_vertices)
    image[::2] = -1
    assert metric_distortion(sheet, sheet, Correspondence(image, len(image)), n_rows=20).linf < 1e-9
    with pytest.raises(MapError, match="maps none of the points"):
        metric_distortion(sheet, sheet, Correspondence(np.full(len(image), -1), len(image)))
    with pytest.raises(MapError, match="does not fit"):
        metric_distortion(sheet, flat_grid(3, 3), identity(sheet))


def test_torn_components_are_infinitely_distorted():
    spheres = two_spheres(1, 1.0)
    n = spheres.n_vertices
    kept = metric_distortion(spheres, spheres, Correspondence(np.roll(np.arange(n), n // 2), n), n_rows=30)
    assert kept.linf < 1e-9, "the spheres change places; distances between them are inf on both sides"
    torn = np.arange(n)
    torn[: n // 4] = n - 1
    assert metric_distortion(spheres, spheres, Correspondence(torn, n)).linf == np.inf
