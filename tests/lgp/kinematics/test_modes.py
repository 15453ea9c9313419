"""Kinematic switches: no jump where the freedom allows it, poses that follow what holds the object, derivatives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lgp.errors import WorldError
from lgp.kinematics.actions import SHIPPED
from lgp.kinematics.features import Feature
from lgp.kinematics.modes import KinematicSwitch, ModeSequence
from lgp.kinematics.world import World
from lgp.logic.pddl import load_domain
from lgp.scene.model import GRIP_DEPTH
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import anywhere, differences, human_world
from tests.support.says import says

RIGHT, LEFT = "human.right_hand", "human.left_hand"
MOVE = (
    KinematicSwitch("grasp", RIGHT, "box"),
    KinematicSwitch("grasp", LEFT, "box"),
    KinematicSwitch("place", LEFT, "box", "table.near"),
)


@pytest.fixture(params=["free", "axis", "fixed"])
def modes(request: pytest.FixtureRequest) -> ModeSequence:
    scene = human_world().scene
    hands = tuple(replace(hand, freedom=request.param) for hand in scene.human.hands)
    return ModeSequence(World(replace(scene, humans={"human": replace(scene.human, hands=hands)})), MOVE)


def test_variables_are_named_and_bounded(modes: ModeSequence) -> None:
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
def test_jump_by_differences(modes: ModeSequence, number: int) -> None:
    world, nq = modes.world, modes.world.nq
    q = anywhere(world, 3, seed=number)
    z = 0.5 * np.random.default_rng(1).uniform(modes.lower, modes.upper)

    def jump(step: np.ndarray) -> np.ndarray:
        return modes.pose_continuity(number, world.at(q + step[:nq], modes.frames), z + step[nq:]).value

    found = modes.pose_continuity(number, world.at(q, modes.frames), z).jacobian
    for at in range(nq + modes.size):
        step = np.zeros(nq + modes.size)
        step[at] = 1e-6
        np.testing.assert_allclose(found[:, :, at], (jump(step) - jump(-step)) / 2e-6, atol=2e-7)


def test_a_free_grasp_is_guessed_without_a_jump_of_orientation() -> None:
    world = human_world()
    modes = ModeSequence(world, MOVE)
    keys = anywhere(world, 3, seed=8)
    z = modes.guess(keys)
    for number in (0, 1):
        jump = modes.pose_continuity(number, world.at(keys[number : number + 1], modes.frames), z).value[0]
        np.testing.assert_allclose(jump[3:], 0.0, atol=1e-7)
    assert np.all((z >= modes.lower) & (z <= modes.upper))


def test_poses_follow_what_holds_the_object() -> None:
    world = human_world()
    modes = ModeSequence(world, MOVE)
    q, z = anywhere(world, 4), 0.3 * modes.upper
    kinematics = world.at(q, modes.frames)
    assert [modes.attachment("box", phase).parent for phase in range(4)] == ["table.near", RIGHT, LEFT, "table.near"]
    first = modes.pose("box", 0, kinematics, z)
    np.testing.assert_allclose(first.position, np.tile([0.5, 0.1, 0.9], (4, 1)))
    held = modes.pose("box", 1, kinematics, z)
    # Slid along its longest side, never away from the hand's point.
    offset = held.position - kinematics.placement(RIGHT).position
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), np.hypot(0.03, 0.1 - GRIP_DEPTH))
    np.testing.assert_allclose(np.abs(np.einsum("ni,ni->n", offset, held.rotation[:, :, 0])), 0.03)
    last = modes.pose("box", 3, kinematics, z)
    assert np.ptp(last.position, axis=0).max() == 0.0
    assert not last.by_q.any()


def test_a_placed_object_keeps_upright_on_the_top_for_any_variables() -> None:
    world = human_world()
    modes = ModeSequence(world, MOVE)
    kinematics = world.at(world.initial_configuration[None], modes.frames)
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
    ("switches", "facts"),
    [
        (
            [KinematicSwitch("grasp", "human.right_han", "box")],
            ("action 1", "unknown hand", "did you mean 'human.right_hand'"),
        ),
        ([KinematicSwitch("grasp", RIGHT, "bux")], ("unknown object 'bux'",)),
        ([KinematicSwitch("place", RIGHT, "box", "table.near")], ("attached to table.near", "grasp it first")),
        (
            [KinematicSwitch("grasp", RIGHT, "box"), KinematicSwitch("place", LEFT, "box", "table.near")],
            ("attached to human.right_hand",),
        ),
        (
            [KinematicSwitch("grasp", RIGHT, "box"), KinematicSwitch("place", RIGHT, "box", "near")],
            ("unknown table 'near'",),
        ),
        ([KinematicSwitch("throw", RIGHT, "box")], ("unknown kind 'throw'",)),
    ],
)
def test_impossible_switches_are_refused(switches: list[KinematicSwitch], facts: tuple[str, ...]) -> None:
    with pytest.raises(WorldError) as error:
        ModeSequence(human_world(), switches)
    says(error, *facts)


def test_unknown_phases_and_objects_are_refused() -> None:
    modes = ModeSequence(human_world(), MOVE)
    with pytest.raises(WorldError) as error:
        modes.attachment("box", 4)
    says(error, "phase is 4", "expected 0 to 3")
    with pytest.raises(WorldError) as error:
        modes.attachment("bx", 0)
    says(error, "no object 'bx'")


# Two boards that lie flat on one table, and the joint between them.
BOARDS = {
    "domain": "toolbox",
    "initial": ["on_table(handle)", "on_table(side)", "free(human.right_hand)", "fit(handle, side)"],
    "goal": ["screwed(handle, side)"],
    "human": {"hands": ["left_hand", "right_hand"]},
    "tables": {"near": {"position": [0.6, 0.0], "size": [0.6, 0.8], "height": 0.9, "yaw": 30}},
    "objects": {
        "handle": {
            "size": [0.36, 0.018, 0.24],
            "mass": 1.0,
            "on": "table.near",
            "up": "y",
            "grips": {"human_hand": {"at": [0.0, 0.009, 0.02], "along": [0, -1, 0], "slide": 0.05}},
        },
        "side": {"size": [0.22, 0.018, 0.16], "mass": 0.4, "on": "table.near", "at": [0.1, 0.2, 0]},
    },
    "joints": [
        {
            "parts": ["handle", "side"],
            "position": [-0.189, 0.0, -0.04],
            "yaw": 90,
            "screw": [-0.198, 0.0, 0.0],
            "along": [1, 0, 0],
            "tool": 0.15,
        }
    ],
}
ASSEMBLE = (
    KinematicSwitch("grasp", LEFT, "handle"),
    KinematicSwitch("handover", RIGHT, "handle", giver=LEFT),
    KinematicSwitch("place", RIGHT, "handle", "table.near"),
    KinematicSwitch("grasp", RIGHT, "side"),
    KinematicSwitch("place", RIGHT, "side", "table.near"),
    KinematicSwitch("hold", LEFT, "handle"),
    KinematicSwitch("screw", RIGHT, "handle", other="side"),
    KinematicSwitch("release", LEFT, "handle"),
)


@cache
def boards() -> ModeSequence:
    return ModeSequence(World(read_scene(BOARDS)), ASSEMBLE)


def test_a_board_lies_flat_and_stands_where_it_is_placed() -> None:
    modes = boards()
    kinematics = modes.world.at(modes.world.initial_configuration[None], modes.frames)
    z = np.zeros(modes.size)
    flat, upright = (modes.pose("handle", phase, kinematics, z) for phase in (0, 3))
    np.testing.assert_allclose(flat.rotation[0, :, 1], [0, 0, 1], atol=1e-12)
    assert flat.position[0, 2] == pytest.approx(0.909)
    np.testing.assert_allclose(upright.rotation[0, :, 2], [0, 0, 1], atol=1e-12)
    assert upright.position[0, 2] == pytest.approx(1.02)
    # A hand that is not turned points its palm the way of the grip, and has the grip's point.
    held = modes.pose("handle", 1, kinematics, z)
    palm = kinematics.placement(LEFT)
    np.testing.assert_allclose(-held.rotation[0, :, 1], palm.axis(2)[0], atol=1e-12)
    point = held.position[0] + held.rotation[0] @ [0.0, 0.009, 0.02]
    np.testing.assert_allclose(point, palm.position[0], atol=1e-12)


def test_a_handover_changes_the_holder_and_a_hold_does_not() -> None:
    modes = boards()
    by = [modes.attachment("handle", phase).parent for phase in range(len(ASSEMBLE) + 1)]
    assert by == ["table.near", LEFT, RIGHT, *["table.near"] * 6]
    assert [holder.parent for holder in modes.contact(1) or ()] == [RIGHT, LEFT]
    assert [holder.parent for holder in modes.contact(5) or ()] == [LEFT, "table.near"]
    assert modes.contact(6) is None
    assert modes.contact(7) is None
    assert modes.holding_intervals == ((LEFT, 5, 7),)


@pytest.mark.parametrize("number", [0, 1, 2, 5])
def test_jumps_between_hands_by_differences(number: int) -> None:
    modes = boards()
    world, nq = modes.world, modes.world.nq
    z = 0.2 * np.random.default_rng(1).uniform(modes.lower, modes.upper)
    x = np.concatenate([anywhere(world, 1, seed=number)[0], z])

    def jump(at: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [modes.pose_continuity(number, world.at(row[None, :nq], modes.frames), row[nq:]).value for row in at]
        )

    found = modes.pose_continuity(number, world.at(x[None, :nq], modes.frames), z).jacobian
    np.testing.assert_allclose(found, differences(jump, x[None]), atol=2e-7)


@pytest.mark.parametrize("seed", range(4))
def test_screws_by_differences(seed: int) -> None:
    modes = boards()
    world, nq = modes.world, modes.world.nq
    screw = modes.screw_constraint(6)
    z = np.random.default_rng(seed).uniform(modes.lower, modes.upper)
    x = np.concatenate([anywhere(world, 1, seed=seed)[0], z])
    for feature in (screw.tool_error, screw.assembly_error):

        def value(at: np.ndarray, feature: Feature = feature) -> np.ndarray:
            return np.concatenate([feature(world.at(row[None, :nq], modes.frames), row[nq:]).value for row in at])

        found = feature(world.at(x[None, :nq], modes.frames), z).jacobian
        np.testing.assert_allclose(found, differences(value, x[None]), atol=3e-7)


def test_the_slant_of_a_tool_is_its_angle() -> None:
    modes = boards()
    world = modes.world
    screw = modes.screw_constraint(6)
    q = anywhere(world, 20)
    kinematics = world.at(q, modes.frames)
    z = np.random.default_rng(0).uniform(modes.lower, modes.upper)
    along = modes.pose("handle", 6, kinematics, z).rotation[:, :, 0]
    cosine = np.einsum("ni,ni->n", kinematics.placement(RIGHT).axis(0), along)
    slant = np.linalg.norm(screw.tool_error(kinematics, z).value[:, 3:], axis=1)
    np.testing.assert_allclose(np.cos(slant), cosine, atol=1e-9)


def test_parts_on_one_table_are_joined_by_place_and_yaw() -> None:
    modes = boards()
    kinematics = modes.world.at(modes.world.initial_configuration[None], modes.frames)
    screw = modes.screw_constraint(6)
    assert screw.rows(kinematics) == (0, 1, 5)
    z = np.zeros(modes.size)
    z[screw.first.variables] = [0.05, 0.1, 0.4]
    z[screw.second.variables] = [0.05 - 0.189 * np.cos(0.4), 0.1 - 0.189 * np.sin(0.4), 0.4 + np.pi / 2]
    np.testing.assert_allclose(screw.assembly_error(kinematics, z).value, 0.0, atol=1e-12)
    # Before the handle stands on the table it cannot be joined: all rows are kept.
    lying = ModeSequence(modes.world, (KinematicSwitch("screw", RIGHT, "handle", other="side"),))
    assert lying.screw_constraint(0).rows(kinematics) == tuple(range(6))


@pytest.mark.parametrize(
    ("switches", "facts"),
    [
        (
            [KinematicSwitch("handover", RIGHT, "handle", giver=LEFT)],
            ("human.left_hand hands over handle", "attached to table"),
        ),
        ([KinematicSwitch("screw", RIGHT, "handle", other="handle")], ("have no assembly",)),
        ([KinematicSwitch("screw", RIGHT, "handle", other="sid")], ("unknown object 'sid'",)),
    ],
)
def test_impossible_assemblies_are_refused(switches: list[KinematicSwitch], facts: tuple[str, ...]) -> None:
    with pytest.raises(WorldError) as error:
        ModeSequence(boards().world, switches)
    says(error, *facts)


@pytest.mark.parametrize("name", ["screwdriver", "toolbox"])
def test_every_action_of_a_shipped_domain_has_its_geometry(name: str) -> None:
    for schema in load_domain(name).actions:
        kind = SHIPPED[schema.name]
        assert len(kind.roles) == len(schema.parameters), schema.name
        assert kind.attaches_to in ("", "hand", "table")
        assert kind.conflict_scope in ("action", "table", "sequence")
        assert not kind.given_by or kind.verb
