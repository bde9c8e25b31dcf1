"""Limbs that touch: glued sheets are separated before they are matched."""

import numpy as np
import pytest

from isomatch import Config, Correspondence, Outcome, check, match, prepare
from isomatch.datasets import ground_truth
from isomatch.evaluation import counted, geodesic_errors
from isomatch.settings import PreparationSettings
from isomatch_lab.damage import damaged_pair, weld
from isomatch_lab.procedural import creature
from isomatch_lab.sets import BenchmarkPair, relabelled

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def pair():
    """Two poses of a creature; in the second, two legs touch and are welded."""
    made = [creature(1500, kind="quadruped", style=0, pose=pose, triangulation=pose) for pose in (1, 3)]
    target, new = relabelled(made[1].mesh, 0)
    truth = np.column_stack([np.arange(made[0].mesh.n_vertices), new[ground_truth(*made).vertices]])
    whole = BenchmarkPair("poses", made[0].mesh, target, truth)
    return damaged_pair(whole, target=weld(target, 0.1))


@pytest.fixture(scope="module")
def welded(pair):
    return prepare(pair.given.target)


def error_of(pair, found):
    lifted = pair.lifted(found.map.vertices)
    target, truth = pair.whole.target, pair.whole.truth
    errors = [
        geodesic_errors(target, Correspondence(image, target.n_vertices), truth, 300) for image in lifted
    ]
    return float(counted(np.min(errors, axis=0)).mean())


@pytest.mark.long
def test_the_body_of_a_welded_shape_is_that_of_the_whole(pair, welded):
    n, merged = pair.given.target.n_vertices, int((pair.target.twin >= 0).sum())
    assert welded.body.n_vertices == pair.whole.target.n_vertices == n + merged
    assert check(welded.body).euler_number == 2
    assert any(f"glued together at {merged} vertices" in note for note in welded.notes)
    np.testing.assert_array_equal(welded.user_vertex[welded.body_vertex], np.arange(n))


@pytest.mark.long
def test_welds_do_not_matter(pair, welded):
    source = prepare(pair.given.source)
    found = match(source, welded)
    assert found.outcome is Outcome.CONVERGED
    assert (found.map.vertices >= 0).all()
    assert error_of(pair, found) < 0.02
    back = match(welded, source)
    assert (back.map.vertices >= 0).all()
    assert back.outcome is Outcome.CONVERGED


def test_sheets_may_be_left_together(pair):
    glued = prepare(pair.given.target, Config(preparation=PreparationSettings(sheet_distance=np.inf)))
    assert glued.body.n_vertices == pair.given.target.n_vertices
    assert not any("glued" in note for note in glued.notes)


def test_given_distances_say_what_is_connected(pair):
    mesh = pair.given.target
    distances = np.linalg.norm(mesh.vertices[:, None] - mesh.vertices, axis=2)
    given = prepare(mesh, Config(n_columns=20, rank=10), distances=distances)
    assert given.body.n_vertices == mesh.n_vertices
