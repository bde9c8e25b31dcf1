"""Pictures of several tiles, and places of a picture that two parts of the surface share."""

import numpy as np
import pytest

from isomatch import Asset, Correspondence, bake_texture, read_asset, write_asset
from isomatch.io import Attribute, Polygons, looks_of

# two squares beside each other, the left one red and the right one blue
POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [3, 0, 0], [4, 0, 0], [4, 1, 0], [3, 1, 0]])
POLYGONS = Polygons([0, 1, 2, 3, 4, 5, 6, 7], [4, 4])
UNIT = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
RED, BLUE = (200, 30, 30), (30, 30, 200)


def baked(second, size=16):
    colour = Attribute("color", "point", "colour", np.uint8([RED] * 4 + [BLUE] * 4))
    uv = Attribute("uv", "point", "uv", np.vstack([UNIT, second]))
    giver, receiver = (Asset(POINTS, POLYGONS, (each,)) for each in (colour, uv))
    return bake_texture(Correspondence(range(8), 8), receiver, giver, size)


@pytest.mark.parametrize(("shift", "tile"), [((1, 0), 1002), ((0, 1), 1011), ((3, 2), 1024)])
def test_each_tile_is_a_picture_of_its_own(shift, tile, tmp_path):
    found = baked(UNIT + shift)
    assert list(found.tiles) == [1001, tile]
    for picture, colour in zip(found.tiles.values(), (RED, BLUE)):
        assert (picture[..., :3] == colour).all()
    assert not found.notes
    write_asset(tmp_path / "a.glb", found.asset)
    looks = looks_of(read_asset(tmp_path / "a.glb"))
    assert len(looks.pictures) == 2
    assert looks.of_triangle.tolist() == [0, 0, 1, 1]


def test_of_parts_with_one_place_the_first_is_painted_and_the_other_named():
    found = baked(UNIT[[1, 0, 3, 2]])  # mirrored
    assert list(found.tiles) == [1001]
    assert (found.picture[..., :3] == RED).all()
    assert "50.0% of the surface" in found.notes[-1]
    assert not baked(np.array([5.0, 0]) + 0.01 * UNIT).notes


def test_many_tiles_are_a_picture_that_repeats():
    points = np.tile(POINTS[:4], (40, 1)) + 2 * np.repeat(np.arange(40), 4)[:, None] * [1, 0, 0]
    uv = np.tile(UNIT, (40, 1)) + np.column_stack(
        [np.repeat(np.arange(40) % 10, 4), np.repeat(np.arange(40) // 10, 4)]
    )
    colour = Attribute("color", "point", "colour", np.uint8([RED] * 160))
    polygons = Polygons(range(160), [4] * 40)
    giver, receiver = (
        Asset(points, polygons, (colour,)),
        Asset(points, polygons, (Attribute("uv", "point", "uv", uv),)),
    )
    found = bake_texture(Correspondence(range(160), 160), receiver, giver, 8)
    assert list(found.tiles) == [1001]
    assert (found.picture[..., :3] == RED).all()
