"""Recordings, rules and profiles that change while a dataset is written: no score stands beside the hash of others."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import reba
from reba import readers
from reba.batch import dataset_run
from reba.batch import run as run_module
from reba.batch.dataset import Dataset, scoring_settings
from reba.batch.dataset_run import DatasetRun, score_into
from reba.batch.manifest import MANIFEST
from reba.batch.run import ScoringOptions, score_many
from reba.posture.table import table_of
from reba.readers.recording.profile import SHIPPED
from tests.support.says import says

LOW, HIGH = 5.0, 70.0
"""[deg] Trunk flexion of the recording that is read first, and of the one that takes its place."""


def table(angle: float) -> str:
    return "time,trunk_flexion,neck_flexion\n" + "".join(f"{time},{angle:04.1f},5\n" for time in range(50))


def rewritten(path: Path) -> None:
    path.write_text(table(HIGH))


def replaced(path: Path) -> None:
    other = path.with_name("other.part")
    other.write_text(table(HIGH))
    other.replace(path)


def time_kept(path: Path) -> None:
    status = path.stat()
    path.write_text(table(HIGH))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def shortened(path: Path) -> None:
    path.write_text(table(HIGH)[:200])


CHANGES = (rewritten, replaced, time_kept, shortened)


def run(folder: Path, inputs: list[str], **options: Any) -> DatasetRun:
    with Dataset(folder) as dataset:
        return score_into(dataset, inputs, ScoringOptions(**options))


def last_line(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / MANIFEST).read_text().splitlines()[-1]))


def after_reading(monkeypatch: pytest.MonkeyPatch, change: Callable[[], None], name: str = "score") -> None:
    """Make `change` happen once, when a recording was read and before its hash is recorded."""
    original = getattr(run_module, name)
    pending = [change]

    def changing(*args: Any, **options: Any) -> Any:
        result = original(*args, **options)
        if pending:
            pending.pop()()
        return result

    monkeypatch.setattr(run_module, name, changing)


def scores_in(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder)[["time", *reba.SCORE_COLUMNS, "recording"]]


def check_new_content(out: Path, recording: Path) -> None:
    """Check that the next run scores what the recording is now."""
    again = run(out, [str(recording)])
    assert dict(again.scored) == {"failed before": 1}
    assert again.failed == 0
    expected = reba.score(reba.read(recording)).data
    pd.testing.assert_frame_equal(scores_in(out).drop(columns="recording"), expected, check_dtype=False)
    assert run(out, [str(recording)]).unchanged == 1


@pytest.mark.parametrize("change", CHANGES)
def test_a_recording_that_changes_after_it_was_read_is_scored_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], None]
) -> None:
    recording, out = tmp_path / "a.csv", tmp_path / "out"
    recording.write_text(table(LOW))
    after_reading(monkeypatch, lambda: change(recording))
    first = run(out, [str(recording)])
    assert first.failed == 1
    says(last_line(out)["error"], recording, "changed while it was read", "score it again")
    assert not list(out.rglob("*.parquet"))
    check_new_content(out, recording)


@pytest.mark.parametrize("change", CHANGES)
def test_a_recording_that_changes_before_its_hash_is_scored_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], None]
) -> None:
    recording, out = tmp_path / "a.csv", tmp_path / "out"
    recording.write_text(table(LOW))
    original = readers.table_of_match

    def changing(*args: Any, **options: Any) -> Any:
        monkeypatch.setattr(readers, "table_of_match", original)
        opened = original(*args, **options)
        change(recording)
        return opened

    monkeypatch.setattr(readers, "table_of_match", changing)
    with pytest.raises(reba.ReadError, match="changed while it was read"):
        reba.read(recording)
    recording.write_text(table(LOW))
    monkeypatch.setattr(readers, "table_of_match", changing)
    assert run(out, [str(recording)]).failed == 1
    check_new_content(out, recording)


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_between_two_runs_is_seen_whatever_its_times(tmp_path: Path, change: Callable[[Path], None]) -> None:
    recording, out = tmp_path / "a.csv", tmp_path / "out"
    recording.write_text(table(LOW))
    run(out, [str(recording)])
    change(recording)
    assert dict(run(out, [str(recording)]).scored) == {"the file changed": 1}
    expected = reba.score(reba.read(recording)).data
    pd.testing.assert_frame_equal(scores_in(out).drop(columns="recording"), expected, check_dtype=False)


def test_a_change_while_the_content_is_confirmed_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording, out = tmp_path / "a.csv", tmp_path / "out"
    recording.write_text(table(LOW))
    run(out, [str(recording)])
    os.utime(recording, (1e9, 1e9))
    original = dataset_run.content_hash

    def hashed(path: str) -> str:
        digest = original(path)
        rewritten(recording)
        return digest

    monkeypatch.setattr(dataset_run, "content_hash", hashed)
    assert run(out, [str(recording)]).failed == 1
    monkeypatch.undo()
    check_new_content(out, recording)


@pytest.mark.parametrize("other", ["content", "rules"])
def test_scores_whose_scoring_was_interrupted_never_count_as_the_former_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, other: str
) -> None:
    recording, kept, out = tmp_path / "a.csv", tmp_path / "kept.csv", tmp_path / "out"
    recording.write_text(table(LOW))
    run(out, [str(recording)])
    former = scores_in(out)
    recording.replace(kept)
    recording.write_text(table(HIGH if other == "content" else LOW))
    options = {} if other == "content" else {"rules": "paper"}

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    # The new scores are complete on the disk, and the manifest does not know of them.
    monkeypatch.setattr(Dataset, "record", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(out, [str(recording)], **options)
    monkeypatch.undo()
    assert not scores_in(out).equals(former)
    kept.replace(recording)
    assert dict(run(out, [str(recording)]).scored) == {"was interrupted": 1}
    pd.testing.assert_frame_equal(scores_in(out), former)
    assert run(out, [str(recording)]).unchanged == 1


def test_scores_that_cannot_be_written_leave_the_former_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording, out = tmp_path / "a.csv", tmp_path / "out"
    recording.write_text(table(LOW))
    run(out, [str(recording)])
    former = scores_in(out)

    def full(*_: Any, **__: Any) -> None:
        raise reba.RebaError("scores.parquet: cannot be written (No space left on device)")

    monkeypatch.setattr(run_module, "write_scores", full)
    with Dataset(out) as dataset:
        again = score_into(dataset, [str(recording)], ScoringOptions(rules="paper"))
        assert [one.error is None for one in dataset.results([str(recording)])] == [False]
    assert again.failed == 1
    pd.testing.assert_frame_equal(scores_in(out), former)
    monkeypatch.undo()
    assert dict(run(out, [str(recording)]).scored) == {"was interrupted": 1}
    pd.testing.assert_frame_equal(scores_in(out), former)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no limit of file sizes here")
def test_a_full_disk_is_told_with_the_folder(tmp_path: Path) -> None:
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limits[1]))
    try:
        with pytest.raises(reba.RebaError) as error:
            Dataset(tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    says(error, tmp_path, "cannot be written", "too large", "choose another folder")


def write_split(folder: Path, number: int) -> None:
    folder.mkdir(exist_ok=True)
    frames = pd.DataFrame({"time": 20.0 * number + np.arange(20.0), "trunk_flexion": LOW})
    reba.write_postures(replace(table_of(frames), epoch=1e9), folder / f"run_{number}.mcap")


def test_a_split_added_while_a_folder_is_read_is_scored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, out = tmp_path / "run", tmp_path / "out"
    write_split(folder, 0)
    write_split(folder, 1)
    after_reading(monkeypatch, lambda: write_split(folder, 2))
    assert run(out, [str(folder)]).failed == 1
    assert run(out, [str(folder)]).frames == 60
    assert run(out, [str(folder)]).unchanged == 1
    (folder / "run_2.mcap").unlink()
    assert dict(run(out, [str(folder)]).scored) == {"the file changed": 1}


def test_a_link_pointed_elsewhere_meanwhile_belongs_to_what_was_scored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second, link, out = (tmp_path / name for name in ("first.csv", "second.csv", "link.csv", "out"))
    first.write_text(table(LOW))
    second.write_text(table(HIGH))
    link.symlink_to(first)

    def point_to_second() -> None:
        (tmp_path / "new").symlink_to(second)
        (tmp_path / "new").replace(link)

    with Dataset(out) as dataset:
        after_reading(monkeypatch, point_to_second)
        assert score_into(dataset, [str(link)], ScoringOptions()).failed == 1
        assert last_line(out)["input"] == str(first)
        assert [result.input for result in dataset.results([str(link)])] == [str(link)]
    assert run(out, [str(link)]).failed == 0
    assert last_line(out)["input"] == str(second)
    expected = reba.score(reba.read(second)).data
    pd.testing.assert_frame_equal(scores_in(out).drop(columns="recording"), expected, check_dtype=False)


@pytest.mark.parametrize("jobs", [1, 2])
def test_rules_and_profile_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: int) -> None:
    inputs = []
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text(table(30.0))
        inputs.append(str(tmp_path / name))
    rules, out = tmp_path / "ours.toml", tmp_path / "out"
    rules.write_text("trunk_upright = 5.0\n")
    original = Dataset.pending

    def gone(*args: Any, **more: Any) -> Any:
        rules.write_text("trunk_upright = 19.0\nwalking_legs = 2\n")
        return original(*args, **more)

    monkeypatch.setattr(Dataset, "pending", gone)
    with Dataset(out) as dataset:
        done = score_into(dataset, inputs, ScoringOptions(rules=str(rules)), jobs=jobs)
    assert (done.failed, done.scored.total()) == (0, 2)
    for line in (out / MANIFEST).read_text().splitlines():
        assert json.loads(line)["summary"]["rules"]["trunk_upright"] == 5.0


def test_a_profile_counts_by_what_is_in_it(tmp_path: Path) -> None:
    shipped = SHIPPED / "human_description.toml"
    own = tmp_path / "lab.toml"

    def setting(profile: Path | str) -> str:
        return str(scoring_settings(ScoringOptions(profile=profile))["options"]["profile"])

    own.write_text(shipped.read_text())
    assert setting(own) == setting("human_description") == "human_description"
    own.write_text(shipped.read_text().replace('title = "', 'title = "our '))
    assert setting(own) not in ("human_description", "auto")
    read = ScoringOptions(profile=own).with_files_read()
    own.unlink()
    assert scoring_settings(read) == scoring_settings(read.with_files_read())


def test_a_batch_without_a_dataset_reads_its_rules_once(tmp_path: Path) -> None:
    recordings = [tmp_path / name for name in ("a.csv", "b.csv")]
    for recording in recordings:
        recording.write_text(table(30.0))
    rules = tmp_path / "ours.toml"
    rules.write_text("trunk_upright = 5.0\n")
    results = score_many(
        [str(recording) for recording in recordings],
        None,
        ScoringOptions(rules=str(rules)),
        on_done=lambda _: rules.write_text("damaged = ["),
    )
    assert [result.error for result in results] == [None, None]
