"""Double walls told, and the outermost surface kept: shells, chambers, and shapes without an inside."""

from functools import partial

import numpy as np
import pytest

from data import real_file
from isomatch import Asset, Attribute, Mesh, check, repair
from isomatch._core.errors import SettingError
from isomatch.datasets import example_pair
from isomatch.repair import double_walled_share, inner_faces
from isomatch_lab.procedural import PLANS, creature, organ
from later import some_later
from shapes import icosphere
from thin_walls import shell
from zoo import torus
from zoo.made import together


def ball(radius, centre=(0, 0, 0), inward=False):
    mesh = icosphere(3)
    return Mesh(radius * mesh.vertices + centre, mesh.faces[:, ::-1] if inward else mesh.faces)


def made_organ(kind):
    return organ(kind, 2000).mesh


SINGLE = {
    "ball": lambda: ball(1.0),
    "torus": lambda: torus(60, 30),
    "two balls": lambda: together(ball(1.0), ball(0.5, (3, 0, 0))),
    "body": lambda: example_pair()[0].mesh,
    "another body": lambda: creature(1500, kind="biped", pose=3).mesh,
    **{kind: partial(made_organ, kind) for kind in PLANS},
}


@pytest.mark.parametrize("name", some_later(SINGLE, lambda name: name not in PLANS or name == "cortex"))
def test_a_shape_without_an_inside_stays_as_it_is(name):
    mesh = SINGLE[name]()
    report, plain, outer = check(mesh), repair(mesh), repair(mesh, outer=True)
    assert report.double_walled < 0.25
    assert not any("double-walled" in sentence for sentence in report.warnings)
    assert outer.changes == plain.changes
    assert np.array_equal(outer.mesh.vertices, plain.mesh.vertices)
    assert np.array_equal(outer.mesh.faces, plain.mesh.faces)


@pytest.mark.parametrize("kind", ["capsule", "tube"])
def test_shells_are_called_double_walled(kind):
    mesh = shell(kind, 0.03, 0).mesh
    report = check(mesh)
    assert report.double_walled > 0.8
    assert any("double-walled" in sentence and "outer=True" in sentence for sentence in report.warnings)
    turned = check(Mesh(100 * mesh.vertices, mesh.faces[:, ::-1]))
    assert turned.double_walled == pytest.approx(report.double_walled, abs=0.03), "neither size nor winding"
    assert check(mesh, wall=0.01).double_walled < 0.1
    assert np.isnan(check(mesh, wall=0).double_walled)


def test_two_sheets_with_air_between_them_are_no_wall():
    """Of a hollow ball the wall counts, and not the narrow space around a ball in a larger one."""
    shell = together(ball(1.0, inward=True), ball(1.05))
    assert double_walled_share(shell) > 0.95
    assert check(shell).double_walled > 0.95, "though the inner surface looks inward by right"
    gap = together(ball(1.0), ball(1.05, inward=True))
    assert double_walled_share(gap) == 0


def test_thickness_and_winding_that_cannot_be_used_are_named():
    with pytest.raises(SettingError, match="wall = nan"):
        check(ball(1.0), wall=np.nan)
    with pytest.raises(SettingError, match="orient"):
        repair(ball(1.0, inward=True), orient=False, outer=True)


@pytest.mark.parametrize("inward", [True, False])
def test_a_chamber_of_a_ball_is_removed(inward):
    whole = ball(1.0)
    found = repair(together(ball(0.6, (0.1, 0, 0), inward), whole), outer=True)
    n = icosphere(3).n_vertices
    assert found.mesh.n_vertices == n
    assert np.array_equal(found.vertex_index, n + np.arange(n))
    assert np.array_equal(found.new_index, np.append(np.full(n, -1), np.arange(n)))
    assert found.mesh.faces.shape == whole.faces.shape
    assert found.changes[-1] == f"removed {len(whole.faces)} faces of chambers, 26.5% of the area"


def test_of_nested_balls_the_outermost_stays():
    nested = together(*(ball(radius) for radius in (0.3, 1.0, 0.6)))
    found = repair(nested, outer=True)
    assert np.array_equal(np.unique(np.linalg.norm(found.mesh.vertices, axis=1).round(6)), [1.0])


def test_the_inner_wall_of_a_capsule_with_windows_goes_and_the_outer_stays():
    capsule = shell("capsule", 0.03, 0)
    to_axis = capsule.rest.vertices - np.clip(capsule.rest.vertices[:, 2:], -0.3, 0.3) * [0, 0, 1]
    radius = np.linalg.norm(to_axis, axis=1)
    inner, outer = radius < 0.22, radius > 0.28
    found = repair(capsule.mesh, outer=True, opening=0.15)
    kept = found.new_index >= 0
    assert kept[outer].mean() > 0.99
    assert kept[inner].mean() < 0.05
    assert np.array_equal(found.mesh.vertices, capsule.mesh.vertices[found.vertex_index])
    corners = found.vertex_index[found.mesh.faces]
    assert np.array_equal(corners, capsule.mesh.faces[found.face_index])
    assert not repair(found.mesh, outer=True, opening=0.15).changes, "once is enough"


def test_windows_that_are_larger_than_the_opening_are_looked_through():
    mesh = shell("capsule", 0.03, 0).mesh
    assert not inner_faces(mesh, 0.05).any()
    assert inner_faces(mesh, 0.15).mean() > 0.3


def test_values_stay_with_their_vertices_and_faces():
    mesh = together(ball(0.6, inward=True), ball(1.0))
    point = Attribute("height", "point", "scalar", mesh.vertices[:, 2])
    face = Attribute("part", "face", "label", np.repeat([1, 2], mesh.n_faces // 2))
    asset = repair(Asset.of_mesh(mesh, [point, face]), outer=True).asset
    assert np.array_equal(asset.attribute("height", "point").values, asset.points[:, 2])
    assert (asset.attribute("part", "face").values == 2).all()


def test_an_opening_has_a_size():
    with pytest.raises(SettingError, match="opening = 0 is no size"):
        repair(ball(1.0), outer=True, opening=0)


@pytest.mark.long
def test_skulls_are_double_walled_and_lose_their_inside():
    skull = np.load(real_file("real/mouse20k_A_J.npz"))
    mesh = Mesh(skull["vertices"], skull["faces"])
    assert check(mesh).double_walled > 0.5
    share = mesh.face_areas[inner_faces(mesh)].sum() / mesh.area
    assert 0.2 < share < 0.4
