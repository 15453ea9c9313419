"""Faults of the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

import lgp
from lgp.execution.faults import KINDS, parse_fault
from lgp.scene.scene_file import read_scene
from tests.support.execution_plans import saved, went
from tests.support.gantry import scene_values
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = [pytest.mark.slow, needs_robots]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return saved(tmp_path)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("moved", "KIND@ACTION"),
        ("moved@0", "KIND@ACTION"),
        ("mved@1", "did you mean 'moved'"),
        ("moved@1:1.2.3", "1.2.3"),
    ],
)
def test_a_wrong_fault_is_refused(text: str, hint: str) -> None:
    with pytest.raises(lgp.LgpError) as error:
        parse_fault(text)
    says(error, text, hint)


def test_a_fault_after_the_last_action_is_refused(folder: Path) -> None:
    with pytest.raises(lgp.LgpError) as error:
        went(folder, "moved@4")
    says(error, "moved@4", "3 actions")


def test_every_kind_of_fault_is_explained() -> None:
    assert all(parse_fault(f"{kind}@1").amount == amount for kind, (amount, _) in KINDS.items())


def test_a_robot_that_cannot_turn_in_every_direction_places_what_was_moved(tmp_path: Path) -> None:
    # The grip is tracked with noise, and the gantry cannot level what it holds.
    scene = read_scene(scene_values(tmp_path, goal=["placed(box, table.b)"]))
    plan = lgp.plan(scene, None, collisions=False, seconds=600)
    assert plan.feasible, plan.reason
    plan.save(tmp_path / "plan")
    summary, events = went(tmp_path / "plan", "moved@1")
    assert summary["state"] == "finished", summary["why"]
    assert [event.kind for event in events].count("ended") == 2
