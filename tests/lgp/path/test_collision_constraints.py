"""Rows that keep bodies apart, and paths that are free of collisions with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path.bounds import PathBounds, Solution
from lgp.path.collision_constraints import FINER, MARGIN, CollisionRows
from lgp.path.feasibility import explain_infeasibility
from lgp.path.problem import PathProblem
from lgp.planner import plan, task_of
from lgp.scene.scene_file import load_scene
from lgp.search.tree_search import BoundResult
from tests.support.lgp_worlds import needs_robots

pytestmark = needs_robots

LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.center)",
    "grasp(human.right_hand, screwdriver)",
)
SLICES = 5


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_scene("screwdriver").with_heights({"left": 0.9, "center": 1.0, "right": 1.1}))


@pytest.fixture(scope="module")
def actions(world: World) -> tuple[Action, ...]:
    task = task_of(world.scene)
    return tuple(task.action(line) for line in LINES)


def solved(bounds: PathBounds, actions: tuple[Action, ...], last: str = "path") -> BoundResult:
    found: BoundResult | None = None
    for end in range(len(actions)):
        found = bounds.solve("pose", actions[: end + 1], found)
    for level in ("sequence", "path"):
        found = bounds.solve(level, actions, found)
        if level == last:
            break
    assert found is not None
    return found


@pytest.fixture(scope="module")
def free(world: World, actions: tuple[Action, ...]) -> Solution:
    found = solved(PathBounds(world, slices=SLICES), actions).payload
    assert isinstance(found, Solution)
    return found


def chosen(world: World, actions: tuple[Action, ...], free: Solution, **given: float) -> CollisionRows:
    bounds = PathBounds(world, slices=SLICES)
    rows = CollisionRows(world, bounds.phases(actions), bounds.start, **given)
    rows.extend(free.path, free.variables)
    return rows


def test_rows_have_the_derivatives_they_say(world: World, actions: tuple[Action, ...], free: Solution) -> None:
    rows = chosen(world, actions, free, margin=0.05)
    assert {int(point) % FINER for point in rows.points} == set(range(FINER))
    bounds = PathBounds(world, slices=SLICES)
    problem = PathProblem(world, bounds.phases(actions), apart=rows)
    x = problem.join(free.path, free.variables)
    own = np.array([row.kind == "collision" for row in problem.rows.in_rows])
    assert np.count_nonzero(own) == len(rows.points) > 20
    zeros = np.zeros(len(problem.rows.eq_rows)), np.zeros(len(own))
    slopes = problem.linearise(x, *zeros).in_jac[own].toarray()
    rng = np.random.default_rng(0)
    for _ in range(5):
        way = rng.normal(size=problem.n)
        high, low = problem.evaluate(x + 1e-7 * way)[2][own], problem.evaluate(x - 1e-7 * way)[2][own]
        # A few rows may lie on an edge of a box, where the nearest point jumps.
        assert np.quantile(np.abs((high - low) / 2e-7 - slopes @ way), 0.9) < 1e-4


def test_rows_are_kept_and_new_ones_come_last(world: World, actions: tuple[Action, ...], free: Solution) -> None:
    rows = chosen(world, actions, free)
    before = list(zip(rows.points.tolist(), rows.pairs.tolist(), strict=True))
    assert rows.extend(free.path, free.variables) == 0
    elsewhere = np.random.default_rng(0).uniform(world.lower, world.upper, free.path.shape)
    assert rows.extend(elsewhere, free.variables) > 0
    after = list(zip(rows.points.tolist(), rows.pairs.tolist(), strict=True))
    assert after[: len(before)] == before
    assert len(set(after)) == len(after) > len(before)


def test_paths_keep_bodies_apart_between_slices_too(world: World, actions: tuple[Action, ...], free: Solution) -> None:
    touching, words = chosen(world, actions, free).worst(free.path, free.variables)
    assert touching > 0.01
    assert words.startswith("phase ")
    assert " m into " in words
    bounds = PathBounds(world, slices=SLICES, collisions=True)
    found = solved(bounds, actions)
    assert found.feasible, found.reason
    apart = found.payload
    assert isinstance(apart, Solution)
    assert chosen(world, actions, apart).worst(apart.path, apart.variables) == (0.0, "")
    assert found.cost >= solved(bounds, actions, "sequence").cost - 1e-6
    rest = bounds.problem("path", bounds.phases(actions)).rows.residuals(apart.path, apart.variables)
    assert max(rest["equality"], rest["inequality"]) <= 1e-6


def test_where_bodies_touch_is_named(world: World, actions: tuple[Action, ...], free: Solution) -> None:
    rows = chosen(world, actions, free)
    problem = PathProblem(world, PathBounds(world, slices=SLICES).phases(actions), apart=rows)
    words = explain_infeasibility(problem, problem.join(free.path, free.variables))
    deepest, same = rows.worst(free.path, free.variables)
    assert words == same
    assert f"{deepest:.3f} m into" in words


def test_what_touches_at_the_start_may_go_on_touching_in_the_first_phase(
    world: World, actions: tuple[Action, ...]
) -> None:
    phases = PathBounds(world, slices=SLICES).phases(actions)
    z = np.zeros(PathProblem(world, phases).modes.size)
    touched = 0
    for start in np.random.default_rng(1).uniform(world.lower, world.upper, (10, world.nq)):
        rows = CollisionRows(world, phases, start)
        still = np.tile(start, (phases.total, 1))
        rows.extend(still, z)
        # Objects move with the phases, so they may touch something new in the first one; bodies of agents do not.
        agents = np.array(["screwdriver" not in row.name for row in rows.names()], dtype=bool)
        inside = (rows.evaluate(still, z)[0] > MARGIN) & agents
        first = rows.points < SLICES * FINER
        touched += int(inside.any())
        assert not inside[first].any()
    assert touched > 0


def test_a_plan_says_how_far_bodies_touch(world: World) -> None:
    scene = replace(world.scene, slices=SLICES)
    through = plan(scene, None, sequence=LINES, world=world, collisions=False)
    assert through.feasible
    assert through.residuals["penetration"] > 0.01
    around = plan(scene, None, sequence=LINES, world=world)
    assert around.feasible
    assert around.residuals["penetration"] == 0.0
    assert around.costs["total"] >= through.costs["total"] - 1e-6
