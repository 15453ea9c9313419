"""The `dreba` command as a user runs it: output, JSON, exit codes, one-line errors."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import dreba
import reba
from dreba.cli import cli, main
from reba.posture.columns import COLUMNS
from tests.support.says import says

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dreba", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            main()
        captured = capsys.readouterr()
        return int(stop.value.code or 0), captured.out, captured.err

    return call


@pytest.fixture
def model(tmp_path: Path) -> Path:
    poses = dreba.sample(500, rng=1)
    path = tmp_path / "model.json"
    dreba.QuadraticModel().fit(poses.angles, poses.reba).save(path)
    return path


@pytest.mark.parametrize("command", sorted(cli.commands))
def test_every_command_has_help_with_an_example(run: Run, command: str) -> None:
    code, out, _ = run(command, "--help")
    assert code == 0
    assert f"Example: dreba {command}" in " ".join(out.split())


def test_sample_fit_evaluate(run: Run, tmp_path: Path) -> None:
    poses, made, report = tmp_path / "poses.parquet", tmp_path / "model.json", tmp_path / "model.html"
    code, out, err = run("sample", "-n", 1200, "--classes", "1:8", "--seed", 3, "-o", poses, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["classes"] == {str(score): 150 for score in range(1, 9)}
    code, out, err = run("fit", "--poses", poses, "-o", made, "--report", report, "--option", "free=true")
    assert code == 0
    assert "RMSE of Table I" in out
    assert str(made) in err
    assert report.stat().st_size > 1_000_000
    assert dreba.load(made).free is True
    code, out, err = run("evaluate", made, "--poses", poses, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["kind"] == "quadratic"
    assert found["classes"]["1"].keys() == {"n", "rmse", "bias"}
    assert found["classes"]["1"]["n"] == 150
    assert found["overall"]["n"] == 1200
    assert {"rmse", "spearman", "rounded_accuracy"} <= found["overall"].keys()


def test_fit_draws_poses_and_keeps_others_for_the_error(run: Run, tmp_path: Path) -> None:
    made = tmp_path / "model.json"
    code, out, _ = run("fit", "--domain", "paper", "-n", 1000, "--seed", 5, "-o", made, "--json")
    assert code == 0
    assert json.loads(out)["overall"]["n"] == 1000
    about = dreba.load(made).about_
    assert about.domain["name"] == "paper"
    assert about.provenance["train"]["seed"] == 5
    assert about.provenance["held_out"]["seed"] == [5, 1]
    assert about.provenance["command"].startswith("dreba fit --domain paper")
    code, out, _ = run("evaluate", made, "--json")
    assert code == 0


def test_fit_as_the_paper_comes_near_table_1(run: Run, tmp_path: Path) -> None:
    made = tmp_path / "paper.json"
    code, out, _ = run("fit", "--as", "paper", "--seed", 1, "-o", made)
    assert code == 0
    words = " ".join(out.split())
    assert 'setting: quadratic, domain paper, class_power=1, payload="linear", payload_only=true' in words
    assert float(words.split("difference to Table I ")[1].split()[0]) <= 0.20
    assert dreba.load(made).factors_ == ("load",)
    code, out, _ = run("evaluate", made, "--seed", 4, "--json")
    assert json.loads(out)["factors"] == ["load"]
    assert "class_power=1" in json.loads(out)["setting"]


@pytest.mark.parametrize("poses", ["drawn", "file without factors", "recording"])
def test_every_fit_knows_load_coupling_and_activity(run: Run, tmp_path: Path, poses: str) -> None:
    drawn = dreba.sample(1500, rng=3)
    drawn.save(tmp_path / "poses.parquet")
    pd.DataFrame(drawn.angles, columns=list(COLUMNS)).assign(time=np.arange(1500)).to_csv(tmp_path / "shift.csv")
    given = {"drawn": ("-n", 1500), "recording": ("--poses", tmp_path / "shift.csv")}
    words = given.get(poses, ("--poses", tmp_path / "poses.parquet"))
    for kind in ("quadratic", "convex"):
        code, out, _ = run("fit", "--kind", kind, *words, "-o", tmp_path / "m.json", "--json")
        assert code == 0
        assert json.loads(out)["factors"] == ["load", "coupling", "activity"]
        model = dreba.load(tmp_path / "m.json")
        heavy = {"load": 15.0, "coupling": "unacceptable"}
        exact = (reba.score_array(drawn.angles, heavy).reba.astype(float) - drawn.reba).mean()
        rise = (model.value(drawn.angles, **heavy) - model.value(drawn.angles)).mean()
        assert rise == pytest.approx(exact, abs=0.5)


def test_radians_in_a_recording_are_warned_about_once(run: Run, tmp_path: Path) -> None:
    drawn = dreba.sample(600, rng=3)
    table = pd.DataFrame(np.radians(drawn.angles), columns=list(COLUMNS)).assign(time=np.arange(600) / 10)
    table.to_csv(tmp_path / "shift.csv", index=False)
    for words in (("fit", "-o", tmp_path / "m.json"), ("evaluate", tmp_path / "m.json")):
        code, _, err = run(*words, "--poses", tmp_path / "shift.csv", "--json")
        assert code == 0
        assert err.count("look like radians") == 1


def test_a_seated_recording_can_be_fitted(run: Run, tmp_path: Path) -> None:
    drawn = dreba.sample(1500, range(1, 10), rng=3)
    table = pd.DataFrame(drawn.angles, columns=list(COLUMNS)).assign(time=np.arange(1500) / 10)
    table.assign(support="sitting", unstable=True).to_csv(tmp_path / "seated.csv", index=False)
    code, _, err = run("fit", "--poses", tmp_path / "seated.csv", "-o", tmp_path / "m.json", "--json")
    *notes, written = err.splitlines()
    assert (code, written) == (0, f"written: {tmp_path / 'm.json'}")
    assert all(note.startswith("note: ") for note in notes)
    code, out, _ = run("evaluate", tmp_path / "m.json", "--poses", tmp_path / "seated.csv", "--json")
    assert code == 0
    assert json.loads(out)["overall"]["rmse"] < 2.0


def test_fit_on_a_recording_weighs_classes_evenly(run: Run, tmp_path: Path) -> None:
    poses = dreba.sample(2000, [1, 2, 9], rng=1)
    uneven = poses.rows(np.flatnonzero((poses.reba != 1) | (np.arange(2000) % 10 == 0)))
    data = pd.DataFrame(uneven.angles, columns=list(COLUMNS))
    data.insert(0, "time", np.arange(len(data)) * 0.1)
    data.to_csv(tmp_path / "shift.csv", index=False)
    code, out, _ = run("fit", "--poses", tmp_path / "shift.csv", "-o", tmp_path / "m.json", "--json")
    assert code == 0
    errors = json.loads(out)["classes"]
    plain = dreba.QuadraticModel().fit(uneven.angles, uneven.reba)
    assert errors["1"]["bias"] < dreba.evaluate(plain, uneven).classes[1].bias - 0.1


@pytest.mark.slow
def test_compare_and_export(run: Run, model: Path, tmp_path: Path) -> None:
    code, out, err = run("compare", model, "-n", 500, "--tasks", 0, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["published"]["8"] == 2.18
    assert found["models"][0]["seconds_per_pose"].keys() == {"single", "batch"}
    for tasks, advised in ((1, False), (2, True)):  # one task has no standard error
        code, out, _ = run("compare", model, "-n", 500, "--tasks", tasks)
        assert code == 0
        words = " ".join(out.split())
        assert "published Table I" in words
        assert "true REBA reached" in words
        assert ("recommended here: " in words) == advised
    code, out, _ = run("compare", model, "-n", 500, "--tasks", "bench:2", "--json")
    assert code == 0
    enabler = json.loads(out)["enabler"]
    keys = {"name", "start", "solver", "reba", "standard_error", "evaluations", "certified"}
    assert all(keys <= row.keys() and row["solver"] == enabler["solver"] for row in enabler["rows"])
    assert any("distance" in row["name"] for row in enabler["rows"])
    for wrong in ("narrow", "wide:81", "bench:", "-1", "81", "1e1"):
        code, _, err = run("compare", model, "--tasks", wrong)
        assert code == 2
        says(err, wrong, "wide", "bench", 80)
    code, _, _ = run("export", model, "--to", "c", "-o", tmp_path / "reba.c")
    assert code == 0
    assert "double" in (tmp_path / "reba.c").read_text()


@pytest.mark.parametrize(
    ("words", "fact"),
    [
        (["sample", "-n", 100, "--classes", "12:13", "-o", "x.parquet"], "class 12 cannot be reached"),
        (["sample", "--classes", "", "-o", "x.parquet"], "FIRST:LAST"),
        (["sample", "--classes", "low", "-o", "x.parquet"], "FIRST:LAST"),
        (["sample", "-o", "x.csv"], ".parquet"),
        (["sample", "-n", 10**13, "-o", "x.parquet"], "1<=x<=20000000"),
        (["sample", "--classes", "1:99999999999", "-o", "x.parquet"], "class 16 is not a REBA score"),
        (["fit", "--kind", "net", "--option", "epochs=abc", "-n", 300, "-o", "x.json"], "epochs is 'abc'"),
        (["fit", "--option", "domain=5", "-n", 300, "-o", "x.json"], "domain is 5"),
        (["fit", "-n", 300, "-o", "x.json", "--report", "./x.json"], "already"),
        (["sample", "--domain", "humn", "-o", "x.parquet"], "did you mean 'human'"),
        (["sample", "--factors", "lode", "-o", "x.parquet"], "load, coupling, activity"),
        (["fit", "--kind", "quadratc", "-o", "x.json"], "did you mean 'quadratic'"),
        (["fit", "--option", "fre=true", "-o", "x.json"], "did you mean 'free'"),
        (["fit", "--option", "payload=cubic", "-n", "100", "-o", "x.json"], "tree, linear"),
        (["fit", "--poses", "nothere.parquet", "-o", "x.json"], "nothere.parquet"),
        (["fit"], "Missing option"),
        (["evaluate", "nothere.json"], "cannot be read as a model"),
        (["export", "quadratic", "--to", "rust"], "rust"),
        (["export", "quadratic", "--to", "c", "--first"], "no first stage"),
        (["export", "quadratic", "--to", "c", "--temperature", 2], "no temperature"),
        (["evaluate", "quadratic", "--temperature", 2], "no temperature"),
        (["evaluate", "soft", "--temperature", 3, "-n", 300], "16, 8, 4, 2, 1"),
        (["evaluate", "quadratic", "--hold", "neutral"], "--poses"),
        (["evaluate", "quadratic", "--poses", "x.csv", "-n", 9], "-n is an option of drawn poses"),
        (["fit", "--poses", "x.csv", "--no-adjustments", "-o", "x.json"], "--adjustments is an option of drawn poses"),
        (["fit", "--poses", "x.csv", "--domain", "humn", "-o", "x.json"], "did you mean 'human'"),
        (["fit", "--joints", "measured", "-o", "x.json"], "--poses"),
        (["fit", "--as", "paper", "--domain", "human", "-o", "x.json"], "--domain paper"),
        (["fit", "--as", "paper", "--kind", "soft", "-o", "x.json"], "--kind quadratic"),
        (["fit", "--as", "paper", "--option", "class_power=2", "-o", "x.json"], "class_power=2"),
        (["fit", "--joints", "trunk", "-o", "x.json"], "column 'trunk' is unknown"),
        (["fit", "--joints", "trunk_flexion", "--hold", "wrist_twist", "-o", "x.json"], "COLUMN=DEGREES"),
        (["fit", "--joints", "trunk_flexion", "--hold", "neutral,neck_twist=3", "-o", "x.json"], "alone"),
        (["fit", "--option", "joints=[]", "-n", 300, "-o", "x.json"], "--joints"),
        (["compare", "quadratic", "nothere"], "nothere"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[object], fact: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*words)
    assert code == 2
    assert out == ""
    says(err, fact)
    assert err.startswith("dreba: ")
    assert list(tmp_path.iterdir()) == []


def test_too_few_poses_and_a_newer_model_are_refused(run: Run, model: Path, tmp_path: Path) -> None:
    dreba.sample(50, rng=1).save(tmp_path / "few.parquet")
    code, _, err = run("fit", "--poses", tmp_path / "few.parquet", "-o", tmp_path / "x.json")
    assert code == 2
    says(err, "50 poses", "200 or more")
    data = json.loads(model.read_text())
    model.write_text(json.dumps({**data, "version": 99}))
    code, _, err = run("evaluate", model)
    assert code == 2
    says(err, "version 99", "update dreba")


def test_inputs_are_never_written_over(run: Run, model: Path, tmp_path: Path) -> None:
    poses = tmp_path / "poses.parquet"
    dreba.sample(500, rng=1).save(poses)
    before = model.read_bytes(), poses.read_bytes()
    for words in (
        ["fit", "--poses", poses, "-o", poses],
        ["export", model, "--to", "c", "-o", model],
        ["evaluate", model, "--report", model],
        ["evaluate", model, "--poses", poses, "--report", poses],
    ):
        code, _, err = run(*words)
        assert code == 2
        says(err, words[-1], "input", "choose another name")
    assert (model.read_bytes(), poses.read_bytes()) == before


def test_a_model_is_evaluated_in_the_domain_it_was_fitted_in(run: Run, tmp_path: Path) -> None:
    domain, made = tmp_path / "mine.toml", tmp_path / "mine.json"
    domain.write_text(
        'name = "mine"\n[limits]\ntrunk_flexion = [0, 90]\nneck_flexion = [-20, 40]\nknee_flexion = [0, 90]\n'
        "upper_arm_flexion = [-30, 120]\nlower_arm_flexion = [0, 140]\n"
    )
    assert run("fit", "--domain", domain, "--classes", "1:5", "-n", 1000, "-o", made)[0] == 0
    code, out, _ = run("evaluate", made, "--classes", "1:5", "-n", 1000, "--json")
    assert code == 0
    own = json.loads(out)["overall"]["rmse"]
    _, out, _ = run("evaluate", made, "--classes", "1:5", "-n", 1000, "--domain", domain, "--json")
    assert json.loads(out)["overall"]["rmse"] == own


def test_a_recording_that_lacks_angles_is_fitted_over_those_it_has(run: Run, tmp_path: Path) -> None:
    poses = dreba.sample(800, rng=1)
    data = pd.DataFrame(poses.angles, columns=list(COLUMNS)).filter(regex="^(?!wrist|shoulder)")
    data.insert(0, "time", np.arange(len(data)) * 0.1)
    table, made = tmp_path / "shift.csv", tmp_path / "m.json"
    data.to_csv(table, index=False)
    code, _, err = run("fit", "--poses", table, "-o", made)
    assert code == 2
    assert "wrist_flexion_left" in err
    assert "--" not in err.split(";")[0]
    report = tmp_path / "m.html"
    assert run("fit", "--poses", table, "--joints", "measured", "-o", made, "--report", report)[0] == 0
    found = dreba.load(made)
    assert len(found.joints_) == 14
    assert found.about_.provenance["train"]["held"]["wrist_flexion_left"] == 0.0
    code, out, err = run("evaluate", made, "--poses", table, "--json")
    assert code == 0
    assert all(line.startswith("note: ") for line in err.splitlines())
    assert json.loads(out)["overall"]["n"] == 800
    assert run("evaluate", made, "-n", 300)[0] == 0  # from the range of its angles
    code, _, err = run("evaluate", "quadratic", "--poses", table)
    assert code == 2
    assert run("evaluate", "quadratic", "--poses", table, "--hold", "neutral")[0] == 0
    assert run("fit", "--poses", table, "--hold", "wrist_flexion=0,wrist_deviation=0", "-o", made)[0] == 2
    assert run("fit", "--poses", table, "--hold", "neutral", "--kind", "convex", "-o", made)[0] == 0
    assert dreba.load(made).joints_ == COLUMNS


def test_drawn_poses_move_the_joints_only(run: Run, tmp_path: Path) -> None:
    made = tmp_path / "m.json"
    words = ["--joints", "trunk_flexion,knee_flexion", "--hold", "neck_flexion=40,wrist_twist_left=5,wrist_twist=1"]
    words += ["--classes", "2,3", "-n", 400]
    assert run("fit", *words, "-o", made)[0] == 0
    found = dreba.load(made)
    assert found.joints_ == ("trunk_flexion", "knee_flexion_left", "knee_flexion_right")
    assert found.about_.domain["limits"]["neck_flexion"] == [40.0, 40.0]
    assert found.about_.domain["limits"]["wrist_twist_left"] == [5.0, 5.0]
    _, out, _ = run("evaluate", made, "-n", 300, "--json")
    assert set(json.loads(out)["classes"]) == {"2", "3"}


def test_models_of_several_domains_are_evaluated_in_one_and_named(run: Run) -> None:
    code, out, err = run("compare", "quadratic", "quadratic_paper", "-n", 300, "--tasks", 0, "--json")
    assert code == 0
    says(err, "dreba: note", "domain human", "quadratic_paper (paper)", "--domain")
    assert json.loads(out)["domain"] == "human"
    code, out, err = run("compare", "quadratic_paper", "-n", 300, "--tasks", 0, "--json")
    assert (json.loads(out)["domain"], err) == ("paper", "")


def test_a_domain_with_bins_of_its_own_is_kept_in_the_model(run: Run, tmp_path: Path) -> None:
    domain, made = tmp_path / "mine.toml", tmp_path / "mine.json"
    domain.write_text(
        'name = "mine"\n[bins]\ntrunk_flexion = { edges = [0, 10, 90], points = [1, 4] }\n'
        "knee_flexion = { edges = [0, 20, 90], points = [0, 2] }\n"
    )
    assert run("fit", "--domain", domain, "--classes", "1,2,6", "-n", 600, "-o", made)[0] == 0
    domain.unlink()
    code, out, err = run("evaluate", made, "-n", 600, "--json")
    assert (code, err) == (0, "")
    assert set(json.loads(out)["classes"]) == {"1", "2", "6"}
    assert run("compare", made, "-n", 300, "--tasks", 0)[0] == 0


@pytest.mark.filterwarnings("default::dreba.RadiansWarning")
def test_radians_are_warned_about_in_one_line(run: Run, tmp_path: Path) -> None:
    poses = dreba.sample(500, rng=1)
    small = dreba.Poses(np.radians(poses.angles), poses.reba, None, poses.provenance)
    small.save(tmp_path / "radians.parquet")
    code, _, err = run("fit", "--poses", tmp_path / "radians.parquet", "-o", tmp_path / "m.json", "--json")
    assert code == 0
    assert err.count("dreba: warning: nearly every angle lies within +-3.2") == 1


def test_no_command_leaves_part_files(run: Run, model: Path, tmp_path: Path) -> None:
    run("evaluate", model, "-n", 500, "--report", tmp_path / "report.html")
    assert {path.name for path in tmp_path.iterdir()} == {"model.json", "report.html"}
