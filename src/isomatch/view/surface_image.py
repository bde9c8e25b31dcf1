"""The image of one surface. All pictures are composed of these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch.loading.compiled import compiled
from isomatch.surfaces import Mesh, rasterise
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property
from isomatch.view.camera import camera_of, of_ordinary_size, seen_from, used_vertices
from isomatch.view.colours import UNMATCHED_GREY, from_screen, to_screen
from isomatch.view.finer import finer
from isomatch.view.lighting import light

OVERSAMPLING = 2  # samples per pixel and axis


@dataclass(frozen=True, eq=False)
class SurfaceView:
    """A surface with values at its vertices, their colours, and a camera. Coarse triangles are drawn round, see `finer`.

    Parameters
    ----------
    mesh : Mesh
        The surface.
    camera : (3, 3) array
        See `camera_of`.
    values : (n, q) array of float
        Values at the vertices.
    paint : callable
        Maps the values interpolated in m pixels, (m, q), to colours in linear light, (m, 3); nan is drawn grey.
    """

    mesh: Mesh
    camera: FloatArray
    values: FloatArray
    paint: Callable[[FloatArray], FloatArray]

    @cached_property
    def _finer(self) -> tuple[Mesh, FloatArray, FloatArray]:
        return finer(self.mesh, self.values)

    def extent(self) -> FloatArray:
        """Return the width and height of the surface, scaled to unit area."""
        mesh, _, _ = self._finer
        drawn = seen_from(self.camera, mesh)[used_vertices(mesh)]
        return np.asarray(np.ptp(drawn, axis=0)[:2], dtype=np.float64)

    def pixels(self, width: int, height: int, scale: float) -> FloatArray:
        """Draw the image, (height, width, 4), in sRGB with opacity, at ``scale`` pixels per unit."""
        width, height, scale = width * OVERSAMPLING, height * OVERSAMPLING, scale * OVERSAMPLING
        mesh, values, normals = self._finer
        points = seen_from(self.camera, mesh) * [scale, -scale, scale] + [width / 2, height / 2, 0.0]
        faces = mesh.faces
        raster = rasterise(points, faces, width, height)
        colour = self.paint(raster.interpolated(values, faces))
        colour = np.where(np.isnan(colour), UNMATCHED_GREY, colour)
        diffuse, gloss = light(raster, raster.interpolated(normals @ self.camera.T, faces))
        mean = np.zeros((height // OVERSAMPLING, width // OVERSAMPLING, 4))
        _collect(raster.face, colour * diffuse[:, None] + gloss[:, None], mean)
        opacity = mean[..., 3:]
        return np.concatenate([to_screen(mean[..., :3] / np.maximum(opacity, 1e-6)), opacity], axis=2)


@compiled()
def _collect(face: IntArray, colour: FloatArray, mean: FloatArray) -> None:
    """Add the samples of each pixel, with opacity."""
    height, width = face.shape
    share = 1.0 / OVERSAMPLING**2
    sample = 0
    for row in range(height):
        for column in range(width):
            if face[row, column] < 0:
                continue
            pixel = mean[row // OVERSAMPLING, column // OVERSAMPLING]
            for channel in range(3):
                pixel[channel] += share * colour[sample, channel]
            pixel[3] += share
            sample += 1


def surface_image(
    mesh: Mesh,
    values: ArrayLike,
    paint: Callable[[FloatArray], FloatArray],
    camera: FloatArray | None = None,
    resolution: float = 400.0,
) -> FloatArray:
    """Draw a surface, coloured in every pixel by values interpolated from its vertices.

    Parameters
    ----------
    mesh : Mesh
        The surface.
    values : (n,) or (n, q) array_like of float
        Values at the vertices. For sharp borders of a field that is constant in regions, give one column per region
        and a ``paint`` that takes the largest column.
    paint : callable
        Maps interpolated values, (m, q), to sRGB colours, (m, 3), 0 … 1.
    camera : (3, 3) array, optional
        Rows: right, up, towards the viewer; by default those of `camera_of`.
    resolution : float
        Pixels per √area, so that shapes drawn with the same resolution have equal area.

    Returns
    -------
    (height, width, 4) array of float
        sRGB colours and opacity, cropped to the surface.
    """
    mesh = of_ordinary_size(mesh)
    columns = np.asarray(values, dtype=np.float64).reshape(mesh.n_vertices, -1)
    view = SurfaceView(
        mesh, camera_of(mesh) if camera is None else camera, columns, lambda seen: from_screen(paint(seen))
    )
    width, height = (int(side) + 2 for side in np.ceil(resolution * view.extent()))
    return view.pixels(width, height, resolution)
