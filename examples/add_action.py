"""A new action for the planner: one PDDL action and one record of its geometry. Here a hand inspects an object."""

from dataclasses import replace
from pathlib import Path

import lgp
from lgp.kinematics.modes import ACTIONS, ActionKind

Path("inspection.pddl").write_text("""
(define (domain inspection)
  (:requirements :strips :typing)
  (:types hand thing table - object human_hand robot_hand - hand)
  (:predicates (free ?e - hand) (on_table ?o - thing) (inspected ?o - thing))
  (:action inspect
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o))
    :effect (inspected ?o)))
""")
# The hand touches the object where it stands and holds still there; tilt is limited as at any table top.
ACTIONS["inspect"] = ActionKind(("hand", "object_name"), holds_still=True, works_at_table=True)

scene = lgp.load_scene("screwdriver")
near = replace(scene.tables["table.start"], position=(0.45, -0.2), height=1.0)
scene = replace(
    scene,
    domain="inspection.pddl",
    initial=("free(human.right_hand)", "on_table(screwdriver)"),
    goal=("inspected(screwdriver)",),
    tables=scene.tables | {"table.start": near},
)
plan = lgp.plan(scene, cost=None)
print(*plan.actions, sep="\n")
