"""Collision constraints, and paths that are collision-free under them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lgp.kinematics.world import World
from lgp.logic.task import Action
from lgp.path.bounds import PathBounds
from lgp.path.collision_constraints import EXTRA, MARGIN, POINTS_PER_SLICE, CollisionConstraints
from lgp.path.keyframes import Solution
from lgp.path.problem import PathProblem
from lgp.path.reasons import explain_infeasibility
from lgp.planner import plan, task_of
from lgp.scene.scene_file import load_scene
from lgp.search.records import BoundResult
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = needs_robots

LINES = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.center)",
    "grasp(human.right_hand, screwdriver)",
)
SLICES = 8


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_scene("screwdriver").with_heights({"left": 0.9, "center": 1.0, "right": 1.1}))


@pytest.fixture(scope="module")
def actions(world: World) -> tuple[Action, ...]:
    task = task_of(world.scene)
    return tuple(task.action(line) for line in LINES)


def solved(bounds: PathBounds, actions: tuple[Action, ...], last: str = "path") -> BoundResult:
    result: BoundResult | None = None
    for end in range(len(actions)):
        result = bounds.solve("pose", actions[: end + 1], result)
    for level in ("sequence", "path"):
        result = bounds.solve(level, actions, result)
        if level == last:
            break
    assert result is not None
    return result


@pytest.fixture(scope="module")
def free(world: World, actions: tuple[Action, ...]) -> Solution:
    solution = solved(PathBounds(world, slices=SLICES), actions).payload
    assert isinstance(solution, Solution)
    return solution


def active(world: World, actions: tuple[Action, ...], free: Solution, **options: float) -> CollisionConstraints:
    bounds = PathBounds(world, slices=SLICES)
    rows = CollisionConstraints(world, bounds.phases(actions), bounds.initial_configuration, **options)
    rows.add_violated(free.path, free.variables)
    return rows


def test_rows_have_the_derivatives_they_say(world: World, actions: tuple[Action, ...], free: Solution) -> None:
    bounds = PathBounds(world, slices=SLICES)
    rng = np.random.default_rng(0)
    # Every joint moves in every slice: where one rests, the interpolation has a kink.
    path = np.clip(free.path + 0.02 * rng.normal(size=free.path.shape), world.lower, world.upper)
    rows = active(world, actions, free, margin=0.05)
    assert {int(point) % POINTS_PER_SLICE for point in rows.points} == set(range(POINTS_PER_SLICE))
    problem = PathProblem(world, bounds.phases(actions), active=rows)
    x = problem.join(path, free.variables)
    own = np.array([row.kind == "collision" for row in problem.constraints.in_rows])
    assert np.count_nonzero(own) == len(rows.points) > 20
    zeros = np.zeros(len(problem.constraints.eq_rows)), np.zeros(len(own))
    slopes = problem.linearise(x, *zeros).in_jac[own].toarray()
    for _ in range(5):
        way = rng.normal(size=problem.n)
        high, low = problem.evaluate(x + 1e-7 * way)[2][own], problem.evaluate(x - 1e-7 * way)[2][own]
        # A few rows may lie on an edge of a box, where the nearest point jumps.
        assert np.quantile(np.abs((high - low) / 2e-7 - slopes @ way), 0.9) < 1e-4


def test_active_constraints_stay_and_new_ones_come_last(
    world: World, actions: tuple[Action, ...], free: Solution
) -> None:
    rows = active(world, actions, free)
    before = list(zip(rows.points.tolist(), rows.pairs.tolist(), strict=True))
    assert rows.add_violated(free.path, free.variables) == 0
    elsewhere = np.random.default_rng(0).uniform(world.lower, world.upper, free.path.shape)
    assert rows.add_violated(elsewhere, free.variables) > 0
    after = list(zip(rows.points.tolist(), rows.pairs.tolist(), strict=True))
    assert after[: len(before)] == before
    assert len(set(after)) == len(after) > len(before)


def test_paths_are_collision_free_between_slices_too(world: World, actions: tuple[Action, ...], free: Solution) -> None:
    touching, words = active(world, actions, free).deepest_penetration(free.path, free.variables)
    assert touching > 0.01
    assert words.startswith("phase ")
    says(words, "penetrates", " m")
    bounds = PathBounds(world, slices=SLICES, collisions=True)
    found = solved(bounds, actions)
    assert found.feasible, found.reason
    solution = found.payload
    assert isinstance(solution, Solution)
    assert active(world, actions, solution).deepest_penetration(solution.path, solution.variables) == (0.0, "")
    assert found.cost >= solved(bounds, actions, "sequence").cost - 1e-6
    rest = bounds.problem("path", bounds.phases(actions)).constraints.residuals(solution.path, solution.variables)
    assert max(rest["equality"], rest["inequality"]) <= 1e-6


def test_pairs_keep_more_around_what_they_pass_between_two_points(
    world: World, actions: tuple[Action, ...], free: Solution
) -> None:
    bounds = PathBounds(world, slices=SLICES)
    rows = CollisionConstraints(world, bounds.phases(actions), bounds.initial_configuration)
    before = np.concatenate([rows.limits_of_phase(phase) for phase in range(len(actions))])
    raised = rows.keep_more_around(free.path, free.variables)
    after = np.concatenate([rows.limits_of_phase(phase) for phase in range(len(actions))])
    assert raised >= np.count_nonzero(after > before) > 2
    assert (after >= before).all()
    bodies = [not rows.collisions.is_grip(pair) for pair in rows.collisions.pairs]
    assert (before[(after > before) & bodies] >= MARGIN).all()  # near contacts nothing changes
    for point, pair in np.argwhere(after > before):
        assert after[point, pair] > rows._distances(free.path, free.variables, [point], [pair])[0] + EXTRA
    assert rows.add_violated(free.path, free.variables) > 0


def test_the_pair_that_is_nearest_beyond_what_it_may_is_named(
    world: World, actions: tuple[Action, ...], free: Solution
) -> None:
    rows = active(world, actions, free)
    problem = PathProblem(world, PathBounds(world, slices=SLICES).phases(actions), active=rows)
    x = problem.join(free.path, free.variables)
    values = problem.constraints.evaluate(*problem.split(x)).inequality
    rows_of = [number for number, row in enumerate(problem.constraints.in_rows) if row.kind == "collision"]
    worst = max(rows_of, key=lambda number: values[number])
    first, _, second = problem.constraints.in_rows[worst].name.partition(" and ")
    says(explain_infeasibility(problem, x), "phase ", first, second, f"{values[worst]:.3f} m nearer")


def test_pairs_in_contact_at_first_may_stay_so_within_the_first_phase(
    world: World, actions: tuple[Action, ...]
) -> None:
    phases = PathBounds(world, slices=SLICES).phases(actions)
    z = np.zeros(PathProblem(world, phases).modes.size)
    touched = 0
    for start in np.random.default_rng(1).uniform(world.lower, world.upper, (10, world.nq)):
        rows = CollisionConstraints(world, phases, start)
        still = np.tile(start, (phases.total, 1))
        rows.add_violated(still, z)
        # Objects move with the phases, so they may touch something new in the first one; bodies of agents do not.
        agents = np.array(["screwdriver" not in row.name for row in rows.names()], dtype=bool)
        inside = (rows.evaluate(still, z) > MARGIN) & agents
        first = rows.points < SLICES * POINTS_PER_SLICE
        touched += int(inside.any())
        assert not inside[first].any()
    assert touched > 0


def test_a_plan_holds_its_deepest_penetration(world: World) -> None:
    scene = replace(world.scene, slices=SLICES)
    through = plan(scene, None, sequence=LINES, world=world, collisions=False)
    assert through.feasible
    assert through.residuals["penetration"] > 0.01
    around = plan(scene, None, sequence=LINES, world=world)
    assert around.feasible
    assert around.residuals["penetration"] == 0.0
    assert around.costs["total"] >= through.costs["total"] - 1e-6


def test_a_stride_leaves_out_what_lies_between(world: World, actions: tuple[Action, ...], free: Solution) -> None:
    phases = PathBounds(world, slices=SLICES).phases(actions)
    found: dict[int, set[tuple[int, int]]] = {}
    for stride in (SLICES, SLICES // 2, 1):
        constraints = CollisionConstraints(world, phases, world.initial_configuration)
        constraints.stride = stride
        constraints.add_violated(free.path, free.variables)
        found[stride] = set(zip(constraints.points.tolist(), constraints.pairs.tolist(), strict=True))
        slices = {point // POINTS_PER_SLICE for point, _ in found[stride]}
        assert all((at + 1) % stride == 0 for at in slices)
    assert found[SLICES] < found[SLICES // 2] < found[1]
    assert any((at // POINTS_PER_SLICE + 1) % SLICES == 0 for at, _ in found[SLICES])
