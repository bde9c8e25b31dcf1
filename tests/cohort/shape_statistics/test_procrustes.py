"""Generalised Procrustes analysis: what it may not depend on, and what it minimises."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from corresponded import ellipsoids, moved, only, random_shapes
from isomatch._core.errors import MeshError, NotConvergedError, SettingError
from isomatch.cohort.shape_statistics import generalised_procrustes, procrustes_distances


def apart(points):
    """Distances between all vertices of a shape, which no motion changes."""
    return np.linalg.norm(points[:, None] - points, axis=-1)


@pytest.mark.parametrize("scale", ["keep", "remove"])
@pytest.mark.parametrize("seed", range(3))
def test_motions_of_the_shapes_do_not_matter(scale, seed):
    shapes = random_shapes(6, spread=0.3)
    weights = shapes.area_weights
    first = generalised_procrustes(shapes.vertices, weights, scale)
    second = generalised_procrustes(moved(shapes, seed).vertices, weights, scale)
    for before, after in zip([first.mean, *first.aligned], [second.mean, *second.aligned]):
        np.testing.assert_allclose(apart(after), apart(before), atol=1e-8)


def test_sizes_do_not_matter_where_they_are_removed():
    shapes = random_shapes(6, spread=0.3)
    first = generalised_procrustes(shapes.vertices, scale="remove")
    second = generalised_procrustes(moved(shapes, scale=True).vertices, scale="remove")
    np.testing.assert_allclose(apart(second.mean) / second.size, apart(first.mean) / first.size, atol=1e-8)
    spread = np.sqrt((second.aligned - second.aligned.mean(axis=1, keepdims=True)) ** 2).sum(axis=2)
    assert spread.shape == (6, shapes.n_vertices)
    sizes = np.sqrt(
        ((second.aligned - second.aligned.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1)
    )
    np.testing.assert_allclose(sizes, second.size)


def test_the_order_does_not_matter():
    shapes = moved(random_shapes(7, spread=0.3))
    order = [3, 0, 6, 2, 5, 1, 4]
    first = generalised_procrustes(shapes.vertices)
    second = generalised_procrustes(only(shapes, order).vertices)
    np.testing.assert_allclose(second.aligned, first.aligned[order], atol=1e-8)


def test_copies_of_one_shape_are_brought_together():
    one = random_shapes(1).vertices
    found = generalised_procrustes(moved(random_shapes(1).moved(one), 1).vertices)
    assert found.n_iterations == 1
    shapes = moved(only_copies(one[0], 5))
    aligned = generalised_procrustes(shapes.vertices).aligned
    np.testing.assert_allclose(aligned, np.broadcast_to(aligned[0], aligned.shape), atol=1e-9)


def only_copies(points, count):
    shapes = random_shapes(count)
    return shapes.moved(np.broadcast_to(points, (count, *points.shape)))


def test_no_motion_of_one_shape_brings_it_nearer_to_the_mean():
    shapes = random_shapes(5, spread=0.4)
    found = generalised_procrustes(shapes.vertices, shapes.area_weights)
    away = ((found.aligned - found.mean) ** 2).sum(axis=2) @ shapes.area_weights
    centre = shapes.area_weights @ found.mean
    for turn in Rotation.from_rotvec(1e-3 * np.vstack([np.eye(3), -np.eye(3)])).as_matrix():
        turned = (found.aligned - centre) @ turn.T + centre
        assert (((turned - found.mean) ** 2).sum(axis=2) @ shapes.area_weights > away).all()


def test_the_transforms_give_the_aligned_shapes():
    shapes = moved(random_shapes(4), scale=True)
    found = generalised_procrustes(shapes.vertices, scale="remove")
    turned = found.scales[:, None, None] * shapes.vertices @ found.rotations.transpose(0, 2, 1)
    np.testing.assert_allclose(turned + found.translations[:, None], found.aligned, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(found.rotations), 1)


def test_a_mirror_image_stays_one():
    shape = random_shapes(1, spread=0.5).vertices[0]
    found = generalised_procrustes(np.array([shape, shape * [-1, 1, 1]]))
    assert np.abs(found.aligned[0] - found.aligned[1]).max() > 0.1
    between = np.sqrt(((found.aligned[0] - found.aligned[1]) ** 2).sum(axis=1).mean())
    assert procrustes_distances(np.array([shape, shape * [-1, 1, 1]]))[0, 1] == pytest.approx(between)


def test_the_shapes_stay_about_where_they_were():
    shapes = ellipsoids([0.8, 1.0, 1.3])
    found = generalised_procrustes(shapes.vertices)
    np.testing.assert_allclose(found.aligned, shapes.vertices, atol=1e-9)


def test_distances_of_pairs_are_those_after_aligning_the_pair():
    shapes = moved(random_shapes(4, spread=0.4))
    weights = shapes.area_weights
    distances = procrustes_distances(shapes.vertices, weights)
    for i in range(4):
        for j in range(i):
            pair = generalised_procrustes(shapes.vertices[[i, j]], weights).aligned
            expected = np.sqrt(weights @ ((pair[0] - pair[1]) ** 2).sum(axis=1))
            assert distances[i, j] == pytest.approx(expected, rel=1e-9)
    np.testing.assert_array_equal(distances, distances.T)


def test_bad_input():
    shapes = random_shapes(3, spread=0.5).vertices
    with pytest.raises(SettingError, match="scale"):
        generalised_procrustes(shapes, scale="drop")
    with pytest.raises(SettingError, match="give 42 finite ones"):
        generalised_procrustes(shapes, np.ones(3))
    with pytest.raises(MeshError, match="shape 1 is a single point"):
        generalised_procrustes(shapes * np.array([1, 0, 1])[:, None, None], scale="remove")
    with pytest.raises(NotConvergedError, match="leave out outliers"):
        generalised_procrustes(shapes, most_iterations=1)
