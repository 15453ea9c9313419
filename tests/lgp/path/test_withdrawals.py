"""Plans in which hands draw back: at a handover before the taker moves off, and before another hand comes near."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from tests.support.gantry import BOX, TABLES, scene_values

pytestmark = pytest.mark.slow

ROD = {
    **BOX,
    "size": [0.60, 0.06, 0.08],
    "slide": 0.25,
    "grips": {"robot_hand": {"at": [0.0, 0.0, 0.03], "slide": 0.25}},
}
DOMAIN = """(define (domain two)
  (:requirements :strips :typing)
  (:types robot_hand thing table)
  (:predicates (grasped ?h - robot_hand ?o - thing) (free ?h - robot_hand) (placed ?o - thing ?t - table)
    (on_table ?o - thing))
  (:action grasp :parameters (?h - robot_hand ?o - thing) :precondition (and (free ?h) (on_table ?o))
    :effect (and (grasped ?h ?o) (not (free ?h)) (not (on_table ?o))))
  (:action place :parameters (?h - robot_hand ?o - thing ?t - table) :precondition (and (grasped ?h ?o))
    :effect (and (placed ?o ?t) (on_table ?o) (free ?h) (not (grasped ?h ?o))))
  (:action handover :parameters (?g - robot_hand ?o - thing ?h - robot_hand)
    :precondition (and (grasped ?g ?o) (free ?h))
    :effect (and (grasped ?h ?o) (free ?g) (not (free ?h)) (not (grasped ?g ?o)))))
"""
"""Two robots that hand over."""


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    (tmp_path / "two.pddl").write_text(DOMAIN)
    values = scene_values(tmp_path, objects={"box": ROD}, domain=str(tmp_path / "two.pddl"))
    gantry = values["robots"]["gantry"]
    values["robots"] = {
        "left": {**gantry, "joints": {"x": -0.3, "z": 1.3}},
        "right": {**gantry, "joints": {"x": 0.5, "z": 1.6}},
    }
    values["initial"] = ["on_table(box)", "free(left.hand)", "free(right.hand)"]
    values["tables"] = {**TABLES, "a": {**TABLES["a"], "size": [0.7, 0.4]}}
    return read_scene({**values, "goal": ["placed(box, table.b)"]})


@pytest.mark.parametrize("durations", ["fixed", "free"])
def test_at_a_handover_the_giver_is_away_before_the_taker_moves_off(scene: Scene, durations: str) -> None:
    given = read_scene({**scene.values, "durations": durations})
    sequence = ["grasp(left.hand, box)", "handover(left.hand, box, right.hand)", "place(right.hand, box, table.b)"]
    plan = lgp.plan(given, cost=None, sequence=sequence)
    assert plan.feasible, plan.reason
    assert plan.audit["faults"] == []
    taker = [plan.joints.index(f"right.{name}") for name in "xyz"]
    after = np.flatnonzero(plan.phase == 2)
    still = 3  # slices of 0.2 s at first
    np.testing.assert_allclose(plan.path[after[:still]][:, taker], plan.path[[after[0]]][:, taker].repeat(still, 0))


def test_who_put_a_thing_down_is_away_before_another_hand_comes(scene: Scene) -> None:
    sequence = ["grasp(left.hand, box)", "place(left.hand, box, table.a)", "grasp(right.hand, box)",
                "place(right.hand, box, table.b)"]  # fmt: skip
    plan = lgp.plan(scene, cost=None, sequence=sequence)
    assert plan.feasible, plan.reason
    assert plan.audit["faults"] == []
