"""A path problem in which some things are settled: how objects lie in hands and on tables, what some arms do.

What comes later was planned for an object in the same grip, or at a given spot, so it stays as good as it was. Hands
that hold a part when the sequence begins stand still until their next action, as hands that hold within it do.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds, Solution
from lgp.path.collision_constraints import CollisionRows
from lgp.path.collision_path import settled, solve_collision_free
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.search.tree_search import Skeleton
from lgp.sqp.problem import SolverOptions
from lgp.sqp.solver import Solver
from reba.arrays import Array, Flags, Indices

SLACK = 1e-5
"""[m, rad] Room around a pinned value, so that bounds do not become equations."""
FIRST = 0.05
"""[rad, m] Longest step from a planned motion before it is looked at which bodies it brings near each other."""
ROUGH = 2e-4
"""Promised decrease of the cost, relative to it, that a run does not wait for."""
BUDGET = 20
"""Iterations after which a path that started from the planned one is good enough, if it holds its constraints."""


@dataclass(frozen=True)
class PrescribedMotion:
    """How some joints move during the first action: columns of q (k,), their values (slices, k) after its start."""

    columns: Indices
    values: Array


class FixedPathBounds(PathBounds):
    """The levels of a scene in which some variables and joints have given values.

    Args:
        pins: name of a variable, such as `0.box.yaw` -> value [m, rad].
        still: hands that stay where they start until their next action.
        course: of joints that move in a given way during the first action.
        resting: columns of q that stay where they start in the first slice.
        shapes: sequence -> motion that was planned for it in another world (1 + T, nq) and its variables (nz,); where
            bodies are in each other's way, the solver starts from that one.
        more: as `PathBounds` takes it.
    """

    def __init__(
        self,
        *args: Any,
        pins: Mapping[str, float] | None = None,
        still: Iterable[str] = (),
        course: PrescribedMotion | None = None,
        resting: Indices | None = None,
        shapes: Mapping[Skeleton, tuple[Array, Array]] | None = None,
        **more: Any,
    ) -> None:
        super().__init__(*args, **more)
        self.detours = False
        self.pins = {} if pins is None else pins
        self.still = {hand: np.flatnonzero(self.world.support(hand)) for hand in still}
        self.course = course
        self.resting = np.zeros(0, np.intp) if resting is None else resting
        self.shapes = {} if shapes is None else dict(shapes)

    def problem(self, level: str, phases: Phases, *args: Any, **more: Any) -> PathProblem:
        """Return the problem of a level with narrow bounds around the given values; poses leave joints free."""
        problem = super().problem(level, phases, *args, **more)
        first = problem.n - problem.modes.size
        for at, name in enumerate(problem.modes.names, start=first):
            if name in self.pins:
                inside = np.clip(self.pins[name], problem.lower[at], problem.upper[at])
                _pin(problem, np.array([at]), inside)
        if level == "pose":
            return problem
        nq = self.world.nq
        for row, at in enumerate(problem.kept.tolist()):
            for hand, columns in self.still.items():
                if at <= _until(phases, hand):
                    _pin(problem, row * nq + columns, self.start[columns])
            if self.course is not None and at < phases.slices:
                _pin(problem, row * nq + self.course.columns, self.course.values[at])
            if at == 0:
                _pin(problem, row * nq + self.resting, self.start[self.resting])
        return problem

    @property
    def _options(self) -> SolverOptions:
        options = super()._options
        return replace(options, decrease=max(options.decrease, ROUGH), kkt=max(options.kkt, ROUGH))

    def _path(self, phases: Phases, earlier: Solution | None) -> tuple[Solution | None, str]:
        shape = self.shapes.get(phases.actions)
        if shape is None or earlier is None or earlier.path is None:
            return super()._path(phases, earlier)
        near = CollisionRows(self.world, phases, self.start).extend(earlier.path, earlier.variables)
        found = self._reshaped(phases, *shape) if near else None
        return super()._path(phases, earlier) if found is None else (found, "")

    def _reshaped(self, phases: Phases, shape: Array, variables: Array) -> Solution | None:
        """Return the path that a planned one (1 + T, nq) becomes in this world, None if it becomes none."""
        rows = CollisionRows(self.world, phases, self.start)
        fade = np.maximum(1.0 - np.arange(1, len(shape)) / phases.slices, 0.0)
        guess = shape[1:] + fade[:, None] * (self.start - shape[0])
        rows.extend(guess, variables)
        make = partial(self.problem, "path", phases)
        problem = make(apart=rows)
        options = replace(settled(self._options), longest_step=FIRST, iterations=1)
        result = Solver(options).solve(problem, problem.join(guess, variables))
        limited = replace(self._options, iterations=min(BUDGET, self._options.iterations))
        return self._judged(*solve_collision_free(lambda given: make(apart=given), rows, result, limited))[0]


def _pin(problem: PathProblem, unknowns: Indices, values: Array) -> None:
    """Leave some unknowns hardly any room around values."""
    problem.lower[unknowns], problem.upper[unknowns] = values - SLACK, values + SLACK


def _until(phases: Phases, hand: str) -> int:
    """Return the slice of a hand's first action, the last slice if it has none."""
    acts = [number for number, switch in enumerate(phases.switches) if hand in switch.hands]
    return int(phases.keys[acts[0] if acts else -1])


OFF = 0.02
"""[rad] An arm with a joint farther from the plan than this does not move as planned."""


def still_hands(modes: ModeSequence, number: int) -> tuple[str, ...]:
    """Return the hands that stand still during an action, as they hold a part until their next action.

    Args:
        modes: of the whole sequence.
        number: of the action.
    """
    found = [hand for hand, since, end in modes.holding_intervals if since < number <= end]
    found += [hand for hand, _, end in modes.held_at_first if number <= end]
    return tuple(dict.fromkeys(found))


def planned_course(world: World, first: Array, planned: Array, hands: Sequence[str]) -> PrescribedMotion:
    """Return the planned motion of those robot arms that have no part in an action and start as planned.

    An arm moves as planned as a whole or not at all: some of its joints alone would take the hand anywhere.

    Args:
        world: the kinematics.
        first: (nq,) present configuration.
        planned: (slices + 1, nq) planned motion of the action.
        hands: that have a part in the action or stand still.
    """
    off = np.abs(first - planned[0]) >= OFF
    busy, moving = _columns(world, hands), np.zeros(world.nq, bool)
    for robot in world.scene.robots:
        own = np.zeros(world.nq, bool)
        own[world.columns(robot)] = True
        arms = [_columns(world, [name]) & own for name, hand in world.scene.hands.items() if hand.agent == robot]
        rest = own & ~np.any(arms, axis=0) if arms else own
        for part in (*arms, rest):
            part = part & ~busy
            moving |= part & (not np.any(off & part))
    columns = np.flatnonzero(moving)
    return PrescribedMotion(columns, planned[1:, columns])


def _columns(world: World, hands: Sequence[str]) -> Flags:
    """Return (nq,) which joints move any of some hands."""
    return np.asarray(np.sum([np.zeros(world.nq), *map(world.support, hands)], axis=0) > 0.0)
