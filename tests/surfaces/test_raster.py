"""The depth buffer: which triangle is seen in a pixel, and where."""

import numpy as np

from isomatch.surfaces import rasterise

WIDTH, HEIGHT = 13, 9


def test_each_pixel_shows_the_nearest_triangle_around_its_centre():
    """The other route tests every triangle at every pixel, by three linear equations each."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-5, 20, (60, 3))
    points[:3] = points[0]  # no area
    faces = np.arange(60).reshape(-1, 3)
    raster = rasterise(points, faces, WIDTH, HEIGHT)
    seen = iter(raster.interpolated(points, faces))
    for row in range(HEIGHT):
        for column in range(WIDTH):
            nearest, depth = -1, -np.inf
            for f in range(1, len(faces)):
                corners = points[faces[f]]
                weights = np.linalg.solve([*corners[:, :2].T, np.ones(3)], [column + 0.5, row + 0.5, 1])
                if weights.min() >= 0 and weights @ corners[:, 2] > depth:
                    nearest, depth = f, weights @ corners[:, 2]
            assert raster.face[row, column] == nearest
            if nearest >= 0:
                np.testing.assert_allclose(next(seen), [column + 0.5, row + 0.5, depth])
                np.testing.assert_allclose(raster.depth[row, column], depth)
    assert 0.5 < raster.covered.mean() < 1
    assert next(seen, None) is None


def test_pixels_at_the_rim_of_the_image_and_of_triangles_are_filled():
    square = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]], dtype=float)
    assert rasterise(square, np.array([[0, 1, 2], [0, 2, 3]]), 4, 3).covered.all()
    centres = square * [0.75, 2 / 3, 0] + 0.5  # corners at the centres of pixels
    assert rasterise(centres, np.array([[0, 1, 2], [0, 2, 3]]), 4, 3).covered.all()
    assert not rasterise(square + np.array([9, 0, 0]), np.array([[0, 1, 2]]), 4, 3).covered.any()
