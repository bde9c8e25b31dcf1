"""Two maps fit equally well, and priors tell which one is meant."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.datasets import ground_truth
from isomatch_lab.damage import holes
from isomatch_lab.procedural import creature
from isomatch_lab.procedural.organs import organ, organ_truth
from shapes import icosphere
from zoo.made import moved, together

pytestmark = pytest.mark.usefixtures("prepared_once")
SIDES = "direct", "other"


def error(target, image, truth):
    """Mean distance in space / √area, where both are known."""
    known = (image >= 0) & (truth >= 0)
    offset = target.vertices[image[known]] - target.vertices[truth[known]]
    return np.linalg.norm(offset, axis=1).mean() / np.sqrt(target.area)


@pytest.fixture(scope="module")
def kidneys():
    """Two bent kidneys with half a turn of symmetry, and both true maps."""
    source, target = (organ("kidney", 1500, style=4, symmetry="turn", pose=pose) for pose in (1, 2))
    both = [organ_truth(source, target, symmetric=other).vertices for other in (False, True)]
    return source.mesh, target.mesh, dict(zip(SIDES, both))


@pytest.fixture(scope="module")
def animals():
    """Two poses of a symmetric animal, and both true maps; the second one mirrors it."""
    source, target = (creature(3500, pose=i, triangulation=i, symmetric=True) for i in (1, 2))
    both = [ground_truth(source, target, mirrored=other).vertices for other in (False, True)]
    return source.mesh, target.mesh, dict(zip(SIDES, both))


@pytest.mark.long
@pytest.mark.parametrize("prior", ["map", "sparse map", "map of components", "landmarks"])
@pytest.mark.parametrize("side", SIDES)
def test_a_prior_wins_a_tie(kidneys, side, prior):
    source, target, truth = *kidneys[:2], kidneys[2][side]
    step = 200 if prior == "sparse map" else 1
    given = {"initial_map": np.where(np.arange(source.n_vertices) % step == 0, truth, -1)}
    if prior == "landmarks":
        rows = prepare(source).column_vertices[:4]
        given = {"landmarks": np.column_stack([rows, truth[rows]])}
    if prior == "map of components":
        ball = moved(icosphere(2), [0, 0, 1.5], 0.1)
        source, target = together(source, ball), together(target, ball)
        given["initial_map"] = truth = np.concatenate([truth, np.full(ball.n_vertices, -1)])
    found = match(source, target, **given)
    assert error(target, found.map.vertices, truth) < 0.05
    if prior in ("map", "map of components"):
        assert found.origin == "initial map"
    if prior == "map":
        assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
        assert found.quality.runner_up >= 1


@pytest.mark.long
@pytest.mark.parametrize("side", SIDES)
def test_a_given_map_may_mirror_also_at_a_coarser_level(animals, side):
    source, target, truth = animals
    found = match(source, target, initial_map=truth[side], config=Config(resolution="fast"))
    assert error(target, found.map.vertices, truth[side]) < 0.03
    assert found.origin == "initial map"
    assert found.outcome is (Outcome.CONVERGED if side == "direct" else Outcome.SYMMETRY_AMBIGUOUS)


@pytest.mark.long
@pytest.mark.parametrize(("part_of", "side"), [("source", "direct"), ("target", "other")])
def test_a_given_map_of_a_part_wins_a_tie(kidneys, part_of, side):
    source, target, truth = kidneys
    part = holes(source if part_of == "source" else target, 0.15, seed=4)
    if part_of == "source":
        shapes, known = (part.mesh, target), truth[side][part.original]
    else:
        shapes, known = (source, part.mesh), part.damaged_vertex[truth[side]]
    found = match(*shapes, initial_map=known)
    assert error(shapes[1], found.map.vertices, known) < 0.06
    assert found.origin == "initial map"
    assert found.outcome is not Outcome.PRIORS_CONTRADICTED


@pytest.mark.long
def test_a_mirrored_map_of_an_asymmetric_animal_does_not_win(example, example_truth, prepared_example):
    """Its sides differ: the map that keeps the orientation fits better."""
    rest = example[0].rest
    mirror = cKDTree(rest).query(rest * [-1, 1, 1])[1]
    found = match(*prepared_example, initial_map=example_truth[mirror])
    assert found.outcome is Outcome.PRIORS_CONTRADICTED


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "turned"), [("kidney", True), ("liver", False), ("kidney", False), ("liver", True)]
)
def test_the_pose_wins_a_tie(kind, turned):
    """The target is aligned within 20° as it is, or by the turn that carries the shape onto itself."""
    made = [organ(kind, 1500, style=4, symmetry="turn", pose=pose) for pose in (1, 2)]
    turn = Rotation.from_rotvec(np.deg2rad(20) * np.array([1, 2, 2]) / 3)
    if turned:
        turn = turn * Rotation.from_euler("z", 180, degrees=True)
    target = Mesh(made[1].mesh.vertices @ turn.as_matrix().T, made[1].mesh.faces)
    found = match(made[0].mesh, target, config=Config(start="pose"))
    truth = organ_truth(*made, symmetric=turned).vertices
    assert error(target, found.map.vertices, truth) < 0.05
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert not any("aligned" in note for note in found.notes)


@pytest.mark.long
def test_a_pose_that_misleads_is_told(example, prepared_example):
    over = Mesh(example[1].mesh.vertices @ np.diag([1.0, -1, -1]), example[1].mesh.faces)
    found = match(prepared_example[0], over, config=Config(start="pose"))
    assert found.outcome is Outcome.CONVERGED
    assert any("do not seem to be aligned" in note for note in found.notes)
