"""Small collections: fixtures of the tests in ``cohort``, how these run them and compare their maps."""

import csv
import shutil
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

import isomatch
from isomatch.cohort import Collection, PairMaps, finish, workers
from isomatch.datasets import example_pair
from isomatch.decimation import decimate
from shapes import icosphere

QUICK = (
    "n_columns = 40\nrank = 20\nn_functions = 40\nn_search = 100\nn_refine = 100\nrefinement = 'none'\n"
    "[search]\nflipped = 1\nstart_steps = 2\n"
)
N = (260, 270, 280, 290)  # vertices of the shapes


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """The folder of four creatures, the file of settings for quick matches, and the settings."""
    folder = tmp_path_factory.mktemp("small")
    shapes = folder / "shapes"
    shapes.mkdir()
    for i, n in enumerate(N):
        isomatch.write_mesh(shapes / f"s{i}.ply", decimate(example_pair()[i % 2].mesh, n).mesh)
    settings = folder / "quick.toml"
    settings.write_text(QUICK)
    config = isomatch.Config.from_file(settings)
    return SimpleNamespace(folder=folder, shapes=shapes, settings=settings, config=config)


@pytest.fixture(scope="session")
def finished(small, tmp_path_factory):
    """Folder of a collection of which all pairs are matched; not to be changed."""
    folder = tmp_path_factory.mktemp("finished") / "all"
    events = run(Collection.create(folder, small.shapes, pairs="all", config=small.config))
    assert [event.state for event in events] == ["done"] * 10
    return folder


@pytest.fixture
def copied(finished, tmp_path):
    """A copy of the finished collection."""
    return Collection.open(shutil.copytree(finished, tmp_path / "all"))


@pytest.fixture
def in_threads(monkeypatch):
    """Local workers that need not be started."""
    monkeypatch.setattr(workers, "worker_processes", lambda _: ThreadPoolExecutor(1))


def lopsided_blob(level, seed=0, spread=0.01):
    """A sphere with four unlike bumps: no rotation and no reflection leaves it as it is."""
    ball = icosphere(level)
    points, radius = ball.vertices, np.ones(ball.n_vertices)
    for direction, height, width in (
        ((1, 0, 0), 0.9, 0.35),
        ((0, 1, 0), 0.6, 0.3),
        ((0, 0, 1), 0.35, 0.25),
        ((-0.65, -0.54, 0.54), 0.5, 0.2),
    ):
        radius += height * np.exp(-((points - direction) ** 2).sum(axis=1) / (2 * width**2))
    stretched = 1 + spread * np.random.default_rng(seed).standard_normal(3)
    return isomatch.Mesh(points * radius[:, None] * stretched, ball.faces)


def run(collection, **options):
    """Run a collection in this process; its events."""
    with ThreadPoolExecutor(1) as executor:
        return list(collection.run(executor, 1, **options))


def finished_names(collection):
    """Finish a collection in this process; the names of the surfaces that were written."""
    with ThreadPoolExecutor(1) as executor:
        return [line.name for line in finish(collection, executor, 1)]


def lines_of(path):
    """The lines of a CSV file, as dicts."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def arrays_of(folder):
    """Bytes of all maps, by the names of their files."""
    found = {path.name: PairMaps.load(path) for path in (folder / "maps").iterdir()}
    return {
        name: b"".join(
            part.tobytes()
            for side in (maps.forward, maps.backward)
            for part in (side.vertices, side.faces, side.barycentric)
        )
        for name, maps in found.items()
    }
