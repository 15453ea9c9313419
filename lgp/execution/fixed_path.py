"""Path problems with prescribed joint motions and fixed variables: how objects lie in hands and on tables.

Later actions were planned for an object in the same grip, or at a given spot, so their motions stay valid. Hands that
hold a part when the sequence begins stand still until their next action, as hands that hold within it do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.path.collision_path import collision_options, solve_constrained
from lgp.path.keyframes import Answer, KeyframeSolver, Solution
from lgp.path.paths import PathSolver
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.search.records import Skeleton
from lgp.sqp.problem import SolverOptions
from lgp.sqp.solver import Solver
from reba.arrays import Array, Flags, Indices

SLACK = 1e-5
"""[m, rad] Half width of the bounds around a fixed value, so that bounds do not become equations."""
FIRST_STEP = 0.05
"""[rad, m] Largest change of an unknown of a planned motion before collision constraints are added."""
DECREASE = 2e-4
"""Predicted decrease of the cost, relative to it, that ends a solve during a run."""
ITERATIONS = 20
"""Iterations after which a path that started from the planned one is good enough, if its constraints hold."""


@dataclass(frozen=True)
class PrescribedMotion:
    """How some joints move during the first action: columns of q (k,), their values (slices, k) after its start."""

    columns: Indices
    values: Array


class FixedPathSolver(PathSolver):
    """A path solver that starts from planned motions where the free path is in collision; stops early, one start only.

    Attributes:
        planned_motions: sequence -> motion planned for it in another world (1 + T, nq) and its variables (nz,).
    """

    def __init__(
        self,
        keyframes: KeyframeSolver,
        options: SolverOptions,
        free_path: Callable[[Phases, Solution | None], Answer],
        *,
        collisions: bool,
        planned_motions: Mapping[Skeleton, tuple[Array, Array]],
    ) -> None:
        super().__init__(keyframes, options, free_path, collisions=collisions, multi_start=False)
        self.planned_motions = dict(planned_motions)
        self.limits_speeds = False  # a motion that is too fast is slowed down when it runs
        self.options = replace(
            self.options, decrease=max(self.options.decrease, DECREASE), kkt=max(self.options.kkt, DECREASE)
        )

    def solve_collision_free(
        self, phases: Phases, earlier: Solution | None, limit: float = math.inf, *, thorough: bool = True
    ) -> Answer:
        """Return the collision-free path from the planned motion, or from the free path where that gives none.

        A planned motion is used only where `earlier` is the free path, not where it is a sequence.
        """
        planned = self.planned_motions.get(phases.actions)
        if planned is None or earlier is None or earlier.path is None:
            return super().solve_collision_free(phases, earlier, limit, thorough=thorough)
        in_collision = self.collision_constraints(phases).add_violated(earlier.path, earlier.variables) > 0
        solution = self._adapted(phases, *planned)[0] if in_collision else None
        return (
            super().solve_collision_free(phases, earlier, limit, thorough=thorough)
            if solution is None
            else (solution, "")
        )

    def _adapted(self, phases: Phases, planned: Array, variables: Array) -> Answer:
        """Return the collision-free path from a planned one (1 + T, nq), moved to the initial configuration."""
        constraints = self.active(phases)
        fade = np.maximum(1.0 - np.arange(1, len(planned)) / phases.slices, 0.0)
        guess = planned[1:] + fade[:, None] * (self.keyframes.initial_configuration - planned[0])
        constraints.add_violated(guess, variables)
        problem_of = self.problem_of(phases)
        problem = problem_of(constraints)
        options = replace(collision_options(self.options), longest_step=FIRST_STEP, iterations=1)
        result = Solver(options).solve(problem, problem.join(guess, variables))
        limited = replace(self.options, iterations=min(ITERATIONS, self.options.iterations))
        return self.accept(*solve_constrained(problem_of, constraints, result, limited))


class FixedPathBounds(PathBounds):
    """The levels of a scene in which some variables and joints have given values.

    Args:
        fixed_variables: name of a variable, such as `0.box.yaw` -> value [m, rad].
        holding: hands that stay where they start until their next action.
        prescribed: motion of some joints during the first action.
        resting: columns of q that stay where they start in the first slice.
        planned_motions: see `FixedPathSolver`; the initial guess where the free path is in collision.
    """

    def __init__(
        self,
        *args: Any,
        fixed_variables: Mapping[str, float] | None = None,
        holding: Iterable[str] = (),
        prescribed: PrescribedMotion | None = None,
        resting: Indices | None = None,
        planned_motions: Mapping[Skeleton, tuple[Array, Array]] | None = None,
        **more: Any,
    ) -> None:
        super().__init__(*args, **more)
        paths = FixedPathSolver(
            self.keyframes,
            self.options,
            self.free_path,
            collisions=self.collisions,
            planned_motions=planned_motions or {},
        )
        self.paths, self.planned_motions = paths, paths.planned_motions
        self.fixed_variables = {} if fixed_variables is None else fixed_variables
        self.holding = {hand: np.flatnonzero(self.world.support(hand)) for hand in holding}
        self.prescribed = prescribed
        self.resting = np.zeros(0, np.intp) if resting is None else resting

    def problem(self, level: str, phases: Phases, *args: Any, **more: Any) -> PathProblem:
        """Return the problem of a level with narrow bounds around the given values; poses leave joints free."""
        problem = super().problem(level, phases, *args, **more)
        first = problem.n - problem.modes.size
        for at, name in enumerate(problem.modes.names, start=first):
            if name in self.fixed_variables:
                inside = np.clip(self.fixed_variables[name], problem.lower[at], problem.upper[at])
                _fix(problem, np.array([at]), inside)
        if level == "pose":
            return problem
        nq, initial = self.world.nq, self.initial_configuration
        for row, at in enumerate(problem.knots.tolist()):
            for hand, columns in self.holding.items():
                if at <= _first_action_of(phases, hand):
                    _fix(problem, row * nq + columns, initial[columns])
            if self.prescribed is not None and at < phases.slices:
                _fix(problem, row * nq + self.prescribed.columns, self.prescribed.values[at])
            if at == 0:
                _fix(problem, row * nq + self.resting, initial[self.resting])
        return problem


def _fix(problem: PathProblem, unknowns: Indices, values: Array) -> None:
    """Bound some unknowns to values within SLACK."""
    problem.lower[unknowns], problem.upper[unknowns] = values - SLACK, values + SLACK


def _first_action_of(phases: Phases, hand: str) -> int:
    """Return the slice of a hand's first action, the last slice if it has none."""
    acts = [number for number, switch in enumerate(phases.switches) if hand in switch.hands]
    return int(phases.keyframes[acts[0] if acts else -1])


OFF = 0.02
"""[rad] An arm with a joint farther from the plan than this does not move as planned."""


def holding_hands(modes: ModeSequence, number: int) -> tuple[str, ...]:
    """Return the hands that stand still during an action of a sequence: they hold a part until their next action."""
    hands = [hand for hand, since, end in modes.holding_intervals if since < number <= end]
    hands += [hand for hand, _, end in modes.held_at_first if number <= end]
    return tuple(dict.fromkeys(hands))


def planned_course(world: World, first: Array, planned: Array, hands: Sequence[str]) -> PrescribedMotion:
    """Return the planned motion of those robot arms that have no part in an action and start as planned.

    An arm moves as planned as a whole or not at all: some of its joints alone would take the hand to any place.

    Args:
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
