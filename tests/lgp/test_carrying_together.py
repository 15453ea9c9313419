"""Hands of two agents that carry one thing: planned, audited, and executed with both grippers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.execution.predicates import gripper_commands
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.kinematics import actions, features
from lgp.planner import task_of
from lgp.scene.scene_file import read_scene
from tests.support.gantry import BOX, TABLES, scene_values

APART = 0.4
DOMAIN = """(define (domain together) (:requirements :strips :typing :negative-preconditions :equality)
  (:types hand thing table - object human_hand robot_hand - hand)
  (:predicates (free ?e - hand) (on_table ?o - thing) (grasped ?e - hand ?o - thing) (placed ?o - thing ?p - table)
    (helps ?e - hand ?o - thing))
  (:action take :parameters (?l - hand ?o - thing ?r - hand)
    :precondition (and (free ?l) (free ?r) (on_table ?o) (not (= ?l ?r)))
    :effect (and (grasped ?l ?o) (helps ?r ?o) (not (free ?l)) (not (free ?r)) (not (on_table ?o))))
  (:action bring :parameters (?l - hand ?o - thing ?r - hand ?p - table)
    :precondition (and (grasped ?l ?o) (helps ?r ?o) (not (free ?r)))
    :effect (and (placed ?o ?p) (on_table ?o) (free ?l) (free ?r) (not (grasped ?l ?o)) (not (helps ?r ?o)))))"""


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    before = dict(actions._registered)
    there = lgp.ActionConstraint(
        "the second hand is at the other end",
        lambda at: features.relative_position(at["object"], at["second"]) - np.array([APART / 2, 0.0, 0.04]),
        equal=True,
    )
    along = lgp.ActionConstraint(there.says, there.feature, equal=True, along=True)
    lgp.register_action("take", lgp.ActionKind(("hand", "object", "second"), attaches_to="hand", constraints=(there,)))
    lgp.register_action(
        "bring",
        lgp.ActionKind(
            ("hand", "object", "second", "table"), attaches_to="table", given_by="hand", constraints=(along,)
        ),
    )
    yield
    actions._registered.clear()
    actions._registered.update(before)


def _both_let_go_where_one_is_off(plan: lgp.Plan) -> None:
    """What is put down is given to no hand: a hand that is off keeps no gripper closed."""
    motion = lgp.Motion(plan)
    q = plan.path[-1].copy()
    q[plan.joints.index("right.x")] += 0.3
    view, rod = TrackedWorld(motion.world), motion.object_poses("rod")
    for time in (0.0, 0.1, 0.2, 0.3):
        at = TrackedPose(rod.rotation[-1], rod.position[-1], time)
        view.add(Observation(time, q, {"rod": at}, frozenset({"left.hand", "right.hand"})))
    task = task_of(plan.scene)
    commands = gripper_commands(task, task.action("bring(left.hand, rod, right.hand, table.b)"), view)
    assert sorted(commands) == [("left.hand", False), ("right.hand", False)]


def test_two_robots_carry_one_thing(tmp_path: Path) -> None:
    (tmp_path / "together.pddl").write_text(DOMAIN)
    values = scene_values(tmp_path, domain=str(tmp_path / "together.pddl"), goal=["placed(rod, table.b)"])
    gantry = values["robots"]["gantry"]
    values["robots"] = {side: gantry | {"joints": {"x": x, "z": 1.5}} for side, x in (("left", -0.3), ("right", 0.3))}
    values["initial"] = ["on_table(rod)", "free(left.hand)", "free(right.hand)"]
    values["tables"] = {name: {**table, "size": [0.7, 0.4]} for name, table in TABLES.items()}
    grips = {"robot_hand": {"at": [-APART / 2, 0.0, 0.04], "along": [0, 0, -1]}}
    values["objects"] = {"rod": {**BOX, "size": [0.6, 0.06, 0.08], "grips": grips}}
    plan = lgp.plan(
        read_scene(values),
        cost=None,
        depth=2,
        sequence=["take(left.hand, rod, right.hand)", "bring(left.hand, rod, right.hand, table.b)"],
    )
    assert plan.feasible, plan.reason
    assert plan.audit["faults"] == []
    later = lgp.replan(plan, 1.3 * plan.scene.phase_seconds)
    assert later.actions == ("bring(1, left.hand, rod, right.hand, table.b)",), later.reason
    _both_let_go_where_one_is_off(plan)
    plan.save(tmp_path / "plan")
    summary = lgp.run_plan(tmp_path / "plan")
    assert (summary["state"], summary["replanned"]) == ("finished", 0), summary["why"]
