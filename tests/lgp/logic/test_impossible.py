"""Goals that no sequence reaches: what is said of them, against enumeration of all states."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from functools import cache

import pytest

from lgp.logic.impossible import exclusive_goals, fewest_actions
from lgp.logic.pddl import load_domain
from lgp.logic.task import Task, ground, parse_atom
from lgp.search.records import Budget, SearchStatus
from lgp.search.tree_search import search
from tests.support.random_bounds import RandomBounds
from tests.support.says import says

domain = cache(load_domain)


def task(goal: Iterable[str], which: str = "screwdriver") -> Task:
    hands = {"h": "human_hand", "r": {"screwdriver": "robot_hand", "toolbox": "vacuum_gripper"}[which]}
    objects = {**hands, "a": "thing", "b": "thing", "left": "table", "right": "table"}
    initial = ["free(h)", "free(r)", "on_table(a)", "on_table(b)"]
    initial += ["fit(a, b)"] if which == "toolbox" else []
    return ground(domain(which), objects, map(parse_atom, initial), map(parse_atom, goal))


def states(problem: Task) -> dict[int, int]:
    """Every reachable state with the number of actions to it."""
    seen, layer, steps = {problem.initial: 0}, [problem.initial], 0
    while layer:
        steps += 1
        layer = [
            after for state in layer for _, after in problem.successors(state) if seen.setdefault(after, steps) == steps
        ]
        layer = list(dict.fromkeys(layer))
    return seen


@pytest.mark.parametrize("which", ["screwdriver", "toolbox"])
def test_agrees_with_the_enumeration_of_all_states(which: str) -> None:
    everything = task((), which)
    reachable = states(everything)
    missed = 0
    for pair in itertools.combinations(everything.atoms, 2):
        problem = task([str(atom) for atom in pair], which)
        steps = [count for state, count in states(problem).items() if problem.is_goal(state)]
        assert fewest_actions(problem) == (min(steps) if steps else -1)
        found = exclusive_goals(problem)
        if found is not None:
            assert set(found) == set(pair)
            assert not steps, f"{pair} are true together"
        else:
            missed += not steps
    # Of the pairs that exclude each other at most a few are not seen by looking at pairs alone.
    assert missed <= 2, f"{missed} of {len(reachable)} states"


@pytest.mark.parametrize("depth", [1, 4, 40])
def test_a_contradiction_is_named_at_every_depth(depth: int) -> None:
    result = search(task(["grasped(h, a)", "free(h)"]), RandomBounds(1, 0.0), Budget(depth=depth))
    assert result.status is SearchStatus.UNREACHABLE
    says(result.reason, "free(h)", "grasped(h, a)", "never true together")


def test_three_goals_that_exclude_each_other_only_together_are_named() -> None:
    problem = task(["on_table(a)", "grasped(h, b)", "free(r)", "grasped(r, b)"])
    result = search(problem, RandomBounds(1, 0.0), Budget(depth=3))
    assert result.status is SearchStatus.UNREACHABLE
    says(result.reason, "never true together")


def test_the_depth_that_is_needed_is_said() -> None:
    problem = task(["placed(a, left)", "placed(b, left)"])
    result = search(problem, RandomBounds(1, 0.0), Budget(depth=3))
    assert result.status is SearchStatus.INFEASIBLE
    says(result.reason, "at least 4 actions", "depth is 3", "raise the depth")
