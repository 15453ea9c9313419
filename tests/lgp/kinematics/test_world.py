"""Everybody's kinematics, features and their derivatives."""

from __future__ import annotations

from dataclasses import replace
from importlib import metadata

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.errors import WorldError
from lgp.kinematics import features, robot
from lgp.kinematics.features import exponential, exponential_with_slope, inverse_right_jacobian, logarithm
from lgp.kinematics.world import World
from lgp.scene.model import Robot
from lgp.scene.scene_file import load_scene, read_scene
from tests.support.lgp_worlds import anywhere, differences, human_world, needs_robots, screwdriver_world
from tests.support.says import says

HAND = "human.right_hand"
VECTORS = st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array)


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


@pytest.mark.parametrize("kind", ["along", "tilt", "pose", "pose_difference"])
def test_features_by_differences(kind: str) -> None:
    world = human_world("planted")
    q = anywhere(world, 6, seed=5)
    rotation = exponential(np.array([0.3, -1.0, 0.4]))

    def feature(x: np.ndarray) -> features.Feature:
        kinematics = world.at(x, [HAND, "human.left_hand"])
        place, other = kinematics.placement(HAND), kinematics.placement("human.left_hand")
        if kind == "along":
            return features.along(place, 0, rotation[0])
        if kind == "tilt":
            return features.tilt(place, 30.0)
        if kind == "pose":
            return features.pose(place, rotation, np.array([0.1, 0.2, 0.3]))
        return features.pose_difference(place, other)

    np.testing.assert_allclose(feature(q).jacobian, differences(lambda x: feature(x).value, q), atol=2e-7)


def test_curvature_by_differences_of_jacobians() -> None:
    world = human_world("planted")
    q = anywhere(world, 3)
    weights = np.random.default_rng(0).standard_normal((3, 3))

    def slopes(x: np.ndarray, turned: bool) -> np.ndarray:
        place = world.at(x, [HAND]).placement(HAND)
        jacobian = features.axis(place, 2).jacobian if turned else place.jacobian[:, :3]
        return np.einsum("ni,nij->nj", weights, jacobian)

    place = world.at(q, [HAND]).placement(HAND)
    np.testing.assert_allclose(
        features.position_curvature(place.jacobian, weights), differences(lambda x: slopes(x, False), q), atol=1e-7
    )
    np.testing.assert_allclose(
        features.axis_curvature(place.jacobian, place.axis(2), weights),
        differences(lambda x: slopes(x, True), q),
        atol=1e-7,
    )


@settings(max_examples=60, deadline=None)
@given(VECTORS)
def test_rotation_vectors_go_round(vector: np.ndarray) -> None:
    rotation = exponential(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(logarithm(rotation), vector, atol=1e-7)
    np.testing.assert_allclose(
        inverse_right_jacobian(vector) @ rotation.T @ exponential_with_slope(vector)[1], np.eye(3), atol=1e-9
    )


@pytest.mark.parametrize("vector", [(np.pi, 0, 0), (0, -np.pi, 0), (np.pi / np.sqrt(2), 0, -np.pi / np.sqrt(2))])
def test_half_a_turn_has_its_length(vector: tuple[float, ...]) -> None:
    found = logarithm(exponential(np.array(vector)))
    np.testing.assert_allclose(exponential(found), exponential(np.array(vector)), atol=1e-7)
    assert np.linalg.norm(found) == pytest.approx(np.pi)


def test_soles_of_the_planted_human_stay_where_it_stands() -> None:
    world = human_world("planted")
    positions = np.array([position for _, position in world.planted.values()])
    np.testing.assert_allclose(positions.mean(axis=0), [0.3, -0.2, 0.0], atol=1e-12)
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
        (
            {"right_elbow_Z": 200.0},
            (
                "human.right_elbow_Z starts at 200 deg",
                "expected 0 to 145 deg",
            ),
        ),
        (
            {"pelvis_x": 0.5},
            (
                "human.pelvis_x starts at 0.5 m",
                "expected -0.12 to 0.12 m",
            ),
        ),
        (
            {"right_elbow_z": 20.0},
            (
                "no joint 'right_elbow_z'",
                "did you mean 'right_elbow_Z'",
            ),
        ),
    ],
)
def test_wrong_first_postures_are_refused(joints: dict[str, float], facts: tuple[str, ...]) -> None:
    scene = human_world().scene
    assert scene.human is not None
    with pytest.raises(WorldError) as error:
        World(replace(scene, human=replace(scene.human, joints=joints)))
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


def test_without_the_package_the_command_to_install_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(robot.metadata, "distribution", absent)
    with pytest.raises(WorldError) as error:
        World(load_scene("screwdriver"))
    says(error, "pip install 'dreba[robots]'")


def test_unknown_robots_are_refused() -> None:
    with pytest.raises(WorldError) as error:
        robot.urdf_of("baxtr")
    says(error, "did you mean 'baxter'")


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


@needs_robots
def test_wrong_locked_joints_are_refused() -> None:
    with pytest.raises(WorldError) as error:
        robot.robot_model(Robot("b", (0, 0, 0), 0, (), ("left_x*",), {}, "baxter"))
    says(error, "no joint matches 'left_x*'")
    with pytest.raises(WorldError) as error:
        robot.robot_model(Robot("b", (0, 0, 0), 0, (), (), {"left_s9": 1.0}, "baxter"))
    says(error, "no joint 'left_s9'", "did you mean 'left_s")


def test_hands_without_a_limit_change_nothing_else() -> None:
    world = human_world()
    free = world.with_free_hands("human")
    assert {hand.tilt for hand in free.scene.hands.values()} == {180.0}
    assert free.joints == world.joints
    assert free.scene.tables == world.scene.tables
