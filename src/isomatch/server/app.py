"""The addresses that the page asks, and the server that answers."""

from __future__ import annotations

import json
import os
import secrets
import socket
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

from isomatch._core.errors import IsomatchError, SettingError
from isomatch._core.first_use import package
from isomatch.server.guard import App, Guard
from isomatch.server.session import Session

HOST = "127.0.0.1"
EXTRA, FEATURE = "open", "isomatch open"
REFUSED_STATUS = 400  # HTTP status of a request that fails; its body gives the reason in words
VERTEX_LIMIT = 2**31  # all surfaces have fewer vertices
T = TypeVar("T")


def require_server() -> None:
    """Raise `MissingDependencyError` if starlette or uvicorn is not installed."""
    for name in ("starlette", "uvicorn"):
        package(name, EXTRA, FEATURE)


def make_app(session: Session, token: str, port: int, once: str = "") -> App:
    """Make the ASGI application of a session; for the token and ``once`` see `Guard`."""
    modules = "applications", "responses", "routing"
    applications, responses, routing = (package(f"starlette.{name}", EXTRA, FEATURE) for name in modules)
    text = partial(responses.Response, media_type="text/plain")

    def answers(function: Callable[..., Any], **fields: Callable[[Any], Any]) -> Any:
        async def answer(request: Any) -> Any:
            try:
                if request.method == "GET":
                    return responses.JSONResponse(function())
                function(**_read_fields(await request.body(), fields))
                return text("", 202)
            except IsomatchError as error:
                return text(str(error), REFUSED_STATUS)

        return answer

    async def page(request: Any) -> Any:
        return responses.HTMLResponse(session.html())

    async def packed(request: Any) -> Any:
        return responses.Response(session.archive(), media_type="application/zip")

    of_match = {"landmarks": _read_pairs, "only": _flag, "hold": _flag, "start": _word, "orientation": _word}
    get = {"/": page, "/packed": packed}
    get |= {"/state": answers(session.state), "/result": answers(session.shown)}
    post = {
        "/match": answers(session.match, **of_match),
        "/choose": answers(session.choose, number=_whole),
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
        if os.name == "posix":  # on Windows it would let others take a port in use
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((HOST, port))
        made.listen()  # a browser that asks before the server is ready then waits
    except (OSError, OverflowError) as error:
        made.close()
        raise SettingError(
            f"--port {port} cannot be used: {error}; leave it out to take any that is free"
        ) from None
    return made


def _read_fields(body: bytes, fields: Mapping[str, Callable[[object], object]]) -> dict[str, Any]:
    """Read the fields of a JSON object; `SettingError` if any is missing or unknown."""
    try:
        values = json.loads(body)
        if not isinstance(values, dict) or values.keys() != fields.keys():
            raise ValueError
        return {name: read(values[name]) for name, read in fields.items()}
    except (ValueError, RecursionError):
        raise SettingError("the page asked for something that is not understood; load it again") from None


def _exactly(kind: type[T]) -> Callable[[object], T]:
    def read(value: object) -> T:
        if type(value) is not kind:
            raise ValueError
        return value

    return read


_whole, _word, _flag = _exactly(int), _exactly(str), _exactly(bool)


def _read_pairs(value: object) -> list[tuple[int, int]]:
    pairs = []
    for row in _exactly(list)(value):
        first, second = map(_whole, _exactly(list)(row))
        if max(abs(first), abs(second)) >= VERTEX_LIMIT:
            raise ValueError
        pairs.append((first, second))
    return pairs
