"""The light of a rasterised surface, in every pixel."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from isomatch.loading.compiled import compiled
from isomatch.surfaces import Raster
from isomatch.values.arrays import FloatArray

KEY_LIGHT = np.array([-0.45, 0.65, 0.62])  # right, up, towards the viewer
FILL_LIGHT = np.array([0.75, 0.05, 0.45])
TOWARDS_VIEWER = np.array([0.0, 0.0, 1.0])
AMBIENT, KEY, FILL = 0.30, 0.62, 0.16
GLOSS, SHARPNESS = 0.10, 30.0
CREVICE_RADIUS = 0.025  # of the image height; radius of the surroundings that a depth is compared with
CREVICE_DEPTH = 0.06  # of the image height; depth below the surroundings at which a crevice is darkest
CREVICE_DARKNESS = 0.55
CREVICE_STEP = 6  # the surroundings are computed on every sixth pixel


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
    key, fill = (direction / np.linalg.norm(direction) for direction in (KEY_LIGHT, FILL_LIGHT))
    halfway = key + TOWARDS_VIEWER
    diffuse, gloss = np.empty((2, len(normals)))
    _reflect(normals, key, fill, halfway / np.linalg.norm(halfway), diffuse, gloss)
    return diffuse * (1.0 - CREVICE_DARKNESS * _crevices(raster)), gloss


@compiled()
def _reflect(
    normals: FloatArray,
    key: FloatArray,
    fill: FloatArray,
    halfway: FloatArray,
    diffuse: FloatArray,
    gloss: FloatArray,
) -> None:
    for i in range(len(normals)):
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        length = max(np.sqrt(x * x + y * y + z * z), 1e-12)
        if z < 0.0:
            length = -length
        x, y, z = x / length, y / length, z / length
        from_key = 0.5 + 0.5 * (x * key[0] + y * key[1] + z * key[2])
        from_fill = 0.5 + 0.5 * (x * fill[0] + y * fill[1] + z * fill[2])
        diffuse[i] = AMBIENT + KEY * from_key**1.5 + FILL * from_fill**1.5
        gloss[i] = GLOSS * max(x * halfway[0] + y * halfway[1] + z * halfway[2], 0.0) ** SHARPNESS


def _crevices(raster: Raster) -> FloatArray:
    """Measure how far each covered pixel lies below its surroundings, 0 … 1."""
    covered, height = raster.covered, raster.depth.shape[0]
    if not covered.any():  # of a surface that is smaller than a pixel
        return np.zeros(0)
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
