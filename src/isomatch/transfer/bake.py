"""The colours of one asset as a picture for the texture coordinates of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.assets import Asset, base_colours, pixels_of, png_of, with_texture
from isomatch.correspondence import Correspondence
from isomatch.errors import DescriptorError, SettingError
from isomatch.surfaces import PrecisePoints, rasterise
from isomatch.transfer.bridge import Bridge, Places, columns, rows_of_corners
from isomatch.transfer.choices import Side
from isomatch.values.arrays import AnyArray, FloatArray

CHUNK = 2**18  # texels at once
GREY = 0.5  # of what is unmatched
SIZES = (8, 16384)


@dataclass(frozen=True, eq=False)
class Baked:
    """What `bake_texture` returns.

    Parameters
    ----------
    picture : (size, size, 4) array of uint8
        Red, green, blue and opacity; row 0 is at the top.
    asset : Asset
        The one that receives; written as glTF, it shows the picture.
    unmatched : int
        Texels of the surface without an image, which are grey.
    """

    picture: AnyArray
    asset: Asset
    unmatched: int

    @property
    def png(self) -> bytes:
        """The picture as a PNG file."""
        return png_of(self.picture)


def bake_texture(
    correspondence: Correspondence, source: Asset, target: Asset, size: int = 1024, *, to: Side = "source"
) -> Baked:
    """Paint a texture for the texture coordinates that one asset has, from the texture or the colours of the other.

    Parameters
    ----------
    correspondence : Correspondence
        Source → target, see `carry_attributes`.
    source, target : Asset
        From `read_asset`. The one that gives has a texture in its glTF file, or colours.
    size : int
        Width and height of the picture in texels.
    to : {"source", "target"}
        Which of the two receives.

    Returns
    -------
    Baked
        Texels beside the surface have the colour of the nearest on it, so that no seam shows.

    Raises
    ------
    MapError
        If the map is one of other surfaces.
    DescriptorError
        If the one has no texture coordinates, or the other neither texture nor colours.
    SettingError
        If the size is not a number of texels.

    Notes
    -----
    Each texel on the surface takes the colour at its place under the piecewise linear map. O(size²) time and memory,
    beside the reversal of the map if the target receives.

    Examples
    --------
    A square with texture coordinates takes the colours at the corners of another one, black below and white above.

    >>> from isomatch.assets import Attribute, Polygons
    >>> square = Asset([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], Polygons([0, 1, 2, 3], [4]))
    >>> unfolded = square.with_attributes(Attribute("uv", "point", "uv", square.points[:, :2]))
    >>> grey = [[0.0] * 3, [0.0] * 3, [1.0] * 3, [1.0] * 3]
    >>> coloured = square.with_attributes(Attribute("color", "point", "colour", grey))
    >>> baked = bake_texture(Correspondence(range(4), n_target=4), unfolded, coloured, size=8)
    >>> baked.picture.shape, baked.unmatched, baked.picture[[0, -1], 0, 0]
    ((8, 8, 4), 0, array([239,  16], dtype=uint8))
    """
    from scipy.ndimage import distance_transform_edt

    if not SIZES[0] <= size <= SIZES[1]:
        raise SettingError(f"size = {size}; give a number of texels from {SIZES[0]} to {SIZES[1]}")
    receiver = source if to == "source" else target
    if not receiver.of_kind("uv"):
        raise DescriptorError(
            f"the {to} has no texture coordinates to bake for; carry those of the other instead (uv)"
        )
    bridge = Bridge.between(correspondence, source, target, to_source=to == "source")
    attribute = receiver.of_kind("uv")[0]
    uv = columns(attribute)[rows_of_corners(receiver, attribute)][receiver.polygons.corner_of_triangle][
        :, :, :2
    ]
    uv -= np.floor(uv.mean(axis=1, keepdims=True))
    uv = np.where(np.isnan(uv).any(axis=(1, 2), keepdims=True), -1.0, uv).reshape(-1, 2)
    texels = np.column_stack([uv[:, 0], 1 - uv[:, 1], np.zeros(len(uv))]) * size
    raster = rasterise(texels, np.arange(len(uv)).reshape(-1, 3), size, size)
    covered = raster.covered
    if not covered.any():
        raise DescriptorError(f"no texel of {size} × {size} lies on the surface; bake a larger picture")
    faces, weights = receiver.mesh.faces[raster.face[covered]], raster.barycentric[covered]
    colours = np.zeros((len(faces), 4))
    unmatched = 0
    for first in range(0, len(faces), CHUNK):
        rows = slice(first, first + CHUNK)
        places = bridge.at(PrecisePoints(faces[rows], weights[rows]))
        colours[rows] = np.where(places.found[:, None], _colours(places), [GREY, GREY, GREY, 1.0])
        unmatched += int((~places.found).sum())
    picture = np.zeros((size, size, 4))
    picture[covered] = colours
    nearest = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    painted = np.rint(np.clip(picture[tuple(nearest)], 0, 1) * 255).astype(np.uint8)
    return Baked(painted, with_texture(receiver, png_of(painted)), unmatched)


def _colours(places: Places) -> FloatArray:
    """(m, 4) colours of a texture, or else of an attribute, at places."""
    giver = places.asset
    looks, uv, colour = base_colours(giver.document), giver.of_kind("uv"), giver.of_kind("colour")
    if looks and uv and any(picture for picture, _ in looks[1]):
        at = places.interpolated(columns(uv[0]), places.rows(uv[0]))
        material = np.where(places.found, looks[0][places.triangle], -1)
        tinted = np.ones((len(at), 4))
        for i, (picture, tint) in enumerate(looks[1]):
            here = material == i
            tinted[here] = tint
            if picture and here.any():
                tinted[here] *= _sampled(pixels_of(picture), np.nan_to_num(at[here, :2]))
        return tinted
    if not colour:
        raise DescriptorError(
            "there is neither a texture in a glTF file nor a colour to bake; give a file that has one"
        )
    seen = np.nan_to_num(places.interpolated(colour[0].fractions, places.rows(colour[0])), nan=GREY)
    return np.column_stack([seen[:, :3], seen[:, 3] if seen.shape[1] == 4 else np.ones(len(seen))])


def _sampled(pixels: FloatArray, uv: FloatArray) -> FloatArray:
    """(m, 4) interpolated colours of a picture that repeats beyond its borders."""
    height, width = pixels.shape[:2]
    x, y = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    s, t = (x - left)[:, None], (y - top)[:, None]
    total: FloatArray = np.zeros((len(uv), 4))
    for i, down in ((0, 1 - t), (1, t)):
        for j, right in ((0, 1 - s), (1, s)):
            total += down * right * pixels[(top + i) % height, (left + j) % width]
    return total
