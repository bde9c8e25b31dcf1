"""The view of a notebook in a browser: clicks in its frame reach a widget, which a small object stands in for here."""

import numpy as np
import pytest

from isomatch import Mesh
from isomatch.visualization.viewer import text_of
from shapes import icosphere
from view_results import result_of

pytestmark = pytest.mark.long

SHOWN = """async ([script, page, pairs, dark]) => {
  document.body.dataset.jpThemeLight = String(!dark);
  const module = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  window.held ??= { page, pairs, height: 700 };
  window.saved ??= [];
  const model = { get: (name) => held[name], set: (name, value) => { held[name] = value; },
    save_changes: () => saved.push(JSON.stringify(held.pairs)) };
  const el = document.createElement("div"); document.body.append(el);
  window.leave = module.default.render({ model, el });
}"""


def test_clicked_pairs_reach_the_widget_and_a_second_view(browser):
    sphere = icosphere(3)
    shape = Mesh(sphere.vertices * [1.0, 2.0, 0.6], sphere.faces)
    html = result_of(shape).show()._page
    page = browser.new_page(viewport={"width": 1100, "height": 900})
    complaints = []
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: complaints.append(asked.url) if asked.url.startswith("http") else None)
    page.goto("about:blank")
    page.evaluate(SHOWN, [text_of("widget.js"), html, [[3, 4]], True])
    frame = page.frame_locator("iframe")
    frame.locator("#stage.live").wait_for()
    assert frame.locator("#noted").input_value() == "# source, target\n3, 4\n"
    assert (
        frame.locator("body").evaluate("body => getComputedStyle(body).backgroundColor") == "rgb(23, 25, 27)"
    )
    box = frame.locator("#view").bounding_box()
    for x in (0.25, 0.75):
        page.mouse.click(box["x"] + x * box["width"], box["y"] + 0.45 * box["height"])
        page.wait_for_timeout(200)
    page.wait_for_function("held.pairs.length === 2")
    pairs = np.array(page.evaluate("held.pairs"))
    assert pairs[0].tolist() == [3, 4]
    np.testing.assert_allclose(*shape.vertices[pairs[1]], atol=0.1)  # the same place of the same shape
    page.evaluate(SHOWN, [text_of("widget.js"), html, [], False])  # the cell is run again
    again = page.frame_locator("iframe >> nth=1")
    again.locator("#stage.live").wait_for()
    assert again.locator("#noted").input_value().count("\n") == 3
    assert (
        again.locator("body").evaluate("body => getComputedStyle(body).backgroundColor")
        == "rgb(250, 250, 248)"
    )
    again.locator("#clear").click()
    page.wait_for_function("held.pairs.length === 0")
    page.evaluate("leave()")
    again.locator("#undo").click()
    page.wait_for_timeout(200)
    assert page.evaluate("held.pairs.length") == 0, "a view that is gone says nothing"
    assert complaints == []
    page.close()


def test_the_page_alone_works_in_a_frame(browser):
    """As in an exported notebook: the frame of the representation, without a widget."""
    page = browser.new_page(viewport={"width": 1100, "height": 900})
    ball = icosphere(2)
    page.set_content(result_of(ball).show()._repr_html_())
    page.frame_locator("iframe").locator("#stage.live").wait_for()
    page.close()
