"""A pair of small shapes on disk, and how the command line matches them."""

import pytest

import isomatch
from isomatch.datasets import example_pair

collect_ignore = ["like_windows"]  # changes the process that imports it

QUICK = "n_columns = 40\nrank = 20\nn_functions = 40\nn_search = 100\nn_refine = 100\nrefinement = 'none'\n"


@pytest.fixture(scope="session")
def pair():
    return tuple(creature.mesh for creature in example_pair())


@pytest.fixture(scope="session")
def match_argv(pair, tmp_path_factory):
    """Function from an output folder to the arguments of a quick match."""
    folder = tmp_path_factory.mktemp("shapes")
    for name, mesh in zip(("source.ply", "target.ply"), pair):
        isomatch.write_mesh(folder / name, mesh)
    (folder / "quick.toml").write_text(QUICK)
    ends = [str(folder / "source.ply"), str(folder / "target.ply")]
    return lambda out: ["match", *ends, "-o", str(out), "--config", str(folder / "quick.toml")]
