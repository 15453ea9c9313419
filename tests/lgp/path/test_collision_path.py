"""Multi-start of collision-free paths that cost much more than the free path."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path.bounds import PathBounds
from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.collision_path import MULTI_START_RATIO, candidate_guesses, initial_guesses
from lgp.path.keyframes import Solution
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.scene_file import load_scene
from lgp.search.records import SearchResult
from tests.support.lgp_worlds import needs_robots

pytestmark = [pytest.mark.slow, needs_robots]

SLICES = 8
HIGH, LOW = {"left": 1.24, "center": 0.87, "right": 0.64}, {"left": 0.68, "center": 1.0, "right": 1.2}
"""Heights [m] at which a table is in the way of the right one, and at which none is."""
ANY_GRIP = {f"robots.baxter.hands.{hand}.freedom": "free" for hand in ("left", "right")}


@cache
def world_at(left: float, center: float, right: float) -> tuple[World, tuple[Action, ...]]:
    world = World(load_scene("screwdriver", ANY_GRIP).with_heights({"left": left, "center": center, "right": right}))
    hand = "baxter.right, screwdriver"
    lines = f"grasp({hand})", f"place({hand}, table.right)", "grasp(human.right_hand, screwdriver)"
    return world, parse_sequence(task_of(world.scene), lines)


def planned(heights: dict[str, float], **options: Any) -> tuple[PathBounds, SearchResult]:
    world, actions = world_at(**heights)
    bounds = PathBounds(world, slices=SLICES, collisions=True, **options)
    return bounds, follow(bounds, actions)


@pytest.fixture(scope="module")
def blocked() -> tuple[PathBounds, SearchResult]:
    return planned(HIGH)


def free(bounds: PathBounds, found: SearchResult) -> Solution:
    solution = bounds.solve("free_path", found.skeleton, None).payload
    assert isinstance(solution, Solution)
    assert solution.path is not None
    return solution


def test_an_expensive_collision_free_path_is_compared_with_others(
    blocked: tuple[PathBounds, SearchResult],
) -> None:
    bounds, found = blocked
    _, nearest = planned(HIGH, multi_start=False)
    assert nearest.cost > 1.2 * free(bounds, found).costs.total
    assert found.cost <= nearest.cost * 1.01
    path, variables = found.payload.path, found.payload.variables
    constraints = CollisionConstraints(bounds.world, bounds.phases(found.skeleton), bounds.initial_configuration)
    assert constraints.deepest_penetration(path, variables)[0] <= 1e-6
    rest = bounds.problem("path", bounds.phases(found.skeleton)).constraints.residuals(path, variables)
    assert max(rest["equality"], rest["inequality"]) <= 1e-6


def test_the_same_scene_leads_to_the_same_path(blocked: tuple[PathBounds, SearchResult]) -> None:
    assert planned(HIGH)[1].cost == blocked[1].cost


def test_a_path_that_costs_more_than_a_known_one_is_given_up(blocked: tuple[PathBounds, SearchResult]) -> None:
    bounds, found = blocked
    before = bounds.solve("free_path", found.skeleton, None)
    other = PathBounds(bounds.world, slices=SLICES, collisions=True)
    limit = 0.5 * (before.cost + found.cost)
    result = other.solve("path", found.skeleton, before, limit)
    assert result.given_up
    assert result.payload is None
    assert limit <= result.cost <= found.cost * 1.1
    # What is given up at one limit is no answer for a higher one.
    assert other.solve("path", found.skeleton, before, limit).known
    first = other.solve("path", found.skeleton, before, 2.0 * found.cost)
    assert not first.known
    assert other.solve("path", found.skeleton, before, 2.0 * found.cost).known
    # Whether the first guess leads to a path here depends on the last digits, and so on the machine.
    whole = other.solve("path", found.skeleton, before, 2.0 * found.cost, thorough=True)
    assert whole.known is not first.postponed
    assert whole.cost == pytest.approx(found.cost if first.postponed else first.cost, rel=1e-6)


def test_a_cheap_collision_free_path_needs_no_multi_start() -> None:
    bounds, found = planned(LOW)
    assert found.cost <= MULTI_START_RATIO * free(bounds, found).costs.total
    # The sequences of both are the same to six digits; distances have edges, at which paths end in different minima.
    assert found.cost <= planned(LOW, multi_start=False)[1].cost * 1.1


def test_initial_guesses_move_robots_between_keyframes_only(blocked: tuple[PathBounds, SearchResult]) -> None:
    bounds, found = blocked
    world, phases, path = bounds.world, bounds.phases(found.skeleton), free(bounds, found).path
    guesses = list(initial_guesses(world, phases, path, 3))
    assert [guess.tobytes() for guess in initial_guesses(world, phases, path, 3)] == [
        guess.tobytes() for guess in guesses
    ]
    arm = world.support("baxter.right") > 0.0
    for guess in guesses:
        assert np.allclose(guess[phases.keyframes], path[phases.keyframes], atol=1e-12)
        assert np.array_equal(guess[:, ~arm], path[:, ~arm])
        assert (np.abs(guess - path)[:, arm].max(axis=0) > 0.05).all()
        assert ((guess >= world.lower - 1e-9) & (guess <= world.upper + 1e-9)).all()


def test_the_first_candidates_have_the_robots_of_the_reference_and_all(
    blocked: tuple[PathBounds, SearchResult],
) -> None:
    bounds, found = planned(HIGH, reference=blocked[0])
    assert found.cost <= blocked[1].cost * 1.01
    robot = bounds.world.columns("baxter")
    problem = bounds.problem("path", bounds.phases(found.skeleton))
    without, other = free(bounds, found), blocked[1].payload
    reference = other.path, other.variables
    guesses = candidate_guesses(problem, without.path, without.variables, reference)
    first, variables = next(guesses).motion
    assert np.array_equal(first[:, robot], other.path[:, robot])
    assert np.array_equal(variables, without.variables)
    assert next(guesses).motion is reference
    own, near = next(guesses), next(guesses)
    assert own.gradual
    assert own.motion[0] is without.path
    assert near.gradual
    assert 0.0 < np.abs(near.motion[0] - without.path).max() < 0.2
    assert not next(guesses).gradual
    others = np.setdiff1d(np.arange(bounds.world.nq), robot)
    assert np.array_equal(first[:, others], without.path[:, others])
