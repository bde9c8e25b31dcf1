"""The report: one whole file, nothing from outside, and what it shows is what was found."""

import dataclasses
import json
import re
import shutil
import subprocess
from base64 import b64decode
from functools import partial
from html import escape
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, Quality, judge
from isomatch._core.errors import DescriptorError, LandmarkError
from isomatch.correspondence import Correspondence
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import Alternative, DoubtfulRegion, MatchResult
from isomatch.visualization import (
    HEADLINES,
    position_colours,
    report,
    summary_of,
    write_judgement,
    write_report,
)
from isomatch.visualization.colours import to_screen
from isomatch.visualization.measures import MEASURES, quality_bounds, quality_measures
from isomatch.visualization.scene import scene_of, stretch
from isomatch.visualization.summary import describe_alternative, describe_alternatives, share_elsewhere

pytestmark = pytest.mark.usefixtures("narrow_reports")
HOSTILE = '</title><script>alert("x")</script>&amp;$scene ${title} \\.ply'
VOID = {"meta", "img", "br", "line", "circle", "input"}


class Page(HTMLParser):
    """Elements of a page in order, with their text; fails where they are not properly nested."""

    def __init__(self, text):
        super().__init__()
        self.open, self.found = [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        element = {"tag": tag, "text": "", **dict(attributes)}
        self.found.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_startendtag(self, tag, attributes):
        self.found.append({"tag": tag, "text": "", **dict(attributes)})

    def handle_endtag(self, tag):
        assert self.open.pop()["tag"] == tag

    def handle_data(self, data):
        for element in self.open:
            element["text"] += data

    def by_id(self, name):
        (element,) = (element for element in self.found if element.get("id") == name)
        return element

    def all(self, tag):
        return [element for element in self.found if element["tag"] == tag]


@pytest.fixture(scope="module")
def pair():
    source, target = example_pair()
    truth = Correspondence(ground_truth(source, target).vertices, target.mesh.n_vertices)
    return source.mesh, target.mesh, truth


@pytest.fixture(scope="module")
def result(pair):
    """A result made by hand: no match is run here."""
    _, target, truth = pair
    unmatched = truth.vertices.copy()
    unmatched[:7] = -1
    quality = Quality(
        0.71,
        float("inf"),
        float("inf"),
        0.16,
        1.0,
        0.98,
        0.0186,
        0.0478,
        0.994,
        0.9,
        float("nan"),
        float("nan"),
    )
    other = Correspondence(np.roll(truth.vertices, 1), target.n_vertices)
    return MatchResult(
        map=Correspondence(unmatched, target.n_vertices),
        outcome=Outcome.LOW_CONFIDENCE,
        quality=quality,
        expected_error=np.where(unmatched < 0, np.nan, 0.01),
        alternatives=(Alternative(lambda: other, 0.125, -0.5, "a <bold> guess"),),
        timings={"prepare": 1.25, "total": 2.5},
        notes=("source: left out <7> vertices",),
        engine="fast_marching",
        origin="flip",
        reason="least spectral residual",
        config=Config(rank=48),
        seed=17,
    )


@pytest.fixture(scope="module")
def written(pair, result, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, *pair[:2], result, names=(HOSTILE, "target.ply"), facts={"source": HOSTILE})
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(written):
    return Page(written)


def unpacked(text, dtype, columns=1):
    values = np.frombuffer(b64decode(text), dtype)
    return values if columns == 1 else values.reshape(-1, columns)


@pytest.mark.long
def test_the_report_is_whole_small_and_loads_nothing(written, page):
    assert len(written) < 5e6
    assert "default-src 'none'" in written
    assert not re.search(r"https?:|//[\w-]+\.\w|@import|url\(|\bfetch\(|XMLHttpRequest|\bimport\(", written)
    for element in page.found:
        assert element.get("src", "data:").startswith("data:")
        assert "href" not in element
        assert element["tag"] not in ("link", "iframe", "object", "embed", "base")
    names = [element["id"] for element in page.found if "id" in element]
    assert len(names) == len(set(names))


def test_the_script_asks_only_for_elements_that_are_there(page):
    script = "".join(each["text"] for each in page.all("script")[-3:])
    asked = set(re.findall(r'(?:by|getElementById)\("(\w+)"\)', script))
    for names in re.findall(r"\[([^\[\]]*)\]\.map\(by\)", script):
        asked |= set(re.findall(r'"(\w+)"', names))
    assert {"view", "scene", "dot1", "save", "reset"} <= asked
    for name in asked | {"name0", "name1", "vertex", "fragment"}:
        page.by_id(name)


def test_what_the_user_named_is_shown_and_never_obeyed(written, page):
    assert page.all("title")[0]["text"] == f"isomatch: {HOSTILE} → target.ply"
    assert page.by_id("name0")["text"] == f"source: {HOSTILE}"
    assert HOSTILE in [cell["text"] for cell in page.all("td")]
    assert len(page.all("script")) == 7
    assert "<script>alert" not in written
    for text in ("a <bold> guess", "left out <7> vertices"):
        assert text not in written
        assert escape(text) in written


def test_outcome_numbers_and_settings_are_those_of_the_result(page, result):
    assert page.by_id("outcome")["text"] == summary_of(result).headline
    assert page.by_id("advice")["text"] == summary_of(result).advice_in_python
    rows = [row["text"] for row in page.all("tr")]
    for start in ("spectral residual0.71at most 0.66 (violated)", "best alternativenoneat least 1.25 ×"):
        assert any(row.startswith(start) for row in rows)
    assert any(row.startswith("orientation0.98at least 0.65Whether") for row in rows)
    for row in ("rank48", "seed17", "total2.50", "geodesic enginefast_marching", "winning startflip"):
        assert row in rows
    assert not any(row.startswith("landmark error") for row in rows)
    (caption,) = (element["text"] for element in page.all("figcaption"))
    assert re.fullmatch(
        r"Alternative 1 Differs on \d+% of the surface\. Exchanges left and right in .*", caption
    )
    assert [option["text"] for option in page.all("option")] == ["the map", "alternative 1"]
    soft = " ".join(element["text"] for element in page.all("p"))
    assert "Grey: 7 source vertices" in soft
    assert "Source: left out <7> vertices" in soft
    assert "--landmarks" in page.by_id("command")["text"]
    assert "hidden" not in page.by_id("landmarks")
    assert "simplified" not in soft


def test_pictures_are_embedded(page):
    images = [b64decode(image["src"].removeprefix("data:image/png;base64,")) for image in page.all("img")]
    assert [image[:8] for image in images] == [b"\x89PNG\r\n\x1a\n"] * 2
    assert len(images[0]) > len(images[1])


def test_embedded_arrays_are_the_shapes_and_the_map(page, pair, result):
    scene = json.loads(page.by_id("scene")["text"])
    for side, mesh in zip(("source", "target"), pair):
        stored = scene[side]
        np.testing.assert_array_equal(unpacked(stored["index"], "<u4"), np.arange(mesh.n_vertices))
        np.testing.assert_array_equal(unpacked(stored["faces"], "<u2", 3), mesh.faces)
        points = unpacked(stored["vertices"], "<f4", 3).astype(float)
        np.testing.assert_allclose(
            lengths(points, mesh.edges) * np.sqrt(mesh.area), lengths(mesh.vertices, mesh.edges), rtol=1e-3
        )
        assert Mesh(points, mesh.faces).volume * mesh.area**1.5 == pytest.approx(mesh.volume, rel=1e-3)
    best, other = scene["maps"]
    images = unpacked(best["images"], "<i4")
    np.testing.assert_array_equal(images, result.map.vertices)
    at_target = unpacked(scene["target"]["vertices"], "<f4", 3)
    np.testing.assert_array_equal(unpacked(best["points"], "<f4", 3)[7:], at_target[images[7:]])
    np.testing.assert_array_equal(unpacked(other["images"], "<i4"), result.alternatives[0].map.vertices)
    colours = unpacked(scene["target"]["colours"], "u1", 3)
    np.testing.assert_allclose(colours / 255, to_screen(position_colours(pair[1])), atol=0.5 / 255 + 1e-9)
    np.testing.assert_array_equal(unpacked(best["colours"], "u1", 3)[7:], colours[images[7:]])
    assert np.ptp(unpacked(best["colours"], "u1", 3)[:7]) == 0


def lengths(points, edges):
    return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)


def test_a_large_shape_is_simplified_and_its_vertices_stay_what_they_are(pair):
    source, target, truth = pair
    whole = scene_of(source, target, {"map": truth})
    thin = scene_of(source, target, {"map": truth}, most=600)
    for side in ("source", "target"):
        index = unpacked(thin[side]["index"], "<u4")
        assert 400 < len(index) == thin[side]["n_shown"] <= 600
        assert len(set(index)) == len(index)
        points = unpacked(thin[side]["vertices"], "<f4", 3)
        np.testing.assert_array_equal(points, unpacked(whole[side]["vertices"], "<f4", 3)[index])
        faces = unpacked(thin[side]["faces"], "<u2", 3)
        assert faces.max() < len(index)
        assert (np.diff(np.sort(faces, axis=1), axis=1) > 0).all()
        mesh = pair[0] if side == "source" else pair[1]
        assert Mesh(points, faces).area == pytest.approx(1.0, rel=0.1)
        unit_volume = mesh.volume / mesh.area**1.5
        assert Mesh(points, faces).volume == pytest.approx(unit_volume, rel=0.1)
    index = unpacked(thin["source"]["index"], "<u4")
    np.testing.assert_array_equal(unpacked(thin["maps"][0]["images"], "<i4"), truth.vertices[index])


def test_the_report_says_that_a_shape_was_simplified(pair, result, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "scene_of", partial(scene_of, most=3000))
    converged = dataclasses.replace(result, outcome=Outcome.CONVERGED, alternatives=(), map=pair[2], notes=())
    (tmp_path / "still.png").write_bytes(b"a picture")
    write_report(tmp_path / "report.html", *pair[:2], converged, picture=tmp_path / "still.png")
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    told = " ".join(element["text"] for element in page.all("p"))
    assert re.search(r"target is simplified to [\d,]+ of its 3,242 vertices", told)
    assert "source is simplified" not in told
    assert "hidden" in page.by_id("landmarks")
    assert "Other maps" not in [each["text"] for each in page.all("h2")]
    assert "Nothing was repaired" in told
    assert page.by_id("outcome")["text"] == HEADLINES[Outcome.CONVERGED]
    assert b64decode(page.all("img")[0]["src"].split(",")[1]) == b"a picture"


def test_the_map_that_was_given_is_shown_and_drawn_with_the_alternatives(pair, result, tmp_path):
    source, target, truth = pair
    moved = dataclasses.replace(result, map=Correspondence(np.roll(truth.vertices, 900), target.n_vertices))
    write_report(tmp_path / "report.html", source, target, moved, given=truth)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    names = ["the map", "alternative 1", "the map that was given"]
    assert [each["text"] for each in page.all("option")][: len(names)] == names
    scene = json.loads(page.by_id("scene")["text"])["maps"]
    assert [each["name"] for each in scene] == names
    shown = unpacked(json.loads(page.by_id("scene")["text"])["source"]["index"], "<u4")
    np.testing.assert_array_equal(unpacked(scene[2]["images"], "<i4"), truth.vertices[shown])
    first, *_ = (each["text"] for each in page.all("figcaption"))
    assert re.fullmatch(r"The map that was given Differs on (\d\d|100)% of the surface\.", first)


def test_the_page_of_a_judgement_has_the_map_that_was_judged_beside_the_own_one(pair, result, tmp_path):
    source, target, truth = pair
    wrong = np.roll(truth.vertices, 900)
    judged = dataclasses.replace(judge(source, target, wrong, reference=truth), result=result)
    write_judgement(tmp_path / "page.html", source, target, judged)
    page = Page((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert page.by_id("outcome")["text"].startswith("Wrong: it differs from the reference")
    assert "isomatch's own" in page.by_id("sureness")["text"]
    cells = [each["text"] for each in page.all("td") if each.get("data-is") in ("vertex", "other image")]
    assert len(cells) == 2 * len(judged.regions) > 0
    assert [int(cell) for cell in cells[1::2]] == [wrong[int(vertex)] for vertex in cells[::2]]


def test_every_measure_of_quality_has_words():
    assert {field.name for field in dataclasses.fields(Quality)} == set(MEASURES)
    assert all(measure.name and measure.meaning.endswith(".") for measure in MEASURES.values())


def test_a_mirror_image_that_was_wanted_is_no_evidence_against_the_map(result):
    mirrored = dataclasses.replace(result.quality, orientation=-0.98)
    for wanted, against in (("preserve", True), ("reverse", False)):
        config = dataclasses.replace(result.config, orientation=wanted)
        measured = quality_measures(dataclasses.replace(result, quality=mirrored, config=config))
        assert [bad for measure, _, bad in measured if measure.name == "orientation"] == [against]


def test_a_part_is_held_to_bounds_of_its_own(result):
    complete, bounds = quality_bounds(result), result.config.parts
    part = dataclasses.replace(result.quality, stress=0.01, doubt=2 * bounds.poor_doubt)
    of_part = dataclasses.replace(result, quality=part, way="part")
    held = quality_bounds(of_part)
    assert complete["spectral_residual"] == {"most": result.config.outcome.poor_spectral_residual}
    assert held["doubt"] == {"most": bounds.poor_doubt}
    assert held["runner_up"] == {"least": bounds.tie}
    assert (
        not {"spectral_residual", "orientation", "residual", "stretch", "torn_off", "mirrored"} & held.keys()
    )
    against = {measure.name for measure, _, bad in quality_measures(of_part) if bad}
    assert MEASURES["doubt"].name in against


@pytest.mark.long
def test_layers_are_levels_between_their_ends_and_grey_without_a_value(pair, result, tmp_path):
    source, target, _ = pair
    values = np.linspace(4.0, 5.0, source.n_vertices)
    values[:9] = np.nan, np.inf, -np.inf, -100.0, 1e9, *np.full(4, np.nan)
    write_report(tmp_path / "report.html", source, target, result, layers={"<b>": values})
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    first, other = json.loads(page.by_id("scene")["text"])["maps"]
    assert [list(each["layers"]) for each in (first, other)] == [
        ["stretch", "expected error", "<b>"],
        ["stretch"],
    ]
    layer = first["layers"]["<b>"]
    levels = unpacked(layer["levels"], "u1")
    assert list(levels[:5]) == [255, 255, 255, 0, 254]
    shown = layer["low"] + levels[9:] / 254 * (layer["high"] - layer["low"])
    np.testing.assert_allclose(shown, np.clip(values[9:], layer["low"], layer["high"]), atol=0.01)
    assert 4.0 < layer["low"] < 4.1
    assert 4.9 < layer["high"] < 5.0


@pytest.mark.long
def test_regions_of_doubt_are_listed_and_shown(pair, result, tmp_path):
    source, target, _ = pair
    regions = (
        DoubtfulRegion(np.array([30, 10]), 0.0834, "another <map>", np.array([77, 78])),
        DoubtfulRegion(np.array([50]), 0.021, "it looks unlike its image"),
    )
    write_report(tmp_path / "report.html", source, target, dataclasses.replace(result, regions=regions))
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    cells = [each["text"] for each in page.found if each["tag"] == "td"]
    at = cells.index("8.3%")
    assert cells[at : at + 8] == [
        *("8.3%", "30", "77", "another <map>"),
        *("2.1%", "50", "", "it looks unlike its image"),
    ]
    scene = json.loads(page.by_id("scene")["text"])
    shown = unpacked(scene["source"]["index"], "<u4")
    levels = unpacked(scene["maps"][0]["layers"]["doubt"]["levels"], "u1")
    assert set(shown[levels != 255]) == {10, 30, 50}


def test_without_doubt_there_is_no_list_of_regions(page):
    assert "Regions of doubt" not in [each["text"] for each in page.all("h2")]
    assert "doubt" not in json.loads(page.by_id("scene")["text"])["maps"][0]["layers"]


def test_the_stretch_of_a_similarity_is_one_and_of_a_scaled_part_its_scale(pair):
    mesh = pair[0]
    itself = Correspondence(np.arange(mesh.n_vertices), mesh.n_vertices)
    np.testing.assert_allclose(stretch(mesh, mesh.moved(3 * mesh.vertices), itself).values, 1.0)
    x = mesh.vertices[:, 0]
    far = x > np.quantile(x, 0.8)
    grown = mesh.vertices * np.where(far, 1.5, 1.0)[:, None]
    values = stretch(mesh, mesh.moved(grown), itself).values
    inner = far & ~np.isin(np.arange(mesh.n_vertices), mesh.edges[far[mesh.edges].sum(axis=1) == 1])
    np.testing.assert_allclose(values[inner], 1.5)
    assert np.median(values[~far]) == 1.0


@pytest.mark.parametrize("name", ["position", "stretch", "expected error", "doubt"])
def test_a_layer_takes_no_name_of_another(pair, result, name, tmp_path):
    source, target, _ = pair
    with pytest.raises(DescriptorError, match=f"a layer '{name}' of its own"):
        write_report(
            tmp_path / "report.html", source, target, result, layers={name: np.zeros(source.n_vertices)}
        )


@pytest.mark.parametrize("values", [np.zeros(7), np.zeros((2968, 1)), ["a"] * 2968])
def test_a_layer_needs_one_number_for_each_source_vertex(pair, result, values, tmp_path):
    with pytest.raises(DescriptorError, match="layer 'error'"):
        write_report(tmp_path / "report.html", *pair[:2], result, layers={"error": values})
    with pytest.raises(LandmarkError, match="expected rows"):
        write_report(tmp_path / "report.html", *pair[:2], result, landmarks=[1.5, 2.5])
    assert not list(tmp_path.iterdir())


def test_the_source_returns_to_how_it_lies_in_its_file(pair):
    source, target, truth = pair
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    lying, upright = (
        scene_of(source.moved(source.vertices @ turn.T), target, {"map": truth})
        for turn in (quarter, np.eye(3))
    )
    filed = np.reshape(lying["filed"], (3, 3))
    np.testing.assert_allclose(filed @ filed.T, np.eye(3), atol=1e-12)
    assert np.trace(filed) == pytest.approx(1.0)
    np.testing.assert_allclose(np.reshape(upright["filed"], (3, 3)), np.eye(3), atol=1e-12)
    seen = [unpacked(scene["source"]["vertices"], "<f4", 3) for scene in (lying, upright)]
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-6)


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_the_script_is_sound_javascript():
    script = "".join(
        (files("isomatch.visualization") / name).read_text(encoding="utf-8")
        for name in ("landmarks.js", "report.js", "work.js")
    )
    done = subprocess.run(["node", "--check", "-"], input=script, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("runner_up", "mirrored", "words"),
    [
        (np.inf, np.inf, "No other map came near"),
        (1.0, np.inf, "Another map fits as well"),
        (0.9, np.inf, "Another map fits better"),
        (2.04, np.inf, "The best other map fits 2.0 times worse"),
        (np.inf, 0.4, "A mirror image fits better"),
        (np.inf, 1.2, "A mirror image fits about as well"),
        (np.nan, np.nan, "If the map above looks wrong"),
    ],
)
def test_alternatives_are_told_by_how_near_they_come(result, runner_up, mirrored, words):
    quality = dataclasses.replace(result.quality, runner_up=runner_up, mirrored=mirrored)
    assert describe_alternatives(dataclasses.replace(result, quality=quality)).startswith(words)


@pytest.mark.parametrize(
    ("orientation", "words"), [(0.9, "Keeps left and right"), (0.3, "in places"), (-0.9, "Mirror image")]
)
def test_an_alternative_is_told_by_where_it_goes(pair, result, orientation, words):
    source, target, _ = pair
    same = Alternative(lambda: result.map, 0.1, orientation, "flip")
    told = describe_alternative(source, target, result, same)
    assert told.startswith("Differs on 0% of the surface. ")
    assert words in told
    former = dataclasses.replace(same, energy=np.nan, orientation=np.nan)
    assert describe_alternative(source, target, result, former).startswith(
        "The map before this one was chosen. Differs on 0%"
    )


def test_where_an_alternative_goes_does_not_depend_on_the_unit(pair, result):
    """Not even where areas vanish: a shape of 1e-200 has a report, too."""
    source, target, _ = pair
    turned = Correspondence(np.roll(result.map.vertices, 100), target.n_vertices)
    tiny = [mesh.moved(1e-200 * mesh.vertices) for mesh in (source, target)]
    share = share_elsewhere(source, target, result.map, turned)
    assert 0.1 < share < 1
    assert share_elsewhere(*tiny, result.map, turned) == pytest.approx(share, rel=1e-6)
