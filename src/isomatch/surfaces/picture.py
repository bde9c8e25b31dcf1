"""A small picture of a mesh, for notebooks."""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO

import numpy as np

from isomatch.surfaces._faces import unsound_faces
from isomatch.surfaces._normals import vertex_normals
from isomatch.surfaces.raster import rasterise
from isomatch.values.arrays import FloatArray, IntArray

SIZE = 240  # pixels of the longer side
LIGHT = np.array([-0.4, 0.5, 0.77])  # right, up, towards the viewer


def picture(vertices: FloatArray, faces: IntArray, title: str, colours: FloatArray | None = None) -> str:
    """Draw a mesh as an HTML image, seen along its shortest side, the longest one upright.

    Parameters
    ----------
    vertices, faces : (n, 3) array of float, (m, 3) array of int
        Any mesh; faces that are not sound are left out. Without others the text is empty.
    title : str
        What it is, for who cannot see it.
    colours : (n, 3) array of float, optional
        Red, green and blue of each vertex, 0…1; grey where ``nan``, and by default.
    """
    from matplotlib.image import imsave  # takes longer to import than all else

    faces = faces[~unsound_faces(vertices, faces).any]
    if not len(faces):
        return ""
    drawn, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3)
    points = vertices[drawn] / (np.abs(vertices[drawn]).max() or 1.0)
    axes = np.argsort(np.ptp(points, axis=0), kind="stable")[[1, 2, 0]]  # right, up, towards the viewer
    side = np.linalg.det(
        np.eye(3)[axes]
    )  # −1: the picture is seen from behind, or it would be a mirror image
    seen = (points - points.min(axis=0))[:, axes]
    seen *= (SIZE - 2) / (seen[:, 1].max() or 1.0)
    width, height = (int(np.ceil(length)) + 2 for length in seen[:, :2].max(axis=0))
    normals = vertex_normals(points, faces)[:, axes] * [1.0, 1.0, side]
    seen *= [1.0, -1.0, side]
    seen += [1.0, height - 1.0, 0.0]
    raster = rasterise(seen, faces, width, height)
    shade = np.abs(raster.interpolated(normals, faces) @ LIGHT).clip(0, 1)
    paint = np.full((len(drawn), 3), 0.8)
    if colours is not None:
        paint = np.where(np.isnan(colours[drawn]), 0.6, colours[drawn])
    pixels = np.zeros((height, width, 4))
    pixels[raster.covered, 3] = 1.0
    pixels[raster.covered, :3] = (raster.interpolated(paint, faces) * (0.3 + 0.7 * shade[:, None])).clip(0, 1)
    file = BytesIO()
    imsave(file, pixels, format="png")
    return f'<img alt="{title}" src="data:image/png;base64,{b64encode(file.getvalue()).decode("ascii")}">'
