"""Gromov–Wasserstein transport: laws of the plan, what its features do, and the missing package."""

import sys

import numpy as np
import pytest
from poses import error, landmarks_of, two_poses

from isomatch import Graph, MissingDependencyError, geodesic_distances, prepare
from isomatch_lab.baselines import GromovWassersteinConfig, gromov_wasserstein
from isomatch_lab.baselines.gromov_wasserstein import transport
from isomatch_lab.baselines.task import Task
from shapes import disguised

CONFIG = GromovWassersteinConfig(n_samples=200)


@pytest.fixture(scope="module")
def poses():
    return two_poses()


def solved(source, target, config=CONFIG):
    task = Task.of(source, target, None, None, None, 0)
    return transport(task, task.pair.signatures, config)


@pytest.mark.long
def test_marginals_are_the_areas_around_the_samples(poses):
    found, body = solved(*poses[:2]), poses[0].body
    owner = geodesic_distances(body, found.rows[0], engine="dijkstra").argmin(axis=0)
    np.testing.assert_allclose(found.areas[0], np.bincount(owner, body.vertex_areas) / body.area, rtol=1e-6)
    assert found.plan.shape == (200, 200)
    assert found.plan.min() >= 0
    for axis, areas in zip((1, 0), found.areas):
        np.testing.assert_allclose(found.plan.sum(axis=axis), areas, atol=1e-9)
        assert areas.min() > 0
        assert areas.sum() == pytest.approx(1)


def test_a_copy_stays_where_it_is(poses):
    """Signatures and distances agree on the identity: the plan is diagonal."""
    found = solved(poses[0], poses[0])
    np.testing.assert_allclose(found.plan, np.diag(found.areas[0]), atol=1e-9)


def test_transport_of_reversed_roles_is_as_good(poses):
    """The cost is symmetric in the shapes; the solver need not find the same plan."""
    source, target, truth = poses
    found = gromov_wasserstein(target, source, landmarks_of(source, truth)[:, ::-1], config=CONFIG)
    assert error(found.map.vertices, np.argsort(truth), source.surface) < 0.02


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
    assert error(found.map.vertices, truth, target.surface) < 0.02


@pytest.mark.long
def test_graphs_are_matched(poses):
    mesh = poses[0].surface
    graph = Graph(mesh.n_vertices, mesh.edges, mesh.edge_lengths)
    found = gromov_wasserstein(graph, graph, initial_map=np.arange(mesh.n_vertices), config=CONFIG)
    assert (found.map.vertices == np.arange(mesh.n_vertices)).mean() > 0.95


def test_without_the_package_the_error_says_what_to_install(poses, monkeypatch):
    monkeypatch.setitem(sys.modules, "ot.gromov", None)
    with pytest.raises(MissingDependencyError, match="transport"):
        gromov_wasserstein(*poses[:2])
