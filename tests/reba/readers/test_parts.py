"""Parts of a recording: an interval and blocks are the complete table, cut; accounts add up."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import reba
from reba.errors import ProfileError, ReadError, RebaError
from tests.reba.readers.test_whole_recording import JOINTS, state, write
from tests.support import mcap_builder as make
from tests.support.mcap_builder import EPOCH_NS, STEP_NS
from tests.support.paths import DATASETS
from tests.support.says import says

ANY = settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def joints(path: Path) -> Path:
    """3000 messages of 10 ms: an elbow that is 0 up to second 20, a sign that only the last seconds show, gap codes."""
    rows = []
    for at in range(3000):
        values = [0.0 if at < 2000 else 0.5, 0.6, -0.2 - at * 1e-4, 0.4 + 0.3 * np.sin(at / 40), 0.3, 0.3, 0.3, -0.1]
        values[1] = -999.0 if at % 97 == 0 else values[1]
        stamp = at if at < 1500 else at + 300  # a gap of 3 s
        rows.append((1, EPOCH_NS + stamp * STEP_NS, make.joint_state(EPOCH_NS + stamp * STEP_NS, JOINTS, values)))
    return write(path, rows)


def angles(path: Path) -> Path:
    time = np.arange(0, 30, 0.05)
    frame = pd.DataFrame({"time": time, "trunk_flexion": 30 * np.sin(time), "load": np.where(time < 9, 3.0, 12.0)})
    frame["support"] = np.where(time < 15, "walking", "bilateral")
    frame["knee_flexion_left"] = np.where(time < 20, np.nan, 45.0)
    frame.to_csv(path, index=False)
    return path


RECORDINGS: dict[str, Callable[[Path], Path]] = {
    "joints.mcap": joints,
    "points.trc": lambda path: DATASETS / "balancing_keypoints.trc",
    "palletising.mcap": lambda path: DATASETS / "simulated_palletising.mcap",
    "angles.csv": angles,
}


@pytest.fixture(scope="module", params=RECORDINGS)
def recording(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any, Any]:
    """A recording, its complete table and its scores."""
    path = RECORDINGS[request.param](tmp_path_factory.mktemp("parts") / request.param)
    postures = reba.read(path, neutral="first:1s")
    return path, postures, reba.score(postures)


def adds_up(table: reba.PostureTable) -> bool:
    return all(each["read"] == each["used"] + sum(each["not_used"].values()) for each in table.quality.accounts)


@ANY
@given(ends=st.tuples(st.floats(0, 1), st.floats(0, 1)), exact=st.booleans())
def test_an_interval_is_the_complete_table_cut(
    recording: tuple[Path, Any, Any], ends: tuple[float, float], exact: bool
) -> None:
    path, whole, _ = recording
    time = whole.data["time"].to_numpy()
    start, end = sorted(time[0] + share * (time[-1] - time[0]) for share in ends)
    if exact:  # both ends belong to the interval
        start, end = (float(time[np.argmin(np.abs(time - at))]) for at in (start, end))
    expected = whole.data[(time >= start) & (time <= end)].reset_index(drop=True)
    if not len(expected):
        with pytest.raises(ReadError, match="no frame lies in"):
            reba.read(path, start=start, end=end, neutral="first:1s")
        return
    part = reba.read(path, start=start, end=end, neutral="first:1s")
    pd.testing.assert_frame_equal(part.data, expected)
    assert adds_up(part)
    assert part.quality.accounts[0]["used"] == len(expected)
    outside = part.quality.accounts[0]["not_used"].get("outside_interval", 0)
    assert outside == whole.quality.accounts[0]["used"] - len(expected)
    for each in part.quality.accounts[1:]:  # the pelvis, at the times of the joints
        assert each["used"] in (0, len(expected))
    assert part.epoch == whole.epoch
    assert part.assumed == whole.assumed


@ANY
@given(seconds=st.floats(0.3, 40))
def test_blocks_are_the_table_and_their_scores_its_scores(recording: tuple[Path, Any, Any], seconds: float) -> None:
    path, whole, scores = recording
    # At most forty blocks: of many more each is like those.
    seconds = max(seconds, float(whole.data["time"].iloc[-1]) / 40)
    blocks = list(reba.read_blocks(path, seconds=seconds, neutral="first:1s"))
    pd.testing.assert_frame_equal(pd.concat([block.data for block in blocks], ignore_index=True), whole.data)
    scored = pd.concat([reba.score(block).data for block in blocks], ignore_index=True)
    pd.testing.assert_frame_equal(scored, scores.data)
    for block in blocks:
        assert block.data["time"].iloc[-1] - block.data["time"].iloc[0] <= seconds
        assert block.quality.accounts == whole.quality.accounts


def test_activity_of_blocks_reaches_across_them(tmp_path: Path) -> None:
    time = np.arange(0, 200, 0.1)
    frame = pd.DataFrame({"time": time, "trunk_flexion": 30.0, "lower_arm_flexion_left": 80 + 20 * np.sin(time)})
    frame.to_csv(tmp_path / "held.csv", index=False)
    scores = [reba.score(block) for block in reba.read_blocks(tmp_path / "held.csv", seconds=10)]
    assert all(np.all(each.factors.static) for each in scores)
    assert all(np.all(each.factors.repeated) for each in scores[1:-1])
    block = next(reba.read_blocks(tmp_path / "held.csv", seconds=10))
    says(refused(lambda: reba.score(block, support=["walking"] * 100)), "other blocks", "activity='none'")
    assert len(reba.score(block, support=["walking"] * 100, activity="none").data) == 100


def refused(call: Callable[[], object]) -> str:
    with pytest.raises(RebaError) as caught:
        call()
    return str(caught.value)


def test_an_interval_of_transforms_sent_one_by_one(tmp_path: Path) -> None:
    """Several messages make one frame: they are counted, not the frames."""
    rows = [state(at // 2, at // 2, JOINTS[:4] if at % 2 else JOINTS[4:], channel=1 + at % 2) for at in range(2000)]
    path = write(tmp_path / "halves.mcap", rows, channels=2)
    whole = reba.read(path)
    part = reba.read(path, start=2.0, end=5.0)
    assert whole.quality.accounts[0]["used"] == 2000
    assert len(part.data) == 301
    assert part.quality.accounts[0]["used"] == 602
    assert part.quality.accounts[0]["not_used"] == {"outside_interval": 1398}


def test_frames_that_have_to_be_sorted(tmp_path: Path) -> None:
    whole = reba.read(DATASETS / "simulated_palletising.mcap")
    turned = whole.data.iloc[::-1]
    turned.rename(columns=str).to_csv(tmp_path / "turned.csv", index=False)
    part = reba.read(tmp_path / "turned.csv", start=10, end=11)
    assert part.data["time"].is_monotonic_increasing
    rows = [state(at, at, log=at) for at in range(900)]
    path = write(tmp_path / "mixed.mcap", rows[450:] + rows[:450])
    pd.testing.assert_frame_equal(
        reba.read(path, start=1.0, end=6.0).data,
        reba.read(path).data.query("1.0 <= time <= 6.0").reset_index(drop=True),
    )


def test_nothing_in_the_interval_and_wrong_intervals() -> None:
    path = DATASETS / "simulated_palletising.mcap"
    says(refused(lambda: reba.read(path, start=500)), "no frame lies in 500", "0.000 to 176.160 s")
    says(refused(lambda: reba.read(path, start=20, end=10)), "no frame lies in 20 to 10 s", "start before the end")
    says(refused(lambda: reba.read_blocks(path, start=500)), "no frame lies in")
    for wrong in (float("nan"), float("inf"), "10", True, 10**400):
        says(refused(lambda wrong=wrong: reba.read(path, end=wrong)), "end is", "expected seconds")
    says(refused(lambda: reba.read_blocks(path, seconds=0)), "seconds is 0", "expected seconds from 0.001")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
def test_a_full_temporary_folder_is_one_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.TemporaryFile", lambda: open("/dev/full", "w+b", buffering=0))  # noqa: SIM115
    for call in (reba.read_blocks, lambda path: reba.read(path, end=9)):
        says(refused(lambda call=call: call(DATASETS / "simulated_palletising.mcap")), "temporary file", "TMPDIR")


def test_one_of_two_bodies(tmp_path: Path) -> None:
    rows = []
    for at in range(600):
        rows += [state(at, at, [f"{body}_{name}" for name in JOINTS], channel=1) for body in ("alice", "bob")]
    path = write(tmp_path / "two.mcap", rows)
    with pytest.raises(ProfileError):
        reba.read(path)
    bob = reba.read(path, body="bob", start=1, end=2)
    assert len(bob.data) == 101
    assert adds_up(bob)
    pd.testing.assert_frame_equal(bob.data, reba.read(path, topic="/joint_states", body="bob", start=1, end=2).data)
    says(refused(lambda: reba.read(path, body="bbo")), "no body 'bbo'", "bodies are alice", "bob (0.0 to 6.0 s)")
    streams = reba.info(path, body="alice").streams
    assert set(streams[0].bodies) == {"alice", "bob"}
    assert streams[0].used


def test_files_of_one_recording(tmp_path: Path) -> None:
    rows = [state(at, at) for at in range(900)]
    whole = reba.read(write(tmp_path / "whole.mcap", rows)).data
    parts = [write(tmp_path / f"part_{n}.mcap", rows[300 * n : 300 * n + 300]) for n in range(3)]
    joined = reba.read([str(parts[2]), parts[0], parts[1]])  # their times order them
    pd.testing.assert_frame_equal(joined.data, whole)
    assert joined.files == (str(parts[2]), str(parts[0]), str(parts[1]))
    assert adds_up(joined)
    pd.testing.assert_frame_equal(reba.read([tmp_path / "whole.mcap"]).data, whole)
    pd.testing.assert_frame_equal(
        reba.read(parts, start=2.0, end=4.0).data, whole.query("2.0 <= time <= 4.0").reset_index(drop=True)
    )
    assert reba.info(parts).frames == 900
    says(refused(lambda: reba.write_scores(reba.score(joined), parts[1])), "input")
    says(refused(lambda: reba.read([])), "no file")
    says(refused(lambda: reba.read([parts[0], parts[0]])), "twice")
    says(refused(lambda: reba.read([parts[0], tmp_path / "whole.mcap"])), "recorded at one time", "one by one")
    table = DATASETS / "simulated_assembly.csv"
    says(refused(lambda: reba.read([table, parts[0]])), "not an MCAP, .bag or .db3 file", "one by one")
    says(refused(lambda: reba.read([parts[0], tmp_path / "gone.mcap"])), "no such file")


def test_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    angles(tmp_path / "angles.csv")
    postures = reba.read("~/angles.csv")
    assert len(reba.read(Path("~/angles.csv")).data) == len(postures.data)
    scores = reba.score(postures)
    reba.write_scores(scores, "~/out/scores.parquet")
    reba.write_report(scores, "~/out/report.html")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"scores.parquet", "report.html"}
    assert reba.info("~/angles.csv").frames == len(postures.data)
    reba.PRESETS["paper"].replace(name="mine").save("~/mine.toml")
    assert reba.score(postures, rules="~/mine.toml").rules.name == "mine"
    assert len(list(reba.read_blocks(["~/angles.csv"]))) == 1
    assert reba.read_scores("~/out/scores.parquet").rules == scores.rules


def test_streams_are_listed(tmp_path: Path) -> None:
    contents = reba.info(DATASETS / "simulated_palletising.mcap")
    stream, *_ = contents.streams
    assert (stream.name, stream.kind, stream.messages, stream.used) == ("/joint_states", "joints", 4405, True)
    assert stream.rate == pytest.approx(25.0)
    assert stream.seconds == pytest.approx(176.16)
    assert contents.to_dict()["streams"][0]["rate"] == pytest.approx(25.0)
    table = reba.info(angles(tmp_path / "angles.csv"))
    assert [(each.kind, each.messages, each.used) for each in table.streams] == [("angles", 600, True)]
    assert table.streams[0].seconds == pytest.approx(29.95)
