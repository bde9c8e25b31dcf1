"""A map as a matrix between Laplace–Beltrami functions."""

import numpy as np
import pytest

from isomatch import Correspondence, MapError, laplace_basis
from isomatch_lab.sets import relabelled
from shapes import icosphere, planar_delaunay


@pytest.fixture(scope="module")
def square():
    return planar_delaunay(600, 3)


def test_of_the_identity_is_the_identity(square):
    same = Correspondence(np.arange(600), 600, None, None, square.content_hash, square.content_hash)
    np.testing.assert_allclose(same.to_functional(square, square, 20).matrix, np.eye(20), atol=1e-8)


def test_of_a_relabelling_is_orthogonal_and_pulls_functions_back(square):
    copy, new = relabelled(square, 4)
    found = Correspondence(new, 600).to_functional(laplace_basis(square, 30), copy, 30)
    np.testing.assert_allclose(found.matrix @ found.matrix.T, np.eye(30), atol=1e-6)
    smooth = copy.vertices @ [1.0, 2.0, 0.0] * 1e-1
    smooth = found.target.low_passed(smooth[:, None], 30)
    np.testing.assert_allclose(found.pull_back(smooth), smooth[new], atol=1e-6)


def test_unmatched_vertices_do_not_count(square):
    image = np.where(np.random.default_rng(0).random(600) < 0.3, -1, np.arange(600))
    np.testing.assert_allclose(
        Correspondence(image, 600).to_functional(square, square, 15).matrix, np.eye(15), atol=1e-8
    )


def test_constants_stay_constant():
    coarse, fine = icosphere(2), icosphere(3)
    nearest = ((coarse.vertices[:, None] - fine.vertices) ** 2).sum(axis=2).argmin(axis=1)
    found = Correspondence(nearest, fine.n_vertices).to_functional(coarse, fine, 16)
    np.testing.assert_allclose(found.pull_back(np.ones((fine.n_vertices, 1))), 1.0, atol=1e-6)


def test_other_surfaces_and_bases_are_refused(square):
    f = Correspondence(np.arange(600), 600)
    with pytest.raises(MapError, match="functions"):
        f.to_functional(square, laplace_basis(square, 10), 20)
    with pytest.raises(MapError, match="source"):
        f.to_functional(icosphere(2), square, 20)
