"""The persons of a scene: one by the short form, several by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lgp.errors import SceneError
from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.says import says
from tests.support.two_people import two_people


def test_several_people_have_bodies_of_their_own() -> None:
    scene = read_scene(two_people(human={"position": [0.0, 3.0]}))
    assert list(scene.humans) == ["human", "anna", "bert"], "the short form comes first"
    assert scene.human is scene.humans["human"]
    assert [one.stature for one in scene.humans.values()] == [1.75, 1.62, 1.85]
    assert list(scene.hands) == ["human.right_hand", "anna.right_hand", "bert.left_hand"]
    assert all(hand.human for hand in scene.hands.values())
    world = World(scene)
    assert [len(world.columns(name)) for name in scene.humans] == [29, 18, 18]
    heads = world.at(world.initial_configuration[None], [f"{name}.head" for name in scene.humans]).position[0]
    np.testing.assert_allclose(heads[:, :2], [[0.0, 3.0], [0.0, 0.0], [1.3, 0.0]], atol=0.2)
    assert heads[1, 2] < heads[0, 2] < heads[2, 2]


def test_the_short_form_is_a_person_named_human() -> None:
    short = load_scene("screwdriver")
    values = dict(short.values)
    values["humans"] = {"human": values.pop("human")}
    assert read_scene(values, short.name) == short


def test_one_of_several_is_changed_by_key() -> None:
    assert read_scene(two_people(), changes={"humans.bert.stature": 1.7}).humans["bert"].stature == 1.7


@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        ({"human": {}, "humans": {"human": {}}}, ("humans.human", "[human]", "another name")),
        ({"humans": {"anna": {}, "bert.l": {}}}, ("bert.l", "expected letters", "another one")),
        ({"humans": {"anna": {}, "table": {}}}, ("'table' is no name of a person", "another one")),
        ({"humans": {"anna": {"tall": 1.7}, "bert": {}}}, ("humans.anna", "unknown key 'tall'")),
        ({"humans": {"anna": {"stature": 3.0}, "bert": {}}}, ("humans.anna", "stature is 3", "1.4 to 2.1")),
        ({"humans": {"stature": 1.7}}, ("humans.stature is 1.7", "expected a table")),
        ({"humans": {"anna": {}}}, ("unknown 'bert.left_hand'", "known are anna.right_hand")),
        ({"humans": {}}, ("no agent", "[humans.NAME]", "add one")),
    ],
)
def test_wrong_persons_are_refused(changes: dict[str, Any], facts: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as error:
        read_scene(two_people(**changes))
    says(error, *facts)


def test_a_name_is_that_of_one_thing() -> None:
    values = two_people()
    values["objects"]["anna"] = values["objects"]["rod"]
    with pytest.raises(SceneError) as error:
        read_scene(values)
    says(error, "'anna'", "person and object", "another name")
    values = two_people(robots={"bert": {"model": "panda", "position": [0.0, 0.0]}})
    with pytest.raises(SceneError) as error:
        read_scene(values)
    says(error, "'bert'", "person and robot", "another name")
