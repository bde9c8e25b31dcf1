"""Colours of positions: smooth, different for left and right and for front and back, and safe for the colour-blind."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch.surfaces import Mesh
from isomatch.visualization.camera import principal_axes

VIVID_CHROMA = 0.17  # chroma, in Oklab, towards which colours are moved; chosen: screens show it in most hues
# How far the chroma of colours is moved to `VIVID_CHROMA`: with 0, the middle of a shape is grey and the chroma grows
# with the distance from it; with 1, all colours are equally vivid; chosen.
CHROMA_EVENNESS = 0.3
UNMATCHED_GREY = np.array([0.42, 0.42, 0.42])  # linear light (red, green, blue) of unmatched vertices; chosen

# matrix from Oklab to cube roots of cone responses (Ottosson 2020)
_OKLAB_TO_LMS = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
# matrix from cone responses to linear sRGB (Ottosson 2020)
_LMS_TO_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def position_colours(mesh: Mesh) -> FloatArray:
    """Colour every vertex by its position.

    Returns
    -------
    (n, 3) array of float
        Red, green and blue in linear light, 0 … 1. A picture of a map pulls the target's colours
        back to the source.

    Notes
    -----
    In Oklab (Ottosson 2020), an approximately uniform colour space, colours vary from blue to yellow along the longest
    principal axis of the surface, from green to red along the second, and from dark to light along the third. With
    red–green blindness, the common form of colour blindness, the first and the third axis remain visible.

    Examples
    --------
    >>> colours = position_colours(Mesh([[0, 0, 0], [3, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    >>> colours.shape, bool((colours[0] != colours[1]).any())
    ((3, 3), True)
    """
    along, across, third = principal_coordinates(mesh).T
    lightness = 0.72 + 0.06 * along + 0.12 * third
    chroma = np.column_stack([0.12 * across - 0.02 * along, 0.15 * along - 0.01])
    vividness = np.linalg.norm(chroma, axis=1, keepdims=True)
    chroma *= (VIVID_CHROMA / np.maximum(vividness, 1e-3)) ** CHROMA_EVENNESS
    oklab = np.column_stack([lightness, chroma])
    # The colours are turned into linear light and clipped to the gamut of sRGB.
    return np.asarray(np.clip((oklab @ _OKLAB_TO_LMS.T) ** 3 @ _LMS_TO_RGB.T, 0.0, 1.0))


def principal_coordinates(mesh: Mesh) -> FloatArray:
    """Compute coordinates (n, 3) along the principal axes, in −1 … 1 and spread by area."""
    areas = np.maximum(mesh.vertex_areas, 0.0)
    centred = mesh.vertices - np.average(mesh.vertices, axis=0, weights=areas)
    axes = principal_axes(mesh.vertices, areas)[1][:, ::-1]
    # An axis may point either way: we choose the way in which its largest component is positive.
    axes = axes * np.sign(axes[np.abs(axes).argmax(axis=0), range(3)])
    return np.column_stack([_spread_evenly(column, areas) for column in (centred @ axes).T])


def _spread_evenly(values: FloatArray, areas: FloatArray) -> FloatArray:
    """Average a value with its rank by area, both scaled to −1 … 1, so that colours vary on thin limbs and on bodies."""
    order = values.argsort()
    share = np.empty_like(values)
    share[order] = np.cumsum(areas[order]) / areas.sum()
    used = values[areas > 0]  # A vertex without a face might be far away.
    extent = max(float(np.ptp(used)), 1e-300)
    scaled = np.clip(2.0 * (values - used.min()) / extent - 1.0, -1.0, 1.0)
    return np.asarray(0.5 * scaled + 0.5 * (2.0 * share - 1.0))


def to_screen(linear: FloatArray) -> FloatArray:
    """Encode linear light as sRGB values, 0 … 1."""
    clipped = np.clip(linear, 0.0, 1.0)
    rgb: FloatArray = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    return rgb
