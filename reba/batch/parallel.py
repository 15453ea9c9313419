"""Many independent pieces of work at once: in processes of this machine, or on the workers of a Dask cluster.

    tasks -> window of twice the workers -> results as they finish

Local processes are joblib's own (loky). On a cluster the same calls go through Dask's executor: joblib's Dask backend
waits for ever once a task takes its worker down with it (joblib 1.6.0, distributed 2026.8.0).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from itertools import islice
from typing import Any, Final, TypeVar

from reba.batch.dask_cluster import Cluster
from reba.batch.worker_pool import Pool, Processes, WorkerDied

Task = TypeVar("Task")
Result = TypeVar("Result")
CHECK: Final = 2.0
"""[s] Without a result after which the pool is looked at."""


def run_parallel(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    probe: Callable[[], str] | None = None,
) -> Iterator[tuple[Task, Result | WorkerDied]]:
    """Yield every task with its result, as they finish.

    Tasks are taken from the iterable only as workers get free, and results are not kept: memory does not grow with
    their number. A process that dies takes no other task with it: what was under way is run again, and a task that
    kills its process every time comes back as `WorkerDied`.

    Args:
        work: a function of a module, or a partial of one; it and the tasks are pickled.
        tasks: taken lazily.
        jobs: processes on this machine; 1 runs everything in this one.
        scheduler: address of a Dask scheduler, such as tcp://10.0.0.5:8786; `jobs` does not matter then.
        probe: run on every worker of a cluster before anything else: says what is missing there, "" if nothing.

    Raises:
        RebaError: the cluster cannot be used or was lost; and whatever `work` raises.

    Example:
        >>> sorted(fan_out(abs, [-3, 2]))
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
    under_way: dict[Future[Result], Task] = {}
    suspects: list[Task] = []
    while True:
        for task in islice(tasks, max(0, pool.room() - len(under_way))):
            under_way[pool.submit(work, task)] = task
        if not under_way:
            break
        for future in _done(pool, under_way):
            task = under_way.pop(future)
            result = pool.result(future)
            if isinstance(result, WorkerDied):
                suspects.append(task)
            else:
                yield task, result
    # A process that dies takes what waits beside it along: which task it was shows when each runs by itself.
    for task in suspects:
        alone = pool.submit(work, task)
        _done(pool, [alone])
        yield task, pool.result(alone)


def _done(pool: Pool, futures: Iterable[Future[Any]]) -> set[Future[Any]]:
    """Wait until at least one is done and return those that are."""
    while not (done := wait(futures, timeout=CHECK, return_when=FIRST_COMPLETED).done):
        pool.check()
    return done
