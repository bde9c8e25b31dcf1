"""Maps joined by the geometric median of their images."""

import numpy as np
import pytest

from isomatch import Correspondence, MapError, Mesh
from isomatch.correspondence import geometric_median, median_map
from shapes import icosphere

BALL = icosphere(2)
N = BALL.n_vertices


def precise(seed):
    """A map of five vertices to points inside triangles of the ball."""
    rng = np.random.default_rng(seed)
    faces, weights = BALL.faces[rng.choice(BALL.n_faces, 5)], rng.dirichlet(np.ones(3), 5)
    nearest = faces[np.arange(5), weights.argmax(axis=1)]
    return Correspondence(nearest, N, faces, weights)


def test_equal_maps_are_their_median():
    one = precise(0)
    for count in (1, 2, 3, 5):
        joined = median_map([one] * count, BALL)
        np.testing.assert_allclose(joined.pull_back(BALL.vertices), one.pull_back(BALL.vertices), atol=1e-5)


def test_one_wrong_map_of_three_changes_nothing_where_the_others_agree():
    right, wrong = precise(0), precise(1)
    joined = median_map([right, wrong, right], BALL)
    np.testing.assert_allclose(joined.pull_back(BALL.vertices), right.pull_back(BALL.vertices), atol=1e-5)


def test_the_order_of_the_maps_does_not_matter():
    maps = [precise(seed) for seed in range(4)]
    found, expected = (median_map(order, BALL).pull_back(BALL.vertices) for order in (maps, maps[::-1]))
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_images_lie_inside_triangles_not_only_at_vertices():
    flat = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    joined = median_map([Correspondence([0], 3), Correspondence([1], 3)], flat)
    np.testing.assert_allclose(joined.pull_back(flat.vertices), [[0.5, 0, 0]], atol=1e-12)


def test_a_median_stays_on_a_sheet_of_the_images():
    """Of a folded strip, whose other sheet passes between the images, nearer to their median."""
    near, far = (
        [[x, y, 0.0] for x in (0, 1, 2) for y in (0, 1)],
        [[x, y, -0.1] for x in (0, 1, 2) for y in (0, 1)],
    )
    bend = [[1, y, 0.5] for y in (0, 1)]  # the images' sheet is a roof over the other one
    faces = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]])
    roof = np.array(near)
    roof[2:4] = bend
    folded = Mesh(np.concatenate([roof, far]), np.concatenate([faces, faces + 6]))
    joined = median_map([Correspondence([0], 12), Correspondence([4], 12)], folded)
    assert joined.vertices[0] < 6


def test_an_image_of_at_least_half_of_the_maps_counts():
    some, none = Correspondence([0, 0], N), Correspondence([-1, 0], N)
    assert median_map([some, none], BALL).matched.tolist() == [True, True]
    assert median_map([some, none, none], BALL).matched.tolist() == [False, True]
    assert not median_map([Correspondence([-1], N)] * 2, BALL).matched.any()


def test_maps_that_do_not_belong_together_are_refused():
    with pytest.raises(MapError, match="join"):
        median_map([], BALL)
    with pytest.raises(MapError, match="different"):
        median_map([Correspondence([0], N), Correspondence([0, 1], N)], BALL)
    with pytest.raises(MapError, match="target"):
        median_map([Correspondence([0], 3)], BALL)


def test_a_median_that_is_one_of_the_points_is_found():
    corner = np.array([[[0.0, 0, 0]], [[1, 0, 0]], [[0, 1, 0]], [[0.2, 0.2, 0]]])
    np.testing.assert_allclose(geometric_median(corner), [[0.2, 0.2, 0]], atol=1e-9)
    np.testing.assert_allclose(geometric_median(corner, 1e-6), [[0.2, 0.2, 0]], atol=1e-5)
