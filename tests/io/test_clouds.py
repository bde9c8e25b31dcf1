"""Files of points alone, and pictures that comments of PLY files name."""

import json

import numpy as np
import pytest
from PIL import Image

from isomatch import FormatError, PointCloud, read_asset, read_mesh, write_asset, write_mesh
from isomatch.cli import main
from isomatch.io import (
    asset_from,
    looks_of,
    meshes_among,
    surface_from,
    to_meshio,
    to_pyvista,
    to_trimesh,
    unreadable_files,
    with_texture,
)
from shapes import icosphere

POINTS = np.random.default_rng(0).normal(size=(40, 3)).round(5)
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
COLOURS = np.random.default_rng(1).integers(0, 256, (40, 3), np.uint8)


def rows(*tables, separator=" "):
    return "\n".join(separator.join(f"{x:.6g}" for x in row) for row in np.hstack(tables)) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        rows(POINTS),
        rows(POINTS, separator=","),
        rows(POINTS, separator="; "),
        "40\n" + rows(POINTS),
        "# SPACE=LPS\n" + rows(POINTS).replace("\n", "\r\n"),
        "//X Y Z\n" + rows(POINTS),
        "\n\n" + rows(POINTS).replace(" ", "\t"),
    ],
    ids=["blanks", "commas", "semicolons", "counted", "comment", "names", "tabs"],
)
def test_rows_of_text_are_points(tmp_path, text):
    (tmp_path / "a.xyz").write_bytes(text.encode())
    np.testing.assert_allclose(read_mesh(tmp_path / "a.xyz").vertices, POINTS, atol=1e-5)
    assert isinstance(surface_from(tmp_path / "a.xyz"), PointCloud)


@pytest.mark.parametrize("order", ["colour first", "normal first"])
@pytest.mark.parametrize("suffix", [".xyz", ".npy"])
def test_further_columns_are_colours_normals_or_numbers(tmp_path, suffix, order):
    further = [COLOURS, NORMALS] if order == "colour first" else [NORMALS, COLOURS]
    tables, path = [POINTS, *further, np.arange(40)[:, None] / 7], tmp_path / f"a{suffix}"
    path.write_text(rows(*tables)) if suffix == ".xyz" else np.save(path, np.hstack(tables))
    asset = read_asset(path)
    np.testing.assert_array_equal(asset.attribute("color").values, COLOURS)
    np.testing.assert_allclose(asset.attribute("normal").values, NORMALS, atol=1e-5)
    np.testing.assert_allclose(asset.attribute("column 10").values, np.arange(40) / 7, atol=1e-5)


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_clouds_of_pcl(tmp_path, encoding):
    pypcd4 = pytest.importorskip("pypcd4")
    packed = COLOURS.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)
    columns = [
        *POINTS.T.astype("f4"),
        *NORMALS.T.astype("f4"),
        packed.astype("u4"),
        np.arange(40, dtype="f4"),
    ]
    fields = ("x", "y", "z", "normal_x", "normal_y", "normal_z", "rgb", "intensity")
    kinds = tuple(np.uint32 if name == "rgb" else np.float32 for name in fields)
    cloud = pypcd4.PointCloud.from_points(columns, fields, kinds)
    cloud.save(tmp_path / "a.pcd", pypcd4.Encoding(encoding))
    asset = read_asset(tmp_path / "a.pcd")
    np.testing.assert_allclose(asset.points, POINTS, atol=1e-6)
    np.testing.assert_array_equal(asset.attribute("color").values, COLOURS)
    np.testing.assert_allclose(asset.attribute("normal").values, NORMALS, atol=1e-6)
    assert asset.attribute("intensity").values[7] == 7
    data = (tmp_path / "a.pcd").read_bytes()
    (tmp_path / "cut.pcd").write_bytes(data[:-40])
    with pytest.raises(FormatError, match="expected a PCD"):
        read_asset(tmp_path / "cut.pcd")
    (tmp_path / "much.pcd").write_bytes(data.replace(b"POINTS 40", b"POINTS 40000000000"))
    with pytest.raises(FormatError, match="header"):
        read_asset(tmp_path / "much.pcd")


@pytest.mark.parametrize(
    ("array", "remedy"), [(POINTS.T, "transposed"), (POINTS[:, :2], "as columns"), (POINTS > 0, "as columns")]
)
def test_an_array_of_something_else_is_refused_with_what_to_do(tmp_path, array, remedy):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FormatError, match=remedy):
        read_mesh(tmp_path / "a.npy")


def test_clouds_are_shapes_of_a_folder_only_without_surfaces_and_are_not_written(tmp_path):
    (tmp_path / "b.xyz").write_text(rows(POINTS))
    assert [path.name for path in meshes_among(tmp_path.iterdir())] == ["b.xyz"]
    write_mesh(tmp_path / "a.ply", icosphere(1))
    assert [path.name for path in meshes_among(tmp_path.iterdir())] == ["a.ply"]
    with pytest.raises(FormatError, match="not a mesh format"):
        write_mesh(tmp_path / "c.xyz", icosphere(1))


def test_a_command_takes_a_cloud(tmp_path, capsys):
    (tmp_path / "a.xyz").write_text(rows(icosphere(2).vertices))
    main(["check", str(tmp_path / "a.xyz"), "--json"])
    assert json.loads(capsys.readouterr().out)["n_vertices"] == 162


PLY = """ply
format ascii 1.0
comment made by hand
comment TextureFile red one.png
comment TextureFile green.png
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
property list uchar float texcoord
property int texnumber
end_header
0 0 0
1 0 0
1 1 0
0 1 0
3 0 1 2 6 0 0 1 0 1 1 {}
3 0 2 3 6 0 0 1 1 0 1 {}
"""


def textured(folder, first=0, second=1):
    for name, colour in (("red one.png", (200, 0, 0)), ("green.png", (0, 100, 0))):
        Image.new("RGB", (2, 2), colour).save(folder / name)
    (folder / "square.ply").write_text(PLY.format(first, second))
    return folder / "square.ply"


def seen(path):
    """Return the colour of the picture on each triangle, in the order of their middles."""
    asset, colours = read_asset(path), []
    looks, middles = looks_of(asset), asset.placed_points[asset.polygons.triangles].mean(axis=1)
    for look in looks.of_triangle[np.argsort(-middles[:, 0])]:
        picture = looks.looks[look].base.picture
        assert not picture.missing
        (path.parent / "seen.png").write_bytes(picture.data)
        colours.append(Image.open(path.parent / "seen.png").convert("RGB").getpixel((0, 0)))
    return colours


@pytest.mark.parametrize("between", [None, "obj", "glb", "gltf"])
@pytest.mark.parametrize("numbers", [(0, 1), (1, 0), (1, 1)], ids=str)
def test_pictures_of_ply_go_through_every_format_that_has_some(tmp_path, numbers, between):
    truth = [[(200, 0, 0), (0, 100, 0)][number] for number in numbers]
    path = textured(tmp_path, *numbers)
    assert seen(path) == truth
    for suffix in (between, "ply") if between else ("ply",):
        (tmp_path / suffix).mkdir(exist_ok=True)
        asset, path = read_asset(path), tmp_path / suffix / f"out.{suffix}"
        assert {lost.name for lost in write_asset(path, asset)} <= {"names of material"}
        assert seen(path) == truth


def test_a_picture_that_is_not_there_is_named_and_pictures_without_a_place_too(tmp_path):
    path = textured(tmp_path)
    assert {"the pictures of the materials", "uv", "texnumber"} == {
        lost.name for lost in write_asset(tmp_path / "a.stl", read_asset(path))
    }
    (tmp_path / "green.png").unlink()
    assert unreadable_files(read_asset(path)) == (
        "'green.png': there is no such file in the folder of the surface",
    )
    main(["repair", str(path), "-o", str(tmp_path / "b.ply")])
    assert "TextureFile green.png" in (tmp_path / "b.ply").read_text(errors="replace")


def test_a_picture_named_twice_keeps_both_numbers_and_comments_their_place(tmp_path):
    path = textured(tmp_path, 0, 2)
    path.write_text(
        path.read_text().replace("comment TextureFile green.png", "comment TextureFile green.png\n" * 2)
    )
    path.write_text(path.read_text().replace("\n\n", "\n"))
    (tmp_path / "copy").mkdir()
    write_asset(tmp_path / "copy" / "b.ply", read_asset(path))
    assert seen(tmp_path / "copy" / "b.ply") == [(200, 0, 0), (0, 100, 0)]
    comments = [line for line in path.read_text().splitlines() if line.startswith("comment")]
    assert list(read_asset(tmp_path / "copy" / "b.ply").document.comments) == comments


def test_a_baked_picture_is_written_beside_a_ply_file(tmp_path):
    plain = read_asset(textured(tmp_path))
    (tmp_path / "c").mkdir()
    write_asset(tmp_path / "c" / "baked.ply", with_texture(plain, (tmp_path / "green.png").read_bytes()))
    assert seen(tmp_path / "c" / "baked.ply") == [(0, 100, 0)] * 2


@pytest.mark.parametrize("convert", [to_trimesh, to_pyvista, to_meshio])
def test_the_space_goes_with_objects_of_other_libraries(tmp_path, convert):
    pytest.importorskip(convert.__name__.removeprefix("to_"))
    (tmp_path / "a.ply").write_text(PLY.format(0, 0).replace("comment made by hand", "comment SPACE=LPS"))
    assert asset_from(convert(read_asset(tmp_path / "a.ply"))).frame.axes == "LPS"
    assert asset_from(convert(read_asset(textured(tmp_path)))).frame is None
