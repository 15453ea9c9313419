"""Scenes and models that cannot be planned with, from the command line: one line that says what, where, by how much."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import dreba
from lgp.cli import cli
from lgp.errors import LgpError
from tests.support.invoke import invoke
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = pytest.mark.slow


SCENE = """
domain = "screwdriver"
initial = ["on_table(box)", "free(human.right_hand)"{more}]
goal = ["{goal}"]
[human]
hands = ["right_hand"]
{human}
[tables.near]
position = [{x}, 0.1]
size = [0.6, 0.4]
height = 0.8
[objects.box]
size = [0.3, 0.1, 0.2]
mass = 2.0
on = "{on}"
"""
VALUES = {"more": "", "goal": "grasped(human.right_hand, box)", "human": "", "x": "0.5", "on": "table.near"}


def said(tmp_path: Path, *arguments: str, **changes: str) -> str:
    """Return the error of `lgp plan` for a changed scene."""
    scene = tmp_path / "bench.toml"
    scene.write_text(SCENE.format(**VALUES | changes))
    done = invoke(cli, ["plan", str(scene), *(arguments or ("--no-ergonomics",))])
    assert isinstance(done.exception, ValueError), done.output
    text = str(done.exception)
    assert "\n" not in text
    assert done.stdout == ""
    return text


def test_an_unknown_object_names_the_known_ones(tmp_path: Path) -> None:
    assert "unknown 'boxx'; did you mean 'box'" in said(tmp_path, more=', "on_table(boxx)"')
    assert "unknown 'crate'" in said(tmp_path, goal="grasped(human.right_hand, crate)")
    assert "table.far" in said(tmp_path, on="table.far")


def test_an_unknown_joint_names_the_nearest(tmp_path: Path) -> None:
    text = said(tmp_path, human="joints = { right_elbow_Q = 20 }")
    assert "no joint 'right_elbow_Q'" in text
    assert "right_elbow_" in text.partition("did you mean")[2]


def test_a_goal_that_nothing_reaches_names_the_precondition(tmp_path: Path) -> None:
    scene = tmp_path / "held.toml"
    scene.write_text(SCENE.format(**VALUES).replace(', "free(human.right_hand)"', ""))
    done = invoke(cli, ["plan", str(scene), "--no-ergonomics"])
    assert isinstance(done.exception, LgpError)
    assert "free(human.right_hand)" in str(done.exception)
    assert "grasp" in str(done.exception)
    short = said(tmp_path, "--depth", "1", "--no-ergonomics", goal="placed(box, table.near)")
    assert "the goal needs at least 2 actions" in short


def test_a_table_out_of_reach_says_what_fails_by_how_much_and_when(tmp_path: Path) -> None:
    text = said(tmp_path, x="2.2")
    says(text, "phase 1, grasp(1, human.right_hand, box)", "cannot reach box on table.near", "at least 0.", " m short")
    near = said(tmp_path, x="1.45")
    says(near, "phase 1, grasp(1, human.right_hand, box)", "cannot reach box on table.near: 0.")


@needs_robots
def test_a_table_out_of_everyones_reach_says_so_for_every_hand(tmp_path: Path) -> None:
    from lgp.scene.scene_file import SHIPPED

    text = (SHIPPED / "screwdriver.toml").read_text().replace("position = [1.45, 0.90]", "position = [3.0, 2.0]")
    scene = tmp_path / "far.toml"
    scene.write_text(text)
    done = invoke(cli, ["plan", str(scene), "--no-ergonomics"])
    for hand in ("human.right_hand", "baxter.left", "baxter.right"):
        says(str(done.exception), f"{hand} cannot reach screwdriver on table.start: at least ")


def test_a_model_of_joints_that_the_human_lacks_is_refused(tmp_path: Path) -> None:
    poses = dreba.sample(300, classes=range(1, 8), rng=np.random.default_rng(0))
    model = dreba.QuadraticModel().fit(poses.angles, poses.reba)
    file = tmp_path / "model.json"
    model.save(file)
    data = json.loads(file.read_text())
    file.write_text(json.dumps(data).replace("wrist_twist_left", "tail_flexion"))
    text = said(tmp_path, "--cost", str(file))
    assert "tail_flexion" in text


@pytest.mark.parametrize("text", ["{", '{"format": "other"}', '{"format": "dreba-model", "version": 99}'])
def test_a_damaged_model_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "model.json"
    file.write_text(text)
    assert "model.json" in said(tmp_path, "--cost", str(file))
