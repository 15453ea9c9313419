"""Work for processes that the tests of fanning out start, and a cluster of real processes on this machine."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
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
    log = (folder / "cluster.log").open("w")
    # A task is given up after two deaths: each takes seconds until the worker is there again.
    env = {**os.environ, "PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    common = ["--scheduler-file", str(file), "--no-dashboard"]
    start = "import sys; {} from distributed.cli.dask_{} import main; main()"

    def run(kind: str, first: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-c", start.format(first, kind), *common, *words]
        return subprocess.Popen(command, stdout=log, stderr=log, env=env, cwd=folder)

    processes = [run("scheduler", "", "--host", "127.0.0.1", "--port", "0")]
    try:
        for _ in range(workers):
            words = ["--nthreads", "1", "--host", "127.0.0.1", "--local-directory", str(folder)]
            processes.append(run("worker", prelude, *words, "--no-nanny" if prelude else "--nanny"))
        deadline = time.monotonic() + 30.0
        while not file.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        address = str(pd.read_json(file, typ="series")["address"])
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
        yield address
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait(timeout=20)
        log.close()
