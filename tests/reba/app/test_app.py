"""`reba app`: from drop to download in a browser, answers to other requests, and that nothing is kept."""

from __future__ import annotations

import contextlib
import http.client
import json
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import reba
from reba.analysis.wording import percent, span
from reba.app.recordings import Recordings
from reba.app.server import AppServer
from reba.errors import RebaError
from reba.loopback import MAX_CONNECTIONS
from tests.reba.readers.test_whole_recording import JOINTS, state, write
from tests.support.browser import chromium, needs_browser, preferring, resize, until, visible, weak_texts
from tests.support.paths import ROOT
from tests.support.says import says

pytestmark = pytest.mark.slow
pytest.importorskip("starlette", reason="starlette is not installed")
pytest.importorskip("uvicorn", reason="uvicorn is not installed")
RECORDING = ROOT / "datasets" / "simulated_assembly.csv"


@pytest.fixture
def address() -> Iterator[str]:
    server = AppServer()
    folder = Path(server._folder.name)
    thread = threading.Thread(target=server.run)
    thread.start()
    yield server.address
    server.stop()
    thread.join(10.0)
    assert not folder.exists()


def ask(address: str, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, Any]:
    connection = http.client.HTTPConnection(address.removeprefix("http://").rstrip("/"), timeout=60)
    sent = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
    connection.request(method, path, sent, headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    if answer.headers.get("content-type") == "application/json":
        return answer.status, json.loads(content)
    return answer.status, content


def uploaded(address: str, path: Path = RECORDING) -> str:
    status, content = ask(address, "POST", f"/recordings?name={path.name}", path.read_bytes())
    assert status == 200, content
    return str(content["id"])


def test_scores_are_those_of_the_command(address: str) -> None:
    key = uploaded(address)
    status, about = ask(address, "GET", f"/recordings/{key}")
    assert (status, about["usable"], about["frames"]) == (200, True, len(reba.read(RECORDING).data))
    tasks = [{"name": "first half", "end": 30.0}, {"name": "second half", "start": 30.0}]
    settings = {"load": 8, "coupling": "fair", "tasks": tasks}
    status, result = ask(address, "POST", f"/recordings/{key}/scores", settings)
    assert status == 200, result
    for row, task in zip(result["rows"], tasks, strict=True):
        postures = reba.read(RECORDING, start=task.get("start"), end=task.get("end"))
        summary = reba.score(postures, load=8, coupling="fair").summary()
        assert (row["name"], row["reba"]) == (task["name"], summary["reba"])
        assert row["verdict"] == summary["verdict"]["text"]
        assert row["high_seconds"] == summary["verdict"]["high_seconds"]
    status, page = ask(address, "GET", f"/results/{result['id']}/report.html")
    assert status == 200
    assert b"first half" in page
    assert b"second half" in page
    assert ask(address, "GET", f"/results/{result['id']}/scores.xlsx")[1].startswith(b"PK")
    status, compared = ask(address, "POST", "/comparison", {"first": result["id"], "second": result["id"]})
    assert status == 200
    assert compared["verdicts"] == [["first half", result["rows"][0]["verdict"]]] * 2
    ends = reba.score(reba.read(RECORDING, end=30.0), load=8, coupling="fair").summary()["range"]
    p90 = span(ends["p90_low"], ends["p90_high"])
    assert compared["rows"][0] == ["REBA, 90th percentile", p90, p90, "\u22121 to +1"]
    assert [row[0] for row in compared["rows"]][-1] == "Time at REBA 8 or more, share"
    status, page = ask(address, "GET", f"/results/{compared['id']}/report.html")
    assert status == 200
    assert b"B minus A" in page
    again = {"first": compared["id"], "second": result["id"]}
    status, refused = ask(address, "POST", "/comparison", again)
    assert status == 400
    says(refused["error"], "comparison", "choose two results")
    assert ask(address, "DELETE", f"/recordings/{key}")[0] == 200
    assert ask(address, "GET", f"/recordings/{key}")[0] == 400


def test_a_recording_is_read_by_the_neutral_posture_and_the_person_that_are_chosen(
    address: str, tmp_path: Path
) -> None:
    points = ROOT / "datasets" / "balancing_keypoints.trc"
    key = uploaded(address, points)
    before = ask(address, "GET", f"/recordings/{key}")[1]
    assert "--" not in str(before)  # options are those of the command
    assert before["topics"] == []
    assert "give one below" in str(before["warnings"])
    after = ask(address, "GET", f"/recordings/{key}?neutral=first:0.5s")[1]
    assert (after["warnings"], after["assumed"][0]) == ([], before["assumed"][0])
    assert "neutral posture from" in after["assumed"][1]
    scored = ask(address, "POST", f"/recordings/{key}/scores", {"neutral": "first:0.5s"})[1]
    right = reba.score(reba.read(points, neutral="first:0.5s")).summary()
    assert scored["rows"][0]["range"] == right["range"] != reba.score(reba.read(points)).summary()["range"]

    rows = [
        state(at, at, [f"{body}_{name}" for name in JOINTS], channel=1) for at in range(300) for body in ("ann", "bob")
    ]
    key = uploaded(address, write(tmp_path / "two.mcap", rows))
    about = ask(address, "GET", f"/recordings/{key}")[1]
    assert not about["usable"]
    assert about["recognised"].endswith("; choose one below")
    assert about["topics"] == ["/joint_states#ann", "/joint_states#bob"]
    assert ask(address, "GET", f"/recordings/{key}?topic=%2Fjoint_states%23bob")[1]["usable"]
    assert ask(address, "POST", f"/recordings/{key}/scores", {"topic": "/joint_states#bob"})[0] == 200
    status, refused = ask(address, "POST", f"/recordings/{key}/scores", {})
    assert status == 400
    assert refused["error"].endswith("; choose one below")


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/", {"Host": "evil.example"}, 421),
        ("POST", "/recordings?name=a.csv", {"Origin": "http://evil.example"}, 403),
        ("PUT", "/recordings", {}, 405),
        ("GET", "/results/x/../../etc/passwd", {}, 404),
        ("GET", "/results/none/report.html", {}, 404),
        ("GET", "/nothing", {}, 404),
        ("POST", "/comparison", {}, 400),
    ],
)
def test_other_requests_are_refused(address: str, method: str, path: str, headers: dict[str, str], status: int) -> None:
    assert ask(address, method, path, b"{" if method == "POST" else None, **headers)[0] == status


@pytest.mark.parametrize(
    ("name", "content", "facts"),
    [
        ("../../evil", b"time,trunk_flexion\n0,abc\n", ("evil",)),
        ("bad.csv", b"time,trunk_flexion\n0,abc\n", ("bad.csv", "abc")),
        ("bad.mcap", b"no recording", ("bad.mcap",)),
    ],
)
def test_what_is_no_recording_is_one_line(address: str, name: str, content: bytes, facts: tuple[str, ...]) -> None:
    status, kept = ask(address, "POST", f"/recordings?name={name}", content)
    assert status == 200
    assert "/" not in kept["name"]
    status, about = ask(address, "GET", f"/recordings/{kept['id']}")
    text = about["error"] if status == 400 else about["recognised"]
    assert "/reba-app-" not in text  # places of the server are nobody's business
    says(text, *facts)


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("..%5c..%5cshift.csv", "shift.csv"),
        ("..%2f..%2fshift.csv", "shift.csv"),
        ("/etc/shift.csv", "shift.csv"),
        ("a.csv&name=../shift.csv", "shift.csv"),
        ("%22%3cb%3e;%27.csv", "\"<b>;'.csv"),
        (f"{'%c3%a4' * 125}.csv", f"{'ä' * 125}.csv"),
        ("%2e%2e", ""),
        ("x%00.csv", ""),
        ("x%1b%5b31m.csv", ""),
        ("x%0d%0aSet-Cookie:1.csv", ""),
        ("%e2%80%aevsc.csv", ""),
        (f"{'%c3%a4' * 126}.csv", ""),
        (f"{'%f0%9f%98%80' * 180}.csv", ""),
        ("a" * 256, ""),
    ],
)
def test_a_name_is_that_of_a_file_or_refused(address: str, name: str, kept: str) -> None:
    status, answer = ask(address, "POST", f"/recordings?name={name}", RECORDING.read_bytes())
    assert (status, answer.get("name", "")) == (200 if kept else 400, kept)
    if kept:
        status, scored = ask(address, "POST", f"/recordings/{answer['id']}/scores", {})
        assert (status, scored["name"]) == (200, kept)
    else:
        assert answer["error"].isprintable()


WAIT = 0.5
"""[s] That the server of the next test waits for a client."""


def test_uploads_that_fall_silent_hold_up_no_other_one(tmp_path: Path) -> None:
    server = AppServer(wait_seconds=WAIT)
    thread = threading.Thread(target=server.run)
    thread.start()
    port = int(server.address.rstrip("/").rpartition(":")[2])
    head = f"POST /recordings?name=a.csv HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 1000\r\n\r\n".encode()
    try:
        with contextlib.ExitStack() as stack:
            clients = [
                stack.enter_context(socket.create_connection(("127.0.0.1", port), 10)) for _ in range(MAX_CONNECTIONS)
            ]
            for client in clients:
                client.sendall(head + b"time,")
            sending = clients.pop()  # a client that sends on is waited for
            for _ in range(12):
                time.sleep(WAIT / 3)
                sending.sendall(b"x")
            for client in clients:
                client.settimeout(5.0)
                with contextlib.suppress(ConnectionResetError):
                    assert client.recv(100) == b""
            assert len(list(Path(server._folder.name).iterdir())) == 1  # what was sent is not kept
            assert ask(server.address, "GET", "/")[0] == 200
            sending.sendall(b"x" * 983)
            assert sending.recv(100).startswith(b"HTTP/1.1 200")
    finally:
        server.stop()
        thread.join(10.0)


@pytest.mark.parametrize(
    ("settings", "facts"),
    [
        ({"load": -1}, ("load", "-1")),
        ({"load": True}, ("load", "True")),
        ({"load": 10**400}, ("load", "1329 bits")),
        ({"tasks": [{"name": "x", "end": 10**400}]}, ("'x'", "1329 bits", "seconds")),
        ({"rules": "mine.toml"}, ("rules", "mine.toml", "measured")),
        ({"coupling": "good "}, ("coupling", "good")),
        ({"colour": 1}, ("colour", "load")),
        ({"tasks": [{"name": "x", "start": "now"}]}, ("'x'", "'now'", "seconds")),
        ({"tasks": "all"}, ("tasks", "list")),
        ({"tasks": {}}, ("tasks", "list")),
        ({"tasks": [{"name": 5}]}, ("task", "text")),
        ({"tasks": [{"begin": 5}]}, ("task", "start")),
        ({"neutral": "first:0s"}, ("neutral", "first:0s")),
        ({"neutral": 3}, ("neutral", "3")),
        ({"topic": "/none"}, ("no stream '/none'",)),
        ({"topic": ["/none"]}, ("topic", "list", "text")),
        ({"shock": "yes"}, ("shock", "'yes'", "true")),
        ({"arm_supported": 1}, ("arm_supported", "1", "true")),
        ({"tasks": [{"name": "late", "start": 1e6}]}, ("1",)),
    ],
)
def test_wrong_settings_are_one_line(tmp_path: Path, settings: dict[str, Any], facts: tuple[str, ...]) -> None:
    recordings = Recordings(tmp_path)
    place = tmp_path / "key"
    place.mkdir()
    shutil.copy(RECORDING, place)
    recordings._recordings["key"] = place / RECORDING.name
    with pytest.raises(RebaError) as error:
        recordings.score("key", settings)
    says(error, *facts)


@needs_browser
def test_from_drop_to_download(address: str, tmp_path: Path) -> None:
    with chromium(tmp_path / "profile") as browser:
        browser.get(address)
        for _ in range(2):
            browser.find_element("id", "files").send_keys(str(RECORDING))
            until(browser, "!document.querySelector('#busy').textContent")
        until(browser, "document.querySelectorAll('form:not([hidden])').length === 2")
        for load in (0, 12):
            card = browser.find_elements("css selector", ".recording")[1 if load else 0]
            card.find_element("name", "load").send_keys(str(load))
            card.find_element("css selector", "[type=submit]").click()
            until(browser, f"document.querySelectorAll('.results a').length >= {8 if load else 4}")
        text = browser.find_element("css selector", ".results").text
        assert "90th percentile" in text
        summary = reba.score(reba.read(RECORDING), load=0).summary()
        assert text.startswith(summary["verdict"]["text"])
        low, high = (percent(end / summary["seconds"]) for end in summary["verdict"]["high_seconds"])
        assert low != high
        assert f"{low} to {high}" in text
        browser.find_element("id", "compare").click()
        until(browser, "document.querySelector('#compared table')")
        compared = browser.find_element("id", "compared")
        assert "undetermined" not in compared.text
        assert len(compared.find_elements("css selector", ".verdict, a")) == 4
        for link in browser.find_elements("css selector", "details > summary, .add"):
            link.click()
        resize(browser, 390)
        assert browser.find_elements("css selector", ".tasks input")
        assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
        damaged = tmp_path / "damaged.csv"
        damaged.write_text("time,trunk_flexion\n0,abc\n")
        browser.find_element("id", "files").send_keys(str(damaged))
        until(browser, "document.querySelector('.alarm')")
        assert visible(browser, "form") == 2
        for card in browser.find_elements("css selector", ".recording")[1:]:
            card.find_element("class name", "remove").click()
        assert len(browser.find_elements("css selector", ".recording")) == 1
        refused = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        assert ["status of 400" in entry["message"] for entry in refused] == [True]
        for scheme in ("light", "dark"):
            with preferring(browser, scheme):
                assert weak_texts(browser) == []
        link = browser.find_element("link text", "Open the report").get_attribute("href")
        browser.get(link)
        until(browser, "document.title.includes('REBA')")
        assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
