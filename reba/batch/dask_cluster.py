"""Worker pool on an existing Dask cluster.

A worker runs one task at a time, however many threads it has: tasks share state inside a process. Workers may join at
any time, so each process is checked before its first task: one with another version of the package, or without the
files of the tasks, is refused work for the whole run, and its tasks go to the other workers.
"""

from __future__ import annotations

import contextlib
import logging
import pickle
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future
from functools import lru_cache
from typing import Any, Final

from reba._version import __version__
from reba.batch.worker_pool import TASKS_PER_WORKER, NotRun, WorkerDied
from reba.errors import RebaError, warn_user
from reba.extras import missing

CONNECT_SECONDS: Final = 5.0
"""[s] Within which a scheduler must answer."""
PROBE_SECONDS: Final = 30.0
"""[s] Within which every worker must answer the probe; the first call on a worker imports the package."""
MAX_SECONDS_WITHOUT_WORKERS: Final = 30.0
"""[s] After which a cluster without usable workers counts as lost; a worker restarts within seconds."""
WORKER_COUNT_SECONDS: Final = 5.0
"""[s] Between two queries of the workers."""
WAIT_SECONDS: Final = 1.0
"""[s] Between two queries while no worker is usable."""
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
        self._usable: frozenset[str] = frozenset()  # addresses of workers
        self._refused: dict[str, str] = {}  # address of a worker -> what it lacks
        self._restricted: dict[Future[Any], frozenset[str]] = {}  # task -> workers that may run it
        self._counted_at, self._last_with_workers = 0.0, time.monotonic()
        try:
            self._await_workers()
            self._probe(probe)
        except BaseException:
            self._close()
            raise
        self._call = _remote_call(_version_check(), probe)
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
        return TASKS_PER_WORKER * max(len(self._usable), 1)

    def submit(self, work: Callable[[Any], Any], task: Any) -> Future[Any]:
        """Submit a task, to usable workers only once one was refused.

        Raises:
            RebaError: only refused workers are left.
        """
        import cloudpickle

        packed = cloudpickle.dumps((work, task))
        if not self._refused:
            future: Future[Any] = self._executor.submit(self._call, packed)
            return future
        self._count()
        while not self._usable:
            time.sleep(WAIT_SECONDS)
            self.check()
        future = self._executor.submit(self._call, packed, workers=sorted(self._usable))
        self._restricted[future] = self._usable
        return future

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a finished task; the scheduler repeats a task on other workers if one died.

        `NotRun` if its worker was refused, or if every worker that might run it is gone.

        Raises:
            RebaError: the scheduler is lost, or a worker cannot load the task.
        """
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        allowed = self._restricted.pop(future, None)
        if allowed is not None and future.cancelled():
            return NotRun()
        try:
            problem, worker, result = future.result()
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
        if not problem:
            return result
        if worker not in self._refused:
            self._refused[worker] = problem
            warn_user(f"worker {worker} {problem}; its tasks go to other workers")
        return NotRun()

    def check(self) -> None:
        """Check that the cluster had usable workers within the last `MAX_SECONDS_WITHOUT_WORKERS`.

        Tasks whose workers are all gone end, so that they can be submitted again.
        """
        self._count()
        if time.monotonic() - self._last_with_workers > MAX_SECONDS_WITHOUT_WORKERS:
            raise RebaError(_problems(self._refused) or _no_workers_message(self.address))
        for future, allowed in self._restricted.items():
            if not allowed & self._usable:
                future.cancel()

    def _count(self) -> None:
        self._counted_at = time.monotonic()
        with contextlib.suppress(OSError, TimeoutError):
            self._usable = frozenset(self._client.nthreads()) - self._refused.keys()
        if self._usable:
            self._last_with_workers = time.monotonic()

    def _await_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=CONNECT_SECONDS)
        except TimeoutError as error:
            raise RebaError(_no_workers_message(self.address)) from error
        self._count()

    def _probe(self, probe: Callable[[], str] | None) -> None:
        for check in (_version_check(), probe):
            problem = "" if check is None else _problems(self._run_on_workers(check))
            if problem:
                raise RebaError(problem)

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
    import asyncio  # on use: no other command needs it

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


def _version_check() -> Callable[[], str]:
    """Return the function that tells what is wrong with the version of a worker, "" if nothing is."""
    local_version = __version__

    def version_problem() -> str:
        # A local function is pickled by value: a worker without the package could not import it from this module.
        try:
            from reba._version import __version__ as worker_version
        except ImportError as error:
            return f"cannot load dreba ({error}); install version {local_version} there"
        same = worker_version == local_version
        return "" if same else f"has dreba {worker_version}, this is {local_version}; install the same version"

    return version_problem


def _remote_call(
    version_problem: Callable[[], str], probe: Callable[[], str] | None
) -> Callable[[bytes], tuple[str, str, Any]]:
    """Return the function that workers run: packed task -> what the worker lacks, its address, the result.

    It is pickled by value, so the scheduler needs no installation of dreba, and a worker of another version unpacks
    nothing of ours.
    """
    import cloudpickle

    packed_probe = cloudpickle.dumps(probe)

    def unpack_and_run(packed: bytes) -> tuple[str, str, Any]:
        from distributed import get_worker

        worker = get_worker()
        address = str(worker.contact_address or worker.address)
        problem = version_problem()
        if problem:
            return problem, address, None
        from reba.batch.dask_cluster import UnusableWorker, run_exclusively

        try:
            return "", address, run_exclusively(packed_probe, packed)
        except UnusableWorker as error:
            return str(error), address, None

    return unpack_and_run


class UnusableWorker(Exception):
    """This process lacks what tasks need; the text says what."""


def run_exclusively(probe: bytes, packed: bytes) -> Any:
    """Run a packed task while no other one runs in this process.

    Raises:
        UnusableWorker: the packed probe, which runs before the first task, finds what this process lacks.
    """
    _pass(probe)
    work, task = pickle.loads(packed)
    with _task_lock:
        return work(task)


@lru_cache(maxsize=64)
def _pass(packed: bytes) -> None:
    """Run a probe, once in this process if it passes: a cache does not keep exceptions."""
    probe = pickle.loads(packed)
    problem = "" if probe is None else probe()
    if problem:
        raise UnusableWorker(problem)


def _problems(answers: Mapping[str, str]) -> str:
    """Return the first problem of workers, worker -> what it lacks, and how many more there are; "" without any."""
    problems = [f"worker {worker} {answer}" for worker, answer in sorted(answers.items()) if answer]
    more = f" (and {len(problems) - 1} more workers)" if len(problems) > 1 else ""
    return problems[0] + more if problems else ""


def _no_workers_message(address: str) -> str:
    return f"{address}: the scheduler has no workers; start some with `dask worker {address} --nthreads 1`"
