"""Scenes of examples/scenes with actions, domains and robots of their own: planned, audited, run and shown."""

from __future__ import annotations

import html
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.execution.events import Event
from lgp.extensions import run_extension
from lgp.kinematics import actions
from tests.support.paths import ROOT

pytestmark = pytest.mark.slow
EXAMPLES = ROOT / "examples"
PLANNED = {
    "inspection": ("inspect_with_camera.py", ["inspect", "inspect"]),
    "pouring": ("pour.py", ["grasp", "bring", "pour", "place"]),
    "over_the_wall": ("", ["grasp", "handover", "place"]),
    "restock": ("", ["grasp", "place", "grasp", "place"]),
    "gantry": ("", ["grasp", "place", "grasp", "place"]),
    "steps": ("", ["grasp", "place"]),
    "two_people": ("", ["grasp", "handover", "place"]),
    "waiter": ("", ["grasp", "place", "grasp"]),
    "lift_arm": ("", ["grasp", "place", "grasp"]),
    "shelf_and_pillar": ("", ["grasp", "place"]),
    "two_hands": ("carry_with_both_hands.py", ["lift", "put"]),
}
"""Scene -> the file with its actions, and the actions of its plan."""


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    before = dict(actions._registered)
    yield
    actions._registered.clear()
    actions._registered.update(before)


@pytest.mark.parametrize("name", list(PLANNED))
def test_a_scene_is_planned_audited_run_and_shown(name: str, tmp_path: Path) -> None:
    extension, expected = PLANNED[name]
    if extension:
        run_extension(str(EXAMPLES / extension))
    plan = lgp.plan(EXAMPLES / "scenes" / f"{name}.toml")
    assert plan.feasible, plan.reason
    assert [action.partition("(")[0] for action in plan.actions] == expected
    assert plan.audit["faults"] == []
    CHECKS[name](lgp.Motion(plan)) if name in CHECKS else None
    plan.save(tmp_path / "plan")
    page = lgp.write_page(lgp.Plan.load(tmp_path / "plan"), tmp_path / "page", pictures=False)
    events: list[Event] = []
    summary = lgp.run_plan(tmp_path / "plan", on_event=events.append)
    assert summary["state"] == "finished", summary["why"]
    shown = html.unescape(page.read_text())
    assert all(event.text in shown for event in events if event.kind == "told"), "people read what the page says"


def _pours(motion: lgp.Motion) -> None:
    """The jug is carried upright and tilted at the end of the third phase."""
    tilt = np.degrees(np.arccos(np.clip(motion.object_poses("jug").rotation[:, 2, 2], -1.0, 1.0)))
    each = motion.phases.slices
    assert tilt[each + 1 : 2 * each + 1].max() < 12.0
    assert tilt[3 * each] > 65.0


def _carries(motion: lgp.Motion) -> None:
    """Both palms stay where they took the crate; a hand alone would not carry it."""
    hands = motion.frames(["human.left_hand", "human.right_hand"])
    half = motion.phases.slices
    away = np.linalg.norm(np.subtract(*(hand.position[half:] for hand in hands.values())), axis=1)
    np.testing.assert_allclose(away, 0.30, atol=1e-4)
    assert motion.plan.scene.objects["crate"].mass > motion.plan.scene.hands["human.left_hand"].payload


def _hands_over(motion: lgp.Motion) -> None:
    """Both have the rod for a while, and both have scores of their own."""
    people = motion.plan.people
    assert [one.carried.max() for one in people.values()] == [1.5, 1.5]
    assert [one["max"] >= 1 for one in motion.plan.summary()["reba"]["people"].values()] == [True, True]


def _steps(motion: lgp.Motion) -> None:
    """The person stands at two places, and in each while its hand takes or puts."""
    place = motion.frames(["human.base_yaw"])["human.base_yaw"].position
    each = motion.phases.slices
    for last in (each, 2 * each):
        np.testing.assert_allclose(
            place[last - each // 2 + 1 : last + 1], np.tile(place[last], (each // 2, 1)), atol=1e-4
        )
    assert place[2 * each, 1] - place[each, 1] > 0.5


def _serves(motion: lgp.Motion) -> None:
    """The tray is driven to the guest with glass and bottle on it, and rests while the guest takes the bottle."""
    tray, each = motion.frames(["table.tray"])["table.tray"], motion.phases.slices
    for name, first in (("glass", 0), ("bottle", 2 * each)):
        on = motion.object_poses(name).position - tray.position
        on = np.einsum("tji,tj->ti", tray.rotation, on)[first : 3 * each + 1]
        np.testing.assert_allclose(on, np.tile(on[0], (len(on), 1)), atol=1e-4)
    assert np.linalg.norm(tray.position[-1] - tray.position[0]) > 1.0
    np.testing.assert_allclose(tray.rotation[:, 2, 2], 1.0)


CHECKS = {
    "steps": _steps,
    "pouring": _pours,
    "two_hands": _carries,
    "two_people": _hands_over,
    "waiter": _serves,
}
