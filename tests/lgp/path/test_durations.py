"""Durations of phases: slopes, the condition of their optimum, least durations, and plans that have them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dreba
import lgp
from lgp.kinematics.world import World
from lgp.motion import Motion
from lgp.path.bounds import PathBounds
from lgp.path.costs import Weights
from lgp.path.durations import LEAST_SECONDS, SHARE_OF_SPEED, DurationSolver, least_durations, speed_limits
from lgp.path.ergonomics import Ergonomics
from lgp.path.keyframes import Solution
from lgp.path.phases import Phases
from lgp.planner import follow, parse_sequence, task_of
from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY

pytestmark = pytest.mark.slow

SLICES = 5
SEQUENCE = ["grasp(human.right_hand, box)", "place(human.right_hand, box, table.near)"]
NO_LIMIT = 1e-9
"""[s] Least duration that bounds nothing."""


def free_scene(weight: float = 0.5, **changes: object) -> Scene:
    values = {**HUMAN_ONLY, "durations": "free", "cost": {"time_weight": weight}}
    return read_scene(values | {"goal": ["on_table(box)"]} | changes)


@pytest.fixture(scope="module")
def world() -> World:
    return World(free_scene())


@pytest.fixture(scope="module")
def ergonomics(world: World) -> Ergonomics:
    return Ergonomics(world, dreba.load("convex"))


def solved(world: World, ergonomics: Ergonomics | None, scene: Scene) -> tuple[PathBounds, Phases, Solution]:
    bounds = PathBounds(world.with_scene(scene), ergonomics, slices=SLICES)
    skeleton = parse_sequence(task_of(scene), SEQUENCE)
    result = follow(bounds, skeleton)
    assert result.skeleton, result.reason
    return bounds, bounds.phases(skeleton, result.payload.durations), result.payload


@pytest.mark.parametrize("ergonomic", [False, True])
def test_of_a_fixed_path_three_times_accelerations_are_what_time_costs(
    world: World, ergonomics: Ergonomics, ergonomic: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Accelerations fall with the third power of time, all other costs grow with it."""
    monkeypatch.setattr("lgp.path.durations.LEAST_SECONDS", NO_LIMIT)
    fixed = replace(free_scene(), durations="fixed")
    bounds, phases, solution = solved(world, ergonomics if ergonomic else None, fixed)

    def of(phases: Phases):  # type: ignore[no-untyped-def]
        return bounds.problem("path", phases)

    def same_path(phases: Phases, known: Solution) -> Solution:
        problem = of(phases)
        return replace(known, costs=problem.costs(problem.join(known.path, known.variables)))

    solver = DurationSolver(world, of, same_path)
    solver.limits = np.full(world.nq, np.inf)
    best = solver.solve(phases, solution)
    assert 3.0 * best.costs.acceleration == pytest.approx(best.costs.ergonomics + best.costs.time, rel=1e-2)
    assert best.costs.total < solution.costs.total
    for factors in ((1.02, 1.0), (0.98, 1.0), (1.0, 1.02), (1.0, 0.98)):
        durations = tuple(np.multiply(best.durations, factors).tolist())
        assert same_path(replace(phases, durations=durations), best).costs.total >= best.costs.total * (1.0 - 5e-4)


def test_no_other_durations_give_a_cheaper_path(world: World, ergonomics: Ergonomics) -> None:
    scene = free_scene(0.1)
    bounds, phases, best = solved(world, ergonomics, scene)
    _, _, fixed = solved(world, ergonomics, replace(scene, durations="fixed"))
    assert best.costs.total < fixed.costs.total
    limits = least_durations(speed_limits(world), bounds.initial_configuration, best.path, SLICES)
    assert (np.array(best.durations) >= limits - 1e-9).all()
    for factors in ((1.1, 1.0), (0.9, 1.0), (1.0, 1.1), (1.0, 0.9), (1.1, 0.9), (0.9, 1.1)):
        durations = np.multiply(best.durations, factors)
        if (durations < limits).any():
            continue
        other = bounds.paths.solve_again(
            replace(phases, durations=tuple(durations.tolist())), best, collision_free=False
        )
        assert other is not None
        assert other.costs.total >= best.costs.total * (1.0 - 1e-4), factors


def test_speeds_and_the_shortest_action_bound_durations(world: World) -> None:
    _, _, hasty = solved(world, None, free_scene(500.0))
    start = world.initial_configuration
    limits = speed_limits(world)
    needed = least_durations(limits, start, hasty.path, SLICES)
    assert hasty.durations == pytest.approx(needed, rel=0.3)
    assert (np.array(hasty.durations) >= needed - 1e-9).all()
    assert min(hasty.durations) >= LEAST_SECONDS
    # One joint that moves a step in one slice needs as long as its speed says: a cubic is 1.5 times as fast in between.
    path = np.tile(start, (3, 1))
    path[1:, 0] += 1.0
    limit = np.full(world.nq, np.inf)
    limit[0] = 2.0
    needed = least_durations(limit, start, path, 3)
    assert needed == pytest.approx([3 * 1.5 / (SHARE_OF_SPEED * 2.0)], rel=0.02)


def test_the_levels_stay_relaxations(world: World, ergonomics: Ergonomics) -> None:
    scene = free_scene()
    bounds = PathBounds(world.with_scene(scene), ergonomics, slices=SLICES)
    skeleton = parse_sequence(task_of(scene), SEQUENCE)
    pose = None
    for end in (1, 2):
        pose = bounds.solve("pose", skeleton[:end], pose)
        prefix = bounds.solve(bounds.prefix_level, skeleton[:end], pose)
        assert prefix.feasible
    sequence = bounds.solve("sequence", skeleton, pose)
    path = bounds.solve("path", skeleton, sequence)
    assert prefix.cost <= sequence.cost * 1.001
    assert sequence.cost <= path.cost * 1.001
    assert not bounds.is_lower_bound("pose")
    assert bounds.least_cost(2) == pytest.approx(2 * LEAST_SECONDS * (0.5 + ergonomics.lower_bound))


def test_a_plan_keeps_its_durations(world: World, tmp_path: Path) -> None:
    scene = free_scene(1.0, goal=["grasped(human.right_hand, box)"])
    plan = lgp.plan(scene, cost=None, world=world, collisions=False, slices=SLICES)
    assert plan.durations != (scene.phase_seconds,)
    assert plan.costs["time"] == pytest.approx(sum(plan.durations))
    assert plan.time == pytest.approx(np.arange(1, SLICES + 1) * plan.durations[0] / SLICES)
    assert plan.summary()["durations"] == list(plan.durations)
    assert plan.audit["speed"] <= SHARE_OF_SPEED + 1e-3
    plan.save(tmp_path / "plan")
    again = lgp.Plan.load(tmp_path / "plan")
    assert again.durations == plan.durations
    assert Motion(again).phases.phase_durations == pytest.approx(plan.durations)
    weights = Weights(time=2.0)
    dearer = lgp.plan(scene, cost=None, world=world, collisions=False, slices=SLICES, weights=weights)
    assert dearer.durations < plan.durations
