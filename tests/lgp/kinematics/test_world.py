"""The kinematics of all agents: placements, Jacobians, initial configuration, other scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lgp.errors import WorldError
from lgp.kinematics import features, robot
from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.lgp_worlds import anywhere, differences, human_world, needs_robots, screwdriver_world
from tests.support.says import says

HAND = "human.right_hand"


def test_hand_jacobian_by_differences() -> None:
    world = human_world("planted")
    q = anywhere(world, 6)
    place = world.at(q, [HAND]).placement(HAND)
    moved = differences(lambda x: world.at(x, [HAND]).position[:, 0], q)
    np.testing.assert_allclose(place.jacobian[:, :3], moved, atol=1e-8)
    for number in range(3):
        found = features.axis(place, number)
        full = differences(lambda x, at=number: world.at(x, [HAND]).rotation[:, 0, :, at], q)
        np.testing.assert_allclose(found.jacobian, full, atol=1e-8)


def test_soles_of_the_planted_human_stay_where_it_stands() -> None:
    world = human_world("planted")
    positions = np.array([position for _, position in world.planted.values()])
    np.testing.assert_allclose(positions.mean(axis=0), [0.1, -0.3, 0.0], atol=1e-12)
    rotation = next(iter(world.planted.values()))[0]
    np.testing.assert_allclose(rotation[:2, 0], [np.cos(np.radians(40)), np.sin(np.radians(40))])


def test_other_tables_share_the_kinematics_but_other_agents_do_not() -> None:
    world = human_world()
    moved = world.with_scene(world.scene.with_heights({"near": 1.2}))
    assert moved.scene.tables["table.near"].height == 1.2
    assert world.scene.tables["table.near"].height == 0.8
    with pytest.raises(WorldError) as error:
        world.with_scene(human_world("planted").scene)
    says(error, "human", "tables and objects only", "build a new World")


@pytest.mark.parametrize(
    ("joints", "facts"),
    [
        ({"right_elbow_Z": 200.0}, ("human.right_elbow_Z starts at 200 deg", "expected 0 to 145 deg")),
        ({"pelvis_x": 0.5}, ("human.pelvis_x starts at 0.5 m", "expected -0.12 to 0.12 m")),
        ({"right_elbow_z": 20.0}, ("no joint 'right_elbow_z'", "did you mean 'right_elbow_Z'")),
    ],
)
def test_wrong_first_postures_are_refused(joints: dict[str, float], facts: tuple[str, ...]) -> None:
    scene = human_world().scene
    assert scene.human is not None
    with pytest.raises(WorldError) as error:
        World(replace(scene, humans={"human": replace(scene.human, joints=joints)}))
    says(error, *facts)


def test_wrong_names_and_shapes_are_refused() -> None:
    world = human_world()
    with pytest.raises(WorldError) as error:
        world.at(world.initial_configuration[None], ["human.right_hnad"])
    says(error, "did you mean 'human.right_hand'")
    with pytest.raises(WorldError) as error:
        world.at(world.initial_configuration, [HAND])
    says(error, "shape (29,)", "expected (n, 29)")
    with pytest.raises(WorldError) as error:
        world.columns("robot")
    says(error, "no agent 'robot'")


@needs_robots
def test_baxter_moves_its_arms_only_and_rests_in_its_limits() -> None:
    world = screwdriver_world()
    own = [world.joints[column] for column in world.columns("baxter")]
    assert len(own) == 14
    assert all(name[7:-3] in ("left", "right") for name in own)
    assert np.all((world.initial_configuration >= world.lower) & (world.initial_configuration <= world.upper))
    hands = world.at(world.initial_configuration[None], ["baxter.left", "baxter.right"]).position[0]
    np.testing.assert_allclose(hands[0] * (1, -1, 1), hands[1], atol=1e-6)


@needs_robots
def test_a_panda_works_by_name_and_any_urdf_by_path() -> None:
    values = {
        "domain": "screwdriver",
        "initial": [],
        "goal": [],
        "robots": {
            "arm": {"model": "panda", "position": [0, 0.5, 0]},
            "spare": {
                "model": str(robot.urdf_of("panda")),
                "position": [1, 0, 0.2],
                "yaw": 90,
                "locked": ["panda_finger_*"],
                "hands": {"tip": {"frame": "panda_hand_tcp"}},
            },
        },
    }
    world = World(read_scene(values))
    assert world.nq == 14
    places = world.at(world.initial_configuration[None], ["arm.hand", "spare.tip"])
    assert places.placement("arm.hand").axis(2)[0, 2] < -0.9
    assert not places.placement("spare.tip").jacobian[0, :, :7].any()


def test_hands_without_a_limit_change_nothing_else() -> None:
    world = human_world()
    free = world.without_tilt_limits("human")
    assert {hand.tilt for hand in free.scene.hands.values()} == {180.0}
    assert free.joints == world.joints
    assert free.scene.tables == world.scene.tables


@needs_robots
def test_initial_values_of_prismatic_joints_are_metres() -> None:
    scene = load_scene("screwdriver_panda")
    (name, robot), *_ = scene.robots.items()
    free = tuple(pattern for pattern in robot.locked if "finger" not in pattern)
    joints = {**robot.joints, "panda_finger_joint1": 0.03}
    world = World(replace(scene, robots={**scene.robots, name: replace(robot, locked=free, joints=joints)}))
    assert world.initial_configuration[world.column[f"{name}.panda_finger_joint1"]] == pytest.approx(0.03)
