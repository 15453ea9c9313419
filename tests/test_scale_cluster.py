"""The same work on a real Dask scheduler and workers on loopback: equal to the local one, whoever dies."""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from scale_work import cluster, die_at, write_recordings

from reba.batch import Options, score_many, sees
from reba.cli import main
from reba.dataset import Dataset
from reba.dataset_run import score_into
from reba.errors import RebaError
from reba.fan_out import Lost, fan_out
from reba.manifest import MANIFEST

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module", autouse=True)
def _levels() -> Iterator[None]:
    """Give the loggers back the levels that a client takes away."""
    loggers = [logging.getLogger(name) for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = [logger.level for logger in loggers]
    yield
    for logger, level in zip(loggers, levels, strict=True):
        logger.setLevel(level)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with cluster(tmp_path_factory.mktemp("cluster")) as found:
        yield found


def table(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder).sort_values(["recording", "time"], ignore_index=True)


def test_the_command_gives_the_same_as_here(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_recordings(tmp_path / "in", 6)
    (tmp_path / "in" / "bad.csv").write_text("time,trunk_flexion\n0,abc\n")
    monkeypatch.chdir(tmp_path)  # workers are elsewhere
    results = []
    for out, words in (("here", []), ("there", ["--scheduler", address])):
        monkeypatch.setattr(sys, "argv", ["reba", "score", "in", "-o", out, "--json", *words])
        with pytest.raises(SystemExit) as stop:
            main()
        assert stop.value.code == 1
        results.append(json.loads(capsys.readouterr().out.replace(str(tmp_path / out), "OUT")))
    here, there = results
    assert here["recordings"] == there["recordings"]
    assert [failure["input"] for failure in there["failed"]] == ["in/bad.csv"]
    assert "'abc'" in there["failed"][0]["error"]
    pd.testing.assert_frame_equal(table(tmp_path / "here"), table(tmp_path / "there"))


def test_a_worker_killed_in_the_middle_changes_nothing(address: str, tmp_path: Path) -> None:
    inputs = write_recordings(tmp_path / "in", 24)
    with Dataset(tmp_path / "here") as dataset:
        score_into(dataset, inputs, Options())
    done: list[str] = []

    def kill_one(name: str) -> None:
        done.append(name)
        if len(done) == 3:
            with distributed.Client(address, set_as_default=False) as client:
                victim = min(client.run(os.getpid).values())
            os.kill(victim, signal.SIGKILL)

    with Dataset(tmp_path / "there") as dataset:
        run = score_into(dataset, inputs, Options(), scheduler=address, done=kill_one)
    assert (dict(run.scored), run.failed) == ({"new": 24}, 0)
    assert sorted(done) == inputs
    assert len((tmp_path / "there" / MANIFEST).read_text().splitlines()) == 24
    pd.testing.assert_frame_equal(table(tmp_path / "here"), table(tmp_path / "there"))


def test_a_task_that_kills_workers_is_lost_and_stops_no_other(address: str) -> None:
    found = dict(fan_out(partial(die_at, poison=2), range(6), scheduler=address))
    lost = found.pop(2)
    assert isinstance(lost, Lost)
    assert "workers died with it" in lost.reason
    assert found == {number: number * number for number in (0, 1, 3, 4, 5)}


def test_what_workers_lack_is_said_before_the_work(address: str, tmp_path: Path) -> None:
    with pytest.raises(RebaError, match=r"worker tcp://.* \(and 1 more workers\)"):
        list(fan_out(abs, [1], scheduler=address, probe=partial(sees, str(tmp_path / "nothing.mcap"))))
    (inside,) = write_recordings(tmp_path, 1)
    (outcome,) = score_many([inside], tmp_path / "one.csv", Options(), scheduler=address)
    assert outcome.error is None
    assert (tmp_path / "one.csv").is_file()


def test_a_worker_without_the_package_is_one_line(tmp_path: Path) -> None:
    with (
        cluster(tmp_path, workers=1, prelude="sys.modules['reba'] = None;") as address,
        pytest.raises(RebaError, match="cannot load dreba") as error,
    ):
        list(fan_out(abs, [1], scheduler=address))
    assert "\n" not in str(error.value)
