"""What notebooks show: figures, representations, the report's view, and progress; no kernel is needed for these laws."""

import base64
import json
import re
import sys
from dataclasses import replace
from html import escape, unescape
from html.parser import HTMLParser
from importlib.util import find_spec
from io import BytesIO
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread
from scipy.spatial import KDTree

from isomatch import (
    BothDirections,
    Config,
    Correspondence,
    Graph,
    Mesh,
    Outcome,
    PointCloud,
    distance_basis,
    laplace_basis,
    match,
    prepare,
    show_progress,
)
from isomatch._core.errors import DescriptorError, MapError, MeshError, MissingDependencyError, SettingError
from isomatch.matching import Alternative
from isomatch.visualization import ValuePanel, camera_of, html_of, notebook, summary_of
from shapes import icosphere
from view_results import QUALITY, map_of, result_of
from zoo import zoo

BALL = icosphere(2)
SIZES = {name: getattr(notebook, name) for name in ("PAIR_WIDTH", "ALONE_WIDTH")}
HAS_ANYWIDGET = find_spec("anywidget") is not None


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Pictures take time as their pixels do."""
    for name, wide in SIZES.items():
        monkeypatch.setattr(notebook, name, wide // 3)


@pytest.fixture(scope="module")
def ball_basis():
    return distance_basis(BALL, k=8, p=20, held_out=4)


@pytest.fixture(scope="module")
def shown(ball_basis):
    """One of everything that notebooks show."""
    result = result_of(BALL)
    return (
        BALL,
        PointCloud(BALL.vertices),
        result.map,
        result,
        BothDirections(result, result),
        QUALITY,
        Outcome.PARTIAL,
        Config(),
        Config(rank=40),
        ball_basis,
        laplace_basis(BALL, k=5),
        prepare(BALL),
    )


def pictures(html):
    found = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    return [imread(BytesIO(base64.b64decode(data))) for data in found]


class Elements(HTMLParser):
    """Whether every element that is opened is closed, and all words outside of tags."""

    def __init__(self, html):
        super().__init__()
        self.open, self.words = [], []
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        if tag not in ("img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.mark.long
def test_representations_are_whole_and_load_nothing(shown):
    for thing in shown:
        html = thing._repr_html_()
        assert Elements(html).words
        assert not re.search(r'(src|href)="(?!data:)', html)
        assert "nan" not in re.sub(r'src="[^"]*"', "", html)


def test_texts_are_escaped():
    words = Elements(html_of(result_of(BALL))).words
    assert "<b>a note</b> & more" in words
    assert "<b>a note" not in html_of(result_of(BALL))
    assert html_of("<i>").count("<i>") == 0


def test_a_result_says_how_it_ended_and_what_is_against_it():
    result = result_of(BALL, quality=replace(QUALITY, spectral_residual=5.0))
    text, summary = " ".join(Elements(html_of(result)).words), summary_of(result)
    for words in (
        summary.headline,
        summary.sureness,
        summary.advice_in_python,
        "coverage",
        "against the map: spectral residual",
        "rank = 40",
    ):
        assert words in text
    sure = result_of(BALL, outcome=Outcome.CONVERGED, quality=replace(QUALITY, runner_up=9.0, mirrored=9.0))
    assert "none is against" in html_of(sure)


def test_settings_that_differ_are_shown_with_their_defaults():
    assert "All settings have their defaults" in html_of(Config())
    words = Elements(html_of(Config(rank=40))).words
    at = words.index("rank")
    assert words[at : at + 3] == ["rank", "40", str(Config().rank)]


@pytest.mark.long
def test_every_mesh_has_something_to_show():
    for specimen in zoo():
        html = specimen.mesh._repr_html_()
        assert "Mesh(" in html
        assert all((image[..., 3] > 0).any() for image in pictures(html))


def test_a_picture_is_sharp_and_large():
    """Two pixels for each of the page, and a pair is at least 800 of the page wide."""
    assert SIZES["PAIR_WIDTH"] >= 800
    for thing in (BALL, result_of(BALL)):
        html = thing._repr_html_()
        (image,) = pictures(html)
        assert image.shape[1] == 2 * int(re.search(r'width="(\d+)"', html)[1])
    covered = pictures(BALL._repr_html_())[0][30:-30, 30:-30, 3] > 0  # without margins
    assert covered.mean() == pytest.approx(np.pi / 4, abs=0.03)


def test_a_triangle_is_not_mirrored():
    """Of three corners in the plane, seen from the side of its normal, red, green and blue go around as they should."""
    corners = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]])
    mesh = Mesh(corners, [[0, 1, 2]])
    image = imread(BytesIO(mesh.plot(np.eye(3), width=300).png()))
    vivid = [
        np.argwhere(image[..., k] - image[..., [c for c in range(3) if c != k]].max(axis=2) > 0.4)
        for k in range(3)
    ]
    (ax, ay), (bx, by), (cx, cy) = (np.array([p[:, 1].mean(), -p[:, 0].mean()]) for p in vivid)
    sides = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    assert np.sign(sides) == np.sign((camera_of(mesh) @ [0, 0, 1])[2])


@pytest.mark.long
def test_figures_show_the_mesh_and_touch_nothing_else(ball_basis):
    """The axes hold the pixels, also of what values are shown in; pyplot is not loaded, and no backend chosen."""
    backend = dict.__getitem__(
        matplotlib.rcParams, "backend"
    )  # asking for it in the usual way would choose one
    height = BALL.vertices[:, 2]
    figure = BALL.plot(height, label="height", title="a $5 ball", width=300)
    drawn, bar = figure.axes
    pixels = drawn.images[0].get_array()
    middle = pixels[:, pixels.shape[1] // 2, :3].astype(int)
    covered = middle[pixels[:, pixels.shape[1] // 2, 3] == 255]
    assert (abs(covered[5] - covered[-5]) > 60).any(), "one colour above and another one below"
    assert bar.get_ylabel() == "height"
    assert figure.bbox.width == pytest.approx(300, abs=0.01)
    assert [text.get_text() for text in figure.texts if text.get_text()] == ["a $5 ball"]
    assert len(BALL.plot(width=200).axes) == 1
    assert len(result_of(BALL).plot(width=300).axes) == 2
    assert len(result_of(BALL).plot(values=height, width=300).axes) == 4
    assert len(ball_basis.plot(width=600).axes) == 2
    assert len(ball_basis.plot(BALL, width=600).axes) == 4
    assert len(laplace_basis(BALL, k=3).plot(BALL, width=600).axes) == 3
    assert len(PointCloud(BALL.vertices).plot(height, width=200).axes) == 2
    assert dict.__getitem__(matplotlib.rcParams, "backend") == backend
    assert "matplotlib.pyplot" not in sys.modules or matplotlib.pyplot.get_fignums() == []
    assert pictures(figure._repr_html_())[0].shape[1] == 300


def test_a_prepared_shape_is_coloured_by_its_average_distance():
    prepared = prepare(BALL)
    _, bar = prepared.plot(width=300).axes
    assert bar.get_ylabel().split() == ["average", "distance", "/", "√area"]
    assert prepared.plot(np.ones((BALL.n_vertices, 3)), width=300).axes[0].images


def test_a_view_goes_around_and_above():
    assert camera_of(BALL, 2, (0, 90))[2] == pytest.approx([0, 0, 1])
    front, behind = (camera_of(BALL, 2, (azimuth, 0))[2] for azimuth in (0, 180))
    assert front == pytest.approx(-behind)
    for view in ((0, 90), (77, -20), (212, 14)):
        camera = camera_of(BALL, 2, view)
        np.testing.assert_allclose(camera @ camera.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(camera) == pytest.approx(1.0)


def test_colours_span_the_values():
    uneven = np.concatenate([np.linspace(-2, 1, 1000), [1e9, np.nan, np.inf]])
    both = ValuePanel(uneven)
    assert both.colours == "PuOr_r"
    assert both.scale().vmin == -both.scale().vmax
    assert both.beyond in ("max", "both")
    assert ValuePanel(np.linspace(0.1, 5, 100)).scale().vmin == 0
    assert ValuePanel(np.linspace(90, 100, 100)).scale().vmin > 80
    rare = ValuePanel(np.eye(1000)[0]).scale()
    assert (rare.vmin, rare.vmax) == (0, 1)
    assert np.isnan(both.paint(np.array([[np.nan]]))).all()
    assert ValuePanel([np.nan]).scale().vmax == 1


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(DescriptorError, match=r"shape \(3,\).*162"):
        BALL.plot([1, 2, 3])
    with pytest.raises(DescriptorError, match="3 columns"):
        BALL.plot(np.ones((5, 3)))
    with pytest.raises(SettingError, match="width = 20"):
        BALL.plot(width=20)
    with pytest.raises(SettingError, match="no colour map"):
        BALL.plot(np.ones(BALL.n_vertices), colour_map="none such")
    with pytest.raises(MeshError, match="repair"):
        Mesh(np.zeros((3, 3)), [[0, 1, 2]]).plot()
    with pytest.raises(DescriptorError, match="surface"):
        laplace_basis(BALL, k=2).plot(icosphere(1))
    with pytest.raises(SettingError, match=r"width = 800\.5"):
        BALL.plot(width=800.5)
    with pytest.raises(SettingError, match="view = "):
        BALL.plot(view=(np.nan, 0.0))


def test_a_map_is_drawn_while_its_surfaces_are_in_use():
    sphere = icosphere(1)
    f = map_of(sphere)
    assert len(pictures(f._repr_html_())) == 1
    assert Mesh(sphere.vertices, sphere.faces).content_hash == f.source_hash, "a copy that is soon gone"
    assert len(pictures(f._repr_html_())) == 1
    again = Mesh(sphere.vertices + 0.0, sphere.faces)
    del sphere
    assert f._repr_html_().count("no longer in use") == 1
    with pytest.raises(MapError, match="give"):
        f.plot()
    assert f.plot((again.vertices, again.faces), again, width=300).axes
    with pytest.raises(MapError, match="source"):
        f.plot(BALL, again)
    assert pictures(Correspondence([0, -1], 2)._repr_html_()) == []


def test_a_graph_has_no_picture():
    path = Graph(4, [[0, 1], [1, 2], [2, 3]], [1.0, 1.0, 1.0])
    assert pictures(map_of(path)._repr_html_()) == []


def test_the_view_in_a_notebook_holds_the_arrays_and_begins_with_the_landmarks():
    result = result_of(BALL)
    view = result.show(landmarks=[[3, 4], [5, 6], [1, 10**6]], height=500)
    html = view._repr_html_()
    assert Elements(html)
    page = unescape(re.search(r'srcdoc="([^"]*)"', html)[1])
    scene, given = (
        json.loads(re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', page)[1])
        for name in ("scene", "given")
    )
    index = np.frombuffer(base64.b64decode(scene["source"]["index"]), dtype="<u4")
    np.testing.assert_array_equal(np.sort(index), np.arange(BALL.n_vertices))
    assert given["landmarks"] == [[3, 4], [5, 6]]
    assert escape(summary_of(result).advice_in_python) in page
    assert 'sandbox="allow-scripts allow-downloads"' in html
    assert "height:500px" in html
    assert not re.search(r'(src|href)="(?!data:|#)[^"]', page.replace(html, ""))


def test_the_view_asks_what_decides_between_the_maps_of_a_doubtful_result():
    there = result_of(BALL)
    half_turn = KDTree(BALL.vertices).query(BALL.vertices * [-1.0, 1.0, -1.0])[1]
    other = Alternative(lambda: Correspondence(half_turn, BALL.n_vertices), 0.1, 1.0, "flip")
    doubtful = replace(there, outcome=Outcome.LOW_CONFIDENCE, alternatives=(other,))
    assert "data-pair=" in unescape(doubtful.show()._repr_html_())
    assert (
        "data-pair="
        not in unescape(replace(there, outcome=Outcome.PARTIAL).show()._repr_html_()).split("<script")[0]
    )


@pytest.mark.skipif(HAS_ANYWIDGET, reason="anywidget is installed")
def test_without_anywidget_the_view_says_how_clicks_come_back():
    view = result_of(BALL).show()
    assert ".[notebook]" in view._repr_html_()
    assert view._repr_mimebundle_()[0].keys() == {"text/plain", "text/html"}
    with pytest.raises(MissingDependencyError, match=r"\.\[notebook\]"):
        _ = view.landmarks


@pytest.mark.skipif(not HAS_ANYWIDGET, reason="needs anywidget")
def test_clicked_pairs_come_back():
    result = result_of(BALL)
    view = result.show(landmarks=[[3, 4]])
    np.testing.assert_array_equal(view.landmarks, [[3, 4]])
    view.widget.set_state({"pairs": [[3, 4], [7, 8]]})  # what a browser sends
    np.testing.assert_array_equal(view.landmarks, [[3, 4], [7, 8]])
    assert view.widget.get_state()["pairs"] == [[3, 4], [7, 8]]
    view.widget.set_state({"pairs": []})
    assert view.landmarks.shape == (0, 2)
    shown, _ = view._repr_mimebundle_()
    assert {"application/vnd.jupyter.widget-view+json", "text/html", "text/plain"} <= shown.keys()
    assert "view.landmarks" in view.widget.page


@pytest.fixture
def displayed(monkeypatch):
    """A kernel that keeps what it is told to display: a list of [how, what]."""
    told = []

    class Handle:
        def display(self, data, raw):
            told.append(["new", data])

        def update(self, data, raw):
            told.append(["same", data])

    shell = SimpleNamespace(kernel=object(), execution_count=1)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(DisplayHandle=Handle))
    return told, shell


def test_progress_in_a_notebook_is_one_bar_for_each_computation(displayed, capsys):
    told, shell = displayed
    for stages in (("prepare", 0.0), ("prepare", 0.0), ("<search>", 0.5), ("done", 1.0)):
        show_progress(*stages)
    assert [how for how, _ in told] == ["new", "same", "same", "same"]
    assert "&lt;search&gt;" in told[2][1]["text/html"]
    assert told[3][1]["text/plain"].startswith("100%")
    show_progress("prepare", 0.0)
    shell.execution_count = 2  # it was interrupted, and another cell begins
    show_progress("prepare", 0.3)
    assert [how for how, _ in told[4:]] == ["new", "new"]
    assert capsys.readouterr().err == ""


def test_progress_elsewhere_is_one_line(capsys):
    for stages in (("prepare", 0.0), ("search", 0.5), ("done", 1.0)):
        show_progress(*stages)
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert line.endswith("\n")
    assert [part[:4] for part in line.split("\r")[1:]] == ["  0%", " 50%", "100%"]


@pytest.mark.long
def test_a_result_shows_outcome_quality_and_map(prepared_example):
    result = match(*prepared_example)
    html = result._repr_html_()
    assert all(word in html for word in (result.outcome.name, "coverage", "spectral residual"))
    assert len(pictures(html)) == 1
