"""What must not change a map: labels, pose in space, scale, signs of eigenvectors, seeds, threads.

Ties in the search are broken by rounding, so a law holds if at least 99 % of the images are the same and no other
is more than two edges off.
"""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, match, prepare
from later import some_later
from shapes import disguised


@pytest.fixture(scope="module")
def plain(prepared_example):
    return match(*prepared_example)


@pytest.fixture(scope="module")
def assert_same_map(example, plain):
    mesh = example[1].mesh
    edge = np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1).mean()

    def check(image):
        moved = mesh.vertices[image] - mesh.vertices[plain.map.vertices]
        assert (image == plain.map.vertices).mean() >= 0.97
        assert np.linalg.norm(moved, axis=1).max() <= 2 * edge

    return check


def with_flipped_signs(shape, seed):
    """The same shape with every eigenvector multiplied by a random sign, its derived values not yet computed."""
    rng = np.random.default_rng(seed)
    signs = [rng.choice([-1.0, 1.0], len(basis.values)) for basis in (shape.distances, shape.laplace)]
    return replace(
        shape,
        distances=replace(shape.distances, vectors=shape.distances.vectors * signs[0]),
        laplace=replace(shape.laplace, vectors=shape.laplace.vectors * signs[1]),
    )


@pytest.mark.long
def test_target_relabelled_moved_and_scaled(example, prepared_example, plain, assert_same_map):
    other = disguised(example[1].mesh, seed=5, scale=1000.0)
    found = match(prepared_example[0], prepare(other.mesh))
    assert_same_map(np.argsort(other.new_vertex)[found.map.vertices])
    assert found.outcome is plain.outcome
    for name in ("distortion_mean", "distortion_p95", "coverage", "residual"):
        assert getattr(found.quality, name) == pytest.approx(getattr(plain.quality, name), rel=0.01)


@pytest.mark.long
def test_source_relabelled_moved_and_scaled(example, prepared_example, assert_same_map):
    other = disguised(example[0].mesh, seed=6, scale=0.01)
    found = match(prepare(other.mesh), prepared_example[1])
    assert_same_map(found.map.vertices[other.new_vertex])


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
def test_signs_of_eigenvectors(prepared_example, assert_same_map, seed):
    flipped = (with_flipped_signs(shape, seed + i) for i, shape in enumerate(prepared_example))
    assert_same_map(match(*flipped).map.vertices)


@pytest.mark.long
def test_seed(example, prepared_example, assert_same_map):
    assert_same_map(match(*(prepare(made.mesh, seed=3) for made in example)).map.vertices)


@pytest.mark.long
def test_meshes_or_prepared_shapes_and_any_number_of_threads(example, plain, monkeypatch):
    for threads in ("1", "2"):
        monkeypatch.setenv("ISOMATCH_NUM_THREADS", threads)
        found = match(*(made.mesh for made in example))
        np.testing.assert_array_equal(found.map.vertices, plain.map.vertices)


@pytest.mark.parametrize(
    "config",
    some_later(
        [Config(refinement="none"), Config(refinement="laplace_icp"), Config()],
        lambda config: config == Config(),
    ),
)
def test_self_match_is_the_identity(example, prepared_example, config):
    mesh = example[0].mesh
    other = disguised(mesh, seed=8)
    landmarks = prepared_example[0].column_vertices[:5]
    pairs = np.column_stack([landmarks, other.new_vertex[landmarks]])
    config = replace(config, hypotheses="given")
    found = match(prepared_example[0], other.mesh, landmarks=pairs, config=config)
    np.testing.assert_array_equal(found.map.vertices, other.new_vertex)
    assert found.quality.landmark_error == 0
    assert found.origin == "landmarks"


@pytest.mark.long
def test_self_match_without_landmarks(example, prepared_example):
    other = disguised(example[0].mesh, seed=10)
    found = match(prepared_example[0], prepare(other.mesh))
    np.testing.assert_array_equal(found.map.vertices, other.new_vertex)
    assert found.outcome.name == "CONVERGED"
    assert found.quality.coverage == pytest.approx(1)
