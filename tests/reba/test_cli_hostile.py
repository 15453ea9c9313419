"""The `reba` command with inputs, places and terminals that are not as they should be: one line, no traceback."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from unittest import mock

import pandas as pd
import pytest

import reba
from reba.batch.dataset import Dataset, settings
from reba.batch.run import ScoringOptions, check_report, find_inputs, plan_output
from reba.cli import main
from reba.errors import RebaError

TABLE = "time,trunk_flexion,neck_flexion\n0,10,5\n1,70,5\n2,30,5\n"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "shift.csv"
    path.write_text(TABLE)
    return path


def start(words: Sequence[str | Path], shell: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command: in a process of its own where a shell holds its ends, else in this one, which is faster."""
    if shell is not None:
        call = [sys.executable, "-c", "from reba.cli import main; main()", *map(str, words)]
        env = {key: value for key, value in os.environ.items() if key != "COLUMNS"}
        piped = ["bash", "-c", f'"$@" {shell}', "bash", *call]
        return subprocess.run(piped, capture_output=True, text=True, timeout=60, env=env, check=False)
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["reba", *map(str, words)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as stop,
    ):
        main()
    return subprocess.CompletedProcess(sys.argv, int(stop.value.code or 0), out.getvalue(), err.getvalue())


@pytest.mark.parametrize("command", ["score", "compare"])
def test_a_report_never_replaces_a_recording(table: Path, command: str) -> None:
    inputs = [table, table] if command == "compare" else [table]
    link = table.with_name("link.html")
    link.symlink_to(table)
    for place in (table, link):
        done = start([command, *inputs, "--report", place])
        assert done.returncode == 2
        assert "recording and would be lost" in done.stderr
        assert done.stderr.count("\n") == 1
    assert table.read_text() == TABLE


def test_a_report_is_refused_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(RebaError, match="score table"):
        check_report("out.csv", ["a.mcap"], Path("out.csv"))
    with pytest.raises(RebaError, match="one file"):
        check_report(str(tmp_path), ["a.mcap"])
    check_report("new.html", ["a.mcap"], None)


def test_a_folder_may_link_to_itself_and_hold_its_scores(table: Path, tmp_path: Path) -> None:
    (tmp_path / "again").symlink_to(tmp_path)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "up").symlink_to(tmp_path)
    assert find_inputs([str(tmp_path)]) == [str(table)]
    for _ in range(2):
        assert start(["score", tmp_path, "-o", tmp_path / "scores"]).returncode == 0
    found = [path.relative_to(tmp_path) for path in (tmp_path / "scores").rglob("*.parquet")]
    assert found == [Path("scores/recording=shift.csv/scores.parquet")]


def test_an_empty_name_is_no_folder(monkeypatch: pytest.MonkeyPatch, table: Path) -> None:
    monkeypatch.chdir(table.parent)
    with pytest.raises(RebaError, match="empty name"):
        find_inputs([""])
    assert plan_output(["."], "out") == (None, Path("out"))
    with Dataset("out") as dataset:
        (part,) = dataset.due(["."], settings(ScoringOptions()))
    assert part.recording == table.parent.name


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_does_not_hang(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    with pytest.raises(reba.ReadError, match="not a regular file"):
        reba.read(pipe)
    with pytest.raises(RebaError, match="holds no recording"):
        find_inputs([str(tmp_path)])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("words", [[], ["--json"]])
def test_a_full_disk_is_one_line(table: Path, words: list[str]) -> None:
    done = start(["score", table, *words], ">/dev/full")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "No space left" in done.stderr


def test_a_reader_that_goes_away_is_no_error(table: Path) -> None:
    done = start(["info", table], '| head -1 >/dev/null; exit "${PIPESTATUS[0]}"')
    assert (done.returncode, done.stderr) == (0, "")
    assert start(["score", table], ">&-").stderr.count("Traceback") == 0


def test_a_place_inside_a_file_is_one_line(table: Path) -> None:
    for words in (["-o", table / "x.csv"], ["--report", table / "x.html"]):
        done = start(["score", table, *words])
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert "cannot be written" in done.stderr


def test_warnings_of_the_reader_stand_in_every_output(tmp_path: Path) -> None:
    path = tmp_path / "odd.csv"
    path.write_text("time,trunk_flexion,neck_flexoin\n0,1,2\n2,1,2\n1,1,2\n3,1")
    (found,) = json.loads(start(["score", path, "--json"]).stdout)["recordings"]
    assert any("truncated" in text for text in found["warnings"])
    assert any("neck_flexion" in text for text in found["warnings"])
    assert any("sorted" in text for text in found["warnings"])
    assert "truncated" in start(["score", path]).stdout


def test_factor_columns_hold_words_codes_and_both_sides(tmp_path: Path) -> None:
    path = tmp_path / "factors.csv"
    path.write_text("time,trunk_flexion,coupling_left,shock\n0,1,fair,yes\n1,1,2,no\n")
    scores = reba.score(reba.read(path))
    assert scores.data["coupling_left"].tolist() == [1, 2]
    assert scores.data["load_force"].tolist() == [1, 0]
    path.write_text("time,trunk_flexion,coupling,arm_supported\n0,1,fair,true\n1,1,poor,false\n")
    for postures in (reba.read(path), pd.read_csv(path)):
        scores = reba.score(postures)
        assert scores.data["coupling_left"].tolist() == scores.data["coupling_right"].tolist() == [1, 2]
        assert scores.factors.arm_supported_right.tolist() == [True, False]
        assert not [text for text in scores.assumed if "coupling" in text or "supported" in text]
