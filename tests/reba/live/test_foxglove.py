"""Scores and the skeleton over the WebSocket that Foxglove and Lichtblick connect to."""

from __future__ import annotations

import builtins
import json
import os
import re
import resource
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from reba.errors import RebaError
from reba.live.notices import FrameWatch
from reba.live.session import Alert, LiveScorer
from tests.reba.live.test_session import frames
from tests.support.json_viewer import problems_of_message, problems_of_schema
from tests.support.paths import ROOT
from tests.support.says import says

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
websocket = pytest.importorskip("websocket", reason="websocket-client is not installed")

from foxglove import messages  # noqa: E402

from reba.live.foxglove import TOPICS, FoxgloveServer, skeleton_markers  # noqa: E402

pytestmark = pytest.mark.slow


PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]


@pytest.fixture
def server() -> Iterator[FoxgloveServer]:
    served = FoxgloveServer(port=0)
    yield served
    served.close()


def test_a_client_gets_scores_and_a_skeleton(server: FoxgloveServer) -> None:
    client = websocket.create_connection(server.address, subprotocols=PROTOCOLS, timeout=20)
    try:
        channels = _channels(client)
        assert set(channels) == set(TOPICS.values())
        scores, figure = (channels[TOPICS[name]] for name in ("scores", "figure"))
        assert (scores["encoding"], scores["schemaEncoding"]) == ("json", "jsonschema")
        schema = json.loads(scores["schema"])
        assert problems_of_schema(schema) == []
        assert figure["schemaName"] == "foxglove.SceneUpdate"
        subscriptions = [{"id": number, "channelId": channel["id"]} for number, channel in enumerate((scores, figure))]
        client.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        scorer = LiveScorer("measured", 1.0, Alert(8, 1.0))
        got: dict[int, bytes] = {}
        at = 0
        while len(got) < 2:
            # A subscription takes effect some time after it was sent.
            block = frames([1, 9], start=at / 10)
            server.publish(block, *scorer.add(block), epoch=1_700_000_000.0)
            at += 1
            client.settimeout(0.2)
            got |= _messages(client)
        record = json.loads(got[0])
        assert record["reba_low"] == record["reba_high"] == record["reba"]
        assert set(record) >= {"time", "window", "exposure", "alert"}
        assert problems_of_message(schema, record) == []
        assert b"person" in got[1]
        assert b"REBA " in got[1]
    finally:
        client.close()


def test_a_notice_is_sent_and_turns_the_skeleton_grey(server: FoxgloveServer) -> None:
    client = websocket.create_connection(server.address, subprotocols=PROTOCOLS, timeout=20)
    try:
        channels = _channels(client)
        notices, figure = (channels[TOPICS[name]] for name in ("notices", "figure"))
        members = list(json.loads(notices["schema"])["properties"].values())
        types = [member["type"] for member in members]
        types += [one["type"] for member in members for one in member.get("properties", {}).values()]
        assert {type(one) for one in types} == {str}
        subscriptions = [{"id": number, "channelId": channel["id"]} for number, channel in enumerate((notices, figure))]
        client.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        scorer = LiveScorer("measured", 1.0, Alert(8, 1.0))
        block = frames([9])
        server.publish(block, *scorer.add(block), epoch=1_700_000_000.0)
        line = scorer.notice(FrameWatch().lose("silent", "no frame for 1.5 s", 1.5))
        got: dict[int, bytes] = {}
        client.settimeout(0.2)
        while len(got) < 2:
            server.publish_notice(line)
            got |= _messages(client)
        assert json.loads(got[0])["notice"]["followed"] is False
        assert b"no signal, last REBA" in got[1]
    finally:
        client.close()


def test_a_client_that_never_reads_delays_nothing_and_costs_bounded_memory(server: FoxgloveServer) -> None:
    client = websocket.create_connection(server.address, subprotocols=PROTOCOLS, timeout=20)
    try:
        channels = _channels(client).values()
        subscriptions = [{"id": number, "channelId": channel["id"]} for number, channel in enumerate(channels)]
        client.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        block = frames([1] * 50)
        records, scores = LiveScorer("measured", 1.0, Alert(8, 1.0)).add(block)
        server.publish(block, records, scores, epoch=0.0)
        time.sleep(0.5)
        before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
        for _ in range(2000):  # 100,000 records of some 700 bytes
            server.publish(block, records, scores, epoch=0.0)
        assert time.monotonic() - start < 30.0
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 30_000  # [KiB]
    finally:
        client.close()


def _channels(client: Any) -> dict[str, dict[str, Any]]:
    messages_by_id: dict[str, dict[str, Any]] = {}
    while len(messages_by_id) < len(TOPICS):
        message = json.loads(client.recv())
        if message["op"] == "advertise":
            messages_by_id |= {channel["topic"]: channel for channel in message["channels"]}
    return messages_by_id


def _messages(client: Any) -> dict[int, bytes]:
    """Return the newest message of each subscription."""
    messages_by_id: dict[int, bytes] = {}
    try:
        while True:
            data = client.recv()
            if isinstance(data, bytes) and data[:1] == b"\x01":
                messages_by_id[struct.unpack_from("<I", data, 1)[0]] = data[13:]
    except websocket.WebSocketTimeoutException:
        return messages_by_id


def test_the_sdk_encodes_the_skeleton(server: FoxgloveServer) -> None:
    scorer = LiveScorer("measured", 1.0, Alert(8, 1.0))
    block = frames([9])
    records, scores = scorer.add(block)
    update = server.scene(skeleton_markers(block.angles[0], scores, 0), records[0], 10**9)
    assert isinstance(update, messages.SceneUpdate)
    assert len(update.encode()) > 500


def test_nothing_that_a_client_sends_reaches_the_terminal(tmp_path: Path) -> None:
    words = [sys.executable, "-P", "-m", "reba", "live", "-", "--foxglove", "0"]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, cwd=tmp_path,
    ) as process:  # fmt: skip
        assert process.stdin
        assert process.stderr
        address = re.search(r"ws://[\d.:]+", process.stderr.readline())
        assert address
        hostile = "\x1b[31mforged"
        for text in (json.dumps({"op": hostile}), json.dumps({"op": "subscribe", "subscriptions": hostile}), hostile):
            client = websocket.create_connection(address[0], subprotocols=PROTOCOLS, timeout=20)
            client.recv()
            client.send(text)
            client.ping()
            while client.recv_data(control_frame=True)[0] != websocket.ABNF.OPCODE_PONG:
                pass
            client.sock.close()  # without a word, which it would tell
        process.stdin.close()
        told = process.stderr.read()
    assert "forged" not in told
    assert "127.0.0.1:" not in told


def test_a_port_that_is_taken_is_one_line(server: FoxgloveServer) -> None:
    port = int(server.address.rpartition(":")[2])
    with pytest.raises(RebaError) as error:
        FoxgloveServer(port=port)
    says(error, port, "--foxglove PORT")


def test_without_the_sdk_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    original = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name.partition(".")[0] == "foxglove":
            raise ImportError(name)
        return original(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RebaError) as error:
        FoxgloveServer(port=0)
    says(error, "foxglove-sdk", "pip install", "dreba[live]")
