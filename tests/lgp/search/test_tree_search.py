"""The tree search against exhaustive enumeration, on problems of random costs."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.logic.pddl import load_domain
from lgp.logic.task import Task, ground, parse_atom
from lgp.search.records import BoundResult, Budget, SearchResult, SearchStatus, Skeleton
from lgp.search.tree_search import search
from tests.support.random_bounds import RandomBounds
from tests.support.says import says

domain = cache(load_domain)
TABLES = ("left", "center", "right")


def task(hands: int = 2, start: tuple[str, ...] = ("free", "on_table")) -> Task:
    robots = {f"robot.{i}": "robot_hand" for i in range(hands)}
    objects = {"human": "human_hand", "tool": "thing", **robots, **dict.fromkeys(TABLES, "table")}
    initial = [f"free({hand})" for hand in ("human", *robots) if "free" in start]
    initial += ["on_table(tool)"] if "on_table" in start else []
    initial += ["placed(tool, left)"] if "placed" in start else []
    goal = [parse_atom("grasped(human, tool)")]
    return ground(domain("screwdriver"), objects, map(parse_atom, initial), goal)


def exhaustive(problem: Task, bounds: RandomBounds, depth: int) -> float:
    best = math.inf

    def visit(state: int, skeleton: Skeleton, seen: frozenset[int]) -> None:
        nonlocal best
        if problem.is_goal(state):
            best = min(best, bounds.solve("path", skeleton, None).cost)
            return
        if len(skeleton) < depth:
            for action, after in problem.successors(state):
                if after not in seen:
                    visit(after, (*skeleton, action), seen | {after})

    visit(problem.initial, (), frozenset({problem.initial}))
    return best


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.2, 0.6]), st.booleans(), st.sampled_from(["", "prefix"]))
def test_finds_the_optimum_and_proves_it(seed: int, infeasible: float, direct: bool, prefix_level: str) -> None:
    problem = task()
    bounds = RandomBounds(seed, infeasible, direct, prefix_level)
    result = search(problem, bounds, Budget(depth=5))
    truth = exhaustive(problem, RandomBounds(seed, infeasible, direct), 5)
    assert result.cost == pytest.approx(truth)
    if math.isfinite(truth):
        assert result.status is SearchStatus.OPTIMAL
        assert result.bound <= result.cost + 1e-12
        assert result.gap == 0.0
        assert problem.is_goal(end_state(problem, result.skeleton))
    else:
        assert result.status is SearchStatus.INFEASIBLE
        assert "cannot be reached" in result.reason


def end_state(problem: Task, skeleton: Skeleton) -> int:
    state = problem.initial
    for action in skeleton:
        assert action.applies(state)
        state = action.apply(state)
    return state


def test_solves_far_fewer_paths_than_there_are() -> None:
    problem, bounds = task(), RandomBounds(3, 0.1)
    result = search(problem, bounds, Budget(depth=5))
    paths = [skeleton for level, skeleton in bounds.calls if level == "path"]
    every = RandomBounds(3, 0.1)
    exhaustive(problem, every, 5)
    assert len(paths) == result.statistics["path"].solved
    assert len(paths) < len(every.calls) / 4
    assert result.pruned > 0


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.data())
def test_a_first_sequence_is_solved_first_and_changes_no_result(seed: int, data: st.DataObject) -> None:
    problem = task()
    plain = search(problem, RandomBounds(seed, 0.0), Budget(depth=5))
    ends = [node.skeleton for node in plain.nodes if node.goal]
    first = data.draw(st.sampled_from(ends))
    bounds = RandomBounds(seed, 0.0)
    result = search(problem, bounds, Budget(depth=5), first)
    assert (result.skeleton, result.cost, result.status) == (plain.skeleton, plain.cost, plain.status)
    if len(first) > 1:
        assert next(skeleton for level, skeleton in bounds.calls if level == "path") == first


def test_same_search_twice_is_the_same() -> None:
    def run() -> SearchResult:
        return search(task(), RandomBounds(11), Budget(depth=5))

    first, second = run(), run()
    assert [(n.skeleton, n.costs, n.verdict) for n in first.nodes] == [
        (n.skeleton, n.costs, n.verdict) for n in second.nodes
    ]


def test_a_thing_may_be_put_elsewhere_on_the_table_that_it_is_on() -> None:
    """The symbols are the same before and after; what can be reached is not."""
    problem = task(start=("free", "on_table", "placed"))

    class Displaced(RandomBounds):
        def displaced(self, skeleton: Skeleton) -> tuple[str, ...]:
            last = [action for action in skeleton if action.name == "place"][-1:]
            return tuple(f"{action.arguments[1]} by {action.arguments[0]}" for action in last)

        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf
        ) -> BoundResult:
            if any(action.name == "place" and action.arguments[2] != "left" for action in skeleton):
                return BoundResult(False, math.inf, "only left can be reached")
            return super().solve(level, skeleton, warm, limit)

    result = search(problem, Displaced(4, 0.0), Budget(depth=5))
    assert [action.name for action in result.skeleton] == ["grasp", "place", "grasp"]
    assert result.skeleton[1].arguments[2] == "left"
    # One hand does not put it down twice for nothing, another hand may.
    for node in result.nodes:
        by = [action.arguments for action in node.skeleton if action.name == "place"]
        assert all(first != second for first, second in itertools.pairwise(by)), node.skeleton


def test_conflicts_prune_other_sequences() -> None:
    problem = task(hands=2)
    bad = problem.action("place(robot.0, tool, left)")

    class Learning(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf
        ) -> BoundResult:
            result = super().solve(level, skeleton, warm, limit)
            if skeleton[-1] == bad:
                return BoundResult(False, math.inf, "left is out of reach of robot.0", conflict=(bad,))
            return result

    bounds = Learning(5, 0.0)
    result = search(problem, bounds, Budget(depth=5))
    solved = [skeleton for _, skeleton in bounds.calls if bad in skeleton]
    assert len(solved) == 1
    assert result.status is SearchStatus.OPTIMAL
    assert any(node.verdict == "pruned" and "out of reach" in node.reason for node in result.nodes)


def test_an_action_that_fails_in_every_phase_is_one_reason_and_few_are_given() -> None:
    class Blocked(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf
        ) -> BoundResult:
            if str(skeleton[-1]).startswith("grasp(human"):
                at = skeleton[-1].at(len(skeleton))
                return BoundResult(False, math.inf, f"phase {len(skeleton)}, {at}: out of reach")
            return super().solve(level, skeleton, warm, limit)

    result = search(task(), Blocked(5, 0.0), Budget(depth=5))
    assert result.status is SearchStatus.INFEASIBLE
    assert len([node for node in result.nodes if node.verdict == "infeasible"]) > 1
    assert result.reason == "phase 1, grasp(1, human, tool): out of reach"
    many = search(task(hands=6), RandomBounds(1, 1.0), Budget(depth=3))
    says(many.reason, "; and ", " more")
    assert many.reason.count("; ") == 4


def test_unreachable_and_too_deep() -> None:
    unreachable = search(task(start=("on_table",)), RandomBounds(1))
    assert unreachable.status is SearchStatus.UNREACHABLE
    says(unreachable.reason, "free(human) is never true")
    assert unreachable.gap == math.inf
    shallow = search(task(), RandomBounds(1, 0.0), Budget(depth=0))
    assert shallow.status is SearchStatus.INFEASIBLE
    says(shallow.reason, "at least 1 action", "raise the depth")


def test_budgets_end_the_search_with_a_gap() -> None:
    problem = task()
    free = search(problem, RandomBounds(7, 0.0), Budget(depth=5))
    few = search(problem, RandomBounds(7, 0.0), Budget(depth=5, calls={"path": 1}))
    assert few.statistics["path"].solved == 1
    assert few.status in (SearchStatus.GAP, SearchStatus.OPTIMAL)
    assert few.bound <= free.cost + 1e-12 <= few.cost + 2e-12
    none = search(problem, RandomBounds(7, 0.0), Budget(depth=5, calls={"pose": 0}))
    assert none.status is SearchStatus.EXHAUSTED
    late = search(problem, RandomBounds(7, 0.0), Budget(depth=5, seconds=0.0))
    assert late.status is SearchStatus.EXHAUSTED


def test_an_interrupt_is_raised_unless_the_best_plan_is_asked_for() -> None:
    class Interrupted(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf
        ) -> BoundResult:
            if sum(1 for name, _ in self.calls if name == "path"):
                raise KeyboardInterrupt
            return super().solve(level, skeleton, warm, limit)

    with pytest.raises(KeyboardInterrupt):
        search(task(), Interrupted(2, 0.0), Budget(depth=5))
    result = search(task(), Interrupted(2, 0.0), Budget(depth=5, keep_interrupted=True))
    assert result.status is SearchStatus.INTERRUPTED
    assert result.skeleton
    assert result.bound <= result.cost


def test_levels_without_a_bound_do_not_prune() -> None:
    class Unrelated(RandomBounds):
        def is_lower_bound(self, level: str) -> bool:
            return False

    for seed in range(5):
        result = search(task(), Unrelated(seed, 0.2), Budget(depth=3))
        assert result.cost == pytest.approx(exhaustive(task(), RandomBounds(seed, 0.2), 3))


def crew() -> Task:
    """Two hands, each at its own of two tools, and a third tool that no goal names; one table."""
    objects = {"a": "robot_hand", "b": "robot_hand", "left": "table", **dict.fromkeys(("one", "two", "odd"), "thing")}
    initial = ["free(a)", "free(b)", "on_table(one)", "on_table(two)", "on_table(odd)"]
    goal = ["placed(one, left)", "placed(two, left)"]
    return ground(domain("screwdriver"), objects, map(parse_atom, initial), map(parse_atom, goal))


def test_the_path_of_the_lowest_estimate_is_solved_first() -> None:
    """An estimate that knows the cost of each prefix finds the best plan at once."""

    class Informed(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf
        ) -> BoundResult:
            result = super().solve(level, skeleton, warm, limit)
            return replace(result, estimate=super().solve("path", skeleton, None).cost) if result.feasible else result

    for seed in range(8):
        best = search(crew(), Informed(seed, 0.0), Budget(depth=4))
        first = search(crew(), Informed(seed, 0.0), Budget(depth=4, calls={"path": 1}))
        assert first.cost <= 1.25 * best.cost, seed


def test_objects_outside_the_goal_and_swapped_orders_come_last() -> None:
    bounds = RandomBounds(3, 0.0)
    search(crew(), bounds, Budget(depth=4, calls={"path": 1}))
    first = next(index for index, (level, _) in enumerate(bounds.calls) if level == "path")
    before = [skeleton for _, skeleton in bounds.calls[: first + 1]]
    assert not any("odd" in action.arguments for skeleton in before for action in skeleton)
    for one, two in itertools.pairwise(before[-1]):
        assert not (two.commutes_with(one) and str(two) < str(one)), before[-1]


def test_the_finer_level_of_prefixes_saves_paths_and_closes_the_gap() -> None:
    saved = 0
    for seed in range(6):
        plain, finer = (RandomBounds(seed, 0.1, prefix_level=level) for level in ("", "prefix"))
        results = [search(crew(), bounds, Budget(depth=5)) for bounds in (plain, finer)]
        assert results[0].cost == pytest.approx(results[1].cost)
        sequences = [sum(level == "sequence" for level, _ in bounds.calls) for bounds in (plain, finer)]
        saved += sequences[0] - sequences[1]
        few = [
            search(crew(), RandomBounds(seed, 0.1, prefix_level=level), Budget(5, {"path": 1, "prefix": 20}))
            for level in ("", "prefix")
        ]
        assert few[0].bound <= few[1].bound + 1e-12
        assert few[1].bound <= results[0].cost + 1e-12
    assert saved > 0


def test_a_bound_that_a_longer_sequence_undercuts_is_lowered() -> None:
    """Bounds are solved locally and may be too high; what they exclude is opened again as soon as that shows."""

    class TooHigh(RandomBounds):
        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf
        ) -> BoundResult:
            result = super().solve(level, skeleton, warm, limit)
            wrong = level == "prefix" and len(skeleton) == 1
            return replace(result, cost=100.0, attained=100.0) if wrong and result.feasible else result

    for seed in range(6):
        result = search(crew(), TooHigh(seed, 0.0, prefix_level="prefix"), Budget(depth=4))
        for node in result.nodes:
            if node.skeleton == result.skeleton[:1]:
                assert min(node.bound, node.attained) <= result.cost
        best = min((n for n in result.nodes if n.skeleton[:1] == result.skeleton[:1] and "path" in n.costs),
                   key=lambda n: n.costs["path"])  # fmt: skip
        assert result.cost == best.costs["path"]
        left = [n for n in result.nodes if n.skeleton[:1] == result.skeleton[:1] and n.verdict == "pruned"]
        assert all("100" not in node.reason for node in left), seed


def test_what_is_left_costs_something() -> None:
    """The least cost of the actions that are still needed is part of the bound."""

    class Priced(RandomBounds):
        def least_cost(self, actions: int) -> float:
            return 0.4 * actions

    for seed in range(5):
        plain, priced = (search(task(), kind(seed, 0.1), Budget(depth=4)) for kind in (RandomBounds, Priced))
        assert plain.cost == pytest.approx(priced.cost)
        assert len(priced.nodes) <= len(plain.nodes)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_paths_that_are_given_up_change_no_plan(seed: int) -> None:
    """A path that costs as much as the incumbent need not be solved to its end."""

    class GivesUp(RandomBounds):
        given_up = 0

        def solve(
            self, level: str, skeleton: Skeleton, warm: BoundResult | None, limit: float = math.inf
        ) -> BoundResult:
            result = super().solve(level, skeleton, warm)
            if level != "path" or not limit <= result.cost < math.inf:
                return result
            self.given_up += 1
            return BoundResult(True, 0.5 * (limit + result.cost), given_up=True)

    problem, bounds = task(), GivesUp(seed, 0.2)
    result, whole = search(problem, bounds, Budget(depth=5)), search(problem, RandomBounds(seed, 0.2), Budget(depth=5))
    assert (result.skeleton, result.cost, result.bound, result.status) == (
        whole.skeleton,
        whole.cost,
        whole.bound,
        whole.status,
    )
    dear = [node for node in result.nodes if node.level == len(bounds.levels) and "path" not in node.costs]
    assert len(dear) == bounds.given_up
    for node in dear:
        assert node.verdict == "pruned"
        assert "or more, the best path" in node.reason


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_what_a_solver_postpones_comes_last_and_changes_no_plan(seed: int, every: bool) -> None:
    """Paths that take long to find are looked for once all others are known."""

    class Postpones(RandomBounds):
        def solve(
            self,
            level: str,
            skeleton: Skeleton,
            warm: BoundResult | None,
            limit: float = math.inf,
            *,
            thorough: bool = False,
        ) -> BoundResult:
            result = super().solve(level, skeleton, warm)
            hard = level == "path" and (every or self._draw("hard", *map(str, skeleton)).random() < 0.5)
            return BoundResult(False, math.inf, "not known yet", postponed=True) if hard and not thorough else result

    bounds = Postpones(seed, 0.2)
    result, whole = search(task(), bounds, Budget(depth=5)), search(task(), RandomBounds(seed, 0.2), Budget(depth=5))
    assert (result.skeleton, result.cost, result.bound, result.status) == (
        whole.skeleton,
        whole.cost,
        whole.bound,
        whole.status,
    )
    paths = [skeleton for level, skeleton in bounds.calls if level == "path"]
    first_again = next((at for at, skeleton in enumerate(paths) if skeleton in paths[:at]), len(paths))
    assert len(set(paths[first_again:])) == len(paths[first_again:])
    stopped = search(task(), Postpones(seed, 0.2), Budget(depth=5, calls={"path": 1}))
    assert stopped.bound <= whole.cost
