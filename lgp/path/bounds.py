"""The levels of the tree search: pose, sequence and path problems of one sequence, each a relaxation of the next.

pose: the last configuration of a prefix under the constraints of the last switch only. sequence: the configurations at
all switches under the constraints of all. path: every slice; where paths must be collision-free, a path without
collision constraints comes first (free_path). All are the same `PathProblem` on fewer knots or constraints, so their
costs are on one scale and none exceeds the next, as far as each is solved: the problems are not convex and solutions
are local minima.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.costs import Weights
from lgp.path.ergonomics import Ergonomics
from lgp.path.keyframes import Answer, KeyframeSolver, Solution
from lgp.path.paths import OPTIONS, PathSolver
from lgp.path.phases import Phases, switch_of
from lgp.path.problem import PathProblem
from lgp.search.tree_search import BoundResult, Skeleton
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
        multi_start: whether collision-free paths that cost much more than the free path are solved from other initial
            guesses too.
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
    ) -> None:
        self.world, self.ergonomics, self.options = world, ergonomics, options
        self.collisions = collisions
        self.weights = Weights.of(world.scene, slices) if weights is None else weights
        self.initial_configuration = (
            world.initial_configuration
            if initial_configuration is None
            else np.asarray(initial_configuration, dtype=float)
        )
        self.slices, self.reference = slices, reference
        self.keyframes = KeyframeSolver(
            self.problem, world, ergonomics, self.weights, self.initial_configuration, self.reference_solution
        )
        self.paths = PathSolver(self.keyframes, options, self.free_path, collisions=collisions, multi_start=multi_start)
        self._results: dict[tuple[str, Skeleton], BoundResult] = {}

    @property
    def levels(self) -> tuple[str, ...]:
        """Names of the levels, coarse to fine."""
        return ("pose", "sequence", *(["free_path"] if self.collisions else []), "path")

    def is_lower_bound(self, level: str) -> bool:
        """Return True: dropping slices, switches and the stop at the end only ever lowers the cost."""
        return level in self.levels

    def displaced(self, skeleton: Skeleton) -> tuple[tuple[str, str], ...]:
        """Return (object, hand that put it down last): one hand does not put a thing down twice for nothing."""
        switches = map(switch_of, skeleton)
        return tuple(sorted({s.object_name: s.hand for s in switches if s.action.attaches_to == "table"}.items()))

    def phases(self, skeleton: Skeleton) -> Phases:
        """Return a sequence laid out in time."""
        return Phases.of(self.world.scene, skeleton, self.slices)

    def problem(
        self,
        level: str,
        phases: Phases,
        stage: int = -1,
        collision_constraints: CollisionConstraints | None = None,
    ) -> PathProblem:
        """Return the problem of a level: "pose", "sequence" or "path", only the last one with collision constraints.

        `stage` is the continuation stage of the ergonomic cost.
        """
        last = phases.count - 1
        return PathProblem(
            self.world,
            phases,
            knots={"pose": phases.keyframes[-1:], "sequence": phases.keyframes, "path": None}[level],
            enforced=[last] if level == "pose" else None,
            stop=level != "pose",
            ergonomics=self.ergonomics,
            weights=self.weights,
            initial_configuration=self.initial_configuration,
            stage=stage,
            collision_constraints=collision_constraints,
        )

    def solve(self, level: str, skeleton: Skeleton, warm: BoundResult | None) -> BoundResult:
        """Return the result of a level for a sequence; a stored one does not depend on the warm start it had."""
        stored = self._results.get((level, skeleton))
        if stored is not None:
            return replace(stored, known=True, seconds=0.0)
        result = self._results[level, skeleton] = self._result(level, skeleton, warm)
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

    def set_initial_guess(self, skeleton: Skeleton, keyframes: Array, variables: Array) -> None:
        """Let sequences of these actions start from keyframes (K, nq) [rad, m] and variables (nz,)."""
        self.keyframes.cache.store_motion(self.phases(skeleton), math.inf, keyframes, variables)

    def forget_paths(self) -> None:
        """Drop results of sequences and paths; the next search starts each from the best motion of its actions."""
        self._results = {key: result for key, result in self._results.items() if key[0] == "pose"}

    def _result(self, level: str, skeleton: Skeleton, warm: BoundResult | None) -> BoundResult:
        begin = time.perf_counter()
        phases = self.phases(skeleton)
        earlier = warm.payload if warm is not None and isinstance(warm.payload, Solution) else None
        by_level = {
            "pose": self.keyframes.solve_pose,
            "sequence": self.keyframes.solve_sequence,
            "free_path": self.paths.solve_free,
            "path": self.paths.solve_collision_free if self.collisions else self.paths.solve_free,
        }
        solution, reason = by_level[level](phases, earlier)
        seconds = time.perf_counter() - begin
        if solution is None:
            conflict = infeasible_actions(skeleton) if level == "pose" else ()
            return BoundResult(False, math.inf, reason, conflict, seconds)
        cost = solution.costs.total
        if level != "path" and not solution.result:
            # A cost that is not at its minimum bounds nothing; the bound of the level before stays true.
            cost = warm.cost if warm is not None else 0.0
        return BoundResult(True, cost, seconds=seconds, payload=solution)


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
