"""Paths of a sequence on every slice: continuation over the stages of the cost, then constraint generation.

The free path is minimised stage after stage (numerical continuation, Nocedal & Wright 2006, 11.3), each stage
warm-started from the one before. A collision-free path starts from it (`collision_path`); where collision constraints
make it cost much more, other initial guesses are solved too. Joints that would be too fast are slowed down: by
constraints, or in longer phases. A path is accepted once its constraints hold within the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lgp.path.active_constraints import ActiveConstraints, MotionConstraints
from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.collision_path import (
    COMPARABLE_VIOLATION,
    DEARER,
    MULTI_START_RATIO,
    PLAUSIBLE_RATIO,
    UNSETTLED,
    Guess,
    ProblemOf,
    candidate_guesses,
    collision_options,
    disturbed_guesses,
    exceeds,
    multi_start,
    solve_constrained,
    solve_contacts,
)
from lgp.path.feasibility import nearest_feasible
from lgp.path.joint_constraints import JointConstraints
from lgp.path.joint_speeds import needed_durations, speed_limits, too_fast
from lgp.path.keyframes import NEARLY_FEASIBLE, Answer, KeyframeSolver, Solution
from lgp.path.leg_reach import LegConstraints
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.path.reasons import explain_infeasibility
from lgp.path.sampled_motion import Motion, sampled_motions
from lgp.search.records import Skeleton
from lgp.search.time_limit import time_is_up
from lgp.sqp.merit import violation_max
from lgp.sqp.problem import SolverOptions
from lgp.sqp.result import Result
from lgp.sqp.solver import solve
from reba.arrays import Array

OPTIONS = SolverOptions(violation=1e-6, kkt=1e-5, decrease=1e-7, iterations=60)
"""Paths: violations of a micrometre, costs to seven digits."""
COARSE_OPTIONS = replace(OPTIONS, kkt=1e-3, decrease=1e-4, iterations=12)
"""Paths at all continuation stages but the last, each the initial guess of the next."""
FINAL_OPTIONS = replace(OPTIONS, kkt=1e-4, decrease=1e-6, iterations=30)
"""Paths at the last stage, whose cost has edges: steps to more digits get ever shorter."""


CORRECTIONS = 3
"""Times that a path is moved to the nearest feasible one, each with what the last one turned out to break."""
DURATION_FACTORS = (1.0, 1.2, 1.5)
"""Durations that are tried in turn, in multiples of what the path that is too fast needs: contacts need time too."""
DIGITS = 13
"""Decimals of a path [rad, m]."""


@dataclass(frozen=True)
class _Guesses:
    """Other initial guesses of a path.

    Attributes:
        left: those that are not solved.
        contacts: result of `solve_contacts`.
        nearest: the path known without them.
        starts: of the free path.
    """

    left: Iterator[Guess]
    contacts: Result
    nearest: Answer
    starts: tuple[int, int]


class PathSolver:
    """Solves path problems of a scene, collision-free ones where `collisions` is set.

    Args:
        keyframes: solves the sequence a path starts from; gives problems and the reference.
        options: of a path without continuation stages.
        free_path: phases, sequence -> solution of the level "free_path", solved or stored.
        multi_start: whether an expensive collision-free path is solved from other initial guesses too.

    Attributes:
        limits_speeds: whether the speed limits of joints are constraints; not where durations follow from them.
        extends_phases: whether phases last longer where a joint would be too fast.
    """

    def __init__(
        self,
        keyframes: KeyframeSolver,
        options: SolverOptions,
        free_path: Callable[[Phases, Solution | None], Answer],
        *,
        collisions: bool,
        multi_start: bool,
    ) -> None:
        self.keyframes, self.free_path, self.multi_start = keyframes, free_path, multi_start
        self.collisions = collisions
        self.limits_speeds = keyframes.world.scene.durations == "fixed"
        self.extends_phases = keyframes.world.scene.durations == "stretched"
        self.tolerance = options.violation
        self._left: dict[Skeleton, _Guesses] = {}
        final = options if keyframes.stages == 1 else FINAL_OPTIONS
        self.options = collision_options(final) if collisions else final

    def solve_free(self, phases: Phases, earlier: Solution | None) -> Answer:
        """Return the path without collision constraints, from the sequence in `earlier` or one solved here."""
        if earlier is None or not len(earlier.variables):
            earlier, reason = self.keyframes.solve_sequence(phases, earlier)
            if earlier is None:
                return None, reason
        sequence = self.keyframes.problem("sequence", phases)
        begins = earlier.minima or (sequence.join(earlier.keyframes, earlier.variables),)
        answers = [self._solve_from(phases, sequence.path(x), sequence.split(x)[1], earlier.starts) for x in begins]
        return self._slow_enough(phases, min(answers, key=_cost), collision_free=False)

    def _slow_enough(self, phases: Phases, answer: Answer, *, collision_free: bool) -> Answer:
        """Return a path that keeps the limits of joints: near the given one, or in longer phases where these may be.

        Args:
            phases: in which the given path is too fast, if it is.
        """
        solution = answer[0]
        if solution is None or solution.path is None:
            return answer
        world, start = self.keyframes.world, self.keyframes.initial_configuration
        limited = self.limits_speeds or self.extends_phases
        reason = too_fast(world, phases, start, solution.path) if limited else ""
        if not reason:
            # Paths of the last level have these as rows; another one is only where the last level begins.
            last = collision_free or not self.collisions
            if not last or not self.active(phases, collision_free=False).add_violated(
                solution.path, solution.variables
            ):
                return answer
            kept = self.solve_again(phases, solution, collision_free=collision_free)
            return answer if kept is None else (replace(kept, durations=solution.durations), "")
        needed = needed_durations(speed_limits(world), start, solution.path, phases.slices)
        for factor in DURATION_FACTORS if self.extends_phases else (0.0,):
            longer = np.maximum(factor * needed, phases.phase_durations)
            given = replace(phases, durations=tuple(longer.tolist())) if self.extends_phases else phases
            slower = self.solve_again(given, solution, collision_free=collision_free)
            if slower is not None:
                return replace(slower, durations=given.durations), ""
        return None, f"path: {reason}"

    def _solve_from(self, phases: Phases, path: Array, variables: Array, starts: tuple[int, int]) -> Answer:
        """Return the free path nearest to a path (T, nq) with variables (nz,)."""
        result: Result | None = None
        stages = self.keyframes.stages
        for stage in range(stages):
            problem = self.keyframes.problem("path", phases, stage)
            options = self.options if stage == stages - 1 else COARSE_OPTIONS
            result = solve(problem, problem.join(path, variables), options=options, warm=result)
            path, variables = problem.split(result.x)
        if result is None:
            return None, "path: the ergonomic cost has no stage; expected 1 or more"
        return self.accept(problem, result, starts)

    def solve_collision_free(
        self, phases: Phases, earlier: Solution | None, limit: float = math.inf, *, thorough: bool = True
    ) -> Answer:
        """Return the collision-free path that starts from the free path, or a cheaper one from another guess.

        One that turns out to cost `limit` or more is given up: its solution says what it costs at least. Without
        `thorough` other guesses are left where the first one leads to no path; the next call goes on with them.
        """
        free, reason = (
            (earlier, "") if earlier is not None and earlier.path is not None else self.free_path(phases, earlier)
        )
        if free is None:
            return None, reason
        if free.durations:
            phases = replace(phases, durations=free.durations)
        nearest, reason = self._cheapest_collision_free(phases, free, limit, thorough)
        if nearest is not None and nearest.given_up:
            return nearest, ""
        if nearest is not None:
            nearest = replace(nearest, durations=free.durations)
        return self._slow_enough(phases, (nearest, reason), collision_free=True)

    def improved(self, phases: Phases, known: Solution, seed: int = 0) -> Solution:
        """Return the collision-free path from a slightly disturbed one where that is clearly cheaper, or the known."""
        problem = self.keyframes.problem("path", phases)
        path = known.keyframes if known.path is None else known.path
        guesses = disturbed_guesses(problem, path, known.variables, seed)
        given = _Guesses(guesses, known.result, (known, ""), known.starts)
        better = self._best_of(phases, given, math.inf, speeds=True)[0]
        return known if better is None or better is known else replace(better, durations=known.durations)

    def has_guesses_left(self, actions: Skeleton) -> bool:
        """Return whether no path of a sequence was found from the first guess, and the others are left."""
        return actions in self._left

    def _cheapest_collision_free(self, phases: Phases, free: Solution, limit: float, thorough: bool) -> Answer:
        problem_of = self.problem_of(phases)
        constraints = self.active(phases)
        limit = DEARER * (limit - (free.costs.total - free.costs.motion))
        if phases.actions in self._left:
            return self._from_guesses(phases, self._left.pop(phases.actions), limit)
        problem, contacts = solve_contacts(problem_of, constraints, free.result, cost_limit=limit)
        if exceeds(contacts, limit, UNSETTLED):
            return self._given_up(problem, contacts)
        if contacts.violation > COMPARABLE_VIOLATION:
            # Stuck in a table, say: no path to go on from.
            constraints, contacts = self.active(phases), free.result
        solved = solve_constrained(
            problem_of,
            constraints,
            contacts,
            self.options,
            solved=False,
            cost_limit=limit,
            unsettled=UNSETTLED,
            plausible=min(limit, PLAUSIBLE_RATIO * contacts.cost),
        )
        too_dear = exceeds(solved[1], limit, UNSETTLED)
        nearest = self._given_up(*solved) if too_dear else self.accept(*solved, free.starts)
        if not self.multi_start or _cost(nearest) <= MULTI_START_RATIO * contacts.cost:
            return nearest
        other = self.keyframes.reference("path", phases.actions)
        reference = None if other is None or other.path is None else (other.path, other.variables)
        problem = self.keyframes.problem("path", phases)
        known = problem.split(contacts.x)
        guesses = candidate_guesses(problem, *known, reference, lambda: self._sampled(phases))
        given = _Guesses(guesses, contacts, nearest, free.starts)
        if nearest[0] is None and not thorough:
            self._left[phases.actions] = given
            return nearest
        return self._from_guesses(phases, given, limit)

    def _from_guesses(self, phases: Phases, given: _Guesses, limit: float) -> Answer:
        """Return the cheaper of the known path and one from other guesses; those that time leaves are kept."""
        answer = self._best_of(phases, given, limit)
        if answer[0] is None and time_is_up():
            self._left[phases.actions] = given
        return answer

    def _best_of(self, phases: Phases, given: _Guesses, limit: float, *, speeds: bool | None = None) -> Answer:
        problem_of = self.problem_of(phases)
        candidate = multi_start(
            problem_of,
            lambda: self.active(phases, speeds=speeds),
            self.keyframes.problem("path", phases),
            given.contacts,
            given.left,
            _cost(given.nearest),
            limit,
        )
        if candidate is None:
            return given.nearest
        if exceeds(candidate.result, limit):
            return min(given.nearest, self._given_up(candidate.problem, candidate.result), key=_cost)
        cheaper = self.accept(
            *solve_constrained(problem_of, candidate.constraints, candidate.result, self.options, solved=False),
            given.starts,
        )
        return min(given.nearest, cheaper, key=_cost)

    def _sampled(self, phases: Phases) -> Iterator[Motion]:
        """Return collision-free motions by sampling, computed as they are asked for."""
        keyframes = self.keyframes
        constraints = self.collision_constraints(phases)
        return sampled_motions(
            phases, keyframes.initial_configuration, partial(keyframes.problem, "sequence"), constraints
        )

    def _given_up(self, problem: PathProblem, result: Result) -> Answer:
        """Return what is known of a path that costs more than one that is known: that it does."""
        path, variables = problem.split(result.x)
        keyframes = path[problem.phases.keyframes]
        return Solution(keyframes, variables, None, problem.costs(result.x), result, given_up=True), ""

    def solve_again(self, phases: Phases, earlier: Solution, *, collision_free: bool) -> Solution | None:
        """Return the path near one with other durations or limits of speed, None where it is not feasible."""
        problem = self.keyframes.problem("path", phases)
        path = earlier.keyframes if earlier.path is None else earlier.path
        begin = replace(earlier.result, x=problem.join(path, earlier.variables))
        active = self.active(phases, collision_free=collision_free, speeds=self.limits_speeds or self.extends_phases)
        solved = solve_constrained(self.problem_of(phases), active, begin, self.options, solved=False)
        return self.accept(*solved, earlier.starts)[0]

    def accept(self, problem: PathProblem, result: Result, starts: tuple[int, int] = (1, 1)) -> Answer:
        """Return the solution if its constraints hold within the tolerance, else None and the one that fails most."""
        x, violation = result.x, result.violation
        for _ in range(CORRECTIONS):
            if NEARLY_FEASIBLE > violation > self.tolerance:
                # The iterations ended just before the constraints held: the nearest feasible path costs as much.
                x, violation = nearest_feasible(problem, x, 0.5 * self.tolerance)
            active = problem.constraints.active
            if violation > self.tolerance or active is None or not active.add_violated(*problem.split(x)):
                break
            # A joint that rested at its limit no longer does, so that it passes the limit between two slices, say.
            problem = self.problem_of(problem.phases)(active)
            violation = violation_max(*problem.evaluate(x)[1:])
        if violation > self.tolerance:
            why = explain_infeasibility(problem, x) or "no motion keeps all constraints; try longer phases"
            return None, f"path: {why}"
        # Steps of 1e-310 rad are none: those who interpolate a path divide by them.
        path, variables = problem.split(np.clip(np.round(x, DIGITS), problem.lower, problem.upper))
        # Active constraints are found again by whoever starts from here.
        result = replace(result, y_in=result.y_in[: problem.constraints.always])
        return Solution(path[problem.phases.ends], variables, path, problem.costs(x), result, starts), ""

    def collision_constraints(self, phases: Phases) -> CollisionConstraints:
        """Return the collision constraints of a sequence, none active yet."""
        return CollisionConstraints(self.keyframes.world, phases, self.keyframes.initial_configuration)

    def active(self, phases: Phases, *, collision_free: bool = True, speeds: bool | None = None) -> MotionConstraints:
        """Return the constraints that may become active in a path, none active yet."""
        world, start = self.keyframes.world, self.keyframes.initial_configuration
        limited = self.limits_speeds if speeds is None else speeds
        return MotionConstraints(
            JointConstraints(world, phases, start, limits_speeds=limited),
            [LegConstraints(world, phases, start, one) for one in world.scene.humans.values() if one.legs == "solved"],
            self.collision_constraints(phases) if collision_free else None,
        )

    def problem_of(self, phases: Phases) -> ProblemOf:
        """Return active constraints -> path problem."""

        def make(active: ActiveConstraints) -> PathProblem:
            return self.keyframes.problem("path", phases, active=active)

        return make


def _cost(answer: Answer) -> float:
    return math.inf if answer[0] is None else answer[0].costs.motion
