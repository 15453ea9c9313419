"""The plan as a frozen record: actions, motion, costs, residuals, true REBA scores."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lgp.agent_trajectory import AgentTrajectory, configurations_at, moments_of
from lgp.errors import LgpError
from lgp.logic.task import numbered
from lgp.plan_files import AS_THEY_ARE, SavedMotion, read_plan, write_plan
from lgp.scene.model import Scene
from lgp.scene.surroundings import standing
from reba.arrays import Array, Indices
from reba.checks import PATH, POSITIVE, TEXT, accepts
from reba.errors import did_you_mean
from reba.files import as_json, plain_data
from reba.method.rules import Rules
from reba.method.scoring import ScoreArrays, score_angles
from reba.provenance import generator, provenance


def _no_values() -> Array:
    return np.zeros(0)


def _no_rows() -> Array:
    return np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class PersonPostures:
    """The posture angles of a person (T, 22) [deg] as `reba` defines them, and the mass in the hands (T,) [kg]."""

    angles: Array
    carried: Array

    def reba(self, rules: Rules | str = "measured") -> ScoreArrays:
        """Return the true REBA scores of every slice."""
        return score_angles(self.angles, {"load": self.carried}, rules)


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan for a scene.

    Attributes:
        scene: the scene, with the heights of its tables.
        feasible: whether there is a plan.
        status: optimal, gap or interrupted of a search with a plan, given of a given sequence, concurrent where actions
            happen at the same time; infeasible, unreachable or exhausted where there is no plan.
        reason: why there is no plan, "" if there is one.
        actions: each with the number of the phase that it ends, as in the paper: `grasp(1, baxter.right, screwdriver)`;
            those with the same number happen at the same time.
        joints: names of the columns of `path`.
        start: configuration at time 0 (nq,) [rad, m].
        time: of each slice (T,) [s].
        phase: number of the phase of each slice, from 0 (T,).
        path: configurations (T, nq) [rad, m].
        variables: pose of objects relative to hands and tables: name -> value [m, rad].
        people: postures and loads of each person by name, in the order of the scene; {} without a human.
        costs: total, acceleration, ergonomics, time, cost terms of one's own, what actions cost in the domain.
        weights: of these terms; {} of older plans.
        residuals: largest constraint violations recomputed from the path: equality, inequality, by unit (metres,
            radians), and the deepest penetration of two collision shapes [m], between slices as well.
        solver: status, KKT residual, iterations and seconds of the path problem.
        search: expanded, pruned, poses, sequences, paths, seconds, bound, gap, and statistics of each level.
        tree: nodes of the searched tree; not saved.
        provenance: the version that computed the plan; {} if it is unknown.
        starts: how many starts of the best sequence were solved (`of`) and how many agree on its cost (`agreed`) within
            1 %; {} without a plan, and of older plans.
        audit: what `lgp.audit_plan` found, as `Audit.summary` gives it; {} without a plan, and of older plans.
        concurrent: the sequence of actions one at a time and the same at the same time, with costs and seconds, and
            which was `kept`; {} unless the scene asks for it.
    """

    scene: Scene
    feasible: bool
    status: str
    reason: str
    joints: tuple[str, ...]
    start: Array
    search: dict[str, Any]
    actions: tuple[str, ...] = ()
    time: Array = field(default_factory=_no_values)
    phase: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    path: Array = field(default_factory=_no_rows)
    variables: dict[str, float] = field(default_factory=dict)
    people: Mapping[str, PersonPostures] = field(default_factory=dict)
    costs: dict[str, float] = field(default_factory=dict)
    weights: dict[str, float] = field(default_factory=dict)
    residuals: dict[str, float] = field(default_factory=dict)
    solver: dict[str, Any] = field(default_factory=dict)
    tree: tuple[Any, ...] = field(default=(), repr=False)
    provenance: dict[str, Any] = field(default_factory=provenance)
    audit: dict[str, Any] = field(default_factory=dict)
    starts: dict[str, int] = field(default_factory=dict)
    concurrent: dict[str, Any] = field(default_factory=dict)

    @property
    def phase_of(self) -> tuple[int, ...]:
        """Number of the phase that each action ends, from 0 (A,)."""
        return tuple((np.cumsum([not together for _, together in numbered(self.actions)], dtype=int) - 1).tolist())

    @property
    def durations(self) -> tuple[float, ...]:
        """Duration of each phase [s], (K,)."""
        ends = self.time[np.flatnonzero(np.diff(self.phase, append=-1))]
        return tuple(np.diff(ends, prepend=0.0).tolist())

    @property
    def digest(self) -> str:
        """SHA-256 of scene, actions and path, hexadecimal: what tells one plan from another."""
        steps = {"scene": self.scene.values, "actions": self.actions, "joints": self.joints}
        return hashlib.sha256(as_json({**steps, "time": self.time, "path": self.path}).encode()).hexdigest()

    @property
    def posture(self) -> Array:
        """Posture angles of the first person (T, 22) [deg], (0, 0) without a human."""
        return next((one.angles for one in self.people.values()), _no_rows())

    @property
    def carried(self) -> Array:
        """Mass in the hands of the first person (T,) [kg], 0 without a human."""
        return next((one.carried for one in self.people.values()), np.zeros(len(self.time)))

    @accepts(LgpError, person=TEXT.or_none())
    def reba(self, rules: Rules | str = "measured", *, person: str | None = None) -> ScoreArrays | None:
        """Return the true REBA scores of a person in every slice, None without a plan or a human.

        Args:
            rules: name of a preset, or a `reba.Rules` record.
            person: name of the person, by default the first one.

        Raises:
            LgpError: there is no such person.
        """
        if person is not None and person not in self.scene.humans:
            hint = did_you_mean(person, self.scene.humans) or f"; known are {', '.join(self.scene.humans) or 'none'}"
            raise LgpError(f"{self.scene.name}: no person {person!r}{hint}")
        if not self.people:
            return None
        return self.people[next(iter(self.people)) if person is None else person].reba(rules)

    def summary(self) -> dict[str, Any]:
        """Return status, actions, costs, scores and residuals as plain data, as in `lgp plan --json`."""
        return {
            "feasible": self.feasible,
            "status": self.status,
            "reason": self.reason,
            "scene": self.scene.name,
            "actions": list(self.actions),
            "durations": list(self.durations),
            "cost": self.costs or dict.fromkeys(("total", "acceleration", "ergonomics", "time", "terms", "actions")),
            "weights": self.weights,
            "reba": self._scores(),
            "residuals": self.residuals or {"equality": None, "inequality": None},
            "audit": plain_data(self.audit),
            "search": plain_data(self.search),
            "solver": self.solver,
            "starts": self.starts,
            "concurrent": self.concurrent,
        }

    def _scores(self) -> dict[str, Any]:
        """Return mean, largest, last and mean score per phase: of all persons together, and of each by name."""
        totals = {name: np.asarray(one.reba().reba, dtype=float) for name, one in self.people.items()}
        if not totals:
            return {"mean": None, "max": None, "per_phase": [], "people": {}}
        everyone = self._figures(np.stack(list(totals.values()), axis=1))
        return {**everyone, "people": {name: self._figures(own[:, None]) for name, own in totals.items()}}

    def _figures(self, total: Array) -> dict[str, Any]:
        """Return the figures of the scores of some persons (T, persons)."""
        return {
            "mean": float(np.average(total.mean(axis=1), weights=np.diff(self.time, prepend=0.0))),
            "max": int(total.max()),
            "per_phase": [float(total[self.phase == number].mean()) for number in range(len(self.durations))],
            "last": int(total[-1].max()),
        }

    @accepts(LgpError, agent=TEXT, step=POSITIVE.or_none())
    def trajectory(self, agent: str, *, step: float | None = None) -> AgentTrajectory:
        """Return the motion of one agent over time, between slices as the plan interpolates.

        Args:
            agent: `human`, or the name of a person or robot.
            step: time between moments [s]; by default the moments are the start and the slices.

        Raises:
            LgpError: there is no such agent, or no motion.

        Example:
            >>> import lgp
            >>> scene = lgp.load_scene("screwdriver", {"goal": ["grasped(baxter.right, screwdriver)"]})
            >>> motion = lgp.plan(scene, cost=None, collisions=False).trajectory("baxter", step=0.1)
            >>> motion.position.shape, motion.joints[0]
            ((21, 14), 'left_s0')
        """
        names = [one.name for one in self.scene.agents]
        if agent not in names:
            hint = did_you_mean(agent, names) or f"; known are {', '.join(names)}"
            raise LgpError(f"{self.scene.name}: no agent {agent!r}{hint}")
        if not self.feasible:
            raise LgpError(
                f"{self.scene.name}: the plan is infeasible ({self.reason}), so there is no motion; plan again"
            )
        own = [column for column, name in enumerate(self.joints) if name.startswith(f"{agent}.")]
        knots, clock = np.concatenate([self.start[None], self.path])[:, own], np.append(0.0, self.time)
        moments = moments_of(clock, step)
        joints = tuple(self.joints[column].removeprefix(f"{agent}.") for column in own)
        return AgentTrajectory(agent, joints, moments, *configurations_at(knots, clock, moments))

    def pddl(self) -> str:
        """Return the actions as a temporal plan of PDDL 2.1 (Fox & Long 2003): begin [s], action, duration [s].

        Actions with the same begin happen at the same time: `0.000: (grasp baxter.right screwdriver) [2.000]`.
        """
        begins = np.append(0.0, np.cumsum(self.durations)).round(9)
        lines = [f"; {generator('lgp')}", f"; {self.scene.name}: cost {self.costs.get('total', 0.0):.6g}"]
        for (text, _), phase in zip(numbered(self.actions), self.phase_of, strict=True):
            words = text.removesuffix(")").replace("(", ", ", 1).replace(", ", " ")
            lines.append(f"{begins[phase]:.3f}: ({words}) [{self.durations[phase]:.3f}]")
        return "\n".join(lines) + "\n"

    @accepts(LgpError, folder=PATH)
    def save(self, folder: str | Path) -> None:
        """Write `plan.json`, `path.parquet`, the actions as `plan.txt` (`pddl`) and, with a human, `postures.parquet`
        (which `reba score` reads).

        `postures.parquet` is of the first person, `postures-NAME.parquet` of each other one.

        Raises:
            LgpError: the folder cannot be written.
        """
        data = {
            "scene": {"name": self.scene.name, "values": self.scene.values, **standing(self.scene)},
            **{name: getattr(self, name) for name in AS_THEY_ARE},
            "actions": list(self.actions),
            "durations": list(self.durations),
            "joints": list(self.joints),
            "start": self.start.tolist(),
            "reba": self.summary()["reba"],
        }
        people = {name: (one.angles, one.carried) for name, one in self.people.items()}
        motion = SavedMotion(self.time, self.phase, self.path, people)
        write_plan(Path(folder), data, motion, self.pddl() if self.feasible else "")

    @staticmethod
    @accepts(LgpError, folder=PATH)
    def load(folder: str | Path) -> Plan:
        """Return the plan that `save` wrote into a folder.

        Raises:
            LgpError: the folder has no plan, or it is damaged or of a newer version.
        """
        fields, motion = read_plan(Path(folder))
        if motion is None:
            return Plan(**fields)
        people = {name: PersonPostures(*own) for name, own in motion.people.items()}
        return Plan(**fields, time=motion.time, phase=motion.phase, path=motion.path, people=people)
