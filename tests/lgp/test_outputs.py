"""What planning writes: refused before the work, never half replaced, and the same when a command is repeated."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import lgp
from lgp.cli import cli
from lgp.errors import LgpError
from lgp.execution import trajectory_export
from lgp.experiments import screwdriver_experiment, toolbox
from lgp.experiments.runs import RunStore
from lgp.page import page as page_module
from lgp.scene.scene_file import read_scene
from lgp.study import simulate as simulate_module
from lgp.study.labels import Label
from lgp.study.simulate import simulate
from reba.command_line import run
from reba.errors import RebaError
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.page_packages import needs_page
from tests.support.says import says
from tests.support.studies import log

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plan() -> lgp.Plan:
    return lgp.plan(read_scene(HUMAN_ONLY, "box"), cost=None, slices=4)


def call(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    argv, sys.argv = sys.argv, ["lgp", *map(str, words)]
    try:
        with pytest.raises(SystemExit) as stop:
            run(cli, "lgp")
    finally:
        sys.argv = argv
    printed = capsys.readouterr()
    return int(stop.value.code or 0), printed.out, printed.err


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def work(*_: Any, **__: Any) -> Any:
    raise AssertionError("the work began")


FUNCTIONS: dict[str, Callable[[lgp.Plan, Path], Any]] = {
    "write_page": lambda plan, path: lgp.write_page(plan, path),
    "experiment_screwdriver": lambda _, path: lgp.experiment_screwdriver(path, runs=1),
    "experiment_toolbox": lambda _, path: lgp.experiment_toolbox(path),
    "simulate": lambda plan, path: simulate({"a": plan}, path, participants=1),
    "export": lambda plan, path: trajectory_export.write_trajectories(plan, path),
}


@needs_page
@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_refuse_what_cannot_be_written_before_the_work(
    plan: lgp.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    for module, worker in (
        (page_module, "scene_animation"),
        (screwdriver_experiment, "cost_model"),
        (toolbox, "task_of"),
        (simulate_module, "simulated"),
        (trajectory_export, "Planner"),
    ):
        monkeypatch.setattr(module, worker, work)
    (tmp_path / "file").write_text("")
    before = files(tmp_path)
    for place in (tmp_path / "file" / "below", Path("/proc/nothing"), Path("/dev/null")):
        with pytest.raises(LgpError) as error:
            FUNCTIONS[name](plan, place)
        says(error, place)
    assert files(tmp_path) == before


def test_a_plan_replaces_the_former_one_whole_or_not_at_all(
    plan: lgp.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan.save(tmp_path)
    before = files(tmp_path)
    heavier = replace(plan.people["human"], carried=plan.carried + 1.0)
    other = replace(plan, path=plan.path + 0.1, people={"human": heavier})

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    for step in ("lgp.plan_files.write_text", "lgp.plan_files.write_parquet"):
        with monkeypatch.context() as disk:
            disk.setattr(step, full)
            with pytest.raises(LgpError) as error:
                other.save(tmp_path)
        says(error, tmp_path, "cannot be written", "No space left")
        assert files(tmp_path) == before
    replace(plan, people={}).save(tmp_path)
    assert {*files(tmp_path)} == {"plan.json", "plan.txt", "path.parquet"}
    assert lgp.Plan.load(tmp_path).posture.size == 0


def test_a_failed_planning_keeps_the_former_plan(
    plan: lgp.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan.save(tmp_path)
    before = files(tmp_path)
    infeasible = replace(plan, feasible=False, reason="out of reach")
    monkeypatch.setattr("lgp.planner.plan", lambda *_, **__: infeasible)
    code, _, err = call(capsys, "plan", "screwdriver", "-o", tmp_path)
    assert code == 2
    assert "out of reach" in err
    assert "former plan is kept" in err
    assert files(tmp_path) == before
    assert call(capsys, "plan", "screwdriver", "-o", tmp_path / "new")[0] == 2
    assert json.loads((tmp_path / "new" / "plan.json").read_text())["reason"] == "out of reach"


def test_the_record_of_a_failed_planning_is_no_plan_to_keep(
    plan: lgp.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for reason in ("out of reach", "too heavy"):
        infeasible = replace(plan, feasible=False, reason=reason)
        monkeypatch.setattr("lgp.planner.plan", lambda *_, result=infeasible, **__: result)
        code, _, err = call(capsys, "plan", "screwdriver", "-o", tmp_path)
        assert code == 2
        assert "former plan" not in err
        assert json.loads((tmp_path / "plan.json").read_text())["reason"] == reason
    (tmp_path / "plan.json").write_text("{")
    assert "former plan is kept" in call(capsys, "plan", "screwdriver", "-o", tmp_path)[2]
    assert (tmp_path / "plan.json").read_text() == "{"


@pytest.mark.parametrize("name", ["plan.json", "plan.txt", "path.parquet", "postures.parquet"])
def test_a_tree_and_an_export_replace_no_plan(
    plan: lgp.Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    plan.save(tmp_path)
    (tmp_path / "run-1.mcap").write_bytes(b"log")
    before = files(tmp_path)
    for words in (
        ["plan", "screwdriver", "-o", tmp_path, "--tree", tmp_path / name],
        ["run", tmp_path, "--export", tmp_path / name],
        ["run", tmp_path, "--export", tmp_path / "run-1.mcap"],
    ):
        code, _, err = call(capsys, *words)
        assert code == 2
        says(err, words[-1], "another name")
    assert files(tmp_path) == before


@needs_page
def test_a_page_is_written_whole_and_spares_other_files(
    plan: lgp.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan.save(tmp_path)
    own = tmp_path / "pictures" / "holiday.webp"
    own.parent.mkdir()
    own.write_bytes(b"mine")
    (tmp_path / "pictures" / "action-9.webp").write_bytes(b"of a former page")
    lgp.write_page(plan, tmp_path, pictures=False)
    first = files(tmp_path)
    assert {"index.html", "assets/plan.js", "plan.json", "pictures/holiday.webp"} <= {*first}
    assert "pictures/action-9.webp" not in first
    lgp.write_page(lgp.Plan.load(tmp_path), tmp_path, pictures=False)
    assert files(tmp_path) == first

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(page_module, "write_pictures", full)
    with pytest.raises(LgpError) as error:
        lgp.write_page(plan, tmp_path)
    says(error, tmp_path, "cannot be written", "No space left")
    assert files(tmp_path) == first


def test_an_experiment_spares_the_runs_of_another_one(tmp_path: Path) -> None:
    pytest.importorskip("statsmodels")
    RunStore(tmp_path / "screwdriver", {"experiment": "screwdriver"})
    with pytest.raises(LgpError) as error:
        lgp.experiment_toolbox(tmp_path / "screwdriver")
    says(error, "screwdriver", "another experiment", "another folder")
    (tmp_path / "toolbox").mkdir()
    (tmp_path / "toolbox" / "runs.parquet").write_bytes(b"rows")
    with pytest.raises(LgpError) as error:
        lgp.experiment_screwdriver(tmp_path / "toolbox", runs=1)
    says(error, "toolbox", "another experiment", "another folder")
    assert files(tmp_path / "toolbox") == {"runs.parquet": b"rows"}
    RunStore(tmp_path / "every" / "screwdriver" / "paper", {"experiment": "screwdriver"})
    for held, plan in (
        ("screwdriver", lgp.experiment_all), ("toolbox", lgp.experiment_all), ("every", lgp.experiment_toolbox),
        ("every", lgp.experiment_screwdriver),
    ):  # fmt: skip
        before = files(tmp_path)
        with pytest.raises(LgpError) as error:
            plan(tmp_path / held)
        says(error, held, "another experiment", "all" if held == "every" else held, "another folder")
        assert files(tmp_path) == before


def recordings(folder: Path) -> list[Path]:
    names = ((person, condition) for person in ("p1", "p2", "p3") for condition in ("x", "y"))
    return [
        log(folder / f"{person}_{condition}.mcap", Label(person, condition).record()) for person, condition in names
    ]


def test_a_study_in_the_folder_of_its_logs_is_the_same_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("statsmodels")
    logs = recordings(tmp_path)
    for words in ([tmp_path], logs):
        for output in (tmp_path, tmp_path / "results", tmp_path / "more" / ".." / "results"):
            report = tmp_path / "one.html"
            results = [call(capsys, "study", *words, "-o", output, "--report", report, "--json") for _ in range(2)]
            assert [code for code, *_ in results] == [0, 0], results
            assert results[0] == results[1]
            assert len(json.loads(results[0][1])["recordings"]) == len(logs)
            for written in ("summary.json", "scores.parquet", "report.html"):
                (output / written).unlink()


def test_a_study_spares_its_recordings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("statsmodels")
    folder = tmp_path / "logs"
    logs = recordings(folder)
    manifest = folder / "who.csv"
    rows = [f"{file.name},{file.stem[:2]},{file.stem[-1]}" for file in logs]
    manifest.write_text("\n".join(["file,participant,condition", *rows]))
    (tmp_path / "link.html").symlink_to(logs[0])
    before = files(tmp_path)
    for words in (
        [folder, "--report", logs[0]],
        [folder, "--report", tmp_path / "link.html"],
        ["--manifest", manifest, "--report", logs[0]],
        ["--manifest", manifest, "--report", manifest],
    ):
        code, _, err = call(capsys, "study", *words)
        assert code == 2
        says(err, words[-1], "input", "another name")
    for name in ("summary.json", "scores.parquet", "report.html"):
        code, _, err = call(capsys, "study", folder, "-o", folder / "r", "--report", folder / "r" / name)
        assert code == 2
        says(err, name, "another output")
    assert files(tmp_path) == before


def test_simulated_logs_replace_the_former_ones_all_or_none(
    plan: lgp.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulate({"a": plan}, tmp_path, participants=2, rate=5.0)
    before = files(tmp_path)
    assert {*before} == {"sim01_a.mcap", "sim02_a.mcap"}
    written = simulate_module.write_postures

    def full(postures: Any, path: Path, **more: Any) -> None:
        if path.name.startswith("sim02"):
            raise RebaError(f"{path}: cannot be written (No space left on device)")
        written(postures, path, **more)

    monkeypatch.setattr(simulate_module, "write_postures", full)
    with pytest.raises(RebaError):
        simulate({"a": plan}, tmp_path, participants=2, seed=1, rate=5.0)
    assert files(tmp_path) == before
