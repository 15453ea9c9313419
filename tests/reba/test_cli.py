"""The `reba` command: output, JSON, exit codes, one-line errors."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

import reba
from reba.cli import cli, main
from tests.support import mcap_builder as make
from tests.support.paths import DATASETS
from tests.support.says import says

ASSEMBLY = str(DATASETS / "simulated_assembly.csv")
PALLETS = str(DATASETS / "simulated_palletising.mcap")

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["reba", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            main()
        captured = capsys.readouterr()
        return int(stop.value.code or 0), captured.out, captured.err

    return call


@pytest.mark.parametrize("command", sorted(cli.commands))
def test_every_command_has_help_with_an_example(run: Run, command: str) -> None:
    code, out, _ = run(command, "--help")
    assert code == 0
    assert f"Example: reba {command}" in " ".join(out.split())


@pytest.mark.parametrize("width", [80, 160])
def test_score_prints_a_table(run: Run, monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    code, out, err = run("score", ASSEMBLY)
    assert code == 0
    lines = out.splitlines()
    assert all(len(line) <= width for line in lines)
    assert "\u2026" not in out
    assert "median" in out
    words = " ".join(out.split())
    assert "not measured: wrist_flexion, wrist_deviation, wrist_twist" in words
    assert "assumed: no shock" in words
    assert err == ""


def test_score_json_has_the_contract_shape(run: Run, tmp_path: Path) -> None:
    out_file = tmp_path / "scores.parquet"
    code, out, _ = run("score", ASSEMBLY, "--json", "-o", out_file, "--missing", "neutral")
    assert code == 0
    result = json.loads(out)
    assert result["failed"] == []
    (recording,) = result["recordings"]
    keys = {"input", "frames", "seconds", "rules", "profile", "unmeasured", "assumed", "reba", "range"}
    assert keys | {"action_levels", "worst", "parts", "output"} <= set(recording)
    assert recording["input"] == ASSEMBLY
    assert recording["output"] == str(out_file)
    assert set(recording["reba"]) == {"mean", "median", "p90", "max"}
    assert {"mean_low", "mean_high"} <= set(recording["range"])
    assert sum(recording["action_levels"].values()) == pytest.approx(1.0)
    assert {"time", "reba", "why"} <= set(recording["worst"][0])
    table = pd.read_parquet(out_file)
    assert recording["frames"] == len(table)
    assert recording["reba"]["max"] == int(table["reba"].max())


def test_measurement_error(run: Run, tmp_path: Path) -> None:
    own = tmp_path / "lab.toml"
    own.write_text('base = "optical"\ntrunk_flexion = 9\n', encoding="utf-8")
    out_file = tmp_path / "scores.csv"
    code, out, _ = run("score", ASSEMBLY, "--json", "--error", own, "-o", out_file)
    assert code == 0
    found = json.loads(out)["recordings"][0]["distribution"]
    assert found["error"]["name"] == "lab"
    assert found["error"]["sd"]["trunk_flexion"] == 9.0
    table = pd.read_csv(out_file)
    assert table["p_level_2_low"].between(0.0, 1.0).all()
    assert (table["reba_95_low"] <= table["reba_95_high"]).all()
    about = json.loads((tmp_path / "scores.csv.meta.json").read_text(encoding="utf-8"))
    assert about["error"]["name"] == "lab"
    _, out, _ = run("score", ASSEMBLY, "--error", "inertial")
    assert "with measurement error (inertial)" in " ".join(out.split())
    _, out, _ = run("score", ASSEMBLY)
    assert "measurement error" not in out
    _, out, _ = run("explain", ASSEMBLY, "--at", "20", "--error", "inertial")
    assert "with measurement error (inertial)" in out
    code, _, err = run("score", ASSEMBLY, "--error", "laser")
    assert code == 2
    says(err, "laser", "one-camera", ".toml")


def test_one_bad_file_does_not_stop_the_others(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a_bad.csv").write_text("time,trunk_flexion\n0,abc\n")
    (tmp_path / "b_good.csv").write_text(Path(ASSEMBLY).read_text())
    code, out, _ = run("score", tmp_path, "--json", "-o", tmp_path / "out")
    result = json.loads(out)
    assert code == 1
    assert [Path(r["input"]).name for r in result["recordings"]] == ["b_good.csv"]
    assert [Path(f["input"]).name for f in result["failed"]] == ["a_bad.csv"]
    assert [str(p.relative_to(tmp_path / "out")) for p in (tmp_path / "out").rglob("*.parquet")] == [
        "recording=b_good.csv/scores.parquet"
    ]
    code, out, _ = run("score", tmp_path / "a_bad.csv", tmp_path / "b_good.csv")
    assert code == 1
    assert "failed: " in out
    code, out, err = run("score", tmp_path / "a_bad.csv", tmp_path / "b_good.csv", "-o", tmp_path / "other")
    assert "1 scored, 1 failed (2 new)" in out + err


@pytest.mark.slow
def test_parallel_scoring_gives_the_same(run: Run, tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text(Path(ASSEMBLY).read_text())
    _, one, _ = run("score", tmp_path, "--json")
    _, two, _ = run("score", tmp_path, "--json", "--jobs", "2")
    assert json.loads(one) == json.loads(two)


@pytest.mark.parametrize(
    ("words", "facts"),
    [
        (["score", "no_such_file.mcap"], ("no_such_file.mcap", "no such file")),
        (["score", ASSEMBLY, "--load", "-3"], ("--load", "-3", "0<=x<=10000")),
        (["score", ASSEMBLY, "--load", "heavy"], ("--load", "heavy")),
        (["score", ASSEMBLY, "--rules", "strict"], ("strict", "measured", "paper")),
        (["score", ASSEMBLY, "--activity", "sleeping"], ("sleeping",)),
        (["score", ASSEMBLY, "--coupling", "super"], ("--coupling", "super", "good")),
        (["score", ASSEMBLY, "--frobnicate"], ("--frobnicate",)),
        (["score"], ("INPUT",)),
        (["explain", ASSEMBLY, "--at", "1e9"], ("outside the recording",)),
        (["score", ASSEMBLY, "-o", "scores.docx"], (".docx", ".parquet")),
        (["score", ASSEMBLY, "--missing", "error"], ("not measured",)),
        (["score", ASSEMBLY, "--profile", "xsenss"], ("xsenss", "xsens")),
        (["convert", ASSEMBLY, "-o", ASSEMBLY], (ASSEMBLY, "also an input", "choose another name")),
        (["frobnicate"], ("frobnicate",)),
    ],
)
def test_bad_usage_is_one_line_and_exit_2(run: Run, words: list[str], facts: tuple[str, ...]) -> None:
    code, out, err = run(*words)
    assert code == 2
    assert out == ""
    assert err.startswith("reba: ")
    says(err, *facts)


def test_explain_worksheet_adds_up(run: Run) -> None:
    code, out, _ = run("explain", ASSEMBLY, "--at", "10", "--json", "--load", "7")
    assert code == 0
    sheet = json.loads(out)
    trunk = sum(line["points"] for line in sheet["lines"] if line["part"] == "trunk")
    assert trunk == sheet["scores"]["trunk"]
    code, out, _ = run("explain", ASSEMBLY, "--at", "10")
    assert code == 0
    assert "trunk flexion" in out
    assert "Table A" in out


def test_improve_lowers_the_level(run: Run) -> None:
    code, out, _ = run("improve", ASSEMBLY, "--json", "--load", "12")
    assert code == 0
    result = json.loads(out)
    for frame in result["frames"]:
        for improvement in frame["improvements"]:
            assert improvement["level_after"] < improvement["level_before"]
    assert result["worst_minute"]["improvements"]
    code, out, _ = run("improve", ASSEMBLY, "--at", "10", "--load", "12")
    assert code == 0
    assert "frame at 10.00 s" in out


def test_compare_shows_the_difference(run: Run) -> None:
    code, out, _ = run("compare", ASSEMBLY, ASSEMBLY, "--json")
    assert code == 0
    result = json.loads(out)
    assert result["difference"]["range"]["mean_low"] == 0.0
    code, out, _ = run("compare", ASSEMBLY, PALLETS)
    assert code == 0
    assert "At medium risk" in out
    assert re.search(r"At medium risk .*[+−]\d+", out)


def test_info_and_profiles(run: Run) -> None:
    code, out, _ = run("info", PALLETS)
    assert code == 0
    assert "/joint_states" in out
    assert "human_description" in out
    assert not re.search(r"[┃│] +[┃│]?$", out, re.MULTILINE)  # no column is empty
    assert "not measured" not in out
    assert re.search(r"highest +┃ not measured +┃", run("info", ASSEMBLY)[1])
    code, out, _ = run("info", PALLETS, "--json")
    assert code == 0
    assert json.loads(out)
    code, out, _ = run("profiles", "--json")
    assert code == 0
    known = {p["name"]: p for p in json.loads(out)["profiles"]}
    assert {"human_description", "ros4hri"} <= known.keys()
    girdle = ["shoulder_elevation_left", "shoulder_elevation_right"]
    assert known["keypoints_openpose"]["needs_neutral"] == girdle
    assert known["human_description"]["needs_neutral"] == known["keypoints_coco"]["needs_neutral"] == []
    code, out, _ = run("profiles")
    assert code == 0
    assert "ros4hri" in out


def test_info_of_thousands_of_topics_lists_those_that_can_be_read(run: Run, tmp_path: Path) -> None:
    """Each row of a table in the terminal takes long; a small file can hold tens of thousands of topics."""
    text = make.schema(1, "std_msgs/msg/String", "ros2msg", b"string data\n")
    state = make.schema(2, make.JOINT_STATE, "ros2msg", make.definition(make.JOINT_STATE))
    topics = [make.channel(number, 1, f"/said_{number}", "cdr") for number in range(1, 3000)]
    rows = tuple((5000, make.EPOCH_NS + at * make.STEP_NS, one) for at, one in enumerate(make.payloads()))
    joints = make.channel(5000, 2, "/joints", "cdr")
    path = tmp_path / "topics.mcap"
    path.write_bytes(make.build(make.Plan((rows,), (text, state, *topics, joints))))
    _, out, _ = run("info", path)
    assert "/joints" in out
    assert "and 2500 more topics" in out
    _, out, _ = run("info", path, "--json")
    assert len(json.loads(out)["topics"]) == 3000


def test_a_shipped_profile_is_a_start_for_ones_own(run: Run, tmp_path: Path) -> None:
    code, text, _ = run("profiles", "human_description")
    assert code == 0
    own = tmp_path / "own.toml"
    own.write_text(text.replace('name = "human_description"', 'name = "own"'))
    code, out, _ = run("score", PALLETS, "--profile", own, "--json")
    assert code == 0
    assert json.loads(out)["recordings"][0]["profile"] == "own"
    assert run("profiles", "human_descriptoin")[0] == 2


def test_open_statistics_are_empty_not_those_of_some_frames(run: Run) -> None:
    _, out, _ = run("score", ASSEMBLY, "--json")
    recording = json.loads(out)["recordings"][0]
    assert recording["reba"]["mean"] is None
    assert recording["range"]["mean_low"] < recording["range"]["mean_high"]
    for name in ("p90", "max"):
        low, high = recording["range"][f"{name}_low"], recording["range"][f"{name}_high"]
        assert recording["reba"][name] == (low if low == high else None)
    assert recording["parts"]["wrist_left"]["determined"] < 1.0


def test_convert_then_score_is_the_same(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "postures.parquet"
    assert run("convert", PALLETS, "-o", path)[0] == 0
    direct = reba.score(reba.read(PALLETS)).data
    again = reba.score(reba.read(path)).data
    pd.testing.assert_frame_equal(direct, again)


def test_report_is_written(run: Run, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    code, _, err = run("score", ASSEMBLY, "--report", page)
    assert code == 0
    assert f"written: {page}" in err
    assert "<html" in page.read_text(encoding="utf-8")


def test_interrupt_is_130(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("reba.cli.score_many", interrupted)
    code, out, err = run("score", ASSEMBLY)
    assert code == 130
    assert out == ""
    assert err.strip() == "reba: interrupted"


def test_closed_pipe_is_quiet() -> None:
    code = "import sys; from reba.cli import main; sys.argv = ['reba', 'profiles']; main()"
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([sys.executable, "-c", code], stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_installed_commands_answer() -> None:
    for module in ("dreba", "lgp"):
        code = f"import sys; from {module}.cli import main; sys.argv = ['{module}', '--help']; main()"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        assert "Traceback" not in done.stderr
