"""The colours of one asset as a picture for the texture coordinates of the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch._core.errors import DescriptorError, SettingError
from isomatch.correspondence import Correspondence
from isomatch.io import (
    Asset,
    Layer,
    Looks,
    Picture,
    linear_of,
    looks_of,
    multiply_colours,
    pixels_of,
    png_of,
    sample_texture,
    srgb_of,
    unreadable_files,
    unreadable_pictures,
    with_tiles,
)
from isomatch.surfaces import Mesh, PrecisePoints, label_components, rasterise
from isomatch.transfer.bridge import Bridge, Places, columns, rows_of_corners
from isomatch.transfer.choices import Side

TEXELS_PER_CHUNK = 2**18  # texels whose colours are computed at once, which bounds the memory; chosen
UNPAINTED_COLOUR = (0.5, 0.5, 0.5, 1.0)  # grey for unmatched places and for pictures that cannot be read
SIZE_LIMITS = (8, 16384)  # least and largest width of a picture in texels; chosen
FIRST_UDIM_TILE = 1001  # number of the UDIM tile of texture coordinates from 0 to 1, by convention
# largest number of UDIM tiles with a picture each; for more tiles, one picture is repeated in all of them; chosen
MAX_TILES = 16
# A note is made if at least this share of the surface's area shares its place in the picture with another part, for
# which the picture is painted; chosen.
MIN_HIDDEN_SHARE = 5e-4
SAME_PLACE_DISTANCE = 0.01  # largest distance of points of one texel, in √area, that are at one place; chosen


@dataclass(frozen=True, eq=False)
class Baked:
    """What `bake_texture` returns.

    Parameters
    ----------
    tiles : dict of int to (size, size, 4) array of uint8
        The picture of each tile by its UDIM number, 1001 + u + 10 v; only 1001 if all coordinates are
        in 0…1. Red, green, blue and opacity; row 0 is at the top.
    asset : Asset
        The asset that receives; written as glTF, it shows the pictures.
    unmatched : int
        Number of texels of the surface without an image, which are grey.
    notes : tuple of str
        Pictures of the other asset that cannot be read, and why; their places are grey. The share of
        the surface that shows other parts, because they have the same places in the picture.
    """

    tiles: Mapping[int, AnyArray]
    asset: Asset
    unmatched: int
    notes: tuple[str, ...] = ()

    @property
    def picture(self) -> AnyArray:
        """The picture, of several the first."""
        return next(iter(self.tiles.values()))

    @property
    def png(self) -> bytes:
        """The picture as a PNG file."""
        return png_of(self.picture)


def bake_texture(
    correspondence: Correspondence, source: Asset, target: Asset, size: int = 1024, *, to: Side = "source"
) -> Baked:
    """Paint a texture for the texture coordinates of one asset, from the texture or the colours of the other.

    Each texel on the surface takes the colour at its place under the piecewise linear map. Texels
    beside the surface take the colour of the nearest one on it, so that no seam shows. O(size²) time
    and memory, beside the reversal of the map if the target receives.

    Parameters
    ----------
    correspondence : Correspondence
        Source → target, see `carry_attributes`.
    source, target : Asset
        From `read_asset`. The one that gives has pictures or materials of its glTF or OBJ file, or colours.
    size : int
        Width and height of the picture in texels.
    to : {"source", "target"}
        Which of the two receives.

    Raises
    ------
    MapError, DescriptorError, SettingError
        If the map is a map of other surfaces; if the one asset has no texture coordinates, or the other
        neither colours nor a picture that can be read; if the size is not a number of texels.

    Examples
    --------
    A square takes the colours at the corners of another one, black below and white above.

    >>> from isomatch.io import Attribute, Polygons
    >>> square = Asset([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], Polygons([0, 1, 2, 3], [4]))
    >>> unfolded = square.with_attributes(Attribute("uv", "point", "uv", square.points[:, :2]))
    >>> grey = [[0.0] * 3, [0.0] * 3, [1.0] * 3, [1.0] * 3]
    >>> coloured = square.with_attributes(Attribute("color", "point", "colour", grey))
    >>> baked = bake_texture(Correspondence(range(4), n_target=4), unfolded, coloured, size=8)
    >>> baked.picture.shape, baked.unmatched, baked.picture[[0, -1], 0, 0]
    ((8, 8, 4), 0, array([239,  16], dtype=uint8))
    """
    from scipy.ndimage import distance_transform_edt

    if not SIZE_LIMITS[0] <= size <= SIZE_LIMITS[1]:
        message = f"size = {size}; give a number of texels from {SIZE_LIMITS[0]} to {SIZE_LIMITS[1]}"
        raise SettingError(message)
    receiver = source if to == "source" else target
    if not receiver.of_kind("uv"):
        remedy = "carry those of the other instead (uv)"
        raise DescriptorError(f"the {to} has no texture coordinates to bake for; {remedy}")
    bridge = Bridge.between(correspondence, source, target, to_source=to == "source")
    paint = _Paint.of(bridge.giver)
    uv, tile_of_triangle, used = _split_into_tiles(receiver)
    tiles, unmatched, hidden = dict[int, AnyArray](), 0, 0.0
    for tile in used:
        triangles = np.flatnonzero(tile_of_triangle == tile)
        covered, seen, area = _rasterise_faces(receiver.mesh, triangles, uv[triangles], size)
        if covered.any():
            colours, n_unmatched = _colours_at(seen, bridge, paint)
            unmatched, hidden = unmatched + n_unmatched, hidden + area
            picture = np.zeros((size, size, 4))
            picture[covered] = colours
            nearest = distance_transform_edt(~covered, return_distances=False, return_indices=True)
            tiles[tile] = np.rint(np.clip(picture[tuple(nearest)], 0, 1) * 255).astype(np.uint8)
    if not tiles:
        raise DescriptorError(f"no texel of {size} × {size} lies on the surface; bake a larger picture")
    notes = paint.notes
    if hidden > 0 and (hidden_share := hidden / receiver.mesh.area) >= MIN_HIDDEN_SHARE:
        notes += (
            f"texture coordinates overlap: {hidden_share:.1%} of the surface shares its place in the picture with "
            "another part, and shows what is painted for that part",
        )
    names = [f"baked_{tile}" for tile in tiles] if len(tiles) > 1 else ["baked"]
    pictures = dict(zip(names, map(png_of, tiles.values())))
    picture_of_triangle = np.searchsorted(list(tiles), tile_of_triangle).clip(0, len(tiles) - 1)
    return Baked(tiles, with_tiles(receiver, picture_of_triangle, pictures), unmatched, notes)


def _split_into_tiles(receiver: Asset) -> tuple[FloatArray, IntArray, list[int]]:
    """Return (t, 3, 2) coordinates in each triangle's tile, (t,) tiles, and the used tiles."""
    attribute = receiver.of_kind("uv")[0]
    of_corner = columns(attribute)[rows_of_corners(receiver, attribute), :2]
    uv = of_corner[receiver.polygons.corner_of_triangle]
    low = np.floor(uv.mean(axis=1))
    uv -= low[:, None]
    is_without = np.isnan(uv).any(axis=(1, 2))
    uv[is_without] = -1.0  # outside all tiles, where nothing is drawn
    is_in_first = is_without | (low < 0).any(axis=1) | (low[:, 0] > 9)
    tile = np.where(is_in_first, FIRST_UDIM_TILE, FIRST_UDIM_TILE + low @ [1, 10]).astype(np.int64)
    if len(np.unique(tile[~is_without])) > MAX_TILES:
        tile[:] = FIRST_UDIM_TILE
    return uv, tile, np.unique(tile[~is_without]).tolist()


def _rasterise_faces(
    mesh: Mesh, triangles: IntArray, uv: FloatArray, size: int
) -> tuple[BoolArray, PrecisePoints, float]:
    """Find the texels that show faces, the points that they show, and the area hidden below."""
    corners = uv.reshape(-1, 2)
    # The first chart is drawn on top.
    height = -np.repeat(_number_charts(mesh.faces[triangles], uv), 3) / size
    texels = np.column_stack([corners[:, 0], 1 - corners[:, 1], height]) * size
    rows = np.arange(len(corners)).reshape(-1, 3)
    above, below = (rasterise(texels * [1, 1, sign], rows, size, size) for sign in (1, -1))
    covered = above.covered
    face, face_below = triangles[above.face[covered]], triangles[below.face[covered]]
    seen = PrecisePoints(mesh.faces[face], above.barycentric[covered])
    hidden = PrecisePoints(mesh.faces[face_below], below.barycentric[covered])
    # A face is hidden if most of its texels show another place.
    distances = np.linalg.norm(hidden.interpolated(mesh.vertices) - seen.interpolated(mesh.vertices), axis=1)
    is_elsewhere = distances > SAME_PLACE_DISTANCE * np.sqrt(mesh.area)
    n_hidden = np.bincount(face_below, is_elsewhere, mesh.n_faces)
    n_texels = np.bincount(face_below, minlength=mesh.n_faces)
    is_hidden = n_hidden > 0.5 * np.maximum(n_texels, 1)
    return covered, seen, float(mesh.face_areas[is_hidden].sum())


def _colours_at(points: PrecisePoints, bridge: Bridge, paint: _Paint) -> tuple[FloatArray, int]:
    """Compute colours (m, 4) of points of the receiver, and count the points without an image."""
    colours, unmatched = np.zeros((len(points.corners), 4)), 0
    for first in range(0, len(colours), TEXELS_PER_CHUNK):
        rows = slice(first, first + TEXELS_PER_CHUNK)
        places = bridge.at(PrecisePoints(points.corners[rows], points.barycentric[rows]))
        colours[rows] = np.where(places.has_place[:, None], paint.at(places), UNPAINTED_COLOUR)
        unmatched += int((~places.has_place).sum())
    return colours, unmatched


def _number_charts(faces: IntArray, uv: FloatArray) -> IntArray:
    """Find the chart, numbered by first triangles, of each triangle (t, 3) with texture coordinates (t, 3, 2)."""
    # A chart is connected in the picture and on the surface, and has one orientation: mirrored
    # halves are two charts.
    a, b, c = uv.transpose(1, 0, 2)
    sides = np.sign((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    corners = np.column_stack([faces.ravel(), uv.reshape(-1, 2), np.repeat(sides, 3)])
    place = np.unique(corners, axis=0, return_inverse=True)[1].reshape(-1, 3)
    _, label = label_components(
        int(place.max(initial=0)) + 1, (place[:, 0], place[:, 1]), (place[:, 1], place[:, 2])
    )
    _, first, number = np.unique(label[place[:, 0]], return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[number])


@dataclass(frozen=True, eq=False)
class _Paint:
    """The colours of an asset: its looks with the pixels of their pictures, or an attribute if there are none."""

    asset: Asset
    looks: Looks | None
    pixels: dict[Picture, FloatArray]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, asset: Asset) -> _Paint:
        looks, colours, notes = looks_of(asset), asset.of_kind("colour"), unreadable_files(asset)
        pictures = looks.pictures if looks else ()
        lost = unreadable_pictures(pictures)
        if len(lost) == len(pictures) and colours:
            looks = None
        elif not looks or all(lost.keys() & set(look.pictures) for look in looks.looks):
            why = f"no colour to bake, and no picture can be read ({'; '.join(notes)})"
            why = why if notes else "neither a texture nor a colour to bake"
            raise DescriptorError(f"there is {why}; give a file that has one")
        pixels = {picture: pixels_of(picture.data) for picture in pictures if picture not in lost}
        instead = "what it would paint is grey" if looks else "colours are painted instead"
        return cls(asset, looks, pixels, tuple(f"{note}; {instead}" for note in notes))

    def at(self, places: Places) -> FloatArray:
        """(m, 4) colours at places."""
        if self.looks is None:
            return self._of_points(places)
        look = np.where(places.has_place, self.looks.of_triangle[places.triangle], -1)
        colours = np.ones((len(look), 4))
        for i, appearance in enumerate(self.looks.looks):
            rows = look == i
            some_places = Places(places.asset, places.triangle[rows], places.barycentric[rows])
            base = self._of_layer(appearance.base, some_places)
            if self.looks.tinted and self.asset.of_kind("colour"):
                base = multiply_colours(base, self._of_points(some_places))
            if appearance.emitted:
                glow = self._of_layer(appearance.emitted, some_places)
                base[:, :3] = srgb_of(linear_of(base) + linear_of(glow))[:, :3]
            colours[rows] = base
        return colours

    def _of_points(self, places: Places) -> FloatArray:
        colour = self.asset.of_kind("colour")[0]
        seen = places.interpolated(colour.fractions, places.rows(colour))
        seen = np.nan_to_num(seen, nan=UNPAINTED_COLOUR[0])
        return np.column_stack([seen[:, :3], seen[:, 3] if seen.shape[1] == 4 else np.ones(len(seen))])

    def _of_layer(self, layer: Layer, places: Places) -> FloatArray:
        uv = [attribute for attribute in self.asset.of_kind("uv") if attribute.name == layer.uv]
        if layer.picture in self.pixels and uv:
            sample_uv = places.interpolated(columns(uv[0]), places.rows(uv[0]))[:, :2]
            return sample_texture(self.pixels[layer.picture], layer, np.nan_to_num(sample_uv))
        colour = np.array(UNPAINTED_COLOUR if layer.picture else layer.tint, dtype=np.float64)
        return np.tile(colour, (len(places.triangle), 1))
