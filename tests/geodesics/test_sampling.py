"""Farthest point sampling, geodesic and Euclidean."""

import numpy as np
import pytest

from isomatch import Mesh, MeshError, SettingError, geodesic_distances
from isomatch.geodesics import (
    distance_engine,
    euclidean_farthest_points,
    farthest_point_sampling,
    peripheral_vertex,
)
from shapes import disguised, flat_grid, icosphere, two_spheres

P = 40


@pytest.fixture(scope="module")
def mesh(example):
    return example[0].mesh


@pytest.fixture(scope="module")
def sampling(mesh):
    return farthest_point_sampling(distance_engine(mesh), P, start=17)


def test_samples_are_distinct_and_columns_are_the_distances_from_them(mesh, sampling):
    assert sampling.vertices[0] == 17
    assert len(np.unique(sampling.vertices)) == P
    assert np.array_equal(sampling.columns, geodesic_distances(mesh, sampling.vertices))


def test_each_sample_is_farthest_from_those_before(sampling):
    """Up to 1 %, by which fronts that stop where an earlier sample is nearer differ from full ones."""
    for i in range(1, P):
        nearest = sampling.columns[:i].min(axis=0)
        assert nearest[sampling.vertices[i]] >= 0.99 * nearest.max()


def test_samples_are_apart_and_cover(sampling):
    """All are r apart and every point is within r, the distance of the last sample from the others."""
    among = sampling.columns[:, sampling.vertices]
    smallest = among[~np.eye(P, dtype=bool)].min()
    assert smallest >= 0.98 * sampling.columns[:-1, sampling.vertices[-1]].min()
    assert sampling.columns.min(axis=0).max() <= 1.02 * smallest


def test_every_vertex_may_be_a_sample():
    sheet = flat_grid(4, 5)
    sampling = farthest_point_sampling(distance_engine(sheet), 20, start=3)
    assert sorted(sampling.vertices) == list(range(20))


def test_relabelling_relabels_the_samples(mesh):
    other = disguised(mesh, seed=1)
    engines = distance_engine(mesh), distance_engine(other.mesh)
    starts = [peripheral_vertex(surface, engine) for surface, engine in zip((mesh, other.mesh), engines)]
    assert starts[1] == other.new_vertex[starts[0]]
    plain, moved = (farthest_point_sampling(e, P, start).vertices for e, start in zip(engines, starts))
    assert np.array_equal(moved, other.new_vertex[plain])


def test_peripheral_vertex_is_at_an_end(mesh):
    engine = distance_engine(mesh)
    vertex = peripheral_vertex(mesh, engine, seed=5)
    across = geodesic_distances(mesh, range(0, mesh.n_vertices, 20)).max()
    assert geodesic_distances(mesh, [vertex]).max() > 0.95 * across


def test_two_components_cannot_be_sampled():
    with pytest.raises(MeshError, match="samples"):
        farthest_point_sampling(distance_engine(two_spheres(1, 1.0)), 5, start=0)


def test_more_samples_than_points():
    with pytest.raises(MeshError, match="12 points"):
        farthest_point_sampling(distance_engine(icosphere(0)), 13, start=0)


def test_coincident_points_are_not_distinct():
    """A square with one corner twice, at both ends of a face without area."""
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 0]]
    mesh = Mesh(vertices, [[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    with pytest.raises(MeshError, match="4 points"):
        farthest_point_sampling(distance_engine(mesh), 5, start=0)


def by_definition(points, n_samples, start):
    chosen = [start]
    while len(chosen) < n_samples:
        nearest = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(nearest.argmax()))
    return chosen


@pytest.mark.parametrize("dimension", [1, 2, 3, 7])
def test_euclidean_farthest_points_by_definition(dimension):
    points = np.random.default_rng(dimension).normal(size=(300, dimension))
    assert euclidean_farthest_points(points, 40, 8).tolist() == by_definition(points, 40, 8)


def test_coincident_points_are_chosen_last_and_once():
    points = np.repeat(np.random.default_rng(0).random((20, 3)), 2, axis=0)
    chosen = euclidean_farthest_points(points, 40, 0)
    assert len(set(chosen)) == 40
    assert len(set(chosen[:20] // 2)) == 20


@pytest.mark.parametrize(("n_samples", "start"), [(0, 0), (13, 0), (3, -1), (3, 12)])
def test_euclidean_farthest_points_out_of_range(n_samples, start):
    with pytest.raises(SettingError, match=r"n_samples|start"):
        euclidean_farthest_points(icosphere(0).vertices, n_samples, start)
