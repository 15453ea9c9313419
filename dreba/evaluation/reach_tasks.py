"""Reach tasks: hands on target points, by which surrogates are judged as costs.

Tasks alternate between one hand at a random point and two hands on the sides of a box 0.34 m wide. A seed generates
them, independently of the training poses of any model. Those of two seeds are stored with the least true REBA that they
allow.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final, Literal

import numpy as np

from dreba.errors import ModelError
from dreba.evaluation.reach_figure import hand, limits, neutral
from reba.arrays import Array
from reba.open_file import read_settings
from reba.posture.columns import SIDES

Starts = Literal["random", "neutral"]
Space = Literal["wide", "bench"]
BOX: Final = 0.34
"""[m] Distance of the hands on a box, a common box width."""
INFEASIBLE: Final = 12
"""Score of a run that does not reach its targets: the worst score of Table C."""
_Ranges = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
SPACES: Final[dict[Space, tuple[_Ranges, _Ranges]]] = {
    "bench": (((0.20, 0.65), (-0.20, 0.50), (0.40, 1.60)), ((0.25, 0.60), (-0.20, 0.20), (0.40, 1.50))),
    "wide": (((0.00, 0.80), (-0.30, 0.70), (0.10, 1.90)), ((0.20, 0.75), (-0.35, 0.35), (0.10, 1.80))),
}
"""[m] Ranges of target points and of box centres: forward, towards the side of the hand (of a box: left), up. "wide"
has points near the floor, overhead and far ahead."""


@dataclass(frozen=True)
class ReachTask:
    """Target points of the hands: side -> (x, y, z) [m], forward, left and up from the floor under the pelvis."""

    targets: Mapping[str, tuple[float, float, float]]

    def constraint(self, dofs: Array) -> tuple[Array, Array]:
        """Return the position errors (m,) [m] of the hands, three for each, and their Jacobian (m, 22) [m/deg]."""
        residuals, jacobians = [], []
        for side, target in self.targets.items():
            position, jacobian = hand(dofs, side)
            residuals.append(position - np.array(target))
            jacobians.append(jacobian)
        return np.concatenate(residuals), np.concatenate(jacobians)


def tasks(n: int, seed: int = 0, space: Space = "wide") -> tuple[ReachTask, ...]:
    """Return n tasks in one of `SPACES`; one hand (left and right in turn) and two hands alternate.

    Example:
        >>> [sorted(task.targets) for task in tasks(4)]
        [['left'], ['left', 'right'], ['right'], ['left', 'right']]
    """
    rng = np.random.default_rng(seed)
    of_hand, of_box = SPACES[space]
    generated = []
    for number in range(n):
        if number % 2 == 0:
            side = SIDES[number // 2 % 2]
            x, y, z = (float(rng.uniform(*ends)) for ends in of_hand)
            generated.append(ReachTask({side: (x, y if side == "left" else -y, z)}))
        else:
            x, y, z = (float(rng.uniform(*ends)) for ends in of_box)
            generated.append(ReachTask({"left": (x, y + BOX / 2, z), "right": (x, y - BOX / 2, z)}))
    return tuple(generated)


def starts(kind: Starts, n: int, seed: int = 0) -> Array:
    """Return initial postures (n, 22) [deg]: uniform within the limits, or within 5 deg of standing upright."""
    rng = np.random.default_rng([seed, 1])
    low, high = limits()
    if kind == "random":
        return rng.uniform(low, high, (n, len(low)))
    return np.clip(neutral() + rng.uniform(-5.0, 5.0, (n, len(low))), low, high)


STORED: Final = Path(__file__).with_suffix(".json")
"""Tasks with the least true REBA that they allow, written by `python benchmarks/certify_tasks.py`."""


@dataclass(frozen=True)
class StoredTask:
    """A reach task and what is known of the least true REBA of a posture that solves it.

    Attributes:
        proved: no posture with the hands within 1 mm of the targets has a lower score; see `dreba.evaluation.certify`.
        reached: score of `dofs`, the lowest that is known.
        dofs: (22,) [deg], a posture of that score that solves the task.
    """

    task: ReachTask
    proved: int
    reached: int
    dofs: tuple[float, ...]

    @property
    def certified(self) -> bool:
        """Whether the least score is known: the proved bound is reached."""
        return self.proved == self.reached


@cache
def stored_tasks(space: Space = "wide", seed: int = 0) -> tuple[StoredTask, ...]:
    """Return the stored tasks of one space and seed.

    Raises:
        ModelError: no tasks are stored for the seed.

    Example:
        >>> stored_tasks("wide")[0].task == tasks(1)[0]
        True
    """
    sets = json.loads(read_settings(STORED))["sets"]
    if f"{space} {seed}" not in sets:
        raise ModelError(f"no reach tasks are stored for {space} and seed {seed}; stored: {', '.join(sets)}")
    return tuple(
        StoredTask(
            ReachTask({side: (x, y, z) for side, (x, y, z) in row["targets"].items()}),
            row["proved"], row["reached"], tuple(row["dofs"]),
        )
        for row in sets[f"{space} {seed}"]
    )  # fmt: skip
