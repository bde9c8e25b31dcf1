"""The addresses that the page asks, and the server that answers."""

from __future__ import annotations

import json
import os
import secrets
import socket
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from isomatch._core.errors import IsomatchError, SettingError
from isomatch._core.first_use import package
from isomatch.server.guard import App, Guard
from isomatch.server.session import Session

HOST = "127.0.0.1"  # address that only programs on this machine can reach
EXTRA, FEATURE = "open", "isomatch open"  # extra with the packages of the server, and what needs it
REFUSED_STATUS = 400  # HTTP status of a request that fails; the answer gives the reason in words
VERTEX_LIMIT = 2**31  # an index of a vertex in a request must be below this, to fit 32 bits; chosen


def require_server() -> None:
    """Raise `MissingDependencyError` if starlette or uvicorn is not installed."""
    for name in ("starlette", "uvicorn"):
        package(name, EXTRA, FEATURE)


def make_app(session: Session, token: str, port: int, once: str = "") -> App:
    """Make the ASGI application of a session; for the token and ``once`` see `Guard`."""
    modules = "applications", "responses", "routing"
    applications, responses, routing = (package(f"starlette.{name}", EXTRA, FEATURE) for name in modules)
    text = partial(responses.Response, media_type="text/plain")

    def answers(function: Callable[..., Any], **kinds: type) -> Any:
        async def answer(request: Any) -> Any:
            try:
                if request.method == "GET":
                    return responses.JSONResponse(function())
                function(**_read_fields(await request.body(), kinds))
                return text("", 202)
            except IsomatchError as error:
                return text(str(error), REFUSED_STATUS)

        return answer

    async def page(request: Any) -> Any:
        return responses.HTMLResponse(session.html())

    async def packed(request: Any) -> Any:
        return responses.Response(session.archive(), media_type="application/zip")

    of_match = {"landmarks": list, "only": bool, "hold": bool, "start": str, "orientation": str}
    get = {"/": page, "/packed": packed}
    get |= {"/state": answers(session.state), "/result": answers(session.shown)}
    post = {
        "/match": answers(session.match, **of_match),
        "/choose": answers(session.choose, number=int),
        "/write": answers(session.write),
        "/pack": answers(session.pack),
        "/cancel": answers(session.cancel),
    }
    routes = [routing.Route(path, answer, methods=["GET"]) for path, answer in get.items()]
    routes += [routing.Route(path, answer, methods=["POST"]) for path, answer in post.items()]
    return Guard(applications.Starlette(routes=routes), token, port, once)


class PageServer:
    """Serves the page of a session to browsers of this machine, on a port; 0 is any that is free.

    ``address`` is the page's address with the token. ``once`` is an address that works a single
    time: it is for command lines, which other users of the machine can read. `SettingError` if the
    port cannot be used.
    """

    def __init__(self, session: Session, port: int = 0) -> None:
        uvicorn = package("uvicorn", EXTRA, FEATURE)
        token, key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        self._socket = _bind(port)
        number = self._socket.getsockname()[1]
        try:
            app = make_app(session, token, number, key)
        except BaseException:
            self._socket.close()
            raise
        self.address = f"http://{HOST}:{number}/?token={token}"
        self.once = f"http://{HOST}:{number}/?once={key}"
        options = {"lifespan": "off", "ws": "none", "server_header": False, "proxy_headers": False}
        self._server = uvicorn.Server(uvicorn.Config(app, log_level="error", **options))

    def run(self) -> None:
        """Answer until `stop` is called, or the process is interrupted."""
        with self._socket:
            self._server.run([self._socket])

    def stop(self) -> None:
        """Let `run` end, from another thread."""
        self._server.should_exit = True


def _bind(port: int) -> socket.socket:
    made = socket.socket()
    try:
        if os.name == "posix":  # On Windows, this option would let others take a port in use.
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((HOST, port))
        made.listen()  # A browser that asks before the server is ready then waits.
    except (OSError, OverflowError) as error:
        made.close()
        message = f"--port {port} cannot be used: {error}; leave it out to take any that is free"
        raise SettingError(message) from None
    return made


def _read_fields(body: bytes, kinds: Mapping[str, type]) -> dict[str, Any]:
    """Read a JSON object with fields of these types; `SettingError` if any is missing, unknown or of another type."""
    try:
        values = json.loads(body)
        if {name: type(value) for name, value in values.items()} != kinds:
            raise ValueError
        for first, second in values.get("landmarks", ()):
            if {type(first), type(second)} != {int} or max(abs(first), abs(second)) >= VERTEX_LIMIT:
                raise ValueError
        return dict(values)
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise SettingError("the page asked for something that is not understood; load it again") from None
