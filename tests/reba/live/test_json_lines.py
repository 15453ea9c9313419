"""`reba live -`: JSON lines on standard input, good and bad."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import reba
from reba.cli import cli
from reba.live.follow import Follower
from reba.live.frames import ReadingOptions
from reba.live.json_lines import LineStore
from reba.live.session import Alert, LiveScorer
from tests.support.invoke import invoke
from tests.support.live_sources import assert_same, batch, json_lines, rewritten, run_live
from tests.support.paths import DATASETS
from tests.support.says import says

pytestmark = pytest.mark.slow


ASSEMBLY = DATASETS / "simulated_assembly.csv"


def rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table, empty cells as null."""
    return json.loads(table.to_json(orient="records", double_precision=15))


def scored(table: pd.DataFrame, **options: Any) -> pd.DataFrame:
    return reba.score(table, activity="none", **options).data


def table_of_postures(count: int = 300) -> pd.DataFrame:
    """Return random postures at 20 Hz, some angles missing, with columns of factors."""
    random = np.random.default_rng(11)
    angles = random.uniform(-60, 120, (count, len(reba.COLUMNS)))
    angles[random.random(angles.shape) < 0.1] = np.nan
    table = pd.DataFrame(angles, columns=list(reba.COLUMNS)).drop(columns=["shoulder_elevation_left"])
    table.insert(0, "time", np.arange(count) / 20)
    table["shoulder_raised_left"] = random.random(count) < 0.5
    table["load"] = random.uniform(0, 15, count)
    table["coupling"] = random.choice(["good", "poor"], count)
    return table


def test_rows_give_the_scores_of_the_table() -> None:
    table = table_of_postures()
    code, lines, messages = run_live("-", "--rules", "paper", "--activity", "static", stdin=json_lines(rows(table)))
    assert code == 0, messages
    expected = reba.score(table, rules="paper", activity="static").data
    assert_same(lines[:-1], expected)


def test_rows_of_a_data_set_give_its_scores_with_a_neutral_posture() -> None:
    table = pd.read_csv(ASSEMBLY).iloc[:400]
    text = json_lines(rows(table))
    code, lines, messages = run_live("-", "--neutral", "first:3s", "--load", "6", stdin=text)
    assert code == 0, messages
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "part.csv"
        table.to_csv(path, index=False)
        assert_same(lines[:-1], batch(path, neutral="first:3s", load=6.0))


@pytest.mark.parametrize("stamp", ["number", "ros"])
def test_joint_states_give_the_scores_of_the_recording(stamp: str, tmp_path: Path) -> None:
    path = rewritten(tmp_path / "joints.mcap", 20.0, 30.0, chunked=True)
    states = []
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, _, _, message in reader.iter_decoded_messages(topics=["/joint_states"]):
            at = message.header.stamp
            body = {"name": list(message.name), "position": list(message.position)}
            if stamp == "number":
                states.append({"time": at.sec % 1000 + at.nanosec / 1e9, **body})
            else:
                states.append({"header": {"stamp": {"sec": at.sec, "nanosec": at.nanosec}}, **body})
    code, lines, messages = run_live("-", stdin=json_lines(states))
    assert code == 0, messages
    # Without /tf the pelvis counts as upright.
    postures = reba.read(path, profile="human_description")
    assert len(lines) - 1 == len(states) == len(postures.data)
    joints_only = tmp_path / "only.mcap"
    _without_tf(path, joints_only)
    expected = batch(joints_only)
    if stamp == "number":
        np.testing.assert_allclose([line["time"] for line in lines[:-1]], expected["time"], atol=1e-6)
        expected["time"] = [line["time"] for line in lines[:-1]]
    assert_same(lines[:-1], expected)


def _without_tf(source: Path, path: Path) -> None:
    from mcap.writer import Writer

    with source.open("rb") as stream, path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        known: dict[int, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages(topics=["/joint_states"]):
            if channel.id not in known:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(known[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()


def test_bad_lines_are_skipped_counted_and_reported_once() -> None:
    good = [{"time": at / 10, "trunk_flexion": 5.0 * at, "load": 3} for at in range(10)]
    texts = [json.dumps(row) for row in good]
    texts.insert(2, "not json")
    texts.insert(4, '{"time": 0.05, "trunk_flexion": 1, "load": 3}')
    texts.insert(5, '{"time": 0.25, "trunk_flexion": "steep", "load": 3}')
    texts.insert(6, '{"time": 0.26, "trunk_flexion": 3}')
    texts.insert(7, '{"time": NaN, "trunk_flexion": 3, "load": 3}')
    texts.insert(8, '{"time": 0.27, "trunk_flexion": Infinity, "load": 3}')
    texts.insert(9, "{}")
    code, lines, messages = run_live("-", stdin="\n".join(texts))
    assert code == 0, messages
    assert_same(lines[:-1], scored(pd.DataFrame(good)))
    summary = lines[-1]["summary"]
    assert (summary["skipped"], summary["out_of_order"]) == (6, 1)
    assert messages.count("such lines are skipped") == 1
    assert messages.count("reba: skipped: ") == 1
    assert messages.count("does not increase") == 1


def test_nan_and_null_are_not_measured() -> None:
    text = '{"time": 0, "trunk_flexion": 70}\n{"time": 1, "trunk_flexion": NaN}\n{"time": 2, "trunk_flexion": null}\n'
    _, lines, _ = run_live("-", stdin=text)
    assert [line["trunk"] for line in lines[:-1]] == [None, None, None]
    assert lines[0]["reba_low"] > lines[1]["reba_low"] == lines[2]["reba_low"]


BAD_FIRST = {
    "not json": "not JSON",
    "[1, 2]": "not a JSON object",
    '{"time": 0, "trunk_flexoin": 3}': "did you mean 'trunk_flexion'",
    '{"time": "noon", "trunk_flexion": 3}': "number of seconds",
    '{"time": "2024-05-01T10:00:00Z", "trunk_flexion": 3}': "number of seconds",
    '{"timestamp": "2024-02-30T10:00:00Z", "name": ["a"], "position": [1]}': "2024-02-30T10:00:00Z",
    '{"timestamp": "noon", "name": ["a"], "position": [1]}': "ISO 8601",
    '{"time": 0, "trunk_flexion": "x"}': "trunk_flexion",
    '{"time": 0, "trunk_flexion": 3, "load": -1}': "load is -1",
    '{"time": 0, "name": ["nose"], "position": [1.0]}': "profile",
    "": "being written",
}


@pytest.mark.parametrize("line", BAD_FIRST)
def test_an_unusable_first_line_is_an_error(line: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    code, lines, messages = _in_process(line, monkeypatch, tmp_path)
    assert (code, lines) == (2, "")
    says(messages, BAD_FIRST[line])


def _in_process(text: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> tuple[int, str, str]:
    """Run the command in this process on a file as standard input; errors come as the exception's text."""
    (folder / "lines").write_text(text)
    with (folder / "lines").open("rb") as stream:
        monkeypatch.setattr("reba.live.command.stdin_descriptor", stream.fileno)
        result = invoke(cli, ["live", "-"], catch_exceptions=True)
    error = result.exception
    assert isinstance(error, reba.RebaError), repr(error)
    return 2, result.stdout, str(error)


LINE = st.one_of(
    st.binary(max_size=30),
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["time", "stamp", "header", "trunk_flexion", "load", "coupling", "support", "shoulder_raised_left",
                 "name", "position", "transforms", "joints", "sec", "nanosec"]
            ),
            inner,
            max_size=5,
        ),
        max_leaves=6,
    ).map(lambda tree: json.dumps(tree).encode()),
)  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(st.lists(LINE, max_size=8), st.booleans())
def test_no_line_brings_it_down(lines: list[bytes], opened: bool) -> None:
    first = [b'{"time": 0, "trunk_flexion": 10, "load": 2, "coupling": "good"}'] if opened else []
    reading, writing = os.pipe()
    os.write(writing, b"\n".join([*first, *lines]))
    os.close(writing)
    warnings: list[str] = []
    follower = Follower(LineStore(reading, warnings.append), ReadingOptions(), {}, {}, warnings.append)
    scorer = LiveScorer("measured", 1.0, Alert(8, 1.0))
    message = ""
    try:
        for frames in follower.follow():
            scorer.add(frames)
    except reba.RebaError as error:
        message = str(error)
    finally:
        os.close(reading)
    assert not (opened and message)
    assert "\n" not in message
    assert len(warnings) == len(set(warnings))
    assert scorer.frames >= opened


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        (["--activity", "auto"], ("auto", "static,repeated,unstable")),
        (["--activity", "lazy"], ("lazy",)),
        (["--alert", "8", "--alert-level", "high"], ("--alert", "--alert-level", "one of them")),
        (["--hold", "soon"], ("--hold", "soon", "seconds")),
        (["--window", "0"], ("window", "0 s", "more than 0")),
        (["--neutral", "later"], ("later", "first:")),
    ],
)
def test_unusable_options_are_refused(options: list[str], facts: tuple[str, ...]) -> None:
    result = invoke(cli, ["live", "-", *options])
    assert isinstance(result.exception, reba.RebaError)
    says(str(result.exception), *facts)
    assert result.stdout == ""


def test_names_without_a_side_stand_for_both() -> None:
    table = pd.DataFrame({"time": np.arange(20) / 20, "trunk_flexion": 30.0, "knee_flexion": 70.0})
    table["knee_flexion_left"] = 5.0
    code, lines, messages = run_live("-", stdin=json_lines(rows(table)))
    assert code == 0, messages
    assert_same(lines[:-1], scored(table))


@pytest.mark.parametrize("seconds", [3.0, 30.0])
def test_radians_for_degrees_are_told_once(seconds: float) -> None:
    table = table_of_postures(int(20 * seconds))
    columns = [name for name in table if name in reba.COLUMNS]
    table[columns] = np.radians(table[columns])
    code, lines, messages = run_live("-", "--activity", "none", stdin=json_lines(rows(table)))
    assert code == 0
    assert messages.count("look like radians") == 1
    assert ["look like radians" in text for text in lines[-1]["summary"]["warnings"]] == [True]


def test_a_neutral_beginning_is_no_radians() -> None:
    table = table_of_postures()
    columns = [name for name in table if name in reba.COLUMNS]
    table.loc[:150, columns] = 1.5
    assert "radians" not in run_live("-", "--activity", "none", stdin=json_lines(rows(table)))[2]
