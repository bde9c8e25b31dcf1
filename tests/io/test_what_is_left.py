"""`write_asset` returns what is not in the file; what no file could hold is refused before it is written."""

import numpy as np
import pytest
from made import ATTRIBUTES, POINTS, POLYGONS

from isomatch import (
    Asset,
    FormatError,
    Mesh,
    MeshError,
    read_asset,
    read_mesh,
    write_asset,
    write_mesh,
)
from isomatch.io import Attribute, Polygons, asset_from, to_pyvista

REGION = Attribute("words", "point", "label", ["a", "b", "a", "c", "a", "a", "b"])


def carrying(*attributes):
    return Asset(POINTS, POLYGONS, attributes)


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".ply", ".vtp", ".vtu", ".vtk", ".glb", ".gii"])
def test_names_of_labels_are_in_the_file_or_returned(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    left = write_asset(path, carrying(REGION, ATTRIBUTES["label"]))
    for given in (REGION, ATTRIBUTES["label"]):
        found = read_asset(path).attribute(given.name)
        lost = [a for a in left if a.name == f"names of {given.name}"]
        named = lost[0] if lost else found
        words = [named.coded.names[code] for code in named.coded.values.tolist()]
        assert words == [given.coded.names[code] for code in given.coded.values.tolist()]


@pytest.mark.parametrize("suffix", [".obj", ".off"])
def test_opacity_is_returned(tmp_path, suffix):
    colors = np.full((7, 4), 255, np.uint8)
    assert write_asset(tmp_path / f"a{suffix}", carrying(Attribute("color", "point", "colour", colors))) == ()
    colors[2, 3] = 51
    [left] = write_asset(tmp_path / f"a{suffix}", carrying(Attribute("color", "point", "colour", colors)))
    assert left.name == "opacity of color"
    assert np.allclose(left.values, [1, 1, 0.2, 1, 1, 1, 1])


def test_points_without_texture_coordinates_have_none_in_obj(tmp_path):
    uv = np.column_stack([np.linspace(0, 1, 7), np.linspace(1, 0, 7)])
    uv[3] = np.nan
    normals = np.tile([0, 0.6, 0.8], (7, 1))
    normals[5] = np.nan
    asset = carrying(Attribute("uv", "point", "uv", uv), Attribute("normal", "point", "normal", normals))
    write_asset(tmp_path / "a.obj", asset)
    assert "nan" not in (tmp_path / "a.obj").read_text()
    again = read_asset(tmp_path / "a.obj")
    assert np.array_equal(again.attribute("uv").values, uv[POLYGONS.corners], equal_nan=True)
    assert np.array_equal(again.attribute("normal").values, normals[POLYGONS.corners], equal_nan=True)


@pytest.mark.parametrize("suffix", [".obj", ".vtu", ".glb"])
def test_a_file_that_none_could_read_is_not_written(tmp_path, suffix):
    with pytest.raises(MeshError, match=r"there (are|is) no"):
        write_asset(tmp_path / f"a{suffix}", Asset(np.zeros((0, 3)), Polygons([], [])))
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_polygons_of_points_that_are_not_there(tmp_path):
    """A mesh may have them, so that `check` can tell; what is built on it may not."""
    bad = Mesh(np.eye(3), [[0, 1, 9]])
    uv = Attribute("uv", "corner", "uv", np.zeros((3, 2)))
    write_mesh(tmp_path / "a.vtp", bad)
    assert read_mesh(tmp_path / "a.vtp").faces.tolist() == [[0, 1, 9]]
    for use in (
        lambda: read_asset(tmp_path / "a.vtp"),
        lambda: asset_from(bad),
        lambda: Asset.of_mesh(bad).mesh,
        lambda: Asset.of_mesh(bad).vertex_of_corner,
        lambda: write_asset(tmp_path / "a.obj", Asset.of_mesh(bad, [uv])),
        lambda: to_pyvista(Asset.of_mesh(bad, [uv])),
        lambda: write_mesh(tmp_path / "a.glb", bad),
    ):
        with pytest.raises(ValueError, match="outside") as caught:
            use()
        assert isinstance(caught.value, MeshError | FormatError)
    assert not (tmp_path / "a.glb").exists()
