"""Worker pools: the protocol that every pool satisfies, and the pool of local processes (loky, the one of joblib)."""

from __future__ import annotations

import os
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Final, Protocol

from reba.import_path import SAFE_PATH, left_out_for_started
from reba.interrupts import held_back

TASKS_PER_WORKER: Final = 2
"""Submitted tasks per worker: one that runs and one in the queue, so that a worker never idles between two tasks."""
PARENT_POLL_SECONDS: Final = 0.5
"""[s] Between two checks of a worker process that the process that started it is alive."""
THREAD_VARIABLES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
"""Environment variables set to 1 in worker processes: one process per core leaves no core for more threads."""


@dataclass(frozen=True)
class WorkerDied:
    """Result of a task whose worker process died in every attempt; `reason` completes a sentence."""

    reason: str


@dataclass(frozen=True)
class NotRun:
    """Result of a task that no worker ran; it has to be submitted again."""


class Pool(Protocol):
    """Workers that run tasks."""

    def __enter__(self) -> Any: ...

    def __exit__(self, kind: object, /, *rest: object) -> None: ...

    def capacity(self) -> int:
        """Return the number of tasks that may be submitted and unfinished."""

    def submit(self, work: Callable[[Any], Any], task: Any) -> Future[Any]:
        """Submit a task."""

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a finished task; exceptions of the task are re-raised.

        `WorkerDied` if its process died, `NotRun` if it has to be submitted again.

        Raises:
            RebaError: the pool can run no further task.
        """

    def check(self) -> None:
        """Check that the pool can still deliver results.

        Raises:
            RebaError: all workers are lost.
        """


class Processes:
    """Local worker processes; they end with the process that started them, even if that is killed.

    Ctrl-C reaches every process of a terminal; workers take no notice, as this process ends them.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._pool = self._start(jobs)

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, kind: object, /, *rest: object) -> None:
        self._pool.shutdown(wait=True, kill_workers=kind is not None)

    def capacity(self) -> int:
        """Return the number of tasks that may be submitted and unfinished."""
        return TASKS_PER_WORKER * self.jobs

    def submit(self, work: Callable[[Any], Any], task: Any) -> Future[Any]:
        """Submit a task."""
        from concurrent.futures.process import BrokenProcessPool

        with warnings.catch_warnings(), held_back():  # the first task, and a task after a process died, start processes
            # loky replaces a worker whose memory has grown much; that is no reason to warn the user.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)
            try:
                return self._pool.submit(work, task)
            except BrokenProcessPool:
                self._pool.shutdown(wait=True, kill_workers=True)
                self._pool = self._start(self.jobs)
                return self._pool.submit(work, task)

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a finished task; one process that dies ends every unfinished task of the pool."""
        from concurrent.futures.process import BrokenProcessPool

        try:
            return future.result()
        except BrokenProcessPool:
            return WorkerDied("the process died (out of memory, or killed)")

    def check(self) -> None:
        """Pass: a process that dies ends its tasks, which `result` reports."""

    @staticmethod
    def _start(jobs: int) -> Any:
        from multiprocessing import resource_tracker

        from joblib.externals.loky import ProcessPoolExecutor
        from joblib.externals.loky.backend import resource_tracker as loky_tracker

        # Workers, and the processes that clean up after them, would import a numpy.py of the current folder.
        with left_out_for_started():
            for tracker in (resource_tracker, loky_tracker):  # started on demand, they let signals through again
                tracker.ensure_running()
        env = SAFE_PATH | {name: "1" for name in THREAD_VARIABLES if name not in os.environ}
        with held_back():  # a semaphore that is half made at an interrupt is complained of at the end
            return ProcessPoolExecutor(jobs, initializer=_exit_with_parent, initargs=(os.getpid(),), env=env)


def _exit_with_parent(parent: int) -> None:
    """End this process soon after its parent process, even if that was killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_POLL_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
