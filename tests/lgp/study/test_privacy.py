"""The report of a study shows no label that may be a name and no folder, unless asked."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from lgp.study.commands import study as study_command
from tests.lgp.study.test_commands import call
from tests.support.studies import log


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    folder = tmp_path / "customer_acme" / "ann lee"
    for person, lean in (("Ann Lee", 10.0), ("bo", 20.0), ("p07", 15.0)):
        for condition, more in (("low", 0.0), ("high", 40.0)):
            if (person, condition) != ("bo", "high"):
                label = {"participant": person, "condition": condition}
                log(folder / f"{person.replace(' ', '_')}_{condition}.mcap", label, lean + more)
    (folder / "Ann Lee broken.mcap").write_bytes(b"\x89MCAP0\r\n")
    return folder


def test_names_and_folders_are_left_out(logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, _ = call(capsys, study_command, logs, "-o", tmp_path / "out", "--conditions", "low,high")
    assert code == 1, "one recording is damaged"
    page = (tmp_path / "out" / "report.html").read_text()
    for hidden in ("Ann", "Lee", "acme", ">bo<", "bo,", "bo:", str(tmp_path)):
        assert hidden not in page.replace("Ann_Lee_", ""), hidden
    assert "[name 1]" in page
    assert "p07" in page, "a number tells nothing"
    assert "numbered in their alphabetical order" in page
    scores = pd.read_parquet(tmp_path / "out" / "scores.parquet")
    assert set(scores["participant"]) == {"Ann Lee", "bo", "p07"}, "the table has the labels"


def test_names_are_shown_on_request(logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, study_command, logs, "-o", tmp_path / "out", "--names")
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Ann Lee" in page
    assert "[name 1]" not in page
    assert "as was asked for" in page
