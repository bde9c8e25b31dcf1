"""Colours mean the same in every type, and labels keep theirs apart."""

import base64
import json

import numpy as np
import pytest
from made import POINTS, POLYGONS

from isomatch import Asset, Correspondence, read_asset, write_asset
from isomatch.io import (
    Attribute,
    linear_of,
    png_of,
    read_attributes,
    srgb_of,
    with_texture,
    write_attribute,
)
from isomatch.io.polygons import merge_corners
from isomatch.transfer import bake_texture

OCTETS = np.arange(21).reshape(7, 3) * 12


@pytest.mark.parametrize("suffix", [".off", ".obj", ".glb", ".gii"])
@pytest.mark.parametrize(
    "values", [np.uint8(OCTETS), np.uint16(OCTETS * 257), np.int32(OCTETS), np.float32(OCTETS), OCTETS / 255]
)
@pytest.mark.parametrize("darker", [1, 240])
def test_colours_of_every_type(tmp_path, suffix, values, darker):
    values = (values / darker).astype(values.dtype)
    color = Attribute("color", "point", "colour", values)
    write_asset(tmp_path / f"a{suffix}", Asset(POINTS, POLYGONS, (color,)))
    found = read_asset(tmp_path / f"a{suffix}").attribute("color").fractions
    expected = OCTETS / 255 if darker == 1 else color.fractions
    assert np.allclose(found[:, :3], expected, atol=0.003 if suffix == ".off" else 1e-5)


def test_annotations_tell_labels_of_one_colour_apart(tmp_path):
    red, black = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0)
    names = {0: "none", 1: "a", 2: "b", 3: "c"}
    region = Attribute(
        "r", "point", "label", [0, 1, 2, 3, 3], names=names, colors={0: black, 1: red, 2: red, 3: black}
    )
    write_attribute(tmp_path / "lh.r.annot", region)
    found = read_attributes(tmp_path / "lh.r.annot")[0]
    assert [found.names[code] for code in found.values.tolist()] == ["none", "a", "b", "c", "c"]


@pytest.mark.parametrize(
    ("kind", "values", "none"), [("scalar", np.ones(15), "nan"), ("label", np.ones(15, np.uint8), "-1")]
)
def test_a_point_of_no_polygon_has_none_of_the_values_of_corners(kind, values, none):
    merged = merge_corners(POLYGONS, 8, Attribute("a", "corner", kind, values))
    assert str(int(merged.values[7]) if kind == "label" else merged.values[7]) == none
    assert (merged.values[:7] == 1).all()


def test_rows_without_a_value_among_those_that_have_one():
    labels = Attribute("part", "point", "label", np.uint8([1, 200])).spread(np.array([0, 2]), 4)
    assert labels.values.tolist() == [1, -1, 200, -1]
    dark = Attribute("color", "point", "colour", np.uint8([[0, 1, 0], [0, 0, 1]]))
    np.testing.assert_array_equal(dark.spread(np.array([2, 0]), 3).fractions[[2, 0]], dark.fractions)
    assert np.isnan(dark.spread(np.array([2, 0]), 3).values[1]).all()
    assert dark.spread(np.array([1, 0]), 2).values.dtype == np.uint8


SRGB, LINEAR = (200, 128, 40), (0.5776, 0.2159, 0.0212)


def test_colours_of_gltf_are_linear_and_others_are_not(tmp_path):
    colour = Attribute("color", "point", "colour", np.tile(np.uint8(SRGB), (len(POINTS), 1)))
    write_asset(tmp_path / "a.gltf", Asset(POINTS, POLYGONS, (colour,)))
    document = json.loads((tmp_path / "a.gltf").read_text())
    blob = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    first = document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    assert accessor["normalized"]
    assert np.frombuffer(blob, np.uint16, 3, first) / 65535 == pytest.approx(LINEAR, abs=1e-4)
    read = read_asset(tmp_path / "a.gltf")
    assert read.attribute("color").values[0, :3].tolist() == list(SRGB)
    for other in (".ply", ".off", ".obj"):
        write_asset(tmp_path / f"b{other}", read)
        found = read_asset(tmp_path / f"b{other}").attribute("color").fractions[0, :3]
        assert np.allclose(255 * found, SRGB, atol=1)


def test_the_curve_and_its_inverse():
    assert srgb_of(LINEAR) * 255 == pytest.approx(SRGB, abs=0.1)
    shades = np.linspace(0, 1, 256)
    assert np.allclose(linear_of(srgb_of(shades[:, None])), shades[:, None])
    assert srgb_of([1.0, 1, 1, 0.5]).tolist() == [1, 1, 1, 0.5]
    assert srgb_of([0.0031308])[0] == pytest.approx(1.055 * 0.0031308 ** (1 / 2.4) - 0.055, abs=1e-4)


def test_a_primitive_shows_picture_times_factor_times_colours_of_points(tmp_path):
    """White × a factor × colours of points, in linear light."""
    uv = Attribute("uv", "point", "uv", POINTS[:, :2] - POINTS[:, :2].min(axis=0))
    half = srgb_of(np.full((len(POINTS), 3), 0.5))
    colour = Attribute("color", "point", "colour", np.float32(half))
    white = png_of(np.full((2, 2, 4), 255, np.uint8))
    giver = with_texture(Asset(POINTS, POLYGONS, (uv, colour)), white, (*srgb_of([0.5] * 3), 1))
    write_asset(tmp_path / "giver.glb", giver)
    read = read_asset(tmp_path / "giver.glb")
    receiver = Asset(POINTS, POLYGONS, (uv,))
    same = Correspondence(range(read.mesh.n_vertices), read.mesh.n_vertices)
    baked = bake_texture(same, receiver, read, size=16).picture
    assert np.abs(baked[..., :3] - 255 * srgb_of(0.25 * np.ones(3))).max() <= 1
