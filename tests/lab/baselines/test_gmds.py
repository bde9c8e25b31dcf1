"""Generalised multidimensional scaling: laws of the descent, and how near the samples come to the truth."""

import numpy as np
import pytest
from poses import landmarks_of, two_poses

from data import tosca
from isomatch import Outcome, PointCloud, SettingError, geodesic_distances, prepare
from isomatch.matching import prepare_pair
from isomatch_lab.baselines import GmdsConfig, gmds
from isomatch_lab.baselines.gmds import Placement, descend_stress, place_points, placement, relative_stress
from isomatch_lab.baselines.task import Task
from shapes import disguised

CONFIG = GmdsConfig()


def sample_errors(source, target, points, truth):
    """Distance of each place from the true one / √(target area)."""
    true = truth[source.user_vertex[points.vertices]]
    columns = geodesic_distances(target.surface, true)[
        np.arange(len(true))[:, None], target.user_vertex[points.corners]
    ]
    return (columns * points.barycentric).sum(axis=1) / np.sqrt(target.surface.area)


@pytest.fixture(scope="module")
def poses():
    return two_poses()


@pytest.fixture(scope="module")
def copies(poses):
    other = disguised(poses[0].surface, seed=2)
    return poses[0], prepare(other.mesh), other.new_vertex


@pytest.fixture(scope="module")
def scattered(poses):
    """Samples placed on vertices drawn blindly."""
    rows = poses[0].column_vertices[:30]
    images = np.random.default_rng(0).integers(poses[1].body.n_vertices, size=len(rows))
    return Placement.at_vertices(np.column_stack([rows, images]))


def test_stress_is_that_of_the_definition(poses, scattered):
    """Over marched distances of the points, which the bases approximate."""
    source, target, _ = poses
    there = geodesic_distances(target.body, scattered.corners[:, 0])[:, scattered.corners[:, 0]]
    here = geodesic_distances(source.body, scattered.vertices)[:, scattered.vertices]
    here, there = here / source.intrinsic_scale, there / target.intrinsic_scale
    expected = np.linalg.norm(there - here) / np.linalg.norm(here)
    assert relative_stress(prepare_pair(source, target), scattered) == pytest.approx(expected, rel=0.02)


@pytest.mark.long
def test_from_a_bad_start_stress_falls_and_points_stay_on_triangles_of_the_target(poses, scattered):
    points, stresses = descend_stress(prepare_pair(*poses[:2]), scattered, 0, 20)
    assert (np.diff(stresses) <= 0).all()
    assert stresses[-1] < 0.7 * stresses[0]
    assert points.barycentric.min() >= 0
    np.testing.assert_allclose(points.barycentric.sum(axis=1), 1)
    inside = points.barycentric.min(axis=1) > 0
    assert inside.any()
    triangles = {tuple(sorted(face)) for face in poses[1].faces.tolist()}
    assert {tuple(sorted(face)) for face in points.corners[inside].tolist()} <= triangles
    assert (points.corners[:, 0] != scattered.corners[:, 0]).any()


@pytest.mark.long
def test_held_points_do_not_move(poses, scattered):
    points, _ = descend_stress(prepare_pair(*poses[:2]), scattered, 7, 3)
    np.testing.assert_array_equal(points.corners[:7], scattered.corners[:7])
    np.testing.assert_array_equal(points.barycentric[:7], scattered.barycentric[:7])
    assert (points.corners[7:] != scattered.corners[7:]).any()


@pytest.mark.long
def test_no_place_nearby_is_better(poses):
    """At the end no point gains by a small step to a corner of a triangle around it."""
    source, target, truth = poses
    pair = prepare_pair(source, target)
    task = Task.of(source, target, landmarks_of(source, truth), None, None, 0)
    points, _, _ = placement(task, GmdsConfig(levels=(20,)))
    for _ in range(100):
        points, stresses = descend_stress(pair, points, 5, 1)
    for i in range(5, len(points.vertices), 4):
        for corner in points.corners[i]:
            corners, weights = points.corners.copy(), points.barycentric.copy()
            step = 0.99 * weights[i] + 0.01 * (corners[i] == corner)
            weights[i] = step / step.sum()
            moved = Placement(points.vertices, corners, weights)
            assert relative_stress(pair, moved) >= stresses[-1] * (1 - 1e-7)


def test_a_copy_has_no_stress(copies):
    source, target, truth = copies
    task = Task.of(source, target, landmarks_of(source, truth), None, None, 0)
    points, stresses, _ = placement(task, CONFIG)
    assert stresses[-1] < 1e-4
    assert sample_errors(source, target, points, truth).max() < 1e-3
    assert len(points.vertices) == 100


@pytest.mark.long
def test_without_priors_a_copy_is_recognised(copies):
    source, target, truth = copies
    found = gmds(source, target)
    assert (found.map.vertices == truth).mean() > 0.95
    assert found.notes[-1].startswith("relative stress of 100 points: 0.000")


@pytest.mark.long
def test_samples_of_another_pose(poses):
    source, target, truth = poses
    priors = {"landmarks": landmarks_of(source, truth), "initial_map": truth}
    for given in ({}, *({name: prior} for name, prior in priors.items())):
        task = Task.of(source, target, given.get("landmarks"), given.get("initial_map"), None, 0)
        points, _, _ = placement(task, CONFIG)
        assert sample_errors(source, target, points, truth).mean() < 0.035


def test_landmarks_are_honoured(poses):
    source, target, truth = poses
    landmarks = landmarks_of(source, truth)
    task = Task.of(source, target, landmarks, None, None, 0)
    points, _, _ = placement(task, CONFIG)
    np.testing.assert_array_equal(target.user_vertex[points.corners[:5, 0]], landmarks[:, 1])
    assert len(np.unique(points.vertices)) == len(points.vertices)


@pytest.mark.long
def test_the_truth_has_more_stress(poses):
    """Poses are not quite isometric: the least stress is below that of the true map, whatever the start."""
    source, target, truth = poses
    pair = prepare_pair(source, target)
    for landmarks in (None, landmarks_of(source, truth)):
        points, stresses, _ = placement(Task.of(source, target, landmarks, None, None, 0), CONFIG)
        true = np.column_stack(
            [points.vertices, target.body_vertex[truth[source.user_vertex[points.vertices]]]]
        )
        assert stresses[-1] < relative_stress(pair, Placement.at_vertices(true))


def test_points_are_placed_by_distances_to_others(copies):
    source, target, truth = copies
    images = target.body_vertex[truth[source.user_vertex[source.column_vertices]]]
    anchors = Placement.at_vertices(np.column_stack([source.column_vertices, images]))
    vertices = np.arange(0, source.body.n_vertices, 50)
    found = place_points(prepare_pair(source, target), vertices, anchors)
    nearest = target.user_vertex[found.corners[np.arange(len(vertices)), found.barycentric.argmax(axis=1)]]
    np.testing.assert_array_equal(nearest, truth[source.user_vertex[vertices]])


def test_descriptors_can_start(copies):
    source, target, truth = copies
    values = np.sin(3 * target.surface.vertices @ np.random.default_rng(0).normal(size=(3, 30)))
    found = gmds(source, target, initial_descriptors=(values[truth], values))
    assert found.origin == "descriptors"
    assert (found.map.vertices == truth).mean() > 0.95


@pytest.mark.long
def test_points_go_to_triangles_only(poses):
    source, target, truth = poses
    cloud = PointCloud(source.surface.vertices)
    found = gmds(cloud, target, initial_map=truth)
    assert found.outcome is not Outcome.PARTIAL
    with pytest.raises(SettingError, match="target"):
        gmds(source, cloud, initial_map=np.arange(len(truth)))


@pytest.mark.long
def test_wolf_with_five_landmarks():
    other = disguised(tosca("wolf1"), seed=1)
    source, target = prepare(tosca("wolf0")), prepare(other.mesh)
    task = Task.of(source, target, landmarks_of(source, other.new_vertex), None, None, 0)
    points, _, _ = placement(task, CONFIG)
    assert sample_errors(source, target, points, other.new_vertex).mean() < 0.02
