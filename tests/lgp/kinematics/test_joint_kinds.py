"""Robots with joints of any kind: slides in metres, endless and following joints, planar joints and mobile bases."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lgp.audit.agents import robot_model
from lgp.audit.joint_tree import BASE, Frame, TreeJoint, attached, place, values_of
from lgp.errors import SceneError, WorldError
from lgp.execution.trajectory import JointTrajectory, violations
from lgp.kinematics import features
from lgp.kinematics.world import World
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import anywhere, differences
from tests.support.robot_files import LIFT_ARM, arm_world
from tests.support.says import says

FULL_TURN = 2.0 * np.pi


@pytest.mark.parametrize("locked", [[], ["lift"], ["l*"]])
def test_a_slide_is_in_metres_wherever_it_is_stated(tmp_path: Path, locked: list[str]) -> None:
    world = arm_world(tmp_path, joints={"lift": 0.3, "shoulder": 30}, locked=locked)
    assert world.initial_values["arm.lift"] == 0.3
    assert world.initial_values["arm.shoulder"] == pytest.approx(np.pi / 6)
    height = world.at(world.initial_configuration[None], ["arm.l0"]).position[0, 0, 2]
    assert height == pytest.approx(0.2 + 0.5 + 0.3)
    assert (world.units["arm.lift"].written, world.units["arm.lift"].si) == ("m", "m")
    model = robot_model(world.scene.robots["arm"])
    assert model.fixed["arm.lift"] == 0.3


def test_limits_of_slides_are_said_in_metres(tmp_path: Path) -> None:
    with pytest.raises(WorldError) as error:
        arm_world(tmp_path, joints={"lift": 0.5})
    says(error, "arm.lift starts at 0.5 m", "expected 0 to 0.4 m")
    world = arm_world(tmp_path)
    knots = np.tile(world.initial_configuration, (3, 1))
    knots[1:, world.column["arm.lift"]] = 0.35, 0.45
    said = [str(one) for one in violations(world, JointTrajectory(knots, 1.0), world.columns("arm"))]
    assert any("arm.lift: position 0.450 m at" in one for one in said)
    assert any("arm.lift: velocity" in one and "m/s at" in one for one in said)


def test_an_endless_joint_turns_a_full_turn_each_way_from_where_it_starts(tmp_path: Path) -> None:
    world = arm_world(tmp_path, joints={"wrist": 500})
    start, at = np.radians(500.0), world.column["arm.wrist"]
    assert world.initial_configuration[at] == pytest.approx(start)
    assert (world.lower[at], world.upper[at]) == pytest.approx((start - FULL_TURN, start + FULL_TURN))
    assert world.speed_limit[at] == 3.0
    assert world.speed_limit[world.column["arm.pan"]] == np.inf, "its URDF has no limit"


def test_a_joint_that_follows_another_is_no_variable_but_moves(tmp_path: Path) -> None:
    world = arm_world(tmp_path, joints={"f1": 0.01})
    assert world.joints == tuple(f"arm.{name}" for name in ("lift", "pan", "shoulder", "elbow", "level", "wrist", "f1"))
    at = world.column["arm.f1"]
    # f2 is within 0.002 to 0.034, so 0.8 f1 + 0.002 is, and moves at most with 0.4 m/s.
    assert (world.lower[at], world.upper[at]) == pytest.approx((0.0, 0.04))
    assert world.speed_limit[at] == pytest.approx(0.5)
    fingers = world.at(world.initial_configuration[None], ["arm.fl", "arm.fr", "arm.l5"]).position[0]
    across = fingers[0] - fingers[1]
    assert np.linalg.norm(across) == pytest.approx(0.04 + 0.01 + 0.8 * 0.01 + 0.002)
    q = anywhere(world, 5)
    for name in ("arm.fl", "arm.fr", "arm.tcp"):
        frame = world.at(q, [name]).placement(name)
        moved = differences(lambda x, name=name: world.at(x, [name]).position[:, 0], q)  # type: ignore[misc]
        np.testing.assert_allclose(frame.jacobian[:, :3], moved, atol=1e-8)
        turned = differences(lambda x, name=name: world.at(x, [name]).rotation[:, 0, :, 0], q)  # type: ignore[misc]
        np.testing.assert_allclose(features.axis(frame, 0).jacobian, turned, atol=1e-8)
    assert world.at(q, []).spatial.shape == (5, 6, world.nq)
    assert world.support("arm.fr")[at] == 1.0
    assert world.support("arm.tcp")[at] == 0.0


@pytest.mark.parametrize(
    ("robot", "facts"),
    [
        ({"joints": {"f2": 0.01}}, ("joint 'f2' follows 'f1'", "give the value of 'f1'")),
        ({"locked": ["f2"]}, ("joint 'f2' in `locked` follows 'f1'", "lock 'f1'")),
    ],
)
def test_a_joint_that_follows_has_no_value_of_its_own(
    tmp_path: Path, robot: dict[str, Any], facts: tuple[str, ...]
) -> None:
    with pytest.raises(WorldError) as error:
        arm_world(tmp_path, **robot)
    says(error, *facts)


def test_what_follows_a_locked_joint_stays_where_that_takes_it(tmp_path: Path) -> None:
    world = arm_world(tmp_path, joints={"f1": 0.03}, locked=["f1"])
    assert not any(name.startswith("arm.f") for name in world.joints)
    fingers = world.at(world.initial_configuration[None], ["arm.fl", "arm.fr"]).position[0]
    assert np.linalg.norm(fingers[0] - fingers[1]) == pytest.approx(0.04 + 0.03 + 0.8 * 0.03 + 0.002)


MIMIC = '<mimic joint="f1" multiplier="0.8" offset="0.002"/>'


def test_following_oneself_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WorldError) as error:
        arm_world(tmp_path, LIFT_ARM.replace(MIMIC, '<mimic joint="f2"/>'))
    says(error, "joint 'f2' follows 'f2'", "in turn")


def test_following_a_joint_that_is_not_there_is_standing_still(tmp_path: Path) -> None:
    world = arm_world(tmp_path, LIFT_ARM.replace(MIMIC, '<mimic joint="f9" multiplier="0.8" offset="0.003"/>'))
    assert "arm.f2" not in world.joints
    assert agreement(world) < 1e-12
    (note,) = robot_model(world.scene.robots["arm"]).notes[:1]
    says(note, "joint 'f2' follows 'f9'", "not there")


def test_an_endless_joint_that_follows_does_not_narrow_the_other(tmp_path: Path) -> None:
    wheel = LIFT_ARM.replace(
        '<limit effort="1" velocity="3"/></joint>',
        '<limit effort="1" velocity="3"/><mimic joint="lift" multiplier="20"/></joint>',
    )
    world = arm_world(tmp_path, wheel)
    at = world.column["arm.lift"]
    assert (world.lower[at], world.upper[at]) == (0.0, 0.4)
    assert world.speed_limit[at] == pytest.approx(3.0 / 20.0)


def test_a_joint_that_follows_one_that_follows_another(tmp_path: Path) -> None:
    third = LIFT_ARM.replace('<link name="fr"/>', '<link name="fr"/><link name="ft"/>').replace(
        "</robot>",
        '<joint name="a3" type="revolute"><parent link="l5"/><child link="ft"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="f2" multiplier="-10"/></joint></robot>',
    )
    world = arm_world(tmp_path, third, joints={"f1": 0.02})
    placed = world.at(world.initial_configuration[None], ["arm.l5", "arm.ft"]).rotation[0]
    turn = features.logarithm((placed[0].T @ placed[1])[None])[0]
    np.testing.assert_allclose(turn, [0.0, 0.0, -10.0 * (0.8 * 0.02 + 0.002)], atol=1e-12)
    assert agreement(world) < 1e-12


@pytest.mark.parametrize("last_first", [False, True])
def test_the_audit_follows_in_any_order(last_first: bool) -> None:
    at = Frame(BASE, np.eye(3), np.zeros(3))
    axis = np.array([0.0, 0.0, 1.0])
    tree = [
        TreeJoint("a", at, axis, True, 0.0, 1.0, 1.0),
        TreeJoint("b", at, axis, True, 0.0, 1.0, 1.0, ("a", 2.0, 0.1)),
        TreeJoint("c", at, axis, True, 0.0, 1.0, 1.0, ("b", -1.0, 0.0)),
    ]
    values = values_of(tree[::-1] if last_first else tree, {"a": np.array([0.0, 0.5])}, {})
    np.testing.assert_allclose(values["c"], [-0.1, -1.1])


def agreement(world: World) -> float:
    """Return the largest difference [m] of the hand from where the audit has it."""
    q = anywhere(world, 10)
    model = robot_model(world.scene.robots["arm"])
    values = values_of(model.joints, dict(zip(world.joints, q.T, strict=True)), model.fixed)
    frames = place(model.joints, model.rotation, model.position, values, len(q))
    _, at = attached(*frames, list(model.hands.values()))
    return float(np.abs(at[0] - world.at(q, ["arm.tcp"]).position[:, 0]).max())


PLANAR = LIFT_ARM.replace('name="lift" type="prismatic"', 'name="floor" type="planar"').replace(
    'lower="0" upper="0.4" effort="1" velocity="0.2"', 'lower="-2" upper="1" effort="1" velocity="0.2"'
)


def test_a_planar_joint_is_two_slides_and_a_turn(tmp_path: Path) -> None:
    world = arm_world(tmp_path, PLANAR, joints={"floor_x": 0.5, "floor_yaw": 90})
    assert world.joints[:3] == ("arm.floor_x", "arm.floor_y", "arm.floor_yaw")
    assert [world.units[name].si for name in world.joints[:3]] == ["m", "m", "rad"]
    np.testing.assert_allclose(world.lower[:3], [-2.0, -2.0, np.pi / 2 - FULL_TURN])
    np.testing.assert_allclose(world.upper[:2], [1.0, 1.0])
    np.testing.assert_allclose(world.speed_limit[:2], 0.2)
    base, moved = world.at(world.initial_configuration[None], ["arm.base", "arm.l0"]).position[0]
    yaw = np.radians(30)
    np.testing.assert_allclose(moved - base, [0.5 * np.cos(yaw), 0.5 * np.sin(yaw), 0.5], atol=1e-12)
    assert agreement(world) < 1e-12


def test_a_mobile_base_moves_any_robot_over_the_floor(tmp_path: Path) -> None:
    base = {"x": [-1, 2], "y": [-0.5, 0.5], "yaw": [-90, 90], "speed": 0.4, "turn": 45}
    world = arm_world(tmp_path, base=base, joints={"base_x": 0.5, "base_yaw": 45})
    assert world.joints[:4] == ("arm.base_x", "arm.base_y", "arm.base_yaw", "arm.lift")
    np.testing.assert_allclose(world.lower[:3], [-1.0, -0.5, -np.pi / 2])
    np.testing.assert_allclose(world.speed_limit[:3], [0.4, 0.4, np.pi / 4])
    yaw = np.radians(30)
    at = world.at(world.initial_configuration[None], ["arm.base"])
    np.testing.assert_allclose(at.position[0, 0], [0.4 + 0.5 * np.cos(yaw), -0.3 + 0.5 * np.sin(yaw), 0.2], atol=1e-12)
    np.testing.assert_allclose(at.rotation[0, 0, :2, 0], [np.cos(np.radians(75)), np.sin(np.radians(75))], atol=1e-12)
    assert agreement(world) < 1e-12


def test_a_wrong_base_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as error:
        arm_world(tmp_path, base={"x": [1, -1]})
    says(error, "base: x is [1, -1]", "[lowest, highest]")
    with pytest.raises(WorldError) as failed:
        arm_world(tmp_path, LIFT_ARM.replace('"lift"', '"base_x"'), base={"x": [-1, 1]})
    says(failed, "joint 'base_x' is that of a mobile base", "leave out `base`")


def test_a_joint_may_have_the_name_of_a_link(tmp_path: Path) -> None:
    world = arm_world(
        tmp_path, LIFT_ARM.replace('joint name="tcp_joint"', 'joint name="tcp"').replace('"lift"', '"l5"')
    )
    assert agreement(world) < 1e-12
    assert world.support("arm.l5").sum() == 6.0, "the link, not the joint"


def test_a_floating_joint_has_to_be_locked(tmp_path: Path) -> None:
    floating = LIFT_ARM.replace('name="pan" type="continuous"', 'name="pan" type="floating"')
    with pytest.raises(WorldError) as error:
        arm_world(tmp_path, floating)
    says(error, "joint pan is floating", "add it to `locked`")
    assert "arm.pan" not in arm_world(tmp_path, floating, locked=["pan"]).joints


def test_two_robots_of_one_model_move_on_their_own(tmp_path: Path) -> None:
    scene = arm_world(tmp_path).scene
    values = dict(scene.values)
    one = values["robots"]["arm"]
    values["robots"] = {"a": one | {"joints": {"lift": 0.1}}, "b": one | {"position": [2, 0, 0], "locked": ["f1"]}}
    world = World(read_scene(values))
    assert [len(world.columns(name)) for name in ("a", "b")] == [7, 6]
    q = anywhere(world, 3)
    moved = world.at(q, ["b.fr"]).placement("b.fr").jacobian
    assert not moved[:, :, world.columns("a")].any()
    assert moved[:, :, world.columns("b")].any()
