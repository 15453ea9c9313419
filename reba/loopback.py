"""What a server of pages answers, to whom, and how long it waits for a client.

A server on the loopback interface is reachable from every web page that a browser on this machine shows: by requests
to its port (their `Origin` names the page), and under a name of that page's site which comes to point here (DNS
rebinding; the `Host` names that). Both are refused. Connections are few, carry one request each, and end if the client
neither asks, sends nor reads, so that no client that falls silent holds up the other ones.
"""

from __future__ import annotations

import asyncio
from typing import Any, Final

MAX_CONNECTIONS: Final = 64
"""Connections at a time; further ones are closed at once. A browser opens six for a page."""
WAIT_SECONDS: Final = 10.0
"""[s] For a complete head of a request, for the next part of its body, and for a client that does not read to read on.
"""
LOOPBACK: Final = ("localhost", "127.0.0.1", "[::1]")
HEADERS: Final = (
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
    (b"content-security-policy", b"default-src 'self' 'unsafe-inline' data: blob:; frame-ancestors 'none'"),
)
"""Of every answer: other pages may neither embed nor read it, and the page loads nothing from elsewhere."""


class Guard:
    """ASGI application that passes on what may be answered: requests under a name of this server, from its own pages.

    Args:
        host: the name or address that the user gave; a request may name it, besides those of the loopback interface.
        port: of the server.
        methods: that are answered.
    """

    def __init__(self, app: Any, host: str, port: int, methods: tuple[str, ...] = ("GET",)) -> None:
        self._app, self._methods = app, methods
        self._host, self._port = _in_url(host), port

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        async def send_guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", []), *HEADERS]}
            await send(message)

        status, text = self.refusal(scope)
        if not status:
            await self._app(scope, receive, send_guarded)
            return
        headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"allow", ", ".join(self._methods).encode())]
        await send_guarded({"type": "http.response.start", "status": status, "headers": headers})
        await send_guarded({"type": "http.response.body", "body": f"{text}\n".encode()})

    def refusal(self, scope: Any) -> tuple[int, str]:
        """Return status and reason if a request is refused, else (0, "")."""
        given = {name: [value.decode("latin-1") for key, value in scope["headers"] if key == name]
                 for name in (b"host", b"origin")}  # fmt: skip
        server = scope.get("server") or ("", None)
        names = {*LOOPBACK, self._host, _in_url(server[0])}
        ours = {f"{name}:{self._port}" for name in names} | (names if self._port == 80 else set())
        if len(given[b"host"]) != 1 or given[b"host"][0].lower() not in ours:
            return 421, f"this server has another name; open http://{self._host}:{self._port}/"
        if any(origin.lower() not in {f"http://{name}" for name in ours} for origin in given[b"origin"]):
            return 403, "other pages may not read this server"
        if scope["method"] not in self._methods:
            return 405, f"this server answers {' and '.join(self._methods)} requests only"
        if "\0" in scope["path"]:
            return 404, "there is no such file"
        return 0, ""


def _in_url(host: str) -> str:
    """Return a host as a URL has it, in lower case.

    >>> _in_url("::1"), _in_url("Robot")
    ('[::1]', 'robot')
    """
    return (f"[{host}]" if ":" in host else host).lower()


def bounded_connection(wait_seconds: float = WAIT_SECONDS) -> type[asyncio.Protocol]:
    """Return the class of connections that are closed if there are too many, or if the client keeps the server waiting.

    It is uvicorn's with other limits: that waits for a request, and for a client that does not read, for ever.
    """
    from uvicorn.protocols.http.h11_impl import H11Protocol

    class Connection(H11Protocol):
        def connection_made(self, transport: Any) -> None:
            """Refuse the connection if there are enough, else expect a request."""
            super().connection_made(transport)
            self._timers: dict[str, asyncio.TimerHandle] = {}
            self._received = False
            if len(self.connections) > MAX_CONNECTIONS:
                transport.abort()
            else:
                self._expect_request()

        def connection_lost(self, exc: Exception | None) -> None:
            """Stop waiting."""
            for timer in self._timers.values():
                timer.cancel()
            super().connection_lost(exc)

        def data_received(self, data: bytes) -> None:
            """Note that the client sends."""
            self._received = True
            super().data_received(data)

        def pause_writing(self) -> None:
            """Expect that a client whose answer fills the buffer reads on."""
            super().pause_writing()
            self._timers["read"] = self.loop.call_later(wait_seconds, self.transport.abort)

        def resume_writing(self) -> None:
            """Write on: the client has read."""
            self._timers.pop("read").cancel()
            super().resume_writing()

        def _expect_request(self) -> None:
            def check() -> None:
                # Without a cycle there is no request yet; a closing connection has an answer that is not fetched.
                silent = self.cycle is None or (self.cycle.more_body and not self._received)
                if silent or self.transport.is_closing():
                    self.transport.abort()
                else:
                    self._received = False
                    self._expect_request()

            self._timers["request"] = self.loop.call_later(wait_seconds, check)

    return Connection
