"""Colours mean the same in every type, and labels keep theirs apart."""

import numpy as np
import pytest
from made import POINTS, POLYGONS

from isomatch import Asset, read_asset, write_asset
from isomatch.assets import Attribute, read_attributes, write_attribute
from isomatch.assets.polygons import merged_corners

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
    merged = merged_corners(POLYGONS, 8, Attribute("a", "corner", kind, values))
    assert str(int(merged.values[7]) if kind == "label" else merged.values[7]) == none
    assert (merged.values[:7] == 1).all()


def test_rows_without_a_value_among_those_that_have_one():
    labels = Attribute("part", "point", "label", np.uint8([1, 200])).spread(np.array([0, 2]), 4)
    assert labels.values.tolist() == [1, -1, 200, -1]
    dark = Attribute("color", "point", "colour", np.uint8([[0, 1, 0], [0, 0, 1]]))
    np.testing.assert_array_equal(dark.spread(np.array([2, 0]), 3).fractions[[2, 0]], dark.fractions)
    assert np.isnan(dark.spread(np.array([2, 0]), 3).values[1]).all()
    assert dark.spread(np.array([1, 0]), 2).values.dtype == np.uint8
