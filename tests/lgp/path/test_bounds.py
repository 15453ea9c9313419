"""Path problems of the levels: derivatives, and costs that are lower bounds of the next level."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import dreba
from lgp.errors import LgpError
from lgp.kinematics.world import World
from lgp.logic.task import Action, Task
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.path.feasibility import project_to_feasible
from lgp.path.keyframes import Solution
from lgp.path.phases import Phases, switch_of
from lgp.path.problem import PathProblem
from lgp.planner import task_of
from lgp.scene.scene_file import load_scene
from lgp.search.records import BoundResult
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = [pytest.mark.slow, needs_robots]

SLICES = 4
GRASP, TAKE = "grasp(baxter.right, screwdriver)", "grasp(human.right_hand, screwdriver)"


def place(table: str) -> str:
    return f"place(baxter.right, screwdriver, table.{table})"


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_scene("screwdriver").with_heights({"left": 1.0, "center": 0.9, "right": 1.1}))


@pytest.fixture(scope="module")
def planted() -> World:
    return World(load_scene("screwdriver", {"human.legs": "planted"}))


@pytest.fixture(scope="module")
def task(world: World) -> Task:
    return task_of(world.scene)


@pytest.fixture(scope="module")
def ergonomics(world: World) -> Ergonomics:
    return Ergonomics(world, dreba.load("convex"))


def actions(task: Task, *texts: str) -> tuple[Action, ...]:
    return tuple(task.action(text) for text in texts)


def phases(world: World, task: Task, slices: int = SLICES) -> Phases:
    return Phases.of(world.scene, actions(task, GRASP, place("left"), TAKE), slices)


def differences(function: object, x: np.ndarray, step: float = 1e-6) -> np.ndarray:
    columns = []
    for number in range(len(x)):
        moved = np.zeros_like(x)
        moved[number] = step
        columns.append((function(x + moved) - function(x - moved)) / (2 * step))  # type: ignore[operator]
    return np.array(columns).T


def random_point(problem: PathProblem, seed: int = 0) -> np.ndarray:
    """A point near the start with bent knees, the variables of grasps away from 0."""
    rng = np.random.default_rng(seed)
    q = problem.initial_configuration + rng.normal(scale=0.1, size=(len(problem.knots), problem.world.nq))
    q[:, problem.world.column["human.pelvis_z"]] = -0.2
    return problem.join(q, 0.3 * rng.normal(size=problem.modes.size))


@pytest.mark.parametrize("legs", ["solved", "planted"])
def test_constraints_have_their_stated_derivatives(world: World, planted: World, task: Task, legs: str) -> None:
    there = world if legs == "solved" else planted
    # Two slices a phase: the switches are in slices 1, 3 and 5.
    knots, switches = ([1, 2, 3], [0, 1]) if legs == "solved" else ([3, 4, 5], [1, 2])
    problem = PathProblem(there, phases(there, task, 2), knots=np.array(knots), enforced=switches)
    assert {row.kind for row in problem.constraints.eq_rows} == {"pose_continuity", "rest"} | (
        {"sole"} if legs == "planted" else set()
    )
    assert {row.kind for row in problem.constraints.in_rows} == {"tilt", "footing"} | (
        {"leg"} if legs == "solved" else set()
    )
    x = random_point(problem)
    found = problem.linearise(x, np.zeros(len(problem.constraints.eq_rows)), np.zeros(len(problem.constraints.in_rows)))
    assert found.eq_jac.toarray() == pytest.approx(differences(lambda at: problem.evaluate(at)[1], x), abs=1e-6)
    assert found.in_jac.toarray() == pytest.approx(differences(lambda at: problem.evaluate(at)[2], x), abs=1e-5)
    assert found.eq == pytest.approx(problem.evaluate(x)[1])
    assert found.ineq == pytest.approx(problem.evaluate(x)[2])


def test_costs_have_their_stated_gradient(world: World, task: Task, ergonomics: Ergonomics) -> None:
    for cost in (None, ergonomics):
        problem = PathProblem(world, phases(world, task), knots=np.array([7, 11]), enforced=[2], ergonomics=cost)
        x = random_point(problem)
        rows = np.zeros(len(problem.constraints.eq_rows)), np.zeros(len(problem.constraints.in_rows))
        found = problem.linearise(x, *rows)
        slope = differences(lambda at: np.array([problem.evaluate(at)[0]]), x, 1e-5)[0]  # noqa: B023
        assert found.gradient == pytest.approx(slope, abs=1e-4 * np.abs(slope).max())
        full = found.hessian.toarray()
        full = full + full.T - np.diag(np.diag(full))
        assert np.linalg.eigvalsh(full).min() > -1e-8
        pattern = found.hessian.indices.copy()
        again = problem.linearise(random_point(problem, 1), np.ones(len(rows[0])), rows[1])
        assert np.array_equal(again.hessian.indices, pattern)


@pytest.mark.parametrize("number", [0, 1])
def test_equality_hessians_are_second_derivatives_at_feasible_points(world: World, task: Task, number: int) -> None:
    sequence = phases(world, task)
    problem = PathProblem(world, sequence, knots=sequence.keyframes[number : number + 1], enforced=[number], stop=False)
    x, left = project_to_feasible(
        problem, problem.join(world.initial_configuration[None], np.zeros(problem.modes.size))
    )
    x, left = project_to_feasible(problem, x, 1e-9)
    assert left < 1e-8
    y = np.array([0.3, -0.7, 0.4, 0.2, -0.1, 0.5])
    rows = np.zeros(len(problem.constraints.in_rows))

    def slope(at: np.ndarray) -> np.ndarray:
        return np.asarray(problem.linearise(at, 0.0 * y, rows).eq_jac.toarray().T @ y)

    columns = problem.constraints.hessian_columns()[0]
    true = differences(slope, x)[np.ix_(columns, columns)]
    q, z = problem.split(x)
    (hessian,) = problem.constraints.equality_hessians(problem.constraints.evaluate(q, z), q, z, y)
    assert hessian == pytest.approx(true, abs=2e-3)


def solved(bounds: PathBounds, skeleton: tuple[Action, ...]) -> dict[str, BoundResult]:
    found: dict[str, BoundResult] = {}
    warm: BoundResult | None = None
    for end in range(len(skeleton)):
        warm = bounds.solve("pose", skeleton[: end + 1], warm)
        assert warm.feasible, warm.reason
        found[f"pose {end}"] = warm
        found[f"prefix {end}"] = bounds.solve(bounds.prefix_level, skeleton[: end + 1], warm)
    for level in ("sequence", "path"):
        warm = bounds.solve(level, skeleton, warm)
        assert warm.feasible, warm.reason
        found[level] = warm
    return found


@pytest.mark.parametrize("ergonomic", [False, True])
def test_no_level_costs_more_than_the_next(world: World, task: Task, ergonomics: Ergonomics, ergonomic: bool) -> None:
    rng = np.random.default_rng(5)
    for table in ("left", "center"):
        there = world.with_scene(world.scene.with_heights({table: float(rng.uniform(0.8, 1.2))}))
        bounds = PathBounds(there, ergonomics if ergonomic else None, slices=SLICES)
        found = solved(bounds, actions(task, GRASP, place(table), TAKE))
        poses = [result.cost for level, result in found.items() if level.startswith("pose")]
        prefixes = [result.cost for level, result in found.items() if level.startswith("prefix")]
        assert 0.0 < max(poses) <= found["sequence"].cost
        assert prefixes == sorted(prefixes)
        assert max(poses) <= prefixes[-1] * 1.01
        assert 0.5 * found["sequence"].cost < prefixes[-1] <= found["sequence"].cost
        estimate = found[f"pose {len(poses) - 1}"].estimate
        assert estimate is not None
        assert 0.5 < estimate / found["path"].cost < 3.0
        assert found["sequence"].cost <= found["path"].cost * (1.0 + 1e-6)
        if not ergonomic:
            # Without posture costs only limits between switches part the two.
            assert found["sequence"].cost > 0.9 * found["path"].cost


def test_poses_are_continuous_and_limbs_rest_at_switches(world: World, task: Task) -> None:
    bounds = PathBounds(world, slices=SLICES)
    skeleton = actions(task, GRASP, place("center"), TAKE)
    solution = solved(bounds, skeleton)["path"].payload
    assert isinstance(solution, Solution)
    problem = bounds.problem("path", bounds.phases(skeleton))
    path, keyframes = solution.path, problem.phases.keyframes
    assert path is not None
    assert np.all(path >= world.lower - 1e-9)
    assert np.all(path <= world.upper + 1e-9)
    for number, key in enumerate(keyframes):
        kinematics = world.at(path[key : key + 1], problem.modes.frames)
        before = problem.modes.pose("screwdriver", number, kinematics, solution.variables)
        after = problem.modes.pose("screwdriver", number + 1, kinematics, solution.variables)
        assert after.position[0] == pytest.approx(before.position[0], abs=1e-6)
        assert np.linalg.norm(pin.log3(before.rotation[0].T @ after.rotation[0])) < 1e-6
        if key + 1 < len(path):
            limb = problem.constraints.limb(number)
            assert path[key + 1, limb] == pytest.approx(path[key, limb], abs=1e-6)
    lying = problem.modes.pose(
        "screwdriver", 2, world.at(path[keyframes[1:2]], problem.modes.frames), solution.variables
    )
    table = world.scene.tables["table.center"]
    assert lying.position[0, 2] == pytest.approx(table.height + 0.015)
    assert np.all(np.abs(lying.position[0, :2] - table.position) <= 0.5 * np.array(table.size))
    assert lying.rotation[0, 2, 2] == pytest.approx(1.0)


def test_an_unreachable_object_is_refused_with_the_distance(world: World, task: Task) -> None:
    found = PathBounds(world, slices=SLICES).solve("pose", actions(task, TAKE), None)
    assert not found.feasible
    says(found.reason, "phase 1, grasp(1, human.right_hand, screwdriver)", "screwdriver on table.start", "at least 0.")


def test_loads_count_while_the_human_holds_something(world: World, task: Task) -> None:
    put = "place(human.right_hand, screwdriver, table.left)"
    loads = Phases.of(world.scene, actions(task, TAKE, put, GRASP), 2).loads()
    assert loads[:, 0].tolist() == [0.0, 0.0, 0.3, 0.3, 0.0, 0.0]


def test_scores_count_from_zero(world: World, ergonomics: Ergonomics) -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(world.lower, world.upper, (500, world.nq))
    assert ergonomics.lower_bound >= 0.0
    assert ergonomics.value(q, np.zeros(len(q))).min() >= ergonomics.lower_bound - 1e-9


def test_actions_without_geometry_are_refused(task: Task) -> None:
    odd = Action("sing", ("human.right_hand",), 0, 0, 0, 0)
    with pytest.raises(LgpError) as error:
        switch_of(odd)
    says(error, "sing(human.right_hand)", "geometry", "expected one of grasp(")
    with pytest.raises(LgpError) as error:
        Phases.of(load_scene("screwdriver"), [], slices=1)
    says(error, "1 slices per phase", "expected 2 or more")


def test_a_problem_is_solved_once(world: World, task: Task) -> None:
    bounds = PathBounds(world, slices=SLICES)
    first = bounds.solve("pose", actions(task, GRASP), None)
    again = bounds.solve("pose", actions(task, GRASP), None)
    assert (first.known, again.known) == (False, True)
    assert again.seconds == 0.0
    assert again.payload is first.payload


def test_robots_start_from_their_motion_under_another_cost(world: World, task: Task, ergonomics: Ergonomics) -> None:
    plain = PathBounds(world, slices=SLICES)
    before = plain.solve("pose", actions(task, GRASP), None)
    alone = PathBounds(world, ergonomics, slices=SLICES).solve("pose", actions(task, GRASP), None)
    after = PathBounds(world, ergonomics, slices=SLICES, reference=plain).solve("pose", actions(task, GRASP), None)
    assert after.cost == pytest.approx(alone.cost, rel=1e-3)
    robot = world.columns("baxter")
    assert after.payload.keyframes[0][robot] == pytest.approx(before.payload.keyframes[0][robot], abs=1e-2)
    assert len(after.payload.result.iterations) <= len(alone.payload.result.iterations)
