"""Values that make no sense, in arguments, in the environment and as files: a named error that says which."""

import os

import numpy as np
import pytest

from isomatch import (
    Config,
    Correspondence,
    DistanceBasis,
    Graph,
    Mesh,
    PointCloud,
    distance_basis,
    prepare,
    read_mesh,
)
from isomatch._core.errors import FormatError, LandmarkError, MapError, MeshError, SettingError
from isomatch._core.memory import GIB, memory_budget
from isomatch._core.settings import generator
from isomatch._core.tables import read_integers
from isomatch._core.threads import n_threads
from isomatch.matching.priors import checked_landmarks
from isomatch_lab.sets import benchmark_set
from zoo import grid, torus

RAGGED = [[0, 0, 0], [1, 0]]


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Mesh(RAGGED, []), MeshError, "vertices have rows of different lengths"),
        (lambda: Mesh(np.eye(3), [[0, 1, 2], [0, 1]]), MeshError, "faces have rows of different lengths"),
        (lambda: Mesh([["a", "b", "c"]], []), MeshError, "vertices have type <U1, expected real numbers"),
        (lambda: Mesh([[1j, 0, 0]], []), MeshError, "vertices have type complex128"),
        (lambda: Mesh([[10**400, 0, 0]], []), MeshError, "vertices have type object"),
        (lambda: PointCloud(RAGGED), MeshError, "points have rows of different lengths"),
        (lambda: Graph(3, [[0, 1], [1]], [1, 1]), MeshError, "edges have rows of different lengths"),
        (lambda: Graph(3, [[0, 1]], [[1], []]), MeshError, "lengths have rows of different lengths"),
        (lambda: Correspondence([[0], []], 2), MapError, "vertices of a map have rows of different lengths"),
        (lambda: Correspondence([2**64 - 1], 2), MapError, "source vertices 0 are mapped outside"),
        (lambda: Correspondence([0], 3, [[0, 1, 2]], [[np.nan] * 3]), MapError, "sum to 1"),
        (lambda: Correspondence([0], 3, [[0, 1, 2]], [[np.inf, -np.inf, 1]]), MapError, "not negative"),
        (lambda: Correspondence([0], 3, [[0, 1, 2]], [[0, 1], [2]]), MapError, "rows of different lengths"),
        (lambda: checked_landmarks([[0, 1], [2]], 9, 9), LandmarkError, "rows of different lengths"),
    ],
)
def test_arrays(make, error, message):
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize("seed", [-1, 1.5, None, True, "1", np.int64(-3), [1]])
def test_seeds(seed):
    with pytest.raises(SettingError, match="integer"):
        prepare(torus(20, 12), seed=seed)
    with pytest.raises(SettingError, match="seed"):
        distance_basis(grid(6, 6), k=5, p=10, seed=seed)
    with pytest.raises(SettingError, match="seed"):
        benchmark_set("creatures").chosen(2, seed)


def test_seeds_that_are_good():
    assert (
        generator(np.int64(3)).integers(9) == generator(3).integers(9) == np.random.default_rng(3).integers(9)
    )


@pytest.mark.parametrize("value", ["²", " 1_0", "1_0", "0", "-1", "1.5", "nan", "9" * 5000, "٣", "1e3"])
def test_numbers_of_threads(monkeypatch, value):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", value)
    with pytest.raises(SettingError, match="positive"):
        n_threads()


@pytest.mark.parametrize("value", ["inf", "nan", "-1", "0", "0.0", "1_0", "1e400", "8 GB", "٣", "."])
def test_memory_budgets(monkeypatch, value):
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", value)
    with pytest.raises(SettingError, match="positive"):
        memory_budget()


def test_environment_that_is_good(monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "03")
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.5")
    assert (n_threads(), memory_budget()) == (3, GIB // 2)


def pipe(path):
    os.mkfifo(path)
    return path


def device(path):
    path.symlink_to("/dev/zero")
    return path


def folder(path):
    path.mkdir()
    return path


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("make", [pipe, device, folder])
def test_files_that_are_none(tmp_path, make):
    readers = {
        "a.obj": read_mesh,
        "a.ply": read_mesh,
        "map.npz": Correspondence.load,
        "map.txt": Correspondence.load,
        "basis.npz": DistanceBasis.load,
        "config.toml": Config.from_file,
        "pairs.txt": lambda path: read_integers(path, 2, "is no pair"),
    }
    for name, reader in readers.items():
        with pytest.raises(FormatError, match="regular"):
            reader(make(tmp_path / name))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.off", "OFF\n" + "9" * 5000 + " 0 0\n", "a.off:2: expected the number of vertices"),
        (
            "a.off",
            "OFF\n1 1 0\n0 0 0\n3 0 0 99999999999999999999\n",
            "a.off:4: expected whole vertex indices",
        ),
        ("a.obj", "v 0 0 0\nf 1 1 99999999999999999999\n", "a.obj:2: expected whole vertex indices"),
        ("a.obj", "v 1_0 0 0\n", "a.obj:1: expected numbers, found '1_0 0 0'"),
        ("a.off", "OFF\n1 1 0\n1_0 0 0\n3 0 0 0 0_1\n", "a.off:3: expected numbers"),
        ("a.stl", "solid\nvertex 1_0 0 0\nendsolid\n", "a.stl"),
        (
            "a.ply",
            f"ply\nformat ascii 1.0\nelement vertex {'9' * 5000}\nend_header\n",
            "a.ply:3: expected 'element NAME COUNT'",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty list uchar float x\nproperty float y\n"
            "property float z\nend_header\n2 1 1 0 0\n0 0 0\n",
            "a.ply:1: expected an element 'vertex' with numbers x, y, z, found no x",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nelement vertex 1\nend_header\n",
            "a.ply:4: expected 'element NAME COUNT'",
        ),
    ],
)
def test_mesh_files(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(FormatError, match=message):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize("k", [0, -7])
def test_a_basis_without_vectors(k):
    basis = distance_basis(grid(6, 6), k=5, p=10)
    with pytest.raises(MeshError, match="do not make a basis"):
        basis.truncated(k)
    with pytest.raises(MeshError, match="outside 0…35"):
        basis.row(36)
