"""Worker pool on an existing Dask cluster.

A worker runs one task at a time, however many threads it has: tasks share state inside a process.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from typing import Any, Final

from reba._version import __version__
from reba.batch.worker_pool import TASKS_PER_WORKER, WorkerDied
from reba.errors import RebaError
from reba.extras import missing

CONNECT_SECONDS: Final = 5.0
"""[s] Within which a scheduler must answer."""
PROBE_SECONDS: Final = 30.0
"""[s] Within which every worker must answer the probe; the first call on a worker imports the package."""
MAX_SECONDS_WITHOUT_WORKERS: Final = 30.0
"""[s] After which a cluster without workers counts as lost; a worker restarts within seconds."""
WORKER_COUNT_SECONDS: Final = 5.0
"""[s] Between two queries of the number of workers."""
INSTALL_HINT: Final = "install the same version of dreba on scheduler, workers and this machine"
_task_lock = threading.Lock()


class Cluster:
    """An existing Dask cluster.

    Args:
        address: of its scheduler.
        probe: see `reba.batch.parallel.run_parallel`.
        connect_seconds: [s] within which the scheduler must answer.

    Raises:
        RebaError: distributed is not installed, or the scheduler or its workers cannot be used.
    """

    def __init__(
        self, address: str, probe: Callable[[], str] | None = None, *, connect_seconds: float = CONNECT_SECONDS
    ) -> None:
        self.address = address
        self._client = _connect(address, connect_seconds)
        self._workers, self._counted_at, self._last_with_workers = 0, 0.0, time.monotonic()
        try:
            self._await_workers()
            self._probe(probe)
        except BaseException:
            self._close()
            raise
        self._call = _remote_call()
        self._executor = self._client.get_executor(pure=False)

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, kind: object, /, *rest: object) -> None:
        with contextlib.suppress(OSError, TimeoutError, CancelledError):
            self._executor.shutdown(wait=kind is None)
        self._close()

    def capacity(self) -> int:
        """Return the number of tasks that may be submitted and unfinished; the number of workers may change."""
        if time.monotonic() - self._counted_at > WORKER_COUNT_SECONDS:
            self._count()
        return TASKS_PER_WORKER * max(self._workers, 1)

    def submit(self, work: Callable[[Any], Any], task: Any) -> Future[Any]:
        """Submit a task."""
        import cloudpickle

        future: Future[Any] = self._executor.submit(self._call, cloudpickle.dumps((work, task)))
        return future

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a finished task; the scheduler repeats a task on other workers if one died.

        Raises:
            RebaError: the scheduler is lost, or a worker cannot load the task.
        """
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        try:
            return future.result()
        except KilledWorker as error:
            return WorkerDied(f"{error.allowed_failures + 1} workers died with it (out of memory, or killed)")
        except (CancelledError, FutureCancelledError) as error:
            raise RebaError(
                f"{self.address}: the scheduler was lost; finished results are saved, run the same command again"
            ) from error
        except Exception as error:
            if type(error) is Exception:  # distributed's type for a task that could not be unpickled on a worker
                raise RebaError(f"{self.address}: a worker cannot load its task ({error}); {INSTALL_HINT}") from error
            raise

    def check(self) -> None:
        """Check that the cluster had workers within the last `MAX_SECONDS_WITHOUT_WORKERS`."""
        self._count()
        if time.monotonic() - self._last_with_workers > MAX_SECONDS_WITHOUT_WORKERS:
            raise RebaError(_no_workers_message(self.address))

    def _count(self) -> None:
        self._counted_at = time.monotonic()
        with contextlib.suppress(OSError, TimeoutError):
            self._workers = len(self._client.nthreads())
        if self._workers:
            self._last_with_workers = time.monotonic()

    def _await_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=CONNECT_SECONDS)
        except TimeoutError as error:
            raise RebaError(_no_workers_message(self.address)) from error
        self._count()

    def _probe(self, probe: Callable[[], str] | None) -> None:
        local_version = __version__

        def version_problem() -> str:
            # A local function is pickled by value: a worker without the package could not import it from this module.
            try:
                from reba._version import __version__ as worker_version
            except ImportError as error:
                return f"cannot load dreba ({error}); install version {local_version} there"
            same = worker_version == local_version
            return "" if same else f"has dreba {worker_version}, this is {local_version}; install the same version"

        for check in (version_problem, probe):
            answers = {} if check is None else self._run_on_workers(check)
            problems = [f"worker {worker} {answer}" for worker, answer in sorted(answers.items()) if answer]
            if problems:
                more = f" (and {len(problems) - 1} more workers)" if len(problems) > 1 else ""
                raise RebaError(problems[0] + more)

    def _run_on_workers(self, check: Callable[[], str]) -> dict[str, str]:
        """Return the answer of every worker: worker address -> text; each must answer."""
        try:
            answers: dict[str, str] = self._client.sync(self._client.run, check, callback_timeout=PROBE_SECONDS)
        except Exception as error:  # distributed's type for an error that could not be pickled on the worker
            raise RebaError(f"{self.address}: a worker cannot run the check ({error}); {INSTALL_HINT}") from error
        return answers

    def _close(self) -> None:
        with contextlib.suppress(OSError, TimeoutError):
            self._client.close(timeout=CONNECT_SECONDS)


def _connect(address: str, seconds: float) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise missing("distributed", "--scheduler") from error
    for name in logging.root.manager.loggerDict:
        if name.startswith(("asyncio", "distributed", "tornado")):  # reported once, as the one line of the command
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        # A Client without a scheduler keeps retrying in the background, so the address is tried with a bare connection.
        asyncio.run(asyncio.wait_for(_try_connection(address, seconds), seconds))
        return Client(address, timeout=seconds, set_as_default=False)
    # The reply of another kind of server is decoded as a message header, which may declare a size of exabytes.
    except (OSError, ValueError, RuntimeError, TypeError, MemoryError, OverflowError) as error:
        raise RebaError(
            f"{address or 'an empty address'}: no Dask scheduler answers there; give an address like tcp://HOST:8786"
        ) from error


async def _try_connection(address: str, seconds: float) -> None:
    from distributed.comm.core import connect

    comm = await connect(address, timeout=seconds)
    comm.abort()


def _remote_call() -> Callable[[bytes], Any]:
    """Return the function that workers run; it is pickled by value, so the scheduler needs no installation of dreba."""

    def unpack_and_run(packed: bytes) -> Any:
        import pickle

        from reba.batch.dask_cluster import run_exclusively

        return run_exclusively(*pickle.loads(packed))

    return unpack_and_run


def run_exclusively(work: Callable[[Any], Any], task: Any) -> Any:
    """Run a task while no other one runs in this process."""
    with _task_lock:
        return work(task)


def _no_workers_message(address: str) -> str:
    return f"{address}: the scheduler has no workers; start some with `dask worker {address} --nthreads 1`"
