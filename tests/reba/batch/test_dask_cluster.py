"""Tasks on a real Dask scheduler and workers on loopback: results equal to local ones, even if a worker dies."""

from __future__ import annotations

import importlib
import json
import logging
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import reba
from lgp.experiments import screwdriver
from lgp.experiments.runs import check_paths, check_runs
from lgp.experiments.variants import VARIANT, setting
from reba.batch import dask_cluster
from reba.batch.dataset import Dataset
from reba.batch.dataset_run import score_into
from reba.batch.manifest import MANIFEST
from reba.batch.parallel import run_parallel
from reba.batch.run import ScoringOptions, access_problem, score_many
from reba.batch.worker_pool import WorkerDied
from reba.errors import RebaError
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says
from tests.support.scale_work import OTHER_VERSION, cluster, die_at, joined, square_slowly, write_recordings

pytestmark = pytest.mark.slow


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
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with cluster(tmp_path_factory.mktemp("cluster")) as scheduler:
        yield scheduler


@pytest.fixture
def address(started: str) -> str:
    """Give the cluster with both workers: an earlier test may have killed one, which restarts within seconds."""
    with distributed.Client(started, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    return started


Run = Callable[..., tuple[int, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    def call(command: str, *words: object) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", [command, *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            importlib.import_module(f"{command}.cli").main()
        return int(stop.value.code or 0), capsys.readouterr().out

    return call


def table(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder).sort_values(["recording", "time"], ignore_index=True)


def kill_a_worker(address: str) -> None:
    with distributed.Client(address, set_as_default=False) as client:
        victim = min(client.run(os.getpid).values())
    os.kill(victim, signal.SIGKILL)


def timeless(result: Any) -> Any:
    """Return the JSON of a command without durations, which differ between runs."""
    if isinstance(result, dict):
        return {name: timeless(value) for name, value in result.items() if not name.startswith("seconds")}
    return [timeless(value) for value in result] if isinstance(result, list) else result


def test_the_command_gives_the_same_as_here(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    write_recordings(tmp_path / "in", 6)
    (tmp_path / "in" / "bad.csv").write_text("time,trunk_flexion\n0,abc\n")
    monkeypatch.chdir(tmp_path)  # workers are elsewhere
    results = []
    for out, words in (("here", []), ("there", ["--scheduler", address])):
        code, output = run("reba", "score", "in", "-o", out, "--json", *words)
        assert code == 1
        results.append(json.loads(output.replace(str(tmp_path / out), "OUT")))
    here, there = results
    assert here["recordings"] == there["recordings"]
    assert [failure["input"] for failure in there["failed"]] == ["in/bad.csv"]
    assert "'abc'" in there["failed"][0]["error"]
    pd.testing.assert_frame_equal(table(tmp_path / "here"), table(tmp_path / "there"))


def test_a_worker_killed_in_the_middle_changes_nothing(address: str, tmp_path: Path) -> None:
    inputs = write_recordings(tmp_path / "in", 24)
    with Dataset(tmp_path / "here") as dataset:
        score_into(dataset, inputs, ScoringOptions())
    done: list[str] = []

    def kill_one(name: str) -> None:
        done.append(name)
        if len(done) == 3:
            kill_a_worker(address)

    with Dataset(tmp_path / "there") as dataset:
        result = score_into(dataset, inputs, ScoringOptions(), scheduler=address, on_done=kill_one)
    assert (dict(result.scored), result.failed) == ({"new": 24}, 0)
    assert sorted(done) == inputs
    assert len((tmp_path / "there" / MANIFEST).read_text().splitlines()) == 24
    pd.testing.assert_frame_equal(table(tmp_path / "here"), table(tmp_path / "there"))


def test_models_are_compared_as_here(address: str, run: Run) -> None:
    words = ("compare", "quadratic", "convex", "-n", 300, "--tasks", 1, "--json")
    (here_code, here), (there_code, there) = run("dreba", *words), run("dreba", *words, "--scheduler", address)
    assert (here_code, there_code) == (0, 0)
    assert [row["model"] for row in json.loads(there)["models"]] == ["quadratic", "convex"]
    assert len(json.loads(there)["enabler"]["rows"]) == 24
    assert timeless(json.loads(here)) == timeless(json.loads(there))


RUNS = 3


def same_runs(here: list[pd.DataFrame], there: list[pd.DataFrame]) -> None:
    assert here[0].groupby("run").size().to_dict() == dict.fromkeys(range(RUNS), 3)
    for ours, theirs in zip(here, there, strict=True):
        for column in set(ours.columns) - {"seconds"}:
            pd.testing.assert_series_equal(ours[column], theirs[column], check_exact=True)


@pytest.fixture(scope="module")
def local_runs() -> list[pd.DataFrame]:
    """Plan the default variant, as the command does."""
    _, scene = setting(VARIANT, screwdriver.SCENE, None, None, None)
    return screwdriver_tables(screwdriver.plan_runs(range(RUNS), scene=scene, jobs=2))


def screwdriver_tables(planned: Iterable[tuple[pd.DataFrame, pd.DataFrame]]) -> list[pd.DataFrame]:
    """Return the two tables that an experiment writes of its runs."""
    runs, paths = (pd.concat(tables) for tables in zip(*planned, strict=True))
    return [check_runs(runs), check_paths(paths)]


@needs_robots
def test_an_experiment_is_the_same_as_here(
    address: str, local_runs: list[pd.DataFrame], run: Run, tmp_path: Path
) -> None:
    pytest.importorskip("statsmodels")
    words = ("experiment", "screwdriver", "--runs", RUNS, "-o", tmp_path, "--json", "--scheduler", address)
    code, output = run("lgp", *words)
    assert code == 0
    assert json.loads(output)["starts"]["rest"]["runs"] == RUNS
    same_runs(local_runs, [pd.read_parquet(tmp_path / f"{name}.parquet") for name in ("runs", "paths")])


@needs_robots
def test_an_experiment_is_the_same_with_a_worker_killed(address: str, local_runs: list[pd.DataFrame]) -> None:
    tables = []
    _, scene = setting(VARIANT, screwdriver.SCENE, None, None, None)
    for pair in screwdriver.plan_runs(range(RUNS), scene=scene, scheduler=address):
        if not tables:
            kill_a_worker(address)  # two unfinished runs, so both workers are busy
        tables.append(pair)
    same_runs(local_runs, screwdriver_tables(tables))


def test_a_task_that_kills_workers_is_lost_and_stops_no_other(address: str) -> None:
    results = dict(run_parallel(partial(die_at, poison=2), range(6), scheduler=address))
    lost = results.pop(2)
    assert isinstance(lost, WorkerDied)
    assert "workers died with it" in lost.reason
    assert results == {number: number * number for number in (0, 1, 3, 4, 5)}


def test_what_workers_lack_is_reported_before_the_first_task(address: str, tmp_path: Path) -> None:
    with pytest.raises(RebaError) as error:
        list(run_parallel(abs, [1], scheduler=address, probe=partial(access_problem, str(tmp_path / "absent.mcap"))))
    says(error, "worker tcp://", "cannot read", "absent.mcap", "1 more")
    (recording,) = write_recordings(tmp_path, 1)
    (result,) = score_many([recording], tmp_path / "one.csv", ScoringOptions(), scheduler=address)
    assert result.error is None
    assert (tmp_path / "one.csv").is_file()


def test_a_worker_without_the_package_is_one_line(tmp_path: Path) -> None:
    with (
        cluster(tmp_path, workers=1, prelude="sys.modules['reba'] = None;") as address,
        pytest.raises(RebaError) as error,
    ):
        list(run_parallel(abs, [1], scheduler=address))
    says(error, "worker tcp://", "cannot load dreba", "install")


def squares(address: str, number: int, events: dict[int, Callable[[], object]]) -> dict[int, int]:
    """Run tasks and return their results; an event is called when this many results have arrived."""
    results: dict[int, int] = {}
    for task, result in run_parallel(square_slowly, range(number), scheduler=address):
        results[task] = result
        events.get(len(results), lambda: None)()
    return results


def expected(number: int) -> dict[int, int]:
    return {task: task * task for task in range(number)}


def test_a_worker_of_another_version_that_joins_later_gets_no_work(address: str, tmp_path: Path) -> None:
    late: list[str] = []
    with ExitStack() as stack, pytest.warns(UserWarning, match="has dreba") as warned:
        results = squares(
            address, 40, {1: lambda: late.append(stack.enter_context(joined(address, tmp_path, OTHER_VERSION)))}
        )
    assert results == expected(40)
    (warning,) = warned
    says(str(warning.message), f"worker {late[0]}", "0.0.9", f"this is {reba.__version__}", "other workers")


def test_a_worker_without_the_package_that_joins_later_gets_no_work(address: str, tmp_path: Path) -> None:
    empty = "sys.modules['reba'] = None;"
    with ExitStack() as stack, pytest.warns(UserWarning, match="cannot load dreba"):
        results = squares(address, 40, {1: lambda: stack.enter_context(joined(address, tmp_path, empty))})
    assert results == expected(40)


def test_a_worker_without_the_shared_files_that_joins_later_gets_no_work(address: str, tmp_path: Path) -> None:
    inputs = write_recordings(tmp_path / "in", 24)
    done: list[str] = []
    with ExitStack() as stack:
        dataset = stack.enter_context(Dataset(tmp_path / "scores"))

        def join_once(name: str) -> None:
            done.append(name)
            if len(done) == 1:
                stack.enter_context(joined(address, tmp_path, "import os; os.access = lambda *_: False;"))

        with pytest.warns(UserWarning, match="cannot read"):
            result = score_into(dataset, inputs, ScoringOptions(), scheduler=address, on_done=join_once)
    assert (dict(result.scored), result.failed) == ({"new": 24}, 0)


def test_a_run_whose_only_worker_left_has_another_version_ends_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_cluster, "MAX_SECONDS_WITHOUT_WORKERS", 3.0)
    late: list[str] = []
    with cluster(tmp_path, workers=1) as address, ExitStack() as stack:

        def replace_worker() -> None:
            late.append(stack.enter_context(joined(address, tmp_path, OTHER_VERSION)))
            retire(address, late[0])

        stack.enter_context(pytest.warns(UserWarning, match="has dreba"))
        with pytest.raises(RebaError) as error:
            squares(address, 100, {1: replace_worker})
    says(error, f"worker {late[0]}", "0.0.9", f"this is {reba.__version__}", "install the same version")


def test_tasks_of_workers_that_are_gone_go_to_a_new_one(tmp_path: Path) -> None:
    late: list[str] = []
    with cluster(tmp_path, workers=1) as address, ExitStack() as stack:
        warned = stack.enter_context(pytest.warns(UserWarning, match="has dreba"))

        def replace_worker() -> None:
            assert len(warned) == 1  # so that unfinished tasks may run on the first worker alone
            retire(address, late[0])
            stack.enter_context(joined(address, tmp_path, ""))

        join = {1: lambda: late.append(stack.enter_context(joined(address, tmp_path, OTHER_VERSION)))}
        results = squares(address, 60, {**join, 20: replace_worker})
    assert results == expected(60)


def retire(address: str, remaining: str) -> None:
    """Retire every worker but one, as an administrator does."""
    with distributed.Client(address, set_as_default=False) as client:
        client.retire_workers([worker for worker in client.nthreads() if worker != remaining], close_workers=True)
