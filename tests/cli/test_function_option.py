"""``isomatch match --function``: values of both files take part in the match."""

import json

import numpy as np
import pytest

import isomatch
from command_line import QUICKEST
from isomatch.cli import main
from isomatch.cli.inputs import read_functions
from isomatch.io import Asset, Attribute
from shapes import box

pytestmark = pytest.mark.usefixtures("small_pictures")


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick.toml").write_text(QUICKEST)
    brick = box(4, 8, 12)
    corner = np.exp(-((np.linalg.norm(brick.vertices - brick.vertices.max(axis=0), axis=1) / 3) ** 2))
    named = [
        Attribute("corner", "point", "scalar", corner),
        Attribute("side", "face", "scalar", np.zeros(brick.n_faces)),
        Attribute("number", "point", "label", np.arange(brick.n_vertices)),
    ]
    for name in ("a.vtp", "b.vtp"):
        isomatch.write_asset(tmp_path / name, Asset.of_mesh(brick, named))
    return brick


@pytest.mark.long
def test_a_marked_corner_goes_to_the_marked_corner(files):
    assert (
        main(["match", "a.vtp", "b.vtp", "-o", "out", "--config", "quick.toml", "--function", "corner"]) == 0
    )
    result = isomatch.Correspondence.load("out/map.npz", files.n_vertices)
    marked = files.vertices.max(axis=0)
    at = np.linalg.norm(files.vertices - marked, axis=1).argmin()
    assert np.linalg.norm(files.vertices[result.vertices[at]] - marked) < 2
    with open("out/result.json", encoding="utf-8") as file:
        assert "--function corner" in json.load(file)["match_again"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "told"), [("corners", "'corner'"), ("side", "no attribute"), ("number", "label")]
)
def test_what_is_no_function_of_the_points_is_refused(files, name, told, capsys):
    assert main(f"match a.vtp b.vtp -o out --config quick.toml --function {name}".split()) == 1
    assert told in capsys.readouterr().err


def test_colours_are_fractions_whatever_the_file_has(tmp_path):
    mesh = box(1, 1, 1)
    colors = np.arange(4 * mesh.n_vertices, dtype=np.uint8).reshape(-1, 4)
    for name, values in (("a.ply", colors), ("b.obj", colors[:, :3])):
        color = Attribute("color", "point", "colour", values)
        isomatch.write_asset(tmp_path / name, Asset.of_mesh(mesh, [color]))
        found = read_functions(tmp_path / name, ["color"], mesh.n_vertices)
        np.testing.assert_allclose(found, colors[:, :3] / 255, atol=1e-6)
