"""First facts that contradict where objects are."""

from __future__ import annotations

from typing import Any

import pytest

import lgp
from lgp.errors import SceneError
from lgp.scene.consistency import check_first_facts
from lgp.scene.scene_file import read_scene, shipped_scenes
from tests.support.says import says


def scene(initial: list[str], goal: str = "placed(box, table.b)", **box: Any) -> lgp.Scene:
    return read_scene(
        {
            "domain": "screwdriver",
            "initial": initial,
            "goal": [goal],
            "human": {"hands": ["left_hand", "right_hand"]},
            "tables": {
                name: {"position": [0.5, y], "size": [0.4, 0.4], "height": 0.9} for name, y in (("a", 0.4), ("b", -0.4))
            },
            "objects": {"box": {"size": [0.1, 0.06, 0.12], "mass": 1.0, "on": "table.a", **box}},
        }
    )


@pytest.mark.parametrize(
    ("initial", "box", "words"),
    [
        (["on_table(box)", "placed(box, table.b)"], {}, ("on table.a", "placed(box, table.b)")),
        (["grasped(human.left_hand, box)"], {}, ("grasped(human.left_hand, box)", "on table.a", "in_hand")),
        (["free(human.left_hand)"], {"hand": "human.left_hand"}, ("grasped(human.left_hand, box)", "add the fact")),
        (
            ["grasped(human.left_hand, box)", "on_table(box)"],
            {"hand": "human.left_hand"},
            ("on_table(box)", "remove the fact"),
        ),
        (
            ["grasped(human.left_hand, box)", "free(human.left_hand)"],
            {"hand": "human.left_hand"},
            ("free(human.left_hand)", "remove the fact"),
        ),
        (
            ["grasped(human.right_hand, box)", "grasped(human.left_hand, box)"],
            {"hand": "human.left_hand"},
            ("grasped(human.right_hand, box)", "on human.left_hand"),
        ),
    ],
)
def test_a_contradiction_is_refused(initial: list[str], box: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        lgp.plan(scene(initial, **box), cost=None)
    says(caught, "box", *words)


@pytest.mark.parametrize(
    ("initial", "box"),
    [
        (["on_table(box)"], {}),
        (["on_table(box)", "placed(box, table.a)"], {}),
        # Taken from b before: grasping does not delete `placed`.
        (["on_table(box)", "placed(box, table.b)", "placed(box, table.a)"], {}),
        (["grasped(human.left_hand, box)", "free(human.right_hand)"], {"hand": "human.left_hand"}),
    ],
)
def test_what_agrees_is_accepted(initial: list[str], box: dict[str, Any]) -> None:
    check_first_facts(scene(initial, **box))


@pytest.mark.parametrize("fact", ["placed(box, table.a)", "on_table(box)"])
def test_what_the_goal_ends_is_a_first_fact(fact: str) -> None:
    other = {"placed(box, table.a)", "on_table(box)"} - {fact}
    with pytest.raises(SceneError) as caught:
        lgp.plan(scene([*other], f"not {fact}"), cost=None)
    says(caught, "box is on table.a", f"the goal is not {fact}", "add the fact")
    check_first_facts(scene([fact, *other], f"not {fact}"))
    check_first_facts(scene([*other], "not placed(box, table.b)"))


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_agree(name: str) -> None:
    check_first_facts(lgp.load_scene(name))
