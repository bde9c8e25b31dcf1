"""The depth buffer: which triangle is seen in a pixel, and where."""

import numpy as np

from isomatch.surfaces import rasterise


def test_the_nearest_triangle_is_seen_and_positions_are_exact():
    points = np.array([[0, 0, 1], [10, 0, 1], [0, 10, 1], [0, 0, 5], [4, 0, 5], [0, 4, 5]], dtype=float)
    raster = rasterise(points, np.array([[0, 1, 2], [3, 4, 5]]), 10, 10)
    assert raster.face[1, 1] == 1
    assert raster.face[4, 4] == 0
    assert raster.face[9, 9] == -1
    seen = raster.interpolated(points, np.array([[0, 1, 2], [3, 4, 5]]))
    rows, columns = np.nonzero(raster.covered)
    np.testing.assert_allclose(seen[:, :2], np.column_stack([columns, rows]) + 0.5)
