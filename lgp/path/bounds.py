"""The levels of the tree search: pose, sequence and path problems of one sequence, each a relaxation of the next.

pose: the last configuration of a prefix, held to the last switch only. sequence: the configurations at all switches,
held to all of them. path: every slice, and where bodies are to be kept apart, first without that (free_path). All are
the same `PathProblem` on fewer slices or rows, so their costs are on one scale and none exceeds the next - as far as
each is solved: problems are not convex, and solutions are local.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path.cache import WarmStartCache
from lgp.path.collision_constraints import CollisionRows
from lgp.path.collision_path import SUSPICIOUS, multi_start, settled, solve_collision_free
from lgp.path.costs import Costs, Weights
from lgp.path.ergonomics import Ergonomics
from lgp.path.feasibility import CLOSE, ReachCheck, explain_infeasibility, project_to_feasible
from lgp.path.phases import Phases, switch_of
from lgp.path.problem import PathProblem
from lgp.search.tree_search import BoundResult, Skeleton
from lgp.sqp.problem import SolverOptions
from lgp.sqp.result import Result
from lgp.sqp.solver import solve
from reba.arrays import Array

OPTIONS = SolverOptions(violation=1e-6, kkt=1e-5, decrease=1e-7, iterations=60)
"""Of paths: violations of a micrometre, costs to seven digits."""
RELAXED = replace(OPTIONS, violation=2e-5, kkt=1e-4, decrease=1e-6, longest_step=1.0)
"""Of sequences, which are bounds and first guesses; longer steps end in poorer minima."""
POSES = replace(RELAXED, longest_step=0.6, iterations=25)
"""Of poses, whose cost is seldom near that of a path: not worth many iterations."""
COARSE_OPTIONS = replace(OPTIONS, kkt=1e-3, decrease=1e-4, iterations=12)
"""Of paths at all stages of a graduated cost but the last, which only lead to the next."""
FINAL_OPTIONS = replace(OPTIONS, kkt=1e-4, decrease=1e-6, iterations=30)
"""Of paths at the last stage: its edges leave no smooth way to more digits, only ever shorter steps."""
SEQUENCE_ITERATIONS = 25
"""Iterations of a sequence with a graduated cost, for the same reason."""
NEARLY = 0.01
"""[m, rad] Violation left by a spent budget that is worth looking for a point near by without any."""
HOPELESS = 0.03
"""[m, rad] A pose whose nearest point violates its constraints by more is refused without asking the solver."""
RESTARTS = 3
"""Starts before a pose or a sequence counts as infeasible, random ones from a fixed seed after the first."""
RESTART_RADII = (0.15, 0.15, 0.3, 0.5)
"""How far the random starts of a sequence go from what is known towards anywhere."""


@dataclass(frozen=True)
class Solution:
    """What a level hands on.

    Attributes:
        keys: (k, nq) configurations at the switches so far.
        variables: (nz,) of grasps and placements; empty at the level "pose".
        path: (T, nq), at the levels "free_path" and "path" only.
        costs: terms of the cost.
        result: of the solver.
    """

    keys: Array
    variables: Array
    path: Array | None
    costs: Costs
    result: Result


class PathBounds:
    """The levels of a scene, as `lgp.search.tree_search.search` asks for them.

    Args:
        world: the kinematics.
        ergonomics: the ergonomic cost, None to leave it out.
        weights: of the terms.
        start: (nq,) first configuration, of the world by default.
        slices: per phase, of the scene by default.
        options: of the solver.
        like: bounds of the same scene and start with another ergonomic cost, solved before: robots start from their
            motions there.
        collisions: whether paths keep bodies apart. The levels before never do, which keeps them lower bounds; a path
            that need not is one more level then.
        detours: whether paths that cost much more with bodies apart are tried from other starts too.
    """

    def __init__(
        self,
        world: World,
        ergonomics: Ergonomics | None = None,
        weights: Weights | None = None,
        start: Array | None = None,
        slices: int | None = None,
        options: SolverOptions = OPTIONS,
        like: PathBounds | None = None,
        collisions: bool = False,
        detours: bool = True,
    ) -> None:
        self.world, self.ergonomics, self.options = world, ergonomics, options
        self.collisions, self.detours = collisions, detours
        self.weights = Weights() if weights is None else weights
        self.start = world.initial_configuration if start is None else np.asarray(start, dtype=float)
        self.slices, self.like = slices, like
        self._stretch = ReachCheck(world)
        self._known: dict[tuple[str, Skeleton], BoundResult] = {}
        self._memory = WarmStartCache(world)

    @property
    def levels(self) -> tuple[str, ...]:
        """Names of the levels, coarse to fine."""
        return ("pose", "sequence", *(["free_path"] if self.collisions else []), "path")

    def is_lower_bound(self, level: str) -> bool:
        """Return True: dropping slices, switches and the stop at the end only ever lowers the cost."""
        return level in self.levels

    def phases(self, skeleton: Skeleton) -> Phases:
        """Return a sequence laid out in time."""
        return Phases.of(self.world.scene, skeleton, self.slices)

    def problem(self, level: str, phases: Phases, stage: int = -1, apart: CollisionRows | None = None) -> PathProblem:
        """Return the problem of a level.

        Args:
            level: "pose", "sequence" or "path".
            phases: the sequence.
            stage: of the ergonomic cost.
            apart: rows that keep bodies apart, at the level "path" only.
        """
        last = phases.count - 1
        return PathProblem(
            self.world,
            phases,
            kept={"pose": phases.keys[-1:], "sequence": phases.keys, "path": None}[level],
            enforced=[last] if level == "pose" else None,
            stop=level != "pose",
            ergonomics=self.ergonomics,
            weights=self.weights,
            start=self.start,
            stage=stage,
            apart=apart,
        )

    def solve(self, level: str, skeleton: Skeleton, warm: BoundResult | None) -> BoundResult:
        """Solve one level for a sequence, unless it was solved before: a warm start only says where to begin."""
        known = self._known.get((level, skeleton))
        if known is not None:
            return replace(known, known=True, seconds=0.0)
        found = self._known[level, skeleton] = self._solved(level, skeleton, warm)
        return found

    def _solved(self, level: str, skeleton: Skeleton, warm: BoundResult | None) -> BoundResult:
        begin = time.perf_counter()
        phases = self.phases(skeleton)
        earlier = warm.payload if warm is not None and isinstance(warm.payload, Solution) else None
        by_level = {
            "pose": self._pose,
            "sequence": self._sequence,
            "free_path": self._free_path,
            "path": self._path if self.collisions else self._free_path,
        }
        solution, why = by_level[level](phases, earlier)
        seconds = time.perf_counter() - begin
        if solution is None:
            conflict = _conflict(skeleton) if level == "pose" else ()
            return BoundResult(False, math.inf, why, conflict, seconds)
        cost = solution.costs.total
        if level != "path" and not solution.result:
            # Not at its minimum, the cost bounds nothing; what was known before still does.
            cost = warm.cost if warm is not None else 0.0
        return BoundResult(True, cost, seconds=seconds, payload=solution)

    def suggest(self, skeleton: Skeleton, keys: Array, variables: Array) -> None:
        """Let a sequence, and others of its actions, start from a motion: (K, nq) at the switches, (nz,) variables."""
        self._memory.keep(self.phases(skeleton), math.inf, keys, variables)

    def reconsider(self) -> None:
        """Forget sequences and paths, but not the best motions found: the next search starts everywhere from those."""
        self._known = {key: found for key, found in self._known.items() if key[0] == "pose"}

    def _pose(self, phases: Phases, earlier: Solution | None) -> tuple[Solution | None, str]:
        refused = self._stretch.refusal(phases)
        if refused:
            return None, refused
        before = np.zeros((0, self.world.nq)) if earlier is None else earlier.keys
        known = self._memory.pose(phases)
        if isinstance(known, str):
            return None, known
        if known is None:
            first = self._with_robots("pose", phases, self.start[None] if earlier is None else before[-1:])
            problem = self.problem("pose", phases)
            result, why = self._solve(problem, [first], POSES)
            if result is None:
                self._memory.refuse(phases, why)
                return None, why
            costs = problem.costs(result.x)
            without = replace(costs, ergonomics=costs.ergonomics - self._carried(phases))
            known = self._memory.note(phases, problem.split(result.x)[0], without, result)
        costs = known.costs
        if known.count != phases.count:
            # After more time the pose costs less: what is sure is the least score of every slice.
            least = 0.0 if self.ergonomics is None else self.ergonomics.floor
            costs = Costs(0.0, self.weights.ergonomics * phases.tau * phases.total * least)
        costs = replace(costs, ergonomics=costs.ergonomics + self._carried(phases))
        return Solution(np.concatenate([before, known.pose]), np.zeros(0), None, costs, known.result), ""

    def _with_robots(self, level: str, phases: Phases, keys: Array) -> Array:
        """Return configurations (P, nq) in which robots are where they were with the other cost, if that is known."""
        found = None if self.like is None else self.like._known.get((level, phases.actions))
        if found is None or not isinstance(found.payload, Solution):
            return keys
        keys = keys.copy()
        for name in self.world.scene.robots:
            columns = self.world.columns(name)
            keys[:, columns] = found.payload.keys[-len(keys) :, columns]
        return keys

    def _carried(self, phases: Phases) -> float:
        """Return what carried loads cost in the phases of a sequence."""
        if self.ergonomics is None:
            return 0.0
        return self.weights.ergonomics * phases.tau * float(self.ergonomics.payload(phases.loads()).sum())

    def _sequence(self, phases: Phases, earlier: Solution | None) -> tuple[Solution | None, str]:
        first = np.tile(self.start, (phases.count, 1))
        if earlier is not None and len(earlier.keys) == phases.count:
            first = self._with_robots("sequence", phases, earlier.keys)
        problem = self.problem("sequence", phases)
        known = self._memory.start(phases, self.start)
        starts = [first] if known is None else [problem.join(*known), first]
        options = RELAXED if self._stages == 1 else replace(RELAXED, iterations=SEQUENCE_ITERATIONS)
        result, why = self._solve(problem, starts, options)
        if result is None:
            return None, f"sequence: {why}"
        keys, variables = problem.split(result.x)
        self._memory.keep(phases, result.cost, keys, variables)
        return Solution(keys, variables, None, problem.costs(result.x), result), ""

    def _solve(self, problem: PathProblem, known: list[Array], options: SolverOptions) -> tuple[Result | None, str]:
        """Solve a problem on few slices from some starts; return the best success, or why there is none.

        Args:
            problem: the problem.
            known: starts, x (n,) or configurations (P, nq); others are drawn around the last one.
            options: of the solver.
        """
        best: Result | None = None
        failed: tuple[float, str] = (math.inf, "")
        sure, others = self._starts(known[-1])
        count = len(known) - 1 + len(sure)
        for number, candidate in enumerate([*known[:-1], *sure, *others]):
            if best is not None and number >= count:
                break
            result, left, why = self._attempt(problem, candidate, options)
            if result is None:
                failed = min(failed, (left, why))
            elif best is None or result.cost < best.cost:
                best = result
        return best, failed[1]

    def _attempt(
        self, problem: PathProblem, candidate: Array, options: SolverOptions
    ) -> tuple[Result | None, float, str]:
        """Solve from one start, x (n,) or configurations (P, nq): the result, or the violation left and why."""
        if candidate.ndim == 2:
            whole = len(candidate) == problem.phases.count
            keys = candidate if whole else np.broadcast_to(candidate[-1], (problem.phases.count, self.world.nq))
            candidate = problem.join(candidate, problem.modes.guess(keys))
        x, left = project_to_feasible(problem, candidate)
        if left > HOPELESS:
            return None, left, explain_infeasibility(problem, x)
        result = solve(problem, x, options=options)
        if result.violation <= CLOSE:
            return result, 0.0, ""
        if result.violation < NEARLY:
            x, left = project_to_feasible(problem, result.x)
            if left <= CLOSE:
                return replace(result, x=x, cost=problem.costs(x).total, equality=left, inequality=left), 0.0, ""
        return None, result.violation, explain_infeasibility(problem, result.x)

    def _free_path(self, phases: Phases, earlier: Solution | None) -> tuple[Solution | None, str]:
        if earlier is None or not len(earlier.variables):
            earlier, why = self._sequence(phases, earlier)
            if earlier is None:
                return None, why
        sequence = self.problem("sequence", phases)
        path = sequence.path(sequence.join(earlier.keys, earlier.variables))
        variables = earlier.variables
        result: Result | None = None
        options = self._options
        for stage in range(self._stages):
            problem = self.problem("path", phases, stage)
            # Scores get sharper from stage to stage; the multipliers of the last one start the next.
            wanted = options if stage == self._stages - 1 else COARSE_OPTIONS
            result = solve(problem, problem.join(path, variables), options=wanted, warm=result)
            path, variables = problem.split(result.x)
        if result is None:
            return None, "path: the cost has no stage to minimise"
        return self._judged(problem, result)

    def _path(self, phases: Phases, earlier: Solution | None) -> tuple[Solution | None, str]:
        if earlier is None or earlier.path is None:
            found = self.solve("free_path", phases.actions, BoundResult(True, 0.0, payload=earlier))
            if not found.feasible:
                return None, found.reason
            earlier = found.payload
        rows = CollisionRows(self.world, phases, self.start)
        plain = partial(self.problem, "path", phases)

        def make(given: CollisionRows) -> PathProblem:
            return plain(apart=given)

        near = self._judged(*solve_collision_free(make, rows, earlier.result, self._options))
        if not self.detours or _cost(near) <= SUSPICIOUS * earlier.costs.total:
            return near
        trial = multi_start(make, plain(), earlier.result, _cost(near), self._robots_like(phases))
        if trial is None:
            return near
        other = self._judged(*solve_collision_free(make, trial.rows, trial.result, self._options, solved=False))
        return min(near, other, key=_cost)

    def _robots_like(self, phases: Phases) -> Array | None:
        """Return the path (T, nq) of the same actions under the other cost, None where none is known."""
        known = None if self.like is None else self.like._known.get(("path", phases.actions))
        return known.payload.path if known is not None and isinstance(known.payload, Solution) else None

    def _judged(self, problem: PathProblem, result: Result) -> tuple[Solution | None, str]:
        x, left = result.x, result.violation
        if NEARLY > left > self.options.violation:
            # The budget ran out just before the constraints held: the nearest path that meets them is as good.
            x, left = project_to_feasible(problem, x, 0.5 * self.options.violation)
        if left > self.options.violation:
            return None, f"path: {explain_infeasibility(problem, x) or result.status.value}"
        path, variables = problem.split(x)
        return Solution(path[problem.phases.keys], variables, path, problem.costs(x), result), ""

    @property
    def _options(self) -> SolverOptions:
        """Settings of the last stage of a path."""
        options = self.options if self._stages == 1 else FINAL_OPTIONS
        return settled(options) if self.collisions else options

    @property
    def _stages(self) -> int:
        return 1 if self.ergonomics is None else len(self.ergonomics.stages)

    def _starts(self, first: Array) -> tuple[list[Array], list[Array]]:
        """Return the starts (P, nq) that are always tried, and random ones for when those fail.

        Where everybody starts elsewhere than at rest, a way by the posture at rest may end in a better one.
        """
        sure = [first]
        if self.ergonomics is not None and not np.allclose(self.start, self.world.initial_configuration):
            rested = first.copy()
            rested[:, self.ergonomics.columns] = self.world.initial_configuration[self.ergonomics.columns]
            sure.append(rested)
        rng = np.random.default_rng(0)
        lower, upper = self.world.lower, self.world.upper
        # A pose may be anywhere; of many at once each stray one spoils the rest.
        shares = RESTART_RADII if len(first) > 1 else [0.5] * (RESTARTS - 1)
        others = [first + share * (rng.uniform(lower, upper, first.shape) - first) for share in shares]
        return sure, others


def _cost(found: tuple[Solution | None, str]) -> float:
    return math.inf if found[0] is None else found[0].costs.total


def _conflict(skeleton: tuple[Action, ...]) -> Skeleton:
    """Return the consecutive actions whose geometry alone makes the last pose infeasible, () if all before matter.

    Whether a hand can put an object on a table, or two hands meet at it, depends on nothing before; whether a hand can
    take or hold the object on a table depends on the table only.
    """
    switch = switch_of(skeleton[-1])
    if switch.action.conflict_scope == "action":
        return skeleton[-1:]
    if switch.action.conflict_scope != "table" or len(skeleton) < 2:
        return ()
    before = switch_of(skeleton[-2])
    placed = before.action.attaches_to == "table" and before.object_name == switch.object_name
    return skeleton[-2:] if placed else ()
