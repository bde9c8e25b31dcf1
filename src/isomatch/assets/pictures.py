"""Pictures as files and as pixels, and those that meshes of other libraries show by their texture coordinates."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.formats.gltf_looks import UNTINTED, base_colours
from isomatch.values.arrays import AnyArray, FloatArray

NO_DIFFUSE = (102, 102, 102, 255)  # of a simple material of trimesh for which none was given


def pixels_of(picture: bytes) -> FloatArray:
    """(height, width, 4) the pixels of a PNG or JPEG file, 0…1; row 0 is at the top."""
    from matplotlib.image import imread  # takes longer to import than all else

    kind = "png" if picture[:4] == b"\x89PNG" else "jpg"
    pixels = np.asarray(imread(BytesIO(picture), format=kind))
    return _four_channels(pixels / 255 if pixels.dtype == np.uint8 else pixels.astype(np.float64), 1.0)


def png_of(pixels: AnyArray) -> bytes:
    """Make a PNG file of (height, width, channels) pixels: integers of the full range of their type, or floats 0…1."""
    from matplotlib.image import imsave

    if pixels.dtype.kind in "iu" and pixels.dtype != np.uint8:
        pixels = pixels / np.iinfo(pixels.dtype).max
    file = BytesIO()
    imsave(file, _four_channels(pixels, 255 if pixels.dtype == np.uint8 else 1.0), format="png")
    return file.getvalue()


def texture_of(asset: Asset) -> AnyArray | None:
    """Return the (height, width, 4) uint8 texture of a glTF file; None unless it has one for all its triangles."""
    materials, looks = base_colours(asset.document) or (np.zeros(0, dtype=np.int64), [])
    used = np.unique(materials)
    if len(used) != 1 or used[0] < 0 or not looks[used[0]][0]:
        return None
    picture, tint = looks[used[0]]
    pixels: AnyArray = np.rint(255 * pixels_of(picture) * tint).astype(np.uint8)
    return pixels


def texture_on(given: Any) -> tuple[AnyArray, tuple[float, ...]] | None:
    """Return the texture of a mesh of trimesh or Open3D, and the colour that tints it, 0…1; None unless it has one."""
    found: list[AnyArray] = []
    material = getattr(getattr(given, "visual", None), "material", None)  # of trimesh
    for name in ("image", "baseColorTexture"):
        if getattr(material, name, None) is not None:
            found = [np.asarray(getattr(material, name).convert("RGBA"))]
    for image in getattr(given, "textures", ()):  # of Open3D, upside down
        if np.asarray(image).size > 1:
            found.append(np.asarray(image)[::-1])
    return (found[0], _tint(material)) if len(found) == 1 else None


def _tint(material: Any) -> tuple[float, ...]:
    """Colour by which a material of trimesh multiplies its picture; those of Open3D are not read."""
    tint = getattr(material, "baseColorFactor", None)
    diffuse = getattr(material, "diffuse", None)
    if tint is None and diffuse is not None and tuple(diffuse) != NO_DIFFUSE:
        tint = diffuse
    if tint is None:
        return UNTINTED
    colour = np.asarray(tint)
    channels = colour if colour.dtype.kind == "f" and colour.max() <= 1 else colour / 255
    return (*channels.tolist(), 1.0)[:4]


def _four_channels(pixels: AnyArray, opaque: float) -> AnyArray:
    table = pixels.reshape(*pixels.shape[:2], -1)
    if table.shape[2] < 3:  # grey
        table = np.repeat(table[:, :, :1], 3, axis=2)
    full = np.full((*table.shape[:2], 4 - table.shape[2]), opaque, table.dtype)
    return np.concatenate([table, full], axis=2)
