"""Work for several models in parallel processes, with one error where a process died."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

from dreba.errors import ModelError
from reba.batch.parallel import run_parallel
from reba.batch.worker_pool import WorkerDied

Name = TypeVar("Name", bound=Hashable)
Item = TypeVar("Item")
Result = TypeVar("Result")


def in_parallel(
    work: Callable[[tuple[Name, Item]], Result], items: Mapping[Name, Item], jobs: int, scheduler: str | None
) -> dict[Name, Result]:
    """Return the results of `work` for every item, in their order.

    Raises:
        ModelError: the process of an item died.
    """
    results: dict[Name, Result] = {}
    for (name, _), result in run_parallel(work, items.items(), jobs=min(jobs, len(items) or 1), scheduler=scheduler):
        if isinstance(result, WorkerDied):
            raise ModelError(f"{name}: {result.reason}; compare it by itself")
        results[name] = result
    return {name: results[name] for name in items}
