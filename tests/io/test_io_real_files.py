"""Files of real shapes, against the same shapes as arrays."""

import numpy as np
import pytest

from isomatch.io import read_mesh
from isomatch.repair import check


@pytest.mark.parametrize(
    ("file", "archive", "vertices"),
    [
        ("off/cat0.off", "tosca/cat.npz", "cat0"),
        ("off/tr_reg_000.ply", "faust_r/tr_reg_000.npz", "vertices"),
        ("off/tr_reg_001.obj", "faust_r/tr_reg_001.npz", "vertices"),
    ],
)
def test_vertex_order_of_real_files(shared_data, file, archive, vertices):
    mesh = read_mesh(shared_data(file))
    with np.load(shared_data(archive), allow_pickle=False) as truth:
        np.testing.assert_allclose(mesh.vertices, truth[vertices], rtol=1e-5, atol=1e-5)
        np.testing.assert_array_equal(mesh.faces, truth["faces"])
    assert check(mesh).fatal == ()
