"""LGP: task and motion planning for a human and robots with an ergonomic cost.

The logic-geometric program of Busch, Toussaint & Lopes 2018: from a scene and a PDDL domain, the sequence of actions
and the motion of all agents.

>>> import lgp
>>> lgp.load_scene("screwdriver").goal
('grasped(human.right_hand, screwdriver)',)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from lgp.errors import LgpError, LogicError, SceneError, WorldError
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene, shipped_scenes

if TYPE_CHECKING:
    from lgp.kinematics.world import World
    from lgp.motion import Motion
    from lgp.path.costs import Weights
    from lgp.path.ergonomics import Ergonomics
    from lgp.plan_record import Plan
    from lgp.planner import plan
    from lgp.sqp.problem import SolverOptions

__all__ = [
    "Ergonomics",
    "LgpError",
    "LogicError",
    "Motion",
    "Plan",
    "Scene",
    "SceneError",
    "SolverOptions",
    "Weights",
    "World",
    "WorldError",
    "load_scene",
    "plan",
    "shipped_scenes",
]
# Scenes are read without the numerical packages that planning needs.
_LATE = {
    "Ergonomics": "lgp.path.ergonomics",
    "Motion": "lgp.motion",
    "Plan": "lgp.plan_record",
    "SolverOptions": "lgp.sqp.problem",
    "Weights": "lgp.path.costs",
    "World": "lgp.kinematics.world",
    "plan": "lgp.planner",
}


def __getattr__(name: str) -> Any:
    if name in _LATE:
        return getattr(importlib.import_module(_LATE[name]), name)
    raise AttributeError(f"module 'lgp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
