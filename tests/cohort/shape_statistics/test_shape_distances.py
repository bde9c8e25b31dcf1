"""Distances between shapes: invariance, closed forms, trees and maps of them."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from corresponded import ellipsoids, moved, only, random_shapes
from isomatch import geodesic_distances
from isomatch._core.errors import InputError, SettingError
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    classical_scaling,
    geodesic_distortions,
    procrustes_distances,
    shape_tree,
)
from isomatch_lab.procedural import creature


def test_size_place_and_order_do_not_matter():
    shapes = random_shapes(4, spread=0.3)
    distances = geodesic_distortions(shapes, n_samples=20)
    np.testing.assert_allclose(
        geodesic_distortions(moved(shapes, scale=True), n_samples=20), distances, atol=1e-6
    )
    order = [2, 0, 3, 1]
    reordered = geodesic_distortions(only(shapes, order), n_samples=20)
    np.testing.assert_allclose(reordered, distances[np.ix_(order, order)], atol=1e-9)
    np.testing.assert_array_equal(distances, distances.T)
    assert (distances[~np.eye(4, dtype=bool)] > 0.01).all()


def test_scaled_copies_are_alike():
    shapes = moved(ellipsoids([1.0, 1.0, 1.0]), scale=True)
    assert geodesic_distortions(shapes).max() < 1e-6


def test_the_distance_is_what_it_says():
    shapes = ellipsoids([0.8, 1.0, 1.3])
    every = geodesic_distortions(shapes, n_samples=10**6, engine="dijkstra")
    matrices = []
    for i in range(3):
        mesh = shapes.mesh(i)
        matrices.append(geodesic_distances(mesh, np.arange(mesh.n_vertices), "dijkstra") / np.sqrt(mesh.area))
    for i in range(3):
        for j in range(3):
            assert every[i, j] == pytest.approx(np.sqrt(((matrices[i] - matrices[j]) ** 2).mean()), abs=1e-12)
    assert every[0, 2] > every[0, 1]


@pytest.mark.long
def test_a_pose_changes_them_less_than_another_animal():
    standing, moving = (creature(1500, pose=pose).mesh for pose in (0, 3))
    bodies = [standing.vertices, moving.vertices, standing.vertices * [1.0, 1.5, 1.0]]
    shapes = CorrespondedShapes(("standing", "moving", "stretched"), np.array(bodies), standing.faces)
    distances = geodesic_distortions(shapes)
    assert distances[0, 1] < distances[0, 2] / 2
    straight = procrustes_distances(shapes.vertices, scale="remove")
    assert distances[0, 1] / distances[0, 2] < straight[0, 1] / straight[0, 2]


def test_components_do_not_matter():
    shapes = ellipsoids([1.0, 1.2])
    n = shapes.n_vertices
    pairs = np.concatenate([shapes.vertices, shapes.vertices + np.array([20, 0, 0])], axis=1)
    both = CorrespondedShapes(shapes.names, pairs, np.vstack([shapes.faces, shapes.faces + n]))
    distances = geodesic_distortions(both)
    assert np.isfinite(distances).all()
    assert distances[0, 1] > 0


def test_a_map_of_points_is_found_again():
    points = np.random.default_rng(0).normal(size=(12, 3))
    distances = cdist(points, points)
    found = classical_scaling(distances, 3)
    np.testing.assert_allclose(cdist(found, found), distances, atol=1e-9)
    assert classical_scaling(distances, 15)[:, 3:].max() < 1e-6
    np.testing.assert_array_equal(classical_scaling(np.zeros((3, 3))), 0)
    assert classical_scaling([[0.0]]).tolist() == [[0.0, 0.0]]


def test_the_tree_merges_the_nearest_first():
    line = np.array([0.0, 1.0, 10.0, 10.5])
    tree = shape_tree(np.abs(line[:, None] - line))
    assert tree[0, :2].tolist() == [2, 3]
    assert tree[:, 2].tolist() == [0.5, 1.0, 9.75]


def test_bad_input():
    with pytest.raises(SettingError, match="n_samples = 0"):
        geodesic_distortions(ellipsoids([1.0]), n_samples=0)
    with pytest.raises(InputError, match="give a square matrix"):
        classical_scaling([[0, 1]])
    with pytest.raises(InputError, match="not symmetric"):
        classical_scaling([[0, 1], [2, 0]])
    with pytest.raises(InputError, match="at least two shapes"):
        shape_tree([[0]])
