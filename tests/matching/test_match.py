"""The whole match on shapes with known truth, and what its result tells."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from data import tosca
from isomatch import (
    Config,
    Outcome,
    geodesic_distances,
    match,
    prepare,
)
from isomatch._core.threads import serial_blas
from isomatch.correspondence import Embedding
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import prepare_pair
from isomatch.matching.refinements import laplace_icp_embedding
from isomatch_lab.procedural import creature
from shapes import disguised
from zoo import torus

pytestmark = pytest.mark.usefixtures("prepared_once")


def errors(image, truth, target, count=400):
    """Distance on the target from images to truths / √(target area), at evenly chosen source vertices."""
    rows = np.linspace(0, len(truth) - 1, min(count, len(truth))).astype(int)
    columns = geodesic_distances(target, truth[rows])
    return columns[np.arange(len(rows)), image[rows]] / np.sqrt(target.area)


def test_example_pair(example, example_truth, prepared_example):
    found = match(*prepared_example)
    assert errors(found.map.vertices, example_truth, example[1].mesh).mean() < 0.015
    assert found.outcome is Outcome.CONVERGED
    assert found.quality.orientation > 0.8
    assert found.quality.coverage > 0.99
    assert found.quality.matched == 1


@pytest.mark.long
def test_refinement_improves_the_plain_method(example, example_truth, prepared_example):
    landmarks = prepared_example[0].user_vertex[prepared_example[0].column_vertices[:5]]
    pairs = np.column_stack([landmarks, example_truth[landmarks]])
    mean = {}
    for refinement in ("none", "laplace_icp", "joint"):
        config = Config(hypotheses="given", refinement=refinement)
        image = match(*prepared_example, landmarks=pairs, config=config).map.vertices
        mean[refinement] = errors(image, example_truth, example[1].mesh).mean()
    assert mean["joint"] < mean["laplace_icp"] < mean["none"] < 0.05, mean


@pytest.mark.long
def test_post_processing_heals_what_is_wrong_in_places(example, example_truth, prepared_example):
    source, target = prepared_example
    points = target.body.vertices
    rng = np.random.default_rng(0)
    near = cKDTree(points).query(points, k=200)[1]  # within about a tenth of √area
    image = near[
        target.body_vertex[example_truth[source.user_vertex]], rng.integers(0, 200, source.body.n_vertices)
    ]
    with serial_blas():
        embedding = laplace_icp_embedding(prepare_pair(source, target), Embedding(points[image], points))
    healed = target.user_vertex[target.index.vertices(embedding.target, embedding.source)]
    truth, mesh = example_truth[source.user_vertex], example[1].mesh
    before, after = (errors(i, truth, mesh).mean() for i in (target.user_vertex[image], healed))
    assert after < min(0.2 * before, 0.012)


@pytest.mark.long
@pytest.mark.parametrize("n_functions", [20, 33, 50])
def test_post_processing_with_few_functions(n_functions):
    source, target = (creature(1500, pose=i, triangulation=i) for i in (1, 2))
    truth = ground_truth(source, target).vertices
    config = Config(n_functions=n_functions, refinement="laplace_icp", hypotheses="given")
    found = match(source.mesh, target.mesh, initial_map=truth, config=config)
    assert errors(found.map.vertices, truth, target.mesh).mean() < 0.05


@pytest.mark.long
def test_orientation_chooses_between_a_map_and_its_mirror_image():
    source = creature(1500, symmetric=True, triangulation=1)
    target = creature(1500, symmetric=True, triangulation=2, pose=2)
    shapes = prepare(source.mesh), prepare(disguised(target.mesh, rotate=False).mesh)
    new_vertex = disguised(target.mesh, rotate=False).new_vertex
    for orientation, mirrored in (("preserve", False), ("reverse", True)):
        found = match(*shapes, config=replace(shapes[0].config, orientation=orientation))
        truth = new_vertex[ground_truth(source, target, mirrored=mirrored).vertices]
        assert errors(found.map.vertices, truth, shapes[1].surface).mean() < 0.025, orientation
        assert (found.quality.orientation > 0) == (orientation == "preserve")


@pytest.mark.long
@pytest.mark.parametrize("symmetric", [True, False])
def test_only_an_asymmetric_shape_is_told_from_its_mirror_image(symmetric):
    """The poses alone may make one side fit better; that must not be taken for knowledge."""
    shapes = [prepare(creature(1500, symmetric=symmetric, triangulation=i, pose=i).mesh) for i in (1, 4)]
    found = match(*shapes, config=Config(orientation="any"))
    assert found.outcome is (Outcome.SYMMETRY_AMBIGUOUS if symmetric else Outcome.CONVERGED)
    assert (found.quality.mirrored < 1.5) == symmetric
    assert match(*shapes).outcome is Outcome.CONVERGED, "orientation decides"


@pytest.mark.long
@pytest.mark.parametrize(
    "other",
    [lambda: torus(60, 30), lambda: creature(1500, kind="biped", pose=2).mesh],
    ids=["torus", "biped"],
)
def test_different_things_give_low_confidence(prepared_example, other):
    """No right map exists."""
    found = match(prepared_example[0], other())
    assert found.outcome is Outcome.LOW_CONFIDENCE
    assert "landmark" in found.outcome.advice


@pytest.mark.long
def test_result_is_told_in_plain_values(prepared_example):
    stages = []
    pairs = np.column_stack([prepared_example[0].column_vertices[:5]] * 2)
    found = match(
        prepared_example[0],
        prepared_example[0],
        landmarks=pairs,
        config=Config(hypotheses="given"),
        seed=3,
        progress=stages.append,
    )
    summary = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert summary["direction"] == "source -> target"
    assert summary["outcome"] == "CONVERGED"
    assert summary["quality"]["runner_up"] is None, "there is no runner-up: inf is not JSON"
    assert summary["quality"]["landmark_error"] == 0
    assert summary["config"]["hypotheses"] == "given"
    assert (summary["seed"], summary["engine"], summary["origin"]) == (3, "fast_marching", "landmarks")
    assert stages.pop() == "done"
    assert stages == ["prepare", "search", "selection", "refinement", "quality"]
    assert set(summary["timings"]) == {*stages, "total"}


@pytest.mark.long
def test_alternatives_are_other_maps(prepared_example):
    found = match(*prepared_example)
    assert 1 <= len(found.alternatives) <= 2
    for alternative in found.alternatives:
        assert alternative.map.shape == found.map.shape
        assert (alternative.map.vertices != found.map.vertices).mean() > 0.2


@pytest.mark.parametrize("outcome", Outcome)
def test_every_outcome_has_advice(outcome):
    assert outcome.advice.endswith(".")


@pytest.fixture(scope="module")
def wolves():
    """Two poses of the wolf, the target in disguise, and the first five samples as landmarks."""
    source = prepare(tosca("wolf0"), Config(weights="uniform"))  # the paper's own setting
    other = disguised(tosca("wolf1"), seed=11)
    landmarks = source.user_vertex[source.column_vertices[:5]]
    return source, other, np.column_stack([landmarks, other.new_vertex[landmarks]])


@pytest.mark.long
@pytest.mark.parametrize(("refinement", "bound"), [("none", 0.011), ("laplace_icp", 0.003), ("joint", 0.003)])
def test_wolf_from_landmarks(wolves, refinement, bound):
    source, other, pairs = wolves
    config = Config(weights="uniform", hypotheses="given", refinement=refinement)
    found = match(source, other.mesh, landmarks=pairs, config=config)
    assert errors(found.map.vertices, other.new_vertex, other.mesh).mean() < bound


@pytest.mark.long
def test_wolf_without_landmarks(wolves):
    source, other, _ = wolves
    found = match(source, other.mesh)
    assert errors(found.map.vertices, other.new_vertex, other.mesh).mean() < 0.003


@pytest.mark.long
def test_a_wrong_given_map_is_not_called_converged():
    """The map that turns the animal around is given as the only one: the right one is found beside it."""
    source, target = example_pair()
    truth = ground_truth(source, target).vertices
    mirror = source.rest * [-1.0, 1.0, 1.0]
    other_side = cKDTree(source.rest).query(mirror)[1]
    found = match(
        source.mesh,
        target.mesh,
        initial_map=truth[other_side],
        config=Config(hypotheses="given", orientation="any"),
    )
    assert found.outcome in (Outcome.LOW_CONFIDENCE, Outcome.SYMMETRY_AMBIGUOUS)
    assert found.quality.runner_up < 1.05


@pytest.mark.long
def test_contradicted_landmarks_are_told(example, example_truth, prepared_example):
    rng = np.random.default_rng(0)
    sizes = [animal.mesh.n_vertices for animal in example]
    anything = np.column_stack([rng.choice(n, 400, replace=False) for n in sizes])
    for hypotheses in ("all", "given"):
        found = match(*prepared_example, landmarks=anything, config=Config(hypotheses=hypotheses))
        assert found.outcome is Outcome.PRIORS_CONTRADICTED
        assert any("contradicts" in note and "of 400 landmarks" in note for note in found.notes)
    right = np.column_stack([anything[:6, 0], example_truth[anything[:6, 0]]])
    exchanged = right.copy()
    exchanged[:2, 1] = right[[1, 0], 1]
    found = match(*prepared_example, landmarks=exchanged)
    assert found.outcome is Outcome.PRIORS_CONTRADICTED
    named = [f"{source} → {target}" for source, target in exchanged[:2]]
    assert all(any(name in note for note in found.notes) for name in named)
    assert any(note.endswith("√area off)") for note in found.notes)
    assert match(*prepared_example, landmarks=right).outcome is Outcome.CONVERGED


@pytest.mark.long
def test_a_noisy_initial_map_is_not_contradicted_but_a_random_one_is(
    example, example_truth, prepared_example
):
    rng = np.random.default_rng(0)
    n = example[1].mesh.n_vertices
    noisy = np.where(
        rng.random(len(example_truth)) < 0.4, rng.integers(n, size=len(example_truth)), example_truth
    )
    assert match(*prepared_example, initial_map=noisy).outcome is Outcome.CONVERGED
    found = match(*prepared_example, initial_map=rng.integers(n, size=len(example_truth)))
    assert found.outcome is Outcome.PRIORS_CONTRADICTED
    assert found.quality.initial_map_error > 0.2
