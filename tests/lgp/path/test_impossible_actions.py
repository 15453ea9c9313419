"""What is too heavy for a hand or too high for a shelf is an impossible action, and the reason names both."""

from __future__ import annotations

import copy
from typing import Any

import pytest

import lgp
from lgp.errors import SceneError
from lgp.logic.task import Action
from lgp.path.impossible_actions import impossible
from lgp.path.phases import Phases
from lgp.planner import task_of
from lgp.scene.consistency import check_first_facts
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.lgp_worlds import HUMAN_ONLY, needs_robots
from tests.support.says import says


def values(payload: float) -> dict[str, Any]:
    changed: dict[str, Any] = copy.deepcopy(HUMAN_ONLY)
    changed["human"] |= {"hands": ["right_hand"], "payload": payload}
    return changed


@pytest.mark.parametrize(("payload", "feasible"), [(1.9, False), (2.0, True)])
def test_a_hand_takes_what_it_carries(payload: float, feasible: bool) -> None:
    plan = lgp.plan(read_scene(values(payload)), cost=None, slices=4, collisions=False)
    assert plan.feasible is feasible
    if not feasible:
        says(plan.reason, "grasp(1, human.right_hand, box)", "box has 2 kg", "human.right_hand carries up to 1.9 kg")


def test_other_hands_do_what_one_cannot() -> None:
    scene = values(1.0)
    scene["human"] |= {"hands": ["left_hand", "right_hand"]}
    scene["initial"] = ["on_table(box)", "free(human.right_hand)", "free(human.left_hand)"]
    plan = lgp.plan(read_scene(scene), cost=None, slices=4, collisions=False)
    assert not plan.feasible, "the payload is that of each hand"


def test_what_is_screwed_to_an_object_is_carried_with_it() -> None:
    changed = copy.deepcopy(dict(load_scene("toolbox").values))
    changed["human"]["payload"] = 1.2
    scene = read_scene(changed)
    part, other = scene.assemblies[0].parts
    hand = next(name for name in scene.hands if name.startswith("human."))
    masses = {name: scene.objects[name].mass for name in (part, other)}
    assert max(masses.values()) <= 1.2 < sum(masses.values())
    task = task_of(scene)
    grasp = task.action(f"grasp({hand}, {part})")
    screw = task.action(f"screw({hand}, {part}, {other})")

    def refusal(*actions: Action) -> str:
        return impossible(Phases.of(scene, actions))

    assert refusal(grasp) == ""
    says(refusal(screw, grasp), f"{part} with {other} has {sum(masses.values()):g} kg", f"{hand} carries up to 1.2 kg")


def test_an_object_in_a_hand_at_first_is_not_too_heavy() -> None:
    scene = values(1.5)
    scene["objects"]["box"] |= {"hand": "human.right_hand", "in_hand": [0.0] * 6}
    scene["initial"] = ["grasped(human.right_hand, box)"]
    with pytest.raises(SceneError) as error:
        check_first_facts(read_scene(scene))
    says(error, "objects.box", "2 kg", "human.right_hand", "payload is 1.5 kg")


@needs_robots
def test_the_payload_of_known_robots_is_that_of_their_makers() -> None:
    baxter, panda = load_scene("screwdriver"), load_scene("screwdriver_panda")
    assert baxter.hands["baxter.left"].payload == 2.2
    assert panda.hands["panda.hand"].payload == 3.0
