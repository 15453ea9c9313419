"""Multi-bound tree search over sequences of actions (Toussaint & Lopes 2017), as best-first branch and bound.

A sequence is judged by problems of growing detail ("pose", "sequence", "path"), each a relaxation of the next: what is
infeasible at one level is infeasible at every later one and for every longer sequence, and where a level's cost is a
lower bound on the same scale, it also tells which sequences cannot beat the best path found so far. The search sees
neither kinematics nor costs: it asks a `Bounds` object.

    prefix -> first level -> extended or pruned;  goal reached -> next levels -> path -> incumbent

Until a first path is known the search dives: the node with the fewest actions left to the goal comes first. From then
on the lowest bound comes first, so that the search ends as soon as nothing open can beat the best path.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from lgp.logic.heuristic import relaxed_plan, why_unreachable
from lgp.logic.task import Action, Task

Skeleton = tuple[Action, ...]


@dataclass(frozen=True)
class BoundResult:
    """What one level says about one sequence.

    Attributes:
        feasible: whether its constraints can be met.
        cost: of its optimum, inf where infeasible.
        reason: why it is infeasible, for people.
        conflict: consecutive actions that are infeasible in any sequence, () if only this one is known to be.
        seconds: time it took.
        payload: whatever the level wants to hand on (a path, a warm start).
        known: whether it was answered from memory.
    """

    feasible: bool
    cost: float
    reason: str = ""
    conflict: Skeleton = ()
    seconds: float = 0.0
    payload: Any = None
    known: bool = False


class Bounds(Protocol):
    """The levels of a problem, coarse to fine; the last one is the problem itself."""

    @property
    def levels(self) -> tuple[str, ...]:
        """Names of the levels."""

    def solve(self, level: str, skeleton: Skeleton, warm: BoundResult | None) -> BoundResult:
        """Solve one level for a sequence; `warm` is the result of the level before."""

    def is_lower_bound(self, level: str) -> bool:
        """Whether the cost of a level never exceeds that of later levels and of longer sequences."""


class SearchStatus(Enum):
    """How a search ended; the text says what it means."""

    OPTIMAL = "no other sequence within the depth can cost less"
    GAP = "a plan was found; a budget ran out before the rest was excluded"
    INTERRUPTED = "interrupted; the best plan so far"
    INFEASIBLE = "no sequence within the depth is feasible"
    UNREACHABLE = "no sequence of actions reaches the goal"
    EXHAUSTED = "a budget ran out before a plan was found"


@dataclass(frozen=True)
class Budget:
    """What a search may spend.

    Attributes:
        depth: longest sequence.
        calls: level -> most problems solved; levels left out are not limited.
        seconds: wall-clock time; a search that ends by it is not repeatable.
    """

    depth: int = 6
    calls: Mapping[str, int] = field(default_factory=dict)
    seconds: float = math.inf


@dataclass
class Node:
    """One sequence in the searched tree.

    Attributes:
        number, parent: position in the tree; the root is 0 and has parent -1.
        action: last action, None at the root.
        skeleton: all actions.
        state: symbolic state after them.
        goal: whether the goal holds.
        left: estimated number of actions to the goal.
        costs: level -> cost found.
        bound: lower bound of any path through this node.
        verdict: "", "infeasible", "pruned" or "over budget".
        reason: why.
        result: the last level's result, kept for warm starts.
    """

    number: int
    parent: int
    action: Action | None
    skeleton: Skeleton
    state: int
    goal: bool
    left: int = 0
    costs: dict[str, float] = field(default_factory=dict)
    bound: float = 0.0
    verdict: str = ""
    reason: str = ""
    result: BoundResult | None = None


@dataclass(frozen=True)
class LevelStatistics:
    """Problems of one level: answered, of these infeasible and answered from memory, and seconds."""

    solved: int = 0
    infeasible: int = 0
    seconds: float = 0.0
    known: int = 0

    def plus(self, result: BoundResult, seconds: float) -> LevelStatistics:
        """Return the statistics with one more problem."""
        return LevelStatistics(
            self.solved + 1, self.infeasible + (not result.feasible), self.seconds + seconds, self.known + result.known
        )


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes:
        status: how it ended.
        skeleton, cost, payload: of the best path, () and inf where there is none.
        bound: no path within the depth can cost less than this.
        nodes: the searched tree.
        statistics: level -> what was solved.
        expanded, pruned: nodes extended, nodes cut off by bounds or known conflicts.
        seconds: wall-clock time.
        reason: why there is no plan.
    """

    status: SearchStatus
    skeleton: Skeleton
    cost: float
    payload: Any
    bound: float
    nodes: tuple[Node, ...]
    statistics: dict[str, LevelStatistics]
    expanded: int
    pruned: int
    seconds: float
    reason: str = ""

    @property
    def gap(self) -> float:
        """Relative distance between the plan and the bound; 0 where it is proved best, inf without a plan."""
        if not self.skeleton:
            return math.inf
        return max(0.0, self.cost - self.bound) / max(abs(self.cost), 1e-12)


def search(task: Task, bounds: Bounds, budget: Budget | None = None, first: Skeleton = ()) -> SearchResult:
    """Return the best sequence of actions for a task.

    The same task and bounds give the same result unless time runs out. An interrupt (Ctrl-C) ends the search with the
    best plan so far.

    Args:
        task: initial state, goal and actions.
        bounds: what judges sequences.
        budget: what may be spent.
        first: a sequence that is thought to be good; its path is the first one looked for, so that its cost prunes.
    """
    return _Search(task, bounds, budget or Budget(), first).run()


class _Search:
    def __init__(self, task: Task, bounds: Bounds, budget: Budget, first: Skeleton) -> None:
        self.task, self.bounds, self.budget, self.first = task, bounds, budget, first
        self.nodes = [Node(0, -1, None, (), task.initial, task.is_goal(task.initial))]
        self.waiting: dict[int, int] = {}
        self.by_bound: list[tuple[float, int, int, int]] = []
        self.by_distance: list[tuple[bool, int, int, float, int]] = []
        self.statistics = {level: LevelStatistics() for level in bounds.levels}
        self.conflicts: dict[Skeleton, str] = {}
        self.best: Node | None = None
        self.expanded = self.pruned = 0
        self.blocked = False
        self.start = time.perf_counter()

    def run(self) -> SearchResult:
        if relaxed_plan(self.task, self.task.initial) is None:
            return self._result(SearchStatus.UNREACHABLE, math.inf, why_unreachable(self.task))
        self._extend(self.nodes[0])
        try:
            while self.waiting:
                if time.perf_counter() - self.start > self.budget.seconds:
                    self.blocked = True
                    break
                node, level = self._pop()
                if self._beaten(node.bound):
                    self._prune(node, f"costs {node.bound:.4g} or more, the best path {self._incumbent():.4g}")
                else:
                    self._advance(node, level)
        except KeyboardInterrupt:
            return self._result(SearchStatus.INTERRUPTED, self._open_bound(), "interrupted")
        return self._finish()

    def _finish(self) -> SearchResult:
        if self.best is not None:
            status = SearchStatus.GAP if self.blocked else SearchStatus.OPTIMAL
            return self._result(status, self._open_bound() if self.blocked else self.best.bound)
        if self.blocked:
            return self._result(SearchStatus.EXHAUSTED, self._open_bound(), "the budget ran out")
        reasons = dict.fromkeys(node.reason for node in self.nodes if node.verdict == "infeasible")
        if not reasons:
            return self._result(
                SearchStatus.INFEASIBLE, math.inf, f"the goal needs more than {self.budget.depth} actions"
            )
        return self._result(SearchStatus.INFEASIBLE, math.inf, "; ".join(reasons))

    def _open_bound(self) -> float:
        """Return the lowest bound of everything that was not excluded."""
        waiting = [self.nodes[number].bound for number in self.waiting]
        return min([self._incumbent(), *waiting, *self._skipped_bounds()])

    def _skipped_bounds(self) -> list[float]:
        return [node.bound for node in self.nodes if node.verdict == "over budget"]

    def _incumbent(self) -> float:
        """Return the cost of the best path so far."""
        return math.inf if self.best is None else self.best.costs[self.bounds.levels[-1]]

    def _beaten(self, bound: float) -> bool:
        return self.best is not None and bound >= self._incumbent()

    def _push(self, node: Node, level: int) -> None:
        self.waiting[node.number] = level
        # Equal bounds: finer levels first, then shorter sequences.
        heapq.heappush(self.by_bound, (node.bound, -level, len(node.skeleton), node.number))
        aside = node.skeleton != self.first[: len(node.skeleton)]
        heapq.heappush(self.by_distance, (aside, node.left, -level, node.bound, node.number))

    def _pop(self) -> tuple[Node, int]:
        """Return the next node and its level: towards the goal until a path is known, then by bound."""
        while True:
            number = heapq.heappop(self.by_distance)[4] if self.best is None else heapq.heappop(self.by_bound)[3]
            # A node waits in both orders; the second meeting is stale.
            if number in self.waiting:
                return self.nodes[number], self.waiting.pop(number)

    def _advance(self, node: Node, level: int) -> None:
        """Solve one level of a node and decide what follows."""
        name = self.bounds.levels[level]
        known = self._known_conflict(node.skeleton)
        if known is not None:
            self._prune(node, known)
            return
        if self.statistics[name].solved >= self.budget.calls.get(name, math.inf):
            self.blocked, node.verdict, node.reason = True, "over budget", f"no {name} problem left"
            return
        result = self._solve(name, node)
        if not result.feasible:
            node.verdict, node.reason = "infeasible", result.reason or f"{name} is infeasible"
            if result.conflict:
                self.conflicts[result.conflict] = node.reason
            return
        node.result = result
        node.costs[name] = result.cost
        last = level == len(self.bounds.levels) - 1
        if last or self.bounds.is_lower_bound(name):
            node.bound = max(node.bound, result.cost)
        if last:
            if self.best is None or result.cost < self._incumbent():
                self.best = node
        elif node.goal:
            self._push(node, level + 1)
        if level == 0 and not node.goal:
            self._extend(node)

    def _solve(self, name: str, node: Node) -> BoundResult:
        start = time.perf_counter()
        parent = self.nodes[node.parent].result if node.result is None and node.parent >= 0 else node.result
        result = self.bounds.solve(name, node.skeleton, parent)
        self.statistics[name] = self.statistics[name].plus(result, time.perf_counter() - start)
        return result

    def _known_conflict(self, skeleton: Skeleton) -> str | None:
        for conflict, reason in self.conflicts.items():
            size = len(conflict)
            if any(skeleton[i : i + size] == conflict for i in range(len(skeleton) - size + 1)):
                return reason
        return None

    def _prune(self, node: Node, reason: str) -> None:
        self.pruned += 1
        node.verdict, node.reason = "pruned", reason

    def _extend(self, node: Node) -> None:
        """Add the children of a node that can still reach the goal within the depth."""
        self.expanded += 1
        visited = {self.task.initial}
        state = self.task.initial
        for action in node.skeleton:
            state = action.apply(state)
            visited.add(state)
        for action, after in self.task.successors(node.state):
            if after in visited:
                continue
            remaining = relaxed_plan(self.task, after)
            depth = len(node.skeleton) + 1
            if remaining is None or depth + remaining.layers > self.budget.depth:
                continue
            child = Node(
                len(self.nodes),
                node.number,
                action,
                (*node.skeleton, action),
                after,
                self.task.is_goal(after),
                left=len(remaining.actions),
                bound=node.bound,
            )
            self.nodes.append(child)
            self._push(child, 0)

    def _result(self, status: SearchStatus, bound: float, reason: str = "") -> SearchResult:
        best, last = self.best, self.bounds.levels[-1]
        return SearchResult(
            status=status,
            skeleton=best.skeleton if best else (),
            cost=best.costs[last] if best else math.inf,
            payload=best.result.payload if best and best.result else None,
            bound=bound,
            nodes=tuple(self.nodes),
            statistics=self.statistics,
            expanded=self.expanded,
            pruned=self.pruned,
            seconds=time.perf_counter() - self.start,
            reason=reason,
        )
