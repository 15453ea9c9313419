"""The live page: static files, and server-sent events with the current action.

A browser that reconnects sends the number of the last event it received and gets the later ones; numbers continue over
a restart of the run. https://html.spec.whatwg.org/multipage/server-sent-events.html
"""

from __future__ import annotations

import asyncio
import json
import socket
import threading
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgp.errors import LgpError
from lgp.execution.events import Event, Hub
from lgp.execution.session import ExecutionRun, RunOptions
from lgp.page.page import is_page_of, write_page
from lgp.plan_record import Plan
from reba.extras import missing
from reba.loopback import WAIT_SECONDS, Guard, bounded_connection

if TYPE_CHECKING:
    from starlette.applications import Starlette

HOST = "127.0.0.1"
"""Loopback: other machines see the page only with another host."""
POLL = 0.05
"""[s] Time between checks for new events."""
KEEP_ALIVE = 10.0
"""[s] Silence after which a comment is sent, so that proxies and browsers keep the connection."""
MAX_READERS = 32
"""Pages that follow the events at a time; the other connections remain for files."""
LINGER = 1.5
"""[s] Largest wait for browsers to receive the last event before the server stops."""


class PageServer:
    """Serves a page and the events of a run at the URL `address`, from a thread of its own.

    Args:
        page: folder with `index.html`; `show` changes it.
        port: 0 for any free one.
        keep_alive: silence after which a comment is sent [s].
        wait_seconds: for a client that neither completes its request nor reads the answer [s].

    Raises:
        LgpError: uvicorn is not installed, or the address is in use.
    """

    def __init__(
        self,
        page: Path,
        hub: Hub,
        host: str = HOST,
        port: int = 0,
        keep_alive: float = KEEP_ALIVE,
        wait_seconds: float = WAIT_SECONDS,
    ) -> None:
        try:
            import uvicorn
        except ImportError as error:
            raise missing("uvicorn", "the live page (or use --no-page)") from error
        self.hub = hub
        self._readers = Readers()
        self._socket = _bind(host, port)
        bound, number = self._socket.getsockname()[:2]
        self.address = f"http://{f'[{bound}]' if ':' in bound else bound}:{number}/"
        self._files = Files(page)
        app = Guard(application(self._files, hub, self._readers, keep_alive), host, number)
        config = uvicorn.Config(
            app,
            http=bounded_connection(wait_seconds),
            ws="none",
            lifespan="off",
            log_level="critical",  # requests that cannot be answered are the client's problem, not the run's
            headers=[("connection", "close")],
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, args=([self._socket],), daemon=True)

    def __enter__(self) -> PageServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def show(self, page: Path) -> None:
        """Serve the page in another folder from now on."""
        self._files.show(page)

    def close(self) -> None:
        """Wait until readers have the last event, then stop."""
        last = self.hub.last
        if self._thread.is_alive() and last is not None:
            self._readers.wait(last.number, LINGER)
        self._readers.over.set()
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join(5.0)
        self._socket.close()


class Files:
    """ASGI application that serves the files of a folder, which can be replaced while it runs."""

    def __init__(self, folder: Path) -> None:
        self.show(folder)

    def show(self, folder: Path) -> None:
        """Serve another folder from now on."""
        from starlette.staticfiles import StaticFiles

        self._files = StaticFiles(directory=folder, html=True)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        await self._files(scope, receive, send)


class Readers:
    """The last event that each connected reader received."""

    def __init__(self) -> None:
        self.over = threading.Event()
        self._served: dict[int, int] = {}
        self._changed = threading.Condition()

    def served(self, reader: int, number: int | None) -> None:
        """Set the last event of a reader, None when it disconnects."""
        with self._changed:
            if number is None:
                self._served.pop(reader, None)
            else:
                self._served[reader] = number
            self._changed.notify_all()

    @property
    def count(self) -> int:
        """Number of connected readers."""
        with self._changed:
            return len(self._served)

    def wait(self, number: int, seconds: float) -> None:
        """Wait until all readers have received an event, at most some seconds."""
        with self._changed:
            self._changed.wait_for(lambda: all(at >= number for at in self._served.values()), seconds)


def application(files: Files, hub: Hub, readers: Readers, keep_alive: float = KEEP_ALIVE) -> Starlette:
    """Return the ASGI application: `/events`, and the files of the page."""
    from starlette.applications import Starlette as App
    from starlette.requests import Request
    from starlette.responses import PlainTextResponse, Response, StreamingResponse
    from starlette.routing import Mount, Route

    async def events(request: Request) -> Response:
        if readers.count >= MAX_READERS:
            return PlainTextResponse("too many readers; close other pages of this run\n", status_code=503)
        stream = follow(hub, readers, _number(request.headers.get("last-event-id")), keep_alive)
        headers = {"Cache-Control": "no-cache", "X-Accel-Buffering": "no"}
        return StreamingResponse(stream, media_type="text/event-stream", headers=headers)

    return App(routes=[Route("/events", events), Mount("/", files)])


async def follow(
    hub: Hub, readers: Readers, received: int | None, keep_alive: float = KEEP_ALIVE
) -> AsyncIterator[str]:
    """Yield server-sent events: those after the last `received` one, at least the current one, then all that follow."""
    reader = id(asyncio.current_task())
    number, silence = received or 0, 0.0
    readers.served(reader, number)
    last = hub.last
    missed = hub.after(number) if received is not None else []
    try:
        for event in missed or ([last] if last is not None else []):
            yield sent(event)
            number = event.number
        while not readers.over.is_set():
            readers.served(reader, number)
            await asyncio.sleep(POLL)
            new = hub.after(number)
            for event in new:
                yield sent(event)
                number = event.number
            silence = 0.0 if new else silence + POLL
            if silence >= keep_alive:
                silence = 0.0
                yield ": keep-alive\n\n"
    finally:
        readers.served(reader, None)


def sent(event: Event) -> str:
    """Return an event in the format of server-sent events.

    >>> print(sent(Event(7, 1.5, 0, "running", "started", "The robot moves")), end="")
    id: 7
    data: {"action": 0, "state": "running", "text": "The robot moves", "time": 1.5, "plan": 0, "wait": false}
    <BLANKLINE>
    """
    return f"id: {event.number}\ndata: {json.dumps(event.page())}\n\n"


def _number(text: str | None) -> int | None:
    # Python refuses to read thousands of digits, and no run has as many events as this.
    return int(text) if text is not None and text.isdecimal() and len(text) < 18 else None


def _bind(host: str, port: int) -> socket.socket:
    """Return a listening socket; raise LgpError if the address is in use or not of this machine."""
    listening: socket.socket | None = None
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listening = socket.socket(family, kind, protocol)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(64)
    except OSError as error:
        if listening is not None:
            listening.close()
        reason = error.strerror or error
        raise LgpError(f"cannot listen at {host} port {port}: {reason}; choose another with --port") from error
    return listening


PAGE = "page"
"""Subfolder of a plan with its page."""
PORT = 8642
"""Default port of the page."""


@dataclass(frozen=True)
class Address:
    """Host and port of the page."""

    host: str = HOST
    port: int = PORT


def run_live(
    folder: Path,
    run: RunOptions,
    on_event: Callable[[Event], None] | None = None,
    address: Address | None = None,
    on_served: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Run the plan in a folder and return the summary of the run, see `ExecutionRun.go`.

    Args:
        folder: with the plan; log, page and new plans are written there.
        address: of the page; None for no page. A plan without actions has none either.
        on_served: is called with the URL of the page.

    Raises:
        LgpError: the plan cannot be run, or the page cannot be served.
    """
    servers: list[PageServer] = []

    def on_plan(plan: Plan, where: Path) -> None:
        # The page of the first plan is written before the server starts.
        if servers:
            servers[0].show(_page(plan, where))

    session = ExecutionRun(folder, run, on_event, on_plan)
    if address is None or not session.planner.actions:
        return session.go()
    with PageServer(_page(session.planner.plan, session.where), session.hub, address.host, address.port) as server:
        session.start()
        servers.append(server)
        if on_served is not None:
            on_served(server.address)
        return session.go()


def _page(plan: Plan, where: Path) -> Path:
    """Return the folder of the page of a plan; the page is written if it does not exist or is that of another plan."""
    folder = where / PAGE
    if not is_page_of(plan, folder):
        write_page(plan, folder, pictures=False)
    return folder
