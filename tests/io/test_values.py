"""Values in files of their own, packages that are missing, and files written again."""

import sys

import numpy as np
import pytest
from made import ATTRIBUTES, whole

from isomatch import Asset, FormatError, MeshError, MissingDependencyError, read_asset, read_mesh, write_asset
from isomatch.io import Attribute, Polygons, read_attributes, write_attribute

COLORS = {0: (1.0, 0.0, 0.0, 1.0), 1: (0.0, 1.0, 0.0, 1.0), 2: (0.0, 0.0, 1.0, 1.0)}


@pytest.mark.parametrize("name", ["lh.aparc.annot", "a.label.gii"])
def test_labels_keep_names_and_colours(tmp_path, name):
    given = ATTRIBUTES["label"]
    given = Attribute(given.name, "point", "label", given.values, names=given.names, colors=COLORS)
    write_attribute(tmp_path / name, given)
    (found,) = read_attributes(tmp_path / name)
    assert found.values.tolist() == given.values.tolist()
    assert dict(found.names) == given.names
    assert dict(found.colors) == COLORS


@pytest.mark.parametrize("name", ["lh.thickness", "a.shape.gii"])
def test_scalars(tmp_path, name):
    write_attribute(tmp_path / name, ATTRIBUTES["scalar"])
    (found,) = read_attributes(tmp_path / name)
    np.testing.assert_array_equal(found.values, ATTRIBUTES["scalar"].values)
    assert found.kind == "scalar"


def test_values_that_have_no_place(tmp_path):
    with pytest.raises(FormatError, match="place"):
        write_attribute(tmp_path / "a.annot", ATTRIBUTES["scalar"])
    with pytest.raises(FormatError, match="annot"):
        read_attributes(tmp_path / "a.ply")


def test_a_file_of_values_is_no_surface(tmp_path):
    write_attribute(tmp_path / "a.shape.gii", ATTRIBUTES["scalar"])
    with pytest.raises(FormatError, match="read_attributes"):
        read_asset(tmp_path / "a.shape.gii")


@pytest.mark.parametrize(
    ("suffix", "package", "extra"),
    [(".vtp", "vtkmodules", "vtk"), (".vtu", "vtkmodules", "vtk"), (".gii", "nibabel.gifti", "io")],
)
def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch, suffix, package, extra):
    write_asset(tmp_path / f"a{suffix}", whole())
    monkeypatch.setitem(sys.modules, package, None)
    name = package.partition(".")[0]
    with pytest.raises(MissingDependencyError, match=rf"{name}.*\[{extra}\]"):
        read_mesh(tmp_path / f"a{suffix}")


PLY = b"""ply
format ascii 1.0
comment TextureFile skin.png
obj_info made by hand
element camera 1
property float view
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property float texture_u
property float texture_v
property list uchar int bones
property double quality
element face 2
property list uchar int vertex_index
property list uchar float texcoord
property int region
end_header
35.5
0 0 0 1 2 3 0.5 0.25 0 0.125
1 0 0 4 5 6 0 1 2 8 9 1e-300
1 1 0 7 8 9 1 1 1 7 2
0 1 0 255 0 0 0 0 0 3
4 0 1 2 3 8 0 0 1 0 1 1 0 1 -3
3 0 1 2 0 7
"""


def test_a_ply_file_written_again_is_the_same(tmp_path):
    (tmp_path / "a.ply").write_bytes(PLY)
    asset = read_asset(tmp_path / "a.ply")
    kinds = {(a.name, a.domain): a.kind for a in asset.attributes}
    assert kinds == {
        ("color", "point"): "colour",
        ("uv", "point"): "uv",
        ("quality", "point"): "scalar",
        ("uv", "corner"): "uv",
        ("region", "face"): "label",
    }
    assert np.isnan(asset.attribute("uv", "corner").values[4:]).all()
    write_asset(tmp_path / "b.ply", asset)
    again = read_asset(tmp_path / "b.ply")
    for one, other in zip(asset.attributes, again.attributes):
        assert one.values.dtype == other.values.dtype
        np.testing.assert_array_equal(one.values, other.values)
    header = PLY[: PLY.index(b"end_header")].split(b"\n")
    written = (tmp_path / "b.ply").read_bytes().split(b"\n")
    assert set(header) <= set(written)
    assert b"35.5" in written
    write_asset(tmp_path / "c.ply", again)
    assert (tmp_path / "c.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()


OBJ = """mtllib skin.mtl
v 0.0 0.0 0.0
v 1.0 0.0 0.0
v 1.0 1.0 0.0
v 0.0 1.0 0.0
vt 0.0 0.0
vt 1.0 0.0
vt 0.5 0.5
vn 0.0 0.0 1.0
o thing
g front
usemtl red
f 1/1/1 2/2/1 3/3/1 4
g back
f 3/1 2/3 1/2
l 1 2
"""


def test_an_obj_file_written_again_is_the_same(tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    asset = read_asset(tmp_path / "a.obj")
    assert asset.polygons.sizes.tolist() == [4, 3]
    group = asset.attribute("group")
    assert [group.names[code] for code in group.values.tolist()] == ["front", "back"]
    write_asset(tmp_path / "b.obj", asset)
    assert (tmp_path / "b.obj").read_text() == OBJ


def test_obj_texture_coordinates_of_one_number(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5\nvt 0.25 1\nf 1/1 2/2 3/1\n")
    assert read_asset(tmp_path / "a.obj").attribute("uv").values.tolist() == [[0.5, 0], [0.25, 1], [0.5, 0]]
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/-2 2/1 3/1\n")
    with pytest.raises(FormatError, match="vt"):
        read_asset(tmp_path / "a.obj")


def test_gltf_refuses_positions_of_nan(tmp_path):
    with pytest.raises(MeshError, match="nan"):
        write_asset(
            tmp_path / "a.glb", Asset([[0, 0, 0], [1, 0, 0], [0, 1, np.nan]], Polygons([0, 1, 2], [3]))
        )
