"""A dataset of scores: every recording scored once, and complete after every kind of interruption."""

from __future__ import annotations

import doctest
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.dataset as ds
import pytest

import reba
from reba.batch.dataset import Dataset, scoring_settings
from reba.batch.dataset_run import DatasetRun, score_into
from reba.batch.manifest import MANIFEST, content_hash
from reba.batch.run import ScoringOptions
from reba.errors import RebaError
from reba.file_stamp import stamp_of
from tests.support.paths import ROOT
from tests.support.says import says
from tests.support.scale_work import write_recordings

pytestmark = pytest.mark.slow


KILLED = 12
"""Times that a run is killed before it may end."""

DRIVER = """
import os, random, signal, sys, time
from pathlib import Path
from reba.batch.run import ScoringOptions, find_inputs
from reba.batch.dataset import Dataset
from reba.batch.dataset_run import score_into
folder, output, seed = sys.argv[1:]
inputs = find_inputs([folder])
ScoringOptions().read_and_score(inputs[0]).summary()  # imports everything before the first fork
rng = random.Random(int(seed))
manifest = Path(output, "_manifest.jsonl")
def lines():
    return manifest.read_bytes().count(b"\\n") if manifest.exists() else 0
for _ in range({killed}):
    goal = lines() + rng.randint(0, 4)
    child = os.fork()
    if child == 0:
        with Dataset(output) as dataset:
            score_into(dataset, inputs, ScoringOptions())
        os._exit(0)
    while lines() < min(goal, len(inputs)):
        time.sleep(0.001)
    time.sleep(rng.uniform(0.0, 0.05))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
"""


def run(folder: Path, inputs: list[str], **options: Any) -> DatasetRun:
    with Dataset(folder) as dataset:
        return score_into(dataset, inputs, ScoringOptions(**options))


def lines(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / MANIFEST).read_text().splitlines()]


def parts(folder: Path) -> dict[str, int]:
    return {str(path.relative_to(folder)): path.stat().st_mtime_ns for path in folder.rglob("*.parquet")}


def part(folder: Path, name: str) -> Path:
    return folder / f"recording={Path(name).stem}%2Eparquet" / "scores.parquet"


@pytest.fixture
def inputs(tmp_path: Path) -> list[str]:
    return write_recordings(tmp_path / "in", 4)


def test_pandas_and_pyarrow_read_it_as_one_table(inputs: list[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run(out, inputs).scored == {"new": 4}
    whole = pd.read_parquet(out)
    assert set(whole["recording"].unique()) == {Path(name).name for name in inputs}
    one = ds.dataset(out, partitioning="hive").to_table(filter=ds.field("recording") == "shift002.parquet").to_pandas()
    expected = reba.score(reba.read(inputs[2])).data
    pd.testing.assert_frame_equal(one[list(expected)], expected, check_dtype=False)


def test_the_manifest_says_what_became_of_each(inputs: list[str], tmp_path: Path) -> None:
    bad = tmp_path / "in" / "bad.csv"
    bad.write_text("time,trunk_flexion\n0,abc\n")
    run(tmp_path / "out", [*inputs, str(bad)])
    first, *_, last = lines(tmp_path / "out")
    assert first["input"] == str(Path(inputs[0]).resolve())
    stamp = stamp_of(inputs[0])
    assert (first["size"], first["modified"], first["changed"]) == (stamp.size, stamp.modified, stamp.changed)
    assert first["hash"] == content_hash(inputs[0])
    assert (first["version"], first["rules"], first["outcome"]) == (reba.__version__, "measured", "scored")
    assert first["options"]["missing"] == "range"
    assert (tmp_path / "out" / first["output"]).is_file()
    assert first["frames"] == first["summary"]["frames"] == 200
    assert first["seconds"] > 0
    assert (last["outcome"], last["output"]) == ("failed", None)
    assert "abc" in last["error"]


def test_nothing_is_scored_twice(inputs: list[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(out, inputs[:2])
    before = parts(out)
    again = run(out, inputs)
    assert (dict(again.scored), again.unchanged) == ({"new": 2}, 2)
    assert before.items() <= parts(out).items()
    third = run(out, [inputs[0], *inputs])
    assert (third.scored.total(), third.unchanged) == (0, 4)
    assert len(lines(out)) == 4


def test_what_changed_is_scored_again_with_the_reason(inputs: list[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(out, inputs)
    pd.read_parquet(inputs[0]).iloc[:100].to_parquet(inputs[0])
    os.utime(inputs[1], (1e9, 1e9))  # touched: the content is the same
    part(out, inputs[2]).unlink()
    again = run(out, inputs)
    assert dict(again.scored) == {"the file changed": 1, "its scores are gone": 1}
    assert again.unchanged == 2
    assert len(pd.read_parquet(out)) == 3 * 200 + 100
    assert run(out, inputs).scored.total() == 0
    assert dict(run(out, inputs, rules="paper").scored) == {"other rules": 4}
    assert dict(run(out, inputs, rules="paper", factors={"load": 12.0}).scored) == {"other options": 4}


def test_a_rules_file_counts_by_what_is_in_it(inputs: list[str], tmp_path: Path) -> None:
    file = tmp_path / "ours.toml"
    file.write_text('name = "ours"\nabduction = 45.0\n')
    before = scoring_settings(ScoringOptions(rules=str(file)))
    file.write_text('name = "ours"\nabduction = 50.0\n')
    assert scoring_settings(ScoringOptions(rules=str(file)))["rules_hash"] != before["rules_hash"]


def test_failures_leave_no_scores_and_are_tried_again(inputs: list[str], tmp_path: Path) -> None:
    out, broken = tmp_path / "out", Path(inputs[0])
    run(out, inputs)
    whole = broken.read_bytes()
    broken.write_bytes(whole[:1000])
    first = run(out, inputs)
    assert (dict(first.scored), first.failed) == ({"the file changed": 1}, 1)
    assert not part(out, inputs[0]).parent.exists()
    assert dict(run(out, inputs).scored) == {"failed before": 1}
    broken.write_bytes(whole)
    mended = run(out, inputs)
    assert (dict(mended.scored), mended.failed) == ({"failed before": 1}, 0)
    assert len(pd.read_parquet(out)) == 800


def test_files_of_one_name_get_different_partitions(tmp_path: Path) -> None:
    names = [*write_recordings(tmp_path / "line 1", 1), *write_recordings(tmp_path / "line 2", 1)]
    odd = tmp_path / "line 1" / "a=b, c%20#ü.parquet"
    Path(names[0]).rename(odd)
    out = tmp_path / "out"
    run(out, [*names[1:], *write_recordings(tmp_path / "line 3", 1), str(odd)])
    partitions = set(pd.read_parquet(out)["recording"].unique())
    assert {"shift000.parquet", odd.name} < partitions
    assert len(partitions) == 3
    assert run(out, [str(odd)]).unchanged == 1


def test_an_incomplete_last_line_is_removed_and_damage_is_an_error(inputs: list[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(out, inputs)
    manifest = out / MANIFEST
    whole = manifest.read_bytes()
    manifest.write_bytes(whole[:-30])
    again = run(out, inputs)
    assert (dict(again.scored), again.unchanged) == ({"new": 1}, 3)
    manifest.write_bytes(b"{}\n" + whole)
    with pytest.raises(RebaError) as error:
        run(out, inputs)
    says(error, MANIFEST, "line 1", "delete the line")


def test_one_command_at_a_time(inputs: list[str], tmp_path: Path) -> None:
    with Dataset(tmp_path / "out"), pytest.raises(RebaError) as error:
        Dataset(tmp_path / "out")
    says(error, tmp_path / "out", "another command", "wait")
    (tmp_path / "file").write_text("")
    with pytest.raises(RebaError) as error:
        Dataset(tmp_path / "file")
    says(error, tmp_path / "file", "cannot be written", "choose another folder")


def complete_and_once(folder: Path, inputs: list[str]) -> None:
    """Check that every recording has one manifest line and correct scores."""
    recorded = lines(folder)
    assert sorted(line["input"] for line in recorded) == sorted(str(Path(name).resolve()) for name in inputs)
    assert {line["outcome"] for line in recorded} == {"scored"}
    assert sorted(parts(folder)) == sorted(line["output"] for line in recorded)
    assert not list(folder.rglob("*.part"))
    for name in inputs:
        scores = pd.read_parquet(part(folder, name), partitioning=None)
        expected = reba.score(reba.read(name)).data
        pd.testing.assert_frame_equal(scores[list(expected)], expected, check_dtype=False)


def test_the_guide_prints_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    result = doctest.testfile(str(ROOT / "docs" / "scale.md"), module_relative=False)
    assert result.attempted >= 8
    assert result.failed == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_killed_at_any_point_it_goes_on_and_scores_nothing_twice(tmp_path: Path) -> None:
    inputs = write_recordings(tmp_path / "in", 40, frames=60)
    out = tmp_path / "out"
    code = DRIVER.format(killed=KILLED)
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "in"), str(out), "1"], check=True, timeout=120)
    # Recorded scores are not written again.
    before = {line["output"]: (out / line["output"]).stat().st_mtime_ns for line in lines(out)}
    assert before
    run(out, inputs)
    assert before.items() <= parts(out).items()
    complete_and_once(out, inputs)


def test_the_command_and_its_processes_killed_together_or_alone(tmp_path: Path) -> None:
    inputs = write_recordings(tmp_path / "in", 16)
    out = tmp_path / "out"
    code = "import sys; from reba.cli import main; sys.argv[0] = 'reba'; main()"
    command = [sys.executable, "-c", code, "score", str(tmp_path / "in"), "-o", f"{out}/", "--json", "--jobs", "2"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT)
    deadline = time.monotonic() + 120.0
    while not (out / MANIFEST).exists() or len(lines(out)) < 3:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    result = json.loads(done.stdout)
    assert result["failed"] == []
    assert [recording["input"] for recording in result["recordings"]] == inputs
    assert result["dataset"]["unchanged"] >= 3
    assert result["dataset"]["unchanged"] + result["dataset"]["scored"]["new"] == 16
    complete_and_once(out, inputs)


def test_another_measurement_error_is_another_option(inputs: list[str], tmp_path: Path) -> None:
    out, own = tmp_path / "out", tmp_path / "lab.toml"
    before = scoring_settings(ScoringOptions())["options"]
    assert "error" not in before, "manifests of former versions stay valid"
    run(out, inputs)
    assert dict(run(out, inputs, error="inertial").scored) == {"other options": 4}
    assert not run(out, inputs, error="inertial").scored
    own.write_text("trunk_flexion = 4\n", encoding="utf-8")
    first = scoring_settings(ScoringOptions(error=str(own)))["options"]["error"]
    own.write_text("trunk_flexion = 5\n", encoding="utf-8")
    assert scoring_settings(ScoringOptions(error=str(own)))["options"]["error"] != first
    assert first.startswith("lab ")
