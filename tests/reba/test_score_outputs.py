"""`reba score` beside and inside its inputs: refused, or the same command gives the same result again."""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest

import reba
from reba.batch.manifest import MANIFEST
from reba.cli import main
from reba.posture.table import table_of
from tests.support.says import says

TABLE = "time,trunk_flexion,neck_flexion\n0,10,5\n1,70,5\n2,30,5\n"


def call(*words: str | Path) -> tuple[int, str, str]:
    """Return exit code, output and messages of `reba`."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["reba", *map(str, words)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as stop,
    ):
        main()
    return int(stop.value.code or 0), out.getvalue(), err.getvalue()


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a folder with one recording, the working folder."""
    place = tmp_path / "rec"
    place.mkdir()
    (place / "shift.csv").write_text(TABLE)
    monkeypatch.chdir(place)
    return place


def refused(folder: Path, *words: str | Path) -> str:
    before = files(folder.parent)
    code, out, err = call(*words)
    assert (code, out) == (2, ""), err
    assert files(folder.parent) == before
    return err


def same_again(*words: str | Path) -> dict[str, Any]:
    """Return the result of a command that must be the same when it is repeated."""
    results = []
    for _ in range(3):
        code, out, err = call(*words, "--json")
        assert code == 0, err
        result = json.loads(out)
        result.pop("dataset", None)
        results.append(result)
    assert results[0] == results[1] == results[2]
    return dict(results[0])


@pytest.mark.parametrize("name", ["scores.parquet", "shift.csv.mcap", "new/scores.csv"])
def test_a_table_in_a_searched_folder_would_be_the_next_recording(folder: Path, name: str) -> None:
    for searched in (".", folder, f"../{folder.name}"):
        says(refused(folder, "score", searched, "-o", folder / name), name, "searched for recordings", "outside")
    assert len(same_again("score", ".", "-o", "../scores.parquet")["recordings"]) == 1
    assert len(same_again("score", "shift.csv", "-o", name)["recordings"]) == 1


def test_a_folder_of_scores_holds_no_recordings_that_are_searched_for(folder: Path) -> None:
    (folder / "day").mkdir()
    (folder / "day" / "late.csv").write_text(TABLE)
    (folder.parent / "link").symlink_to(folder)
    for output in (".", "day", "../link", f"{folder}/day/.."):
        says(refused(folder, "score", ".", "-o", output), output, "holds recordings", "scores")
    assert len(same_again("score", ".", "-o", "scores")["recordings"]) == 2
    assert len(same_again("score", ".", "day", "-o", "day/scores")["recordings"]) == 2
    assert len(same_again("score", "day", "-o", ".")["recordings"]) == 1


def test_a_recording_named_itself_may_lie_in_the_folder_of_scores(folder: Path) -> None:
    assert len(same_again("score", "shift.csv", "-o", ".")["recordings"]) == 1
    assert (folder / MANIFEST).is_file()


def test_scores_are_never_scored_over_themselves(folder: Path) -> None:
    call("score", "shift.csv", "-o", "scores")
    (scores,) = (folder / "scores").rglob("*.parquet")
    says(refused(folder, "score", scores, "-o", "scores"), scores, "would be lost in scores")


@pytest.mark.parametrize("name", [MANIFEST, "_lock", "recording=shift.csv/scores.parquet"])
def test_a_report_replaces_nothing_of_a_folder_of_scores(folder: Path, name: str) -> None:
    report = f"scores/{name}"
    says(refused(folder, "score", "shift.csv", "-o", "scores", "--report", report), report, "another output")


def test_a_report_beside_the_recordings_is_no_recording(folder: Path) -> None:
    assert len(same_again("score", ".", "-o", "scores", "--report", "report.html")["recordings"]) == 1


def test_a_report_replaces_no_recording_that_was_searched_for(folder: Path) -> None:
    os.link(folder / "shift.csv", folder.parent / "hard.html")
    for report in ("shift.csv", "../hard.html"):
        says(refused(folder, "score", ".", "--report", report), report, "input", "another name")
    says(refused(folder, "score", ".", "-o", "../a.csv", "--report", "../a.csv.meta.json"), "another output")


def write_bag(folder: Path) -> None:
    folder.mkdir()
    for number in range(2):
        frames = pd.DataFrame({"time": 20.0 * number + np.arange(20.0), "trunk_flexion": 10.0})
        reba.write_postures(table_of(frames), folder / f"bag_{number}.mcap")


def test_nothing_is_written_into_a_recording_that_was_searched_for(folder: Path) -> None:
    write_bag(folder / "bag")
    for words in (["-o", "bag/scores"], ["--report", "bag/report.html"], ["-o", "bag"]):
        says(refused(folder, "score", ".", *words), words[-1], "lies in the recording", "bag")
    assert len(same_again("score", ".", "-o", "scores", "--report", "report.html")["recordings"]) == 2


def test_functions_replace_no_recording_either(folder: Path) -> None:
    postures = reba.read("shift.csv")
    scores = reba.score(postures)
    before = files(folder)
    for write in (reba.write_scores, reba.write_report):
        with pytest.raises(reba.RebaError) as error:
            write(scores, "shift.csv")
        says(error, "shift.csv", "input", "another name")
    with pytest.raises(reba.RebaError):
        reba.write_postures(postures, folder / "shift.csv")
    assert files(folder) == before


@pytest.mark.parametrize("name", ["in.csv/below.html", "/proc/nothing.html", "folder", ""])
def test_a_report_is_refused_before_it_is_rendered(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    (folder / "folder").mkdir()
    (folder / "in.csv").write_text(TABLE)
    monkeypatch.setattr("reba.report.render", lambda *_, **__: pytest.fail("the work began"))
    with pytest.raises(reba.RebaError) as error:
        reba.write_report(reba.score(reba.read("shift.csv")), name)
    says(error, name or "path is ''")
