"""The levels of the tree search: pose, sequence and path problems of one sequence, each a relaxation of the next.

pose: the last configuration of a prefix under the constraints of the last switch only. sequence: the configurations at
all switches under the constraints of all; of an incomplete sequence (prefix_sequence) agents need not stop. path: every
slice; where paths must be collision-free, a path without collision constraints comes first (free_path). All are the
same `PathProblem` on fewer knots or constraints, so their costs are on one scale and none exceeds the next, as far as
each is solved: the problems are not convex and solutions are local minima.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from lgp.errors import LgpError
from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path.active_constraints import ActiveConstraints
from lgp.path.costs import Weights
from lgp.path.durations import LEAST_SECONDS, DurationSolver
from lgp.path.ergonomics import Ergonomics
from lgp.path.estimate import CostEstimate
from lgp.path.keyframes import PREFIX, PREFIX_TOLERANCE, Answer, KeyframeSolver, Solution
from lgp.path.paths import OPTIONS, PathSolver
from lgp.path.phases import Phases, switch_of
from lgp.path.problem import PathProblem
from lgp.search.records import BoundResult, Skeleton
from lgp.search.time_limit import time_is_up
from lgp.sqp.problem import SolverOptions
from reba.arrays import Array


class PathBounds:
    """The levels of a scene, as `lgp.search.tree_search.search` queries them; each problem is solved once.

    Args:
        ergonomics: the ergonomic cost, None to leave it out.
        initial_configuration: (nq,) [rad, m], of the world by default.
        slices: per phase, of the scene by default.
        options: of the path solver.
        reference: bounds of the same scene and initial configuration with another ergonomic cost, solved before: robots
            start from their motions there.
        collisions: whether paths are collision-free. Poses and sequences never are, which keeps them lower bounds; the
            path without collision constraints is one more level then.
        multi_start: whether sequences are solved from many starts, and collision-free paths that cost much more than
            the free path from other initial guesses too.
        prefixes: whether incomplete sequences have a finer level: fewer complete ones are solved then.
    """

    def __init__(
        self,
        world: World,
        ergonomics: Ergonomics | None = None,
        weights: Weights | None = None,
        initial_configuration: Array | None = None,
        slices: int | None = None,
        options: SolverOptions = OPTIONS,
        reference: PathBounds | None = None,
        collisions: bool = False,
        multi_start: bool = True,
        prefixes: bool = True,
    ) -> None:
        self.world, self.ergonomics, self.options = world, ergonomics, options
        # A prefix whose phases are as long as they are at first bounds nothing where they may be longer.
        self.collisions = collisions
        self.prefix_level = PREFIX if prefixes and world.scene.durations != "stretched" else ""
        self.weights = Weights.of(world.scene, slices) if weights is None else weights
        self.initial_configuration = (
            world.initial_configuration
            if initial_configuration is None
            else np.asarray(initial_configuration, dtype=float)
        )
        self.slices, self.reference = slices, reference
        self.keyframes = KeyframeSolver(
            self.problem,
            world,
            ergonomics,
            self.weights,
            self.initial_configuration,
            self.reference_solution,
            multi_start,
        )
        self.paths = PathSolver(self.keyframes, options, self.free_path, collisions=collisions, multi_start=multi_start)
        self._estimate = CostEstimate(world, ergonomics, self.weights, self.initial_configuration)
        self._results: dict[tuple[str, Skeleton], BoundResult] = {}
        self._improved: set[Skeleton] = set()

    @property
    def levels(self) -> tuple[str, ...]:
        """Names of the levels, coarse to fine."""
        return ("pose", "sequence", *(["free_path"] if self.collisions else []), "path")

    def is_lower_bound(self, level: str) -> bool:
        """Return True: dropping slices, switches and the stop at the end only ever lowers the cost.

        Not so of a problem whose phases have other durations than those of its path.
        """
        own = {"free": self.levels[1:], "stretched": self.levels[-1:]}
        return level in own.get(self.world.scene.durations, self.levels)

    def least_cost(self, actions: int) -> float:
        """Return what a number of further actions cost at least: their time, at the least score."""
        least = 0.0 if self.ergonomics is None else self.ergonomics.lower_bound
        rate = self.weights.ergonomics * least + self.weights.time
        return actions * (LEAST_SECONDS if self.free_durations else self.world.scene.phase_seconds) * rate

    def objects(self, action: Action) -> tuple[str, ...]:
        """Return the objects that an action acts on."""
        switch = switch_of(action)
        return (switch.object_name, switch.other) if switch.other else (switch.object_name,)

    def displaced(self, skeleton: Skeleton) -> tuple[tuple[str, str], ...]:
        """Return (object, hand that put it down last): one hand does not put a thing down twice for nothing."""
        switches = map(switch_of, skeleton)
        return tuple(sorted({s.object_name: s.hand for s in switches if s.action.attaches_to == "table"}.items()))

    @property
    def free_durations(self) -> bool:
        """Whether the durations of phases are unknowns."""
        return self.world.scene.durations == "free"

    def phases(self, skeleton: Skeleton, durations: tuple[float, ...] = ()) -> Phases:
        """Return a sequence laid out in time, with the durations of the scene by default."""
        return Phases.of(self.world.scene, skeleton, self.slices, durations)

    def problem(
        self,
        level: str,
        phases: Phases,
        stage: int = -1,
        active: ActiveConstraints | None = None,
    ) -> PathProblem:
        """Return the problem of a level: "pose", PREFIX, "sequence" or "path", the last one with active constraints.

        `stage` is the continuation stage of the ergonomic cost.
        """
        last = len(phases.switches) - 1
        return PathProblem(
            self.world,
            phases,
            knots={"pose": phases.ends[-1:], "path": None}.get(level, phases.ends),
            enforced=[last] if level == "pose" else None,
            stop=level not in ("pose", PREFIX),
            ergonomics=self.ergonomics,
            weights=self.weights,
            initial_configuration=self.initial_configuration,
            stage=stage,
            active=active,
        )

    def solve(
        self,
        level: str,
        skeleton: Skeleton,
        warm: BoundResult | None,
        limit: float = math.inf,
        *,
        thorough: bool = False,
    ) -> BoundResult:
        """Return the result of a level for a sequence; a stored one does not depend on the warm start it had.

        A collision-free path is given up where it turns out to cost `limit` or more, and where none is found from the
        first guess the others are left until it is asked for again with `thorough`, see `PathSolver`.
        """
        stored = self._results.get((level, skeleton))
        again = stored is not None and ((stored.given_up and stored.cost < limit) or (thorough and stored.postponed))
        if stored is not None and not again:
            return replace(stored, known=True, seconds=0.0)
        # The matrices are small: threads of the linear algebra cost more than they save, on a busy machine several
        # times what they save, and their number must not decide a result.
        with threadpool_limits(1):
            result = self._results[level, skeleton] = self._result(level, skeleton, warm, limit, thorough)
        return result

    def solution(self, level: str, skeleton: Skeleton) -> Solution | None:
        """Return the stored solution of a level, None where it is not solved or infeasible."""
        stored = self._results.get((level, skeleton))
        return stored.payload if stored is not None and isinstance(stored.payload, Solution) else None

    def reference_solution(self, level: str, skeleton: Skeleton) -> Solution | None:
        """Return the solution of a level under the other ergonomic cost, None without one."""
        return None if self.reference is None else self.reference.solution(level, skeleton)

    def free_path(self, phases: Phases, earlier: Solution | None) -> Answer:
        """Return the solution of the level "free_path", solved here where it is not stored."""
        result = self.solve("free_path", phases.actions, BoundResult(True, 0.0, payload=earlier))
        return result.payload, result.reason

    def improved(self, skeleton: Skeleton) -> Solution:
        """Return the stored path of a sequence, or one near it that is clearly cheaper, which is stored then.

        Only where bodies stay apart: paths that ignore them have many starts already. A path is tried once.

        Raises:
            LgpError: there is no stored path.
        """
        known = self.solution("path", skeleton)
        if known is None:
            raise LgpError(f"{skeleton}: no path is known; solve it first")
        if not (self.collisions and self.paths.multi_start) or skeleton in self._improved or time_is_up():
            return known
        with threadpool_limits(1):
            better = self.paths.improved(self.phases(skeleton, known.durations), known)
        if not time_is_up():
            self._improved.add(skeleton)
        stored = self._results["path", skeleton]
        cost = better.costs.total
        self._results["path", skeleton] = replace(stored, cost=cost, attained=cost, payload=better)
        return better

    def set_initial_guess(self, skeleton: Skeleton, keyframes: Array, variables: Array) -> None:
        """Let sequences of these actions start from keyframes (K, nq) [rad, m] and variables (nz,)."""
        self.keyframes.cache.store_motion(self.phases(skeleton), math.inf, keyframes, variables)

    def forget_paths(self) -> None:
        """Drop results of sequences and paths; the next search starts each from the best motion of its actions."""
        self._results = {key: result for key, result in self._results.items() if key[0] == "pose"}
        self._improved.clear()

    def _result(
        self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float, thorough: bool
    ) -> BoundResult:
        begin = time.perf_counter()
        phases = self.phases(skeleton, self._first_durations(skeleton, warm))
        earlier = warm.payload if warm is not None and isinstance(warm.payload, Solution) else None
        by_level = {
            "pose": self.keyframes.solve_pose,
            PREFIX: self._solve_switches(PREFIX),
            "sequence": self._solve_switches("sequence"),
            "free_path": self.paths.solve_free,
            "path": self._solve_collision_free(limit, thorough) if self.collisions else self.paths.solve_free,
        }
        solution, reason = by_level[level](phases, earlier)
        seconds = time.perf_counter() - begin
        if solution is None:
            conflict = infeasible_actions(skeleton) if level == "pose" else ()
            postponed = level == "path" and self.paths.has_guesses_left(skeleton)
            return BoundResult(False, math.inf, reason, conflict, seconds, postponed=postponed)
        if solution.given_up:
            return BoundResult(True, solution.costs.total, seconds=seconds, given_up=True)
        if self.free_durations and level != "pose":
            solution = self._durations(level).solve(phases, solution)
        cost = attained = solution.costs.total
        if level != "path" and not solution.result:
            # A cost that is not at its minimum bounds nothing; the bound of the level before stays true.
            cost = warm.cost if warm is not None and self.is_lower_bound("pose") else 0.0
        elif level == PREFIX:
            cost *= 1.0 - PREFIX_TOLERANCE
        one_each = phases.count == len(phases.actions)
        estimate = self._estimate.of(phases, solution.keyframes) if level == "pose" and one_each else None
        return BoundResult(True, cost, seconds=seconds, payload=solution, estimate=estimate, attained=attained)

    def _first_durations(self, skeleton: Skeleton, warm: BoundResult | None) -> tuple[float, ...]:
        """Return the durations that a problem starts with: those of what was solved before, () without them."""
        if self.world.scene.durations == "fixed":
            return ()
        count = sum(not action.together for action in skeleton)
        if warm is not None and isinstance(warm.payload, Solution) and len(warm.payload.durations) == count:
            return warm.payload.durations
        if not self.free_durations:
            return ()
        before = None if skeleton[-1].together else self.solution(PREFIX, skeleton[:-1])
        first = self.world.scene.phase_seconds
        return (first,) * count if before is None else (*before.durations, first)

    def _durations(self, level: str) -> DurationSolver:
        """Return the solver of the durations of a level."""
        if level in (PREFIX, "sequence"):
            return DurationSolver(
                self.world,
                lambda phases: self.problem(level, phases),
                lambda phases, solution: self.keyframes.solve_again(self.problem(level, phases), solution),
            )
        collision_free = self.collisions and level == "path"
        return DurationSolver(
            self.world,
            lambda phases: self.problem("path", phases),
            lambda phases, solution: self.paths.solve_again(phases, solution, collision_free=collision_free),
        )

    def _solve_collision_free(self, limit: float, thorough: bool) -> Callable[[Phases, Solution | None], Answer]:
        """Return the solver of the last level; what a path costs with other durations is not known before."""
        given = limit if self.world.scene.durations == "fixed" else math.inf
        return lambda phases, earlier: self.paths.solve_collision_free(phases, earlier, given, thorough=thorough)

    def _solve_switches(self, level: str) -> Callable[[Phases, Solution | None], Answer]:
        """Return the solver of a level with all switches, which goes on from the sequence before its last action."""

        def solve(phases: Phases, earlier: Solution | None) -> Answer:
            before = None if phases.actions[-1].together else self.solution(PREFIX, phases.actions[:-1])
            return self.keyframes.solve_sequence(phases, earlier, level, before)

        return solve


def infeasible_actions(skeleton: tuple[Action, ...]) -> Skeleton:
    """Return the consecutive actions whose geometry alone makes the last pose infeasible, () if all before matter.

    Whether a hand can put an object on a table, or two hands meet at it, depends on no earlier action; whether a hand
    can take or hold the object on a table depends on the table only.
    """
    switch = switch_of(skeleton[-1])
    if switch.action.conflict_scope == "action":
        return skeleton[-1:]
    if switch.action.conflict_scope != "table" or len(skeleton) < 2:
        return ()
    before = switch_of(skeleton[-2])
    placed = before.action.attaches_to == "table" and before.object_name == switch.object_name
    return skeleton[-2:] if placed else ()
