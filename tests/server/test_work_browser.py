"""The page in a browser, used by clicking and tapping: nothing is complained about, and it does what it says."""

import json
import re
import signal
import subprocess
import sys
import zipfile
from threading import Event

import numpy as np
import pytest

import isomatch
from browser_pages import settled
from isomatch.datasets import example_pair
from isomatch.visualization import HEADLINES
from served_pages import bent, serving

pytest.importorskip("starlette", reason="needs the extra open")
pytest.importorskip("uvicorn", reason="needs the extra open")

DESKTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
ON_A_PANE = [(0.5, 0.35), (0.5, 0.65), (0.53, 0.5)]  # shares of its width and height
RESULT_FILES = {"map.npz", "map.txt", "map.png", "result.json", "report.html"}


@pytest.fixture
def server():
    with serving((bent(), bent())) as page:
        yield page


@pytest.fixture
def visit(browser):
    """Open an address; fail if the page complains or asks for anything elsewhere."""
    faults, contexts = [], []

    def opened(address, viewport=DESKTOP, **options):
        context = browser.new_context(viewport=viewport, accept_downloads=True, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: faults.append(str(error)))
        own = address.partition("?")[0]
        page.on(
            "request",
            lambda asked: None if asked.url.startswith((own, "data:", "blob:")) else faults.append(asked.url),
        )
        page.goto(address)
        settled(page)
        return page

    opened.faults = faults
    yield opened
    for context in contexts:
        context.close()
    assert not faults


def at(page, pane, x, y):
    """A point of the canvas by the shares of one of its panes, which stand side by side or above one another."""
    box = page.locator("#view").bounding_box()
    if box["width"] < box["height"]:
        return {"x": box["width"] * x, "y": box["height"] * (pane + y) / 2}
    return {"x": box["width"] * (pane + x) / 2, "y": box["height"] * y}


def pick(page, points, tap=False):
    """Click points on the source, each with the same point of the target."""
    view = page.locator("#view")
    for x, y in points:
        for pane in (0, 1):
            (view.tap if tap else view.click)(position=at(page, pane, x, y))
    settled(page)


def drag(page, pane, start, end):
    corner = page.locator("#view").bounding_box()
    ends = [at(page, pane, *each) for each in (start, end)]
    (x0, y0), (x1, y1) = [(corner["x"] + each["x"], corner["y"] + each["y"]) for each in ends]
    page.mouse.move(x0, y0)
    page.mouse.down()
    page.mouse.move((x0 + x1) / 2, (y0 + y1) / 2)
    page.mouse.move(x1, y1)
    page.mouse.up()


def done(page):
    """Wait until nothing is done any more."""
    page.wait_for_selector("#match:enabled", timeout=60_000)
    assert not page.is_visible("#trouble"), page.text_content("#trouble")


def pairs(page):
    lines = page.input_value("#noted").splitlines()[1:]
    return [[int(end) for end in line.split(", ")] for line in lines]


def test_landmarks_are_picked_and_corrected_and_the_map_is_shown_chosen_and_kept(server, visit):
    page = visit(server.address)
    assert page.text_content("#advice").startswith("Press Match.")
    assert not page.is_visible("#found")
    pick(page, ON_A_PANE[:2])
    assert page.is_disabled("#match")
    assert "at least 3 are needed" in page.text_content("#step")
    pick(page, ON_A_PANE[2:])
    assert page.text_content("#match") == "Match with 3 pairs"
    assert page.locator(".pin").count() == 6
    first = pairs(page)
    assert all(source == target for source, target in first)
    page.click("#match")
    done(page)
    assert page.text_content("#outcome") in HEADLINES.values()
    assert page.text_content("#sure")

    drag(page, 1, ON_A_PANE[0], (0.45, 0.3))
    corrected = pairs(page)
    assert [row[0] for row in corrected] == [row[0] for row in first]
    assert [a != b for a, b in zip(corrected, first)] == [True, False, False]
    page.keyboard.press("Control+z")
    assert pairs(page) == first
    drag(page, 1, ON_A_PANE[0], (0.45, 0.3))
    assert pairs(page) == corrected
    page.click("#match")
    done(page)
    assert page.is_visible("#since")
    assert page.locator("#runners_up label").last.text_content().startswith("before")

    page.click("#write")
    done(page)
    assert page.text_content("#written") == "Saved <all>."
    ((_, landmarks),) = server.keeper.results
    assert [list(pair) for pair in landmarks] == corrected


@pytest.mark.long
def test_an_answer_from_before_a_click_is_not_believed(server, visit):
    go_on, held = Event(), []
    server.session._page.at_the_end = lambda: go_on.wait(20)
    page = visit(server.address)
    page.route("**/state", lambda route: held.append((route, route.fetch())), times=1)
    while not held:
        page.wait_for_timeout(100)
    page.click("#match")
    page.evaluate("""() => {
      const button = document.getElementById("match"); window.seen = [];
      new MutationObserver(() => window.seen.push(button.disabled)).observe(button, { attributes: true });
    }""")
    route, answer = held[0]
    route.fulfill(response=answer)
    page.wait_for_timeout(500)
    assert all(page.evaluate("seen"))
    go_on.set()
    done(page)
    assert page.is_visible("#found")


@pytest.mark.long
def test_only_the_page_that_asked_for_a_download_gets_it(server, visit):
    page, other = visit(server.address), visit(server.address)
    page.click("#match")
    done(page)
    other.wait_for_selector("#found:visible")
    downloads = []
    other.on("download", lambda download: downloads.append(download))
    with page.expect_download():
        page.click("#download")
    done(page)
    page.on("download", lambda download: downloads.append(download))
    page.reload()
    page.wait_for_selector("#found:visible")
    other.wait_for_timeout(1500)  # each page has asked again since
    assert not downloads


@pytest.fixture(scope="module")
def animals(tmp_path_factory):
    folder = tmp_path_factory.mktemp("animals")
    for name, creature in zip(("standing", "running"), example_pair()):
        isomatch.write_mesh(folder / f"{name}.ply", creature.mesh)
    return folder


@pytest.fixture
def opened(animals):
    """Run the command in a process of its own, and give the address that it prints."""
    started = []

    def run(*words):
        command = [sys.executable, "-m", "isomatch", "open", *map(str, words), "--no-browser"]
        process = subprocess.Popen(command, cwd=animals, stdout=subprocess.PIPE, text=True)
        started.append(process)
        address = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{43}", address)
        return address

    run.processes = started
    yield run
    for process in started:
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 130
        process.stdout.close()


@pytest.mark.long
@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_animals_from_files_to_files(opened, visit, tmp_path, viewport):
    phone = viewport is PHONE
    page = visit(opened("standing.ply", "running.ply", "-o", tmp_path / "out"), viewport, has_touch=phone)
    page.click("#match")
    assert page.is_visible("#cancel")
    done(page)
    assert page.text_content("#outcome") == HEADLINES[isomatch.Outcome.CONVERGED]
    pick(page, [(0.5, 0.45)], tap=phone)
    page.click("#undo")
    assert page.locator("#pairs .unsure").count() == 1  # the map has a place for it
    page.click("#pairs button:has-text('Confirm')")
    assert len(pairs(page)) == 1
    assert page.is_disabled("#match")
    page.click("#clear")

    page.locator("#runners_up input").nth(1).click()
    page.click("#choose")
    done(page)
    assert (
        page.locator("#runners_up .soft")
        .nth(1)
        .text_content()
        .startswith("The map before this one was chosen.")
    )
    page.click("#write")
    done(page)
    written = {path.name for path in (tmp_path / "out").iterdir() if not path.name.startswith(".")}
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert written == RESULT_FILES | {
        f"alternative_{k}.npz" for k in range(1, len(record["alternatives"]) + 1)
    }
    assert "was chosen" in record["notes"][0]
    with page.expect_download() as download:
        page.click("#download")
    assert download.value.suggested_filename == "isomatch.zip"
    with zipfile.ZipFile(download.value.path()) as archive:
        assert set(archive.namelist()) == written
        result = json.loads(archive.read("result.json"))
        assert set(result["files"].values()) == written
        archive.extract("map.npz", tmp_path)
    found = isomatch.MatchResult.load(tmp_path / "map.npz")
    np.testing.assert_array_equal(
        found.map.vertices, isomatch.MatchResult.load(tmp_path / "out" / "map.npz").map.vertices
    )

    page.reload()
    page.wait_for_selector("#found:visible")
    assert page.locator("#runners_up label").count() == 1 + len(record["alternatives"])

    page.click("#propose")
    assert page.locator("#pairs .unsure").count() == 3
    assert page.locator(".pin.guess").count() == 3
    for _ in range(3):
        page.focus("#pairs button:has-text('Confirm')")
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.tagName") == "BUTTON"
    assert len({target for _, target in pairs(page)}) == 3
    page.click("#match")
    done(page)
    assert page.text_content("#outcome") == HEADLINES[isomatch.Outcome.CONVERGED]


@pytest.mark.long
def test_a_folder_of_a_result_is_opened(opened, visit, animals, tmp_path):
    from isomatch.cli import main

    ends = [str(animals / f"{name}.ply") for name in ("standing", "running")]
    assert main(["match", *ends, "-o", str(tmp_path / "out"), "--quiet"]) == 0
    before = (tmp_path / "out" / "map.npz").read_bytes()
    page = visit(opened(tmp_path / "out"))
    page.wait_for_selector("#found:visible")
    assert page.text_content("#outcome") == HEADLINES[isomatch.Outcome.CONVERGED]
    page.locator("#runners_up input").nth(1).click()
    page.click("#choose")
    done(page)
    assert (tmp_path / "out" / "map.npz").read_bytes() == before
    page.click("#write")
    done(page)
    assert (tmp_path / "out" / "map.npz").read_bytes() != before


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_nothing_sticks_out_and_buttons_are_reached_by_keys(server, visit, viewport, scheme):
    page = visit(server.address, viewport, color_scheme=scheme)
    page.focus("#match")
    page.keyboard.press("Enter")
    done(page)
    settled(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    for item in page.locator("#work button:visible").all():
        item.focus()
        box = item.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= viewport["width"]
    assert page.get_by_role("button", name="Match again").is_enabled()


@pytest.mark.long
def test_a_match_is_cancelled_and_a_server_that_ended_is_told(opened, visit):
    page = visit(opened("standing.ply", "running.ply"))
    page.click("#match")
    page.click("#cancel")
    done(page)
    assert not page.is_visible("#found")
    assert not page.is_visible("#write")
    opened.processes[0].send_signal(signal.SIGINT)
    page.wait_for_selector("#trouble:visible")
    assert page.text_content("#trouble").startswith("isomatch open has ended.")
    assert all("ERR_" in fault for fault in visit.faults)
    visit.faults.clear()


@pytest.mark.long
def test_errors_come_in_words(server, visit):
    page = visit(server.address)
    page.click("summary")
    page.fill("#noted", "0, 0\n1, 1\n2, 999999\n")
    page.click("#match")
    page.wait_for_selector("#trouble:visible")
    assert "outside 0…641" in page.text_content("#trouble")
    page.fill("#noted", "0, 0\nfive, 1\n")
    assert "Line 2 is not a pair" in page.text_content("#problem")


@pytest.mark.long
def test_two_fingers_zoom_and_a_finger_turns(server, visit):
    page = visit(server.address, PHONE, has_touch=True)
    before = page.locator("#view").screenshot()
    asks = page.context.new_cdp_session(page)
    box = page.locator("#view").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 4

    def touch(kind, *points):
        asks.send(
            "Input.dispatchTouchEvent",
            {"type": kind, "touchPoints": [{"x": a, "y": b, "id": k} for k, (a, b) in enumerate(points)]},
        )

    touch("touchStart", (x - 20, y), (x + 20, y))
    touch("touchMove", (x - 40, y), (x + 60, y))
    touch("touchEnd")
    settled(page)
    zoomed = page.locator("#view").screenshot()
    assert zoomed != before
    touch("touchStart", (x, y))
    touch("touchMove", (x + 30, y))
    touch("touchMove", (x + 60, y))
    touch("touchEnd")
    settled(page)
    assert page.locator("#view").screenshot() != zoomed
    assert page.locator(".pin").count() == 0
    assert page.evaluate("scrollY") == 0
