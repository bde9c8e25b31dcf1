"""Poses in space: similarities are undone exactly, and the pose does not matter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isomatch.correspondence import carry_along, nearest_rotation, poses_between


@pytest.fixture
def surface():
    """Points and normals (300, 6) of an ellipsoid with a dent, so that no motion but the identity keeps it."""
    rng = np.random.default_rng(4)
    normals = rng.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    dent = np.exp(-5 * (1 - normals @ [0.6, 0.48, 0.64]))
    return np.hstack([normals * [1.3, 1.0, 0.8] * (1 - 0.4 * dent)[:, None], 0.1 * normals])


def moved(surface, turn, scale=1.0, shift=0.0):
    return np.hstack([scale * surface[:, :3] @ turn + shift, surface[:, 3:] @ turn])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_similarity_is_found(surface, seed, mirrored):
    turn = Rotation.random(random_state=seed).as_matrix() * ([1, 1, -1] if mirrored else 1)
    order = np.random.default_rng(seed).permutation(len(surface))
    target = moved(surface, turn, 3.0, [1.0, -7.0, 2.0])[order]
    best, *others = poses_between(surface, target, mirrored)
    np.testing.assert_allclose(best.rotation, turn, atol=1e-8)
    np.testing.assert_allclose((best.scale, *best.shift), (3.0, 1.0, -7.0, 2.0), atol=1e-7)
    np.testing.assert_array_equal(order[best.nearest], np.arange(len(surface)))
    assert best.distance < 1e-8
    assert all(pose.distance > 0.05 for pose in others)


def test_axes_of_equal_length_are_exchanged(surface):
    ball = surface.copy()
    ball[:, :3] /= [1.3, 1.0, 0.8]
    turn = Rotation.from_euler("z", 80, degrees=True).as_matrix()
    assert poses_between(ball, moved(ball, turn))[0].distance < 0.02


def test_no_rotation_does_what_a_mirror_image_does(surface):
    target = moved(surface, np.diag([1.0, 1.0, -1.0]))
    assert poses_between(surface, target, mirrored=True)[0].distance < 1e-8
    assert poses_between(surface, target)[0].distance > 0.05


def test_distance_counts_both_ways(surface):
    half = surface[surface[:, 0] > 0]
    onto_whole, onto_half = poses_between(half, surface)[0], poses_between(surface, half)[0]
    assert min(onto_whole.distance, onto_half.distance) > 0.05


def test_points_are_carried_along_by_motions_and_by_what_is_nearest():
    random = np.random.default_rng(0)
    points, beside = random.standard_normal((50, 3)), random.standard_normal((20, 3))
    turn = nearest_rotation(random.standard_normal((3, 3)), mirrored=True)
    moved = carry_along(beside, points, 1.5 * points @ turn + 2, scale=1.5, mirrored=True)
    np.testing.assert_allclose(moved, 1.5 * beside @ turn + 2, atol=1e-9)
    far = np.add(points, [100, 0, 0])  # a second part, which moves another way
    both = carry_along(
        far, np.concatenate([points, far]), np.concatenate([points, far @ turn]), mirrored=True
    )
    np.testing.assert_allclose(both, far @ turn, atol=1e-3)
