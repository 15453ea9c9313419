"""The levels of a tree search for a family of persons: one sequence of actions and one set of places serves them all.

Each level is that of the single person, for every member: what is infeasible for one is infeasible for the family, and
the mean, or the largest, of lower bounds is a lower bound of the mean, or the largest, of costs. So the level at which
everyone has places of their own bounds the last one, where places are in common.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from lgp.experiments.common_places import CommonPlaces, common_variables
from lgp.logic.task import Action
from lgp.path.bounds import PathBounds
from lgp.path.keyframes import Answer, Solution
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.search.records import BoundResult, Skeleton
from lgp.sqp.problem import SolverOptions
from lgp.sqp.solver import solve
from reba.arrays import Array

OWN_PLACES: Final = "own_places"
"""Level of complete paths with places of each member's own."""
OPTIONS: Final = SolverOptions(violation=1e-6, kkt=1e-4, decrease=1e-6, iterations=40)
"""Of the problem with common places: costs to six digits."""


class MemberBounds(PathBounds):
    """The levels of one member; `places` (variable of a sequence -> value) fixes where things are put down."""

    places: Mapping[str, float] | None = None

    def problem(self, level: str, phases: Phases, *args: Any, **kwargs: Any) -> PathProblem:
        """Return the problem of a level, of a path with its fixed places."""
        problem = super().problem(level, phases, *args, **kwargs)
        if level == "path" and self.places is not None:
            for number, name in enumerate(problem.modes.names, problem.n - problem.modes.size):
                if name in self.places:
                    problem.lower[number] = problem.upper[number] = self.places[name]
        return problem

    def with_places(self, places: Mapping[str, float], phases: Phases, near: Solution, *, free: bool) -> Answer:
        """Return the path with fixed places near a solution.

        Args:
            free: leave out collision constraints also where paths are collision-free.
        """
        self.places = places
        try:
            if not free:
                return self.paths.solve_collision_free(phases, near)
            problem = self.problem("path", phases)
            path = near.keyframes if near.path is None else near.path
            result = solve(problem, problem.join(path, near.variables), options=self.options)
            return self.paths.accept(problem, result, near.starts)
        finally:
            self.places = None


class FamilyBounds:
    """The levels of a family, as `lgp.search.tree_search.search` queries them.

    Payloads are tuples with the result of each member, of the last level with their solutions.

    Args:
        members: name -> levels of the member, of the same scene but for the person.
        worst: whether the largest cost of a member is minimised instead of the mean.
    """

    def __init__(self, members: Mapping[str, MemberBounds], *, worst: bool) -> None:
        self.members, self.worst = dict(members), worst
        self._first = next(iter(self.members.values()))
        self.prefix_level = self._first.prefix_level
        self._results: dict[tuple[str, Skeleton], BoundResult] = {}

    @property
    def levels(self) -> tuple[str, ...]:
        """Names of the levels, coarse to fine."""
        return ("pose", "sequence", OWN_PLACES, "path")

    def is_lower_bound(self, level: str) -> bool:
        """Whether the cost of a level bounds those of later levels and longer sequences from below."""
        return level == OWN_PLACES or self._first.is_lower_bound(level)

    def least_cost(self, actions: int) -> float:
        """Return what a number of further actions cost at least."""
        return self._total([one.least_cost(actions) for one in self.members.values()])

    def objects(self, action: Action) -> tuple[str, ...]:
        """Return the objects that an action acts on."""
        return self._first.objects(action)

    def displaced(self, skeleton: Skeleton) -> tuple[tuple[str, str], ...]:
        """Return what a sequence changed that symbols do not tell."""
        return self._first.displaced(skeleton)

    def solve(self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf) -> BoundResult:
        """Return the result of a level for a sequence; each is solved once, whatever the limit."""
        stored = self._results.get((level, skeleton))
        if stored is not None:
            return replace(stored, known=True, seconds=0.0)
        begin = time.perf_counter()
        result = self._common(skeleton, warm) if level == "path" else self._each(level, skeleton, warm)
        result = self._results[level, skeleton] = replace(result, seconds=time.perf_counter() - begin)
        return result

    def _total(self, costs: Sequence[float]) -> float:
        return float(max(costs) if self.worst else np.mean(costs))

    def _each(self, level: str, skeleton: Skeleton, warm: BoundResult | None) -> BoundResult:
        """Return the result of a level of every member by itself."""
        free_path = "free_path" if self._first.collisions else "path"
        own_level = free_path if level == OWN_PLACES else level
        before: Sequence[BoundResult | None] = [None] * len(self.members)
        if warm is not None and warm.payload is not None:
            before = warm.payload
        results = []
        for (name, bounds), earlier in zip(self.members.items(), before, strict=True):
            result = bounds.solve(own_level, skeleton, earlier)
            if not result.feasible:
                return BoundResult(False, math.inf, f"{name}: {result.reason}", result.conflict)
            results.append(result)
        attained = [one.cost if one.attained is None else one.attained for one in results]
        estimates = [one.cost if one.estimate is None else one.estimate for one in results]
        return BoundResult(
            True,
            self._total([one.cost for one in results]),
            payload=tuple(results),
            attained=self._total(attained),
            estimate=self._total(estimates),
        )

    def _common(self, skeleton: Skeleton, warm: BoundResult | None) -> BoundResult:
        """Return the paths of all members with common places; where they must be collision-free, solved for these."""
        own = self._each(OWN_PLACES, skeleton, warm) if warm is None or warm.payload is None else warm
        alone: list[Solution] = [one.payload for one in own.payload]
        phases = [bounds.phases(skeleton) for bounds in self.members.values()]
        begin, reason = self._first_places(phases, alone)
        if not begin:
            return BoundResult(False, math.inf, reason)
        solutions = self._joint(phases, begin, worst=False)
        if self.worst:
            solutions = self._joint(phases, solutions, worst=True)
        if self._first.collisions:
            return self._collision_free(phases, solutions)
        return self._result(solutions)

    def _joint(self, phases: Sequence[Phases], begin: list[Solution], *, worst: bool) -> list[Solution]:
        """Return the paths with the best common places near paths with common places."""
        members = list(self.members.values())
        problems = [bounds.problem("path", own) for bounds, own in zip(members, phases, strict=True)]
        joint = CommonPlaces(problems, worst=worst)
        points = [p.join(_path(one), one.variables) for p, one in zip(problems, begin, strict=True)]
        result = solve(joint, joint.join(points), options=OPTIONS)
        solutions = []
        for bounds, problem, one, point in zip(members, problems, begin, joint.split(result.x), strict=True):
            _, equal, limits = problem.evaluate(point)
            violation = max(float(np.abs(equal).max(initial=0.0)), float(limits.max(initial=0.0)))
            own = replace(one.result, x=point, equality=violation, inequality=violation)
            answer, _ = bounds.paths.accept(problem, own, one.starts)
            if answer is None:
                return begin
            solutions.append(answer)
        before, after = (self._total([one.costs.total for one in solved]) for solved in (begin, solutions))
        return solutions if after < before else begin

    def _first_places(self, phases: Sequence[Phases], alone: Sequence[Solution]) -> tuple[list[Solution], str]:
        """Return paths with the places of one member, the one nearest to all others that serves them all."""
        common = self._places(phases[0])
        places = np.array([one.variables[list(common.values())] for one in alone])
        distance = np.linalg.norm(places[:, None] - places, axis=2).sum(axis=1)
        reason = ""
        for chosen in np.argsort(distance, kind="stable").tolist():
            other = alone[chosen]
            fixed = {name: float(other.variables[at]) for name, at in common.items()}
            solutions: list[Solution] = []
            for (name, bounds), own, near in zip(self.members.items(), phases, alone, strict=True):
                answer, why = bounds.with_places(fixed, own, _with_robots(bounds, near, other), free=True)
                if answer is None:
                    reason = reason or f"no place serves all: {name}: {why}"
                    break
                solutions.append(answer)
            if len(solutions) == len(alone):
                return solutions, ""
        return [], reason

    def _places(self, phases: Phases) -> dict[str, int]:
        """Return the common variables of a sequence with their numbers."""
        names = self._first.problem("path", phases).modes.names
        return {names[at]: int(at) for at in np.flatnonzero(common_variables(phases, names))}

    def _collision_free(self, phases: Sequence[Phases], solutions: Sequence[Solution]) -> BoundResult:
        fixed = {name: float(solutions[0].variables[at]) for name, at in self._places(phases[0]).items()}
        free: list[Solution] = []
        for (name, bounds), own, near in zip(self.members.items(), phases, solutions, strict=True):
            answer, why = bounds.with_places(fixed, own, near, free=False)
            if answer is None:
                return BoundResult(False, math.inf, f"{name}: {why}")
            free.append(answer)
        return self._result(free)

    def _result(self, solutions: Sequence[Solution]) -> BoundResult:
        return BoundResult(True, self._total([one.costs.total for one in solutions]), payload=tuple(solutions))


def _path(solution: Solution) -> Array:
    if solution.path is None:
        raise AssertionError("a complete path")
    return solution.path


def _with_robots(bounds: PathBounds, near: Solution, other: Solution) -> Solution:
    """Return a solution with the robots and variables of another member, a start for paths to that member's places."""
    path = _path(near).copy()
    for name in bounds.world.scene.robots:
        columns = bounds.world.columns(name)
        path[:, columns] = _path(other)[:, columns]
    return replace(near, path=path, variables=other.variables)
