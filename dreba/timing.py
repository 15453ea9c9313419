"""How long a model takes for value and gradient: one pose, and a batch."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from dreba.evaluate import angles_for
from dreba.model import Surrogate
from dreba.poses import Poses

ROUNDS: Final = 5
"""Best of this many: other work on the machine only ever adds time."""
BATCH: Final = 100_000


def time_per_pose(model: Surrogate, poses: Poses) -> dict[str, float]:
    """Return seconds per pose for value and gradient together: `single` (one call per pose) and `batch`."""
    angles = angles_for(model, poses)
    repeats = -(-BATCH // len(angles))
    batch = angles.repeat(repeats, axis=0)[:BATCH] if repeats > 1 else angles[:BATCH]
    some = list(angles[:200])

    def one_by_one() -> None:
        for pose in some:
            model.value_and_gradient(pose)

    return {
        "single": _best(one_by_one) / len(some),
        "batch": _best(lambda: model.value_and_gradient(batch)) / len(batch),
    }


def _best(work: Callable[[], object]) -> float:
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best
