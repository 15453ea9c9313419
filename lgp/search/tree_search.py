"""Multi-bound tree search over sequences of actions (Toussaint & Lopes 2017), as best-first branch and bound.

A sequence is bounded by problems of growing detail ("pose", "sequence", "path"), each a relaxation of the next: what is
infeasible at one level is infeasible at every later one and for every longer sequence, and where the cost of a level is
a lower bound on the same scale, sequences that cannot cost less than the incumbent are pruned. The search sees neither
kinematics nor costs: it queries a `Bounds` object.

    prefix -> first level -> extended or pruned;  goal reached -> next levels -> path -> incumbent

Until a first path is found the search is depth first: the node with the fewest estimated actions to the goal comes
first. From then on the lowest bound comes first, so that the search ends as soon as no open node can improve the
incumbent.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from lgp.logic.heuristic import relaxed_plan, why_unreachable
from lgp.logic.impossible import exclusive_goals, fewest_actions
from lgp.logic.task import Action, Task

Skeleton = tuple[Action, ...]


@dataclass(frozen=True)
class BoundResult:
    """Result of one level for one sequence.

    Attributes:
        cost: of its optimum, inf where infeasible.
        reason: why it is infeasible, one sentence.
        conflict: consecutive actions that are infeasible in any sequence, () if only this one is known to be.
        payload: input of the next level (a path, a warm start).
        known: whether it was solved before.
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
        """Return the result of a level for a sequence; `warm` is that of the level before."""

    def is_lower_bound(self, level: str) -> bool:
        """Whether the cost of a level is a lower bound of later levels and of longer sequences."""

    def displaced(self, skeleton: Skeleton) -> Hashable:
        """What a sequence changed that symbols do not tell: a thing put elsewhere on the same table.

        A symbolic state is visited again in one sequence only where this differs.
        """


class SearchStatus(Enum):
    """How a search ended, as a sentence."""

    OPTIMAL = "no other sequence within the depth can cost less"
    GIVEN = "the sequence was given; no other was planned"
    GAP = "a plan was found; a budget ran out before the rest was excluded"
    INTERRUPTED = "interrupted; the best plan so far"
    INFEASIBLE = "no sequence within the depth is feasible"
    UNREACHABLE = "no sequence of actions reaches the goal"
    EXHAUSTED = "a budget ran out before a plan was found"


@dataclass(frozen=True)
class Budget:
    """Limits of a search.

    Attributes:
        depth: longest sequence.
        calls: level -> maximum number of problems solved; other levels are not limited.
        seconds: wall-clock time [s]; a search that ends by it is not repeatable.
        keep_interrupted: an interrupt (Ctrl-C) ends the search with the best plan so far; otherwise it is raised.
    """

    depth: int = 6
    calls: Mapping[str, int] = field(default_factory=dict)
    seconds: float = math.inf
    keep_interrupted: bool = False


@dataclass
class Node:
    """One sequence in the searched tree.

    Attributes:
        number, parent: position in the tree; the root is 0 and has parent -1.
        action: last action of the skeleton, None at the root.
        state: symbolic state after all actions.
        actions_left: estimated number of actions to the goal.
        costs: level -> cost.
        bound: lower bound of any path through this node.
        verdict: "", "infeasible", "pruned" or "over budget"; `reason` says why in one sentence.
        result: of the last level, the warm start of the next.
    """

    number: int
    parent: int
    action: Action | None
    skeleton: Skeleton
    state: int
    goal: bool
    actions_left: int = 0
    costs: dict[str, float] = field(default_factory=dict)
    bound: float = 0.0
    verdict: str = ""
    reason: str = ""
    result: BoundResult | None = None


@dataclass(frozen=True)
class LevelStatistics:
    """Problems of one level: number solved, of these infeasible, and solved before (`known`); time [s]."""

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
    """Result of a search: skeleton, cost and payload of the best path, () and inf where there is none.

    Attributes:
        bound: lower bound on the cost of any path within the depth.
        statistics: level -> problems solved.
        expanded, pruned: nodes extended, nodes cut off by bounds or known conflicts.
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
        """Relative gap between cost and bound; 0 where the plan is proved optimal, inf without a plan."""
        if math.isinf(self.cost):
            return math.inf
        return max(0.0, self.cost - self.bound) / max(abs(self.cost), 1e-12)


def search(task: Task, bounds: Bounds, budget: Budget | None = None, first: Skeleton = ()) -> SearchResult:
    """Return the best sequence of actions for a task.

    The same task and bounds give the same result unless time runs out. The path of a promising sequence `first` is
    solved first, so that its cost prunes others.
    """
    return _Search(task, bounds, budget or Budget(), first).run()


def _why_impossible(task: Task) -> str:
    """Return why no sequence reaches the goal, as far as its atoms and pairs of them tell; "" if they do not."""
    if relaxed_plan(task, task.initial) is None:
        return why_unreachable(task)
    exclusive = exclusive_goals(task)
    return "" if exclusive is None else "{} and {} are never true together; change the goal".format(*exclusive)


class _Search:
    """State of one search: the tree, its open nodes in both orders, conflicts and the incumbent."""

    def __init__(self, task: Task, bounds: Bounds, budget: Budget, first: Skeleton) -> None:
        self.task, self.bounds, self.budget, self.first = task, bounds, budget, first
        self.nodes = [Node(0, -1, None, (), task.initial, task.is_goal(task.initial))]
        self.open: dict[int, int] = {}
        self.by_bound: list[tuple[float, int, int, int]] = []
        self.by_distance: list[tuple[bool, int, int, float, int]] = []
        self.statistics = {level: LevelStatistics() for level in bounds.levels}
        self.conflicts: dict[Skeleton, str] = {}
        self.incumbent: Node | None = None
        self.expanded = self.pruned = 0
        self.blocked = False
        self.start = time.perf_counter()

    def run(self) -> SearchResult:
        impossible = _why_impossible(self.task)
        if impossible:
            return self._result(SearchStatus.UNREACHABLE, math.inf, impossible)
        if self.nodes[0].goal:
            self.incumbent = self.nodes[0]
            self.incumbent.costs[self.bounds.levels[-1]] = 0.0
            return self._finish()
        self._extend(self.nodes[0])
        try:
            while self.open:
                if time.perf_counter() - self.start > self.budget.seconds:
                    self.blocked = True
                    break
                node, level = self._pop()
                if self._cannot_improve(node.bound):
                    self._prune(node, f"costs {node.bound:.4g} or more, the best path {self._best_cost():.4g}")
                else:
                    self._advance(node, level)
        except KeyboardInterrupt:
            if not self.budget.keep_interrupted:
                raise
            return self._result(SearchStatus.INTERRUPTED, self._open_bound(), "interrupted")
        return self._finish()

    def _finish(self) -> SearchResult:
        if self.incumbent is not None:
            status = SearchStatus.GAP if self.blocked else SearchStatus.OPTIMAL
            return self._result(status, self._open_bound() if self.blocked else self.incumbent.bound)
        if self.blocked:
            return self._result(SearchStatus.EXHAUSTED, self._open_bound(), "the budget ran out")
        reasons = dict.fromkeys(node.reason for node in self.nodes if node.verdict == "infeasible")
        if reasons:
            return self._result(SearchStatus.INFEASIBLE, math.inf, "; ".join(reasons))
        fewest = fewest_actions(self.task)
        if fewest is not None and fewest < 0:
            goal = " and ".join(map(str, self.task.holding(self.task.goal)))
            return self._result(SearchStatus.UNREACHABLE, math.inf, f"no sequence makes {goal} true together")
        needed = self.budget.depth + 1 if fewest is None else fewest
        reason = f"the goal needs at least {needed} actions, the depth is {self.budget.depth}; raise the depth"
        return self._result(SearchStatus.INFEASIBLE, math.inf, reason)

    def _open_bound(self) -> float:
        """Return the lowest bound of all sequences that were not excluded."""
        open_bounds = [self.nodes[number].bound for number in self.open]
        return min([self._best_cost(), *open_bounds, *self._skipped_bounds()])

    def _skipped_bounds(self) -> list[float]:
        return [node.bound for node in self.nodes if node.verdict == "over budget"]

    def _best_cost(self) -> float:
        """Return the cost of the incumbent, inf without one."""
        return math.inf if self.incumbent is None else self.incumbent.costs[self.bounds.levels[-1]]

    def _cannot_improve(self, bound: float) -> bool:
        return self.incumbent is not None and bound >= self._best_cost()

    def _push(self, node: Node, level: int) -> None:
        self.open[node.number] = level
        # Equal bounds: finer levels first, then shorter sequences.
        heapq.heappush(self.by_bound, (node.bound, -level, len(node.skeleton), node.number))
        off_first = node.skeleton != self.first[: len(node.skeleton)]
        heapq.heappush(self.by_distance, (off_first, node.actions_left, -level, node.bound, node.number))

    def _pop(self) -> tuple[Node, int]:
        """Return the next node and its level: depth first without an incumbent, then by bound."""
        while True:
            number = heapq.heappop(self.by_distance)[4] if self.incumbent is None else heapq.heappop(self.by_bound)[3]
            # A node is in both orders: skip it where it was taken from the other.
            if number in self.open:
                return self.nodes[number], self.open.pop(number)

    def _advance(self, node: Node, level: int) -> None:
        """Solve one level of a node; push, extend or close it."""
        name = self.bounds.levels[level]
        conflict = self._conflict_in(node.skeleton)
        if conflict is not None:
            self._prune(node, conflict)
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
            if self.incumbent is None or result.cost < self._best_cost():
                self.incumbent = node
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

    def _conflict_in(self, skeleton: Skeleton) -> str | None:
        for conflict, reason in self.conflicts.items():
            size = len(conflict)
            if any(skeleton[i : i + size] == conflict for i in range(len(skeleton) - size + 1)):
                return reason
        return None

    def _prune(self, node: Node, reason: str) -> None:
        self.pruned += 1
        node.verdict, node.reason = "pruned", reason

    def _extend(self, node: Node) -> None:
        """Add the children of a node from which the goal may be reached within the depth."""
        self.expanded += 1
        visited = set()
        state = self.task.initial
        for end, action in enumerate((*node.skeleton, None)):
            visited.add((state, self.bounds.displaced(node.skeleton[:end])))
            state = state if action is None else action.apply(state)
        for action, after in self.task.successors(node.state):
            if (after, self.bounds.displaced((*node.skeleton, action))) in visited:
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
                actions_left=len(remaining.actions),
                bound=node.bound,
            )
            self.nodes.append(child)
            self._push(child, 0)

    def _result(self, status: SearchStatus, bound: float, reason: str = "") -> SearchResult:
        best, last = self.incumbent, self.bounds.levels[-1]
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
