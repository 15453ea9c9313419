"""A sentence for every kind of action."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lgp.kinematics.actions import SHIPPED
from lgp.kinematics.modes import KinematicSwitch
from lgp.page.sentences import humanised, sentences
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene

pytestmark = pytest.mark.slow


def scene_with(*robots: str) -> Scene:
    scene = load_scene("screwdriver")
    first = scene.robots["baxter"]
    found = {}
    for name in robots:
        hands = tuple(replace(hand, agent=name) for hand in first.hands)
        found[name] = replace(first, name=name, hands=hands)
    parts = {name: replace(scene.objects["screwdriver"], name=name) for name in ("toolbox/handle", "toolbox/side.left")}
    return replace(scene, robots=found, objects={**scene.objects, **parts})


def said(scene: Scene, *switches: KinematicSwitch) -> list[str]:
    return [line.text for line in sentences(scene, switches)]


def test_the_sentence_of_the_paper() -> None:
    handle, right = "toolbox/handle", "human.right_hand"
    lines = said(scene_with("baxter"), KinematicSwitch("handover", right, handle, giver="baxter.left"))
    assert lines == ["The robot, using its left arm, hands over the toolbox handle to your right hand."]


def test_a_worker_is_told_what_to_do() -> None:
    hand, screwdriver = "human.right_hand", "screwdriver"
    assert said(
        scene_with("baxter"),
        KinematicSwitch("grasp", "baxter.left", screwdriver),
        KinematicSwitch("place", "baxter.left", screwdriver, "table.left"),
        KinematicSwitch("grasp", hand, screwdriver),
        KinematicSwitch("handover", "baxter.right", screwdriver, giver=hand),
        KinematicSwitch("hold", "baxter.right", "toolbox/handle"),
        KinematicSwitch("screw", hand, "toolbox/handle", other="toolbox/side.left"),
    ) == [
        "The robot, using its left arm, picks up the screwdriver from the start table.",
        "The robot, using its left arm, puts the screwdriver on the left table.",
        "Pick up the screwdriver from the left table with your right hand.",
        "Hand over the screwdriver to the robot's right arm with your right hand.",
        "The robot, using its right arm, holds the toolbox handle still for you.",
        "Screw the toolbox handle and the left toolbox side together with your right hand.",
    ]


@pytest.mark.parametrize("kind", list(SHIPPED))
@pytest.mark.parametrize("actor", ["human.right_hand", "baxter.left"])
@pytest.mark.parametrize("robots", [("baxter",), ("baxter", "panda")])
def test_every_kind_of_action_has_words(kind: str, actor: str, robots: tuple[str, ...]) -> None:
    fields = {"hand": actor, "object_name": "toolbox/handle"}
    fields |= {
        "handover": {"hand": "baxter.right", "giver": actor},
        "place": {"table": "table.center"},
        "screw": {"other": "toolbox/side.left"},
    }.get(kind, {})
    (line,) = sentences(scene_with(*robots), [KinematicSwitch(kind, **fields)])
    assert line.you == actor.startswith("human")
    assert line.text.endswith(".")
    assert line.text[0].isupper()
    assert "toolbox handle" in line.text
    assert not set("{}_/") & set(line.text + line.short)
    assert ("the robot baxter" in line.text.lower()) == (len(robots) > 1 and not (line.you and kind != "handover"))


def test_names_are_humanised() -> None:
    names = ["tableCenter", "toolbox/side.left", "table.start", "right_hand", "box"]
    assert [humanised(name) for name in names] == [
        "Center table", "left toolbox side", "start table", "right hand", "box",
    ]  # fmt: skip
    tables = ["table.stock", "table.bench", "table.top_shelf", "table.shelf.left", "table.left", "table.in", "table"]
    assert [humanised(name) for name in tables] == [
        "stock table", "bench", "top shelf", "left shelf", "left table", "incoming table", "table",
    ]  # fmt: skip
