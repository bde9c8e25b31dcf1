"""A pair of small shapes on disk, and how the command line matches them."""

import pytest

from command_line import QUICKEST, write_pair
from isomatch.datasets import example_pair

collect_ignore = ["like_windows"]  # changes the process that imports it


@pytest.fixture(scope="session")
def pair():
    return tuple(creature.mesh for creature in example_pair())


@pytest.fixture(scope="session")
def match_argv(tmp_path_factory):
    """Function from an output folder to the arguments of a quick match."""
    folder = write_pair(tmp_path_factory.mktemp("shapes"), settings=QUICKEST)
    ends = [str(folder / "source.ply"), str(folder / "target.ply")]
    return lambda out: ["match", *ends, "-o", str(out), "--config", str(folder / "quick.toml")]
