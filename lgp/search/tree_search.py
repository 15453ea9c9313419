"""Multi-bound tree search over sequences of actions (Toussaint & Lopes 2017), as anytime branch and bound.

A sequence is bounded by problems of growing detail ("pose", "sequence", "path"), each a relaxation of the next: what is
infeasible at one level is infeasible at every later one and for every longer sequence, and where the cost of a level is
a lower bound on the same scale, sequences that cannot cost less than the incumbent are pruned. The search sees neither
kinematics nor costs: it queries a `Bounds` object.

    prefix -> first level -> extended or pruned;  goal reached -> next levels -> path -> incumbent

Good plans come first, then their proof. Nodes are taken by the estimated cost of a path through them, as long as one
may cost less than the incumbent; every few steps, and from then on, the lowest bound comes first. Before a node of the
lowest bound is taken further, it is bounded by the finer level of incomplete sequences, from the root on, so that one
problem bounds all nodes below.

Problems are solved locally, so a bound may be too high. Where a longer sequence costs less than the bound of a shorter
one, that bound is lowered to it, and what it excluded is open again.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress

from lgp.logic.heuristic import relaxed_plan, why_unreachable
from lgp.logic.impossible import exclusive_goals, fewest_actions
from lgp.logic.task import Task
from lgp.search.order import OpenNodes
from lgp.search.reasons import in_short, why_cut_short
from lgp.search.records import (
    BoundResult,
    Bounds,
    Budget,
    LevelStatistics,
    Node,
    SearchProgress,
    SearchResult,
    SearchStatus,
    Skeleton,
)
from lgp.search.time_limit import TimeIsUp, stopped_at_limit, time_is_up, time_limit

PATIENCE = 100
"""Nodes extended until a search without a plan goes depth first."""
PHASE = re.compile(r"phase \d+, (\w+)\(\d+, ")
"""The number of a phase in a reason."""
GRACE_SECONDS, GRACE_SHARE = 10.0, 0.1
"""[s] What the first path may take after the time limit, or that share of the limit where it is more."""
REPORT_EVERY = 0.2
"""[s] Least time between two reports of the progress."""
BOUND_EVERY = 4
"""Of so many steps one raises the lowest bound, once there is a plan."""


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
    """State of one search: the tree, its open nodes, conflicts and the incumbent."""

    def __init__(self, task: Task, bounds: Bounds, budget: Budget, first: Skeleton) -> None:
        self.task, self.bounds, self.budget = task, bounds, budget
        self.nodes = [Node(0, -1, None, (), task.initial, task.is_goal(task.initial))]
        self.open = OpenNodes(task, bounds, first, self._bound)
        levels = [*bounds.levels, *([bounds.prefix_level] if bounds.prefix_level else [])]
        self.statistics = {level: LevelStatistics() for level in levels}
        self.conflicts: dict[Skeleton, str] = {}
        self.postponed: list[Node] = []
        self.incumbent: Node | None = None
        self.expanded = self.pruned = self.steps = 0
        self.blocked = self.cut_short = False
        self.start = time.perf_counter()
        self.reported = -math.inf

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
            with time_limit(self.budget.seconds):
                with suppress(TimeIsUp):
                    while not self._time_is_up() and (self.open or self._reopen() or self.postponed):
                        self._report()
                        self._step()
                # What was cut short at the last problem proves nothing either.
                self.cut_short = self._time_is_up()
        except KeyboardInterrupt:
            if not self.budget.keep_interrupted:
                raise
            return self._result(SearchStatus.INTERRUPTED, self._open_bound(), "interrupted")
        return self._finish()

    def _time_is_up(self) -> bool:
        return time_is_up() or (self.incumbent is not None and self._improving_left() <= 0.0)

    def _improving_left(self) -> float:
        """Return how long [s] the search may go on with a plan."""
        return self.budget.improving - (time.perf_counter() - self.start)

    def _report(self) -> None:
        """Tell the progress where that is asked for, no more often than is read: its bound is over all nodes."""
        now = time.perf_counter()
        if self.budget.on_progress is None or now - self.reported < REPORT_EVERY:
            return
        self.reported = now
        paths = self.statistics[self.bounds.levels[-1]].solved
        known = SearchProgress("searching", len(self.nodes), paths, self._best_cost(), self._open_bound())
        self.budget.on_progress(known)

    def _finish(self) -> SearchResult:
        if self.incumbent is not None:
            status = SearchStatus.GAP if self.blocked or self.cut_short else SearchStatus.OPTIMAL
            return self._result(status, self._open_bound())
        if self.blocked or self.cut_short:
            reason = why_cut_short(self.budget.seconds if self.cut_short else None, self._reasons())
            return self._result(SearchStatus.EXHAUSTED, self._open_bound(), reason)
        if reasons := self._reasons():
            return self._result(SearchStatus.INFEASIBLE, math.inf, in_short(reasons))
        fewest = fewest_actions(self.task)
        if fewest is not None and fewest < 0:
            return self._result(
                SearchStatus.UNREACHABLE, math.inf, f"no sequence makes {self.task.goal_text} true together"
            )
        needed = self.budget.depth + 1 if fewest is None else fewest
        reason = f"the goal needs at least {needed} actions, the depth is {self.budget.depth}; raise the depth"
        return self._result(SearchStatus.INFEASIBLE, math.inf, reason)

    def _reasons(self) -> list[str]:
        """Return why sequences are infeasible or have no path yet, of an action that fails in many phases the first."""
        first: dict[str, str] = {}
        for node in (*self.postponed, *self.nodes):
            if node.verdict == "infeasible" or (node.reason and not node.verdict):
                first.setdefault(PHASE.sub(r"\1(", node.reason), node.reason)
        return list(first.values())

    def _step(self) -> None:
        """Take one node further; those whose solver has more to try come last."""
        if not self.open:
            left = self.postponed.pop(0)
            if self._still_open(left):
                self._advance(left, thorough=True)
            return
        if self.incumbent is None:
            by_estimate = self.expanded <= PATIENCE
            node = self.open.pop_by_estimate() if by_estimate else None
            self._advance(node or self.open.pop_by_distance())
            return
        self.steps += 1
        promising = self.open.pop_by_estimate(self._best_cost()) if self.steps % BOUND_EVERY else None
        node = promising or self.open.pop_by_bound()
        if not self._still_open(node):
            return
        loose = None if promising else next(self._not_tightened(node), None)
        if loose is None:
            self._advance(node)
        else:
            self._tighten(loose)
            self.open.push(node)

    def _still_open(self, node: Node) -> bool:
        """Prune a node that cannot improve the incumbent."""
        bound = self._bound(node)
        if bound < self._best_cost():
            return True
        dead = next((above for above in self._chain(node) if above.verdict == "infeasible"), None)
        self._prune(node, self._too_dear(bound) if dead is None else dead.reason)
        return False

    def _too_dear(self, bound: float) -> str:
        return f"costs {bound:.4g} or more, the best path {self._best_cost():.4g}"

    def _chain(self, node: Node) -> Iterator[Node]:
        """Yield a node and its ancestors, up to the root."""
        while True:
            yield node
            if node.parent < 0:
                return
            node = self.nodes[node.parent]

    def _bound(self, node: Node) -> float:
        """Return the lower bound of any path through a node, by its own problems and those of its ancestors."""
        return max(min(above.bound, above.attained) for above in self._chain(node))

    def _not_tightened(self, node: Node) -> Iterator[Node]:
        """Yield the incomplete sequences on the way to a node whose finer level is not solved, the shortest first."""
        name = self.bounds.prefix_level
        if name and self.statistics[name].solved < self.budget.calls.get(name, math.inf):
            for above in reversed(list(self._chain(node))):
                if above.level > 0 and not above.goal and not above.tightened:
                    yield above

    def _tighten(self, node: Node) -> None:
        """Bound all nodes below an incomplete sequence by its finer level."""
        node.tightened = True
        name = self.bounds.prefix_level
        result = self._solve(name, node)
        if not result.feasible:
            self._close(node, name, result)
            return
        rest = self.bounds.least_cost(node.least_left)
        node.costs[name] = result.cost
        self._correct(node, rest + (result.cost if result.attained is None else result.attained))
        node.bound = max(node.bound, rest + result.cost)

    def _correct(self, node: Node, attained: float) -> None:
        """Lower what turns out to be no bound: a sequence costs no less than each of its prefixes."""
        for above in self._chain(node):
            above.attained = min(above.attained, attained)

    def _reopen(self) -> bool:
        """Open again what was excluded by bounds that were lowered since."""
        for node in self.nodes:
            low = node.verdict == "pruned" and self._bound(node) < self._best_cost()
            if low and node.level < len(self.bounds.levels) and self._conflict_in(node.skeleton) is None:
                node.verdict, node.reason = "", ""
                self.pruned -= 1
                self.open.push(node)
        return len(self.open) > 0

    def _open_bound(self) -> float:
        """Return the lowest bound of all sequences that were not excluded."""
        skipped = (node for node in self.nodes if node.verdict == "over budget")
        left = (*self.open, *self.postponed, *skipped)
        return min([self._best_cost(), *map(self._bound, left)])

    def _best_cost(self) -> float:
        """Return the cost of the incumbent, inf without one."""
        return math.inf if self.incumbent is None else self.incumbent.costs[self.bounds.levels[-1]]

    def _advance(self, node: Node, *, thorough: bool = False) -> None:
        """Extend a node, or solve its next level."""
        conflict = self._conflict_in(node.skeleton)
        if conflict is not None:
            self._prune(node, conflict)
            return
        if node.level > 0 and not node.goal:
            self._extend(node)
            return
        name = self.bounds.levels[node.level]
        if self.statistics[name].solved >= self.budget.calls.get(name, math.inf):
            self.blocked, node.verdict, node.reason = True, "over budget", f"no {name} problem left"
            return
        result = self._solve(name, node, thorough=thorough)
        if result.postponed:
            node.reason = result.reason
            self.postponed.append(node)
            return
        if not result.feasible:
            self._close(node, name, result)
            return
        if result.given_up:
            node.level, node.bound = node.level + 1, max(node.bound, result.cost)
            self._prune(node, self._too_dear(result.cost))
            return
        node.result, node.costs[name], node.reason = result, result.cost, ""
        node.estimate = result.cost if result.estimate is None else result.estimate
        node.level += 1
        last = node.level == len(self.bounds.levels)
        if node.level > 1:
            self._correct(node, result.cost if result.attained is None else result.attained)
        if last or self.bounds.is_lower_bound(name):
            node.bound = max(node.bound, result.cost + self.bounds.least_cost(node.least_left))
        if not last:
            node.estimates[node.level] = node.estimate
            self.open.push(node)
            return
        self.open.learn(node.estimates, result.cost)
        if result.cost < self._best_cost():
            self.incumbent = node

    def _close(self, node: Node, name: str, result: BoundResult) -> None:
        """Exclude an infeasible sequence and all longer ones."""
        node.verdict, node.reason = "infeasible", result.reason or f"{name} is infeasible"
        node.bound = math.inf
        if result.conflict:
            self.conflicts[result.conflict] = node.reason

    def _solve(self, name: str, node: Node, *, thorough: bool = False) -> BoundResult:
        start = time.perf_counter()
        parent = self.nodes[node.parent].result if node.result is None and node.parent >= 0 else node.result
        more = {"thorough": True} if thorough else {}
        try:
            with ExitStack() as limits:
                if self.incumbent is not None:
                    limits.enter_context(time_limit(self._improving_left()))
                grace = max(GRACE_SECONDS, GRACE_SHARE * self.budget.seconds) if self.incumbent is None else 0.0
                limits.enter_context(stopped_at_limit(grace))
                result = self.bounds.solve(name, node.skeleton, parent, self._best_cost(), **more)
        except (KeyboardInterrupt, TimeIsUp):
            self.open.push(node)  # its bound is part of what is still open
            raise
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
        states = {state for state, _ in visited}
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
                least_left=remaining.layers,
                deferred=self.open.deferred(node, action, after in states),
                estimate=node.estimate,
            )
            self.nodes.append(child)
            self.open.push(child)

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
