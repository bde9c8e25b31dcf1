"""Attributes of equal, reserved or strange names: none is lost, renames another or makes a file unreadable."""

import re

import numpy as np
import pytest
from made import POINTS, POLYGONS

from isomatch import Asset, MeshError, read_asset, read_mesh, write_asset
from isomatch.io import Attribute, Polygons

RISING, FALLING = np.arange(7.0), 7 - np.arange(7.0)


def carrying(*attributes):
    return Asset(POINTS, POLYGONS, attributes)


def scalar(name, values=RISING):
    return Attribute(name, "point", "scalar", values)


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("name", ["x", "nx", "vertex_indices", "grey value", "größe", "", "a\nb"])
def test_ply_keeps_values_of_any_name(tmp_path, name, binary):
    others = [Attribute("normal", "point", "normal", np.eye(7, 3)), scalar(f"{name}_", FALLING)]
    part = Attribute(name, "face", "label", [1, 2, 3, 4])
    at_corners = Attribute(name, "corner", "scalar", np.arange(15.0))
    asset = carrying(scalar(name), *others, part, at_corners)
    left = {attribute.name for attribute in write_asset(tmp_path / "a.ply", asset, binary=binary)}
    assert left == {
        f"the blanks in the name {attribute.name}"
        for attribute in asset.attributes
        if re.search(r"\s", attribute.name)
    }
    again = read_asset(tmp_path / "a.ply")
    assert np.array_equal(again.points, POINTS)
    assert len(again.attributes) == 5
    found = {tuple(a.values.ravel().tolist()) for a in again.attributes}
    assert found == {tuple(a.values.ravel().tolist()) for a in asset.attributes}


def test_gifti_labels_of_several_attributes_keep_their_names(tmp_path):
    one = Attribute("a", "point", "label", [0, 1, 1, 0, 1, 0, 0], names={0: "left", 1: "right"})
    two = Attribute("b", "point", "label", [1, 0, 2, 2, 1, 0, 1], names={0: "left", 1: "head", 2: "tail"})
    bare = Attribute("c", "point", "label", [1, 1, 1, 5, 5, 5, 5])
    write_asset(tmp_path / "a.gii", carrying(one))
    first = read_asset(tmp_path / "a.gii")
    write_asset(tmp_path / "b.gii", first.with_attributes(two, bare))
    again = read_asset(tmp_path / "b.gii")
    for given in (one, two, bare):
        found = again.attribute(given.name)
        words = [found.names.get(code, str(code)) for code in found.values.tolist()]
        assert words == [given.names.get(code, str(code)) for code in given.values.tolist()]


JOINTS = ["Bip01 L Thigh", "Bip01_L_Thigh", "Ärmel", "x", "nx", "", "line\nbreak"]


@pytest.mark.parametrize("binary", [False, True])
def test_ply_names_the_properties_of_weights_after_their_joints(tmp_path, binary):
    weights = Attribute("weights", "point", "weights", np.eye(7) / 2 + 0.25, names=dict(enumerate(JOINTS)))
    assert write_asset(tmp_path / "a.ply", carrying(weights), binary=binary) == ()
    header = (tmp_path / "a.ply").read_bytes().partition(b"end_header")[0].decode()
    assert "property double Bip01_L_Thigh\nproperty double Bip01_L_Thigh_1\nproperty double Ärmel\n" in header
    found = read_asset(tmp_path / "a.ply")
    assert found.attribute("weights").joint_names == [*JOINTS[:-1], "line break"]
    assert np.array_equal(found.attribute("weights").values, weights.values)
    fewer = weights.with_values(weights.values[:, :2])
    write_asset(
        tmp_path / "b.ply", found.with_attributes(Attribute(**{**vars(fewer), "names": {0: "a", 1: "b"}}))
    )
    again = read_asset(tmp_path / "b.ply").attribute("weights")
    assert again.joint_names == ["a", "b"]
    write_asset(tmp_path / "c.ply", found.without_attributes("weights"))
    assert b"joint" not in (tmp_path / "c.ply").read_bytes()


UV = Attribute("uv", "point", "uv", np.arange(14.0).reshape(7, 2).astype(np.float32))
CORNER_UV = Attribute("uv", "corner", "uv", UV.values[POLYGONS.corners] + 1)


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".ply", ".vtp", ".vtu", ".glb"])
def test_two_of_one_name_are_numbered(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    assert write_asset(path, carrying(UV, CORNER_UV)) == ()
    assert len(read_asset(path).of_kind("uv")) == 2
    assert read_mesh(path).n_faces == 7


def test_standard_names_twice_in_a_file(tmp_path):
    header = "ply\nformat ascii 1.0\nelement vertex 1\n"
    names = ["x", "y", "z", "s", "t", "u", "v", "uv"]
    body = "".join(f"property float {name}\n" for name in names) + "end_header\n0 0 0 1 2 3 4 5\n"
    (tmp_path / "a.ply").write_text(header + body)
    found = read_asset(tmp_path / "a.ply")
    assert [(a.name, a.values.tolist()) for a in found.attributes] == [
        ("uv", [[1, 2]]),
        ("uv_1", [[3, 4]]),
        ("uv_2", [5]),
    ]
    write_asset(tmp_path / "b.ply", found)
    assert set(body.split("\n")) <= set((tmp_path / "b.ply").read_text().split("\n"))


def test_gltf_keeps_letters_and_numbers_of_names(tmp_path):
    names = ["Curv", "curv", "color", "uv_1", "Normal"]
    asset = carrying(*(scalar(name, np.float32(RISING + i)) for i, name in enumerate(names)))
    write_asset(tmp_path / "a.glb", asset)
    again = read_asset(tmp_path / "a.glb").with_attributes(scalar("CURV", np.float32(FALLING)))
    write_asset(tmp_path / "b.glb", again)
    found = {a.name: a.values for a in read_asset(tmp_path / "b.glb").attributes}
    assert set(found) == {*names, "CURV"}
    assert all(np.array_equal(found[name], RISING + i) for i, name in enumerate(names))


@pytest.mark.parametrize("suffix", [".vtu", ".vtp", ".ply", ".gii", ".glb"])
def test_points_without_polygons(tmp_path, suffix):
    asset = Asset(POINTS, Polygons([], []), (scalar("height"),))
    if suffix == ".glb":
        with pytest.raises(MeshError, match="triangles"):
            write_asset(tmp_path / "a.glb", asset)
        return
    write_asset(tmp_path / f"a{suffix}", asset)
    again = read_asset(tmp_path / f"a{suffix}")
    assert np.allclose(again.points, POINTS)
    assert np.array_equal(again.attribute("height").values, RISING)
