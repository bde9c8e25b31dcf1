"""Shapes that hardly belong to a sample: each kind is named, alone, and an ordinary sample is left alone."""

import numpy as np
import pytest

from corresponded import ellipsoids, moved, random_shapes
from data import real_file
from isomatch import Mesh
from isomatch.cohort.shape_statistics import CorrespondedShapes, doubtful_shapes, procrustes_distances


def named(shapes):
    return {(doubt.kind, *doubt.names) for doubt in doubtful_shapes(shapes)}


def changed(shapes, row, change):
    vertices = shapes.vertices.copy()
    vertices[row] = change(vertices[row])
    return shapes.moved(vertices)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 12])
def test_an_ordinary_sample_is_left_alone(n):
    """Also one of growing animals, of which the last is three times as large as the first."""
    assert named(random_shapes(n)) == set()
    assert named(moved(random_shapes(n))) == set()
    growing = random_shapes(n).vertices * np.geomspace(1, 3, n)[:, None, None]
    assert named(random_shapes(n).moved(growing)) == set()


@pytest.mark.parametrize("factor", [0.001, 1 / 25.4, 2.54, 10.0, 1000.0])
@pytest.mark.parametrize("n", [3, 8])
def test_other_units(factor, n):
    shapes = changed(random_shapes(n), 1, lambda x: factor * x)
    assert named(shapes) == {("units", "s001")}
    told = float(doubtful_shapes(shapes)[0].reason.split()[1])
    assert told == pytest.approx(factor, rel=0.03)


def test_two_shapes_in_different_units():
    (doubt,) = doubtful_shapes(changed(random_shapes(2), 1, lambda x: 1000 * x))
    assert (doubt.kind, doubt.names) == ("units", ("s001",))


def test_a_minority_in_other_units():
    shapes = random_shapes(7)
    for row in (2, 4, 5):
        shapes = changed(shapes, row, lambda x: 100 * x)
    assert named(shapes) == {("units", "s002"), ("units", "s004"), ("units", "s005")}


@pytest.mark.parametrize("rows", [[0], [1, 4], [0, 2, 3]])
def test_mirror_images(rows):
    shapes = moved(random_shapes(8))
    for row in rows:
        shapes = changed(shapes, row, lambda x: x * [1, -1, 1])
    assert named(shapes) == {("mirrored", f"s00{row}") for row in rows}


@pytest.mark.parametrize(
    ("file", "rows"), [("scape/scape", [1, 7, 20, 33]), ("tosca/horse", [2]), ("tosca/cat", [0, 5])]
)
def test_mirror_images_among_bodies_in_many_poses(file, rows):
    with np.load(real_file(f"{file}.npz")) as arrays:
        poses = {name: arrays[name] for name in arrays.files if name != "faces"}
        shapes = CorrespondedShapes(tuple(poses), np.array(list(poses.values())), arrays["faces"])
    assert not named(shapes)
    vertices = shapes.vertices.copy()
    vertices[rows] *= [-1, 1, 1]
    assert named(shapes.moved(vertices)) == {("mirrored", shapes.names[row]) for row in rows}


def test_a_mirror_image_whose_faces_were_turned_over_is_not_left_out():
    shapes = random_shapes(5)
    meshes = {name: shapes.mesh(i) for i, name in enumerate(shapes.names)}
    meshes["s000"] = Mesh(meshes["s000"].vertices * [1, 1, -1], shapes.faces[:, ::-1])
    found = CorrespondedShapes.of_meshes(meshes)
    assert not found.left_out
    assert named(found) == {("mirrored", "s000")}
    np.testing.assert_array_equal(found.faces, shapes.faces)


def test_flat_shapes_have_no_mirror_image():
    shapes = random_shapes(6)
    assert not {kind for kind, *_ in named(shapes.moved(shapes.vertices * [1, 1, 0]))} & {"mirrored"}
    assert {
        kind for kind, *_ in named(shapes.moved(np.repeat(shapes.vertices[:1] * [1, 1, 0], 6, axis=0)))
    } == {"twice"}


def test_one_shape_twice_although_moved_and_in_other_units():
    shapes = random_shapes(5)
    twice = CorrespondedShapes("abcdef", shapes.vertices[[0, 1, 2, 3, 4, 1]], shapes.faces)
    renamed = moved(twice)
    assert named(renamed) == {("twice", "b", "f")}
    rounded = renamed.moved(renamed.vertices.astype(np.float32))
    assert named(rounded) == {("twice", "b", "f")}
    scaled = changed(renamed, 5, lambda x: 10 * x)
    assert named(scaled) >= {("twice", "b", "f"), ("units", "f")}


def test_one_shape_far_away_and_all_of_them():
    shapes = random_shapes(6)
    assert named(changed(shapes, 2, lambda x: np.add(x, [0, 500, 0]))) == {("far", "s002")}
    assert named(shapes.moved(np.add(shapes.vertices, [5e6, 4e5, 0]))) == set()


def test_a_shape_unlike_all_others():
    shapes = changed(random_shapes(8), 5, lambda x: x[np.random.default_rng(0).permutation(len(x))])
    assert named(shapes) == {("unlike", "s005")}


def test_distances_from_mirror_images_are_those_of_mirrored_arrays():
    vertices = moved(random_shapes(4)).vertices
    expected = [
        [procrustes_distances(np.stack([a, b * [1, 1, -1]]))[0, 1] for b in vertices] for a in vertices
    ]
    np.testing.assert_allclose(procrustes_distances(vertices, mirrored=True), expected, atol=1e-9)


def test_shapes_that_are_points():
    two = ellipsoids([1.0, 1.2])
    assert named(two.moved(np.zeros((2, 162, 3)))) == {("unlike", name) for name in two.names}


def test_a_point_among_shapes_of_which_one_is_in_other_units():
    shapes = changed(random_shapes(8), 2, lambda x: 1000 * x)
    found = doubtful_shapes(changed(shapes, 5, lambda x: np.full_like(x, 0.1)))
    assert [(doubt.kind, *doubt.names) for doubt in found] == [("unlike", "s005"), ("units", "s002")]
    assert "has no size" in found[0].reason
