"""Every JSON schema that the packages write into an MCAP file or serve is one that viewers know.

A topic whose schema they refuse shows nothing at all, so all places that write one stand here.
"""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import reba
from lgp.execution.log import JSON_SCHEMAS
from reba.live.foxglove import record_schema
from reba.live.session import Alert, LiveScorer
from reba.writers.json_messages import without_missing
from tests.reba.live.test_session import frames
from tests.support.execution_plans import saved, went
from tests.support.json_viewer import problems_of_message, problems_of_schema, problems_of_texts, unnamed
from tests.support.lgp_worlds import HAS_ROBOTS
from tests.support.mcap_check import checked
from tests.support.paths import ROOT

WRITERS = {"reba/writers/mcap.py", "reba/live/foxglove.py", "lgp/execution/log.py"}
"""Modules that write JSON channels; each has a test below."""


def test_every_module_that_writes_a_json_channel_is_tested() -> None:
    found = set()
    for path in (file for package in ("reba", "dreba", "lgp") for file in (ROOT / package).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
        if "jsonschema" in texts:
            found.add(path.relative_to(ROOT).as_posix())
    assert found == WRITERS


@pytest.mark.parametrize(
    "schema",
    [
        {"type": ["object"], "properties": {}},
        {"type": "object"},
        {"type": "object", "properties": {"a": {"type": ["number", "null"]}}},
        {"type": "object", "properties": {"a": {"type": "null"}}},
        {"type": "object", "properties": {"a": {"description": "factor"}}},
        {"type": "object", "properties": {"a": {"oneOf": [{"type": "number"}]}}},
        {"type": "object", "properties": {"a": {"type": "object", "additionalProperties": {"type": "number"}}}},
        {"type": "object", "properties": {"a": {"type": "array"}}},
        {"type": "object", "properties": {"a": {"type": "array", "items": {"type": "array"}}}},
        {"type": "object", "properties": {"a": {"type": "array", "items": {"type": "object"}}}},
        {"type": "object", "properties": {"a": {"type": "string", "contentEncoding": "hex"}}},
    ],
)
def test_what_viewers_refuse(schema: dict[str, Any]) -> None:
    assert len(problems_of_schema(schema)) == 1


def test_what_viewers_know() -> None:
    plain = {name: {"type": name} for name in ("boolean", "string", "number", "integer")}
    image = {"type": "string", "contentEncoding": "base64"}
    inside = {"type": "object", "properties": {**plain, "image": image, "empty": {"type": "object", "properties": {}}}}
    schema = {"type": "object", "properties": {"inside": inside, "list": {"type": "array", "items": inside}}}
    assert problems_of_schema(schema) == []
    assert problems_of_message(schema, {"list": [{"number": 1, "boolean": True}], "more": None}) == []
    assert problems_of_message(schema, {"inside": {"number": None}}) == [
        "root.inside.number: expected number, got None"
    ]


def test_tables(tmp_path: Path) -> None:
    time = [0.0, 0.1, 0.2]
    frame = {"time": time, "trunk_flexion": [10.0, 20.0, None], "load": 2.0, "coupling_left": "fair", "shock": True}
    pd.DataFrame(frame).to_csv(tmp_path / "in.csv", index=False)
    postures = reba.read(tmp_path / "in.csv")
    reba.write_postures(postures, tmp_path / "postures.mcap")
    reba.write_scores(reba.score(postures), tmp_path / "scores.mcap")
    for name in ("postures", "scores"):
        check(tmp_path / f"{name}.mcap", all_named=True)


def check(path: Path, *, all_named: bool) -> set[str]:
    """Check the JSON topics of a file, also that they name all properties of their messages, and return the topics."""
    content = checked(path)
    topics = set()
    for topic, rows in content.messages.items():
        schema = content.schemas[content.channels[rows[0][0]].schema_id]
        if schema.encoding == "jsonschema":
            topics.add(topic)
            texts = content.payloads(topic)
            assert problems_of_texts(schema.data, texts) == [], topic
            assert not all_named or not {
                name for text in texts for name in unnamed(json.loads(schema.data), json.loads(text))
            }
    return topics


def test_live_records() -> None:
    schema = record_schema()
    assert problems_of_schema(schema) == []
    scorer = LiveScorer("measured", 2.0, Alert(8, 0.1))
    first, later = frames([1, 9, 9, 9, 9, 1, 1, 1, 1]), frames([1, 9], start=2.0)
    later.angles[:, reba.COLUMNS.index("neck_flexion")] = float("nan")
    records = [record for part in (first, later) for record in scorer.add(part)[0]]
    assert any(record["reba"] is None for record in records)
    assert {record["alert"]["event"] for record in records} == {None, "raised", "cleared"}
    for record in map(without_missing, records):
        assert problems_of_message(schema, record) == []
        assert unnamed(schema, record) == set()
        for name, member in record.items():
            if isinstance(member, dict):
                assert unnamed(schema["properties"][name], member) == set()


@pytest.mark.parametrize("topic", JSON_SCHEMAS)
def test_topics_of_a_run(topic: str) -> None:
    name, properties = JSON_SCHEMAS[topic]
    assert name
    assert problems_of_schema({"type": "object", "properties": properties}) == []


@pytest.mark.slow
@pytest.mark.skipif(not HAS_ROBOTS, reason="the robot models are not installed")
def test_a_run(tmp_path: Path) -> None:
    went(saved(tmp_path / "plan"), compare=True)
    topics = check(tmp_path / "plan" / "run.mcap", all_named=False)
    assert topics >= {"/plan", "/scene", "/events", "/state", "/ergonomics/posture"}
