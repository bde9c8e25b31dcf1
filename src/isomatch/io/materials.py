"""Materials of a surface: pictures, their texture coordinates, and colours that multiply them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import FormatError
from isomatch._core.files import open_file, read_bytes
from isomatch.io.attribute import linear_of, srgb_of

Wrap = Literal["repeat", "clamp", "mirror"]  # how a picture goes on beyond its border
UNTINTED = (1.0, 1.0, 1.0, 1.0)  # factors of red, green, blue and opacity that change nothing
IN_PLACE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))  # the transform of texture coordinates that moves nothing
_PNG, _JPEG, _KTX = b"\x89PNG", b"\xff\xd8", b"\xabKTX 20\xbb"  # first bytes of pictures by format
# formats of pictures, which Pillow tells by the first bytes
_PILLOW_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "GIF", "TIFF", "DDS")
_CANNOT_READ = "a picture cannot be read: "  # beginning of messages
# widths or heights of a picture, at most, by which its clamped border is extended; chosen
_MAX_PAINTED_WIDTHS = 8
DEFAULT_DIFFUSE = (102, 102, 102, 255)  # colour, 0…255, that trimesh gives a simple material without one


@dataclass(frozen=True)
class Picture:
    """A picture file: its name, its bytes, or the reason why they are missing."""

    name: str
    data: bytes = b""
    missing: str = ""

    @classmethod
    def among(cls, files: Mapping[str, bytes], name: str) -> Picture:
        """Find a picture by name among the files beside the surface."""
        missing = "" if name in files else "there is no such file in the folder of the surface"
        return cls(name, files.get(name, b""), missing)


@dataclass(frozen=True)
class Layer:
    """A picture on a surface, multiplied in linear light by a tint of red to alpha, 0…1 in sRGB; or the tint alone.

    ``uv`` is the attribute with its texture coordinates. The ``matrix`` multiplies columns u, v, 1, with
    v down from the top of the picture. ``wrap`` continues it beyond its borders, sideways and upwards;
    with ``nearest``, texels are not blended.
    """

    tint: tuple[float, ...] = UNTINTED
    picture: Picture | None = None
    uv: str = "uv"
    matrix: tuple[tuple[float, ...], ...] = IN_PLACE
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False

    def looked_up(self, uv: FloatArray) -> FloatArray:
        """Convert texture coordinates (m, 2 or more) to places in the picture, (m, 2), from the lower left."""
        matrix = np.array(self.matrix)
        down = np.column_stack([uv[:, 0], 1 - uv[:, 1]])
        places: FloatArray = down @ matrix[:, :2].T + matrix[:, 2]
        places[:, 1] = 1 - places[:, 1]
        return places

    @property
    def pixels(self) -> FloatArray | None:
        """(h, w, 4) pixels of its picture, multiplied by the tint; None without a readable picture."""
        if self.picture is None or unreadable_pictures([self.picture]):
            return None
        return multiply_colours(pixels_of(self.picture.data), self.tint)

    def unrolled(self, uv: FloatArray) -> Layer:
        """Return a layer with a repeating picture that shows the same at places (m, 2) in this one.

        A mirrored picture is put beside its mirror image; a clamped one gets as much border as is seen.
        """
        if self.picture is None or self.wrap == ("repeat", "repeat") or unreadable_pictures([self.picture]):
            return self
        pixels, matrix = pixels_of(self.picture.data), np.array(self.matrix)
        for axis, wrap in enumerate(self.wrap):
            seen = uv[:, 0] if axis == 0 else 1 - uv[:, 1]  # rows count from the top, v from the bottom
            seen = seen[np.isfinite(seen)]
            first, last = 0, 2 if wrap == "mirror" else 1
            if wrap == "clamp" and len(seen):
                first = int(np.floor(seen.min()).clip(-_MAX_PAINTED_WIDTHS, 0))
                last = int(np.ceil(seen.max()).clip(1, _MAX_PAINTED_WIDTHS))
            n = pixels.shape[1 - axis]
            pixels = pixels.take(_wrap_index(np.arange(first * n, last * n), n, wrap), axis=1 - axis)
            matrix[axis, 2] -= first
            matrix[axis] /= last - first
        picture, rows = Picture(self.picture.name, png_of(pixels)), tuple(map(tuple, matrix.tolist()))
        return replace(self, picture=picture, matrix=rows, wrap=("repeat", "repeat"))


@dataclass(frozen=True)
class Look:
    """A material: its base colour, and emitted light, which is added."""

    name: str
    base: Layer
    emitted: Layer | None = None

    @property
    def main(self) -> Layer:
        """The layer to show if only one can be: the base, or emitted light if the base is black."""
        return self.emitted if self.emitted and max(self.base.tint[:3]) == 0 else self.base

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Its base and, if there is any, its emitted light."""
        return (self.base, self.emitted) if self.emitted else (self.base,)

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The pictures of its layers."""
        return tuple(layer.picture for layer in self.layers if layer.picture)


@dataclass(frozen=True)
class Looks:
    """The material of each triangle, (m,), −1 without one, and the materials.

    If ``tinted``, as in glTF, base colours are multiplied by the colours of points.
    """

    of_triangle: IntArray
    looks: tuple[Look, ...]
    tinted: bool = False

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """All different pictures."""
        return tuple(dict.fromkeys(picture for look in self.looks for picture in look.pictures))


def pixels_of(picture: bytes) -> FloatArray:
    """Read the pixels of a picture file, (h, w, 4), 0…1, row 0 at the top; `FormatError` if damaged."""
    return np.asarray(_load_image(picture)) / 255


def _load_image(picture: bytes) -> Any:
    """Load an image of red, green, blue and opacity; `FormatError` if it cannot be read."""
    from PIL import Image, UnidentifiedImageError  # imported here, as it is slow

    try:
        image: Image.Image = Image.open(BytesIO(picture))
        if image.mode.startswith("I"):  # a grey picture of 16 bits
            image = Image.fromarray((np.asarray(image) // 257).astype(np.uint8))
        return image.convert("RGBA")
    except UnidentifiedImageError:
        raise FormatError(f"{_CANNOT_READ}it is of no known kind; convert it to PNG") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise FormatError(f"{_CANNOT_READ}{error}; copy it again, or convert it to PNG") from None


def unreadable_pictures(pictures: Iterable[Picture]) -> dict[Picture, str]:
    """Explain for each picture that cannot be read why not."""
    reasons = {}
    for picture in pictures:
        try:
            if picture.missing:
                raise FormatError(picture.missing)
            _load_image(picture.data)
        except FormatError as error:
            reasons[picture] = str(error).removeprefix(_CANNOT_READ)
    return reasons


def picture_in(path: Path) -> bytes | None:
    """Read a file if it is a picture; nothing else may be copied into an output."""
    from PIL import Image

    with open_file(path) as file:
        if file.read(len(_KTX)) != _KTX:
            file.seek(0)
            kinds = _PILLOW_FORMATS if path.suffix.lower() != ".tga" else ("TGA",)
            try:
                with warnings.catch_warnings(action="ignore"):
                    Image.open(file, formats=kinds).verify()
            except Exception:  # Pillow's readers raise many kinds of errors
                return None
    return read_bytes(path)


def as_png(picture: bytes) -> tuple[bytes, str]:
    """Convert a picture to PNG, unless it is JPEG or cannot be read; return also which of the two it is."""
    if picture.startswith(_JPEG):
        return picture, "jpeg"
    if not picture.startswith(_PNG):
        with suppress(FormatError):
            picture = png_of(pixels_of(picture))
    return picture, "png"


def png_of(pixels: AnyArray) -> bytes:
    """Make a PNG file of pixels (h, w, channels): integers over the range of their type, or floats 0…1."""
    from matplotlib.image import imsave

    if pixels.dtype.kind in "iu" and pixels.dtype != np.uint8:
        pixels = pixels / np.iinfo(pixels.dtype).max
    table = pixels.reshape(*pixels.shape[:2], -1)
    table = np.repeat(table[:, :, :1], 3, axis=2) if table.shape[2] < 3 else table  # a grey picture
    full = 255 if pixels.dtype == np.uint8 else 1
    opaque = np.pad(table, ((0, 0), (0, 0), (0, 4 - table.shape[2])), constant_values=full)
    file = BytesIO()
    imsave(file, opaque, format="png")
    return file.getvalue()


def sample_texture(pixels: FloatArray, layer: Layer, uv: FloatArray) -> FloatArray:
    """Sample the pixels of a layer at texture coordinates (m, 2), blended between texels: (m, 4)."""
    height, width = pixels.shape[:2]
    places = layer.looked_up(uv)
    x, y = places[:, 0] * width - 0.5, (1 - places[:, 1]) * height - 0.5
    if layer.nearest:
        x, y = np.floor(x + 0.5), np.floor(y + 0.5)
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    s, t = (x - left)[:, None], (y - top)[:, None]
    total: FloatArray = np.zeros((len(uv), 4))
    for i, down in ((0, 1 - t), (1, t)):
        row = _wrap_index(top + i, height, layer.wrap[1])
        for j, right in ((0, 1 - s), (1, s)):
            total += down * right * pixels[row, _wrap_index(left + j, width, layer.wrap[0])]
    return multiply_colours(total, layer.tint)


def multiply_colours(colours: FloatArray, tint: ArrayLike) -> FloatArray:
    """Multiply colours (m, 4), 0…1 in sRGB, by a tint, in linear light."""
    tint = np.asarray(tint, dtype=np.float64)
    return colours if (tint == 1).all() else srgb_of(linear_of(colours) * linear_of(tint))


def _wrap_index(index: IntArray, n: int, wrap: Wrap) -> IntArray:
    """Find which of n texels is shown at an index inside or beyond them."""
    if wrap == "clamp":
        return np.clip(index, 0, n - 1)
    if wrap == "mirror":
        index = index % (2 * n)
        return np.minimum(index, 2 * n - 1 - index)
    return index % n


def texture_of(mesh: Any) -> tuple[AnyArray, tuple[float, ...]] | None:
    """Return the one texture of a mesh of trimesh or Open3D, and its tint, 0…1; None otherwise."""
    material = getattr(getattr(mesh, "visual", None), "material", None)  # trimesh has a material
    images = [getattr(material, name, None) for name in ("image", "baseColorTexture")]
    textures = [np.asarray(image.convert("RGBA")) for image in images if image is not None][-1:]
    upside_down = map(np.asarray, getattr(mesh, "textures", ()))  # Open3D has several pictures
    textures += [texture[::-1] for texture in upside_down if texture.size > 1]
    return (textures[0], _tint(material)) if len(textures) == 1 else None


def _tint(material: Any) -> tuple[float, ...]:
    """Return the colour by which a material of trimesh multiplies its picture."""
    factor = getattr(material, "baseColorFactor", None)  # materials of glTF have this factor
    tint = getattr(material, "diffuse", None) if factor is None else factor
    if tint is None or (factor is None and tuple(tint) == DEFAULT_DIFFUSE):
        return UNTINTED
    colour = np.asarray(tint)
    channels = colour if colour.dtype.kind == "f" and colour.max() <= 1 else colour / 255
    return (*(channels if factor is None else srgb_of(channels)).tolist(), 1.0)[:4]
