"""Plan a scene of your own: a person lifts a box from a table (no robot has to be installed)."""

from pathlib import Path

import lgp

SCENE = """
title = "A person lifts a box from a table"
domain = "screwdriver"
initial = ["on_table(box)", "free(human.right_hand)"]
goal = ["grasped(human.right_hand, box)"]

[human]
hands = ["right_hand"]

[tables.near]
position = [0.5, 0.1]
size = [0.6, 0.4]
height = 0.8

[objects.box]
size = [0.3, 0.1, 0.2]
mass = 2.0
on = "table.near"
"""
Path("lift.toml").write_text(SCENE)
plan = lgp.plan(lgp.load_scene("lift.toml"))
print(*plan.actions, sep="\n")
reba = plan.summary()["reba"]  # the score of the tables, not of the surrogate
print(f"REBA: mean {reba['mean']:.1f}, max {reba['max']}")
print({name: f"{value:.1e}" for name, value in plan.residuals.items()})
plan.save("plan")  # plan.json, path.parquet, postures.parquet: reba score plan/postures.parquet
