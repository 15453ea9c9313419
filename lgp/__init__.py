"""LGP: task and motion planning for a human and robots with an ergonomic cost.

The logic-geometric program of Busch, Toussaint & Lopes 2018: from a scene and a PDDL domain, the sequence of actions
and the motion of all agents.

>>> import lgp
>>> lgp.load_scene("screwdriver").goal
('grasped(human.right_hand, screwdriver)',)
"""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # that of typing takes long to import, and Ctrl-C is not handled yet
if TYPE_CHECKING:
    from typing import Any

    from lgp.agent_trajectory import AgentTrajectory
    from lgp.audit.audit import audit_plan
    from lgp.audit.faults import Audit
    from lgp.errors import LgpError, LogicError, SceneError, WorldError
    from lgp.execution.replan_now import replan
    from lgp.execution.run_plan import run_plan
    from lgp.execution.trajectory_export import write_trajectories
    from lgp.experiments.all_experiments import experiment_all
    from lgp.experiments.screwdriver_experiment import experiment_screwdriver
    from lgp.experiments.toolbox import experiment_toolbox
    from lgp.kinematics.actions import ActionConstraint, ActionKind, ActionMoment, Sentences, register_action
    from lgp.kinematics.cost_terms import ConfigurationMoment, TermValues, register_cost_term
    from lgp.kinematics.world import World
    from lgp.motion import Motion
    from lgp.page.page import write_page
    from lgp.path.costs import Weights
    from lgp.path.ergonomics import Ergonomics
    from lgp.plan_record import Plan
    from lgp.planner import plan
    from lgp.scene.model import Scene
    from lgp.scene.scene_file import load_scene, shipped_scenes
    from lgp.sqp.problem import SolverOptions
    from lgp.study.study import run_study
    from lgp.workplace.improvement import MovedWorkplace, improve

__all__ = [
    "ActionConstraint",
    "ActionKind",
    "ActionMoment",
    "AgentTrajectory",
    "Audit",
    "ConfigurationMoment",
    "Ergonomics",
    "LgpError",
    "LogicError",
    "Motion",
    "MovedWorkplace",
    "Plan",
    "Scene",
    "SceneError",
    "Sentences",
    "SolverOptions",
    "TermValues",
    "Weights",
    "World",
    "WorldError",
    "audit_plan",
    "experiment_all",
    "experiment_screwdriver",
    "experiment_toolbox",
    "improve",
    "load_scene",
    "plan",
    "register_action",
    "register_cost_term",
    "replan",
    "run_plan",
    "run_study",
    "shipped_scenes",
    "write_page",
    "write_trajectories",
]
# Scenes are read without the numerical packages that planning needs; the commands handle interrupts before any import.
_LAZY = {
    "ActionConstraint": "lgp.kinematics.actions",
    "ActionKind": "lgp.kinematics.actions",
    "ActionMoment": "lgp.kinematics.actions",
    "AgentTrajectory": "lgp.agent_trajectory",
    "Audit": "lgp.audit.faults",
    "ConfigurationMoment": "lgp.kinematics.cost_terms",
    "Ergonomics": "lgp.path.ergonomics",
    "LgpError": "lgp.errors",
    "LogicError": "lgp.errors",
    "Motion": "lgp.motion",
    "Plan": "lgp.plan_record",
    "Scene": "lgp.scene.model",
    "SceneError": "lgp.errors",
    "Sentences": "lgp.kinematics.actions",
    "TermValues": "lgp.kinematics.cost_terms",
    "SolverOptions": "lgp.sqp.problem",
    "Weights": "lgp.path.costs",
    "World": "lgp.kinematics.world",
    "WorldError": "lgp.errors",
    "audit_plan": "lgp.audit.audit",
    "load_scene": "lgp.scene.scene_file",
    "shipped_scenes": "lgp.scene.scene_file",
    "plan": "lgp.planner",
    "experiment_all": "lgp.experiments.all_experiments",
    "experiment_screwdriver": "lgp.experiments.screwdriver_experiment",
    "experiment_toolbox": "lgp.experiments.toolbox",
    "register_action": "lgp.kinematics.actions",
    "register_cost_term": "lgp.kinematics.cost_terms",
    "replan": "lgp.execution.replan_now",
    "run_plan": "lgp.execution.run_plan",
    "write_trajectories": "lgp.execution.trajectory_export",
    "run_study": "lgp.study.study",
    "improve": "lgp.workplace.improvement",
    "MovedWorkplace": "lgp.workplace.improvement",
    "write_page": "lgp.page.page",
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        try:
            return getattr(importlib.import_module(_LAZY[name]), name)
        except ModuleNotFoundError as error:
            from reba.extras import missing

            raise missing(error.name or "", f"lgp.{name}") from error
    raise AttributeError(f"module 'lgp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
