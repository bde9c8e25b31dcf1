"""Orthogonal alignment within sign blocks, and iterative closest points, on planted solutions."""

import numpy as np
import pytest
from scipy.stats import ortho_group

from isomatch.correspondence import (
    SignedPoints,
    alignment_residual,
    iterative_closest_points,
    signed_procrustes,
)

SIGNS = np.array([1, -1, -1, 1, -1, -1, -1, 1, -1, -1.0])
DECAY = 1 / (1 + np.arange(10.0))


def planted_rotation(signature, seed=0):
    """Orthogonal on the columns of each sign, zero between them."""
    rotation = np.zeros((len(signature),) * 2)
    for sign in (1, -1):
        rows = np.flatnonzero(signature == sign)
        if len(rows):
            block = ortho_group.rvs(len(rows), random_state=seed) if len(rows) > 1 else np.array([[-1.0]])
            rotation[np.ix_(rows, rows)] = block
    return rotation


def random_cloud(n=80, signature=SIGNS, seed=0):
    return SignedPoints(np.random.default_rng(seed).normal(size=(n, len(signature))), signature)


@pytest.mark.parametrize("seed", range(3))
def test_recovers_a_planted_rotation(seed):
    target, rotation = random_cloud(seed=seed), planted_rotation(SIGNS, seed)
    source = SignedPoints(target.coordinates @ rotation, SIGNS)
    found = signed_procrustes(source, target)
    np.testing.assert_allclose(found, rotation, atol=1e-9)
    assert alignment_residual(source, target, found) < 1e-9


def test_real_never_mixes_with_imaginary():
    """Even where the points ask for it."""
    target = random_cloud(signature=np.array([1, -1.0]))
    found = signed_procrustes(SignedPoints(target.coordinates[:, ::-1], target.signs), target)
    assert found[0, 1] == found[1, 0] == 0
    np.testing.assert_allclose(np.abs(np.diag(found)), 1)


def test_distances_are_kept():
    """X C has the same bilinear form as X: that is what orthogonal within signs means."""
    target, source = random_cloud(seed=1), random_cloud(seed=2)
    turned = target.coordinates @ signed_procrustes(source, target)
    before, after = ((x * SIGNS) @ x.T for x in (target.coordinates, turned))
    np.testing.assert_allclose(after, before, atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_no_other_allowed_rotation_fits_better(seed):
    target, source = random_cloud(seed=1), random_cloud(seed=2)
    best = alignment_residual(source, target, signed_procrustes(source, target))
    assert alignment_residual(source, target, planted_rotation(SIGNS, seed)) >= best


def test_different_numbers_of_signs_give_a_partial_isometry():
    """Two real and six imaginary columns onto three and five: nothing is stretched, the excess is dropped."""
    target = random_cloud(signature=np.array([1, 1, -1, -1, -1, -1, -1, -1.0]))
    source = random_cloud(signature=np.array([1, -1, 1, -1, 1, -1, -1, -1.0]), seed=3)
    found = signed_procrustes(source, target)
    assert found.shape == (8, 8)
    assert not found[np.not_equal.outer(target.signs, source.signs)].any()
    scale = np.linalg.svd(found, compute_uv=False)
    np.testing.assert_allclose(scale, [1] * 7 + [0], atol=1e-9)


def test_sign_that_one_side_lacks_is_dropped():
    target = random_cloud(signature=np.array([1, -1.0]))
    source = random_cloud(signature=np.array([-1.0]))
    found = signed_procrustes(source, target)
    np.testing.assert_allclose(np.abs(found), [[0], [1]], atol=1e-12)


def test_null_columns_are_dropped_not_rotated():
    target = random_cloud()
    target.coordinates[:, [3, 5]] = 0
    found = signed_procrustes(target, target)
    kept = np.delete(np.arange(10), [3, 5])
    np.testing.assert_allclose(found[[3, 5]], 0, atol=1e-12)
    np.testing.assert_allclose(found[:, [3, 5]], 0, atol=1e-12)
    np.testing.assert_allclose(found[np.ix_(kept, kept)], np.eye(8), atol=1e-9)


def test_directions_that_few_points_leave_open_are_dropped():
    """Three points determine three directions of seven; the rest must not become an arbitrary rotation."""
    target = random_cloud(n=3, signature=-np.ones(7))
    found = signed_procrustes(target, target)
    np.testing.assert_allclose(np.linalg.svd(found, compute_uv=False), [1, 1, 1, 0, 0, 0, 0], atol=1e-7)
    np.testing.assert_allclose(target.coordinates @ found, target.coordinates, atol=1e-7)


@pytest.fixture
def planted():
    """A cloud that decays like descriptors, and its rows permuted and rotated."""
    target = SignedPoints(random_cloud(n=300).coordinates * DECAY, SIGNS)
    truth = np.random.default_rng(4).permutation(300)
    return (
        target,
        SignedPoints(target.coordinates[truth] @ planted_rotation(SIGNS, 5), SIGNS),
        truth,
    )


def test_icp_finds_a_planted_permutation_from_a_rough_map(planted):
    target, source, truth = planted
    rng = np.random.default_rng(6)
    rough = np.where(rng.random(300) < 0.4, rng.integers(300, size=300), truth)
    found = iterative_closest_points(source, target, rough[None], 30)[0]
    np.testing.assert_array_equal(found.target_row, truth)
    np.testing.assert_allclose(found.rotation, planted_rotation(SIGNS, 5), atol=1e-9)
    assert found.residual < 1e-9


def test_icp_never_fits_worse_after_more_steps(planted):
    target, source, _ = planted
    start = np.random.default_rng(7).integers(300, size=300)
    residuals = [
        iterative_closest_points(source, target, start[None], steps)[0].residual for steps in (0, 1, 2, 4, 8)
    ]
    assert (np.diff(residuals) <= 1e-12).all(), residuals


def test_icp_without_steps_keeps_the_map(planted):
    target, source, truth = planted
    found = iterative_closest_points(source, target, truth[None, ::-1], 0)[0]
    np.testing.assert_array_equal(found.target_row, truth[::-1])


def test_icp_moves_each_start_as_if_it_were_alone(planted):
    target, source, truth = planted
    starts = np.array([truth, truth[::-1], np.random.default_rng(9).integers(300, size=300)])
    together = iterative_closest_points(source, target, starts, 6)
    for start, found in zip(starts, together):
        alone = iterative_closest_points(source, target, start[None], 6)[0]
        np.testing.assert_array_equal(found.target_row, alone.target_row)
        np.testing.assert_array_equal(found.rotation, alone.rotation)
        assert found.residual == alone.residual
