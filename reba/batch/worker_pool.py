"""Many independent pieces of work at once: in processes of this machine, or on the workers of a Dask cluster.

    tasks -> window of twice the workers -> results as they finish

Local processes are joblib's own (loky). On a cluster the same calls go through Dask's executor: joblib's Dask backend
waits for ever once a task takes its worker down with it (joblib 1.6.0, distributed 2026.8.0).
"""

from __future__ import annotations

import os
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Final, Protocol

WAITING: Final = 2
"""Tasks in the window for each worker: one that runs, and one so that it never waits for the next."""
ORPHANED: Final = 0.5
"""[s] How often a worker process looks whether the one that started it still lives."""
THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
"""What is set to 1 in worker processes: their number uses the cores, threads inside would only get in the way."""


@dataclass(frozen=True)
class WorkerDied:
    """Stands for the result of a task whose process died each time it was tried; `reason` ends a sentence."""

    reason: str


class Pool(Protocol):
    """Where tasks run."""

    def __enter__(self) -> Any: ...

    def __exit__(self, kind: object, /, *rest: object) -> None: ...

    def room(self) -> int:
        """Return how many tasks may be under way."""

    def submit(self, work: Callable[[Any], Any], task: Any) -> Future[Any]:
        """Start a task."""

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a finished task, `WorkerDied` if its process died; re-raise what the work raised.

        Raises:
            RebaError: the pool cannot go on.
        """

    def check(self) -> None:
        """Look whether results can still come.

        Raises:
            RebaError: none can.
        """


class Processes:
    """Processes of this machine; they end with the one that started them, however that ends."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._pool = self._start(jobs)

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, kind: object, /, *rest: object) -> None:
        self._pool.shutdown(wait=True, kill_workers=kind is not None)

    def room(self) -> int:
        """Return how many tasks may be under way."""
        return WAITING * self.jobs

    def submit(self, work: Callable[[Any], Any], task: Any) -> Future[Any]:
        """Start a task."""
        from concurrent.futures.process import BrokenProcessPool

        with warnings.catch_warnings():
            # A worker that holds much more memory than at first is replaced between two tasks.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)
            try:
                return self._pool.submit(work, task)
            except BrokenProcessPool:
                self._pool.shutdown(wait=True, kill_workers=True)
                self._pool = self._start(self.jobs)
                return self._pool.submit(work, task)

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a task that is done; one process that dies ends all tasks that are under way."""
        from concurrent.futures.process import BrokenProcessPool

        try:
            return future.result()
        except BrokenProcessPool:
            return WorkerDied("the process died (out of memory, or killed)")

    def check(self) -> None:
        """Do nothing: a process that dies ends its tasks."""

    @staticmethod
    def _start(jobs: int) -> Any:
        from joblib.externals.loky import ProcessPoolExecutor

        env = {name: "1" for name in THREADS if name not in os.environ}
        return ProcessPoolExecutor(jobs, initializer=_follow, initargs=(os.getpid(),), env=env)


def _follow(parent: int) -> None:
    """End this process soon after the one that started it, even if that was killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(ORPHANED)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
