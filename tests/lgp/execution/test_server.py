"""The live page: files, and events that survive a dropped connection."""

from __future__ import annotations

import json
import socket
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.client import HTTPResponse
from pathlib import Path
from typing import Any

import pytest

import lgp
from lgp.execution.events import Event, Hub
from lgp.execution.server import PageServer
from tests.support.says import says

pytestmark = pytest.mark.slow


pytest.importorskip("uvicorn", reason="uvicorn is not installed")


def event(number: int, state: str = "running") -> Event:
    return Event(number, 0.5 * number, number - 1, state, "started", f"step {number}")


@pytest.fixture
def page(tmp_path: Path) -> Path:
    (tmp_path / "index.html").write_text("<title>one</title>", encoding="utf-8")
    return tmp_path


@pytest.fixture
def hub() -> Hub:
    return Hub([event(1), event(2)])


@pytest.fixture
def server(page: Path, hub: Hub) -> Iterator[PageServer]:
    with PageServer(page, hub) as running:
        yield running


def stream(server: PageServer, last: int | None = None) -> HTTPResponse:
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    request = urllib.request.Request(f"{server.address}events", headers=headers)
    answer: HTTPResponse = urllib.request.urlopen(request, timeout=10)
    return answer


def heard(answer: HTTPResponse) -> tuple[int, dict[str, Any]]:
    """Return number and data of the next event."""
    number = int(answer.readline().decode().removeprefix("id: "))
    data = json.loads(answer.readline().decode().removeprefix("data: "))
    assert answer.readline() == b"\n"
    return number, data


def test_the_present_state_is_told_at_once_and_then_what_follows(server: PageServer, hub: Hub) -> None:
    with stream(server) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        assert heard(answer) == (
            2,
            {"action": 1, "state": "running", "text": "step 2", "time": 1.0, "plan": 0, "wait": False},
        )
        hub.add(event(3, "waiting"))
        assert heard(answer)[1]["state"] == "waiting"


def test_a_reader_that_was_cut_off_gets_what_it_missed(server: PageServer, hub: Hub) -> None:
    with stream(server) as answer:
        heard(answer)
    hub.add(event(3))
    hub.add(event(4))
    with stream(server, last=2) as answer:
        assert [heard(answer)[0] for _ in range(2)] == [3, 4]


@pytest.mark.parametrize("last", [2, 99])
def test_a_reader_that_missed_nothing_or_comes_from_another_run_gets_the_present(server: PageServer, last: int) -> None:
    with stream(server, last=last) as answer:
        assert heard(answer)[0] == 2


def test_a_quiet_connection_is_kept_alive(page: Path, hub: Hub) -> None:
    with PageServer(page, hub, keep_alive=0.1) as server, stream(server) as answer:
        heard(answer)
        assert answer.readline().startswith(b": ")


def test_several_readers_hear_the_same(server: PageServer, hub: Hub) -> None:
    answers = [stream(server) for _ in range(3)]
    assert [heard(answer)[0] for answer in answers] == [2, 2, 2]
    hub.add(event(3))
    assert [heard(answer)[0] for answer in answers] == [3, 3, 3]
    for answer in answers:
        answer.close()


def test_files_are_served_and_nothing_outside_them(
    server: PageServer, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with urllib.request.urlopen(server.address, timeout=10) as answer:
        assert b"one" in answer.read()
    other = tmp_path_factory.mktemp("new")
    (other / "index.html").write_text("<title>two</title>", encoding="utf-8")
    server.show(other)
    with urllib.request.urlopen(server.address, timeout=10) as answer:
        assert b"two" in answer.read()
    for path in ("../plan.json", "%2e%2e/plan.json", "nothing.js"):
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(server.address + path, timeout=10)


def test_the_server_lets_readers_take_the_last_event(page: Path, hub: Hub) -> None:
    got: list[int] = []
    with PageServer(page, hub) as server:
        answer = stream(server)
        heard(answer)
        reader = threading.Thread(target=lambda: got.append(heard(answer)[0]))
        reader.start()
        hub.add(event(3, "finished"))
    reader.join(10)
    assert got == [3]


def test_only_this_machine_sees_the_page(server: PageServer) -> None:
    assert server.address.startswith("http://127.0.0.1:")


def test_a_port_that_is_taken_is_one_clear_error(page: Path, hub: Hub) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(lgp.LgpError) as error:
            PageServer(page, hub, port=port)
        says(error, f"port {port}", "--port")
