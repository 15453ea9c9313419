"""A gantry robot with a gripper of balls and boxes, whose distances have closed forms, and plans made by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.plan_record import Plan
from lgp.scene.scene_file import read_scene

Array = NDArray[np.float64]
BALL, BELOW = 0.05, 0.10
"""[m] Radius of the ball that carries the gripper, and how far the grip point is below its middle."""
SLICES, SECONDS = 10, 2.0
URDF = """<robot name="gantry">
  <link name="base"/><link name="bridge"/><link name="cart"/><link name="mast"/>
  <joint name="x" type="prismatic"><parent link="base"/><child link="bridge"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" velocity="4" effort="1"/></joint>
  <joint name="y" type="prismatic"><parent link="bridge"/><child link="cart"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="4" effort="1"/></joint>
  <joint name="z" type="prismatic"><parent link="cart"/><child link="mast"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="3" velocity="4" effort="1"/></joint>
  <joint name="tilt" type="revolute"><parent link="mast"/><child link="tool"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" velocity="3" effort="1"/></joint>
  <link name="tool"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="tip"/>
  <joint name="tip_joint" type="fixed"><parent link="tool"/><child link="tip"/>
    <origin xyz="0 0 -0.10" rpy="3.141592653589793 0 0"/></joint>
  <link name="f1"><collision><origin xyz="0 0.005 0"/>
    <geometry><box size="0.02 0.01 0.06"/></geometry></collision></link>
  <link name="f2"><collision><origin xyz="0 -0.005 0"/>
    <geometry><box size="0.02 0.01 0.06"/></geometry></collision></link>
  <joint name="jaw1" type="prismatic"><parent link="tool"/><child link="f1"/><origin xyz="0 0 -0.10"/>
    <axis xyz="0 1 0"/>    <limit lower="0" upper="0.04" velocity="1" effort="1"/></joint>
  <joint name="jaw2" type="prismatic"><parent link="tool"/><child link="f2"/><origin xyz="0 0 -0.10"/>
    <axis xyz="0 -1 0"/>    <limit lower="0" upper="0.04" velocity="1" effort="1"/><mimic joint="jaw1"/></joint>
</robot>
"""
"""Jaws of 1 cm that meet at y = 0 when closed and are 8 cm apart when open."""
JOINTS = ("gantry.x", "gantry.y", "gantry.z", "gantry.tilt")
HEIGHT = 0.8
"""[m] Of both tables."""
TABLES = {
    "a": {"position": [0.0, 0.0], "size": [0.4, 0.4], "height": HEIGHT},
    "b": {"position": [1.0, 0.0], "size": [0.4, 0.4], "height": HEIGHT},
}
BOX = {"size": [0.10, 0.06, 0.08], "mass": 1.0, "on": "table.a", "grips": {"robot_hand": {"at": [0.0, 0.0, 0.0]}}}
GRIP = HEIGHT + 0.04 + BELOW
"""[m] Height of the ball when its grip point is in the middle of the box on a table."""


def scene_values(folder: Path, **changes: Any) -> dict[str, Any]:
    """Return a scene of the gantry, two tables and a box; changes replace whole tables of it."""
    file = folder / "gantry.urdf"
    file.write_text(URDF)
    values: dict[str, Any] = {
        "domain": "screwdriver",
        "initial": ["on_table(box)", "free(gantry.hand)"],
        "goal": ["grasped(gantry.hand, box)"],
        "phase_seconds": SECONDS,
        "slices": SLICES,
        "robots": {
            "gantry": {
                "model": str(file),
                "position": [0.0, 0.0, 0.0],
                "locked": ["jaw*"],
                "hands": {"hand": {"frame": "tip", "tilt": 30}},
            }
        },
        "tables": TABLES,
        "objects": {"box": BOX},
    }
    return values | changes


def made_plan(
    values: Mapping[str, Any], actions: Sequence[str], path: Array, start: Array, joints: Sequence[str] = JOINTS
) -> Plan:
    """Return the plan of some actions with a path (T, n), `SLICES` slices each."""
    count = len(path)
    return Plan(
        scene=read_scene(dict(values)),
        feasible=True,
        status="given",
        reason="",
        joints=tuple(joints),
        start=np.asarray(start, float),
        search={},
        actions=tuple(actions),
        time=np.arange(1, count + 1) * SECONDS / SLICES,
        phase=np.repeat(np.arange(len(actions)), SLICES),
        path=np.asarray(path, float),
    )


def through(*points: Sequence[float], each: Sequence[int]) -> Array:
    """Return the path (sum(each), n) from a first point, which is left out, to others: so many slices to each."""
    legs = [np.linspace(one, other, n + 1)[1:] for (one, other), n in zip(pairwise(points), each, strict=True)]
    return np.concatenate(legs)


START = (0.0, 0.0, GRIP + 0.3, 0.0)
TAKE = (0.0, 0.0, GRIP, 0.0)
LIFTED = (0.0, 0.0, GRIP + 0.2, 0.0)
OVER = (1.0, 0.0, GRIP + 0.2, 0.0)
PUT = (1.0, 0.0, GRIP, 0.0)


def carried(folder: Path, put: Sequence[float] = PUT, over: Sequence[float] = OVER, **changes: Any) -> Plan:
    """Return a plan that brings the box from table a to table b and draws back."""
    values = scene_values(folder, goal=["placed(box, table.b)"], **changes)
    lift = through(TAKE, LIFTED, over, put, each=(3, 4, 3))
    path = np.concatenate([through(START, TAKE, each=(10,)), lift])
    return made_plan(
        values, ["grasp(1, gantry.hand, box)", "place(2, gantry.hand, box, table.b)"], path, np.array(START)
    )
