"""Distances among some points of a larger space, in another unit."""

import numpy as np
import pytest

from isomatch import MeshError, SettingError, distance_basis, geodesic_distances
from isomatch.geodesics import RestrictedEngine, distance_engine, farthest_point_sampling
from shapes import icosphere, two_spheres

KEPT = np.array([5, 100, 3, 41, 160])


@pytest.fixture(params=["fast_marching", "dijkstra", "matrix"])
def whole(request):
    """Two engines whose fronts stop early, and one that computes full columns."""
    mesh = icosphere(2)
    if request.param != "matrix":
        return distance_engine(mesh, request.param)
    return distance_engine(geodesic_distances(mesh, np.arange(mesh.n_vertices)))


@pytest.mark.parametrize("unit", [1.0, 2.5])
def test_columns_are_those_of_the_whole_in_the_unit(whole, unit):
    part = RestrictedEngine(whole, KEPT, unit)
    assert (part.name, part.n_points) == (whole.name, 5)
    expected = whole.distances_from(KEPT[[1, 4]])[:, KEPT] / unit
    assert np.array_equal(part.distances_from([1, 4]), expected)


@pytest.mark.parametrize("unit", [1.0, 2.5])
def test_lowering_gives_the_distance_to_the_nearest_source(whole, unit):
    part = RestrictedEngine(whole, KEPT, unit)
    nearest = np.full(5, np.inf)
    for source in (0, 3):
        column = part.lower(nearest, source)
        if column is not None:
            assert np.array_equal(column, part.distances_from([source])[0])
    np.testing.assert_allclose(nearest, part.distances_from([0, 3]).min(axis=0), rtol=1e-12)


def test_a_bound_is_never_raised(whole):
    """Not even by the rounding of two changes of unit."""
    part = RestrictedEngine(whole, np.arange(162), 0.1)
    bound = np.random.default_rng(0).random(162) * 1e-3
    nearest = bound.copy()
    part.lower(nearest, 2)
    assert nearest[2] == 0
    assert (nearest <= bound).all()
    np.testing.assert_allclose(np.delete(nearest, 2), np.delete(bound, 2), rtol=1e-12)


def test_restricting_twice_is_restricting_once(whole):
    twice = RestrictedEngine(RestrictedEngine(whole, KEPT, 2.0), [4, 0, 2], 8.0)
    once = RestrictedEngine(whole, KEPT[[4, 0, 2]], 16.0)
    assert np.array_equal(twice.distances_from(range(3)), once.distances_from(range(3)))


def test_infinite_distances_stay_infinite():
    """From one component of two: the kept vertices 0 and 1 are on the first sphere, 2 on the second."""
    part = RestrictedEngine(distance_engine(two_spheres(1, 0.5)), [0, 7, 50], 2.0)
    assert np.isinf(part.distances_from([2])[0]).tolist() == [True, True, False]
    nearest = np.full(3, np.inf)
    part.lower(nearest, 2)
    assert np.isinf(nearest).tolist() == [True, True, False]


def test_paths_may_leave_the_kept_vertices():
    n = 12
    ring = np.minimum(np.arange(n), n - np.arange(n)).astype(float)
    matrix = ring[np.subtract.outer(np.arange(n), np.arange(n)) % n]
    part = RestrictedEngine(distance_engine(matrix), [0, 6], 3.0)
    assert part.distances_from([0, 1]).tolist() == [[0.0, 2.0], [2.0, 0.0]]


def test_sampling_and_bases_take_it_as_any_other_engine(whole):
    part = RestrictedEngine(whole, np.arange(0, 162, 2), 0.1)
    sampling = farthest_point_sampling(part, 20, start=3)
    assert np.array_equal(sampling.columns, part.distances_from(sampling.vertices))
    assert distance_basis(part, 10, 20).engine == whole.name


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        ([0, 162], r"vertices 162 are outside 0…161, the points of the engine"),
        ([-1], r"vertices -1 are outside 0…161"),
        ([0.5], r"vertices of shape \(1,\) and type float64 are not a list of points"),
        ([[0, 1]], r"vertices of shape \(1, 2\)"),
    ],
)
def test_bad_vertices(vertices, message):
    with pytest.raises(MeshError, match=message):
        RestrictedEngine(distance_engine(icosphere(2)), vertices)


@pytest.mark.parametrize("unit", [0.0, -1.0, np.nan, np.inf])
def test_bad_units(unit):
    with pytest.raises(SettingError, match="unit"):
        RestrictedEngine(distance_engine(icosphere(2)), [0], unit)


def test_bad_sources():
    part = RestrictedEngine(distance_engine(icosphere(2)), [7, 9])
    for ask in (lambda: part.distances_from([2]), lambda: part.lower(np.ones(2), 2)):
        with pytest.raises(MeshError, match="sources 2 are outside 0…1"):
            ask()
