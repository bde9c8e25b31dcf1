"""Shapes without triangles go through the same door."""

import json

import numpy as np
import pytest

from isomatch import Graph, Mesh, MeshError, PointCloud, match, prepare
from isomatch.evaluation import geodesic_errors
from isomatch_lab.procedural import creature

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def mesh():
    return creature(2500, pose=3).mesh


@pytest.fixture(scope="module")
def new(mesh):
    """New number of each vertex."""
    return np.random.default_rng(0).permutation(mesh.n_vertices)


@pytest.fixture(scope="module")
def truth(new):
    return np.column_stack([np.arange(len(new)), new])


@pytest.fixture(scope="module")
def relabelled(mesh, new):
    vertices = np.empty_like(mesh.vertices)
    vertices[new] = mesh.vertices
    return Mesh(vertices, new[mesh.faces])


@pytest.fixture(scope="module")
def cloud(relabelled):
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    return PointCloud(7.0 * relabelled.vertices @ turn)


@pytest.fixture(scope="module")
def graph(relabelled):
    return Graph(relabelled.n_vertices, relabelled.edges, 0.1 * relabelled.edge_lengths)


@pytest.mark.long
def test_a_mesh_finds_itself_in_its_own_points(mesh, cloud, relabelled, truth):
    found = match(mesh, cloud)
    assert 100 * geodesic_errors(relabelled, found.map, truth).mean() < 0.5
    assert found.engine == "fast_marching"
    assert np.isnan(found.quality.orientation), "points have no outside"
    assert found.quality.stretch == pytest.approx(1.0, abs=0.1)


@pytest.mark.long
def test_points_find_themselves_in_their_mesh(cloud, relabelled):
    found = match(cloud, relabelled)
    same = np.column_stack([np.arange(cloud.n_vertices)] * 2)
    assert 100 * geodesic_errors(relabelled, found.map, same).mean() < 0.5
    assert found.engine == "dijkstra"


@pytest.mark.long
def test_a_mesh_finds_itself_in_the_graph_of_its_edges(mesh, graph, relabelled, truth):
    found = match(mesh, graph)
    assert 100 * geodesic_errors(relabelled, found.map, truth).mean() < 1.0
    assert found.quality.distortion_mean < 0.05, "lengths are compared in units of the average distance"
    summary = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert summary["quality"]["stretch"] is None
    assert summary["quality"]["orientation"] is None


@pytest.mark.long
def test_relabelled_graphs_match_exactly(mesh, graph, truth):
    found = match(Graph(mesh.n_vertices, mesh.edges, mesh.edge_lengths), graph)
    np.testing.assert_array_equal(found.map.vertices, truth[:, 1])


@pytest.mark.long
def test_the_smaller_part_of_a_graph_is_left_unmatched(graph):
    n = graph.n_vertices
    edges = np.vstack([graph.edges, [[n, n + 1], [n + 1, n + 2]]])
    whole = Graph(n + 3, edges, np.append(graph.edge_lengths, [1.0, 1.0]))
    found = match(whole, graph)
    assert (found.map.vertices[n:] == -1).all()
    assert (found.map.vertices[:n] >= 0).all()
    assert any("smaller component" in note for note in found.notes)


def test_too_few_points_are_refused():
    points = PointCloud(np.random.default_rng(0).normal(size=(20, 3)))
    with pytest.raises(MeshError, match="component"):
        match(prepare(creature(1500).mesh), points)


def test_what_is_no_shape_is_refused():
    with pytest.raises(MeshError, match="PointCloud"):
        prepare(np.zeros((10, 3)))
