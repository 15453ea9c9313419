"""The `reba` command with unusable inputs, outputs and terminals: one-line errors, no traceback."""

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
from reba.batch.dataset import Dataset, scoring_settings
from reba.batch.run import ScoringOptions, find_inputs, plan_outputs
from reba.cli import main
from reba.errors import RebaError
from tests.support.says import says

TABLE = "time,trunk_flexion,neck_flexion\n0,10,5\n1,70,5\n2,30,5\n"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "shift.csv"
    path.write_text(TABLE)
    return path


def start(words: Sequence[str | Path], shell: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command: in its own process if a shell redirects its output, else in this one, which is faster."""
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
        says(done.stderr, place, "also an input", "choose another name")
    assert table.read_text() == TABLE


def test_a_folder_may_link_to_itself_and_hold_its_scores(table: Path, tmp_path: Path) -> None:
    (tmp_path / "again").symlink_to(tmp_path)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "up").symlink_to(tmp_path)
    assert find_inputs([str(tmp_path)]) == [str(table)]
    for _ in range(2):
        assert start(["score", tmp_path, "-o", tmp_path / "scores"]).returncode == 0
    written = [path.relative_to(tmp_path) for path in (tmp_path / "scores").rglob("*.parquet")]
    assert written == [Path("scores/recording=shift.csv/scores.parquet")]


def test_an_empty_name_is_no_folder(monkeypatch: pytest.MonkeyPatch, table: Path) -> None:
    monkeypatch.chdir(table.parent)
    with pytest.raises(RebaError) as error:
        find_inputs([""])
    says(error, "empty name", "check the path")
    assert plan_outputs(["."], ["."], "out", None) == (None, Path("out"))
    with Dataset("out") as dataset:
        (pending,) = dataset.pending(["."], scoring_settings(ScoringOptions()))
    assert pending.recording == table.parent.name


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_does_not_hang(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    with pytest.raises(reba.ReadError) as error:
        reba.read(pipe)
    says(error, pipe, "regular file")
    with pytest.raises(RebaError) as error:
        find_inputs([str(tmp_path)])
    says(error, tmp_path, "no recording", "reba info FILE")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("words", [[], ["--json"]])
def test_a_full_disk_is_one_line(table: Path, words: list[str]) -> None:
    done = start(["score", table, *words], ">/dev/full")
    assert done.returncode == 2
    says(done.stderr, "No space left")


@pytest.mark.slow
def test_a_closed_output_pipe_is_no_error(table: Path) -> None:
    done = start(["info", table], '| head -1 >/dev/null; exit "${PIPESTATUS[0]}"')
    assert (done.returncode, done.stderr) == (0, "")
    assert start(["score", table], ">&-").stderr.count("Traceback") == 0


def test_an_output_path_inside_a_file_is_one_line(table: Path) -> None:
    for words in (["-o", table / "x.csv"], ["--report", table / "x.html"]):
        done = start(["score", table, *words])
        assert done.returncode == 2
        says(done.stderr, table, "cannot be written")


def test_warnings_of_the_reader_are_in_every_output(tmp_path: Path) -> None:
    path = tmp_path / "odd.csv"
    path.write_text("time,trunk_flexion,neck_flexoin\n0,1,2\n2,1,2\n1,1,2\n3,1")
    (summary,) = json.loads(start(["score", path, "--json"]).stdout)["recordings"]
    assert len(summary["warnings"]) >= 3
    assert any("neck_flexion" in text for text in summary["warnings"])
    assert any("sorted" in text for text in summary["warnings"])
    shown = " ".join(start(["score", path]).stdout.split())
    assert all(" ".join(text.split()) in shown for text in summary["warnings"])


@pytest.mark.parametrize("words", [["explain", "--at", "1"], ["improve"], ["convert", "-o", "out.csv"], ["compare"]])
def test_every_command_says_what_the_reader_noticed(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("odd.csv").write_text("time,trunk_flexion,neck_flexoin\n0,1,2\n2,1,2\n1,1,2\n3,1")
    notes = reba.read("odd.csv").quality.notes()
    assert len(notes) >= 3
    inputs = ["odd.csv"] * (2 if words == ["compare"] else 1)
    for form in ([], ["--json"]):
        done = start([words[0], *inputs, *words[1:], *form])
        assert done.returncode == 0
        assert done.stderr.splitlines() == [f"note: {note}" for note in notes]


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
