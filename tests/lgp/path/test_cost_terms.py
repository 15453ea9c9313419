"""Cost terms of one's own and costs of actions: derivatives, bounds, plans that take them into account, messages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.kinematics import cost_terms, features
from lgp.kinematics.cost_terms import squares
from lgp.kinematics.world import World
from lgp.logic.pddl import SHIPPED
from lgp.path.bounds import PathBounds
from lgp.path.many_starts import ManyStarts
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import read_scene
from tests.support.gantry import scene_values
from tests.support.lgp_worlds import differences
from tests.support.says import says

COSTS = "(:functions (total-cost) - number)"
SEQUENCE = ["grasp(gantry.hand, box)", "place(gantry.hand, box, table.b)"]


@pytest.fixture(autouse=True)
def _terms() -> Iterator[None]:
    before = dict(cost_terms._registered)
    lgp.register_cost_term(
        "low", lambda at: squares(features.position(at.place("gantry.hand"))[[2]] - 1.0, beyond=True)
    )
    lgp.register_cost_term("straight", lambda at: squares(at.joint("gantry.tilt") - 0.3))
    yield
    cost_terms._registered.clear()
    cost_terms._registered.update(before)


def scene(folder: Path, terms: dict[str, float], **changes: Any) -> lgp.Scene:
    values = scene_values(folder, goal=["placed(box, table.b)"], cost={"terms": terms})
    values["robots"]["gantry"]["joints"] = {"z": 1.6}
    return read_scene(values | changes)


def problem_of(scene: lgp.Scene, **options: Any) -> PathProblem:
    return PathProblem(World(scene), Phases.of(scene, parse_sequence(task_of(scene), SEQUENCE)), **options)


def test_derivatives_on_all_slices_and_on_the_joints_that_act(tmp_path: Path) -> None:
    one = scene(tmp_path, {"low": 2.0, "straight": 3.0})
    problem = problem_of(one)
    x = np.random.default_rng(0).uniform(problem.lower, problem.upper)
    rows = np.zeros(len(problem.constraints.eq_rows)), np.zeros(len(problem.constraints.in_rows))
    slope = differences(lambda at: np.array([[problem.evaluate(at[0])[0]]]), x[None], 1e-5)[0, 0]
    assert problem.linearise(x, *rows).gradient == pytest.approx(slope, abs=1e-4 * np.abs(slope).max())
    costs = problem.costs(x)
    heights = World(one).at(problem.split(x)[0], ["gantry.hand"]).position[:, 0, 2]
    tilts = problem.split(x)[0][:, 3]
    expected = 0.2 * (2.0 * np.maximum(heights - 1.0, 0.0) ** 2 + 3.0 * (tilts - 0.3) ** 2).sum()
    assert costs.terms == pytest.approx(expected)
    assert costs.total == pytest.approx(costs.acceleration + costs.time + expected)

    starts = ManyStarts(problem_of(one, knots=problem.phases.keyframes))
    u = np.random.default_rng(1).uniform(starts.lower, starts.upper, (2, starts.n))
    zeros = [np.zeros((2, part.shape[1])) for part in starts.evaluate(u)[1:]]
    true = differences(lambda at: np.stack([starts.evaluate(np.stack([at[0], u[1]]))[0][:1]]), u[:1], 1e-5)[0, 0]
    assert starts.linearise(u, *zeros).gradient[0] == pytest.approx(true, abs=1e-4 * np.abs(true).max())


def test_durations_take_them_into_account(tmp_path: Path) -> None:
    problem = problem_of(scene(tmp_path, {"straight": 3.0}, durations="free"))
    x = np.random.default_rng(0).uniform(problem.lower, problem.upper)

    def cost(logs: Any) -> Any:
        phases = Phases.of(problem.phases.scene, problem.phases.actions, None, tuple(np.exp(logs[0])))
        return np.array([[PathProblem(problem.world, phases).costs(x).total]])

    logs = np.log(problem.phases.phase_durations)[None]
    timed = Phases.of(problem.phases.scene, problem.phases.actions, None, tuple(np.exp(logs[0])))
    slope = PathProblem(problem.world, timed).slope_by_durations(x)
    np.testing.assert_allclose(slope, differences(cost, logs, 1e-6)[0, 0], rtol=1e-5)


def test_levels_with_terms_and_action_costs_are_bounds(tmp_path: Path) -> None:
    one = scene(tmp_path, {"low": 5.0, "straight": 1.0})
    task = task_of(one)
    bounds = PathBounds(World(one), None)
    skeleton = parse_sequence(task, SEQUENCE)
    pose = bounds.solve("pose", skeleton[:1], None)
    last = bounds.solve("pose", skeleton, pose)
    sequence = bounds.solve("sequence", skeleton, last)
    path = bounds.solve("path", skeleton, sequence)
    assert path.feasible, path.reason
    assert pose.cost <= sequence.cost <= path.cost * (1.0 + 1e-6)
    assert last.cost <= sequence.cost * (1.0 + 1e-6)


def test_a_plan_states_and_avoids_them(tmp_path: Path) -> None:
    free, low = (lgp.plan(scene(tmp_path, terms), None, collisions=False) for terms in ({}, {"straight": 50.0}))
    assert free.costs["terms"] == 0.0
    assert 0.0 < low.costs["terms"] < 50.0 * 4.0 * 0.3**2 / 2.0
    assert low.costs["total"] == pytest.approx(sum(value for key, value in low.costs.items() if key != "total"))
    at = low.joints.index("gantry.tilt")
    assert abs(low.path[10, at] - 0.3) < abs(free.path[10, at] - 0.3)
    low.save(tmp_path / "plan")
    assert lgp.Plan.load(tmp_path / "plan").scene.cost.terms == {"straight": 50.0}


def test_costs_of_actions_are_part_of_the_objective(tmp_path: Path) -> None:
    text = (SHIPPED / "screwdriver.pddl").read_text()
    text = text.replace(":strips", ":strips :action-costs").replace("(:action grasp", f"{COSTS} (:action grasp")
    text = text.replace("(and (grasped", "(and (increase (total-cost) 1) (grasped")
    file = tmp_path / "costly.pddl"
    file.write_text(text.replace("(and (placed", "(and (increase (total-cost) 7) (placed"))
    plan = lgp.plan(scene(tmp_path, {}, domain=str(file)), None, collisions=False)
    assert plan.feasible, plan.reason
    assert plan.costs["actions"] == 8.0
    assert plan.costs["total"] == pytest.approx(8.0 + plan.costs["acceleration"] + plan.costs["time"])
    assert plan.search["bound"] <= plan.costs["total"] + 1e-9


@pytest.mark.parametrize(
    ("term", "facts"),
    [
        (lambda at: 3.0, ("returns a float", "TermValues")),
        (lambda at: squares(at.joint("gantry.tilt")[[0]]) and at.place("box"), ("object 'box'", "a hand, a table")),
        (lambda at: squares(at.joint("gantry.tilted")), ("no joint 'gantry.tilted'", "did you mean 'gantry.tilt'")),
        (lambda at: lgp.TermValues(np.full(len(at.q), -1.0), 0 * at.q, 0 * at.q[:, None]), ("-1", "0 or more")),
        (lambda at: squares(at.joint("gantry.tilt") * float("nan")), ("'odd' has nan", "finite numbers")),
        (lambda at: lgp.TermValues(np.zeros(len(at.q)), 0 * at.q + np.inf, 0 * at.q[:, None]), ("has inf", "finite")),
        (lambda at: at.hand, ("cost term 'odd' fails", "test_cost_terms.py", "AttributeError")),
        (lambda at: lgp.TermValues(np.zeros(1), 0 * at.q, 0 * at.q[:, None]), ("(1,)", "(2, 4)")),
    ],
)
def test_wrong_terms_are_told_in_one_line(tmp_path: Path, term: Any, facts: tuple[str, ...]) -> None:
    lgp.register_cost_term("odd", term)
    with pytest.raises(lgp.LgpError) as error:
        problem_of(scene(tmp_path, {"odd": 1.0}))
    says(error, *facts)


@pytest.mark.parametrize(("name", "hint"), [("strait", "did you mean 'straight'"), ("heavy", "is not registered; ")])
def test_a_term_that_is_not_registered_says_how(tmp_path: Path, name: str, hint: str) -> None:
    with pytest.raises(lgp.LgpError) as error:
        problem_of(scene(tmp_path, {name: 1.0}))
    says(error, repr(name), hint, "lgp.register_cost_term, or give its file with --extension")


def test_names_of_terms(tmp_path: Path) -> None:
    with pytest.raises(lgp.LgpError) as error:
        lgp.register_cost_term("two words", lambda at: squares(at.joint("x")))
    says(error, "'two words'", "letters")
    with pytest.raises(lgp.LgpError) as error:
        problem_of(scene(tmp_path, {"lows": 1.0}))
    says(error, "'lows'", "did you mean 'low'")
    with pytest.raises(lgp.LgpError) as error:
        scene(tmp_path, {"low": -1.0})
    says(error, "low", "-1")
