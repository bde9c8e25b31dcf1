"""The report in a browser, used by clicking: nothing is loaded, nothing complained about, and it does what it says."""

import dataclasses
from io import BytesIO

import matplotlib.image
import numpy as np
import pytest
from scipy.spatial import KDTree

from browser_pages import DESKTOP, PHONE, settled
from isomatch import Config, Mesh, Outcome, Quality
from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, MatchResult
from isomatch.visualization import write_landmark_picker, write_report
from shapes import icosphere

pytestmark = pytest.mark.usefixtures("narrow_reports")
SOURCE_POINTS = [(275, 250), (275, 150), (290, 350)]  # of the canvas at desktop width
TARGET_POINTS = [(800, 250), (800, 150), (815, 350)]


@pytest.fixture(scope="module")
def shape():
    """An ellipsoid that stands upright, with three different axes."""
    sphere = icosphere(3)
    return Mesh(sphere.vertices * [1.0, 2.0, 0.6], sphere.faces)


@pytest.fixture(scope="module")
def flipped(shape):
    """A result whose map exchanges front and back, left and right; the alternative is the identity."""
    half_turn = KDTree(shape.vertices).query(shape.vertices * [-1.0, 1.0, -1.0])[1]
    identity = Correspondence(np.arange(shape.n_vertices), shape.n_vertices)
    return MatchResult(
        map=Correspondence(half_turn, shape.n_vertices),
        outcome=Outcome.SYMMETRY_AMBIGUOUS,
        quality=Quality(0.3, 1.0, 1.0, 0.1, 1.0, 0.9, 0.01, 0.02, 1.0, 1.0, np.nan, np.nan),
        expected_error=0.1 * shape.vertices[:, 0] ** 2,
        alternatives=(Alternative(lambda: identity, 0.1, 1.0, "flip"),),
        timings={"total": 1.0},
        notes=(),
        engine="fast_marching",
        origin="extremities",
        reason="least spectral residual",
        config=Config(),
        seed=0,
    )


@pytest.fixture(scope="module")
def report(browser, shape, flipped, tmp_path_factory):
    path = tmp_path_factory.mktemp("browser") / "report.html"
    confidence = shape.vertices[:, 1]
    write_report(
        path,
        shape,
        shape,
        flipped,
        names=("a.ply", "b.ply"),
        layers={"confidence": confidence},
        command="isomatch match a.ply b.ply -o out --landmarks landmarks.txt --force",
    )
    return path


def panes(page):
    """Both halves of the 3D view, as arrays of colours, without their names."""
    settled(page)
    page.mouse.move(0, 0)
    pixels = matplotlib.image.imread(BytesIO(page.locator("#view").screenshot()))[..., :3]
    height, width = pixels.shape[0] - 40, pixels.shape[1] // 2
    return pixels[:height, :width], pixels[:height, -width:]


def difference(a, b):
    return float(np.abs(a - b).mean())


def pick(page, points):
    for x, y in points:
        page.locator("#view").click(position={"x": x, "y": y})
    settled(page)


@pytest.mark.long
def test_a_flipped_map_is_seen_as_in_the_files_and_hidden_when_turned_by_the_map(report, visit):
    page = visit(report)
    as_filed = difference(*panes(page))
    page.check("#turned")
    turned = difference(*panes(page))
    assert as_filed > 0.02 > 4 * turned
    page.select_option("#which", "alternative 1")
    page.uncheck("#turned")
    assert difference(*panes(page)) < turned + 0.002


@pytest.mark.long
def test_layers_checker_and_wireframe_change_what_is_drawn(report, visit):
    page = visit(report)
    assert page.locator("#layer option").all_text_contents() == [
        "position",
        "stretch",
        "expected error",
        "confidence",
    ]
    drawn = {"position": panes(page)[0]}
    for name in ("stretch", "expected error", "confidence"):
        page.select_option("#layer", name)
        drawn[name] = panes(page)[0]
        assert page.locator("#legend").is_visible()
    page.locator("#view").hover(position={"x": 275, "y": 250})
    settled(page)
    assert ", confidence " in page.text_content("#status")
    page.select_option("#layer", "position")
    assert not page.locator("#legend").is_visible()
    for box in ("checker", "wire"):
        page.check(f"#{box}")
        drawn[box] = panes(page)[0]
        page.uncheck(f"#{box}")
    names = list(drawn)
    for k, name in enumerate(names):
        for other in names[:k]:
            assert difference(drawn[name], drawn[other]) > 0.003, (name, other)
    assert difference(panes(page)[0], drawn["position"]) == 0
    page.select_option("#which", "alternative 1")
    assert page.locator("#layer option").all_text_contents() == ["position", "stretch"]


@pytest.mark.long
def test_landmarks_are_picked_listed_kept_saved_and_removed(report, visit, tmp_path):
    page = visit(report)
    pick(page, SOURCE_POINTS)
    assert [line[-1] for line in page.input_value("#noted").splitlines()] == ["t", "?", "?", "?"]
    pick(page, TARGET_POINTS)
    listed = page.input_value("#noted")
    rows = np.array([line.split(", ") for line in listed.splitlines()[1:]], dtype=int)
    assert rows.shape == (3, 2)
    assert (np.sort(rows, axis=0)[1:] != np.sort(rows, axis=0)[:-1]).all()
    assert page.text_content("#command").endswith("-o out --landmarks landmarks.txt --force")
    assert page.locator(".pin").count() == 6
    assert page.locator(".pin text").all_text_contents() == list("112233")
    with page.expect_download() as download:
        page.click("#save")
    assert download.value.suggested_filename == "landmarks.txt"
    download.value.save_as(tmp_path / "landmarks.txt")
    assert (tmp_path / "landmarks.txt").read_text() == listed

    page.reload()
    settled(page)
    assert page.input_value("#noted") == listed
    assert page.locator(".pin").count() == 6
    page.fill("#noted", f"{listed}five, 6\n{rows[0, 0]}, ?\n")
    settled(page)
    assert "Line 5 is not a pair" in page.text_content("#problem")
    assert page.locator(".pin").count() == 7
    page.click("#undo")
    settled(page)
    assert page.input_value("#noted") == listed
    assert page.locator(".pin").count() == 6
    assert page.is_disabled("#undo")
    page.click("#clear")
    settled(page)
    assert page.locator(".pin").count() == 0


@pytest.mark.long
def test_looking_at_a_map_picks_nothing(report, visit):
    page = visit(report)
    page.uncheck("#picking")
    pick(page, SOURCE_POINTS[:1])
    assert page.locator(".pin").count() == 0
    assert "→ target vertex" in page.text_content("#status")


@pytest.mark.long
def test_without_a_map_the_report_is_a_picker(shape, visit, tmp_path):
    path = tmp_path / "report.html"
    write_landmark_picker(path, shape, shape, "no map keeps the orientation", landmarks=[[3, 4], [5, 10**6]])
    page = visit(path)
    assert page.text_content("#outcome") == "No map was found"
    assert "No map keeps the orientation" in page.text_content("#advice")
    assert page.locator(".pin").count() == 2
    assert min(np.ptp(pane) for pane in panes(page)) > 0.2
    pick(page, [SOURCE_POINTS[0], TARGET_POINTS[0]])
    assert page.locator(".pin").count() == 4
    for hidden in ("#which", "#layer", "#checker", "#turned", "#flat"):
        assert not page.locator(hidden).is_visible()


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_nothing_sticks_out_or_overlaps(report, visit, viewport, scheme):
    page = visit(report, viewport, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    boxes = [item.bounding_box() for item in page.locator(".tools > :visible").all()]
    for k, a in enumerate(boxes):
        for b in boxes[:k]:
            apart = a["x"] >= b["x"] + b["width"] or b["x"] >= a["x"] + a["width"]
            assert apart or a["y"] >= b["y"] + b["height"] or b["y"] >= a["y"] + a["height"]
    brightness = "(name) => getComputedStyle(document.body)[name].match(/\\d+/g).reduce((sum, c) => sum + Number(c), 0)"
    ink, ground = (page.evaluate(brightness, name) for name in ("color", "backgroundColor"))
    assert (ink > ground) == (scheme == "dark")


@pytest.mark.long
def test_a_converged_map_hides_the_list_until_picking(shape, flipped, visit, tmp_path):
    path, still = tmp_path / "report.html", tmp_path / "map.png"
    matplotlib.image.imsave(still, np.ones((4, 8, 3)))
    converged = dataclasses.replace(flipped, outcome=Outcome.CONVERGED, alternatives=())
    write_report(path, shape, shape, converged, picture=still)
    page = visit(path)
    assert not page.locator("#landmarks").is_visible()
    page.check("#picking")
    assert page.locator("#landmarks").is_visible()


def test_an_answer_to_a_question_is_one_click(report, visit):
    page = visit(report)
    letters = page.locator("ol.asked li").first.locator("button")
    assert letters.all_inner_texts() == ["A", "B", "elsewhere"]
    letters.nth(1).hover()
    settled(page)
    assert page.locator("#link").get_attribute("visibility") == "visible"
    vertex, place = letters.nth(1).get_attribute("data-pair").split(",")
    letters.nth(1).click()
    assert page.locator("#noted").input_value() == f"# source, target\n{vertex}, {place}\n"
    assert page.locator("#which").input_value() == "alternative 1"
    letters.nth(2).click()
    assert page.locator("#noted").input_value() == f"# source, target\n{vertex}, ?\n"
