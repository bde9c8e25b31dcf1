"""``isomatch demo keys`` and ``demo landmarks`` write the files of two wish pages."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from isomatch import Landmarks, read_asset, read_mesh
from isomatch.cli import main
from isomatch.datasets import animal_head

WISHES = Path(__file__).parents[2] / "docs" / "wishes"
SPECIMENS = "abcde"


def test_keys_are_those_of_two_rigged_heads(tmp_path, capsys):
    assert main(["demo", "keys", "-o", str(tmp_path / "new")]) == 0
    assert "isomatch match" in capsys.readouterr().out
    cat, lion = (read_asset(tmp_path / f"new/{name}.glb") for name in ("cat", "lion"))
    assert [each.name for each in cat.attributes] == ["uv", "weights", "jaw_open", "smile"]
    assert [each.name for each in lion.attributes] == ["uv", "weights"]
    for animal, species in ((cat, "cat"), (lion, "lion")):
        weights = animal.attribute("weights")
        assert [*weights.names.values()] == ["neck", "head", "jaw"]
        np.testing.assert_allclose(weights.dense_weights.sum(axis=1), 1, atol=1e-6)
        assert weights.dense_weights.max(axis=0).min() > 0.9
        uv = animal.attribute("uv").values
        assert 0 <= uv.min() < uv.max() <= 1
        skin = animal.document.json["skins"][0]
        nodes = [animal.document.json["nodes"][joint] for joint in skin["joints"]]
        # joints are where the inverse bind matrices say
        places = np.cumsum([node["translation"] for node in nodes], axis=0)
        inverse = animal.document.data.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        np.testing.assert_allclose(inverse[:, 3, :3], -places, atol=1e-6)
        n_vertices = len(np.unique(animal.points, axis=0))  # points along the seam are there twice
        assert n_vertices == animal_head(species, n_vertices).mesh.n_vertices
        first, second, third = uv[animal.polygons.triangles].transpose(1, 2, 0)
        (a, b), (c, d) = second - first, third - first
        assert (a * d > b * c).all()  # no triangle is turned over in the picture
    for key in ("jaw_open", "smile"):
        moves = np.linalg.norm(cat.attribute(key).values, axis=1)
        assert 0.1 < moves.max() < 1
        assert 0.5 < (moves == 0).mean() < 0.95


@pytest.mark.parametrize("name", ["keys", "landmarks"])
def test_nothing_is_replaced_unless_forced(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", name, "--json"]) == 0
    files = [Path(each) for each in json.loads(capsys.readouterr().out)["files"]]
    before = {file: file.read_bytes() for file in files}
    assert {file for file in tmp_path.rglob("*") if file.is_file()} == {tmp_path / file for file in files}
    files[-1].write_text("my own")
    files[0].unlink()
    assert main(["demo", name]) == 1
    assert "already exists" in capsys.readouterr().err
    assert files[-1].read_text() == "my own"
    assert not files[0].exists()
    assert main(["demo", name, "--force", "--quiet"]) == 0
    assert {file: file.read_bytes() for file in files} == before


def test_demos_are_listed(capsys):
    assert main(["demo", "--help"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "keys Write two rigged heads" in told.replace("│ ", "")
    assert "ground truth" in told


def run_page(page, folder):
    """Run the shell commands of a page, each in a process of its own."""
    text = (WISHES / page).read_text(encoding="utf-8")
    text = re.sub(r"<!-- not run.*?```sh.*?```", "", text, flags=re.DOTALL)
    for line in re.findall(r"^isomatch [^\n]*$", text, re.MULTILINE):
        argv = [sys.executable, "-m", *shlex.split(line, comments=True)]
        done = subprocess.run(argv, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, (line, done.stderr)


@pytest.mark.long
def test_the_page_of_keys(tmp_path):
    """The carried keys are near to those that the lion would have by itself."""
    run_page("shape_keys.md", tmp_path)
    own, found = animal_head("lion", 3500, triangulation=1), read_asset(tmp_path / "lion_with_all.glb")
    away, place = KDTree(own.mesh.vertices).query(found.points)
    assert away.max() < 1e-6
    for name, of_vertex in own.keys.items():
        moves, expected = found.attribute(name).values, of_vertex[place]
        lengths = np.linalg.norm(moves, axis=1), np.linalg.norm(expected, axis=1)
        moved = (lengths[0] > 0) & (lengths[1] > 0.25 * lengths[1].max())
        cosines = np.einsum("ni,ni->n", moves, expected)[moved] / (lengths[0] * lengths[1])[moved]
        assert np.median(np.degrees(np.arccos(cosines))) < 10, name
        assert moved.sum() > 0.9 * (lengths[1] > 0.25 * lengths[1].max()).sum(), name
    assert [each.name for each in read_asset(tmp_path / "lion_with_keys.glb").of_kind("key")] == [*own.keys]


@pytest.mark.long
def test_the_page_of_landmarks(tmp_path):
    run_page("landmarks_to_fifty.md", tmp_path)
    errors = []
    for i, name in enumerate(SPECIMENS):
        own = animal_head(n_vertices=2000, individual=i, triangulation=i).turned(i)
        mesh = read_mesh(tmp_path / f"scans/{name}.ply")
        found = Landmarks.read(tmp_path / f"cohort/landmarks/{name}.mrk.json", mesh)
        assert found.names == own.landmarks.names
        errors.append(np.linalg.norm(found.positions - own.landmarks.positions, axis=1) / np.sqrt(mesh.area))
    assert np.max(errors[0]) < 1e-4
    assert np.median(errors[1:]) < 0.012
    assert np.max(errors) < 0.03
