"""Work for processes that the tests of fanning out start, and a cluster of real processes on this machine."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd

import reba
from reba.errors import RebaError
from tests.support.paths import ROOT


def square(number: int) -> int:
    """Return the square."""
    return number * number


def die_at(number: int, poison: int) -> int:
    """Return the square, but end the process at one number."""
    if number == poison:
        os._exit(1)
    time.sleep(0.01)
    return number * number


def square_slowly(number: int) -> int:
    """Return the square after a while, in which further workers can join."""
    time.sleep(0.2)
    return number * number


def refuse(number: int) -> int:
    """Refuse every number."""
    raise RebaError(f"{number}: expected another number")


def write_recordings(folder: Path, number: int, frames: int = 200) -> list[str]:
    """Write small posture tables that differ, and return their names."""
    folder.mkdir(parents=True, exist_ok=True)
    names = []
    for index in range(number):
        rng = np.random.default_rng(index)
        table = {"time": np.arange(frames) / 25.0}
        table |= {name: rng.normal(20.0, 15.0, frames).cumsum() % 60.0 for name in reba.COLUMNS}
        path = folder / f"shift{index:03d}.parquet"
        pd.DataFrame(table).to_parquet(path)
        names.append(str(path))
    return names


ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
"""Of scheduler and workers. A task is given up after two deaths: each takes seconds until the worker is there again."""
OTHER_VERSION = "import reba._version as installed; installed.__version__ = '0.0.9';"
"""Prelude of a worker whose installation has another version."""


def _dask(kind: str, prelude: str, words: Sequence[str], folder: Path) -> subprocess.Popen[bytes]:
    """Start a scheduler or worker that first runs `prelude`; its messages are added to a file in the folder."""
    program = f"import sys; {prelude} from distributed.cli.dask_{kind} import main; main()"
    with (folder / "cluster.log").open("a") as log:
        command = [sys.executable, "-c", program, "--no-dashboard", "--host", "127.0.0.1", *words]
        return subprocess.Popen(command, stdout=log, stderr=log, env=ENVIRONMENT, cwd=folder)


def _worker(folder: Path, prelude: str, *words: str) -> subprocess.Popen[bytes]:
    own = ["--nthreads", "1", "--local-directory", str(folder), "--no-nanny" if prelude else "--nanny"]
    return _dask("worker", prelude, [*words, *own], folder)


def _end(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        process.terminate()
    for process in processes:
        try:
            process.wait(timeout=20)
        except subprocess.TimeoutExpired:  # a worker of Dask may hang while it ends
            process.kill()
            process.wait()


@contextmanager
def joined(address: str, folder: Path, prelude: str) -> Iterator[str]:
    """Add a worker that first runs Python, `prelude`, to a cluster that runs already, and give its address."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        before = set(client.nthreads())
        process = _worker(folder, prelude, address)
        try:
            client.wait_for_workers(len(before) + 1, timeout=60)
            (own,) = set(client.nthreads()) - before
            yield own
        finally:
            _end([process])


@contextmanager
def cluster(folder: Path, workers: int = 2, prelude: str = "") -> Iterator[str]:
    """Run a Dask scheduler and workers in processes of their own, and give the address of the scheduler.

    Args:
        folder: for their files.
        workers: how many processes with one thread.
        prelude: Python that the workers run first.
    """
    from distributed import Client

    file = folder / "scheduler.json"
    words = ["--scheduler-file", str(file)]
    processes = [_dask("scheduler", "", [*words, "--port", "0"], folder)]
    try:
        processes += [_worker(folder, prelude, *words) for _ in range(workers)]
        deadline = time.monotonic() + 30.0
        while not (file.exists() and file.stat().st_size) and time.monotonic() < deadline:
            time.sleep(0.05)
        address = str(pd.read_json(file, typ="series")["address"])
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
        yield address
    finally:
        _end(processes[::-1])
