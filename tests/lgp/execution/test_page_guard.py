"""The page server against clients that are no page of it: other names, other origins, silent and slow connections."""

from __future__ import annotations

import contextlib
import resource
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from lgp.execution.events import Event, Hub
from lgp.execution.server import MAX_READERS, PageServer
from reba.loopback import MAX_CONNECTIONS

pytestmark = pytest.mark.slow
pytest.importorskip("uvicorn", reason="uvicorn is not installed")
WAIT = 0.5
"""[s] That the server of these tests waits for a client."""
LARGE = 20_000_000
"""[bytes] More than all buffers between server and client hold."""


@pytest.fixture
def hub() -> Hub:
    return Hub([Event(1, 0.5, 0, "running", "started", "step 1")])


@pytest.fixture
def server(tmp_path: Path, hub: Hub) -> Iterator[PageServer]:
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").write_text("<title>one</title>", encoding="utf-8")
    (page / "large.bin").write_bytes(bytes(LARGE))
    (tmp_path / "plan.json").write_text("secret", encoding="utf-8")
    with PageServer(page, hub, wait_seconds=WAIT) as running:
        yield running


def port(server: PageServer) -> int:
    return int(server.address.rstrip("/").rpartition(":")[2])


def connect(server: PageServer) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port(server)), timeout=10)


def answer(server: PageServer, sent: str) -> tuple[int, str]:
    """Send a request as it is written here, PORT replaced, and return status and text of the answer."""
    with connect(server) as client:
        client.sendall(sent.replace("PORT", str(port(server))).replace("\n", "\r\n").encode("latin-1"))
        text = b""
        with contextlib.suppress(ConnectionResetError):
            while data := client.recv(65536):
                text += data
    decoded = text.decode("latin-1")
    return int(decoded.split()[1]) if decoded else 0, decoded


def get(server: PageServer, path: str = "/", host: str = "127.0.0.1:PORT", more: str = "") -> tuple[int, str]:
    return answer(server, f"GET {path} HTTP/1.1\nHost: {host}\n{more}\n")


@pytest.mark.parametrize("host", ["127.0.0.1:PORT", "localhost:PORT", "LOCALHOST:PORT", "[::1]:PORT"])
def test_names_of_this_machine_are_answered(server: PageServer, host: str) -> None:
    status, text = get(server, host=host)
    assert status == 200
    assert "<title>one" in text


@pytest.mark.parametrize(
    "host",
    [
        "rebound.example:PORT",
        "rebound.example",
        "127.0.0.1",
        "127.0.0.1:1",
        "localhost.rebound.example:PORT",
        "",
        "a b",
    ],
)
@pytest.mark.parametrize("path", ["/", "/events"])
def test_other_names_are_refused(server: PageServer, host: str, path: str) -> None:
    status, text = get(server, path, host)
    assert status in (400, 421)
    assert "step 1" not in text
    assert "<title>" not in text


def test_a_request_without_a_name_or_with_two_is_refused(server: PageServer) -> None:
    for request in ("GET / HTTP/1.0\n\n", "GET / HTTP/1.1\n\n", "GET / HTTP/1.1\nHost: 127.0.0.1:PORT\nHost: x\n\n"):
        status, text = answer(server, request)
        assert status in (400, 421)
        assert "<title>" not in text


@pytest.mark.parametrize("origin", ["https://example.org", "null", "http://localhost:1", "https://127.0.0.1:PORT"])
def test_pages_of_other_origins_read_nothing(server: PageServer, origin: str) -> None:
    status, text = get(server, "/events", more=f"Origin: {origin}\n")
    assert status == 403
    assert "step 1" not in text
    assert "access-control" not in text.lower()


def test_its_own_page_reads(server: PageServer) -> None:
    assert get(server, more="Origin: http://127.0.0.1:PORT\n")[0] == 200
    assert get(server, host="localhost:PORT", more="Origin: http://localhost:PORT\n")[0] == 200


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "HEAD", "CONNECT", "BREW"])
@pytest.mark.parametrize("path", ["/", "/events"])
def test_other_methods_are_refused(server: PageServer, method: str, path: str) -> None:
    status, _ = answer(server, f"{method} {path} HTTP/1.1\nHost: 127.0.0.1:PORT\nContent-Length: 0\n\n")
    assert status == 405


@pytest.mark.parametrize(
    "path", ["/../plan.json", "/%2e%2e/plan.json", "/..%2fplan.json", "//../plan.json", "/%00", "/a/" + "b" * 5000]
)
def test_no_path_leaves_the_page(server: PageServer, path: str) -> None:
    status, text = get(server, path)
    assert status == 404
    assert "secret" not in text


def test_answers_say_how_a_browser_may_use_them(server: PageServer) -> None:
    for path in ("/", "/nothing"):
        text = get(server, path)[1].lower()
        assert "x-content-type-options: nosniff" in text
        assert "frame-ancestors 'none'" in text
        assert "cross-origin-resource-policy: same-origin" in text
        assert "access-control" not in text


@pytest.mark.parametrize("junk", ["\x16\x03\x01\x02", "GET /" + "x" * 200_000, "GET / HTTP/1.1\nA: " + "x" * 200_000])
def test_what_is_no_request_is_refused_quietly(
    server: PageServer, junk: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert answer(server, junk + "\n\n")[0] in (0, 400)
    assert get(server)[0] == 200
    assert capfd.readouterr().err == ""


def closed_after(client: socket.socket, seconds: float) -> bool:
    client.settimeout(seconds)
    with contextlib.suppress(ConnectionResetError):
        try:
            while client.recv(65536):
                pass
        except TimeoutError:
            return False
    return True


def test_a_client_that_does_not_complete_its_request_is_cut_off(server: PageServer) -> None:
    with connect(server) as silent, connect(server) as slow:
        slow.sendall(b"GET / HTTP/1.1\r\n")
        end = time.monotonic() + 10 * WAIT
        with contextlib.suppress(OSError):
            while time.monotonic() < end:
                slow.sendall(b"X: y\r\n")
                time.sleep(WAIT / 5)
        assert time.monotonic() < end
        assert closed_after(silent, 1.0)


def test_a_connection_carries_one_request(server: PageServer) -> None:
    with connect(server) as client:
        client.sendall(f"GET / HTTP/1.1\r\nHost: localhost:{port(server)}\r\n\r\n".encode())
        assert closed_after(client, 5.0)


def test_a_client_that_does_not_read_is_cut_off_and_costs_no_memory(server: PageServer) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with contextlib.ExitStack() as stack:
        clients = [stack.enter_context(connect(server)) for _ in range(20)]
        for client in clients:
            client.sendall(f"GET /large.bin HTTP/1.1\r\nHost: localhost:{port(server)}\r\n\r\n".encode())
        time.sleep(3 * WAIT)
        assert get(server)[0] == 200
        for client in clients:
            assert closed_after(client, 5.0)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before  # [KiB]
    assert grown < 2 * LARGE // 1024


def test_readers_of_events_that_never_read_do_not_delay_the_run(server: PageServer, hub: Hub) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(MAX_READERS):
            client = stack.enter_context(connect(server))
            client.sendall(f"GET /events HTTP/1.1\r\nHost: localhost:{port(server)}\r\n\r\n".encode())
            client.recv(100)
        status, text = get(server, "/events")
        assert status == 503
        assert "too many readers" in text
        assert get(server)[0] == 200
        start = time.monotonic()
        for number in range(2, 3000):
            hub.add(Event(number, 0.0, 0, "running", "started", "x" * 100))
        assert time.monotonic() - start < 20.0  # a reader that is waited for would never read
    assert get(server)[0] == 200


def test_connections_are_few(server: PageServer) -> None:
    with contextlib.ExitStack() as stack:
        clients = [stack.enter_context(connect(server)) for _ in range(MAX_CONNECTIONS + 10)]
        assert sum(closed_after(client, 0.01) for client in clients) >= 10
        time.sleep(2 * WAIT)
        assert get(server)[0] == 200


def test_the_server_ends_in_spite_of_clients(tmp_path: Path, hub: Hub) -> None:
    (tmp_path / "index.html").write_text("<title>one</title>", encoding="utf-8")
    server = PageServer(tmp_path, hub)
    with contextlib.ExitStack() as stack:
        with server:
            for request in (b"", b"GET", f"GET /events HTTP/1.1\r\nHost: localhost:{port(server)}\r\n\r\n".encode()):
                stack.enter_context(connect(server)).sendall(request)
            time.sleep(0.2)
            start = time.monotonic()
        assert time.monotonic() - start < 8.0


def test_an_address_of_ones_own_is_a_name_too(tmp_path: Path, hub: Hub) -> None:
    (tmp_path / "index.html").write_text("<title>one</title>", encoding="utf-8")
    with PageServer(tmp_path, hub, host="0.0.0.0") as server:
        assert get(server, host="127.0.0.1:PORT")[0] == 200
        assert get(server, host="rebound.example:PORT")[0] == 421
