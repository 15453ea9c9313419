"""`lgp simulate-study` and `lgp study` from plans to pages: known effects, none, and everything that can be wrong."""

from __future__ import annotations

import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import lgp
import reba
from lgp.study.commands import simulate_study
from lgp.study.commands import study as study_command
from lgp.study.labels import Label, recorded_label
from lgp.study.report import render
from lgp.study.simulate import simulate
from lgp.study.study import run_study
from reba.command_line import run
from tests.support.studies import log

pytestmark = pytest.mark.slow


CONDITIONS = ("lean", "plan")
LEAN = {"lean": {"trunk_flexion": 70.0, "upper_arm_flexion_right": 60.0}}
PEOPLE = 6
VOID = {"area", "base", "br", "col", "hr", "img", "input", "link", "meta"}


@pytest.fixture(scope="module")
def logs(planned: lgp.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Simulated logs of six people, one condition leaning and reaching farther."""
    folder = tmp_path_factory.mktemp("logs")
    simulate(dict.fromkeys(CONDITIONS, planned), folder, participants=PEOPLE, rate=10.0, offsets=LEAN)
    return folder


@pytest.fixture
def copy(logs: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(logs, tmp_path / "logs"))


def call(capsys: pytest.CaptureFixture[str], command: Any, *arguments: str | Path) -> tuple[int, str, str]:
    """Return exit code, output and messages of a command."""
    import sys

    argv = sys.argv
    sys.argv = ["lgp", *map(str, arguments)]
    try:
        with pytest.raises(SystemExit) as stop:
            run(command, "lgp")
    finally:
        sys.argv = argv
    captured = capsys.readouterr()
    return int(stop.value.code or 0), captured.out, captured.err


class Nesting(HTMLParser):
    """Checks that every element is closed in its turn."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_a_known_effect_is_recovered_from_files(logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "results"
    code, printed, _ = call(capsys, study_command, logs, "-o", out, "--report", tmp_path / "one.html", "--json")
    assert code == 0
    found = json.loads(printed)
    assert found["conditions"] == ["lean", "plan"]
    assert found["simulated"]
    (pair,) = found["reba"]["pairs"]
    assert pair["n"] == PEOPLE
    assert pair["low"] > 0
    assert pair["p"] < 0.01
    trunk = found["parts"]["trunk"]["pairs"][0]
    assert trunk["difference"] > 0.5
    assert trunk["p_holm"] < 0.05
    assert found["failed"] == found["missing"] == []
    assert "lean above plan" in found["parts_verdict"]
    assert {key: value for key, value in found.items() if key not in ("output", "report")} == json.loads(
        (out / "summary.json").read_text()
    )
    table = pd.read_parquet(out / "scores.parquet")
    assert list(table.columns[:3]) == ["participant", "condition", "trial"]
    assert len(table) == 2 * PEOPLE
    html = (out / "report.html").read_text()
    assert "Simulated data." in html
    assert html.count("<svg") == 2
    Nesting().feed(html)
    assert "://" not in re.sub(r'xmlns="[^"]*"', "", html)
    assert (tmp_path / "one.html").exists()
    again = run_study(logs, exclude=out).summary
    assert again["reba"] == found["reba"]


def test_the_terminal_says_it_too(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, printed, _ = call(capsys, study_command, logs, "--conditions", "plan,lean")
    assert code == 0
    assert "SIMULATED DATA" in printed
    assert "lower with plan than with lean" in " ".join(printed.split())


def test_a_damaged_recording_is_listed_and_stops_no_other(
    copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = copy / "sim02_plan.mcap"
    data = bytearray(bad.read_bytes())
    at = data.index(b"zstd") + 40
    data[at : at + 40] = bytes(40)
    bad.write_bytes(data)
    (copy / "sim05_lean.mcap").unlink()
    log(copy / "unnamed.mcap")
    code, printed, errors = call(capsys, study_command, copy, "-o", tmp_path / "out", "--json")
    assert code == 1
    assert "sim02_plan.mcap" in errors
    assert "unnamed.mcap: no metadata record" in errors
    found = json.loads(printed)
    assert found["incomplete"] == ["sim02", "sim05"]
    assert found["reba"]["pairs"][0]["n"] == PEOPLE - 2
    assert {Path(one["input"]).name for one in found["failed"]} == {"sim02_plan.mcap", "unnamed.mcap"}
    html = (tmp_path / "out" / "report.html").read_text()
    assert "sim05, lean" in html
    Nesting().feed(html)


def test_a_recording_that_is_shorter_counts_as_long_as_it_is(copy: Path) -> None:
    complete = run_study(copy).recordings.set_index("input")
    path = str(copy / "sim01_plan.mcap")
    table = reba.read(path).data
    half = table[table["time"] < table["time"].max() / 3]
    reba.write_postures(reba.scores.table_of(half), path, records={"study": Label("sim01", "plan").record()})
    scored = run_study([copy])
    row = scored.recordings.set_index("input").loc[path]
    assert row["seconds"] < 0.5 * complete.loc[path]["seconds"]
    others = complete.index != path
    assert scored.recordings.set_index("input")["reba"][others].tolist() == complete["reba"][others].tolist()
    assert any("less than half of the median" in warning for warning in scored.summary["warnings"])
    assert scored.summary["complete"] == [f"sim{n:02}" for n in range(1, PEOPLE + 1)]


def test_a_manifest_names_what_holds_no_label(copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = ["file,participant,condition"]
    for path in sorted(copy.glob("*.mcap")):
        label = recorded_label(path)
        assert label is not None
        target = tmp_path / f"{path.stem}.csv"
        reba.write_postures(reba.read(path), target)
        lines.append(f"{target.name},{label.participant},{label.condition}")
    manifest = tmp_path / "who.csv"
    manifest.write_text("\n".join([*lines, "gone.csv,sim99,lean"]))
    code, printed, errors = call(capsys, study_command, "--manifest", manifest, "--json")
    assert code == 1
    assert "gone.csv" in errors
    found, reference = json.loads(printed), run_study([str(copy)]).summary
    assert found["reba"]["pairs"][0]["difference"] == pytest.approx(reference["reba"]["pairs"][0]["difference"])
    assert found["incomplete"] == ["sim99"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nowhere"], "no such file"),
        ([], "no recording was given"),
        (["{logs}", "--manifest", "{logs}/none.csv"], "cannot be read"),
        (["{logs}", "--pattern", "{participant}"], "expected {participant} and {condition}"),
        (["{logs}", "--conditions", "lean,plam"], "did you mean 'plan'"),
        (["{logs}", "--conditions", "lean,lean"], "repeated"),
        (["{logs}", "--rules", "nonsense"], "nonsense"),
        (["{logs}", "-o", "{logs}/sim01_plan.mcap"], "not a folder"),
        (["{logs}", "--missing", "error", "--profile", "nonsense"], "nonsense"),
    ],
)
def test_bad_usage_is_one_line(logs: Path, given: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    values = [text.replace("{logs}", str(logs)) for text in given]
    code, printed, errors = call(capsys, study_command, *values)
    assert code == 2
    assert said in errors
    assert errors.count("\n") == 1
    assert printed == ""


def test_one_participant_has_scores_and_no_test(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in copy.glob("*.mcap"):
        if "sim01" not in path.name:
            path.unlink()
    code, printed, _ = call(capsys, study_command, copy, "--json", "-o", copy / "out")
    assert code == 0
    found = json.loads(printed)
    assert found["verdict"].startswith("No test can be made: 1 participant")
    assert found["reba"]["pairs"][0]["p"] is None
    Nesting().feed((copy / "out" / "report.html").read_text())


def test_names_are_escaped_on_the_page(logs: Path) -> None:
    summary = run_study(logs).summary
    text = json.dumps(summary).replace("sim01", "<b>&").replace('"lean', '"<i>x')
    html = render(json.loads(text), command="lgp study <logs>")
    assert "<b>&" not in html
    assert "<i>x" not in html
    Nesting().feed(html)


def test_simulate_study_writes_labelled_logs(
    planned: lgp.Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    planned.save(tmp_path / "plan")
    out = tmp_path / "logs"
    same = [f"a b={tmp_path / 'plan'}", f"c={tmp_path / 'plan'}"]
    code, printed, _ = call(capsys, simulate_study, *same, "-n", "2", "--rate", "10", "-o", out, "--json")
    assert code == 0
    made = json.loads(printed)
    assert [one["file"] for one in made["logs"]] == ["sim01_a-b.mcap", "sim01_c.mcap", "sim02_a-b.mcap", "sim02_c.mcap"]
    assert recorded_label(out / "sim01_a-b.mcap") == Label("sim01", "a b", simulated=True)
    read = reba.read(out / "sim01_c.mcap")
    assert read.data["load"].max() == pytest.approx(planned.carried.max())
    assert b"no person was recorded" in (out / "sim01_c.mcap").read_bytes()
    for given, said in ((["x"], "CONDITION=PLAN_DIR"), ([f"a={tmp_path / 'none'}"], "cannot be read as a plan")):
        code, _, errors = call(capsys, simulate_study, *given, "-o", tmp_path / "more")
        assert code == 2
        assert said in errors
    log(out / "other.mcap")
    code, _, errors = call(capsys, simulate_study, *same, "-o", out)
    assert code == 2
    assert "other recordings" in errors
