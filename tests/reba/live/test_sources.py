"""`reba live` on a file that is being written: the scores of `reba score`, and unusable files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import reba
from reba.live.follow import Follower
from reba.live.frames import Frames, ReadingOptions
from reba.live.joint_frames import BodyFollower
from reba.live.session import FrameDurations
from reba.live.sources import GrowingMcap, open_growing
from reba.readers.mcap import open_mcap
from tests.support import mcap_builder as make
from tests.support.encode_motion import write_xsens_tf
from tests.support.live_sources import COMMAND, GrowingFile, assert_same, batch, moving_body, rewritten, run_live
from tests.support.says import says

pytestmark = pytest.mark.slow


def recording(kind: str, folder: Path) -> Path:
    path = folder / f"{kind}.mcap"
    if kind == "frames":
        write_xsens_tf(path, moving_body(250))
        return path
    if kind == "postures":
        joints = rewritten(folder / "joints.mcap", 20.0, 32.0, chunked=True)
        reba.write_postures(reba.read(joints), path)
        return path
    return rewritten(path, 20.0, 32.0, chunked=kind == "chunked")


@pytest.mark.parametrize("kind", ["chunked", "unchunked", "frames", "postures"])
def test_a_growing_file_gives_the_scores_of_the_whole_one(kind: str, tmp_path: Path) -> None:
    whole, growing = recording(kind, tmp_path), tmp_path / "growing.mcap"
    growing.touch()
    writer = GrowingFile(growing, whole.read_bytes())
    writer.start()
    code, lines, messages = run_live(str(growing), "--load", "7", "--until-idle", "60")
    writer.join()
    assert code == 0, messages
    assert_same(lines[:-1], batch(whole, load=7.0))
    summary = lines[-1]["summary"]
    assert summary["frames"] == len(lines) - 1 > 200
    scores = reba.score(reba.read(whole), activity="none", load=7.0).summary()
    exposure = summary["exposure"]
    assert exposure["seconds"] == pytest.approx(scores["seconds"], abs=1e-6)
    assert exposure["mean_low"] == pytest.approx(scores["range"]["mean_low"], abs=1e-6)
    for level, share in scores["action_levels"].items():
        assert exposure["action_levels"][level] == pytest.approx(share * scores["seconds"], abs=1e-6)


def test_rows_that_leave_out_what_is_missing(tmp_path: Path) -> None:
    time = np.arange(0, 8, 0.04)
    frame = pd.DataFrame({"time": time, "trunk_flexion": 30 + 20 * np.sin(time), "neck_flexion": 5.0, "load": 3.0})
    frame.loc[:9, ["trunk_flexion", "neck_flexion"]] = np.nan
    frame.loc[100:105, "neck_flexion"] = np.nan
    frame.to_csv(tmp_path / "in.csv", index=False)
    path = tmp_path / "rows.mcap"
    reba.write_postures(reba.read(tmp_path / "in.csv"), path)
    code, lines, messages = run_live(str(path), "--until-idle", "0.1")
    assert code == 0, messages
    assert_same(lines[:-1], batch(path))


def read_live(path: Path, reading: ReadingOptions | None = None) -> tuple[list[float], list[str], Follower]:
    """Return the times of all frames of a file, the warnings, and the follower."""
    warnings: list[str] = []
    follower = Follower(GrowingMcap(path), reading or ReadingOptions(), {}, {}, warnings.append)
    times = [time for frames in follower.follow(0.0) if isinstance(frames, Frames) for time in frames.time.tolist()]
    return times, warnings, follower


def test_a_neutral_posture_is_that_of_the_batch(tmp_path: Path) -> None:
    whole = recording("unchunked", tmp_path)
    for neutral in ("first:3s", "at:2.5"):
        code, lines, messages = run_live(str(whole), "--neutral", neutral, "--settle", "1s")
        assert code == 0, messages
        assert_same(lines[:-1], batch(whole, neutral=neutral))
        assert "subtracted" in messages


def test_scored_data_are_removed_from_memory(tmp_path: Path) -> None:
    times, _, follower = read_live(recording("unchunked", tmp_path))
    source = follower.source
    assert len(times) == 300
    assert source.segments == []
    assert isinstance(follower.converter, BodyFollower)
    assert follower.converter.pelvis is not None
    assert len(follower.converter.pelvis.pose.time) < 200


def test_a_file_without_end_stops_when_it_is_silent(tmp_path: Path) -> None:
    whole = recording("unchunked", tmp_path).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    code, lines, _ = run_live(str(cut), "--until-idle", "0.2")
    assert code == 0
    assert_same(lines[:-1], batch(cut))


def test_interrupting_still_gives_the_summary(tmp_path: Path) -> None:
    whole = recording("unchunked", tmp_path).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[:-2000])
    with subprocess.Popen([COMMAND, "live", str(cut)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        assert running.stdout is not None
        first = json.loads(running.stdout.readline())
        running.send_signal(signal.SIGINT)
        out, _ = running.communicate(timeout=60)
    assert first["time"] == 0.0
    assert running.returncode == 130
    assert json.loads(out.splitlines()[-1])["summary"]["interrupted"] is True


@pytest.mark.parametrize("change", ["replaced", "cut", "removed"])
def test_another_file_under_the_name_is_an_error(change: str, tmp_path: Path) -> None:
    whole = recording("unchunked", tmp_path)
    data = whole.read_bytes()
    path = tmp_path / "growing.mcap"
    path.write_bytes(data[:200_000])
    source = open_growing(path, 0.0)
    while source.grow() is not None:
        pass
    if change == "replaced":
        os.replace(whole, path)
    elif change == "cut":
        path.write_bytes(data[:1000])
    else:
        path.unlink()
    fact = {"replaced": "replaced", "cut": "shorter", "removed": "removed"}[change]
    with pytest.raises(reba.ReadError) as error:
        source.grow()
    says(error, path, fact, "start again")


def test_a_record_that_never_can_be_complete_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "damaged.mcap"
    path.write_bytes(make.MAGIC + make.record(5, b"abc", length=1 << 62))
    with pytest.raises(reba.ReadError) as error:
        open_growing(path, 0.0).grow()
    says(error, path, "limit")


def test_records_come_complete_whatever_is_written_so_far(tmp_path: Path) -> None:
    data = make.build(make.whole())
    path = tmp_path / "growing.mcap"
    path.write_bytes(data[:8])
    source, seen, at = GrowingMcap(path), 0, 8
    for stop in range(8, len(data) + 7919, 7919):
        with path.open("ab") as file:
            file.write(data[at:stop])
        at = max(at, stop)
        while (segment := source.grow()) is not None:
            seen += len(source.load(segment).scan.times)
            source.forget()
    assert seen == make.COUNT
    assert source.finished


def test_later_frames_that_contradict_the_first_seconds_are_reported_once(tmp_path: Path) -> None:
    path = tmp_path / "late.mcap"
    names, rows = [*make.NAMES], make.positions() * 0.1
    profile = tmp_path / "six.toml"
    profile.write_text(PROFILE)
    rows[:500, 2] = 0.0
    stamps = [make.EPOCH_NS + at * make.STEP_NS for at in range(len(rows))]
    messages = [make.joint_state(stamp, names, row) for stamp, row in zip(stamps, rows, strict=True)]
    path.write_bytes(make.build(make.whole(messages)))
    times, warnings, follower = read_live(path, ReadingOptions(profile=str(profile)))
    assert len(times) == make.COUNT
    contradictions = [text for text in warnings if "contradict" in text]
    assert len(contradictions) == 1
    assert "lower_arm_flexion_left" in contradictions[0]
    assert follower.converter is not None
    assert "lower_arm_flexion_left" in follower.converter.unmeasured


PROFILE = """
name = "six"
title = "Six joints"
source = "tests"
kind = "joints"
unit = "rad"
mirror = false
required = ["trunk"]

[columns]
trunk_flexion = "trunk"
neck_flexion = "neck"
lower_arm_flexion_left = "left_elbow"
lower_arm_flexion_right = "right_elbow"
knee_flexion_left = "left_knee"
knee_flexion_right = "right_knee"
"""


def test_the_peek_sees_past_many_small_segments(tmp_path: Path) -> None:
    path = recording("unchunked", tmp_path)
    assert {stream.name for stream in open_mcap(path).streams} == {"/joint_states", "/tf"}


def test_a_gap_counts_one_period() -> None:
    steps = FrameDurations()
    assert [steps.add(step) for step in (0.04, 0.04, 3.0, 0.04)] == [False, False, True, False]
    assert steps.period() == 0.04


@pytest.mark.parametrize(
    ("name", "fact"), [("none.mcap", "no such file"), ("", "not a file"), ("text.mcap", "magic bytes")]
)
def test_a_file_that_is_not_a_growing_recording_is_refused(name: str, fact: str, tmp_path: Path) -> None:
    (tmp_path / "text.mcap").write_text("time,trunk_flexion\n")
    with pytest.raises(reba.ReadError) as error:
        open_growing(tmp_path / name, 0.0)
    says(error, tmp_path / name, fact)
