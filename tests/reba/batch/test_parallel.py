"""Parallel tasks: complete results, bounded memory, one-line errors."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from reba.batch.dask_cluster import Cluster
from reba.batch.parallel import run_parallel
from reba.batch.run import access_problem
from reba.batch.worker_pool import TASKS_PER_WORKER, WorkerDied
from reba.errors import RebaError
from tests.support.paths import DATASETS, ROOT
from tests.support.says import says
from tests.support.scale_work import die_at, refuse, square

pytestmark = pytest.mark.slow


def test_in_this_process_by_default() -> None:
    assert list(run_parallel(square, range(5))) == [(number, number * number) for number in range(5)]
    with pytest.raises(RebaError) as error:
        list(run_parallel(refuse, range(5)))
    says(error, 0, "another number")


def test_every_task_comes_back_once_and_is_taken_in_a_window() -> None:
    taken = 0

    def tasks() -> Iterator[int]:
        nonlocal taken
        for number in range(60):
            taken += 1
            yield number

    results, ahead = {}, []
    for count, (task, result) in enumerate(run_parallel(square, tasks(), jobs=2)):
        time.sleep(0.002)
        results[task] = result
        ahead.append(taken - count)
    assert results == {number: number * number for number in range(60)}
    assert max(ahead) <= 2 * TASKS_PER_WORKER * 2


def test_a_task_that_kills_its_process_is_reported_and_stops_no_other() -> None:
    results = dict(run_parallel(partial(die_at, poison=3), range(12), jobs=2))
    lost = results.pop(3)
    assert isinstance(lost, WorkerDied)
    assert "died" in lost.reason
    assert results == {number: number * number for number in range(12) if number != 3}


def test_errors_of_the_work_are_raised() -> None:
    with pytest.raises(RebaError) as error:
        list(run_parallel(refuse, range(5), jobs=2))
    says(error, "another number")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", "", "127.0.0.1:99999", "ftp://x:1"])
def test_an_address_without_a_scheduler_is_one_line_in_seconds(address: str) -> None:
    with pytest.raises(RebaError) as error:
        Cluster(address, connect_seconds=0.5)
    says(error, address, "scheduler", "tcp://HOST:8786")


def test_a_server_that_is_no_scheduler_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 4)

        threading.Thread(target=answer, daemon=True).start()
        port = server.getsockname()[1]
        with pytest.raises(RebaError) as error:
            list(run_parallel(square, range(3), scheduler=f"tcp://127.0.0.1:{port}"))
    says(error, f"tcp://127.0.0.1:{port}", "scheduler")


def test_without_the_package_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RebaError) as error:
        list(run_parallel(square, range(3), scheduler="tcp://127.0.0.1:1"))
    says(error, "distributed", "pip install", "dreba[cluster]")


def test_what_a_worker_cannot_access_is_named(tmp_path: Path) -> None:
    here = tmp_path / "a.csv"
    here.write_text("time\n")
    mark = tmp_path / "mark"
    mark.write_text("this one")
    assert access_problem(str(here)) == ""
    assert "cannot read" in access_problem(str(tmp_path / "nothing.csv"))
    assert "cannot write" in access_problem(str(here), str(tmp_path / "nothing"))
    assert access_problem(str(here), str(tmp_path), str(mark), "this one") == ""
    assert "another folder" in access_problem(str(here), str(tmp_path), str(mark), "that one")


@pytest.mark.parametrize("module", ["numpy", "shutil", "tempfile", "joblib"])
def test_workers_import_nothing_of_the_current_folder(module: str, tmp_path: Path) -> None:
    (tmp_path / f"{module}.py").write_text("open('imported', 'w').close()")
    recordings = [tmp_path / name for name in ("a.csv", "b.csv")]
    for path in recordings:
        path.write_bytes((DATASETS / "simulated_assembly.csv").read_bytes())
    # As the installed command starts: its own folder, not the current one, stands first on the path.
    command = [sys.executable, "-P", "-c", "import reba.cli; reba.cli.main()", "score", *map(str, recordings)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*command, "--jobs", "2", "-o", "out"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "imported").exists()
