"""Independent tasks in parallel: in local processes, or on the workers of a Dask cluster.

    tasks -> at most twice as many submitted as workers -> results as they finish

Local processes are loky's (the library below joblib). On a cluster the same calls go through Dask's executor, because
joblib's Dask backend blocks for ever when a task kills its worker (joblib 1.6.0, distributed 2026.8.0).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from itertools import islice
from typing import Any, Final, TypeVar

from reba.batch.dask_cluster import Cluster
from reba.batch.worker_pool import NotRun, Pool, Processes, WorkerDied

Task = TypeVar("Task")
Result = TypeVar("Result")
CHECK_SECONDS: Final = 2.0
"""[s] Without a result after which the pool is checked; short against the tens of seconds until a cluster is lost."""


def run_parallel(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    probe: Callable[[], str] | None = None,
) -> Iterator[tuple[Task, Result | WorkerDied]]:
    """Yield pairs (task, result) in the order in which the tasks finish.

    Tasks are taken from the iterable only as workers become free and results are not stored, so memory does not grow
    with their number. A worker that dies loses only its own task: unfinished tasks are repeated one by one, and a task
    that kills its process again yields `WorkerDied`.

    Args:
        work: a function of a module, or a partial of one; it and the tasks are pickled.
        tasks: consumed lazily.
        jobs: local processes; 1 runs everything in this process.
        scheduler: address of a Dask scheduler, such as tcp://10.0.0.5:8786; `jobs` is ignored then.
        probe: run on every worker of a cluster before its first task; returns what the worker lacks, "" if ready.

    Raises:
        RebaError: the cluster cannot be used or was lost. Exceptions of `work` are re-raised.

    Warns:
        UserWarning: a worker that joined a cluster later cannot be used, and other workers do its tasks.

    Example:
        >>> sorted(run_parallel(abs, [-3, 2]))
        [(-3, 3), (2, 2)]
    """
    if scheduler is None and jobs == 1:
        for task in tasks:
            yield task, work(task)
        return
    if scheduler is None:
        pool: Pool = Processes(jobs)
    else:
        pool = Cluster(scheduler, probe)
    with pool:
        yield from _stream(pool, work, iter(tasks))


def _stream(
    pool: Pool, work: Callable[[Task], Result], tasks: Iterator[Task]
) -> Iterator[tuple[Task, Result | WorkerDied]]:
    submitted: dict[Future[Result], Task] = {}
    unfinished: list[Task] = []
    while True:
        for task in islice(tasks, max(0, pool.capacity() - len(submitted))):
            submitted[pool.submit(work, task)] = task
        if not submitted:
            break
        for future in _wait_for_any(pool, submitted):
            task = submitted.pop(future)
            result = pool.result(future)
            if isinstance(result, NotRun):
                submitted[pool.submit(work, task)] = task
            elif isinstance(result, WorkerDied):
                unfinished.append(task)
            else:
                yield task, result
    # A process that dies ends the tasks submitted with it; which of them kills its process shows when each runs alone.
    for task in unfinished:
        alone: Result | WorkerDied | NotRun = NotRun()
        while isinstance(alone, NotRun):
            retry = pool.submit(work, task)
            _wait_for_any(pool, [retry])
            alone = pool.result(retry)
        yield task, alone


def _wait_for_any(pool: Pool, futures: Iterable[Future[Any]]) -> set[Future[Any]]:
    """Wait until at least one future is done and return all that are done."""
    while not (done := wait(futures, timeout=CHECK_SECONDS, return_when=FIRST_COMPLETED).done):
        pool.check()
    return done
