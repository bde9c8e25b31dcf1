"""The addresses that the page asks, and the server that answers."""

from __future__ import annotations

import json
import os
import secrets
import socket
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from isomatch.errors import IsomatchError, SettingError
from isomatch.loading.first_use import package
from isomatch.serving.guard import App, Guard
from isomatch.serving.session import Session

HOST = "127.0.0.1"
EXTRA, WHAT = "open", "isomatch open"
REFUSED = 400  # answer to what cannot be done, with the reason in words
MANY = 2**31  # no surface has so many vertices


def require_server() -> None:
    """Raise `MissingDependencyError` if starlette or uvicorn is not installed."""
    for name in ("starlette", "uvicorn"):
        package(name, EXTRA, WHAT)


def app_of(session: Session, token: str, port: int, once: str = "") -> App:
    """Make the ASGI application of a session.

    Parameters
    ----------
    session : Session
        What the page works on.
    token, once : str
        See `Guard`.
    port : int
        Port on which it is served.

    Raises
    ------
    MissingDependencyError
        If starlette is not installed.
    """
    applications, responses, routing = (
        package(f"starlette.{name}", EXTRA, WHAT) for name in ("applications", "responses", "routing")
    )
    text = partial(responses.Response, media_type="text/plain")

    def answers(function: Callable[[], Any]) -> Any:
        async def answer(request: Any) -> Any:
            try:
                return responses.JSONResponse(function())
            except IsomatchError as error:
                return text(str(error), REFUSED)

        return answer

    def does(function: Callable[..., None], **fields: Callable[[Any], Any]) -> Any:
        async def answer(request: Any) -> Any:
            try:
                given = _fields(await request.body(), fields)
                function(**given)
                return text("", 202)
            except IsomatchError as error:
                return text(str(error), REFUSED)

        return answer

    async def page(request: Any) -> Any:
        return responses.HTMLResponse(session.html())

    async def packed(request: Any) -> Any:
        return responses.Response(session.archive(), media_type="application/zip")

    def get(path: str, answer: Any) -> Any:
        return routing.Route(path, answer, methods=["GET"])

    def post(path: str, answer: Any) -> Any:
        return routing.Route(path, answer, methods=["POST"])

    routes = [
        get("/", page),
        get("/state", answers(session.state)),
        get("/result", answers(session.shown)),
        get("/packed", packed),
        post(
            "/match",
            does(session.match, landmarks=_pairs, only=_flag, hold=_flag, start=_word, orientation=_word),
        ),
        post("/choose", does(session.choose, number=_whole)),
        post("/write", does(session.write)),
        post("/pack", does(session.pack)),
        post("/cancel", does(session.cancel)),
    ]
    return Guard(applications.Starlette(routes=routes), token, port, once)


class PageServer:
    """Serves the page of a session to browsers of this machine.

    Parameters
    ----------
    session : Session
        What the page works on.
    port : int
        Port; 0 for any that is free.

    Attributes
    ----------
    address : str
        Address of the page, with the token.
    once : str
        Another address of it, which works once: for command lines, which other users of a machine can read.

    Raises
    ------
    MissingDependencyError
        If starlette or uvicorn is not installed.
    SettingError
        If the port cannot be used.
    """

    def __init__(self, session: Session, port: int = 0) -> None:
        uvicorn = package("uvicorn", EXTRA, WHAT)
        token, key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        self._socket = _bound(port)
        number = self._socket.getsockname()[1]
        try:
            app = app_of(session, token, number, key)
        except BaseException:
            self._socket.close()
            raise
        self.address = f"http://{HOST}:{number}/?token={token}"
        self.once = f"http://{HOST}:{number}/?once={key}"
        settings = uvicorn.Config(
            app, log_level="error", lifespan="off", ws="none", server_header=False, proxy_headers=False
        )
        self._server = uvicorn.Server(settings)

    def run(self) -> None:
        """Answer until `stop` is called, or the process is interrupted."""
        with self._socket:
            self._server.run([self._socket])

    def stop(self) -> None:
        """Let `run` end, from another thread."""
        self._server.should_exit = True


def _bound(port: int) -> socket.socket:
    made = socket.socket()
    try:
        if os.name == "posix":  # elsewhere it lets others take a port that is used
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((HOST, port))
        made.listen()  # a browser that is quicker than the server waits
    except (OSError, OverflowError) as error:
        made.close()
        raise SettingError(
            f"--port {port} cannot be used: {error}; leave it out to take any that is free"
        ) from None
    return made


def _fields(body: bytes, fields: Mapping[str, Callable[[object], object]]) -> dict[str, Any]:
    """Read the fields of a JSON object, all of which have to be there, and no others."""
    try:
        given = json.loads(body)
        if not isinstance(given, dict) or given.keys() != fields.keys():
            raise ValueError
        return {name: read(given[name]) for name, read in fields.items()}
    except (ValueError, RecursionError):
        raise SettingError("the page asked for something that is not understood; load it again") from None


def _whole(value: object) -> int:
    if type(value) is not int:
        raise ValueError
    return value


def _word(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError
    return value


def _flag(value: object) -> bool:
    if type(value) is not bool:
        raise ValueError
    return value


def _pairs(value: object) -> list[tuple[int, int]]:
    if not isinstance(value, list):
        raise ValueError
    pairs = []
    for row in value:
        if not isinstance(row, list):
            raise ValueError
        first, second = map(_whole, row)
        if max(abs(first), abs(second)) >= MANY:
            raise ValueError
        pairs.append((first, second))
    return pairs
