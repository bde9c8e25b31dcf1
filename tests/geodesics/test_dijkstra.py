"""Shortest paths: graphs and point clouds against closed forms, and their sampling."""

import numpy as np
import pytest

from isomatch import Graph, Mesh, MeshError, PointCloud, farthest_point_sampling, geodesic_distances
from isomatch.geodesics import distance_along_edges_to_nearest, distance_engine, peripheral_vertex
from shapes import flat_grid


def lattice(rows, columns):
    """A grid graph without diagonals, on which distances are taxicab distances."""
    sheet = flat_grid(rows, columns)
    straight = sheet.edge_lengths < 1.2
    return Graph(sheet.n_vertices, sheet.edges[straight], sheet.edge_lengths[straight])


def random_sphere(n, seed=0):
    points = np.random.default_rng(seed).normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def test_taxicab_distances():
    y, x = np.divmod(np.arange(42), 7)
    expected = np.abs(y - 2) + np.abs(x - 3)
    assert np.array_equal(geodesic_distances(lattice(6, 7), [17])[0], expected)


def test_ring_and_a_shortcut():
    n = 12
    ring = np.column_stack([np.arange(n), (np.arange(n) + 1) % n])
    steps = np.minimum(np.arange(n), n - np.arange(n))
    assert np.array_equal(geodesic_distances(Graph(n, ring, np.ones(n)), [0])[0], steps)
    shortcut = Graph(n, np.vstack([ring, [[6, 0]]]), np.append(np.ones(n), 0.0))
    assert np.array_equal(geodesic_distances(shortcut, [0])[0], np.minimum(steps, 6 - steps))


def test_other_components_and_isolated_vertices_are_infinitely_far():
    graph = Graph(5, [[0, 1], [2, 3]], [1, 2])
    inf = np.inf
    expected = [[0, 1, inf, inf, inf], [inf, inf, inf, inf, 0]]
    assert geodesic_distances(graph, [0, 4]).tolist() == expected
    assert geodesic_distances(Graph(2, [], []), [1]).tolist() == [[inf, 0]]


@pytest.mark.parametrize(("n_neighbours", "error"), [(12, 0.04), (20, 0.015), (30, 0.007), (50, 0.003)])
def test_points_of_a_sphere_as_documented(n_neighbours, error):
    points = random_sphere(4000)
    computed = geodesic_distances(PointCloud(points, n_neighbours), range(5))
    great = np.arccos(np.clip(points[:5] @ points.T, -1, 1))
    far = great > 0.3
    relative = computed[far] / great[far] - 1
    assert np.abs(relative).mean() < error


def test_relabelling_points_relabels_distances_and_samples():
    points = random_sphere(600) * [1, 1, 3]
    old = np.random.default_rng(1).permutation(600)
    new = np.argsort(old)
    clouds = PointCloud(points), PointCloud(points[old])
    plain = geodesic_distances(clouds[0], [4, 9])
    np.testing.assert_allclose(geodesic_distances(clouds[1], new[[4, 9]])[:, new], plain)
    engines = [distance_engine(cloud) for cloud in clouds]
    starts = [peripheral_vertex(cloud, engine, seed=2) for cloud, engine in zip(clouds, engines)]
    assert starts[1] == new[starts[0]]
    samples = [farthest_point_sampling(e, 30, start).vertices for e, start in zip(engines, starts)]
    assert np.array_equal(samples[1], new[samples[0]])


def test_coincident_points_have_distance_zero():
    cloud = PointCloud(np.repeat(random_sphere(50), 2, axis=0), 6)
    columns = geodesic_distances(cloud, [0])
    assert columns[0, 1] == 0
    assert np.isfinite(columns).all()


def test_a_graph_is_sampled_from_end_to_end():
    path = Graph(100, np.column_stack([np.arange(99), np.arange(1, 100)]), np.ones(99))
    engine = distance_engine(path)
    start = peripheral_vertex(path, engine, seed=3)
    assert start in (0, 99)
    sampling = farthest_point_sampling(engine, 5, start)
    assert sorted(sampling.vertices[:3]) in ([0, 49, 99], [0, 50, 99])
    assert np.array_equal(sampling.columns, np.abs(np.subtract.outer(sampling.vertices, np.arange(100))))


def test_the_start_in_a_graph_is_drawn_by_the_seed():
    star = Graph(30, np.column_stack([np.zeros(29, int), np.arange(1, 30)]), np.arange(1.0, 30.0))
    engine = distance_engine(star)
    assert {peripheral_vertex(star, engine, seed) for seed in range(8)} <= {28, 29}


def test_separate_graphs_cannot_be_sampled():
    engine = distance_engine(Graph(4, [[0, 1], [2, 3]], [1, 1]))
    with pytest.raises(MeshError, match="reached"):
        farthest_point_sampling(engine, 3, start=0)


def test_edges_of_a_mesh_are_an_upper_bound():
    mesh = flat_grid(20, 20)
    along = geodesic_distances(mesh, [0], "dijkstra")
    assert (along >= geodesic_distances(mesh, [0]) - 1e-6).all()
    assert along[0, -1] == pytest.approx(19 * 2**0.5), "diagonals are edges"


def test_a_path_may_use_an_edge_of_length_zero():
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 1]], [[0, 1, 2], [1, 2, 3]])
    assert geodesic_distances(mesh, [0], "dijkstra", weld=False)[0, 3] == pytest.approx(1 + 2**0.5)


def test_the_nearest_vertex_across_a_seam_and_none_on_another_component():
    """Two triangles whose common edge is split, and a third far away."""
    corners = [
        [0, 0, 0],
        [1, 0, 0],
        [0, 1, 0],
        [1, 0, 0],
        [0, 1, 0],
        [1, 1, 0],
        [9, 9, 9],
        [9, 8, 9],
        [8, 9, 9],
    ]
    mesh = Mesh(corners, [[0, 1, 2], [3, 5, 4], [6, 7, 8]])
    distance, nearest = distance_along_edges_to_nearest(mesh, np.array([0]), weld=True)
    assert distance.tolist() == [0, 1, 1, 1, 1, 2, np.inf, np.inf, np.inf]
    assert nearest[:6].tolist() == [0] * 6
    assert np.all(nearest[6:] < 0)
