"""Classes of different kinds with known correspondence, in tiny folders."""

import numpy as np
import pytest

from isomatch import FormatError, MissingFileError, SettingError
from isomatch_lab.sets import benchmark_set
from shapes import icosphere

BALL = icosphere(1)
SMALL = icosphere(0)
ONTO = np.linalg.norm(BALL.vertices[:, None] - SMALL.vertices, axis=2).argmin(axis=1)


@pytest.fixture
def folder(tmp_path):
    """Two poses of a cat, one of a wolf, two of a person, and the truth from cat to wolf and to the person."""
    for name in ("tosca", "scape", "cross"):
        (tmp_path / name).mkdir()
    np.savez(tmp_path / "tosca" / "cat.npz", faces=BALL.faces, cat0=BALL.vertices, cat1=2 * BALL.vertices)
    np.savez(tmp_path / "tosca" / "wolf.npz", faces=SMALL.faces, wolf0=SMALL.vertices)
    np.savez(
        tmp_path / "scape" / "scape.npz", faces=SMALL.faces, mesh000=SMALL.vertices, mesh001=SMALL.vertices
    )
    np.savez(tmp_path / "cross" / "truth.npz", **{"cat|wolf": ONTO, "cat|scape": ONTO})
    return tmp_path


def test_two_poses_of_each_direction(folder):
    found = benchmark_set("cross", folder)
    assert found.pairs == (("cat0", "wolf0"), ("cat1", "wolf0"), ("cat0", "mesh000"), ("cat1", "mesh001"))


def test_the_target_is_relabelled_and_the_truth_with_it(folder):
    pair = benchmark_set("cross", folder).load("cat1", "wolf0")
    assert (pair.truth[:, 0] == np.arange(BALL.n_vertices)).all()
    assert (pair.truth[:, 1] != ONTO).any()
    np.testing.assert_allclose(pair.source.vertices, 2 * BALL.vertices)
    images, expected = pair.target.vertices[pair.truth[:, 1]], SMALL.vertices[ONTO]
    np.testing.assert_allclose(images @ images.T, expected @ expected.T, atol=1e-12)


def test_what_is_missing_is_named(folder):
    found = benchmark_set("cross", folder)
    for names, what in ((("wolf0", "cat0"), "wolf|cat"), (("cow0", "cat0"), "cow0")):
        with pytest.raises(MissingFileError, match=what):
            found.load(*names)
    with pytest.raises(SettingError, match="no hand-picked landmarks"):
        benchmark_set("cross", folder, folder)
    (folder / "tosca" / "wolf.npz").unlink()
    with pytest.raises(MissingFileError, match="shapes"):
        benchmark_set("cross", folder)
    (folder / "cross" / "truth.npz").unlink()
    with pytest.raises(MissingFileError, match=r"truth\.npz"):
        benchmark_set("cross", folder)


@pytest.mark.parametrize("truth", [ONTO[1:], np.full(BALL.n_vertices, SMALL.n_vertices)])
def test_truth_that_does_not_fit_is_refused(folder, truth):
    np.savez(folder / "cross" / "truth.npz", **{"cat|wolf": truth})
    with pytest.raises(FormatError, match="do not map"):
        benchmark_set("cross", folder).load("cat0", "wolf0")
