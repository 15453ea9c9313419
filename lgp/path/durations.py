"""Durations of phases as unknowns: quasi-Newton steps on their logarithms, each followed by a warm-started path.

No constraint depends on time, so the derivative of the least cost by the durations is that of the cost of the path
alone (envelope theorem). Its curvature starts as that of a path that does not change (9 times accelerations, which fall
with the third power, plus what grows with time) and is corrected by BFGS updates (Nocedal & Wright 2006, eq. 6.19) for
what the path gives. Each duration is long enough for the speeds of its path and for an action of a person.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from lgp.kinematics.world import World
from lgp.path.joint_speeds import needed_durations, speed_limits
from lgp.path.keyframes import Solution
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.search.time_limit import time_is_up
from reba.arrays import Array

SHARE_OF_SPEED: Final = 0.8
"""Share of the speed limits that a plan uses (a choice): the rest is for a controller."""
LEAST_SECONDS: Final = 0.5
"""[s] Shortest action: reach 30 cm and grasp take 0.53 s by MTM-1 (R30B 12.8 and G1A 2.0 TMU of 0.036 s)."""
LONGEST_SECONDS: Final = 600.0
"""[s] Longest action, as in scenes."""
ROUNDS: Final = 12
"""Paths solved for one set of durations, at most."""
DECREASE: Final = 1e-5
"""Predicted decrease of the cost, relative to it, that ends the rounds."""
LONGEST_STEP: Final = 0.7
"""Largest change of the logarithm of a duration in one round: by a factor of 2."""

Resolve = Callable[[Phases, Solution], Solution | None]
"""Durations, solution for other durations -> solution for these, None without one."""


def least_durations(limits: Array, start: Array, path: Array, slices: int) -> Array:
    """Return the shortest duration of each phase [s], (K,), of a path (T, nq) that starts from (nq,)."""
    return np.maximum(needed_durations(limits, start, path, slices) / SHARE_OF_SPEED, LEAST_SECONDS)


class DurationSolver:
    """Minimises over the durations of the phases of a sequence.

    Args:
        problem_of: phases -> problem of the level.
        resolve: solves the level again for other durations.
    """

    def __init__(self, world: World, problem_of: Callable[[Phases], PathProblem], resolve: Resolve) -> None:
        self.limits, self.problem_of, self.resolve = speed_limits(world), problem_of, resolve

    def solve(self, phases: Phases, solution: Solution) -> Solution:
        """Return the solution with the best durations found, from a solution with those of the phases."""
        logs, hessian = np.log(phases.phase_durations), np.zeros((0, 0))
        solution, slope, lowest = self._evaluate(phases, solution)
        for _ in range(ROUNDS):
            if not len(hessian):
                hessian = self._first_curvature(phases, solution)
            step = bounded_step(hessian, slope, lowest - logs)
            predicted = -float(slope @ step + 0.5 * step @ hessian @ step)
            too_fast = bool((lowest > logs + 1e-9).any())
            if (predicted < DECREASE * solution.costs.total or time_is_up()) and not too_fast:
                break
            durations = np.maximum(np.exp(logs + step), LEAST_SECONDS)
            trial_phases = replace(phases, durations=tuple(durations.tolist()))
            warm = self.resolve(trial_phases, solution)
            if warm is None:
                hessian = 4.0 * hessian
                continue
            trial, trial_slope, trial_lowest = self._evaluate(trial_phases, warm)
            if trial.costs.total > solution.costs.total and not too_fast:
                hessian = 4.0 * hessian
                continue
            hessian = bfgs(hessian, step, trial_slope - slope)
            phases, logs = trial_phases, logs + step
            solution, slope, lowest = trial, trial_slope, trial_lowest
        return self._slowed(phases, solution, lowest)

    def _evaluate(self, phases: Phases, solution: Solution) -> tuple[Solution, Array, Array]:
        """Return the solution with the durations of its phases, its slope and the logarithm of the least durations."""
        problem = self.problem_of(phases)
        x, path = self._point(problem, solution)
        least = least_durations(self.limits, problem.initial_configuration, path, phases.slices)
        timed = replace(solution, durations=tuple(phases.phase_durations.tolist()))
        return timed, problem.slope_by_durations(x), np.log(least)

    def _first_curvature(self, phases: Phases, solution: Solution) -> Array:
        """Return the second derivative (K, K) for a path that does not change, phases apart."""
        problem = self.problem_of(phases)
        x, _ = self._point(problem, solution)
        rising = problem.running_by_phase(x) + problem.weights.time * phases.phase_durations
        accelerations = np.maximum((rising - problem.slope_by_durations(x)) / 3.0, 0.0)
        return np.diag(9.0 * accelerations + rising + 1e-9)

    def _slowed(self, phases: Phases, solution: Solution, lowest: Array) -> Solution:
        """Return the same path in phases that are long enough for its speeds."""
        longer = np.maximum(phases.phase_durations, np.exp(lowest))
        if (longer <= phases.phase_durations * (1.0 + 1e-9)).all():
            return solution
        slower = replace(phases, durations=tuple(longer.tolist()))
        problem = self.problem_of(slower)
        return replace(solution, durations=slower.durations, costs=problem.costs(self._point(problem, solution)[0]))

    @staticmethod
    def _point(problem: PathProblem, solution: Solution) -> tuple[Array, Array]:
        """Return the unknowns of a solution, and its path (T, nq)."""
        x = problem.join(solution.keyframes if solution.path is None else solution.path, solution.variables)
        return x, problem.path(x)


def bounded_step(hessian: Array, slope: Array, lower: Array) -> Array:
    """Return the step of least quadratic model that is not below `lower` (K,) nor longer than allowed.

    >>> bounded_step(np.diag([2.0, 2.0]), np.array([1.0, -1.0]), np.array([-0.1, -0.1])).tolist()
    [-0.1, 0.5]
    """
    from scipy.optimize import lsq_linear

    low = np.clip(lower, -LONGEST_STEP, LONGEST_STEP)
    # The model is the square of the distance to its minimum, in the metric of the Hessian.
    root = np.linalg.cholesky(hessian).T
    high = np.full(len(slope), LONGEST_STEP)
    if (high - low < 1e-12).all():
        return low
    target = -np.linalg.solve(root.T, slope)
    optimum = lsq_linear(root, target, bounds=(low, np.maximum(high, low + 1e-9)), method="bvls")
    return np.asarray(np.clip(optimum.x, low, high).round(15))


def bfgs(hessian: Array, step: Array, change: Array) -> Array:
    """Return the Hessian after a step and the change of the slope; the same where the curvature along it is not > 0.

    >>> bfgs(np.eye(2), np.array([1.0, 0.0]), np.array([3.0, 0.0])).tolist()
    [[3.0, 0.0], [0.0, 1.0]]
    """
    along, moved = float(step @ change), hessian @ step
    if along <= 1e-3 * float(step @ moved):
        return hessian
    return np.asarray(hessian - np.outer(moved, moved) / float(step @ moved) + np.outer(change, change) / along)
