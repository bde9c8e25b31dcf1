"""Four small creatures in a folder, settings for quick matches, and a collection of all their pairs."""

import shutil
from types import SimpleNamespace

import pytest
from small_collections import N, run

import isomatch
from isomatch.collections import Collection
from isomatch.datasets import example_pair
from isomatch.surfaces import decimate

QUICK = (
    "n_columns = 40\nrank = 20\nn_functions = 40\nn_search = 100\nn_refine = 100\nrefinement = 'none'\n"
    "[search]\nflipped = 1\nstart_steps = 2\n"
)


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """The folder, the file of the settings, and the settings."""
    folder = tmp_path_factory.mktemp("small")
    shapes = folder / "shapes"
    shapes.mkdir()
    for i, n in enumerate(N):
        isomatch.write_mesh(shapes / f"s{i}.ply", decimate(example_pair()[i % 2].mesh, n).mesh)
    (folder / "quick.toml").write_text(QUICK)
    return SimpleNamespace(
        shapes=shapes, settings=folder / "quick.toml", config=isomatch.Config.from_file(folder / "quick.toml")
    )


@pytest.fixture(scope="session")
def finished(small, tmp_path_factory):
    """Folder of a collection of which all pairs are matched; not to be changed."""
    folder = tmp_path_factory.mktemp("finished") / "all"
    events = run(Collection.create(folder, small.shapes, pairs="all", config=small.config))
    assert [event.record["state"] for event in events] == ["done"] * 10
    return folder


@pytest.fixture
def copied(finished, tmp_path):
    """A copy of the finished collection."""
    return Collection.open(shutil.copytree(finished, tmp_path / "all"))
