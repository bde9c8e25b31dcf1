"""What the page to work in shows of a result, and that maps which come later are drawn like those of a report."""

import dataclasses
import json
from base64 import b64decode

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, Quality
from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, DoubtfulRegion, MatchResult
from isomatch.visualization import HEADLINES, WorkPage, summary_of
from isomatch.visualization.scene import DrawnPair, scene_of
from shapes import icosphere

QUARTER = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


@pytest.fixture(scope="module")
def shape():
    sphere = icosphere(3)
    return Mesh(sphere.vertices * [1.0, 2.0, 0.6], sphere.faces)


def identity(shape):
    return Correspondence(np.arange(shape.n_vertices), shape.n_vertices)


def half_turned(shape):
    """The map by half a turn about the long axis."""
    turned = shape.vertices * [-1.0, 1.0, -1.0]
    apart = np.linalg.norm(turned[:, None] - shape.vertices, axis=2)
    return Correspondence(apart.argmin(axis=1), shape.n_vertices)


@pytest.fixture(scope="module")
def result(shape):
    other = half_turned(shape)
    return MatchResult(
        map=identity(shape),
        outcome=Outcome.SYMMETRY_AMBIGUOUS,
        quality=Quality(0.3, 1.0, 1.0, 0.1, 1.0, 0.9, 0.01, 0.02, 1.0, 1.0, np.nan, np.nan),
        expected_error=np.where(shape.vertices[:, 1] > 0, 0.01, 0.2),
        alternatives=(Alternative(lambda: other, 0.1, 1.0, "<flip>"),),
        timings={"total": 1.0},
        notes=("a < b",),
        engine="fast_marching",
        origin="extremities",
        reason="least spectral residual",
        config=Config(),
        seed=0,
        regions=(DoubtfulRegion(np.array([7, 8]), 0.125, "it looks unlike its image", np.array([9, 10])),),
    )


def unpacked(text, dtype):
    return np.frombuffer(b64decode(text), dtype)


def test_maps_that_come_later_are_drawn_as_those_of_a_report(shape):
    lying = shape.moved(shape.vertices @ QUARTER)
    at_once, drawn = scene_of(lying, shape, {"map": identity(shape)}), DrawnPair(lying, shape)
    before, later = drawn.shapes(), drawn.maps({"map": identity(shape)}, {})
    for name in ("images", "points", "normals", "colours"):
        assert later["maps"][0][name] == at_once["maps"][0][name]
    assert later["filed"] == at_once["filed"]
    assert before["target"] == at_once["target"]
    np.testing.assert_allclose(np.reshape(before["filed"], (3, 3)), np.eye(3), atol=1e-12)
    filed = np.reshape(at_once["filed"], (3, 3))
    assert np.trace(filed) < 2
    own, turned = (unpacked(each["source"]["vertices"], "<f4").reshape(-1, 3) for each in (before, at_once))
    np.testing.assert_allclose(own, turned @ filed.T, atol=1e-6)


def test_what_is_told_of_a_result(shape, result):
    pairs = [[3, 3], [5, 5], [7, 600]]
    told = WorkPage(shape, shape).result(result, None, pairs)
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    assert (told["headline"], told["since"]) == (HEADLINES[Outcome.SYMMETRY_AMBIGUOUS], "")
    assert told["sure"] == summary_of(result).sureness
    assert told["regions"] == [
        {"area": "12.5%", "vertex": 7, "image": 7, "runner_up": 9, "reason": "it looks unlike its image"}
    ]
    assert [each["name"] for each in told["runners_up"]] == ["the map", "alternative 1"]
    assert "Keeps left and right" in told["runners_up"][1]["about"]
    assert [each["name"] for each in told["scene"]["maps"]] == ["the map", "alternative 1"]
    far = np.linalg.norm(shape.vertices[7] - shape.vertices[600]) / np.sqrt(shape.area)
    assert [each["off"] for each in told["landmarks"]] == pytest.approx([0, 0, far])
    assert "A &lt; b" in told["details"]
    assert "doubt" in told["scene"]["maps"][0]["layers"]
    assert list(told["scene"]["maps"][1]["layers"]) == ["stretch"]


def test_how_much_has_changed(shape, result):
    page, other = WorkPage(shape, shape), half_turned(shape)
    assert page.result(result, result.map)["since"] == "It is the same map as before."
    told = page.result(result, other)
    apart = np.linalg.norm(shape.vertices - shape.vertices[other.vertices], axis=1) > 0.05 * np.sqrt(
        shape.area
    )
    share = shape.vertex_areas[apart].sum() / shape.vertex_areas.sum()
    assert f"{share:.1%} of the source has another image" in told["since"]
    assert told["runners_up"][-1] == {
        "name": "before",
        "origin": "",
        "about": f"The map that this one replaced. Differs on {share:.0%} of the surface.",
    }


def test_what_has_no_image_is_told(shape, result):
    images = np.where(shape.vertices[:, 1] > 0, -1, np.arange(shape.n_vertices))
    partial = dataclasses.replace(result, map=Correspondence(images, shape.n_vertices), alternatives=())
    told = WorkPage(shape, shape).result(partial, result.map, [[int(np.argmax(images < 0)), 0]])
    assert "of the source's points and" in told["sure"]
    assert told["landmarks"][0]["off"] == -1
    json.dumps(told, allow_nan=False)


def test_regions_of_a_simplified_shape_are_told_by_vertices_that_are_shown(shape, result):
    drawn = DrawnPair(shape, shape, most=300)
    shown = unpacked(drawn.shapes()["source"]["index"], "<u4")
    assert len(shown) < shape.n_vertices
    for vertex in range(0, shape.n_vertices, 50):
        near = drawn.shown_near("source", vertex)
        assert near in shown
        apart = np.linalg.norm(shape.vertices[shown] - shape.vertices[vertex], axis=1)
        assert np.linalg.norm(shape.vertices[near] - shape.vertices[vertex]) == pytest.approx(apart.min())


def test_the_page_begins_with_the_settings_and_escapes_all_names(shape):
    page = WorkPage(shape, shape, names=("<a>.ply", "b.ply"), landmarks=[[1, 2]])
    html = page.html("<out>", Config(orientation="any", start="pose"))
    assert "<a>" not in html
    assert "<out>" not in html
    assert '"landmarks": [[1, 2]]' in html
    assert "<option selected>any</option>" in html
    assert 'id="pose" checked>' in html
    assert 'id="hold">' in html
    assert 'id="write" type="button">' in html
    assert 'id="write" type="button" hidden>' in page.html("", Config())
    assert "connect-src 'self'" in html
    assert "https:" not in html.replace("http-equiv", "")
