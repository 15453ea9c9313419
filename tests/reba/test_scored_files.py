"""Files of scores are read back: worksheets, improvements and comparisons without the recording."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import reba
from reba.batch.run import find_inputs
from reba.cli import cli
from tests.reba.readers.test_whole_recording import JOINTS, state, write
from tests.support.invoke import invoke
from tests.support.paths import DATASETS
from tests.support.says import says

ROS = "_ros.mcap"
SUFFIXES = (".parquet", ".csv", ".mcap", ROS)


def frames(n: int = 400) -> pd.DataFrame:
    """Movements that are repeated and held, a load and a grip that change, columns that are not measured."""
    time = np.arange(n) * 0.25
    rng = np.random.default_rng(3)
    frame = pd.DataFrame({"time": time, "trunk_flexion": np.round(35 + 30 * np.sin(time), 6), "neck_twist": 12.5})
    frame["lower_arm_flexion_left"] = np.where(rng.random(n) < 0.1, np.nan, 70.0)
    frame["load"] = np.where(time < 40, 2.5, 11.0)
    frame["coupling_right"] = np.where(time < 20, "good", "unacceptable")
    frame["support"] = np.where(time < 60, "bilateral", "sitting")
    return frame


@pytest.fixture(params=["frames", "mcap", "keypoints"])
def scores(request: pytest.FixtureRequest) -> reba.Scores:
    if request.param == "frames":
        return reba.score(frames(), rules=reba.PRESETS["paper"].replace(name="mine", abduction=20.0))
    source = {"mcap": "simulated_palletising.mcap", "keypoints": "balancing_keypoints.trc"}[request.param]
    return reba.score(reba.read(DATASETS / source), rules="paper", load=7.5, coupling="fair", arm_supported_left=True)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_written_is_read_back(scores: reba.Scores, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"scores{suffix}"
    reba.write_scores(scores, path, as_ros=suffix == ROS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = reba.read_scores(path)
    pd.testing.assert_frame_equal(again.data, scores.data)
    np.testing.assert_allclose(again.angles, scores.angles, rtol=0, atol=1e-9 if suffix == ".mcap" else 0)
    assert again.rules == scores.rules
    for name in reba.FACTORS:
        np.testing.assert_array_equal(getattr(again.factors, name), getattr(scores.factors, name))
    assert again.assumed == scores.assumed
    assert again.unmeasured == scores.unmeasured
    assert again.postures.profile == scores.postures.profile
    middle = float(scores.time[len(scores.time) // 2])
    assert again.explain(middle) == scores.explain(middle)
    assert again.improve(middle) == scores.improve(middle)
    one, other = again.summary(), scores.summary()
    assert {key: one[key] for key in one if key not in ("accounts", "warnings")} == {
        key: other[key] for key in other if key not in ("accounts", "warnings")
    }
    assert reba.compare(path, scores)["difference"]["reba"]["max"] in (0, None)
    assert reba.compare(str(path), path)["a"] == one


@pytest.mark.parametrize("fill", ["neutral", "worst"])
def test_the_fill_is_that_of_the_file(fill: Any, tmp_path: Path) -> None:
    scores = reba.score(frames(), missing=fill)
    reba.write_scores(scores, tmp_path / "scores.parquet")
    pd.testing.assert_frame_equal(reba.read_scores(tmp_path / "scores.parquet").data, scores.data)


def run(*words: object) -> Any:
    result = invoke(cli, list(map(str, words)))
    assert result.exit_code == 0, (result.output, result.exception)
    return json.loads(result.stdout)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_commands_take_files_of_scores(suffix: str, tmp_path: Path) -> None:
    source, path = DATASETS / "simulated_assembly.csv", tmp_path / f"scores{suffix}"
    given = ("--rules", "paper", "--load", "9", "--coupling", "poor")
    run("score", source, *given, "-o", path, "--json", *["--as-ros"] * (suffix == ROS))
    for command in (("explain", "--at", "8"), ("improve", "--at", "8")):
        name, *rest = command
        one, other = run(name, source, *rest, *given, "--json"), run(name, path, *rest, "--json")
        assert {**one, "input": ""} == {**other, "input": ""}
    compared = run("compare", source, path, *given, "--json")
    assert all(value in (0, None) for value in compared["difference"]["reba"].values())
    part = run("explain", path, "--at", "8", "--start", "7", "--end", "9", "--json")
    assert part == run("explain", path, "--at", "8", "--json")


def test_the_newest_scores_of_a_file_are_read(tmp_path: Path) -> None:
    """A file that is scored again has the former scores beside the new ones, of the same postures."""
    source = DATASETS / "simulated_palletising.mcap"
    for number, load in enumerate(("1", "5", "9"), 1):
        run("score", source, "--load", load, "-o", tmp_path / f"{number}.mcap", "--json")
        source = tmp_path / f"{number}.mcap"
    scores = reba.read_scores(source)
    assert scores.postures.topic == "/ergonomics/reba_3"
    says("; ".join(scores.postures.assumed), "scored 3 times", "/ergonomics/reba_3")
    compared = run("compare", DATASETS / "simulated_palletising.mcap", source, "--load", "9", "--json")
    assert all(value in (0, None) for value in compared["difference"]["reba"].values())


def test_scores_of_two_people_are_a_question(tmp_path: Path) -> None:
    """A file with scores of one person, scored for another one."""
    names = [[f"{person}_{joint}" for joint in JOINTS] for person in ("alice", "bob")]
    path = write(tmp_path / "two.mcap", [state(at, at, both) for at in range(200) for both in names])
    run("score", path, "--topic", "alice", "-o", tmp_path / "1.mcap", "--json")
    run("score", tmp_path / "1.mcap", "--topic", "bob", "-o", tmp_path / "2.mcap", "--json")
    with pytest.raises(reba.RebaError) as caught:
        reba.read(tmp_path / "2.mcap")
    says(caught, "/ergonomics/reba", "/ergonomics/reba_2", "--topic")


def test_other_rules_are_told(tmp_path: Path) -> None:
    path = tmp_path / "scores.parquet"
    reba.write_scores(reba.score(frames(), rules="paper"), path)
    with pytest.warns(UserWarning, match="recorded with rules 'paper', these are by 'measured'"):
        reba.score(reba.read(path), rules="measured")
    with pytest.warns(UserWarning, match="recorded with rules 'paper'"):
        run("explain", path, "--at", "8", "--rules", "measured", "--json")


def test_both_sides_are_compared_by_the_same_rules(tmp_path: Path) -> None:
    source, path = DATASETS / "simulated_assembly.csv", tmp_path / "scores.parquet"
    scores = reba.score(reba.read(source), rules="paper")
    reba.write_scores(scores, path)
    for pair in ((path, source), (source, path)):
        compared = run("compare", *pair, "--json")
        assert {compared[side]["rules"]["name"] for side in "ab"} == {"paper"}
        assert all(value in (0, None) for value in compared["difference"]["range"].values())
    with pytest.warns(UserWarning, match="different rules, 'paper' and 'measured'"):
        reba.compare(path, reba.score(reba.read(source)))


def changed(path: Path, change: Any) -> None:
    """Alter what a Parquet file says of its scores."""
    table = pq.read_table(path)
    about = json.loads(table.schema.metadata[b"reba"])
    change(about)
    pq.write_table(table.replace_schema_metadata({**table.schema.metadata, b"reba": json.dumps(about).encode()}), path)


def test_scores_that_differ_are_told(tmp_path: Path) -> None:
    path = tmp_path / "scores.parquet"
    reba.write_scores(reba.score(frames()), path)
    table = pd.read_parquet(path)
    meta = pq.read_schema(path).metadata
    table.loc[0, "trunk_flexion"] = 65.0
    pq.write_table(pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(meta), path)
    with pytest.warns(UserWarning, match="1 of 400 scores differ from those in the file"):
        reba.read_scores(path)


def test_rules_of_another_version_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "scores.parquet"
    reba.write_scores(reba.score(frames()), path)
    changed(path, lambda about: about["rules"].update(hover=3.0))
    with pytest.raises(reba.RulesError) as caught:
        reba.read_scores(path)
    says(caught, "scores.parquet", "rules that this version does not know", "hover", "name the rules")
    result = invoke(cli, ["explain", str(path), "--at", "3"])
    assert isinstance(result.exception, reba.RulesError)
    with pytest.warns(UserWarning, match="recorded with rules 'measured'"):
        run("explain", path, "--at", "3", "--rules", "measured", "--json")


@pytest.mark.parametrize("about", [None, "", "[1]", "{", '{"rules": 3, "assumed": 4, "quality": [], "epoch": "x"}'])
def test_a_csv_that_lost_what_stood_beside_it(about: str | None, tmp_path: Path) -> None:
    path = tmp_path / "scores.csv"
    scores = reba.score(frames(), load=8.0)
    reba.write_scores(scores, path)
    beside = tmp_path / "scores.csv.meta.json"
    beside.unlink()
    if about is not None:
        beside.write_text(about)
    with pytest.warns(UserWarning, match="does not say by which rules"):
        again = reba.read_scores(path)
    pd.testing.assert_frame_equal(again.data, scores.data)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_scores_without_angles_are_refused(suffix: str, tmp_path: Path) -> None:
    """As versions before wrote them."""
    data = reba.score(frames()).data
    path = tmp_path / f"old{suffix}"
    data.to_parquet(path, index=False) if suffix == ".parquet" else data.to_csv(path, index=False)
    for read in (reba.read, reba.read_scores):
        with pytest.raises(reba.ReadError) as caught:
            read(path)
        says(caught, f"old{suffix}", "scores without the angles", "reba score RECORDING -o FILE")


def test_other_tables_hold_no_scores(tmp_path: Path) -> None:
    with pytest.raises(reba.RebaError) as caught:
        reba.read_scores(DATASETS / "simulated_assembly.csv")
    says(caught, "simulated_assembly.csv", "holds no scores", "reba.read")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_postures_of_a_file_of_scores(suffix: str, tmp_path: Path) -> None:
    scores = reba.score(frames(), load=8.0)
    reba.write_scores(scores, tmp_path / f"scores{suffix}")
    run("convert", tmp_path / f"scores{suffix}", "-o", tmp_path / f"postures{suffix}", "--json")
    postures = reba.read(tmp_path / f"postures{suffix}")
    assert postures.scored is None
    assert "score_a" not in postures.data
    pd.testing.assert_frame_equal(reba.score(postures).data, scores.data)


def test_files_of_scores_are_no_recordings_of_a_folder(tmp_path: Path) -> None:
    shutil.copy(DATASETS / "simulated_assembly.csv", tmp_path / "assembly.csv")
    scores = reba.score(reba.read(tmp_path / "assembly.csv"))
    for suffix in (".csv", ".parquet"):
        reba.write_scores(scores, tmp_path / f"scores{suffix}")
    assert [Path(name).name for name in find_inputs([str(tmp_path)])] == ["assembly.csv"]


def test_the_plot_is_that_of_the_report() -> None:
    scores = reba.score(frames())
    figure = scores.plot()
    assert [button.label for button in figure.layout.updatemenus[0].buttons] == ["Total", "Left arm", "Right arm"]
    shown = [trace for trace in figure.data if trace.visible is not False and trace.meta == "reba"]
    assert {float(value) for trace in shown for value in trace.y if value == value} <= set(range(1, 16))
    assert figure.layout.yaxis.title.text == "REBA"
    for button in figure.layout.updatemenus[0].buttons:
        assert len(button.args[0]["visible"]) == len(figure.data)
    with pytest.raises(reba.PostureError, match="no frames"):
        reba.score(frames().iloc[:0]).plot()
