"""A cost term of your own: loads are held near the body, measured as the level distance of the hand from the pelvis."""

from pathlib import Path

import numpy as np

import lgp
from lgp.kinematics import features
from lgp.kinematics.cost_terms import squares

NEAR = 0.30  # [m] Distances up to this cost nothing.


def reach(at):
    """10 for each metre beyond `NEAR`, squared, in each of both level directions of the world."""
    away = features.difference(at.place("human.right_hand"), at.place("human.pelvis_x"))[[0, 1]]
    return squares(features.stack(away * 10.0 - 10.0 * NEAR, away * -10.0 - 10.0 * NEAR), beyond=True)


lgp.register_cost_term("reach", reach)

SCENE = """
title = "A person lifts a box from a table"
domain = "screwdriver"
initial = ["on_table(box)", "free(human.right_hand)"]
goal = ["grasped(human.right_hand, box)"]

[cost.terms]
reach = {weight} # per second; on the command line: lgp --extension own_cost_term.py plan lift.toml

[human]
hands = ["right_hand"]

[tables.near]
position = [0.6, 0.1]
size = [0.6, 0.4]
height = 0.8

[objects.box]
size = [0.3, 0.1, 0.2]
mass = 2.0
on = "table.near"
"""

if __name__ == "__main__":
    for weight in (0.0, 1.0):
        Path("lift.toml").write_text(SCENE.format(weight=weight))
        plan = lgp.plan("lift.toml", cost=None, collisions=False)
        motion = lgp.Motion(plan)
        frames = motion.frames(["human.right_hand", "human.pelvis_x"])
        away = frames["human.right_hand"].position - frames["human.pelvis_x"].position
        print(f"weight {weight}: the hand is {np.linalg.norm(away[:, :2], axis=1).mean():.3f} m away on average")
        print("  cost:", {name: round(value, 2) for name, value in plan.costs.items()})
