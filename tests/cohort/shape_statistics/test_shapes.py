"""Collections of shapes: what is left out, what is refused, mirror images."""

from dataclasses import replace

import numpy as np
import pytest

from corresponded import ellipsoids, random_shapes
from isomatch import Correspondence, Mesh, Outcome, write_mesh
from isomatch._core.errors import FormatError, MapError, MeshError, MissingFileError
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    ShapeModel,
    left_right_map,
    left_right_of_shapes,
    read_shapes,
)
from isomatch_lab.procedural import creature
from shapes import icosphere


def meshes(count=3):
    shapes = random_shapes(count)
    return {name: shapes.mesh(i) for i, name in enumerate(shapes.names)}


def test_shapes_that_do_not_correspond_are_left_out_by_name():
    unplaced = random_shapes(1).vertices[0].copy()
    unplaced[5] = np.nan
    faces = icosphere(1).faces
    odd = {
        "aa": icosphere(2),
        "turned": Mesh(icosphere(1).vertices, (faces + 1) % (faces.max() + 1)),
        "unmatched": Mesh(unplaced, faces),
    }
    found = CorrespondedShapes.of_meshes(meshes() | odd)
    assert found.names == ("s000", "s001", "s002")
    assert [reason.split(":")[0] for reason in found.left_out] == ["aa", "turned", "unmatched"]
    assert "other faces" in found.left_out[0]
    assert found.left_out[2] == "unmatched: vertices without a position, 5"


def test_files_are_read_by_name(tmp_path):
    (tmp_path / "corresponded").mkdir()
    for name, mesh in meshes().items():
        write_mesh(tmp_path / "corresponded" / f"{name}.ply", mesh)
    write_mesh(tmp_path / "another.ply", icosphere(1))
    (tmp_path / "corresponded" / "readme.txt").write_text("no mesh")
    found = read_shapes(tmp_path)
    assert found.names == ("s000", "s001", "s002")
    np.testing.assert_array_equal(found.vertices, random_shapes(3).vertices)
    assert read_shapes([tmp_path / "another.ply"]).names == ("another",)
    write_mesh(tmp_path / "corresponded" / "s001.off", icosphere(1))
    with pytest.raises(FormatError, match="s001"):
        read_shapes(tmp_path)


def test_bad_input(tmp_path):
    with pytest.raises(MissingFileError, match="no such folder"):
        read_shapes(tmp_path / "none")
    with pytest.raises(FormatError, match="no meshes"):
        read_shapes(tmp_path)
    with pytest.raises(MeshError, match="no shapes"):
        CorrespondedShapes.of_meshes({})
    unplaced = Mesh(np.full((42, 3), np.nan), icosphere(1).faces)
    with pytest.raises(MeshError, match=r"\(42 in all"):
        CorrespondedShapes.of_meshes({"x": unplaced})
    points, faces = random_shapes(2).vertices, icosphere(1).faces
    with pytest.raises(MeshError, match="several"):
        CorrespondedShapes(("a", "a"), points, faces)
    with pytest.raises(MeshError, match=r"expected \(1, n, 3\)"):
        CorrespondedShapes(("a",), points, faces)
    with pytest.raises(MeshError, match="shape b"):
        CorrespondedShapes(("a", "b"), points * [[[1]], [[np.inf]]], faces)
    with pytest.raises(MeshError, match="refer to vertices outside"):
        CorrespondedShapes(("a", "b"), points, faces + 1)
    with pytest.raises(MeshError, match="have no faces"):
        CorrespondedShapes.of_meshes({"a": Mesh(points[0], np.zeros((0, 3), dtype=int))})
    with pytest.raises(MeshError, match="expected"):
        CorrespondedShapes(("a", "b"), points[:, :, :2], faces)


def test_weights_are_shares_of_the_area():
    shapes = ellipsoids([1.0, 1.5])
    assert shapes.area_weights.sum() == pytest.approx(1)
    each = [shapes.mesh(i).vertex_areas / shapes.mesh(i).area for i in range(2)]
    np.testing.assert_allclose(shapes.area_weights, np.mean(each, axis=0))
    larger = shapes.moved(shapes.vertices * np.array([1, 7])[:, None, None])
    np.testing.assert_allclose(larger.area_weights, shapes.area_weights)


def exact_left_right(points):
    """The vertex at the mirrored place of each."""
    other = np.abs(points[:, None] * [-1, 1, 1] - points).sum(axis=2).argmin(axis=1)
    return Correspondence(other, len(points))


def test_with_their_mirror_images_the_mean_is_symmetric():
    shapes = random_shapes(4, spread=0.2)
    sides = exact_left_right(icosphere(1).vertices)
    both, other = shapes.mirrored([sides] * 4), sides.vertices
    assert both.names[4:] == ("s000_mirrored", "s001_mirrored", "s002_mirrored", "s003_mirrored")
    mean = ShapeModel.fit(both).mesh().vertices
    apart = np.linalg.norm(mean[:, None] - mean, axis=2)
    np.testing.assert_allclose(apart[np.ix_(other, other)], apart, atol=1e-7)
    alone = ShapeModel.fit(shapes).mesh().vertices
    alone = np.linalg.norm(alone[:, None] - alone, axis=2)
    assert np.abs(alone[np.ix_(other, other)] - alone).max() > 0.01


def test_a_symmetric_shape_is_its_own_mirror_image():
    shapes = ellipsoids([1.0, 1.4])
    both = ShapeModel.fit(shapes.mirrored([exact_left_right(icosphere(2).vertices)] * 2))
    assert both.n_modes == 1
    np.testing.assert_allclose(both.scores[2:], both.scores[:2], atol=1e-9)
    np.testing.assert_allclose(both.aligned[:2], shapes.vertices, atol=1e-9)


def test_bad_left_right_maps():
    shapes = ellipsoids([1.0])
    for bad in ([np.arange(5)], [np.full(162, -1)], [np.arange(162)] * 2):
        with pytest.raises(MeshError, match="no maps of 1 shapes of 162 vertices"):
            shapes.mirrored([Correspondence(each, 162) for each in bad])


def test_a_vertex_without_a_counterpart_is_not_measured_in_the_mirror_image():
    shapes, other = ellipsoids([1.0]), exact_left_right(icosphere(2).vertices).vertices.copy()
    other[7] = -1
    both = shapes.mirrored([Correspondence(other, 162)])
    assert np.flatnonzero(~both.measured[1]).tolist() == [7]
    np.testing.assert_allclose(both.vertices[1], both.vertices[0], atol=1e-9)


@pytest.mark.long
def test_the_left_right_map_is_found():
    body = creature(1500, symmetric=True).mesh
    apart = body.vertices[left_right_map(body).map.vertices] * [-1, 1, 1] - body.vertices
    assert np.linalg.norm(apart, axis=1).mean() < 0.02 * np.sqrt(body.area)
    assert left_right_map(icosphere(2)).outcome is Outcome.SYMMETRY_AMBIGUOUS


@pytest.mark.long
def test_what_is_matched_to_its_own_side_is_left_unmatched():
    """A small ball beside the body, on one side alone, is like nothing but its own mirror image."""
    body, ball = creature(1500, symmetric=True).rest_mesh, icosphere(2)
    vertices = np.concatenate([body.vertices, 0.05 * ball.vertices + [0.5, 0, 0.7]])
    mesh = Mesh(vertices, np.concatenate([body.faces, ball.faces + body.n_vertices]))
    result = left_right_map(mesh)
    assert not result.map.matched[body.n_vertices :].any()
    assert result.map.matched[: body.n_vertices].mean() > 0.99


@pytest.mark.long
def test_a_shape_tells_left_and_right_where_the_mean_does_not():
    ball = icosphere(2)
    points, radius = ball.vertices, np.ones(ball.n_vertices)
    for direction in ((0.8, 0.6, 0), (-0.8, 0.6, 0), (0, -0.8, 0.6), (0, 0.3, -0.95)):
        size = 0.9 if direction[0] else 0.6
        radius += size * np.exp(-((points - direction) ** 2).sum(axis=1) / 0.15)
    symmetric = points * radius[:, None]
    shapes = CorrespondedShapes(("ball", "body"), [points, symmetric], ball.faces)
    found, name = left_right_of_shapes(shapes, ball)
    assert name == "body"
    other = found.vertices
    assert np.linalg.norm(symmetric[other] * [-1, 1, 1] - symmetric, axis=1).mean() < 0.05
    unsure = CorrespondedShapes(("one", "two"), [points, 2 * points], ball.faces)
    lacking = replace(shapes, measured=[[True] * ball.n_vertices, [False] + [True] * (ball.n_vertices - 1)])
    for each in (unsure, lacking):
        with pytest.raises(MapError, match="not certain"):
            left_right_of_shapes(each, ball)
