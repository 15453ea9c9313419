"""Hands of two agents that carry one thing: planned, audited, and executed with both grippers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.execution.predicates import evaluate_predicate, grasped, gripper_commands
from lgp.execution.tracked_scene import carrier
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.kinematics import actions, features
from lgp.kinematics.world import World
from lgp.logic.task import Atom
from lgp.planner import task_of
from lgp.scene.scene_file import read_scene
from tests.support.gantry import BOX, TABLES, scene_values
from tests.support.says import says

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


def _a_gripper_cannot_turn_on_the_way(plan: lgp.Plan) -> None:
    """A tilt about the grip point of the second gripper leaves its position to the constraint, and is found."""
    path = plan.path.copy()
    middle = 3 * len(path) // 4
    path[middle, plan.joints.index("right.tilt")] += 0.2
    faults = lgp.audit_plan(replace(plan, path=path)).faults
    (fault,) = (one for one in faults if "carries too" in one.what and " turns " in one.what)
    says(fault.what, "right.hand turns 11.5 deg in rod", "its whole pose")


@pytest.mark.parametrize(("nominal", "holds"), [({"free"}, False), (set(), True)])
def test_what_a_person_carries_with_a_robot_may_be_in_its_gripper(
    tmp_path: Path, nominal: set[str], holds: bool
) -> None:
    world = World(read_scene(scene_values(tmp_path, human={"hands": ["right_hand"], "position": [0.5, 0.5]})))
    q = world.initial_configuration.copy()
    for _ in range(2):  # the gripper comes to the palm
        hands = world.at(q[None], ["human.right_hand", "gantry.hand"]).position[0]
        for axis, name in enumerate("xyz"):
            q[world.joints.index(f"gantry.{name}")] += (hands[0] - hands[1])[axis]
    view = TrackedWorld(world)
    for time in 0.05 * np.arange(8):
        box = TrackedPose(np.eye(3), hands[0], time)
        view.add(Observation(time, q, {"box": box}, frozenset({"gantry.hand"})))
    atoms = {Atom(name, ("gantry.hand",)) for name in nominal}
    for state in (
        grasped(view, "human.right_hand", "box", atoms),
        evaluate_predicate(view, Atom("grasped", ("human.right_hand", "box")), atoms),
    ):
        assert state.holds == holds
        assert holds or state.why == "box is still in a gripper"
    assert (carrier(view, "box", atoms | {Atom("grasped", ("human.right_hand", "box"))}) == "human.right_hand") == holds


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
    _a_gripper_cannot_turn_on_the_way(plan)
    plan.save(tmp_path / "plan")
    summary = lgp.run_plan(tmp_path / "plan")
    assert (summary["state"], summary["replanned"]) == ("finished", 0), summary["why"]
