"""Constraints that actions bring themselves: derivatives, plans that meet them, and reasons where none can."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.collision.contacts import Clock, declared_contacts
from lgp.kinematics import features
from lgp.kinematics.features import Feature
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.impossible_actions import impossible
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import read_scene
from tests.support.gantry import scene_values
from tests.support.lgp_worlds import differences
from tests.support.own_actions import inspection, registered
from tests.support.says import says

NEAR = 0.30


def constraint(says: str, feature: Any, **more: Any) -> lgp.ActionConstraint:
    return lgp.ActionConstraint(says, feature, **more)


SEES = constraint("the camera sees the part", lambda at: features.outside_cone(at["hand"], at["object"], 10.0), unit="")
APART = constraint(
    "the camera is 30 cm from the part", lambda at: features.distance(at["hand"], at["object"]) - NEAR, equal=True
)
ABOVE = constraint(
    "the camera stays above the part",
    lambda at: -features.difference(at["hand"], at["object"])[[2]] + 0.05,
    along=True,
)
IN_PLANE = constraint(
    "the camera moves in a plane", lambda at: features.position(at.place("gantry.tip"))[[1]], along=True, equal=True
)
INSPECT = lgp.ActionKind(("hand", "object"), constraints=(IN_PLANE, SEES, APART, ABOVE))


def scene(folder: Path, **changes: Any) -> lgp.Scene:
    values = scene_values(folder)
    values["robots"]["gantry"]["joints"] = {"x": 0.5, "z": 1.4}
    values |= {"domain": inspection(folder), "goal": ["inspected(box)"], "slices": 10}
    return read_scene(values | changes)


def problem_of(scene: lgp.Scene, **options: Any) -> PathProblem:
    skeleton = parse_sequence(task_of(scene), ["inspect(gantry.hand, box)"])
    return PathProblem(World(scene), Phases.of(scene, skeleton), **options)


def test_rows_and_their_derivatives(tmp_path: Path) -> None:
    with registered("inspect", INSPECT):
        problem = problem_of(scene(tmp_path))
        x = np.random.default_rng(0).uniform(problem.lower, problem.upper)
        about = problem.constraints.eq_rows
        assert sum(row.name == "the camera moves in a plane" for row in about) == 10
        assert sum(row.name == APART.says for row in about) == 1
        rng = np.random.default_rng(1)
        y_eq, y_in = rng.standard_normal(len(about)), np.abs(rng.standard_normal(len(problem.constraints.in_rows)))
        model = problem.linearise(x, y_eq, y_in)
        for jacobian, part in ((model.eq_jac, 1), (model.in_jac, 2)):
            true = differences(lambda at: problem.evaluate(at[0])[part][None], x[None])[0]  # noqa: B023
            np.testing.assert_allclose(jacobian.toarray(), true, atol=1e-6)
        q, z = problem.split(x)
        values = problem.constraints.evaluate(q, z)
        (hessian,) = problem.constraints.equality_hessians(values, q, z, y_eq)
        (columns,) = problem.constraints.switch_columns()

        def slope(at: Any) -> Any:
            only = np.where([row.name == APART.says for row in about], y_eq, 0.0)
            return (problem.linearise(at[0], 0.0 * y_eq, 0.0 * y_in).eq_jac.toarray().T @ only)[None]

        np.testing.assert_allclose(hessian, differences(slope, x[None])[0][np.ix_(columns, columns)], atol=1e-3)
        full = model.hessian.toarray()
        assert np.linalg.eigvalsh(full + full.T - np.diag(np.diag(full))).min() > -1e-8


def test_a_plan_meets_them_and_its_audit_sees_it(tmp_path: Path) -> None:
    with registered("inspect", INSPECT):
        plan = lgp.plan(scene(tmp_path), cost=None)
        assert plan.feasible, plan.reason
        motion = lgp.Motion(plan)
        camera, part = motion.frames(["gantry.hand"])["gantry.hand"], motion.object_poses("box").position
        away = part[-1] - camera.position[-1]
        assert np.linalg.norm(away) == pytest.approx(NEAR, abs=1e-4)
        assert away @ camera.rotation[-1, :, 2] / NEAR >= np.cos(np.radians(10.0)) - 1e-6
        assert (camera.position[1:, 2] - part[1:, 2]).min() >= 0.05 - 1e-6
        assert np.abs(camera.position[1:, 1]).max() < 1e-4
        assert plan.audit["faults"] == []
        moved = np.array([0.0, 0.0, -0.02, 0.0])
        audit = lgp.audit_plan(replace(plan, path=plan.path + moved))
        (missed,) = [fault.what for fault in audit.faults if fault.kind == "attachment"]
        assert missed.startswith("inspect(1, gantry.hand, box): not met by 19.7 mm: the camera is 30 cm"), missed


def test_the_reason_names_the_constraint(tmp_path: Path) -> None:
    far = constraint("the camera is high above the part", lambda at: -features.position(at["hand"])[[2]] + 9.0)
    with registered("inspect", lgp.ActionKind(("hand", "object"), constraints=(far,))):
        plan = lgp.plan(scene(tmp_path), cost=None)
    assert not plan.feasible
    assert "phase 1, inspect(1, gantry.hand, box): not met by 6." in plan.reason
    assert "the camera is high above the part" in plan.reason


@pytest.mark.parametrize(
    ("feature", "facts"),
    [
        (lambda at: 3.0, ("returns a float", "a Feature")),
        (lambda at: Feature(np.zeros(2), np.zeros((2, 1))), ("values (2,)", "(2, m)")),
        (lambda at: Feature(np.zeros((2, 1)), np.zeros((2, 1, 3))), ("Jacobian (2, 1, 3)", "(2, m, 4)")),
        (lambda at: features.position(at["table"]), ("no role 'table'", "hand, object")),
        (lambda at: features.position(at.place("gantry.tipp")), ("no frame 'gantry.tipp'", "gantry.tip")),
        (lambda at: features.position(at["hand"]) - float("nan"), ("'it holds'", "nan in its value", "finite numbers")),
        (
            lambda at: Feature(np.zeros((len(at.q), 1)), np.full((len(at.q), 1, 4), np.inf)),
            ("inf in its Jacobian", "finite numbers"),
        ),
        (lambda at: features.axis(at["hand"], 5), ("'it holds'", "fails", "test_action_constraints.py", "IndexError")),
        (
            lambda at: features.position(features.offset(at["hand"], (0.0, 0.1, 0.0), (0.0, 0.0, 0.0))),  # type: ignore[arg-type]
            ("turn has shape (3,)", "(3, 3)"),
        ),
    ],
)
def test_wrong_constraints_are_told_in_one_line(tmp_path: Path, feature: Any, facts: tuple[str, ...]) -> None:
    kind = lgp.ActionKind(("hand", "object"), constraints=(constraint("it holds", feature),))
    with registered("inspect", kind), pytest.raises(lgp.LgpError) as error:
        problem_of(scene(tmp_path))
    says(error, *facts)


def test_a_sequence_of_fixed_grips_has_no_variables(tmp_path: Path) -> None:
    values = scene_values(tmp_path)
    values["robots"]["gantry"]["joints"] = {"z": 1.4}
    values["robots"]["gantry"]["hands"]["hand"]["freedom"] = "fixed"
    plan = lgp.plan(read_scene(values), cost=None)
    assert plan.feasible, plan.reason
    assert plan.variables == {}


LIFT = lgp.ActionKind(("hand", "object", "second"), attaches_to="hand")
TWO = """(define (domain two) (:requirements :strips :typing :equality)
  (:types hand thing table - object human_hand robot_hand - hand)
  (:predicates (free ?e - hand) (on_table ?o - thing) (grasped ?e - hand ?o - thing))
  (:action lift :parameters (?l - hand ?o - thing ?r - hand)
    :precondition (and (free ?l) (free ?r) (on_table ?o) (not (= ?l ?r)))
    :effect (and (grasped ?l ?o) (not (free ?l)) (not (free ?r)))))"""


@pytest.mark.parametrize(("mass", "reason"), [(5.0, ""), (7.0, "carry up to 6 kg")])
def test_two_hands_carry_what_both_may(tmp_path: Path, mass: float, reason: str) -> None:
    values = scene_values(tmp_path, domain=str(tmp_path / "two.pddl"), goal=["grasped(gantry.hand, box)"])
    (tmp_path / "two.pddl").write_text(TWO)
    hand = values["robots"]["gantry"]["hands"]["hand"] | {"payload": 3.0}
    values["robots"]["gantry"]["hands"] = {"hand": hand, "other": {**hand, "frame": "tool"}}
    values["initial"] = ["on_table(box)", "free(gantry.hand)", "free(gantry.other)"]
    values["objects"] = {"box": {**values["objects"]["box"], "mass": mass}}
    with registered("lift", LIFT):
        one = read_scene(values)
        skeleton = parse_sequence(task_of(one), ["lift(gantry.hand, box, gantry.other)"])
        phases = Phases.of(one, skeleton)
        why = impossible(phases)
        assert why.endswith(reason), why
        assert bool(why) == bool(reason)
        modes = ModeSequence(World(one), phases.switches)
        assert modes.second_intervals == (("gantry.other", 0, 0),)
        clock = Clock.of(np.full(phases.count, 2.0), 2.0, 10)
        touching = {(one.first, one.second) for one in declared_contacts(modes, clock) if one.touches}
        assert {("gantry.hand", "box"), ("gantry.other", "box")} <= touching
