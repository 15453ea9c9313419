"""The loopback server of `reba app`: the page, uploads, scores and their files."""

from __future__ import annotations

import json
import re
import socket
import tempfile
from collections.abc import Awaitable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from reba.app.recordings import CHOICES, RESULTS, Recordings
from reba.errors import RebaError
from reba.extras import missing
from reba.files import from_json
from reba.loopback import WAIT_SECONDS, Guard, bounded_connection
from reba.report.page import read, template

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response

HOST: Final = "127.0.0.1"
"""Loopback: other machines do not reach the page, and there is no option to change it."""
METHODS: Final = ("GET", "POST", "DELETE")
FIELDS: Final = (
    (re.compile(r" \(--neutral first:3s\)"), " below"),
    (re.compile(r"choose one with --topic, like --topic [^\"]*"), "choose one below"),
)
"""What messages say of options -> the same of the fields of the page."""
MOST_JSON: Final = 1 << 20
"""[bytes] Of a request that is no recording."""


class AppServer:
    """The server of a page; `run` blocks until it is stopped.

    Args:
        port: 0 for any free one.
        wait_seconds: see `reba.loopback.WAIT_SECONDS`.

    Attributes:
        address: URL of the page.

    Raises:
        MissingPackageError: starlette or uvicorn is not installed.
        RebaError: the port is in use.
    """

    def __init__(self, port: int = 0, *, wait_seconds: float = WAIT_SECONDS) -> None:
        try:
            import starlette  # noqa: F401
            import uvicorn
        except ImportError as error:
            raise missing(error.name or "uvicorn", "reba app", "app") from error
        self._folder = tempfile.TemporaryDirectory(prefix="reba-app-")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((HOST, port))
            self._socket.listen()
        except OSError as error:
            self._socket.close()
            self._folder.cleanup()
            why = error.strerror or error
            raise RebaError(f"port {port} cannot be used ({why}); give another with --port") from error
        number = self._socket.getsockname()[1]
        self.address = f"http://{HOST}:{number}/"
        app = Guard(application(Recordings(Path(self._folder.name))), HOST, number, METHODS)
        config = uvicorn.Config(
            app,
            http=bounded_connection(wait_seconds),
            ws="none",
            lifespan="off",
            log_level="critical",  # requests that cannot be answered are the client's problem
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)

    def run(self) -> None:
        """Serve until interrupted, then remove the recordings."""
        try:
            self._server.run(sockets=[self._socket])
        finally:
            self._socket.close()
            self._folder.cleanup()

    def stop(self) -> None:
        """Make `run` return, from another thread."""
        self._server.should_exit = True


def application(recordings: Recordings) -> Starlette:
    """Return the ASGI application of some recordings."""
    from starlette.applications import Starlette
    from starlette.concurrency import run_in_threadpool
    from starlette.responses import FileResponse, HTMLResponse
    from starlette.responses import Response as Plain
    from starlette.routing import Route

    async def answer(work: Awaitable[Any]) -> Response:
        try:
            content, status = await work, 200
        except RebaError as error:
            content, status = {"error": str(error)}, 400
        # Of the places of recordings only the names of the files are the user's.
        text = _place(recordings.folder).sub("", json.dumps(content))
        for option, words in FIELDS:
            text = option.sub(words, text)
        return Plain(text, status_code=status, media_type="application/json")

    async def page(_: Request) -> Response:
        return HTMLResponse(template("reba.app", "page.html").render(choices=CHOICES))

    async def script(_: Request) -> Response:
        return Plain(read("reba.app", "page.js"), media_type="text/javascript")

    async def upload(request: Request) -> Response:
        length = request.headers.get("content-length", "")
        size = int(length) if length.isdecimal() else None
        return await answer(recordings.add(request.query_params.get("name", ""), size, request.stream()))

    async def about(request: Request) -> Response:
        return await answer(run_in_threadpool(recordings.about, request.path_params["key"], request.query_params))

    async def remove(request: Request) -> Response:
        return await answer(run_in_threadpool(recordings.remove, request.path_params["key"]))

    async def scores(request: Request) -> Response:
        async def work() -> Any:
            given = await _json(request)
            return await run_in_threadpool(recordings.score, request.path_params["key"], given)

        return await answer(work())

    async def result(request: Request) -> Response:
        code, name = request.path_params["code"], request.path_params["name"]
        try:
            path = recordings.result(code, name)
        except RebaError as error:
            return Plain(f"{error}\n", status_code=404, media_type="text/plain")
        shown = "inline" if name.endswith(".html") else "attachment"
        return FileResponse(path, media_type=RESULTS[name], filename=name, content_disposition_type=shown)

    async def compared(request: Request) -> Response:
        async def work() -> Any:
            given = await _json(request)
            return await run_in_threadpool(recordings.compare, str(given.get("first")), str(given.get("second")))

        return await answer(work())

    return Starlette(
        routes=[
            Route("/", page, methods=["GET"]),
            Route("/page.js", script, methods=["GET"]),
            Route("/recordings", upload, methods=["POST"]),
            Route("/recordings/{key}", about, methods=["GET"]),
            Route("/recordings/{key}", remove, methods=["DELETE"]),
            Route("/recordings/{key}/scores", scores, methods=["POST"]),
            Route("/results/{code}/{name}", result, methods=["GET"]),
            Route("/comparison", compared, methods=["POST"]),
        ]
    )


def _place(folder: Path) -> re.Pattern[str]:
    """Return the pattern of the folder of a recording, as it stands before its name."""
    return re.compile(re.escape(f"{folder}/") + r"[\w-]+/")


async def _json(request: Request) -> Mapping[str, Any]:
    """Return the object of a request.

    Raises:
        RebaError: it is none, or too large.
    """
    text = b""
    async for part in request.stream():
        text += part
        if len(text) > MOST_JSON:
            raise RebaError(f"the request has more than {MOST_JSON} bytes; send fewer tasks")
    try:
        given = from_json(text)
    except (ValueError, RecursionError) as error:
        raise RebaError("the request is no JSON; reload the page") from error
    if not isinstance(given, dict):
        raise RebaError("the request is no JSON object; reload the page")
    return given
