"""The page is served to whoever has its address, and to nobody else; what it asks for ends in a result or in words."""

import json
import socket
import time
from dataclasses import replace
from threading import Event

import numpy as np
import pytest

from isomatch import Mesh, MeshError, SettingError
from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, match
from isomatch.server import PageServer
from isomatch.server.app import _bind
from isomatch.server.session import Job
from served_pages import PAIRS, QUICK, bent, serving

pytest.importorskip("starlette", reason="needs the extra open")
pytest.importorskip("uvicorn", reason="needs the extra open")


@pytest.fixture(scope="module")
def shape():
    return bent()


@pytest.fixture(scope="module")
def page(shape):
    with serving((shape, shape)) as served:
        yield served


def test_the_page_needs_its_token(page):
    path = f"{page.parts.path}?{page.parts.query}"
    code, headers, html = page.ask("GET", path, X_Isomatch_Token=None)
    assert code == 200
    assert b"a&lt;b&gt;.ply" in html
    assert b"a<b>" not in html
    assert headers["cache-control"] == "no-store"
    assert headers["referrer-policy"] == "no-referrer"
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert "access-control-allow-origin" not in headers
    assert "set-cookie" not in headers
    for wrong in ("/", "/?token=", "/?token=x", path[:-1], f"{path}&token={page.token}", f"{path}x"):
        assert page.code("GET", wrong) == 403, wrong  # a header does not open the page


@pytest.mark.parametrize("path", ["/state", "/result", "/packed", "/elsewhere"])
def test_every_answer_needs_the_token_in_a_header(page, path):
    for token in (None, "", "x", page.token[:-1]):
        assert page.code("GET", f"{path}?token={page.token}", X_Isomatch_Token=token) == 403
    assert page.code("GET", path) in (200, 400, 404)


@pytest.mark.parametrize("path", ["/match", "/choose", "/write", "/pack", "/cancel"])
def test_what_does_something_needs_token_and_origin(page, path):
    assert page.code("POST", path, {}, X_Isomatch_Token=None) == 403
    for origin in (
        None,
        "null",
        "http://evil.example",
        f"https://{page.host}",
        "http://127.0.0.1:1",
        f"http://{page.host}.evil.example",
    ):
        assert page.code("POST", path, {}, Origin=origin) == 403, origin
    assert page.state()["job"] is None
    assert page.code("GET", path) in (404, 405)


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "127.0.0.1.evil.example", "[::1]", "", None]
)
def test_another_host_is_refused_as_of_a_name_that_was_bound_to_this_machine(page, host):
    named = host and f"{host}:{page.parts.port}" if host == "evil.example" else host
    code = page.code("GET", f"/?token={page.token}", Host=named)
    assert code == 403 if host is not None else code in (400, 403)
    assert page.code("GET", f"/?token={page.token}", Host=f"localhost:{page.parts.port}") == 200


def test_other_methods_and_foreign_reads_are_refused(page):
    for method in ("OPTIONS", "PUT", "DELETE", "HEAD", "PATCH"):
        assert page.code(method, "/state") == 403
    assert page.code("GET", "/state", Origin="http://evil.example") == 403


def test_the_address_for_the_browser_works_once(page):
    path = f"{page.once.path}?{page.once.query}"
    code, headers, _ = page.ask("GET", path, X_Isomatch_Token=None)
    assert (code, headers["location"]) == (303, f"/?token={page.token}")
    assert page.code("GET", path) == 403
    assert page.code("GET", "/?once=") == 403


def test_the_size_of_a_request_is_limited(page):
    assert page.words("POST", "/match", b" " * (2**20 + 1)) == (413, "The request is too large.")
    assert page.code("POST", "/match", b" " * 2**20) == 400


@pytest.mark.parametrize(
    "body",
    [
        b"", b"[]", b"{", b"{}", b"[" * 5000, b"\xff", {"landmarks": []},
        {"landmarks": [[1, 2, 3]]}, {"landmarks": [[True, 2]]}, {"landmarks": [[1.5, 2]]}, {"landmarks": [["1", 2]]},
        {"landmarks": "12"}, {"landmarks": [[2**31, 0]]}, {"only": 1}, {"start": 3}, {"folder": "/"},
    ],
)  # fmt: skip
def test_what_is_not_understood_is_refused(page, body):
    if isinstance(body, dict) and body != {"landmarks": []}:
        body = {"landmarks": [], "only": False, "hold": False, "start": "auto", "orientation": "any", **body}
    code, said = page.words("POST", "/match", body)
    assert (code, said) == (400, "the page asked for something that is not understood; load it again")
    assert page.state()["job"] is None


def test_nothing_can_be_shown_or_kept_before_a_match(page):
    for path in ("/write", "/pack"):
        assert page.words("POST", path, {}) == (400, "there is no result yet; match first")
    assert page.words("GET", "/result")[0] == 400
    assert page.ask("GET", "/packed")[2] == b""


def test_a_match_is_shown_corrected_and_kept(shape):
    with serving((shape, shape)) as page:
        assert page.match()[0] == 202
        assert page.match() == (400, "isomatch is busy (match); wait, or cancel that first")
        state = page.settled()
        assert (state["revision"], state["unsaved"], state["error"]) == (1, True, "")
        first = json.loads(page.ask("GET", "/result")[2])
        assert first["since"] == ""
        assert first["scene"]["maps"][0]["name"] == first["runners_up"][0]["name"] == "the map"

        assert page.match(PAIRS[:2])[0] == 202
        assert "2 landmarks do not fix an alignment" in page.settled()["error"]
        assert page.match([[0, 0], [1, 1], [2, 10**6]])[0] == 202
        assert "outside 0…641" in page.settled()["error"]
        assert page.match(start="fast")[0] == 400

        assert page.match(PAIRS, only=True, hold=True)[0] == 202
        state = page.settled()
        assert (state["revision"], state["error"]) == (2, "")
        second = json.loads(page.ask("GET", "/result")[2])
        assert [each["pair"] for each in second["landmarks"]] == PAIRS
        assert max(each["off"] for each in second["landmarks"]) < 1e-6
        assert second["since"]
        assert second["runners_up"][-1]["name"] == "before"

        assert page.match(PAIRS, start="pose", orientation="any")[0] == 202
        assert (page.settled()["error"], page.state()["revision"]) == ("", 3)
        assert page.match(PAIRS, only=True, hold=True)[0] == 202
        assert page.settled()["revision"] == 4

        assert page.code("POST", "/write", {}) == 202
        state = page.settled()
        assert (state["written"], state["unsaved"]) == ("Saved <all>.", False)
        ((result, landmarks),) = page.keeper.results
        assert [list(pair) for pair in landmarks] == PAIRS
        assert (result.config.hypotheses, result.config.pin) == ("given", 0)
        assert page.code("POST", "/pack", {}) == 202
        assert page.settled()["packed"] == 1
        assert page.ask("GET", "/packed")[2] == b"PK" + json.dumps(PAIRS).encode()


def test_a_map_that_was_given_is_shown_first_and_the_match_starts_from_it(shape):
    images = np.roll(np.arange(shape.n_vertices), 1)
    with serving((shape, shape), given=Correspondence(images, shape.n_vertices)) as page:
        state = page.state()
        assert (state["revision"], state["unsaved"]) == (1, False)
        shown = json.loads(page.ask("GET", "/result")[2])
        assert (shown["outcome"], shown["headline"]) == ("", "This is the map that was given.")
        assert [each["name"] for each in shown["scene"]["maps"]] == ["the map that was given"]
        assert page.words("POST", "/write", {}) == (400, "there is no result yet; match first")
        assert page.match()[0] == 202
        assert page.settled()["error"] == ""
        shown = json.loads(page.ask("GET", "/result")[2])
        names = [each["name"] for each in shown["scene"]["maps"]]
        assert (names[0], names[-1]) == ("the map", "the map that was given")
        assert [each["name"] for each in shown["runners_up"]] == names
        assert page.code("POST", "/write", {}) == 202
        page.settled()
        ((result, _),) = page.keeper.results
        assert not np.isnan(result.quality.initial_map_error)


@pytest.mark.long
def test_a_result_is_opened_and_an_alternative_chosen(shape):
    found = match(shape, shape, landmarks=PAIRS, config=QUICK)
    other = Alternative(lambda: found.map, 0.1, 1.0, "a try")
    with serving((shape, shape), result=replace(found, alternatives=(other,)), landmarks=PAIRS) as page:
        state = page.state()
        assert (state["revision"], state["unsaved"]) == (1, False)
        assert page.code("POST", "/choose", {"number": 2}) == 202
        assert page.settled()["error"] == "there is no alternative 2; the result has 1 of them"
        assert page.code("POST", "/choose", {"number": 1}) == 202
        assert page.settled()["unsaved"]
        shown = json.loads(page.ask("GET", "/result")[2])
        assert [each["origin"] for each in shown["runners_up"]] == [
            "a try",
            f"the map before, {found.origin}",
        ]


@pytest.mark.long
def test_what_is_cancelled_leaves_no_result_and_the_next_match_waits_for_its_end(shape):
    entered, go_on, running = Event(), Event(), []

    def slow():
        running.append(1)
        assert len(running) == 1, "two matches at once"
        entered.set()
        go_on.wait(20)
        running.pop()

    with serving((shape, shape), at_the_end=slow) as page:
        assert page.match()[0] == 202
        assert entered.wait(20)
        assert page.code("POST", "/cancel", {}) == 202
        state = page.state()
        assert (state["job"], state["revision"]) == (None, 0)
        assert page.match()[0] == 202
        time.sleep(0.2)
        assert page.state()["job"] == "match"
        go_on.set()
        assert page.settled()["revision"] == 1


@pytest.mark.long
def test_the_error_of_what_was_cancelled_is_not_that_of_the_next_match(shape):
    entered, go_on = Event(), Event()

    def broken_once():
        if not entered.is_set():
            entered.set()
            go_on.wait(20)
            raise MeshError("no")

    with serving((shape, shape), at_the_end=broken_once) as page:
        assert page.match()[0] == 202
        assert entered.wait(20)
        assert page.code("POST", "/cancel", {}) == 202
        assert page.match()[0] == 202
        go_on.set()
        state = page.settled()
        assert (state["revision"], state["error"]) == (1, "")


def ended(job):
    until = time.monotonic() + 20
    while not job.is_over and time.monotonic() < until:
        time.sleep(0.02)
    assert job.is_over


@pytest.mark.long
def test_what_has_ended_when_it_is_cancelled_counts(shape):
    with serving((shape, shape)) as page:
        assert page.match()[0] == 202
        ended(page.session._job)  # no state is asked for meanwhile
        assert page.code("POST", "/cancel", {}) == 202
        assert page.state()["revision"] == 1


@pytest.mark.long
def test_a_save_that_is_cancelled_and_ends_all_the_same_counts(shape):
    entered, go_on = Event(), Event()

    def write(result, landmarks):
        entered.set()
        go_on.wait(20)
        return "Saved <all>."

    with serving((shape, shape)) as page:
        assert page.match()[0] == 202
        page.settled()
        page.keeper.write = write
        assert page.code("POST", "/write", {}) == 202
        assert entered.wait(20)
        job = page.session._job
        assert page.code("POST", "/cancel", {}) == 202
        state = page.state()
        assert (state["job"], state["written"], state["unsaved"]) == (None, "", True)
        go_on.set()
        ended(job)
        state = page.state()
        assert (state["written"], state["unsaved"]) == ("Saved <all>.", False)


def test_a_shape_that_cannot_be_matched_is_told_in_words(shape):
    flat = Mesh(np.zeros((3, 3)) + np.eye(3), [[0, 1, 2]])
    with serving((flat, shape)) as page:
        assert page.match()[0] == 202
        assert "vertices" in page.settled()["error"]


@pytest.mark.long
def test_an_unexpected_error_is_told_and_logged(shape, caplog):
    with serving((shape, shape), at_the_end=lambda: 1 / 0) as page:
        assert page.match()[0] == 202
        assert page.settled()["error"] == "this is a defect of isomatch: ZeroDivisionError: division by zero"
    assert "ZeroDivisionError" in caplog.text


def test_a_port_that_is_taken_is_refused(page, shape):
    with pytest.raises(SettingError, match="port"):
        PageServer(page.session, page.parts.port)
    with pytest.raises(SettingError, match="cannot"):
        PageServer(page.session, 99999)


@pytest.mark.parametrize(("system", "reused"), [("posix", True), ("nt", False)])
def test_a_port_is_shared_with_nobody(system, reused, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr("os.name", system)
        made = _bind(0)
    with made:
        assert bool(made.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)) == reused


def test_a_job_tells_its_stage_and_raises_its_error():
    def work(tell):
        tell("half", 0.5)
        raise MeshError("no")

    job = Job("try", work)
    with pytest.raises(MeshError, match="no"):
        job.wait()
    assert job.now() == ("half", 0.5)
    assert job.is_over
    assert job.seconds == job.seconds
