"""Runs that are killed: what is on disk can be read, and the run goes on from there in the same log."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
import reba
from lgp.execution.log import RunLog
from lgp.execution.log_reader import INTERRUPTED, interrupted_run, messages, read_logged_run
from lgp.execution.session import ExecutionRun, RunOptions
from tests.support.execution_plans import kinds, saved, small_plan, went
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = [pytest.mark.slow, needs_robots]
CODE = """
import sys
from lgp.cli import main
sys.argv = ["lgp", "run", sys.argv[1], "--speed", "0", "--no-page", "--fault", "killed@2"]
main()
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder whose run was killed while the robot carried the object."""
    folder = saved(tmp_path_factory.mktemp("killed"))
    done = subprocess.run([sys.executable, "-c", CODE, str(folder)], capture_output=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    return folder


@pytest.fixture
def folder(killed: Path, tmp_path: Path) -> Path:
    return shutil.copytree(killed, tmp_path / "plan")


def test_the_log_of_a_killed_run_is_readable_to_the_break(folder: Path) -> None:
    log = folder / "run.mcap"
    seen = [message for message in messages(log) if message.topic == "/human/joint_states"]
    assert len(seen) > 40
    table = reba.read(log)
    assert len(table.data) == len(seen)


def test_the_run_goes_on_where_it_was_killed(folder: Path) -> None:
    before = read_logged_run(folder / "run.mcap")
    assert before is not None
    assert not before.over
    summary, events = went(folder, resume=True)
    assert summary["state"] == "finished"
    assert summary["actions"] == list(small_plan().actions)
    assert kinds(events)[:3] == ["resumed", "retargeted", "started"]
    assert events[0].number == before.events[-1].number + 1
    # One file holds the whole run, in order, and nothing is left beside it.
    times = [message.stamp for message in messages(folder / "run.mcap") if message.topic == "/tf"]
    assert times == sorted(set(times))
    whole = [json.loads(one.data)["kind"] for one in messages(folder / "run.mcap") if one.topic == "/events"]
    assert whole == kinds([*before.events, *events])
    assert not list(folder.glob(f"*{INTERRUPTED}"))
    with pytest.raises(lgp.LgpError) as error:
        went(folder, resume=True)
    says(error, folder / "run.mcap", "ended", "without --resume")


def test_a_restart_that_is_killed_while_it_copies_loses_nothing(folder: Path) -> None:
    log = folder / "run.mcap"
    whole = log.read_bytes()
    log.rename(log.with_name(log.name + INTERRUPTED))
    log.write_bytes(whole[: len(whole) // 3])
    summary, _ = went(folder, resume=True)
    assert summary["state"] == "finished"
    assert summary["actions"] == list(small_plan().actions)


def test_a_run_begun_anew_is_not_taken_for_an_older_one(folder: Path) -> None:
    log = folder / "run.mcap"
    whole = log.read_bytes()
    log.rename(log.with_name(log.name + INTERRUPTED))
    log.write_bytes(whole[: len(whole) // 3])
    fresh = ExecutionRun(folder, RunOptions(speed=0.0, compare=False))
    fresh.start()
    fresh.close()
    with pytest.raises(lgp.LgpError) as error:  # it ended before its first checkpoint
        interrupted_run(log)
    says(error, log, "no log of an interrupted run", "without --resume")
    assert sorted(len(path.read_bytes()) for path in folder.glob("run-*.mcap")) == [len(whole) // 3, len(whole)]


def test_a_log_cut_in_the_middle_can_be_gone_on_from(folder: Path) -> None:
    log = folder / "run.mcap"
    data = log.read_bytes()
    log.write_bytes(data[: len(data) // 2])
    summary, _ = went(folder, resume=True)
    assert summary["state"] == "finished"


def test_a_log_of_another_version_is_not_continued(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = (folder / "run.mcap").read_bytes()
    monkeypatch.setattr("reba.provenance.__version__", "9.9.9")
    with pytest.raises(lgp.LgpError) as error:
        went(folder, resume=True)
    says(error, folder / "run.mcap", f"dreba {reba.__version__}", "dreba 9.9.9", "without --resume")
    assert (folder / "run.mcap").read_bytes() == before


def rewrite_state(log: Path, **changes: Any) -> None:
    """Change members of every checkpoint of a log."""
    kept = list(messages(log))
    with RunLog(log, 0.0, {}) as new:
        for one in kept:
            data = json.dumps({**json.loads(one.data), **changes}).encode() if one.topic == "/state" else one.data
            new.copy(one.topic, one.encoding, one.schema, one.stamp, data)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"q": [0.0]}, ["q has 1 numbers"]),
        ({"number": 7}, ["action 8", "3"]),
        ({"closed": ["baxter.tail"]}, ["baxter.tail", "hand"]),
        ({"things": {"spoon": {"hand": "", "rotation": np.eye(3).tolist(), "position": [0, 0, 0]}}}, ["objects"]),
        ({"things": {}}, ["--replay", "the same way"]),
        ({"folder": "replans/1"}, ["replans/1"]),
    ],
)
def test_a_checkpoint_of_another_scene(folder: Path, changes: dict[str, Any], words: list[str]) -> None:
    rewrite_state(folder / "run.mcap", **changes)
    before = (folder / "run.mcap").read_bytes()
    with pytest.raises(lgp.LgpError) as error:
        went(folder, resume=True)
    says(error, str(folder), *words)
    assert (folder / "run.mcap").read_bytes() == before


def test_the_run_of_another_plan_is_not_continued(folder: Path) -> None:
    """The plan may have been made again meanwhile: the actions of the run would be taken for those of the new one."""
    plan = lgp.Plan.load(folder)
    replace(plan, path=plan.path + 1e-9).save(folder)
    before = (folder / "run.mcap").read_bytes()
    with pytest.raises(lgp.LgpError) as error:
        went(folder, resume=True)
    says(error, folder / "run.mcap", "another plan", "without --resume")
    assert (folder / "run.mcap").read_bytes() == before


def test_there_must_be_something_to_go_on_from(tmp_path: Path) -> None:
    folder = saved(tmp_path)
    with pytest.raises(lgp.LgpError) as error:
        went(folder, resume=True)
    says(error, folder / "run.mcap", "no log", "without --resume")
    (folder / "run.mcap").write_bytes(b"no log")
    with pytest.raises(reba.errors.RebaError) as unreadable:
        went(folder, resume=True)
    says(unreadable, "run.mcap", "MCAP")
