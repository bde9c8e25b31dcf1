"""Rasterisation with a depth buffer: the face that is visible in each pixel, the point on it, and its light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from isomatch._arrays import BoolArray, FloatArray, IntArray
from isomatch._compiled import compiled

KEY_LIGHT = np.array([-0.45, 0.65, 0.62])  # right, up, towards the viewer
FILL_LIGHT = np.array([0.75, 0.05, 0.45])
TOWARDS_VIEWER = np.array([0.0, 0.0, 1.0])
AMBIENT, KEY, FILL = 0.30, 0.62, 0.16
GLOSS, SHARPNESS = 0.10, 30.0
CREVICE_RADIUS = 0.025  # of the image height; radius of the surroundings that a depth is compared with
CREVICE_DEPTH = 0.06  # of the image height; depth below the surroundings at which a crevice is darkest
CREVICE_DARKNESS = 0.55
CREVICE_STEP = 6  # the surroundings are computed on every sixth pixel


@dataclass(frozen=True, eq=False)
class Raster:
    """The view of an orthographic camera.

    Parameters
    ----------
    face : (h, w) array of int
        Face visible in each pixel; −1 for the background. Row 0 is at the top.
    barycentric : (h, w, 3) array
        Barycentric coordinates of the visible point in that face.
    depth : (h, w) array
        Height above the image plane in pixels, towards the viewer; ``-inf`` for the background.
    """

    face: IntArray
    barycentric: FloatArray
    depth: FloatArray

    @property
    def covered(self) -> BoolArray:
        """(h, w) which pixels show the surface."""
        return self.face >= 0

    def interpolated(self, values: FloatArray, faces: IntArray) -> FloatArray:
        """Interpolate (n, q) vertex values in the covered pixels: (n_covered, q), in row order."""
        weights = self.barycentric[self.covered]
        corners = values[faces[self.face[self.covered]]]  # (n_covered, 3, q)
        seen: FloatArray = np.einsum("pc,pcq->pq", weights, corners)
        return seen


def rasterise(points: FloatArray, faces: IntArray, width: int, height: int) -> Raster:
    """Find which triangle is visible in each pixel.

    Parameters
    ----------
    points : (n, 3) array
        Column, row and height towards the viewer of each vertex, in pixels.
    faces : (m, 3) array of int
        Triangles.
    width, height : int
        Size of the image in pixels.

    Returns
    -------
    Raster
        A pixel shows the nearest triangle that contains its centre. Time is linear in faces and covered pixels.
    """
    raster = Raster(
        np.full((height, width), -1, dtype=np.int64),
        np.zeros((height, width, 3)),
        np.full((height, width), -np.inf),
    )
    _fill(points, faces, raster.face, raster.barycentric, raster.depth)
    return raster


@compiled()
def _fill(
    points: FloatArray, faces: IntArray, face: IntArray, barycentric: FloatArray, depth: FloatArray
) -> None:  # pragma: no cover - compiled
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


def light(raster: Raster, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the light of the covered pixels.

    Parameters
    ----------
    raster : Raster
        The visible faces.
    normals : (n_covered, 3) array
        Normals in camera coordinates: right, up, towards the viewer. Normals that point away are reversed.

    Returns
    -------
    diffuse, gloss : (n_covered,) array
        Factor of the colour of the surface, and amount of white added to it.

    Notes
    -----
    Lambertian reflection of a key light and a fill light, both wrapped around the object, and a Blinn highlight.
    Crevices are darkened by the difference between the depth and the blurred depth (Luft, Colditz & Deussen, *Image
    enhancement by unsharp masking the depth buffer*, SIGGRAPH 2006).
    """
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    unit = np.where(unit[:, 2:] < 0, -unit, unit)
    key, fill = (direction / np.linalg.norm(direction) for direction in (KEY_LIGHT, FILL_LIGHT))
    lit = AMBIENT + KEY * _wrapped(unit @ key) + FILL * _wrapped(unit @ fill)
    halfway = key + TOWARDS_VIEWER
    gloss = GLOSS * np.maximum(unit @ (halfway / np.linalg.norm(halfway)), 0.0) ** SHARPNESS
    return lit * (1.0 - CREVICE_DARKNESS * _crevices(raster)), gloss


def _wrapped(cosine: FloatArray) -> FloatArray:
    bright: FloatArray = (0.5 + 0.5 * cosine) ** 1.5
    return bright


def _crevices(raster: Raster) -> FloatArray:
    """Measure how far each covered pixel lies below its surroundings, 0 … 1."""
    covered, height = raster.covered, raster.depth.shape[0]
    coarse = slice(None, None, CREVICE_STEP), slice(None, None, CREVICE_STEP)
    blur = CREVICE_RADIUS * height / CREVICE_STEP
    share = gaussian_filter(covered[coarse].astype(np.float64), blur)
    depth = gaussian_filter(np.where(covered, raster.depth, 0.0)[coarse], blur)
    rows, columns = (np.flatnonzero(covered) // covered.shape[1], np.flatnonzero(covered) % covered.shape[1])
    surroundings = map_coordinates(
        depth / np.maximum(share, 1e-6),
        [rows / CREVICE_STEP, columns / CREVICE_STEP],
        order=1,
        mode="nearest",
    )
    below: FloatArray = np.clip((surroundings - raster.depth[covered]) / (CREVICE_DEPTH * height), 0.0, 1.0)
    return below
