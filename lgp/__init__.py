"""LGP: joint task and motion planning over human and robot with an ergonomic cost.

The logic-geometric program of Busch, Toussaint & Lopes 2018: a scene and a PDDL domain in, the sequence of actions and
the motion of everybody out.

>>> import lgp
>>> lgp.load_scene("screwdriver").goal
('grasped(human.right_hand, screwdriver)',)
"""

from __future__ import annotations

from lgp.errors import LgpError, LogicError, SceneError, WorldError
from lgp.plan_record import Plan
from lgp.planner import plan
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene, shipped_scenes

__all__ = [
    "LgpError",
    "LogicError",
    "Plan",
    "Scene",
    "SceneError",
    "WorldError",
    "load_scene",
    "plan",
    "shipped_scenes",
]
