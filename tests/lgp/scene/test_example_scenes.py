"""The scenes in examples/scenes: each is planned, and its motion is the one of its robots."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.gantry import scene_values
from tests.support.lgp_worlds import needs_robots
from tests.support.paths import ROOT

SCENES = ROOT / "examples" / "scenes"


@pytest.mark.slow
@needs_robots
def test_a_box_goes_out_of_a_shelf_and_around_obstacles() -> None:
    plan = lgp.plan(SCENES / "shelf_and_pillar.toml", cost=None)
    assert [action.partition("(")[0] for action in plan.actions] == ["grasp", "place"]
    box = [one.pair for one in lgp.audit_plan(plan).contacts if "box" in one.pair]
    assert not any(name.startswith("obstacle.") for pair in box for name in pair)


@pytest.mark.slow
def test_a_robot_of_ones_own_drives_lifts_and_brings_the_box(tmp_path: Path) -> None:
    plan = lgp.plan(SCENES / "lift_arm.toml", cost=None, collisions=False)
    assert [action.partition("(")[0] for action in plan.actions] == ["grasp", "place", "grasp"]
    motion = plan.trajectory("cart")
    assert motion.joints == ("base_x", "base_y", "base_yaw", "lift", "pan", "shoulder", "elbow", "level", "wrist")
    moved = dict(zip(motion.joints, np.ptp(motion.position, axis=0), strict=True))
    assert moved["base_x"] > 0.3, "it drives"
    assert motion.position[0, 3] == 0.25, "metres"
    faults = {fault.kind for fault in lgp.audit_plan(plan).faults}
    assert not faults & {"speed", "limit", "attachment"}
    plan.save(tmp_path / "plan")
    summary = lgp.run_plan(tmp_path / "plan")
    assert summary["state"] == "finished"
    written = lgp.write_trajectories(plan, tmp_path / "robot.mcap", slow_down=True)
    assert len(written["actions"]) == 3


def test_every_example_scene_is_valid() -> None:
    files = [*SCENES.glob("*.toml"), *(ROOT / "benchmarks" / "scenes").glob("*.toml")]
    assert len(files) > 12
    for file in files:
        assert load_scene(file).title


def test_two_robots_of_one_model_share_the_work(tmp_path: Path) -> None:
    values: dict[str, Any] = scene_values(tmp_path)
    robot = values["robots"]["gantry"]
    near, far = (copy.deepcopy(robot) for _ in range(2))
    near |= {"position": [-2.0, 0.0, 0.0], "joints": {"x": 1.0, "z": 1.5}}
    far |= {"position": [3.5, 0.0, 0.0], "joints": {"x": -1.0, "z": 1.5}}
    values |= {
        "robots": {"near": near, "far": far},
        "initial": ["on_table(box)", "free(near.hand)", "free(far.hand)"],
        "goal": ["grasped(far.hand, box)"],
    }
    plan = lgp.plan(read_scene(values), cost=None)
    # Table a is out of reach of the other one.
    assert [action.partition("(")[2].split(", ")[1] for action in plan.actions] == [
        "near.hand",
        "near.hand",
        "far.hand",
    ]
    assert plan.trajectory("near").joints == plan.trajectory("far").joints == ("x", "y", "z", "tilt")
