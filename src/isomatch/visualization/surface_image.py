"""The image of one surface, used in all pictures: rounded, rasterised, lit in every pixel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter, map_coordinates

from isomatch._core.arrays import FloatArray
from isomatch._core.cached import cached_property
from isomatch.io import linear_of
from isomatch.surfaces import Mesh, Raster, rasterise
from isomatch.visualization.camera import camera_of, of_ordinary_size, seen_from, used_vertices
from isomatch.visualization.colours import UNMATCHED_GREY, to_screen

OVERSAMPLING = 2  # samples per pixel along each axis; a pixel is the mean of its samples; chosen


@dataclass(frozen=True, eq=False)
class SurfaceView:
    """A surface with values at its vertices, their colours, and a camera; coarse triangles are drawn round."""

    mesh: Mesh
    camera: FloatArray  # rotation (3, 3), see `camera_of`
    values: FloatArray  # q values at each of the n vertices, (n, q)
    # The function turns the values of m pixels (m, q) into linear light (m, 3); nan is drawn grey.
    paint: Callable[[FloatArray], FloatArray] = lambda colours: colours
    title: str = ""  # drawn below the surface

    @cached_property
    def _rounded(self) -> tuple[Mesh, FloatArray, FloatArray]:
        return round_outline(self.mesh, self.values)

    def extent(self) -> FloatArray:
        """Return the width and height of the surface, scaled to unit area."""
        mesh, _, _ = self._rounded
        drawn = seen_from(self.camera, mesh)[used_vertices(mesh)]
        return np.asarray(np.ptp(drawn, axis=0)[:2], dtype=np.float64)

    def pixels(self, width: int, height: int, scale: float) -> FloatArray:
        """Draw the image, (height, width, 4), in sRGB with opacity, at ``scale`` pixels per unit."""
        mesh, values, normals = self._rounded
        middle, scale = OVERSAMPLING / 2 * np.array([width, height, 0.0]), scale * OVERSAMPLING
        points = seen_from(self.camera, mesh) * [scale, -scale, scale] + middle
        faces = mesh.faces
        raster = rasterise(points, faces, width * OVERSAMPLING, height * OVERSAMPLING)
        colour = self.paint(raster.interpolated(values, faces))
        colour = np.where(np.isnan(colour), UNMATCHED_GREY, colour)
        diffuse, gloss = compute_light(raster, raster.interpolated(normals @ self.camera.T, faces))
        rows, columns = np.nonzero(raster.covered)
        pixel = rows // OVERSAMPLING * width + columns // OVERSAMPLING
        # A sample adds its light and its share of opacity to its pixel.
        colour *= diffuse[:, None]
        colour += gloss[:, None]
        channels = *colour.T, None
        sums = [np.bincount(pixel, channel, width * height) / OVERSAMPLING**2 for channel in channels]
        red, green, blue, opacity = np.reshape(sums, (4, height, width))
        light = np.stack([red, green, blue], axis=2) / np.maximum(opacity, 1e-6)[..., None]
        return np.dstack([to_screen(light), opacity])


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
        For sharp borders of a field that is constant in regions, give one column per region
        and a ``paint`` that takes the largest column.
    paint : callable
        Maps interpolated values, (m, q), to sRGB colours, (m, 3), 0 … 1.
    camera : (3, 3) array, optional
        Rows: right, up, towards the viewer; by default from `camera_of`.
    resolution : float
        Pixels per √area, so that shapes drawn with the same resolution have equal area.

    Returns
    -------
    (height, width, 4) array of float
        sRGB colours and opacity, cropped to the surface.
    """
    mesh = of_ordinary_size(mesh)
    columns = np.asarray(values, dtype=np.float64).reshape(mesh.n_vertices, -1)
    camera = camera_of(mesh) if camera is None else camera
    view = SurfaceView(mesh, camera, columns, lambda seen: linear_of(paint(seen)))
    width, height = (int(side) + 2 for side in np.ceil(resolution * view.extent()))
    return view.pixels(width, height, resolution)


MAX_FACES = 50_000  # largest number of faces after rounding, which cuts each face into four; chosen
PHONG_ROUNDING = 0.75  # strength of rounding, from 0 to 1: ¾ in Boubekeur & Alexa, Phong Tessellation, 2008
MIN_LENGTH = 1e-300  # normals are divided by their length, or by this if it is shorter: never by 0
# An edge stays straight if the cosine of the angle between the normals at its ends is below this; with 0.5, limbs get
# lumps.
MIN_EDGE_COSINE = 0.0


def round_outline(mesh: Mesh, values: FloatArray) -> tuple[Mesh, FloatArray, FloatArray]:
    """Round the outline of a coarse mesh; return also values (n, q) at its vertices, and its normals, interpolated."""
    normals = mesh.vertex_normals
    while 0 < 4 * mesh.n_faces <= MAX_FACES:
        mesh, columns = _subdivide(mesh, normals, np.hstack([normals, values]))
        normals, values = columns[:, :3], columns[:, 3:]
    return mesh, values, normals


def _subdivide(mesh: Mesh, normals: FloatArray, columns: FloatArray) -> tuple[Mesh, FloatArray]:
    """Cut each triangle into four; return the columns (n, q), with rows for the new vertices."""
    # The middle m of an edge with ends p and q moves towards the tangent planes there, whose normals are n(p) and n(q):
    # to m − (PHONG_ROUNDING / 2) Σ ⟨m − e, n(e)⟩ n(e), summed over e = p, q (Boubekeur & Alexa 2008).
    # Edges at borders and sharp edges stay straight.
    edges = mesh.edge_table
    ends = i, j = edges.ends.T
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), MIN_LENGTH)
    middle = (mesh.vertices[i] + mesh.vertices[j]) / 2
    heights = [((middle - mesh.vertices[end]) * unit[end]).sum(axis=1, keepdims=True) for end in ends]
    bent = (edges.n_faces == 2) & ((unit[i] * unit[j]).sum(axis=1) > MIN_EDGE_COSINE)
    middle[bent] -= PHONG_ROUNDING / 2 * sum(h * unit[end] for h, end in zip(heights, ends))[bent]
    new = np.empty(3 * mesh.n_faces, dtype=np.int64)  # the new vertex on each side of each face
    new[edges.sides] = mesh.n_vertices + np.repeat(np.arange(len(i)), edges.n_faces)
    (a, b, c), (ab, bc, ca) = mesh.faces.T, new.reshape(-1, 3).T
    cut = (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)
    faces = np.concatenate([np.column_stack(corners) for corners in cut])
    vertices = np.concatenate([mesh.vertices, middle])
    return Mesh(vertices, faces), np.concatenate([columns, (columns[i] + columns[j]) / 2])


# Directions towards two lights; the coordinates point right, up and towards the viewer; chosen.
KEY_LIGHT, FILL_LIGHT = np.array([-0.45, 0.65, 0.62]), np.array([0.75, 0.05, 0.45])
TOWARDS_VIEWER = np.array([0.0, 0.0, 1.0])  # direction towards the viewer, in the same coordinates
# largest share of the surface's colour that ambient light, the key light and the fill light add; chosen
AMBIENT, KEY, FILL = 0.30, 0.62, 0.16
GLOSS, GLOSS_EXPONENT = 0.10, 30.0  # white that a highlight adds, and the exponent that narrows it; chosen
# A pixel is in a crevice if it lies below the blurred depth of its surroundings: standard deviation of the blur, and
# depth below the blurred depth at which the crevice is darkest, both over the height of the image; chosen.
CREVICE_RADIUS = 0.025
CREVICE_DEPTH = 0.06
CREVICE_DARKNESS = 0.55  # share of its diffuse light that a pixel loses in the darkest crevice; chosen
CREVICE_STEP = 6  # samples along each axis between two places where the blurred depth is computed; chosen


def compute_light(raster: Raster, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute light from normals: a factor of the surface's colour, and white to add."""
    # Lambertian reflection of a key light and a fill light, both wrapped around the object, and a Blinn highlight.
    # Crevices are darkened by the difference between the depth and the blurred depth (Luft, Colditz & Deussen, Image
    # enhancement by unsharp masking the depth buffer, SIGGRAPH 2006). Normals that point away are reversed.
    key, fill = (direction / np.linalg.norm(direction) for direction in (KEY_LIGHT, FILL_LIGHT))
    halfway = (key + TOWARDS_VIEWER) / np.linalg.norm(key + TOWARDS_VIEWER)
    lengths = np.copysign(np.maximum(np.linalg.norm(normals, axis=1), 1e-12), normals[:, 2])
    from_key, from_fill, from_halfway = np.array([key, fill, halfway]) @ (normals.T / lengths)
    diffuse = AMBIENT + KEY * (0.5 + 0.5 * from_key) ** 1.5 + FILL * (0.5 + 0.5 * from_fill) ** 1.5
    gloss = GLOSS * np.maximum(from_halfway, 0.0) ** GLOSS_EXPONENT
    return diffuse * (1.0 - CREVICE_DARKNESS * _measure_crevices(raster)), gloss


def _measure_crevices(raster: Raster) -> FloatArray:
    """Measure how far each covered pixel lies below its surroundings, 0 … 1."""
    covered, height = raster.covered, raster.depth.shape[0]
    if not covered.any():  # The surface is smaller than a pixel.
        return np.zeros(0)
    coarse = slice(None, None, CREVICE_STEP), slice(None, None, CREVICE_STEP)
    blur = CREVICE_RADIUS * height / CREVICE_STEP
    share = gaussian_filter(covered[coarse].astype(np.float64), blur)
    depth = gaussian_filter(np.where(covered, raster.depth, 0.0)[coarse], blur)
    places = [index / CREVICE_STEP for index in np.nonzero(covered)]
    surroundings = map_coordinates(depth / np.maximum(share, 1e-6), places, order=1, mode="nearest")
    below: FloatArray = np.clip((surroundings - raster.depth[covered]) / (CREVICE_DEPTH * height), 0.0, 1.0)
    return below
