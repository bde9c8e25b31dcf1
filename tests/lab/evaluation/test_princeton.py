"""Errors of maps whose errors are known."""

import numpy as np
import pytest

from isomatch import Correspondence, MapError, geodesic_distances
from isomatch.evaluation import area_under_curve, counted, cumulative_curve, geodesic_errors, sided_errors
from shapes import flat_grid


@pytest.fixture(scope="module")
def sheet():
    return flat_grid(12, 15)


def test_true_map_has_no_error(sheet):
    rows = np.arange(sheet.n_vertices)
    errors = geodesic_errors(sheet, Correspondence(rows, len(rows)), np.column_stack([rows, rows]))
    assert (errors == 0).all()


def test_error_is_the_distance_on_the_target_over_root_area(sheet):
    rows = np.arange(sheet.n_vertices)
    elsewhere = np.full(len(rows), 7)
    errors = geodesic_errors(sheet, Correspondence(elsewhere, len(rows)), np.column_stack([rows, rows]))
    exact = geodesic_distances(sheet, rows)[rows, 7] / np.sqrt(sheet.area)
    np.testing.assert_allclose(errors, exact)


def test_unmatched_is_infinitely_wrong(sheet):
    image = np.arange(sheet.n_vertices)
    image[3] = -1
    errors = geodesic_errors(sheet, Correspondence(image, len(image)), np.array([[3, 3], [4, 4]]))
    assert errors.tolist() == [np.inf, 0.0]


def test_drawn_points_are_those_of_the_seed(sheet):
    rows = np.arange(sheet.n_vertices)
    found = Correspondence(rows[::-1], len(rows))
    truth = np.column_stack([rows, rows])
    first, again, other = (geodesic_errors(sheet, found, truth, 40, seed) for seed in (1, 1, 2))
    assert len(first) == 40
    assert (first == again).all()
    assert (first != other).any()


def test_curve_counts_errors_up_to_each_threshold():
    curve = cumulative_curve(np.array([0.0, 0.1, 0.1, np.inf]), np.array([0.0, 0.05, 0.1, 0.2]))
    assert curve.tolist() == [0.25, 0.25, 0.75, 0.75]


def test_area_under_the_curve_is_that_of_the_steps():
    errors = np.random.default_rng(0).random(200) / 3
    fine = np.linspace(0, 0.25, 100_001)
    assert area_under_curve(errors) == pytest.approx(cumulative_curve(errors, fine).mean(), abs=1e-4)
    assert area_under_curve(np.zeros(3)) == 1
    assert area_under_curve(np.array([0.25, 0.3, np.inf])) == 0


def test_one_flip_is_decided_for_the_whole_map(sheet):
    n = sheet.n_vertices
    rows, mirror = np.arange(n), sheet.vertices[:, 1].astype(int) * 15 + 14 - sheet.vertices[:, 0].astype(int)
    truth, mirrored = (np.column_stack([rows, image]) for image in (rows, mirror))
    mostly = np.where(rows < n // 3, rows, mirror)
    errors = sided_errors(sheet, Correspondence(mostly, n), truth, mirrored)
    assert errors.flipped
    assert (errors.better == errors.mirrored).all()
    assert errors.better[: n // 3].max() > 0, "the vertices that chose the other side stay wrong"
    assert not sided_errors(sheet, Correspondence(rows, n), truth, mirrored).flipped
    assert sided_errors(sheet, Correspondence(rows, n), truth).mirrored is None


def test_truths_over_other_vertices_are_reported(sheet):
    truth = np.array([[3, 3], [4, 4]])
    with pytest.raises(MapError, match="vertices"):
        sided_errors(sheet, Correspondence(np.arange(180), 180), truth, truth[::-1])


def test_unmatched_counts_as_the_root_of_the_area():
    assert counted(np.array([0.0, 0.5, np.inf])).tolist() == [0.0, 0.5, 1.0]
