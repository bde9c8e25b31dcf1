"""Non-rigid registration: a surface onto itself, and onto a smooth deformation of it."""

import numpy as np
import pytest

from isomatch import prepare
from isomatch.correspondence import Embedding, SampledBasis, register_nonrigid
from isomatch_lab.procedural import creature


@pytest.fixture(scope="module")
def shape():
    return prepare(creature(1500).mesh)


def registered(shape, source, target, steps):
    samples = shape.sample_vertices
    displacements = SampledBasis(shape.laplace.vectors, samples)
    return register_nonrigid(
        Embedding(source, target), shape.index, shape.index, displacements, samples, steps
    )


def test_a_surface_stays_on_itself(shape):
    points = shape.body.vertices
    moved, target = registered(shape, points, points, 3)
    np.testing.assert_allclose(moved, points, atol=1e-7)
    np.testing.assert_array_equal(target, points)


def test_no_steps_change_nothing(shape):
    points = shape.body.vertices
    np.testing.assert_array_equal(registered(shape, points, points + 0.1, 0).source, points)


def test_a_smooth_displacement_is_recovered(shape):
    """In the span of the functions, and small against the distance between limbs."""
    points = shape.body.vertices
    smooth = shape.laplace.vectors[:, 1:12] @ np.random.default_rng(0).normal(size=(11, 3))
    target = points + 0.02 * smooth / np.abs(smooth).max()
    before = np.linalg.norm(points - target, axis=1).mean()
    found = registered(shape, points, target, 8)
    nearest = shape.index.points(target, found.source)
    gap = np.linalg.norm(nearest.interpolation(len(target)) @ target - found.source, axis=1).mean()
    assert gap < 0.1 * before
    assert np.linalg.norm(found.source - target, axis=1).mean() < 0.6 * before


def test_any_space_will_do(shape):
    """The registration of more coordinates at once: rotating the space rotates the result."""
    rng = np.random.default_rng(1)
    source = np.hstack([shape.body.vertices, 0.1 * shape.laplace.vectors[:, 1:5]])
    target = source + 0.01 * shape.laplace.vectors[:, 1:4] @ rng.normal(size=(3, 7))
    rotation = np.linalg.qr(rng.normal(size=(7, 7)))[0]
    one = registered(shape, source, target, 2).source
    other = registered(shape, source @ rotation, target @ rotation, 2).source
    np.testing.assert_allclose(other, one @ rotation, atol=1e-6)
