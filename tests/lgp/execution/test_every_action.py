"""Every kind of action by every hand: a run performs each one in order and ends as its plan says."""

from __future__ import annotations

import json
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.execution.executive import Settings
from lgp.execution.log_reader import messages
from lgp.execution.session import ExecutionRun, RunOptions
from lgp.execution.tracked_scene import atoms_now
from lgp.execution.trajectory_export import write_trajectories
from lgp.kinematics.actions import SHIPPED
from lgp.logic.task import Atom
from lgp.motion import Motion
from lgp.planner import parse_sequence, task_of
from tests.support.every_hand import HANDS, agents_of, planned, scene_of
from tests.support.execution_plans import went
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = [pytest.mark.slow, needs_robots]
EVERY = tuple(hand for hands in HANDS.values() for hand in hands)
PAIRS = tuple(permutations(EVERY, 2))
PLACED = 0.1
"""[m] Largest distance of an object from its planned pose: three standard deviations of where people place."""


def of_topic(file: Path, topic: str) -> list[dict[str, Any]]:
    return [json.loads(message.data) for message in messages(file) if message.topic == topic]


def kinds(log: Path) -> list[str]:
    """Return the kinds of the events of a run, without adaptations and whom an action is told to."""
    found = [event["kind"].replace("told", "started") for event in of_topic(log, "/events")]
    return [kind for kind in found if kind not in ("retargeted", "slowed")]


def plays(folder: Path, plan: lgp.Plan) -> None:
    """Run a plan; its events, who has what after each action, the end, and the log watched again are as planned."""
    assert plan.feasible, plan.reason
    plan.save(folder / "plan")
    summary = lgp.run_plan(folder / "plan")
    assert summary["state"] == "finished", summary["why"]
    assert summary["actions"] == list(plan.actions)
    log = folder / "plan" / "run.mcap"
    assert kinds(log) == [*["started", "ended"] * len(plan.actions), "finished"]

    task, states = task_of(plan.scene), of_topic(log, "/state")
    ends = [event["time"] for event in of_topic(log, "/events") if event["kind"] == "ended"]
    state = task.initial
    for action, end in zip(parse_sequence(task, plan.actions), ends, strict=True):
        state = action.apply(state)
        things = [one for one in states if one["time"] <= end + 1e-9][-1]["things"]
        for name, owner in owners(plan, task.holding(state)).items():
            hand = things[name]["hand"]
            assert hand == owner or (not owner and action.name == "place" and hand in HANDS["human"]), (action, name)
    for name, at in states[-1]["things"].items():
        if not at["hand"]:
            np.testing.assert_allclose(at["position"], Motion(plan).object_poses(name).position[-1], atol=PLACED)

    plan.save(folder / "again")
    again = ExecutionRun(folder / "again", RunOptions(speed=0.0, replay=log, compare=False))
    assert again.go()["state"] == "finished"
    assert kinds(folder / "again" / "run.mcap") == kinds(log)
    nominal = frozenset(task.holding(state))
    assert set(atoms_now(again.view, task, nominal)) == nominal


def owners(plan: lgp.Plan, atoms: tuple[Atom, ...]) -> dict[str, str]:
    """Return the hand that has each object in a state; a closed gripper has what it holds in place as well."""
    has = dict.fromkeys(plan.scene.objects, "")
    for atom in atoms:
        if atom.predicate == "grasped" or (atom.predicate == "holding" and not atom.arguments[0].startswith("human.")):
            has[atom.arguments[1]] = atom.arguments[0]
    return has


def test_the_walk_has_every_kind_of_action() -> None:
    scene = scene_of(["human"], ["screwed(box, lid)"])
    assert {action.name for action in task_of(scene).domain.actions} == set(SHIPPED)


@pytest.mark.parametrize("hand", EVERY)
def test_one_hand_takes_and_places(hand: str, tmp_path: Path) -> None:
    scene = scene_of(agents_of([hand]), ["placed(box, table.center)"])
    plays(tmp_path, planned(scene, f"grasp({hand}, box)", f"place({hand}, box, table.center)"))


@pytest.mark.parametrize(("giver", "taker"), PAIRS)
def test_any_hand_hands_over_to_any_other(giver: str, taker: str, tmp_path: Path) -> None:
    scene = scene_of(agents_of([giver, taker]), [f"grasped({taker}, box)"], in_hand=giver)
    plays(tmp_path, planned(scene, f"handover({giver}, box, {taker})"))


@pytest.mark.parametrize(("holder", "screwer"), PAIRS)
def test_any_hand_screws_what_any_other_holds_and_lets_go(holder: str, screwer: str, tmp_path: Path) -> None:
    scene = scene_of(agents_of([holder, screwer]), ["screwed(box, lid)", f"free({holder})"])
    sequence = (f"hold({holder}, box)", f"screw({screwer}, box, lid)", f"release({holder}, box)")
    plays(tmp_path, planned(scene, *sequence))


def test_a_goal_that_holds_already_needs_no_action(tmp_path: Path) -> None:
    scene = scene_of(["human", "baxter"], ["on_table(box)"])
    for number, plan in enumerate((lgp.plan(scene, None), planned(scene))):
        assert plan.feasible
        assert plan.actions == ()
        folder = tmp_path / str(number)
        plan.save(folder)
        assert lgp.Plan.load(folder).summary() == plan.summary()
        summary = lgp.run_plan(folder)
        assert (summary["state"], summary["actions"]) == ("finished", [])
        with pytest.raises(lgp.LgpError) as error:
            lgp.write_page(plan, tmp_path / "page")
        says(error, "no actions", "goal holds")


def test_an_object_that_is_handed_around_comes_back(tmp_path: Path) -> None:
    left, right, panda = "baxter.left", "baxter.right", "panda.hand"
    scene = scene_of(["baxter", "panda"], [f"grasped({left}, box)", f"free({panda})"], in_hand=left)
    ways = [(left, panda), (panda, right), (right, panda), (panda, left)]
    plays(tmp_path, planned(scene, *(f"handover({giver}, box, {taker})" for giver, taker in ways)))


def test_exported_trajectories_are_those_of_every_robot(tmp_path: Path) -> None:
    scene = scene_of(["baxter", "panda"], ["grasped(panda.hand, box)"], in_hand="baxter.left")
    plan = planned(scene, "handover(baxter.left, box, panda.hand)")
    write_trajectories(plan, tmp_path / "robots.mcap", slow_down=True)
    topics = [message.topic for message in messages(tmp_path / "robots.mcap")]
    assert topics == ["/baxter/trajectory", "/panda/trajectory"]


@pytest.mark.parametrize(
    ("giver", "taker", "text"),
    [
        ("baxter.left", "baxter.right", "Please wait. The box was dropped."),
        ("human.left_hand", "panda.hand", "Please wait. The box was dropped."),
        ("human.left_hand", "human.right_hand", "Please wait. The box was dropped."),
    ],
)
def test_what_is_dropped_in_a_handover_is_fetched_and_handed_over_again(
    giver: str, taker: str, text: str, tmp_path: Path
) -> None:
    scene = scene_of(agents_of(["human.left_hand", giver, taker]), [f"grasped({taker}, box)"], in_hand=giver)
    planned(scene, f"handover({giver}, box, {taker})").save(tmp_path)
    summary, events = went(tmp_path, "dropped@1")
    assert (summary["state"], summary["replanned"]) == ("finished", 1)
    assert [event.text for event in events if event.kind == "dropped"] == [text]


@pytest.mark.parametrize(
    ("giver", "taker", "why"),
    [
        ("baxter.left", "panda.hand", "panda.hand is open"),
        ("human.left_hand", "panda.hand", "away from panda.hand"),
        ("panda.hand", "human.left_hand", "away from human.left_hand"),
    ],
)
def test_hands_that_do_not_take_part_end_the_run(giver: str, taker: str, why: str, tmp_path: Path) -> None:
    scene = scene_of(agents_of([giver, taker]), [f"grasped({taker}, box)"], in_hand=giver)
    planned(scene, f"handover({giver}, box, {taker})").save(tmp_path)
    summary, _ = went(tmp_path, "stuck@1", settings=Settings(patience=1.5))
    assert summary["state"] == "failed"
    assert why in summary["why"]
