"""Rasterisation with a depth buffer: the visible face of each pixel, and the point on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled


@dataclass(frozen=True, eq=False)
class Raster:
    """The view of an orthographic camera, (h, w) pixels, row 0 at the top."""

    face: IntArray  # (h, w) visible face, −1 for the background
    barycentric: FloatArray  # (h, w, 3) coordinates of the visible point in its face
    depth: FloatArray  # (h, w) height above the image plane in pixels, towards the viewer; −inf for the background

    @property
    def covered(self) -> BoolArray:
        """(h, w) whether a pixel shows the surface."""
        return self.face >= 0

    def interpolated(self, values: FloatArray, faces: IntArray) -> FloatArray:
        """Interpolate (n, q) vertex values in the covered pixels: (n_covered, q), in row order."""
        seen = np.empty((int(self.covered.sum()), values.shape[1]))
        _interpolate(self.face, self.barycentric, faces, np.ascontiguousarray(values, dtype=np.float64), seen)
        return seen


def rasterise(points: FloatArray, faces: IntArray, width: int, height: int) -> Raster:
    """Find which triangle is visible in each pixel: the nearest of those that contain its centre.

    Points (n, 3) are column, row and height towards the viewer of each vertex, in pixels. Time is linear in faces and
    covered pixels.
    """
    raster = Raster(
        np.full((height, width), -1, dtype=np.int64),
        np.zeros((height, width, 3)),
        np.full((height, width), -np.inf),
    )
    _fill(points, faces, raster.face, raster.barycentric, raster.depth)
    return raster


@compiled()
def _interpolate(
    face: IntArray, barycentric: FloatArray, faces: IntArray, values: FloatArray, seen: FloatArray
) -> None:
    height, width = face.shape
    pixel = 0
    for row in range(height):
        for column in range(width):
            f = face[row, column]
            if f < 0:
                continue
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            u, v, w = barycentric[row, column, 0], barycentric[row, column, 1], barycentric[row, column, 2]
            for q in range(values.shape[1]):
                seen[pixel, q] = u * values[a, q] + v * values[b, q] + w * values[c, q]
            pixel += 1


@compiled()
def _fill(
    points: FloatArray, faces: IntArray, face: IntArray, barycentric: FloatArray, depth: FloatArray
) -> None:
    height, width = depth.shape
    for f in range(len(faces)):
        a, b, c = points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]]
        doubled = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if doubled == 0.0:
            continue
        first_row = max(int(np.ceil(min(a[1], b[1], c[1]) - 0.5)), 0)
        last_row = min(int(np.floor(max(a[1], b[1], c[1]) - 0.5)), height - 1)
        first_column = max(int(np.ceil(min(a[0], b[0], c[0]) - 0.5)), 0)
        last_column = min(int(np.floor(max(a[0], b[0], c[0]) - 0.5)), width - 1)
        for row in range(first_row, last_row + 1):
            y = row + 0.5
            for column in range(first_column, last_column + 1):
                x = column + 0.5
                v = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / doubled
                w = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / doubled
                u = 1.0 - v - w
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                z = u * a[2] + v * b[2] + w * c[2]
                if z > depth[row, column]:
                    depth[row, column] = z
                    face[row, column] = f
                    barycentric[row, column, 0] = u
                    barycentric[row, column, 1] = v
                    barycentric[row, column, 2] = w
