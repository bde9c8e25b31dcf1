"""Landmarks carried: exact by maps whose images are known, both ways; curves at equal distances; what has no image."""

import numpy as np
import pytest

from isomatch import (
    Asset,
    Correspondence,
    LandmarkError,
    Landmarks,
    MapError,
    Mesh,
    PointCloud,
    carry_landmarks,
    match,
)
from isomatch.datasets import example_pair
from isomatch.landmarks import Curve
from isomatch.surfaces import nearest_on_surface
from shapes import cylinder, disguised, flat_grid, icosphere, map_to_nearest, planar_delaunay
from zoo.made import soup

pytestmark = pytest.mark.usefixtures("prepared_once")


def relabelled(mesh):
    """The mesh with its vertices and faces in another order, and the map onto it."""
    other = disguised(mesh, rotate=False)
    return other.mesh, Correspondence(other.new_vertex, mesh.n_vertices)


@pytest.fixture
def marks():
    rng = np.random.default_rng(3)
    return Landmarks(rng.uniform(0.1, 0.9, (30, 3)) * [1, 1, 0], [f"p{i}" for i in range(30)])


@pytest.mark.parametrize("to", ["target", "source"])
def test_the_identity_in_another_order_is_exact(to):
    sphere = icosphere(3)
    other, found = relabelled(sphere)
    rng = np.random.default_rng(1)
    points = nearest_on_surface(sphere, rng.normal(size=(50, 3))).interpolated(sphere.vertices)
    carried = carry_landmarks(found, sphere, other, Landmarks(points), to=to)
    np.testing.assert_allclose(carried.positions, points, atol=1e-12)


@pytest.mark.parametrize("to", ["target", "source"])
def test_another_triangulation_of_a_plane_is_exact(marks, to):
    """The map is linear in every triangle, so that a point inside goes where it is."""
    source, target = planar_delaunay(400, seed=1), planar_delaunay(500, seed=2)
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    source, target = (with_corners(mesh, square) for mesh in (source, target))
    carried = carry_landmarks(map_to_nearest(source.vertices, target), source, target, marks, to=to)
    np.testing.assert_allclose(carried.positions, marks.positions, atol=1e-9)
    assert carried.names == marks.names


def with_corners(mesh, corners):
    from scipy.spatial import Delaunay

    points = np.vstack([mesh.vertices, corners])
    return Mesh(points, Delaunay(points[:, :2]).simplices)


def test_the_direction_is_that_of_the_map():
    """A stretch by two: the other way round would halve it."""
    source = flat_grid(5, 5)
    target, found = relabelled(source.moved(2 * source.vertices + [7, 0, 0]))
    carried = carry_landmarks(found, source, target, Landmarks([[1.25, 0.5, 0]], ["a"]))
    np.testing.assert_allclose(carried.positions, [[9.5, 1.0, 0]], atol=1e-12)
    back = carry_landmarks(found, source, target, carried, to="source")
    np.testing.assert_allclose(back.positions, [[1.25, 0.5, 0]], atol=1e-12)
    with pytest.raises(MapError):
        carry_landmarks(found, source, icosphere(1), carried)


def test_points_off_the_surface_go_with_the_nearest_point():
    source = flat_grid(5, 5)
    carried = carry_landmarks(
        Correspondence(np.arange(25), 25),
        source,
        source.moved(np.add(source.vertices, [0, 0, 3])),
        Landmarks([[1.2, 0.3, 0.4]]),
    )
    np.testing.assert_allclose(carried.positions, [[1.2, 0.3, 3.0]], atol=1e-12)


def test_what_has_no_image_has_no_place():
    source = flat_grid(5, 5)
    image = np.arange(25)
    image[source.vertices[:, 0] > 2] = -1
    marks = Landmarks(
        [[0.5, 0.5, 0], [3.5, 0.5, 0], [0, 1, 0], [2, 1, 0], [0, 2, 0], [4, 2, 0]],
        [*"abcdef"],
        [Curve("whole", (2, 3)), Curve("half", (4, 5))],
    )
    carried = carry_landmarks(Correspondence(image, 25), source, source, marks)
    assert carried.placed.tolist() == [True, False, True, True, False, False]


def test_the_order_stays_where_other_landmarks_are_between_the_points_of_a_curve():
    source = flat_grid(5, 5)
    points = [[0, 0, 0], [0.5, 3, 0], [1, 0, 0], [1.5, 3, 0], [2, 0, 0]]
    marks = Landmarks(points, [*"abcde"], [Curve("s", (0, 2, 4))])
    found = Correspondence(np.arange(25), 25)
    carried = carry_landmarks(found, source, source, marks)
    assert (carried.names, carried.curves) == (marks.names, marks.curves)
    np.testing.assert_allclose(carried.positions, points, atol=1e-12)
    assert carry_landmarks(found, source, source, marks, curve_points=2).names == ("s-1", "s-2", "b", "d")


@pytest.mark.parametrize("to", ["target", "source"])
def test_points_of_a_curve_are_equally_spaced_after_an_uneven_stretch(to):
    """x → x² moves most of the points of a line to one end; along the carried line they are even again."""
    source = flat_grid(5, 41)
    source = source.moved(source.vertices / [40, 4, 1])
    target = source.moved(source.vertices ** [2, 1, 1])
    marks = Landmarks(
        [[0.5, 0.5, 0], [0.0, 0.5, 0], [0.3, 0.5, 0], [1.0, 0.5, 0]],
        ["eye", "s1", "s2", "s3"],
        [Curve("s", (1, 2, 3))],
    )
    found = Correspondence(np.arange(205), 205)
    carried = carry_landmarks(found, source, target, marks, curve_points=6, to=to)
    assert carried.names == ("eye", *(f"s-{i}" for i in range(1, 7)))
    assert carried.curves == (Curve("s", (1, 2, 3, 4, 5, 6)),)
    np.testing.assert_allclose(carried.positions[1:, 0], np.linspace(0, 1, 6), atol=1e-9)
    kept = carry_landmarks(found, source, target, marks, to=to)
    assert kept.names == marks.names
    np.testing.assert_allclose(kept.positions[1:, 0], [0, 0.5, 1], atol=1e-9)
    with pytest.raises(LandmarkError, match="curve_points = 1"):
        carry_landmarks(found, source, target, marks, curve_points=1)


def test_a_closed_curve_around_a_tube():
    tube = cylinder(40, 20)
    wider = tube.moved(tube.vertices * [2, 2, 1])
    angles = np.arange(5) * 2 * np.pi / 5
    radius = np.linalg.norm(tube.vertices[0, :2])
    ring = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(5, 0.2)])
    marks = Landmarks(ring, [*"abcde"], [Curve("ring", tuple(range(5)), True)])
    carried = carry_landmarks(Correspondence(np.arange(800), 800), tube, wider, marks, curve_points=10)
    turned = np.unwrap(np.arctan2(carried.positions[:, 1], carried.positions[:, 0]))
    np.testing.assert_allclose(turned, np.arange(10) * np.pi / 5, atol=0.01)
    np.testing.assert_allclose(carried.positions[:, 2], 0.2, atol=1e-6)


def test_seams_of_a_file_are_closed():
    """Points that a texture seam doubles: landmarks beside the seam go on as if it were not there."""
    sphere = icosphere(2)
    cut = Asset.of_mesh(soup(sphere))
    found = Correspondence(np.arange(len(cut.points)), len(cut.points))
    rng = np.random.default_rng(4)
    points = nearest_on_surface(sphere, rng.normal(size=(20, 3))).interpolated(sphere.vertices)
    for to in ("target", "source"):
        carried = carry_landmarks(found, cut, cut, Landmarks(points), to=to)
        np.testing.assert_allclose(carried.positions, points, atol=1e-9)


def test_points_without_faces():
    cloud = PointCloud(icosphere(3).vertices)
    other = PointCloud(2 * cloud.vertices)
    found = Correspondence(np.arange(cloud.n_vertices), cloud.n_vertices)
    carried = carry_landmarks(found, cloud, other, Landmarks(1.001 * cloud.vertices[[5, 9]]))
    np.testing.assert_array_equal(carried.positions, other.vertices[[5, 9]])
    back = carry_landmarks(found, cloud, other, carried, to="source")
    np.testing.assert_array_equal(back.positions, cloud.vertices[[5, 9]])


@pytest.mark.long
def test_the_expected_error_is_that_of_the_result_in_the_units_of_the_shape_that_receives():
    source, target = (made.mesh for made in example_pair())
    result = match(source, target)
    rows = [3, 500, 900]
    there = carry_landmarks(result, source, target, Landmarks(source.vertices[rows]))
    np.testing.assert_allclose(
        there.expected_error, result.expected_error[rows] * np.sqrt(target.area), rtol=1e-6
    )
    back = carry_landmarks(result, source, target, there, to="source")
    np.testing.assert_allclose(
        back.expected_error, result.expected_error[rows] * np.sqrt(source.area), rtol=0.3
    )
    assert np.isnan(carry_landmarks(result.map, source, target, there, to="source").expected_error).all()
