"""In which order the open nodes of a search are taken: what they may cost, how far they are, what they cost at least.

The cost of a path through a prefix of d actions with l more to go is estimated as e (d + l) / d times the ratio of
paths and estimates on the paths solved so far, where e is the estimate of the prefix itself. Deferred actions come
last: on objects outside the goal, back to a symbolic state, and one of both orders of two independent actions.
"""

from __future__ import annotations

import heapq
import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Iterator

from lgp.logic.heuristic import relaxed_plan
from lgp.logic.task import Action, Task
from lgp.search.records import Bounds, Node, Skeleton


class OpenNodes:
    """The open nodes, in three orders at once.

    Args:
        task, bounds: of the search, to know which actions are deferred.
        first: a sequence whose prefixes come before all others.
        bound_of: lower bound of a node with those of its ancestors; it may rise and fall later.
    """

    def __init__(self, task: Task, bounds: Bounds, first: Skeleton, bound_of: Callable[[Node], float]) -> None:
        self._bounds, self._first, self._bound_of = bounds, first, bound_of
        self._goal_objects = goal_objects(task, bounds)
        self._nodes: dict[int, Node] = {}
        self._by_estimate: list[tuple[bool, int, float, int, int, int]] = []
        self._by_distance: list[tuple[bool, int, int, float, int]] = []
        self._by_bound: list[tuple[float, int, int, int]] = []
        self._ratios: dict[int, list[float]] = defaultdict(list)

    def __len__(self) -> int:
        return len(self._nodes)

    def __iter__(self) -> Iterator[Node]:
        return iter(self._nodes.values())

    def deferred(self, parent: Node, action: Action, revisits: bool) -> int:
        """Return the number of deferred actions after one more; `revisits`: whether it is back to a symbolic state."""
        objects = self._bounds.objects(action)
        outside = bool(objects) and self._goal_objects.isdisjoint(objects)
        before = parent.action
        swapped = before is not None and str(action) < str(before) and action.commutes_with(before)
        return parent.deferred + revisits + outside + swapped

    def estimate(self, node: Node) -> float:
        """Return what a path through a node may cost; an action not solved yet costs as much as those before it."""
        ratios = self._ratios[max(1, node.level)]
        depth = len(node.skeleton)
        scale = (depth + node.actions_left) / max(1, depth - (node.level == 0))
        return node.estimate * scale * (statistics.median(ratios) if ratios else 1.0)

    def learn(self, estimates: dict[int, float], cost: float) -> None:
        """Learn from a path how much the estimates of its levels, by number of the next level, differ from its cost."""
        for level, estimate in estimates.items():
            if estimate > 0.0:
                self._ratios[level].append(cost / estimate)
        self._by_estimate.clear()
        for node in self:
            self._push_estimate(node)

    def push(self, node: Node) -> None:
        """Add a node."""
        self._nodes[node.number] = node
        self._push_estimate(node)
        off_first, estimate = self._off_first(node), self.estimate(node)
        distance = (off_first, node.actions_left, -node.level, estimate, node.number)
        heapq.heappush(self._by_distance, distance)
        self._push_bound(node)

    def pop_by_estimate(self, limit: float = math.inf) -> Node | None:
        """Take the node of the lowest estimate below a limit, None without one."""
        while self._by_estimate:
            *_, estimate, _, level, number = heapq.heappop(self._by_estimate)
            if estimate < limit and self._is_open(number, level):
                return self._nodes.pop(number)
        return None

    def pop_by_distance(self) -> Node:
        """Take the node with the fewest estimated actions to the goal."""
        while True:
            *_, level, _, number = heapq.heappop(self._by_distance)
            if self._is_open(number, -level):
                return self._nodes.pop(number)

    def pop_by_bound(self) -> Node:
        """Take the node of the lowest bound."""
        while True:
            bound, level, _, number = heapq.heappop(self._by_bound)
            if self._is_open(number, -level):
                if self._bound_of(self._nodes[number]) <= bound:
                    return self._nodes.pop(number)
                self._push_bound(self._nodes[number])

    def _is_open(self, number: int, level: int) -> bool:
        """Whether an entry of an order is the latest of an open node."""
        return number in self._nodes and self._nodes[number].level == level

    def _off_first(self, node: Node) -> bool:
        return node.skeleton != self._first[: len(node.skeleton)]

    def _push_estimate(self, node: Node) -> None:
        entry = (
            self._off_first(node),
            node.deferred,
            self.estimate(node),
            -len(node.skeleton),
            node.level,
            node.number,
        )
        heapq.heappush(self._by_estimate, entry)

    def _push_bound(self, node: Node) -> None:
        # Equal bounds: finer levels first, then shorter sequences.
        heapq.heappush(self._by_bound, (self._bound_of(node), -node.level, len(node.skeleton), node.number))


def goal_objects(task: Task, bounds: Bounds) -> frozenset[str]:
    """Return what the goal names, and what a relaxed plan acts on to reach it."""
    named = {word for atom in task.holding(task.goal | task.goal_not) for word in atom.arguments}
    relaxed = relaxed_plan(task, task.initial)
    acted = (bounds.objects(action) for action in (relaxed.actions if relaxed else ()))
    return frozenset(named.union(*acted))
