"""The plan: a frozen record of actions, motion, costs, residuals and true REBA scores, and its files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from lgp.world.scene import Scene
    from reba import Rules, ScoreArrays

Array = NDArray[np.float64]


def _none() -> Array:
    return np.zeros(0)


def _no_rows() -> Array:
    return np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Plan:
    """What was planned for a scene.

    Attributes:
        scene: what was planned for, heights of tables included.
        feasible: whether there is a plan; `reason` says why not.
        status: how the search ended: optimal, gap, interrupted, infeasible, unreachable, exhausted.
        actions: as the paper prints them, one per phase.
        joints: names of the columns of `path`.
        start: (nq,) configuration at time 0 [rad, m].
        time: (T,) of each slice [s].
        phase: (T,) number of its phase, from 0.
        path: (T, nq) configurations [rad, m].
        variables: how objects lie in hands and on tables: name -> value [m, rad].
        posture: (T, 22) angles of the human [deg] as `reba` defines them, (0, 0) without a human.
        carried: (T,) mass the human holds [kg].
        costs: total, acceleration, ergonomics.
        residuals: largest violations recomputed from the path: equality, inequality, by unit (metres, radians), and how
            far any two bodies go into each other (penetration [m], between slices too).
        solver: how the path was solved: status, kkt, iterations, seconds.
        search: expanded, pruned, poses, sequences, paths, seconds, bound, gap, and each level's numbers.
        tree: nodes of the searched tree; not saved.
    """

    scene: Scene
    feasible: bool
    status: str
    reason: str
    joints: tuple[str, ...]
    start: Array
    search: dict[str, Any]
    actions: tuple[str, ...] = ()
    time: Array = field(default_factory=_none)
    phase: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))
    path: Array = field(default_factory=_no_rows)
    variables: dict[str, float] = field(default_factory=dict)
    posture: Array = field(default_factory=_no_rows)
    carried: Array = field(default_factory=_none)
    costs: dict[str, float] = field(default_factory=dict)
    residuals: dict[str, float] = field(default_factory=dict)
    solver: dict[str, Any] = field(default_factory=dict)
    tree: tuple[Any, ...] = field(default=(), repr=False)

    def reba(self, rules: Rules | str = "measured") -> ScoreArrays | None:
        """Return the true scores of every slice, None without a plan or a human.

        Args:
            rules: a preset's name or a record of `reba.Rules`.
        """
        if not len(self.posture):
            return None
        from reba import score_array

        return score_array(self.posture, {"load": self.carried}, rules)

    def summary(self) -> dict[str, Any]:
        """Return the numbers of the plan as plain data, as `lgp plan --json` prints them."""
        scores = self.reba()
        reba: dict[str, Any] = {"mean": None, "max": None, "per_phase": []}
        if scores is not None:
            total = np.asarray(scores.reba, dtype=float)
            phases = [float(total[self.phase == number].mean()) for number in range(len(self.actions))]
            reba = {"mean": float(total.mean()), "max": int(total.max()), "per_phase": phases, "last": int(total[-1])}
        return {
            "feasible": self.feasible,
            "status": self.status,
            "reason": self.reason,
            "scene": self.scene.name,
            "actions": list(self.actions),
            "cost": self.costs or {"total": None, "acceleration": None, "ergonomics": None},
            "reba": reba,
            "residuals": self.residuals or {"equality": None, "inequality": None},
            "search": {name: _finite(value) for name, value in self.search.items()},
            "solver": self.solver,
        }

    def save(self, folder: str | Path) -> None:
        """Write `plan.json`, `path.parquet` and, with a human, `postures.parquet` (which `reba score` reads).

        Raises:
            LgpError: the folder cannot be written.
        """
        from lgp.plan_files import save

        save(self, Path(folder))

    @staticmethod
    def load(folder: str | Path) -> Plan:
        """Return the plan in a folder that `save` wrote.

        Raises:
            LgpError: no plan is there, it is damaged, or a newer version wrote it.
        """
        from lgp.plan_files import load as read

        return read(Path(folder))


def _finite(value: Any) -> Any:
    """Return a number that JSON can hold: None for infinity."""
    return None if isinstance(value, float) and not np.isfinite(value) else value
