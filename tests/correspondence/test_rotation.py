"""The nearest rotation: planted ones are found, mirror images where asked for, and no other is nearer."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import special_ortho_group

from isomatch.correspondence import nearest_rotation


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("d", [2, 3, 7])
def test_a_planted_rotation_is_found(d, mirrored):
    planted = special_ortho_group.rvs(d, random_state=d)
    planted[:, 0] *= -1 if mirrored else 1
    points = np.random.default_rng(d).standard_normal((20, d))
    np.testing.assert_allclose(nearest_rotation(points.T @ (points @ planted), mirrored), planted, atol=1e-12)


def test_no_rotation_is_nearer():
    matrices = np.random.default_rng(1).standard_normal((50, 4, 3, 3))
    for mirrored, side in ((False, 1.0), (True, -1.0)):
        found = nearest_rotation(matrices, mirrored)
        np.testing.assert_allclose(np.linalg.det(found), side)
        kept = np.einsum("...ij,...ij", found, matrices)
        for other in Rotation.random(100, rng=np.random.default_rng(2)).as_matrix():
            assert (kept >= np.einsum("ij,...ij", side * other, matrices)).all()


def test_matrices_of_a_stack_and_transposed_ones_do_not_matter():
    matrices = np.random.default_rng(3).standard_normal((200, 3, 3))
    found = nearest_rotation(matrices)
    np.testing.assert_array_equal(found, [nearest_rotation(matrix) for matrix in matrices])
    np.testing.assert_allclose(nearest_rotation(matrices.swapaxes(1, 2)), found.swapaxes(1, 2), atol=1e-11)
