"""Gromov–Wasserstein transport: laws of the plan, what its features do, and the missing package."""

import sys

import numpy as np
import pytest

from isomatch import Graph, MissingDependencyError, geodesic_distances, prepare
from isomatch.datasets import ground_truth
from isomatch_lab.baselines import GromovWassersteinConfig, gromov_wasserstein
from isomatch_lab.baselines.gromov_wasserstein import transport
from isomatch_lab.baselines.task import Task
from isomatch_lab.procedural import creature
from shapes import disguised

CONFIG = GromovWassersteinConfig(n_samples=200)


def landmarks_of(shape, truth):
    vertices = shape.user_vertex[shape.column_vertices[:5]]
    return np.column_stack([vertices, truth[vertices]])


def error(image, truth, target):
    """Mean distance on the target between images and truths / √(target area), at some vertices."""
    rows = np.arange(0, len(truth), 20)
    apart = geodesic_distances(target.surface, truth[rows])[np.arange(len(rows)), image[rows]]
    return apart.mean() / np.sqrt(target.surface.area)


@pytest.fixture(scope="module")
def poses():
    """A creature and another pose of it in disguise, prepared, and the truth between them."""
    source, target = creature(1500), creature(1500, pose=1)
    other = disguised(target.mesh, seed=1)
    return prepare(source.mesh), prepare(other.mesh), other.new_vertex[ground_truth(source, target).vertices]


def solved(source, target, config=CONFIG):
    task = Task.of(source, target, None, None, None, 0)
    return transport(task, task.pair.signatures, config)


@pytest.mark.long
def test_marginals_are_areas(poses):
    found = solved(*poses[:2])
    assert found.plan.shape == (200, 200)
    assert found.plan.min() >= 0
    for axis, areas in zip((1, 0), found.areas):
        np.testing.assert_allclose(found.plan.sum(axis=axis), areas, atol=1e-9)
        assert areas.min() > 0
        assert areas.sum() == pytest.approx(1)


def test_areas_are_those_around_the_samples(poses):
    shape = poses[0]
    found = solved(*poses[:2])
    owner = geodesic_distances(shape.body, found.rows[0], engine="dijkstra").argmin(axis=0)
    expected = np.bincount(owner, shape.body.vertex_areas)
    np.testing.assert_allclose(found.areas[0], expected / expected.sum(), rtol=1e-6)


def test_a_copy_stays_where_it_is(poses):
    """Signatures and distances agree on the identity: the plan is diagonal."""
    found = solved(poses[0], poses[0])
    np.testing.assert_allclose(found.plan, np.diag(found.areas[0]), atol=1e-9)


def test_transport_of_reversed_roles_is_as_good(poses):
    """The cost is symmetric in the shapes; the solver need not find the same plan."""
    source, target, truth = poses
    found = gromov_wasserstein(target, source, landmarks_of(source, truth)[:, ::-1], config=CONFIG)
    assert error(found.map.vertices, np.argsort(truth), source) < 0.02


def test_another_pose_with_landmarks(poses):
    source, target, truth = poses
    found = gromov_wasserstein(source, target, landmarks_of(source, truth), config=CONFIG)
    assert error(found.map.vertices, truth, target) < 0.02
    assert found.origin == "landmarks"
    assert found.quality.landmark_error < 0.05


def test_relabelling_and_motion_change_nothing(poses):
    source, target, truth = poses
    moved = disguised(target.surface, seed=5)
    landmarks = landmarks_of(source, truth)
    plain = gromov_wasserstein(source, target, landmarks, config=CONFIG)
    landmarks[:, 1] = moved.new_vertex[landmarks[:, 1]]
    other = gromov_wasserstein(source, prepare(moved.mesh), landmarks, config=CONFIG)
    assert (other.map.vertices == moved.new_vertex[plain.map.vertices]).mean() > 0.98


def test_features_are_descriptors_where_given(poses):
    source, target, truth = poses
    values = source.surface.vertices
    given = values, values[np.argsort(truth)]
    found = gromov_wasserstein(source, target, initial_descriptors=given, config=CONFIG)
    assert found.origin == "descriptors"
    assert error(found.map.vertices, truth, target) < 0.02


@pytest.mark.long
def test_graphs_are_matched(poses):
    mesh = poses[0].surface
    edges = np.unique(np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    lengths = np.linalg.norm(np.subtract(*mesh.vertices[edges.T]), axis=1)
    graph = Graph(mesh.n_vertices, edges, lengths)
    found = gromov_wasserstein(graph, graph, initial_map=np.arange(mesh.n_vertices), config=CONFIG)
    assert (found.map.vertices == np.arange(mesh.n_vertices)).mean() > 0.95


def test_without_the_package_the_error_says_what_to_install(poses, monkeypatch):
    monkeypatch.setitem(sys.modules, "ot.gromov", None)
    with pytest.raises(MissingDependencyError, match="transport"):
        gromov_wasserstein(*poses[:2])
