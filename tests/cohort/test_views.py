"""What is looked at of a cohort: thumbnails, the pages of shapes in 3D with their landmarks, sliders for modes."""

import json
import re
from base64 import b64decode
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.spatial.transform import Rotation

from browser_pages import PHONE, settled
from corresponded import ellipsoids
from isomatch import Landmarks, Mesh, read_mesh, write_mesh
from isomatch.cli import main
from isomatch.cohort import finish, shape_statistics, write_landmark_tables
from isomatch.cohort.finish import _draw
from isomatch.cohort.landmarks import Semilandmarks, _least_sure
from isomatch.cohort.specimen_page import Specimen, write_specimen
from isomatch.landmarks import Curve, write_landmarks
from small_collections import lopsided_blob

ROWS = [3, 100, 200]


def scene_in(path):
    (text,) = re.findall(r'id="scene">(.*?)</script>', path.read_text(encoding="utf-8"))
    return json.loads(text)


def decoded(text, dtype="<f4"):
    return np.frombuffer(b64decode(text), dtype).reshape(-1, 3).astype(np.float64)


def moved_onto(points, target):
    """Points under the similarity without reflection that brings them nearest to others, by least squares."""
    at, to = points.mean(axis=0), target.mean(axis=0)
    turn = Rotation.align_vectors(target - to, points - at)[0]
    turned = turn.apply(points - at)
    return turned * ((turned * (target - to)).sum() / (turned**2).sum()) + to


@pytest.mark.parametrize("seed", range(2))
def test_a_thumbnail_is_the_same_in_whatever_pose_a_shape_was_scanned(tmp_path, seed):
    """Turned like the template, and at its scale."""
    template = lopsided_blob(3)
    shape = template.moved(template.vertices * [1.1, 0.95, 1.0])
    turn = Rotation.random(random_state=seed)
    scanned = shape.moved(turn.apply(np.array(shape.vertices)) - 3.0)
    for name, mesh in {"upright": shape, "scanned": scanned, "template": template}.items():
        _draw(template, mesh, tmp_path / f"{name}.png")
    upright, found, other = (imread(tmp_path / f"{n}.png") for n in ("upright", "scanned", "template"))
    assert found.shape == (300, 300, 4)
    assert np.abs(found - upright).mean() < 0.002  # half of a pixel at the rim, and the origin of the raster
    assert np.abs(found - other).mean() > 0.01
    inked = np.argwhere(other[..., 3] > 0)
    assert 250 < np.ptp(inked, axis=0).max() < 300


def test_the_page_of_a_shape_has_its_surface_and_its_landmarks(tmp_path):
    template = lopsided_blob(2)
    shape = template.moved(Rotation.random(random_state=5).apply(template.vertices * [1.2, 1.0, 0.9]) + 7.0)
    names, errors = ["nose", "<b>", "off", "c1", "c2"], [0.1, 0.3, np.nan, 0.2, np.nan]
    placed = np.vstack([shape.vertices[[3, 50]], np.full((1, 3), np.nan), shape.vertices[[9, 30]]])
    marks = Landmarks(placed, names, [Curve("rim", (3, 4))], errors)
    given = Landmarks(template.vertices[[50, 3]], ["<b>", "nose"])  # in another order, and fewer
    own, beside = Specimen("a <shape>", shape, shape, marks), Specimen("t", template, template, given)
    write_specimen(tmp_path / "a.html", own, beside, {"next": "b.html"}, 0.3)
    page, scene = (tmp_path / "a.html").read_text(encoding="utf-8"), scene_in(tmp_path / "a.html")
    assert "default-src 'none'" in page
    assert not re.search(r"https?:|<b>|<shape>", re.sub(r"<b>[\d.]*</b>", "", page))
    drawn, at_template = scene["marks"]["sides"]
    assert drawn["errors"] == [0.1, 0.3, None, 0.2, None]
    assert scene["marks"]["semi"] == [False, False, False, True, True]
    points = decoded(drawn["points"])
    seen = np.vstack([decoded(scene["shapes"][0]["vertices"]), points[[0, 1, 3, 4]]])
    there = np.vstack([shape.vertices, placed[[0, 1, 3, 4]]])
    np.testing.assert_allclose(moved_onto(seen, there), there, atol=1e-5)
    assert np.isnan(points[2]).all()
    assert at_template["errors"] == [None] * 5
    seen = np.vstack([decoded(scene["shapes"][1]["vertices"]), decoded(at_template["points"])[:2]])
    there = np.vstack([template.vertices, template.vertices[[3, 50]]])
    np.testing.assert_allclose(moved_onto(seen, there), there, atol=1e-5)
    assert [int(row) for row in re.findall(r'data-landmark="(\d+)"', page)] == [1, 0]
    assert "Without a place: off." in page


def test_what_is_shown_of_a_large_shape_is_simplified_and_said(tmp_path):
    large = lopsided_blob(6)
    shape = Specimen("a", large, large)
    write_specimen(tmp_path / "a.html", shape, shape, {})
    assert scene_in(tmp_path / "a.html")["shapes"][0]["n_shown"] <= 10_000
    assert re.search(r"a is simplified to [\d,]+ of its 40,962 vertices", (tmp_path / "a.html").read_text())
    assert (tmp_path / "a.html").stat().st_size < 600_000


@pytest.mark.long
def test_landmarks_of_a_collection_can_be_looked_at(copied, small, tmp_path):
    mesh = read_mesh(small.shapes / "s0.ply")
    write_landmarks(tmp_path / "s0.mrk.json", Landmarks(mesh.vertices[ROWS], ["nose", "tail", "foot"]))
    with ThreadPoolExecutor(1) as executor:
        list(finish(copied, executor, 1))
    assert 'href="views/s1.html"' in copied.layout.page.read_text()
    to = copied.layout.landmarks
    found = write_landmark_tables(
        copied.folder, tmp_path / "s0.mrk.json", to, semilandmarks=Semilandmarks(surface_points=20)
    )
    page = copied.layout.page.read_text()
    for name in copied.names:
        assert f'href="landmarks/views/{name}.html"' in page
        scene = scene_in(to / "views" / f"{name}.html")
        marks = Landmarks.read(to / f"{name}.mrk.json", copied.paths[name])
        own = read_mesh(copied.paths[name])
        assert scene["marks"]["names"] == list(marks.names)
        seen = decoded(scene["shapes"][0]["vertices"]), decoded(scene["marks"]["sides"][0]["points"])
        shown = own.vertices[np.frombuffer(b64decode(scene["shapes"][0]["index"]), "<u4")]
        there = np.vstack([shown, marks.positions])
        np.testing.assert_allclose(moved_onto(np.vstack(seen), there), there, atol=1e-4 * np.sqrt(own.area))
    assert found.look_at.endswith(".html")
    assert {*list(found.check_first)[:3]} == {"nose", "tail", "foot"}
    assert all(name.startswith("surface-") for name in list(found.check_first)[3:])


def test_the_landmarks_to_check_first_are_ones_own_and_then_semilandmarks():
    marks = Landmarks(
        np.zeros((6, 3)), [*"abcde", "surface-1"], [Curve("rim", (4,))], [0.1, 0.4, 0.3, 0.2, 5, 7]
    )
    assert list(_least_sure([marks])) == ["b", "c", "d", "surface-1", "e"]


@pytest.fixture(scope="module")
def statistics(tmp_path_factory):
    """Folder of the statistics of ellipsoids that differ in height, a shape of which is longer too."""
    folder = tmp_path_factory.mktemp("statistics")
    shapes = ellipsoids([0.8, 0.9, 1.0, 1.1, 1.3])
    (folder / "shapes").mkdir()
    for i, name in enumerate(shapes.names):
        mesh = Mesh(shapes.vertices[i] * [1.0 + 0.1 * (i == 2), 1.0, 1.0], shapes.faces)
        write_mesh(folder / "shapes" / f"{name}.ply", mesh)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shape_statistics.charts, "DPI", 60)
        assert main(["statistics", str(folder / "shapes"), "-o", str(folder / "out"), "--modes", "2"]) == 0
    return folder / "out"


def test_sliders_move_the_mean_that_is_written_to_the_meshes_that_are_written(statistics):
    scene = scene_in(statistics / "index.html")
    mean = decoded(scene["mean"]["vertices"])
    modes = [decoded(each["vertices"]) for each in scene["modes"]]
    assert len(modes) == 2
    written = read_mesh(statistics / "mean.ply")
    np.testing.assert_array_equal(
        np.frombuffer(b64decode(scene["mean"]["faces"]), "<u2").reshape(-1, 3), written.faces
    )
    size = np.sqrt(written.area)
    unit = np.linalg.norm(mean - mean[0], axis=1) * size
    np.testing.assert_allclose(
        unit, np.linalg.norm(written.vertices - written.vertices[0], axis=1), atol=1e-5 * size
    )
    for number, mode in enumerate(modes, start=1):
        for sign, word in ((-2, "minus"), (2, "plus")):
            moved = read_mesh(statistics / f"mode_{number}_{word}2sd.ply").vertices
            seen = np.vstack([mean, mean + sign * mode])
            there = np.vstack([written.vertices, moved])
            np.testing.assert_allclose(moved_onto(seen, there), there, atol=1e-5 * size)


def test_the_page_of_statistics_links_the_files(statistics):
    page = (statistics / "index.html").read_text(encoding="utf-8")
    linked = set(re.findall(r'<a href="([^"]*)"', page))
    assert {"mean.ply", "mode_1_plus2sd.ply", "aligned/e00.ply", "scores.csv", "model.npz"} <= linked
    assert all((statistics / name).exists() for name in linked)


def shot(page):
    settled(page)
    page.mouse.move(0, 0)
    return imread(BytesIO(page.locator("#view").screenshot()))[..., :3]


@pytest.mark.parametrize("size", [{"width": 1280, "height": 900}, PHONE], ids=["desktop", "phone"])
def test_a_slider_moves_by_the_keyboard_and_back_to_the_mean(statistics, visit, size):
    page = visit(statistics / "index.html", size)
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    mean = shot(page)
    page.focus("#mode1")
    for _ in range(30):
        page.keyboard.press("ArrowRight")
    assert page.locator("#mode1 + output").text_content() == "+3.0 sd"
    assert page.locator("#mode1").get_attribute("aria-valuetext") == "+3.0 sd"
    assert np.abs(shot(page) - mean).mean() > 0.02
    page.locator("#mean").click()
    assert page.locator("#mode1 + output").text_content() == "0.0 sd"
    assert np.abs(shot(page) - mean).mean() < 0.002


@pytest.mark.parametrize("size", [{"width": 1280, "height": 900}, PHONE], ids=["desktop", "phone"])
def test_landmarks_are_told_apart_in_3d(tmp_path, visit, size):
    """Those behind the surface have no number, and a click on the list turns one to the viewer."""
    blob = lopsided_blob(3)
    ends = [blob.vertices[:, axis].argmax() for axis in range(3)] + [blob.vertices[:, 2].argmin()]
    marks = Landmarks(
        blob.vertices[ends], ["side", "upper", "front", "under"], expected_error=[0.1, 0.2, 0.3, 0.4]
    )
    shape = Specimen("a", blob, blob, marks)
    write_specimen(tmp_path / "a.html", shape, shape._replace(name="t", marks=None), {}, 0.4)
    page = visit(tmp_path / "a.html", size)
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    assert page.locator(".mark:not(.far)[visibility=visible]").count() < 4
    for number, name in ((3, "front"), (4, "under")):
        page.locator(f"[data-landmark='{number - 1}']").click()
        settled(page)
        assert name in page.locator("#status").text_content()
        (chosen,) = page.locator(".mark.chosen[visibility=visible]").all()
        assert chosen.text_content() == str(number)
        assert "far" not in chosen.get_attribute("class")
    colours = {mark.get_attribute("style") for mark in page.locator(".mark").all()}
    assert len(colours) == 4 + 1  # by their errors, and white beside where there is none
