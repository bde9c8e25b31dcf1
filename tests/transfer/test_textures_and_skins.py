"""Textures and skins between glTF files: opened by another library, and looked up in the file."""

import io

import matplotlib.image
import numpy as np
import pytest

from isomatch import Asset, bake_texture, carry_attributes, read_asset, read_mesh, write_asset
from isomatch._core.errors import DescriptorError
from isomatch.io import Attribute, Polygons, with_texture
from shapes import flat_grid, map_to_nearest


def halves(size=64):
    """A picture, red on the left and blue on the right, as PNG."""
    pixels = np.zeros((size, size, 3))
    pixels[:, : size // 2, 0] = pixels[:, size // 2 :, 2] = 1
    file = io.BytesIO()
    matplotlib.image.imsave(file, pixels, format="png")
    return file.getvalue()


@pytest.fixture
def giver(tmp_path):
    """A textured, skinned square in a file, with a seam in the middle: its right half is mirrored in the picture."""
    mesh = flat_grid(5, 5)
    u, v = mesh.vertices[mesh.faces, 0] / 4, mesh.vertices[mesh.faces, 1] / 4
    right = u.mean(axis=1) > 0.5
    u[right] = 1.5 - u[right]
    share = mesh.vertices[:, 0] / 4
    asset = Asset(
        mesh.vertices,
        Polygons.of_triangles(mesh.faces),
        (
            Attribute("uv", "corner", "uv", np.stack([u, v], axis=2).reshape(-1, 2)),
            Attribute(
                "weights",
                "point",
                "weights",
                np.column_stack([1 - share, share]),
                names={0: "root", 1: "tip"},
            ),
        ),
    )
    write_asset(tmp_path / "giver.glb", with_texture(asset, halves()))
    return read_asset(tmp_path / "giver.glb")


@pytest.fixture
def receiver(tmp_path):
    """The same square, finer, moved by the node that holds it."""
    fine = flat_grid(9, 9)
    write_asset(tmp_path / "plain.glb", Asset(fine.vertices / 2, Polygons.of_triangles(fine.faces)))
    asset = read_asset(tmp_path / "plain.glb")
    asset.document.json["nodes"][0]["translation"] = [5.0, 0.0, 0.0]
    write_asset(tmp_path / "receiver.glb", asset)
    return read_asset(tmp_path / "receiver.glb")


def test_another_library_opens_what_was_carried(giver, receiver, tmp_path):
    trimesh = pytest.importorskip("trimesh", reason="needs the extra io")
    carried = carry_attributes(map_to_nearest(receiver.points, giver.mesh), receiver, giver)
    assert write_asset(tmp_path / "out.glb", carried.asset) == ()
    scene = trimesh.load(tmp_path / "out.glb")
    (mesh,) = scene.geometry.values()
    assert len(mesh.faces) == len(receiver.polygons)
    assert np.asarray(mesh.visual.material.baseColorTexture).shape[:2] == (64, 64)
    u = mesh.visual.uv[:, 0][mesh.faces]
    x = mesh.vertices[mesh.faces, 0] / 4
    left = x.mean(axis=1) < 0.5
    np.testing.assert_allclose(u, np.where(left[:, None], x, 1.5 - x), atol=1e-6)  # no face is smeared
    np.testing.assert_allclose(scene.bounds[:, 0], [5, 9])


def test_joints_go_along_and_leave_the_surface_where_it_is(giver, receiver, tmp_path):
    giver.document.json["nodes"][-1]["translation"] = [3.0, 1.0, 0.0]
    carried = carry_attributes(map_to_nearest(receiver.points, giver.mesh), receiver, giver, "weights")
    write_asset(tmp_path / "out.glb", carried.asset)
    found = read_asset(tmp_path / "out.glb")
    assert list(found.attribute("weights").names.values()) == ["root", "tip"]
    share = found.points[:, 0] / 4
    np.testing.assert_allclose(
        found.attribute("weights").dense_weights, np.column_stack([1 - share, share]), atol=1e-6
    )
    document = found.document.json
    (skin,) = document["skins"]
    view = document["bufferViews"][document["accessors"][skin["inverseBindMatrices"]]["bufferView"]]
    blob = found.document.blob[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    for joint, inverse in zip(
        skin["joints"], np.frombuffer(blob, "<f4").reshape(-1, 4, 4).transpose(0, 2, 1)
    ):
        there = np.eye(4)
        there[:3, 3] = document["nodes"][joint].get("translation", [0, 0, 0])
        np.testing.assert_allclose((there @ inverse)[:3, 3], [5, 0, 0], atol=1e-6)  # where the node puts it


def test_quads_of_another_format_take_textures_and_joints(giver, tmp_path):
    quads = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]
    receiver = Asset(quads, Polygons([0, 1, 2, 3], [4]))
    carried = carry_attributes(
        map_to_nearest(receiver.points, giver.mesh), receiver, giver, ["uv", "weights"]
    )
    assert carried.asset.polygons is receiver.polygons
    write_asset(tmp_path / "out.glb", carried.asset)
    found = read_asset(tmp_path / "out.glb").document.json
    assert found["meshes"][0]["primitives"][0]["material"] == 0
    assert len(found["skins"]) == len(found["images"]) == 1
    write_asset(tmp_path / "out.obj", carried.asset)
    assert read_mesh(tmp_path / "out.obj").n_faces == 2


@pytest.mark.parametrize("by", ["texture", "colour"])
def test_a_baked_texture_shows_what_the_other_shows(giver, receiver, by):
    """Red on the left and blue on the right; colours of vertices blend in between."""
    if by == "colour":
        reds = np.uint8(np.where(giver.mesh.vertices[:, :1] < 2, [[255, 0, 0]], [[0, 0, 255]]))
        giver = Asset(
            giver.mesh.vertices,
            Polygons.of_triangles(giver.mesh.faces),
            (Attribute("color", "point", "colour", reds),),
        )
    own = Attribute("uv", "point", "uv", receiver.points[:, :2] / [4, 4])
    baked = bake_texture(
        map_to_nearest(receiver.points, giver.mesh), receiver.with_attributes(own), giver, 32
    )
    assert baked.unmatched == 0
    assert baked.picture.shape == (32, 32, 4)
    assert (baked.picture[:, :7, :3] == [255, 0, 0]).all()
    assert (baked.picture[:, 17:, :3] == [0, 0, 255]).all()
    assert baked.png in baked.asset.document.blob


def test_what_cannot_be_baked_is_refused(giver, receiver):
    bare = Asset(giver.mesh.vertices, Polygons.of_triangles(giver.mesh.faces))
    found = map_to_nearest(receiver.points, giver.mesh)
    with pytest.raises(DescriptorError, match="texture coordinates"):
        bake_texture(found, receiver, giver)
    own = Attribute("uv", "point", "uv", receiver.points[:, :2] / 4)
    with pytest.raises(DescriptorError, match="neither"):
        bake_texture(found, receiver.with_attributes(own), bare)
