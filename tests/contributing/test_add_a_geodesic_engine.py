"""The recipe "Add a geodesic engine" of CONTRIBUTING.md, followed with two toy engines."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from isomatch import Mesh, SettingError, distance_basis, geodesic_distances, write_mesh
from isomatch.cli import main
from isomatch.geodesics import ENGINES, ColumnEngine, ComponentEngine, distance_engine, engine_names
from shapes import icosphere

TESTS = Path(__file__).parents[1]


class ToyColumns(ColumnEngine):
    """Computes columns for any mesh: delegates to the default engine."""

    name = "toy_columns"

    def __init__(self, mesh):
        self.n_points = mesh.n_vertices
        self._engine = distance_engine(mesh, weld=False)

    def _columns(self, sources):
        return self._engine.distances_from(sources)


class ToyComponents(ComponentEngine):
    """Needs one solver for each connected component."""

    name = "toy_components"

    def _solver(self, component):
        engine = distance_engine(component, weld=False)
        return lambda source: engine.distances_from([source])[0]


TOYS = (ToyColumns, ToyComponents)


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The entries in the registry."""
    monkeypatch.setitem(ENGINES, Mesh, (*ENGINES[Mesh], *TOYS))


@pytest.mark.parametrize("toy", TOYS)
def test_distances_and_bases_find_it_by_name(toy):
    sphere = icosphere(2)
    assert toy.name in engine_names(Mesh)
    assert isinstance(distance_engine(sphere, toy.name), toy)
    assert np.array_equal(geodesic_distances(sphere, [3], toy.name), geodesic_distances(sphere, [3]))
    assert distance_basis(sphere, 9, 20, engine=toy.name).engine == toy.name


@pytest.mark.parametrize("toy", TOYS)
def test_the_command_line_accepts_it(toy, tmp_path, capsys):
    write_mesh(tmp_path / "sphere.off", icosphere(1))
    sphere = str(tmp_path / "sphere.off")
    assert main(["distance", sphere, "--from", "0", "--engine", toy.name, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["engine"] == toy.name
    output = str(tmp_path / "basis.npz")
    command = ["basis", sphere, "-o", output, "--k", "4", "--p", "9", "--engine", toy.name, "--json"]
    assert main(command) == 0
    assert json.loads(capsys.readouterr().out)["engine"] == toy.name


def test_messages_list_it(tmp_path, capsys):
    with pytest.raises(SettingError, match="available"):
        distance_engine(icosphere(0), "magic")
    assert main(["distance", "sphere.off", "--from", "0", "--engine", "magic"]) == 2
    assert "known are fast_marching" in (said := capsys.readouterr().err)
    assert "toy_columns, toy_components" in said


@pytest.mark.long
def test_the_laws_of_all_engines_run_over_it(tmp_path):
    """The tests are collected in a process whose registry has the toys, and none of them is edited."""
    (tmp_path / "registration.py").write_text(
        "from isomatch import Mesh\n"
        "from isomatch.geodesics import ENGINES\n"
        f"from {Path(__file__).stem} import TOYS\n"
        "ENGINES[Mesh] += TOYS\n"
    )
    folders = [str(tmp_path), str(Path(__file__).parent), *filter(None, sys.path)]
    laws = str(TESTS / "geodesics" / "test_engines.py")
    run = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            laws,
            "-k",
            "toy",
            "-p",
            "registration",
            "-p",
            "no:cacheprovider",
            "-rN",
        ],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
        cwd=TESTS.parent,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert int(re.search(r"(\d+) passed", run.stdout)[1]) >= 40 * len(TOYS)
