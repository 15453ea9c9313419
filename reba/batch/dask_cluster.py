"""The workers of an existing Dask cluster as a place where tasks run.

A worker runs one task at a time, however many threads it has: what is computed here shares state inside a process.
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
from reba.batch.worker_pool import WAITING, WorkerDied
from reba.errors import RebaError

CONNECT: Final = 5.0
"""[s] Until a scheduler must answer."""
PROBE: Final = 30.0
"""[s] Until every worker must have said what it lacks; a cold worker first loads the package."""
NO_WORKERS: Final = 30.0
"""[s] That the cluster may be without workers."""
REFRESH: Final = 5.0
"""[s] Between two looks at how many workers there are."""
SAME: Final = "install the same dreba on scheduler and workers as here"
_one_at_a_time = threading.Lock()


class Cluster:
    """A Dask cluster that is there already.

    Args:
        address: of its scheduler.
        probe: see `reba.batch.parallel.run_parallel`.

    Raises:
        RebaError: distributed is not installed, or the scheduler or its workers cannot be used.
    """

    def __init__(self, address: str, probe: Callable[[], str] | None = None) -> None:
        self.address = address
        self._client = _connect(address)
        self._workers, self._looked, self._seen = 0, 0.0, time.monotonic()
        try:
            self._await_workers()
            self._probe(probe)
        except BaseException:
            self._close()
            raise
        self._carrier = _carrier()
        self._executor = self._client.get_executor(pure=False)

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, kind: object, /, *rest: object) -> None:
        with contextlib.suppress(OSError, TimeoutError, CancelledError):
            self._executor.shutdown(wait=kind is None)
        self._close()

    def room(self) -> int:
        """Return how many tasks may be under way; workers may come and go."""
        if time.monotonic() - self._looked > REFRESH:
            self._count()
        return WAITING * max(self._workers, 1)

    def submit(self, work: Callable[[Any], Any], task: Any) -> Future[Any]:
        """Start a task."""
        import cloudpickle

        future: Future[Any] = self._executor.submit(self._carrier, cloudpickle.dumps((work, task)))
        return future

    def result(self, future: Future[Any]) -> Any:
        """Return the result of a task that is done; the scheduler has tried it on other workers if one died.

        Raises:
            RebaError: the scheduler is gone, or a worker cannot load the task.
        """
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        try:
            return future.result()
        except KilledWorker as error:
            return WorkerDied(f"{error.allowed_failures + 1} workers died with it (out of memory, or killed)")
        except (CancelledError, FutureCancelledError) as error:
            raise RebaError(
                f"{self.address}: the scheduler was lost; what is done is safe, run the same command again"
            ) from error
        except Exception as error:
            if type(error) is Exception:  # how a worker says that it could not even load the task
                raise RebaError(f"{self.address}: a worker cannot load its task ({error}); {SAME}") from error
            raise

    def check(self) -> None:
        """Look whether the cluster still has workers.

        Raises:
            RebaError: it had none for some time.
        """
        self._count()
        if time.monotonic() - self._seen > NO_WORKERS:
            raise RebaError(_no_workers(self.address))

    def _count(self) -> None:
        self._looked = time.monotonic()
        with contextlib.suppress(OSError, TimeoutError):
            self._workers = len(self._client.nthreads())
        if self._workers:
            self._seen = time.monotonic()

    def _await_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=CONNECT)
        except TimeoutError as error:
            raise RebaError(_no_workers(self.address)) from error
        self._count()

    def _probe(self, probe: Callable[[], str] | None) -> None:
        here = __version__

        def lacks_package() -> str:
            # Defined in here it travels as code: a worker without the package could not load it from its module.
            try:
                from reba._version import __version__ as there
            except ImportError as error:
                return f"cannot load dreba ({error}); install it there as it is here"
            return "" if there == here else f"has dreba {there}, this is {here}; install the same"

        for question in (lacks_package, probe):
            answers = {} if question is None else self._ask(question)
            wrong = [f"worker {worker} {answer}" for worker, answer in sorted(answers.items()) if answer]
            if wrong:
                more = f" (and {len(wrong) - 1} more workers)" if len(wrong) > 1 else ""
                raise RebaError(wrong[0] + more)

    def _ask(self, question: Callable[[], str]) -> dict[str, str]:
        """Return the answer of every worker.

        Raises:
            RebaError: one does not answer.
        """
        try:
            answers: dict[str, str] = self._client.sync(self._client.run, question, callback_timeout=PROBE)
        except Exception as error:  # what a worker cannot say properly comes back as this type
            raise RebaError(f"{self.address}: a worker does not answer as it should ({error}); {SAME}") from error
        return answers

    def _close(self) -> None:
        with contextlib.suppress(OSError, TimeoutError):
            self._client.close(timeout=CONNECT)


def _connect(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise RebaError(
            '--scheduler needs the package distributed, which is not installed; pip install "dreba[cluster]"'
        ) from error
    for name in logging.root.manager.loggerDict:
        if name.startswith("distributed"):  # what goes wrong is said here in one line
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        # A client that finds no scheduler goes on trying in the background, so the address is tried without one.
        asyncio.run(asyncio.wait_for(_greet(address), CONNECT))
        return Client(address, timeout=CONNECT, set_as_default=False)
    # A server that is no scheduler answers with anything, which can look like a message of exabytes.
    except (OSError, ValueError, RuntimeError, TypeError, MemoryError, OverflowError) as error:
        raise RebaError(
            f"{address or 'an empty address'}: no Dask scheduler answers there; give an address like tcp://HOST:8786"
        ) from error


async def _greet(address: str) -> None:
    from distributed.comm.core import connect

    comm = await connect(address, timeout=CONNECT)
    comm.abort()


def _carrier() -> Callable[[bytes], Any]:
    """Return the function that a worker is given; it and its bytes pass through schedulers that lack this package."""

    def carried(packed: bytes) -> Any:
        import pickle

        from reba.batch.dask_cluster import run_alone

        return run_alone(*pickle.loads(packed))

    return carried


def run_alone(work: Callable[[Any], Any], task: Any) -> Any:
    """Run a task on a worker."""
    with _one_at_a_time:
        return work(task)


def _no_workers(address: str) -> str:
    return f"{address}: the scheduler has no workers; start some with `dask worker {address} --nthreads 1`"
