"""Alignments from points and functions: against the same least squares solved plainly, one column at a time."""

import numpy as np
import pytest

from isomatch.correspondence import (
    SignedPoints,
    alignment_from_functions,
    alignments_from_points,
    nearest_under_rotation,
)


def cloud(seed, n=60, k=30):
    rng = np.random.default_rng(seed)
    signature = np.where(rng.random(k) < 0.2, 1.0, -1.0)
    signature[0] = 1
    return SignedPoints(rng.normal(size=(n, k)) / (1 + np.arange(k)), signature)


def solved_plainly(y, x, y_signs, x_signs, s):
    """Each column of C on its own: least squares with the penalties as further rows."""
    k = y.shape[1]
    rotation = np.zeros((k, k))
    for j in range(k):
        rows = np.flatnonzero(y_signs[:k] == x_signs[j])
        penalty = np.sqrt(s * (0.01 * (rows - j) ** 2 + 0.001))
        system = np.vstack([y[:, rows], np.diag(penalty)])
        right = np.concatenate([x[:, j], np.zeros(len(rows))])
        rotation[rows, j] = np.linalg.lstsq(system, right, rcond=None)[0]
    return rotation


def test_landmarks_solve_the_penalised_least_squares():
    target, source = cloud(0), cloud(1)
    at_target, at_source = np.array([[1, 5, 9, 20, 33], [2, 3, 4, 5, 6]]), np.array([[7, 2, 0, 11, 40]] * 2)
    found = alignments_from_points(source, target, at_source, at_target)
    assert found.shape == (2, 20, 20)
    s = (target.coordinates[:, :20] ** 2).sum(axis=1).mean()
    for h in range(2):
        expected = solved_plainly(
            target.coordinates[at_target[h], :20],
            source.coordinates[at_source[h], :20],
            target.signs,
            source.signs,
            s,
        )
        np.testing.assert_allclose(found[h], expected, atol=1e-9)


def test_signs_of_columns_are_recovered_from_five_points():
    """The whole use of landmarks: eigenvectors come with either sign."""
    target = cloud(4)
    flips = np.random.default_rng(4).choice([-1.0, 1.0], 30)
    source = SignedPoints(target.coordinates * flips, target.signs)
    points = np.arange(5)[None]
    found = alignments_from_points(source, target, points, points)[0]
    np.testing.assert_array_equal(np.sign(np.diag(found))[:8], flips[:8])
    image = nearest_under_rotation(source, target, found)
    np.testing.assert_array_equal(image[:5], np.arange(5))
    assert (image == np.arange(60)).mean() > 0.8


def test_functions_solve_the_same_problem_in_coefficients():
    target, source = cloud(5), cloud(6, n=70)
    rng = np.random.default_rng(5)
    f_target, f_source = rng.normal(size=(60, 8)), rng.normal(size=(70, 8))
    a_target, a_source = rng.random(60), rng.random(70)
    found = alignment_from_functions(source, target, f_source, f_target, a_source, a_target)
    y, x = (
        (f_target * a_target[:, None]).T @ target.coordinates,
        (f_source * a_source[:, None]).T @ source.coordinates,
    )
    s = (y[:, :20] ** 2).sum(axis=1).mean()
    expected = solved_plainly(y[:, :20], x[:, :20], target.signs, source.signs, s)
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("k", [4, 12])
def test_fewer_columns_than_twenty(k):
    target = cloud(7, k=k)
    points = np.arange(6)[None]
    assert alignments_from_points(target, target, points, points).shape == (1, k, k)
