"""Methods and constructors of public classes: wrong types end in the package's own error, one line, as of functions."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dreba
import lgp
import reba
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.wrong_values import refuses

SCORES = reba.score(pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]}))
POSTURES = SCORES.postures
RULES = reba.PRESETS["measured"]
ERROR = reba.MeasurementError.of("optical")
GOOD: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Factors.of": (reba.Factors.of, {"factors": None}),
    "MeasurementError": (reba.MeasurementError, vars(ERROR)),
    "MeasurementError.of": (reba.MeasurementError.of, {"which": "optical"}),
    "MeasurementError.without": (ERROR.without, {"columns": ()}),
    "PostureTable": (reba.PostureTable, {"data": POSTURES.data}),
    "Rules": (reba.Rules, {one.name: getattr(RULES, one.name) for one in fields(RULES)}),
    "Rules.replace": (RULES.replace, {one.name: getattr(RULES, one.name) for one in fields(RULES)}),
    "Scores.explain": (SCORES.explain, {"time": 0.0}),
    "Scores.frame_at": (SCORES.frame_at, {"time": 0.0}),
    "Scores.improve": (SCORES.improve, {"time": 0.0}),
    "SolverOptions": (lgp.SolverOptions, {one.name: one.default for one in fields(lgp.SolverOptions)}),
    "Weights": (lgp.Weights, {"acceleration": 1.0, "ergonomics": 1.0, "time": 0.2}),
}
"""Name -> function and its arguments; what needs a scene or a plan is below, the surrogates are in tests/dreba."""


@pytest.mark.parametrize("name", GOOD)
def test_wrong_types_end_in_one_line(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    function, good = GOOD[name]
    for argument in good:
        refuses(f"{name}({argument}=)", lambda wrong, argument=argument: function(**{**good, argument: wrong}))


def test_wrong_types_for_scenes_and_plans_end_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from lgp.scene.scene_file import read_scene

    monkeypatch.chdir(tmp_path)
    scene = read_scene(HUMAN_ONLY, "box")
    world = lgp.World(scene)
    plan = lgp.plan(scene, cost=None, slices=2)
    motion = lgp.Motion(plan)
    model = dreba.load("quadratic")
    calls: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
        "Ergonomics": (lgp.Ergonomics, {"world": world, "model": model, "payload": "linear"}),
        "Motion": (lgp.Motion, {"plan": plan, "world": world}),
        "Motion.frames": (motion.frames, {"names": ["human.head"]}),
        "Motion.joints_of": (motion.joints_of, {"person": scene.human}),
        "Motion.object_poses": (motion.object_poses, {"name": "box"}),
        "Plan.save": (plan.save, {"folder": "plan"}),
        "Plan.trajectory": (plan.trajectory, {"agent": "human", "step": None}),
        "Scene.draw_heights": (scene.draw_heights, {"rng": np.random.default_rng(0)}),
        "Scene.ergonomic_weight": (scene.ergonomic_weight, {"slices": 4}),
        "Scene.with_heights": (scene.with_heights, {"heights": {}}),
        "Scene.with_time_weight": (scene.with_time_weight, {"weight": 1.0}),
        "Weights.of": (lgp.Weights.of, {"scene": scene, "slices": None}),
        "World": (lgp.World, {"scene": scene}),
    }
    for name, (function, good) in calls.items():
        for argument in good:
            refuses(f"{name}({argument}=)", lambda wrong, f=function, g=good, a=argument: f(**{**g, a: wrong}))
        assert set(good) <= set(inspect.signature(function).parameters)
