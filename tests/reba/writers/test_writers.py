"""Score and posture tables as files: every value, and the rules as metadata."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import reba
from reba.scores import Scores
from tests.support.paths import DATASETS
from tests.support.says import says


@pytest.fixture
def scores() -> Scores:
    time = np.arange(0, 20, 0.04)
    frames = pd.DataFrame({"time": time, "trunk_flexion": 30 + 40 * np.sin(time), "knee_flexion_left": 45.0})
    return reba.score(frames, load=7.0, rules="paper")


def test_parquet_holds_table_and_rules(scores: Scores, tmp_path: Path) -> None:
    path = tmp_path / "deep" / "scores.parquet"
    reba.write_scores(scores, path)
    table = pd.read_parquet(path)
    pd.testing.assert_frame_equal(table[list(scores.data)], scores.data, check_dtype=False)
    pd.testing.assert_frame_equal(table[list(reba.COLUMNS)], pd.DataFrame(scores.angles, columns=list(reba.COLUMNS)))
    assert list(table)[len(scores.data.columns) :][:22] == list(reba.COLUMNS)
    about = json.loads(pq.read_schema(path).metadata[b"reba"])
    assert about["rules"] == dataclasses.asdict(reba.PRESETS["paper"])
    assert "wrist_flexion_left" in about["unmeasured"]
    assert "no shock" in about["assumed"]


def test_csv_holds_table_and_rules_beside(scores: Scores, tmp_path: Path) -> None:
    path = tmp_path / "scores.csv"
    reba.write_scores(scores, path)
    table = pd.read_csv(path)
    assert table["reba_low"].tolist() == scores.data["reba_low"].tolist()
    assert table["reba"].isna().tolist() == scores.data["reba"].isna().tolist()
    about = json.loads((tmp_path / "scores.csv.meta.json").read_text())
    assert about["rules"]["trunk_upright"] == 0.0


def test_mcap_holds_one_message_a_frame(scores: Scores, tmp_path: Path) -> None:
    path = tmp_path / "scores.mcap"
    reba.write_scores(scores, path)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        rows = [(message.log_time, json.loads(message.data)) for _, _, message in reader.iter_messages()]
        notes = {record.name: record.metadata for record in reader.iter_metadata()}
        schema = next(iter(reader.get_summary().schemas.values()))
    assert len(rows) == len(scores.data)
    assert [row["reba_low"] for _, row in rows] == scores.data["reba_low"].tolist()
    assert rows[3][0] == round(scores.time[3] * 1e9)
    assert json.loads(notes["reba"]["rules"])["name"] == "paper"
    assert schema.encoding == "jsonschema"
    properties = json.loads(schema.data)["properties"]
    assert {*scores.data.columns, *reba.COLUMNS, "load", "support", "static"} <= set(properties)
    assert {properties[name]["type"] for name in ("load", "support", "static")} == {"number", "string", "boolean"}


def test_mcap_keeps_the_original_topics(tmp_path: Path) -> None:
    source = DATASETS / "simulated_palletising.mcap"
    scores = reba.score(reba.read(source))
    reba.write_scores(scores, tmp_path / "scores.mcap")
    counts: dict[str, int] = {}
    payloads: list[bytes] = []
    with (tmp_path / "scores.mcap").open("rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if channel.topic == "/joint_states":
                payloads.append(message.data)
    with source.open("rb") as stream:
        originals = [m.data for _, _, m in make_reader(stream).iter_messages(topics="/joint_states")]
    assert payloads == originals
    assert counts["/ergonomics/reba"] == len(scores.data)


def test_posture_table_round_trip(tmp_path: Path) -> None:
    postures = reba.read(DATASETS / "simulated_assembly.csv")
    expected = reba.score(postures).data
    for suffix in (".parquet", ".csv", ".mcap"):
        path = tmp_path / f"postures{suffix}"
        reba.write_postures(postures, path)
        again = reba.score(reba.read(path)).data
        pd.testing.assert_frame_equal(again.drop(columns="time"), expected.drop(columns="time"))
        np.testing.assert_allclose(again["time"], expected["time"], atol=1e-6)


def test_gaps_of_a_posture_table_are_the_same_in_every_format(tmp_path: Path) -> None:
    time = np.arange(0, 4, 0.02)
    frame = pd.DataFrame({"time": time, "trunk_flexion": 30 + 20 * np.sin(time), "neck_flexion": 5.0, "load": 3.0})
    frame.loc[:9, ["trunk_flexion", "neck_flexion"]] = np.nan  # no angle at all
    frame.loc[50:59, "neck_flexion"] = np.nan  # shorter than values are held between messages
    frame.to_csv(tmp_path / "in.csv", index=False)
    postures = reba.read(tmp_path / "in.csv")
    reba.write_postures(postures, tmp_path / "out.mcap")
    again = reba.read(tmp_path / "out.mcap", strict=True)
    pd.testing.assert_frame_equal(again.data[["time", *frame.columns[1:]]], frame, atol=1e-8)
    assert again.quality.warnings == postures.quality.warnings
    (account,) = again.quality.accounts
    assert (account["read"], account["used"], account["not_used"]) == (200, 200, {})


def test_nothing_is_left_or_lost_on_failure(scores: Scores, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scores.parquet"
    path.write_bytes(b"earlier result")

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pyarrow.parquet.ParquetWriter", fail)
    with pytest.raises(reba.RebaError) as error:
        reba.write_scores(scores, path)
    says(error, "scores.parquet", "No space left on device", "choose another")
    assert path.read_bytes() == b"earlier result"
    assert [p.name for p in tmp_path.iterdir()] == ["scores.parquet"]


def test_unknown_ending_is_refused(scores: Scores, tmp_path: Path) -> None:
    with pytest.raises(reba.RebaError) as error:
        reba.write_scores(scores, tmp_path / "scores.ods")
    says(error, "'.ods'", ".parquet", ".csv", ".mcap", ".xlsx")


def test_what_belongs_to_the_numbers_is_strict_json_and_names_the_factors(tmp_path: Path) -> None:
    one = pd.DataFrame({"time": [0.0], "trunk_flexion": [10.0]})
    (tmp_path / "one.csv").write_text(one.to_csv(index=False))
    scores = reba.score(reba.read(tmp_path / "one.csv"), load=9.0, coupling="fair")
    for suffix in (".csv", ".parquet", ".mcap"):
        reba.write_scores(scores, tmp_path / f"scores{suffix}")
    notes = [(tmp_path / "scores.csv.meta.json").read_text()]
    notes += [pq.read_schema(tmp_path / "scores.parquet").metadata[b"reba"].decode()]
    with (tmp_path / "scores.mcap").open("rb") as stream:
        (record,) = make_reader(stream).iter_metadata()
    notes += [record.metadata["quality"]]
    for note in notes:
        quality = json.loads(note, parse_constant=lambda token: pytest.fail(token))
        assert quality.get("quality", quality)["rate"] is None
    about = json.loads(notes[0])
    assert about["factors"]["load"] == 9.0
    assert about["factors"]["coupling_left"] == "fair"
    assert "load 0 kg" not in about["assumed"]


def test_copied_channels_keep_their_metadata(tmp_path: Path) -> None:
    source = tmp_path / "robot.mcap"
    with source.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/joint_states", "json", 0, {"offered_qos_profiles": "- history: 3"})
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    postures = reba.read(DATASETS / "simulated_assembly.csv")
    moved = dataclasses.replace(postures, source=str(source), quality=reba.Quality())
    scores = dataclasses.replace(reba.score(postures), postures=moved)
    reba.write_scores(scores, tmp_path / "scores.mcap")
    with (tmp_path / "scores.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    metadata = {channel.topic: channel.metadata for channel in summary.channels.values()}
    assert metadata["/joint_states"] == {"offered_qos_profiles": "- history: 3"}


def test_topics_of_a_replaced_recording_are_not_written_with_the_scores_of_the_former(tmp_path: Path) -> None:
    source, out = tmp_path / "shift.mcap", tmp_path / "scores.mcap"
    source.write_bytes((DATASETS / "simulated_palletising.mcap").read_bytes())
    scores = reba.score(reba.read(source))
    reba.write_scores(scores, out)
    before = out.read_bytes()
    reba.write_postures(reba.read(DATASETS / "simulated_assembly.csv"), source)
    with pytest.raises(reba.RebaError) as error:
        reba.write_scores(scores, out)
    says(error, source, "changed after it was read", "score it again")
    assert out.read_bytes() == before


def test_measurement_error_is_written_with_its_columns(tmp_path: Path) -> None:
    frames = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 59.0]})
    scores = reba.score(frames, error="optical")
    for name in ("scores.parquet", "scores.csv", "scores.mcap"):
        reba.write_scores(scores, tmp_path / name)
    table = pd.read_parquet(tmp_path / "scores.parquet")
    pd.testing.assert_frame_equal(table[list(scores.data)], scores.data)
    assert json.loads(pq.read_schema(tmp_path / "scores.parquet").metadata[b"reba"])["error"]["name"] == "optical"
    assert pd.read_csv(tmp_path / "scores.csv")["reba_95_high"].tolist() == table["reba_95_high"].tolist()
    with (tmp_path / "scores.mcap").open("rb") as stream:
        reader = make_reader(stream)
        schema, _, message = next(iter(reader.iter_messages(topics=["/ergonomics/reba"])))
        assert schema is not None
        kinds = {name: one["type"] for name, one in json.loads(schema.data)["properties"].items()}
    assert kinds["p_level_3_low"] == "number"
    assert json.loads(message.data)["p_level_3_low"] == pytest.approx(table["p_level_3_low"][0], abs=1e-9)
