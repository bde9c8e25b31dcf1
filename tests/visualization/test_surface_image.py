"""Single surfaces as pixels: what is seen, sharp regions, one scale, the axis that points up."""

import numpy as np
import pytest

from isomatch import Mesh
from isomatch.visualization import camera_of, surface_image
from shapes import icosphere

BALL = icosphere(3)
SIDES = np.column_stack([BALL.vertices[:, 0], -BALL.vertices[:, 0]])  # which half of the ball
COLOURS = np.array([[1.0, 0.5, 0.0], [0.0, 0.2, 1.0]])
FRONT = np.eye(3)


def halves(seen):
    return COLOURS[seen.argmax(axis=1)]


def test_regions_are_where_they_should_be_and_sharp():
    image = surface_image(BALL, SIDES, halves, FRONT, resolution=200)
    height, width, _ = image.shape
    assert height == pytest.approx(width, abs=2)
    assert width == pytest.approx(200 * 2 / np.sqrt(BALL.area), abs=4)
    inside = image[..., 3] == 1
    orange = inside & (image[..., 0] > image[..., 2])
    assert not orange[:, : width // 2 - 2].any()
    assert orange[:, width // 2 + 2 :][inside[:, width // 2 + 2 :]].all()
    mixed = inside & (np.abs(image[..., 0] - image[..., 2]) < 0.15)
    assert not mixed[:, : width // 2 - 2].any(), "no blend of two colours away from the border"


def test_scale_is_that_of_equal_areas():
    larger = Mesh(3 * BALL.vertices, BALL.faces)
    one, other = (surface_image(mesh, SIDES, halves, FRONT, 100) for mesh in (BALL, larger))
    np.testing.assert_allclose(one, other, atol=1e-6)


def test_values_that_are_not_known_are_grey():
    image = surface_image(
        BALL, np.full(BALL.n_vertices, np.nan), lambda seen: np.repeat(seen, 3, axis=1), FRONT
    )
    solid = image[image[..., 3] == 1]
    assert np.ptp(solid[:, :3], axis=1).max() < 1e-6


@pytest.mark.parametrize("up_axis", [1, 2])
def test_the_axis_that_points_up_can_be_told(up_axis):
    long = Mesh(BALL.vertices * [1, 5, 2], BALL.faces)
    camera = camera_of(long, up_axis)
    assert camera[1, up_axis] > 0.9
    np.testing.assert_allclose(camera @ camera.T, np.eye(3), atol=1e-9)
