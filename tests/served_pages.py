"""A page that is served to a test, and what it would ask."""

import json
import time
from contextlib import contextmanager
from http.client import HTTPConnection
from threading import Thread
from urllib.parse import parse_qs, urlsplit

from isomatch import Config, Mesh
from isomatch.server import PageServer, Session
from isomatch.visualization import WorkPage
from shapes import icosphere

QUICK = Config(n_columns=40, rank=20, n_functions=40, n_search=100, n_refine=100, refinement="none")
PAIRS = [[0, 0], [3, 3], [5, 5], [8, 8]]


class Kept:
    """Keeps results in memory."""

    folder = "somewhere"

    def __init__(self):
        self.results = []

    def write(self, result, landmarks):
        self.results.append((result, landmarks))
        return "Saved <all>."

    def packed(self, result, landmarks):
        return b"PK" + json.dumps(landmarks).encode()


def bent():
    """An ellipsoid that stands upright, with three different axes, bent so that front and back differ."""
    sphere = icosphere(3)
    bend = [0.0, 0.0, 0.3] * sphere.vertices[:, :1] ** 2
    return Mesh(sphere.vertices * [1.0, 2.0, 0.6] + bend, sphere.faces)


class Page:
    """What a page would ask, from the right place and with the token unless a test says otherwise."""

    def __init__(self, server, session, keeper):
        self.address = server.address
        self.parts, self.session, self.keeper = urlsplit(server.address), session, keeper
        self.once = urlsplit(server.once)
        (self.token,) = parse_qs(self.parts.query)["token"]
        self.host = self.parts.netloc

    def ask(self, method, path, body=None, **headers):
        """Code, headers and body of the answer; headers that are None are left out."""
        own = {"Host": self.host, "X-Isomatch-Token": self.token}
        own |= {"Origin": f"http://{self.host}"} if method == "POST" else {}
        own |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = HTTPConnection(self.parts.hostname, self.parts.port, timeout=20)
        connection.putrequest(method, path, skip_host=True)
        for name, value in own.items():
            if value is not None:
                connection.putheader(name, value)
        sent = body if isinstance(body, bytes | None) else json.dumps(body).encode()
        if sent is not None:
            connection.putheader("Content-Length", str(len(sent)))
        connection.endheaders(sent)
        answer = connection.getresponse()
        found = answer.status, dict(answer.getheaders()), answer.read()
        connection.close()
        return found

    def code(self, *asked, **headers):
        return self.ask(*asked, **headers)[0]

    def words(self, *asked):
        code, _, said = self.ask(*asked)
        return code, said.decode()

    def state(self):
        return json.loads(self.ask("GET", "/state")[2])

    def settled(self):
        """The state when nothing is done any more."""
        until = time.monotonic() + 60
        while (state := self.state())["job"] and time.monotonic() < until:
            time.sleep(0.02)
        assert not state["job"]
        return state

    def match(self, landmarks=(), **options):
        asked = {"only": False, "hold": False, "start": "auto", "orientation": "preserve", **options}
        return self.words("POST", "/match", {"landmarks": landmarks, **asked})


class HookedPage(WorkPage):
    """Calls a function at the end of each match, before its result is drawn."""

    at_the_end = staticmethod(lambda: None)

    def result(self, *parts):
        self.at_the_end()
        return super().result(*parts)


@contextmanager
def serving(surfaces, config=QUICK, at_the_end=HookedPage.at_the_end, given=None, **options):
    keeper = Kept()
    work_page = HookedPage(*surfaces, names=("a<b>.ply", "c.ply"), given=given)
    work_page.at_the_end = at_the_end
    session = Session(surfaces, work_page, keeper, config=config, **options)
    server = PageServer(session)
    thread = Thread(target=server.run, daemon=True)
    thread.start()
    try:
        yield Page(server, session, keeper)
    finally:
        server.stop()
        thread.join(10)
        assert not thread.is_alive()
