"""Kinematic switches: no jump where the freedom allows it, poses that follow what holds the object, derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lgp_worlds import anywhere, human_world

from lgp.errors import WorldError
from lgp.world.model import World
from lgp.world.switches import Modes, Switch

RIGHT, LEFT = "human.right_hand", "human.left_hand"
MOVE = (
    Switch("grasp", RIGHT, "box"),
    Switch("grasp", LEFT, "box"),
    Switch("place", LEFT, "box", "table.near"),
)


@pytest.fixture(params=["free", "axis", "fixed"])
def modes(request: pytest.FixtureRequest) -> Modes:
    scene = human_world().scene
    hands = tuple(replace(hand, freedom=request.param) for hand in scene.human.hands)
    return Modes(World(replace(scene, human=replace(scene.human, hands=hands))), MOVE)


def test_variables_are_named_and_bounded(modes: Modes) -> None:
    freedom = modes.world.scene.human.hands[0].freedom
    turns = {"free": 3, "axis": 1, "fixed": 0}[freedom]
    assert modes.size == 2 * (turns + 1) + 3
    assert modes.names[turns] == "0.box.slide"
    assert modes.upper[turns] == pytest.approx(0.1)
    assert modes.names[-3:] == ("2.box.x", "2.box.y", "2.box.yaw")
    # The box is 0.1 m wide, the table 0.6 x 0.4 m.
    np.testing.assert_allclose(modes.upper[-3:], [0.25, 0.15, 2.0 * np.pi])
    np.testing.assert_allclose(modes.lower, -modes.upper)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_jump_by_differences(modes: Modes, number: int) -> None:
    world, nq = modes.world, modes.world.nq
    q = anywhere(world, 3, seed=number)
    z = 0.5 * np.random.default_rng(1).uniform(modes.lower, modes.upper)

    def jump(step: np.ndarray) -> np.ndarray:
        return modes.jump(number, world.at(q + step[:nq], modes.frames), z + step[nq:]).value

    found = modes.jump(number, world.at(q, modes.frames), z).jacobian
    for at in range(nq + modes.size):
        step = np.zeros(nq + modes.size)
        step[at] = 1e-6
        np.testing.assert_allclose(found[:, :, at], (jump(step) - jump(-step)) / 2e-6, atol=2e-7)


def test_a_free_grasp_is_guessed_without_a_jump_of_orientation() -> None:
    world = human_world()
    modes = Modes(world, MOVE)
    keys = anywhere(world, 3, seed=8)
    z = modes.guess(keys)
    for number in (0, 1):
        jump = modes.jump(number, world.at(keys[number : number + 1], modes.frames), z).value[0]
        np.testing.assert_allclose(jump[3:], 0.0, atol=1e-7)
    assert np.all((z >= modes.lower) & (z <= modes.upper))


def test_poses_follow_what_holds_the_object() -> None:
    world = human_world()
    modes = Modes(world, MOVE)
    q, z = anywhere(world, 4), 0.3 * modes.upper
    kinematics = world.at(q, modes.frames)
    assert [modes.holder("box", phase).by for phase in range(4)] == ["table.near", RIGHT, LEFT, "table.near"]
    first = modes.pose("box", 0, kinematics, z)
    np.testing.assert_allclose(first.position, np.tile([0.5, 0.1, 0.9], (4, 1)))
    held = modes.pose("box", 1, kinematics, z)
    # Slid along its longest side, never away from the hand's point.
    offset = held.position - kinematics.place(RIGHT).position
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), 0.03)
    np.testing.assert_allclose(np.abs(np.einsum("ni,ni->n", offset, held.rotation[:, :, 0])), 0.03)
    last = modes.pose("box", 3, kinematics, z)
    assert np.ptp(last.position, axis=0).max() == 0.0
    assert not last.by_q.any()


def test_a_placed_object_keeps_upright_on_the_top_for_any_variables() -> None:
    world = human_world()
    modes = Modes(world, MOVE)
    kinematics = world.at(world.start[None], modes.frames)
    table = world.scene.tables["table.near"]
    turn = np.radians(table.yaw)
    for z in np.random.default_rng(0).uniform(modes.lower, modes.upper, (20, modes.size)):
        pose = modes.pose("box", 3, kinematics, z)
        np.testing.assert_allclose(pose.rotation[0, :, 2], [0, 0, 1], atol=1e-12)
        assert pose.position[0, 2] == pytest.approx(table.height + 0.1)
        out = pose.position[0, :2] - table.position
        local = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ out
        assert np.all(np.abs(local) <= np.array(table.size) / 2.0)


@pytest.mark.parametrize(
    ("switches", "text"),
    [
        ([Switch("grasp", "human.right_han", "box")], "action 0 .* unknown hand .*did you mean 'human.right_hand'"),
        ([Switch("grasp", RIGHT, "bux")], "unknown thing 'bux'"),
        ([Switch("place", RIGHT, "box", "table.near")], "held by table.near; grasp it first"),
        ([Switch("grasp", RIGHT, "box"), Switch("place", LEFT, "box", "table.near")], "held by human.right_hand"),
        ([Switch("grasp", RIGHT, "box"), Switch("place", RIGHT, "box", "near")], "unknown table 'near'"),
        ([Switch("throw", RIGHT, "box")], "unknown kind 'throw'"),
    ],
)
def test_impossible_switches_are_refused(switches: list[Switch], text: str) -> None:
    with pytest.raises(WorldError, match=text):
        Modes(human_world(), switches)


def test_unknown_phases_and_objects_are_refused() -> None:
    modes = Modes(human_world(), MOVE)
    with pytest.raises(WorldError, match="phase 4 is outside 0 to 3"):
        modes.holder("box", 4)
    with pytest.raises(WorldError, match="no object 'bx'"):
        modes.holder("bx", 0)
