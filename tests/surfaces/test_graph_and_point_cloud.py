"""Graphs and point clouds: what is derived from them, and what their constructors refuse."""

import numpy as np
import pytest

from isomatch import Graph, MeshError, PointCloud, SettingError, read_point_cloud, write_mesh
from isomatch._core.errors import FormatError
from shapes import icosphere
from zoo import specimen

PATH = ([[0, 1], [1, 2]], [2.0, 0.5])


def test_edges_are_sorted_and_of_equal_ones_the_shortest_is_kept():
    graph = Graph(4, [[3, 2], [1, 0], [2, 3], [0, 1]], [5, 1, 4, 2])
    assert graph.edges.tolist() == [[0, 1], [2, 3]]
    assert graph.edge_lengths.tolist() == [1, 4]
    assert graph.components.tolist() == [0, 0, 1, 1]


def test_weights_are_ones_unless_given():
    assert Graph(3, *PATH).vertex_areas.tolist() == [1, 1, 1]
    weighted = Graph(3, *PATH, weights=[1, 2, 3])
    assert weighted.area == 6.0
    assert repr(weighted) == "Graph(3 vertices, 2 edges)"


def test_nothing_of_a_graph_can_be_changed():
    given = np.array([2.0, 0.5])
    graph = Graph(3, PATH[0], given)
    given[:] = 9
    assert graph.edge_lengths.tolist() == [2.0, 0.5]
    with pytest.raises(ValueError, match="read-only"):
        graph.vertex_areas[0] = 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((3, [[0, 3], [1, 2]], [1, 1]), "edges 0 have ends outside 0…2, the vertices of the graph"),
        ((3, [[0, 1], [2, 2]], [1, 1]), "edges 1 join a vertex to itself; correct or remove them"),
        ((3, [[0, 1, 2]], [1]), r"edges have shape \(1, 3\) and type int64, expected \(e, 2\) integers"),
        ((3, [[0.5, 1]], [1]), r"type float64, expected \(e, 2\) integers"),
        ((3, PATH[0], [1]), r"lengths have shape \(1,\), expected \(2,\)"),
        ((3, PATH[0], [1, -1]), "edges 1 have lengths that are negative or not finite"),
        ((3, PATH[0], [np.inf, 1]), "edges 0 have lengths that are negative or not finite"),
        ((3, PATH[0], ["far", "near"]), "lengths have type <U4, expected real numbers"),
        ((3, *PATH, [1, 2]), r"weights have shape \(2,\), expected \(3,\)"),
        ((3, *PATH, [1, 0, 2]), "vertices 1 have weights that are not positive numbers"),
    ],
)
def test_what_is_no_graph(arguments, message):
    with pytest.raises(MeshError, match=message):
        Graph(*arguments)


def test_areas_of_points_add_up_to_the_sphere():
    for level, error in ((3, 0.02), (4, 0.006)):
        cloud = PointCloud(icosphere(level).vertices)
        assert (cloud.vertex_areas > 0).all()
        assert cloud.area == pytest.approx(4 * np.pi, rel=error)


@pytest.mark.parametrize("scale", [1e-100, 1e100])
def test_areas_scale(scale):
    points = np.random.default_rng(0).random((200, 3))
    plain, scaled = PointCloud(points), PointCloud(scale * points)
    np.testing.assert_allclose(scaled.vertex_areas, scale**2 * plain.vertex_areas, rtol=1e-9)
    assert np.array_equal(plain.edges, scaled.edges)


def test_neighbours_are_the_nearest():
    points = np.random.default_rng(0).random((200, 3))
    cloud = PointCloud(points, 5)
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    nearest = np.argsort(distances, axis=1)[:, 1:6]
    expected = {tuple(sorted((i, int(j)))) for i in range(200) for j in nearest[i]}
    assert {tuple(edge) for edge in cloud.edges.tolist()} == expected
    np.testing.assert_allclose(cloud.edge_lengths, distances[tuple(cloud.edges.T)])


def test_few_points_are_all_joined():
    cloud = PointCloud(np.vstack([np.zeros(3), np.eye(3)]))
    assert len(cloud.edges) == 6
    assert cloud.components.tolist() == [0] * 4


def test_many_coincident_points_are_not_their_own_neighbours():
    cloud = PointCloud(np.repeat(np.eye(3), 20, axis=0), 4)
    assert (cloud.edges[:, 0] < cloud.edges[:, 1]).all()


def test_points_far_apart_are_separate():
    points = icosphere(1).vertices
    cloud = PointCloud(np.vstack([points, points + 10]), 6)
    assert cloud.components.tolist() == [0] * 42 + [1] * 42


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((4, 2)), r"points have shape \(4, 2\), expected \(n, 3\)"),
        (np.eye(3), r"points have shape \(3, 3\), expected \(n, 3\) with n at least 4"),
        (np.vstack([np.eye(3), [np.nan, 0, 0]]), "points 3 have coordinates that are not finite"),
    ],
)
def test_what_is_no_point_cloud(points, message):
    with pytest.raises(MeshError, match=message):
        PointCloud(points)


def test_neighbours_must_be_some():
    with pytest.raises(SettingError, match="n_neighbours"):
        PointCloud(np.zeros((5, 3)), 0)
    assert PointCloud(np.eye(4, 3), 1).n_neighbours == 1


@pytest.mark.parametrize(
    "points", [np.zeros((40, 3)), np.outer(np.arange(50), [1, 2, 3])], ids=["place", "line"]
)
def test_points_without_an_area(points):
    with pytest.raises(MeshError, match="triangulated"):
        _ = PointCloud(points).vertex_areas


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off"])
def test_a_file_without_faces_is_read(suffix, tmp_path):
    mesh = specimen("no_faces").mesh
    write_mesh(tmp_path / f"points{suffix}", mesh)
    assert np.array_equal(read_point_cloud(tmp_path / f"points{suffix}", 2).vertices, mesh.vertices)


def test_a_file_that_is_not_there():
    with pytest.raises(FormatError, match="no such file"):
        read_point_cloud("nowhere.ply")
