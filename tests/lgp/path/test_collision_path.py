"""Other starts for paths whose bodies, once kept apart, make them cost much more."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path import bounds as levels
from lgp.path.bounds import PathBounds, Solution
from lgp.path.collision_constraints import CollisionRows
from lgp.path.collision_path import SUSPICIOUS, initial_guesses, solve_collision_free
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.scene_file import load_scene
from lgp.search.tree_search import SearchResult
from tests.support.lgp_worlds import needs_robots

pytestmark = needs_robots

SLICES = 5
HIGH, LOW = {"left": 1.24, "center": 0.87, "right": 0.64}, {"left": 0.68, "center": 1.0, "right": 1.2}
"""Heights [m] at which the right table is behind what is in the way, and at which nothing is."""


@cache
def world_at(left: float, center: float, right: float) -> tuple[World, tuple[Action, ...]]:
    world = World(load_scene("screwdriver").with_heights({"left": left, "center": center, "right": right}))
    hand = "baxter.right, screwdriver"
    lines = f"grasp({hand})", f"place({hand}, table.right)", "grasp(human.right_hand, screwdriver)"
    return world, parse_sequence(task_of(world.scene), lines)


def planned(heights: dict[str, float], **given: Any) -> tuple[PathBounds, SearchResult]:
    world, actions = world_at(**heights)
    bounds = PathBounds(world, slices=SLICES, collisions=True, **given)
    return bounds, follow(bounds, actions)


@pytest.fixture(scope="module")
def behind() -> tuple[PathBounds, SearchResult]:
    return planned(HIGH)


def free(bounds: PathBounds, found: SearchResult) -> Solution:
    solution = bounds.solve("free_path", found.skeleton, None).payload
    assert isinstance(solution, Solution)
    assert solution.path is not None
    return solution


def test_a_path_that_costs_much_more_than_without_bodies_is_left_for_a_better_one(
    behind: tuple[PathBounds, SearchResult],
) -> None:
    bounds, found = behind
    _, near = planned(HIGH, detours=False)
    assert near.cost > SUSPICIOUS * free(bounds, found).costs.total
    assert found.cost < 0.7 * near.cost
    path, variables = found.payload.path, found.payload.variables
    rows = CollisionRows(bounds.world, bounds.phases(found.skeleton), bounds.start)
    assert rows.worst(path, variables) == (0.0, "")
    rest = bounds.problem("path", bounds.phases(found.skeleton)).rows.residuals(path, variables)
    assert max(rest["equality"], rest["inequality"]) <= 1e-6


def test_the_same_scene_leads_to_the_same_detour(behind: tuple[PathBounds, SearchResult]) -> None:
    assert planned(HIGH)[1].cost == behind[1].cost


def test_other_starts_are_spared_where_bodies_cost_little(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        raise AssertionError("no other start is called for")

    monkeypatch.setattr(levels, "multi_start", never)
    bounds, found = planned(LOW)
    assert found.cost <= SUSPICIOUS * free(bounds, found).costs.total


def test_starts_swing_robots_out_between_switches(behind: tuple[PathBounds, SearchResult]) -> None:
    bounds, found = behind
    world, phases, path = bounds.world, bounds.phases(found.skeleton), free(*behind).path
    starts = list(initial_guesses(world, phases, path, 3))
    assert [start.tobytes() for start in initial_guesses(world, phases, path, 3)] == [
        start.tobytes() for start in starts
    ]
    arm = world.support("baxter.right") > 0.0
    for start in starts:
        assert np.allclose(start[phases.keys], path[phases.keys], atol=1e-12)
        assert np.array_equal(start[:, ~arm], path[:, ~arm])
        assert (np.abs(start - path)[:, arm].max(axis=0) > 0.05).all()
        assert ((start >= world.lower - 1e-9) & (start <= world.upper + 1e-9)).all()


def test_robots_first_follow_their_path_under_another_cost(
    behind: tuple[PathBounds, SearchResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    from lgp.path import collision_path as detours

    begun = []

    def watched(make, rows, first, *more, **given):  # type: ignore[no-untyped-def]
        begun.append(first.x)
        return solve_collision_free(make, rows, first, *more, **given)

    monkeypatch.setattr(detours, "solve_collision_free", watched)
    bounds, found = planned(HIGH, like=behind[0])
    assert found.cost <= behind[1].cost * 1.01
    robot = bounds.world.columns("baxter")
    problem = bounds.problem("path", bounds.phases(found.skeleton))
    assert np.allclose(problem.split(begun[0])[0][:, robot], behind[1].payload.path[:, robot])
    assert len(begun) == 1
