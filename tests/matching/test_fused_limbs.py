"""Hands that are fused with their thighs, without a mark: where cutting them off fits better, they are cut off."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, Outcome, match, prepare
from isomatch.settings import PreparationSettings
from isomatch.shapes import cut_shape
from shapes import disguised
from touching import body, carried, cup, ring, without

pytestmark = pytest.mark.usefixtures("prepared_once")

UNCUT = Config(preparation=PreparationSettings(self_contact_concavity=0))
POSES = {
    "clean": {},
    "right": {"right": "on thigh", "triangulation": 1},
    "left": {"left": "on thigh", "triangulation": 2},
    "both": {"right": "on thigh", "left": "on thigh", "triangulation": 3},
}


def error_of(source, target, image):
    """Mean distance in space between images and where the bones carry the vertices, in √area; −1 counts as well."""
    expected = carried(source.mesh.vertices, source, target)
    missed = np.linalg.norm(target.mesh.vertices[image] - expected, axis=1)
    return float(np.where(image < 0, 1.0, missed / np.sqrt(target.mesh.area)).mean())


def matched(source, target, config=None):
    """Match two bodies; also the error of the map."""
    source, target = (body(**POSES[pose]) for pose in (source, target))
    found = match(source.mesh, target.mesh, config=config)
    return found, error_of(source, target, found.map.vertices)


def was_cut(found):
    return any("holes closed" in note for note in found.notes)


@pytest.mark.long
@pytest.mark.parametrize(
    ("source", "target"),
    [
        ("right", "left"),
        ("clean", "right"),
        ("right", "clean"),
        ("clean", "both"),
        ("both", "clean"),
        ("both", "left"),
        ("right", "both"),
    ],
)
def test_fused_hands_are_cut_off(source, target):
    found, error = matched(source, target)
    assert found.outcome is Outcome.CONVERGED
    assert found.map.matched.all()
    # onto clean hands a map without the cut may be as good; that it was tried is told
    assert was_cut(found) or "self-contacts cut" in found.reason
    assert error < 0.03


@pytest.mark.long
def test_cutting_can_be_turned_off():
    assert not was_cut(matched("right", "left", UNCUT)[0])


@pytest.mark.long
def test_the_names_of_vertices_do_not_matter():
    """Of the user's vertices, there and back again; nor does where the shapes are, and in which unit."""
    source, target = (body(**POSES[pose]) for pose in ("right", "left"))
    plain = match(source.mesh, target.mesh).map.vertices
    one, other = disguised(source.mesh, 1, scale=1000.0), disguised(target.mesh, 2)
    found = match(one.mesh, other.mesh)
    assert found.map.vertices.shape == (source.mesh.n_vertices,)
    image = np.argsort(other.new_vertex)[found.map.vertices[one.new_vertex]]
    moved = np.linalg.norm(target.mesh.vertices[image] - target.mesh.vertices[plain], axis=1)
    assert moved.mean() < 0.01
    assert error_of(source, target, image) < 0.03


@pytest.mark.long
def test_holes_do_not_matter():
    """One of them next to the self-contact."""
    source, target = (body(**POSES[pose]) for pose in ("right", "left"))
    source = replace(source, mesh=without(source.mesh, [0.1, 0.09, -0.02], 0.03))
    target = replace(target, mesh=without(target.mesh, [0, 0, 0.82], 0.03))
    found = match(source.mesh, target.mesh, config=Config(part="none"))
    assert found.outcome is Outcome.CONVERGED
    assert was_cut(found)
    assert error_of(source, target, found.map.vertices) < 0.03


@pytest.mark.long
@pytest.mark.parametrize(("source", "target"), [("right", "left"), ("right", "clean")])
def test_a_fused_part_is_cut(source, target):
    """A lower leg is missing."""
    source, target = (body(**POSES[pose]) for pose in (source, target))
    part = replace(source, mesh=without(source.mesh, [-0.14, 0.05, -0.66], 0.25))
    found = match(part.mesh, target.mesh)
    assert found.outcome is Outcome.PARTIAL
    assert error_of(part, target, found.map.vertices) < 0.05


@pytest.mark.long
@pytest.mark.parametrize("shape", [lambda i: ring(7, i), lambda i: cup(i)], ids=["ring", "cup"])
def test_handles_that_are_meant_stay(shape):
    """The map is the same to the bit as without a look at self-contacts."""
    source, target = shape(0), shape(1)
    found, uncut = match(source, target), match(source, target, config=UNCUT)
    np.testing.assert_array_equal(found.map.vertices, uncut.map.vertices)
    assert found.outcome is uncut.outcome
    assert not was_cut(found)


@pytest.mark.long
def test_limbs_apart_are_tried_where_the_map_is_poor():
    """The source is taken for a part, because touching surface is hidden; such a map is never sure."""
    strict = Config(outcome=replace(Config().outcome, poor_spectral_residual=0.01))
    found, error = matched("both", "clean", strict)
    assert found.timings["limbs apart: prepare"] > 0
    assert found.way != "limbs apart" or found.outcome is Outcome.LOW_CONFIDENCE
    assert error < 0.05


@pytest.mark.long
def test_a_shape_knows_its_handles():
    shapes = [prepare(body(**pose).mesh) for pose in POSES.values()]
    assert [shape.handles for shape in shapes] == [0, 1, 1, 2]


@pytest.mark.long
def test_a_body_that_is_cut_knows_where_its_vertices_came_from():
    mesh = body(**POSES["both"]).mesh
    shape = prepare(mesh)
    assert cut_shape(shape, 0) is None
    assert cut_shape(prepare(body().mesh), 2) is None
    cut = cut_shape(shape, 2)
    n, origin = shape.body.n_vertices, cut.origin
    np.testing.assert_array_equal(origin[:n], np.arange(n))
    copies, on_caps = np.split(np.arange(n, len(origin)), [(origin >= 0).sum() - n])
    assert len(copies) > 0
    assert (origin[on_caps] == -1).all()
    real = origin >= 0  # lengths are in units of the closed body
    ratio = cut.body.vertices[real].std(axis=0) / shape.body.vertices[origin[real]].std(axis=0)
    centred = [x - x[:n].mean(axis=0) for x in (cut.body.vertices[real], shape.body.vertices[origin[real]])]
    np.testing.assert_allclose(centred[0], ratio * centred[1], atol=1e-6)
    assert cut.handles == 0
    assert not len(cut.mesh_body.boundary_edges)
    assert cut_shape(shape, 2) is cut


@pytest.mark.long
def test_shapes_with_more_handles_than_limbs_are_not_cut():
    few = Config(preparation=PreparationSettings(most_self_contacts=0))
    assert was_cut(matched("right", "left")[0])
    assert not was_cut(matched("right", "left", few)[0])
