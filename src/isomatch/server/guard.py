"""The guard in front of the server: it admits only the page, with the token."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, MutableMapping
from hmac import compare_digest
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]  # types of ASGI, Python's interface between web servers and programs
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

TOKEN_HEADER = b"x-isomatch-token"  # header in which the page's script sends the token
MAX_BODY_BYTES = 2**20  # largest number of bytes of a request's body; chosen: about 70 000 landmark pairs fit
PAGE = "/"  # path of the page, whose address has the token in its query
HEADERS = (  # headers of all answers, by which a browser protects the page from other pages
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"no-referrer"),  # Pages that are linked do not get the address with the token.
    (b"x-content-type-options", b"nosniff"),
    (b"content-security-policy", b"frame-ancestors 'none'"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class Guard:
    """An ASGI application that admits only the page, with the token, on this machine."""

    # The token must be in the query of the page's address, and in a header of all other requests. There are
    # no cookies, which a browser would also send for requests of other pages. Host, and Origin of a POST,
    # must name this machine and the port; this refuses foreign host names that resolve to this machine. The
    # key "once" in the query redirects to the page's address a single time.

    def __init__(self, app: App, token: str, port: int, once: str = "") -> None:
        self._app, self._token, self._once = app, token.encode(), once.encode()
        self._hosts = {f"{name}:{port}".encode() for name in ("127.0.0.1", "localhost")}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            return

        async def send_guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *HEADERS]
            await send(message)

        code, words, *headers = self._refused(scope) or (0, "")
        if not code:
            body = await _body(receive)
            if body is not None:

                async def replay() -> MutableMapping[str, Any]:
                    return {"type": "http.request", "body": body, "more_body": False}

                return await self._app(scope, replay, send_guarded)
            code, words = 413, "The request is too large."
        headers.append((b"content-type", b"text/plain"))
        await send_guarded({"type": "http.response.start", "status": code, "headers": headers})
        await send_guarded({"type": "http.response.body", "body": words.encode()})

    def _refused(self, scope: Scope) -> tuple[Any, ...] | None:
        """Return code, reason and headers of an answer in place of the application's; None if the request passes."""
        headers: dict[bytes, list[bytes]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.lower(), []).append(value)
        (host, *more), origins = headers.get(b"host", [b""]), headers.get(b"origin", [])
        if host not in self._hosts or more:
            return 403, "This address is not that of isomatch."
        if scope["method"] not in ("GET", "POST"):
            return 403, "Only GET and POST are answered."
        if (scope["method"] == "POST" or origins) and origins != [b"http://" + host]:
            return 403, "Only the page of isomatch may ask."
        if scope["method"] == "GET" and scope["path"] == PAGE:
            query = parse_qs(scope["query_string"].decode("latin-1"))
            tokens, key = ([word.encode() for word in query.get(name, [])] for name in ("token", "once"))
            if self._once and len(key) == 1 and compare_digest(key[0], self._once):
                self._once = b""
                return 303, "", (b"location", b"/?token=" + self._token)
        else:
            tokens = headers.get(TOKEN_HEADER, [])
        if len(tokens) != 1 or not compare_digest(tokens[0], self._token):
            return 403, "The token is missing or wrong. Open the address that isomatch open printed."
        return None


async def _body(receive: Receive) -> bytes | None:
    """Read the body; None if it is too large."""
    body: bytes = b""
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > MAX_BODY_BYTES:
            return None
        if not message.get("more_body"):
            return body
