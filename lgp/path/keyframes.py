"""Keyframes of a sequence: pose and sequence problems, solved by SQP from several initial guesses.

A pose problem has the configuration at the last switch as unknown, a sequence problem those at all switches. Each
guess is first projected to the constraints; where none leads to a feasible point, random restarts from a fixed seed
follow, so that the same scene gives the same result.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from lgp.kinematics.world import World
from lgp.path.cache import WarmStartCache
from lgp.path.costs import Costs, Weights
from lgp.path.ergonomics import Ergonomics
from lgp.path.feasibility import CLOSE, ReachCheck, project_to_feasible
from lgp.path.impossible_actions import impossible
from lgp.path.many_starts import ManyStarts
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.path.reasons import explain_infeasibility
from lgp.search.records import Skeleton
from lgp.sqp.problem import SolverOptions
from lgp.sqp.result import Result
from lgp.sqp.solver import solve
from reba.arrays import Array

SEQUENCE_OPTIONS = SolverOptions(violation=2e-5, kkt=1e-4, decrease=1e-6, longest_step=1.0, iterations=60)
"""Sequences are bounds and initial guesses: a violation of 20 um suffices; longer steps end in poorer minima."""
SEQUENCE_ITERATIONS = 25
"""Iterations of a sequence with a graduated cost, whose edges allow ever shorter steps only."""
PREFIX: Final = "prefix_sequence"
"""Level of incomplete sequences: the configurations at all their switches, under the constraints of all."""
PREFIX_OPTIONS = replace(SEQUENCE_OPTIONS, kkt=1e-3, decrease=1e-4, iterations=40)
"""The last digits of a bound exclude nothing."""
PREFIX_STARTS = 16
"""Random starts of a prefix: from one guess alone, where grips leave few ways to turn, its cost was a third above the
least, and no bound (a choice)."""
PREFIX_TOLERANCE = 2e-3
"""Share of its cost by which a prefix may be above its minimum (0.12 % seen in the toolbox): its bound is lower."""
POSE_OPTIONS = replace(SEQUENCE_OPTIONS, longest_step=0.6, iterations=25)
"""The cost of a pose is seldom near that of a path: not worth many iterations."""
NEARLY_FEASIBLE = 0.01
"""[m, rad] Violation at the end of the iterations up to which the nearest feasible point is computed."""
INFEASIBLE = 0.03
"""[m, rad] Violation of the projected guess beyond which the point is infeasible without asking the solver."""
RESTARTS = 3
"""Initial guesses before a pose counts as infeasible, random ones from a fixed seed after the first."""
RESTART_RADII = (0.15, 0.15, 0.3, 0.5)
"""Random guesses of a sequence: share of the way from the first guess to a random configuration."""

Answer = tuple["Solution | None", str]
"""A solution, or None and the reason why there is none."""
ProblemFactory = Callable[..., PathProblem]
"""(level, phases, stage=, active=) -> problem, see `PathBounds.problem`."""


@dataclass(frozen=True)
class Solution:
    """Solution of one level, the warm start of the next.

    Attributes:
        keyframes: (k, nq) configurations at the ends of the phases so far [rad, m].
        variables: (nz,) of grasps and placements; empty at the level "pose".
        path: (T, nq), at the levels "free_path" and "path" only.
        starts: number of starts of the sequence that agree with this one, and of all.
        minima: points (N,) of the sequence problem that paths start from; () for the keyframes alone.
        durations: of each phase [s], () where all take as long.
        given_up: whether the path is none yet, but known to cost this or more.
    """

    keyframes: Array
    variables: Array
    path: Array | None
    costs: Costs
    result: Result
    starts: tuple[int, int] = (1, 1)
    minima: tuple[Array, ...] = ()
    durations: tuple[float, ...] = ()
    given_up: bool = False


class KeyframeSolver:
    """Solves pose and sequence problems of a scene.

    Args:
        problem: makes the problem of a level.
        ergonomics: the ergonomic cost, None to leave it out.
        initial_configuration: (nq,) [rad, m].
        reference: level, actions -> solution under another ergonomic cost, whose robots' motions are initial guesses.
        many_starts: whether sequences are solved from random starts too.
    """

    def __init__(
        self,
        problem: ProblemFactory,
        world: World,
        ergonomics: Ergonomics | None,
        weights: Weights,
        initial_configuration: Array,
        reference: Callable[[str, Skeleton], Solution | None],
        many_starts: bool = True,
    ) -> None:
        self.many_starts = many_starts
        self.problem, self.world, self.ergonomics, self.weights = problem, world, ergonomics, weights
        self.initial_configuration, self.reference = initial_configuration, reference
        self.cache = WarmStartCache(world)
        self._reach = ReachCheck(world)

    @property
    def stages(self) -> int:
        """Number of continuation stages of the ergonomic cost, 1 without one."""
        return 1 if self.ergonomics is None else len(self.ergonomics.stages)

    def solve_pose(self, phases: Phases, earlier: Solution | None) -> Answer:
        """Return the keyframes of `earlier` and the pose at the last switch of a prefix, with its cost as a bound."""
        refusal = impossible(phases) or self._reach.refusal(phases)
        if refusal:
            return None, refusal
        before = np.zeros((0, self.world.nq)) if earlier is None else earlier.keyframes
        cached = self.cache.pose(phases)
        if isinstance(cached, str):
            return None, cached
        if cached is None:
            last = self.initial_configuration[None] if earlier is None else before[-1:]
            problem = self.problem("pose", phases)
            always, restarts = self._initial_guesses(self._with_robots("pose", phases, last))
            result, reason = self._solve(problem, always, restarts, POSE_OPTIONS)
            if result is None:
                self.cache.store_infeasible(phases, reason)
                return None, reason
            costs = problem.costs(result.x)
            without = replace(costs, ergonomics=costs.ergonomics - self._payload_cost(phases))
            cached = self.cache.store_pose(phases, problem.split(result.x)[0], without, result)
        costs = cached.costs
        if cached.count != phases.count:
            # With more phases before it the pose costs less: only the least score of every slice is certain.
            least = 0.0 if self.ergonomics is None else self.ergonomics.lower_bound
            duration = phases.tau * phases.total
            costs = Costs(0.0, self.weights.ergonomics * duration * least, self.weights.time * duration)
        costs = replace(costs, ergonomics=costs.ergonomics + self._payload_cost(phases), actions=phases.action_cost)
        return Solution(np.concatenate([before, cached.pose]), np.zeros(0), None, costs, cached.result), ""

    def solve_sequence(
        self, phases: Phases, earlier: Solution | None, level: str = "sequence", before: Solution | None = None
    ) -> Answer:
        """Return the keyframes of a sequence and the variables of its grasps and placements.

        Args:
            earlier: poses of the sequence.
            level: "sequence", or PREFIX, whose cost is a bound only: it is solved from fewer starts to fewer digits.
            before: keyframes of the sequence without its last action.
        """
        first = np.tile(self.initial_configuration, (phases.count, 1))
        if earlier is not None and len(earlier.keyframes) == phases.count:
            first = self._with_robots(level, phases, earlier.keyframes)
        problem = self.problem(level, phases)
        cached = self.cache.initial_guess(phases, self.initial_configuration)
        after = first if before is None else np.concatenate([before.keyframes, first[-1:]])
        if level == PREFIX:
            always, restarts = self._initial_guesses(after)
            if self.many_starts:
                solved = ManyStarts(problem, PREFIX_STARTS).minima(np.array([self._point(problem, always[0])]))
                restarts = [*always[:1], *restarts] if len(solved.points) else restarts
                always = [problem.join(*problem.split(x)) for x in solved.points[:1]] or always
            result, reason = self._solve(problem, always[:1], restarts, PREFIX_OPTIONS)
            if result is None:
                return None, f"sequence: {reason}"
            keyframes, variables = problem.split(result.x)
            return Solution(keyframes, variables, None, problem.costs(result.x), result), ""
        always, restarts = self._initial_guesses(first)
        guesses = [problem.join(*cached)] if cached is not None else []
        guesses += [self._point(problem, guess) for guess in [*always, *([] if before is None else [after])]]
        minima: list[Array] = []
        starts = (1, 1)
        if self.many_starts:
            solved = ManyStarts(problem).minima(np.array(guesses))
            minima, starts = [problem.join(*problem.split(x)) for x in solved.points], (solved.agreed, solved.starts)
        options = SEQUENCE_OPTIONS if self.stages == 1 else replace(SEQUENCE_OPTIONS, iterations=SEQUENCE_ITERATIONS)
        # The best minimum alone, unless it is not feasible to the last digit.
        result, reason = self._solve(
            problem, minima[:1] or guesses, [*minima[1:], *(guesses if minima else []), *restarts], options
        )
        if result is None:
            return None, f"sequence: {reason}"
        keyframes, variables = problem.split(result.x)
        self.cache.store_motion(phases, result.cost, keyframes, variables)
        return Solution(keyframes, variables, None, problem.costs(result.x), result, starts, tuple(minima)), ""

    def solve_again(self, problem: PathProblem, earlier: Solution) -> Solution | None:
        """Return the solution of a sequence problem near that of a similar one, None where it is not feasible."""
        x = problem.join(earlier.keyframes, earlier.variables)
        result = solve(problem, x, options=PREFIX_OPTIONS, warm=earlier.result)
        if result.violation > CLOSE:
            return None
        keyframes, variables = problem.split(result.x)
        return Solution(keyframes, variables, None, problem.costs(result.x), result)

    def _with_robots(self, level: str, phases: Phases, keyframes: Array) -> Array:
        """Return configurations (P, nq) whose robot joints are those of the reference solution, if there is one."""
        reference = self.reference(level, phases.actions)
        if reference is None:
            return keyframes
        keyframes = keyframes.copy()
        for name in self.world.scene.robots:
            columns = self.world.columns(name)
            keyframes[:, columns] = reference.keyframes[-len(keyframes) :, columns]
        return keyframes

    def _payload_cost(self, phases: Phases) -> float:
        """Return the payload cost of a sequence [score s], weighted."""
        if self.ergonomics is None:
            return 0.0
        return self.weights.ergonomics * phases.tau * float(self.ergonomics.payload(phases.loads()).sum())

    def _solve(
        self, problem: PathProblem, guesses: list[Array], restarts: list[Array], options: SolverOptions
    ) -> tuple[Result | None, str]:
        """Return the cheapest feasible result of the guesses, or None and the constraint that failed least.

        A guess is x (n,) or configurations (P, nq); restarts follow until one is feasible.
        """
        best: Result | None = None
        least: tuple[float, str] = (math.inf, "")
        for number, guess in enumerate([*guesses, *restarts]):
            if best is not None and number >= len(guesses):
                break
            result, violation, reason = self._solve_from(problem, guess, options)
            if result is None:
                least = min(least, (violation, reason))
            elif best is None or result.cost < best.cost:
                best = result
        return best, least[1]

    def _point(self, problem: PathProblem, guess: Array) -> Array:
        """Return x (n,) of configurations (P, nq), with variables that fit them; x is returned as it is."""
        if guess.ndim == 1:
            return guess
        phase_of = problem.phases.phase_of
        at_switches = guess[phase_of if len(guess) == problem.phases.count else np.full(len(phase_of), -1)]
        return problem.join(guess, problem.modes.guess(at_switches))

    def _solve_from(
        self, problem: PathProblem, guess: Array, options: SolverOptions
    ) -> tuple[Result | None, float, str]:
        """Return the result from a guess, x (n,) or configurations (P, nq), or None, the violation and the reason."""
        x, violation = project_to_feasible(problem, self._point(problem, guess))
        if violation > INFEASIBLE:
            return None, violation, explain_infeasibility(problem, x)
        result = solve(problem, x, options=options)
        if result.violation <= CLOSE:
            return result, 0.0, ""
        if result.violation < NEARLY_FEASIBLE:
            x, violation = project_to_feasible(problem, result.x)
            if violation <= CLOSE:
                cost = problem.costs(x).motion
                return replace(result, x=x, cost=cost, equality=violation, inequality=violation), 0.0, ""
        return None, result.violation, explain_infeasibility(problem, result.x)

    def _initial_guesses(self, first: Array) -> tuple[list[Array], list[Array]]:
        """Return the guesses (P, nq) that are always solved, and random restarts for when those fail.

        From another initial configuration than rest, a guess with the human at rest may end in a better minimum.
        """
        always = [first]
        if self.ergonomics is not None and not np.allclose(
            self.initial_configuration, self.world.initial_configuration
        ):
            rested = first.copy()
            rested[:, self.ergonomics.columns] = self.world.initial_configuration[self.ergonomics.columns]
            always.append(rested)
        rng = np.random.default_rng(0)
        lower, upper = self.world.lower, self.world.upper
        # Half way for one pose; of many keyframes at once a single far one spoils the others.
        radii = RESTART_RADII if len(first) > 1 else [0.5] * (RESTARTS - 1)
        return always, [first + radius * (rng.uniform(lower, upper, first.shape) - first) for radius in radii]
