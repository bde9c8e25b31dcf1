"""Pages in Chromium: fixtures of the tests that click; skipped where it or playwright is missing."""

import shutil

import pytest

DESKTOP, PHONE = {"width": 1100, "height": 800}, {"width": 390, "height": 800}
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("needs Chromium")
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    with sync_api.sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield opened
        opened.close()


@pytest.fixture
def visit(browser):
    """Open a page in a browser without a network that has stored nothing; fail if it complains or asks for anything."""
    faults, contexts = [], []

    def opened(path, viewport=DESKTOP, **options):
        context = browser.new_context(offline=True, viewport=viewport, accept_downloads=True, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on(
            "request",
            lambda asked: None if asked.url.startswith(("file:", "data:")) else faults.append(asked.url),
        )
        page.goto(path.as_uri())
        settled(page)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert not faults


def settled(page):
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
