"""What a search asks, and what it finds: bounds of a sequence, budget, nodes of the tree, and the result."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from lgp.logic.task import Action

Skeleton = tuple[Action, ...]
"""Actions in order; those that are `together` end the same phase as the one before."""


@dataclass(frozen=True)
class BoundResult:
    """Result of one level for one sequence.

    Attributes:
        cost: of its optimum, inf where infeasible; where it is not at its minimum, a lower one that is known.
        reason: why it is infeasible, one sentence.
        conflict: consecutive actions that are infeasible in any sequence, () if only this one is known to be.
        payload: input of the next level (a path, a warm start).
        known: whether it was solved before.
        estimate: what a path through what is known by now may cost, no bound; `cost` where it is None.
        attained: cost of the point that was found, which the optimum does not exceed; `cost` where it is None.
        given_up: whether its solver stopped once it had seen that the cost is `cost` or more, and no solution is known.
        postponed: whether no solution was found yet, and the solver has more to try.
    """

    feasible: bool
    cost: float
    reason: str = ""
    conflict: Skeleton = ()
    seconds: float = 0.0
    payload: Any = None
    known: bool = False
    estimate: float | None = None
    attained: float | None = None
    given_up: bool = False
    postponed: bool = False


class Bounds(Protocol):
    """The levels of a problem, coarse to fine; the last one is the problem itself."""

    @property
    def levels(self) -> tuple[str, ...]:
        """Names of the levels."""

    @property
    def prefix_level(self) -> str:
        """Name of a finer level of sequences that are not complete, "" without one."""

    def solve(self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf) -> BoundResult:
        """Return the result of a level for a sequence; `warm` is that of the level before.

        A solver may give up a problem of the last level once it sees that it costs `limit` or more. One that has more
        to try, at length, postpones that until it is asked again with `thorough`, which not every solver has to know.
        """

    def is_lower_bound(self, level: str) -> bool:
        """Whether the cost of a level is a lower bound of later levels and of longer sequences."""

    def least_cost(self, actions: int) -> float:
        """Return what a number of further actions cost at least, whichever they are."""

    def objects(self, action: Action) -> tuple[str, ...]:
        """Return the objects that an action acts on."""

    def displaced(self, skeleton: Skeleton) -> Hashable:
        """What a sequence changed that symbols do not tell: a thing put elsewhere on the same table.

        A symbolic state is visited again in one sequence only where this differs.
        """


class SearchStatus(Enum):
    """How a search ended, as a sentence."""

    OPTIMAL = "no other sequence within the depth can cost less, by the local solutions of its bounds"
    GIVEN = "the sequence was given; no other was planned"
    CONCURRENT = "actions of one sequence at the same time; no other plan with concurrent actions was made"
    GAP = "a plan was found; a budget ran out before the rest was excluded"
    INTERRUPTED = "interrupted; the best plan so far"
    INFEASIBLE = "no sequence within the depth is feasible"
    UNREACHABLE = "no sequence of actions reaches the goal"
    EXHAUSTED = "a budget ran out before a plan was found"


@dataclass(frozen=True)
class SearchProgress:
    """What a search has found so far.

    Attributes:
        step: what is being done, such as "searching".
        sequences: number of sequences looked at, incomplete ones among them; `paths` of paths solved.
        cost: of the best path, inf without one.
        bound: lower bound on the cost of any path within the depth.
    """

    step: str
    sequences: int
    paths: int
    cost: float
    bound: float

    @property
    def gap(self) -> float:
        """Relative gap between cost and bound, inf without a path."""
        return relative_gap(self.cost, self.bound)


def relative_gap(cost: float, bound: float) -> float:
    """Return by which share a cost may be above the optimum; 0 where it is proved to be that, inf without a cost."""
    return math.inf if math.isinf(cost) else max(0.0, cost - bound) / max(abs(cost), 1e-12)


@dataclass(frozen=True)
class Budget:
    """Limits of a search.

    Attributes:
        depth: longest sequence.
        calls: level -> maximum number of problems solved; other levels are not limited.
        seconds: wall-clock time [s]; a search that ends by it is not repeatable.
        improving: wall-clock time [s] after which a search ends that has a plan.
        keep_interrupted: an interrupt (Ctrl-C) ends the search with the best plan so far; otherwise it is raised.
        on_progress: called with what is known so far, a few times a second between problems.
    """

    depth: int = 6
    calls: Mapping[str, int] = field(default_factory=dict)
    seconds: float = math.inf
    improving: float = math.inf
    keep_interrupted: bool = False
    on_progress: Callable[[SearchProgress], None] | None = None


@dataclass
class Node:
    """One sequence in the searched tree.

    Attributes:
        number, parent: position in the tree; the root is 0 and has parent -1.
        action: last action of the skeleton, None at the root.
        state: symbolic state after all actions.
        actions_left: estimated number of actions to the goal; `least_left` is a lower bound of it.
        deferred: number of its actions that are searched last: on objects outside the goal, back to a symbolic state,
            or independent of the one before and usually in the other order.
        level: number of the next level to solve; an incomplete sequence is extended after the first.
        costs: level -> cost.
        estimate: cost of a path through what is known of it, of its parent before the first level; not a bound.
        estimates: number of the next level -> estimate.
        bound: lower bound of any path through this node, by its own problems; those of its ancestors hold as well.
        attained: cost of the cheapest solution of a longer sequence; where it is below the bound, that is none.
        tightened: whether the finer level of incomplete sequences was solved.
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
    least_left: int = 0
    deferred: int = 0
    level: int = 0
    costs: dict[str, float] = field(default_factory=dict)
    estimate: float = 0.0
    estimates: dict[int, float] = field(default_factory=dict)
    bound: float = 0.0
    attained: float = math.inf
    tightened: bool = False
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
        """Return the statistics with one more problem; one that is postponed is counted when it is solved."""
        done = not result.postponed
        return LevelStatistics(
            self.solved + done,
            self.infeasible + (done and not result.feasible),
            self.seconds + seconds,
            self.known + (done and result.known),
        )


@dataclass(frozen=True)
class SearchResult:
    """Result of a search: skeleton, cost and payload of the best path, () and inf where there is none.

    Attributes:
        bound: lower bound on the cost of any path within the depth, as far as its problems are solved to their optimum.
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
        return relative_gap(self.cost, self.bound)
