"""``isomatch basis``: exit codes and files."""

import json

import numpy as np
import pytest

import isomatch
from isomatch.cli import main
from isomatch_lab.procedural import creature


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "creature.ply"
    isomatch.write_mesh(path, creature(1500).mesh)
    return path


def test_basis_and_canonical_form_are_written(file, tmp_path, capsys):
    out, form = tmp_path / "basis.npz", tmp_path / "form.ply"
    arguments = ["basis", str(file), "-o", str(out), "--k", "20", "--p", "40", "--method", "nystrom"]
    assert main([*arguments, "--single", "--canonical", str(form), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    basis = isomatch.DistanceBasis.load(out)
    told = said["rank"], said["columns"], said["method"], said["engine"]
    assert told == (20, 40, "nystrom", "fast_marching")
    assert said["estimated_relative_error"] == pytest.approx(basis.error_estimate())
    assert basis.vectors.dtype == np.float32
    mesh, embedded = isomatch.read_mesh(file), isomatch.read_mesh(form)
    np.testing.assert_array_equal(embedded.faces, mesh.faces)
    assert 0 < said["stress"] < 0.2


def test_tolerance_is_met_and_reported(file, tmp_path, capsys):
    out = tmp_path / "basis.npz"
    assert main(["basis", str(file), "-o", str(out), "--tolerance", "0.03"]) == 0
    said = capsys.readouterr().out
    words = "rank", "method", "predicted", "engine", "fast_marching", "seconds", "estimated relative error"
    assert all(word in said for word in words)
    assert isomatch.DistanceBasis.load(out).error_estimate() <= 0.03


def test_an_existing_basis_is_kept_unless_forced(file, tmp_path, capsys):
    out = tmp_path / "basis.npz"
    out.write_bytes(b"precious")
    arguments = ["basis", str(file), "-o", str(out), "--k", "5", "--p", "10"]
    assert main(arguments) == 1
    assert "already exists" in capsys.readouterr().err
    assert out.read_bytes() == b"precious"
    assert main([*arguments, "--force"]) == 0
    assert isomatch.DistanceBasis.load(out).rank == 5


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--k", "20", "--p", "10"], 1, "k = 20 must lie in 1…p = 10"),
        (["--method", "magic"], 2, "magic"),
        (["--engine", "magic"], 2, "There is no engine 'magic'; known are fast_marching"),
        (["--tolerance", "0"], 1, "tolerance = 0.0 is not a positive"),
    ],
)
def test_bad_settings(file, tmp_path, capsys, arguments, code, message):
    assert main(["basis", str(file), "-o", str(tmp_path / "b.npz"), *arguments]) == code
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
