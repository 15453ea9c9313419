"""The parts of a run one by one: motions, limits, messages, and what predicates mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.execution.predicates import check, end_of, first_failing, free, grasped, on_table, placed, start_of
from lgp.execution.ros_messages import DEFINITIONS, TRAJECTORY, encode, quaternion, trajectory_message
from lgp.execution.tracked_scene import atoms_now, carrier, scene_now
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.execution.trajectory import Brake, JointTrajectory, time_scaled, violations
from lgp.kinematics.features import exponential
from lgp.kinematics.world import World
from lgp.logic.task import parse_atom
from lgp.planner import task_of
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY, needs_robots, screwdriver_world

HAND = "human.right_hand"


@settings(deadline=None, max_examples=25)
@given(st.integers(2, 8), st.floats(0.2, 5.0), st.floats(1.0, 3.0), st.integers(0, 9))
def test_a_motion_begins_and_ends_at_rest_where_it_should(
    slices: int, seconds: float, stretch: float, seed: int
) -> None:
    knots = np.random.default_rng(seed).normal(size=(slices + 1, 3))
    segment = JointTrajectory(knots, seconds, stretch)
    np.testing.assert_allclose(segment.at(0.0), knots[0], atol=1e-9)
    np.testing.assert_allclose(segment.at(segment.duration + 1.0), knots[-1], atol=1e-9)
    for end in (0.0, segment.duration):
        np.testing.assert_allclose(segment.velocity(end), 0.0, atol=1e-9)
    times = np.linspace(0.0, segment.duration, 301)
    q, v = np.array([segment.at(t) for t in times]), np.array([segment.velocity(t) for t in times])
    steps = 0.5 * (v[1:] + v[:-1]) * np.diff(times)[:, None]
    np.testing.assert_allclose(np.diff(q, axis=0), steps, atol=2e-2 * np.abs(v).max() * np.diff(times)[0] + 1e-9)


def test_a_brake_goes_on_as_the_motion_went_and_ends_at_rest() -> None:
    segment = JointTrajectory(np.array([[0.0], [1.0], [2.0]]), 1.0)
    brake = Brake(segment.at(0.5), segment.velocity(0.5))
    np.testing.assert_allclose(brake.velocity(0.0), segment.velocity(0.5))
    assert brake.velocity(brake.duration)[0] == 0.0
    assert brake.at(9.0)[0] == brake.at(brake.duration)[0] > segment.at(0.5)[0]


@needs_robots
def test_limits_name_joint_time_and_value_and_slowing_down_keeps_them() -> None:
    world = screwdriver_world()
    columns = world.columns("baxter")
    at = world.column["baxter.left_s1"]
    knots = np.tile(world.start, (5, 1))
    knots[:, at] += np.linspace(0.0, 1.2, 5)
    fast = JointTrajectory(knots, 0.5)
    (broken,) = violations(world, fast, columns)
    assert (broken.joint, broken.kind, broken.limit) == ("baxter.left_s1", "velocity", 1.5)
    assert abs(broken.value) > 1.5
    slow, factor = time_scaled(world, fast, columns)
    assert factor == pytest.approx(1.001 * abs(broken.value) / 1.5)
    assert violations(world, slow, columns) == []
    knots[:, at] = np.linspace(world.start[at], world.upper[at] + 0.2, 5)
    assert violations(world, JointTrajectory(knots, 9.0), columns)[0].kind == "position"


def test_messages_are_what_ros_writes() -> None:
    typestores = pytest.importorskip("rosbags.typesys")
    store = typestores.get_typestore(typestores.Stores.ROS2_HUMBLE)
    segment = JointTrajectory(np.random.default_rng(1).normal(size=(4, 3)), 0.3)
    message = trajectory_message(1_700_000_000_123_456_789, ["a", "joint_b", "c"], segment, np.arange(3))
    data = encode(TRAJECTORY, message)
    read = store.deserialize_cdr(data, TRAJECTORY)
    assert list(read.joint_names) == ["a", "joint_b", "c"]
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    assert [list(point.velocities) for point in read.points] == [p["velocities"] for p in message["points"]]
    assert bytes(store.serialize_cdr(read, TRAJECTORY)) == data
    for name, text in DEFINITIONS.items():
        assert typestores.get_types_from_msg(text, name)[name][1] == store.fielddefs[name][1]


@settings(deadline=None, max_examples=25)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_quaternions_turn_as_their_matrices_do(vector: list[float]) -> None:
    turn = exponential(np.array(vector))
    x, y, z, w = quaternion(turn)
    axis = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    np.testing.assert_allclose(np.eye(3) + 2 * w * axis + 2 * axis @ axis, turn, atol=1e-9)


@pytest.fixture(scope="module")
def world() -> World:
    return World(
        read_scene(HUMAN_ONLY | {"initial": ["on_table(box)", f"free({HAND})", "free(human.left_hand)"]}, "box")
    )


def seen(world: World, spots: list[np.ndarray], stale: float = 0.0, **more: object) -> TrackedWorld:
    """Return a view of the box at some places, one every 0.05 s, that nobody moves for."""
    view = TrackedWorld(world)
    for number, spot in enumerate(spots):
        time = 0.05 * number
        objects = {"box": TrackedPose(np.eye(3), np.asarray(spot, dtype=float), time - stale)}
        view.add(Observation(time, world.start, objects))
    return view


def top(world: World) -> np.ndarray:
    table = world.scene.tables["table.near"]
    return np.array([*table.position, table.height + world.scene.things["box"].size[2] / 2])


def test_an_object_at_rest_on_a_table_is_placed(world: World) -> None:
    view = seen(world, [top(world)] * 8)
    assert on_table(view, "box").holds
    assert placed(view, "box", "table.near").holds
    assert free(view, HAND).holds
    assert grasped(view, HAND, "box").holds is False


def test_an_object_that_moves_or_hovers_or_is_off_the_table_is_not_placed(world: World) -> None:
    moving = seen(world, [top(world) + np.array([0.01 * k, 0, 0]) for k in range(8)])
    hovering = seen(world, [top(world) + np.array([0, 0, 0.05])] * 8)
    beside = seen(world, [top(world) + np.array([1.0, 0, 0])] * 8)
    assert [on_table(view, "box").holds for view in (moving, hovering, beside)] == [False] * 3


def test_an_object_that_is_lost_is_neither_here_nor_there(world: World) -> None:
    view = seen(world, [top(world)] * 8, stale=1.0)
    assert view.seen("box") is None
    assert on_table(view, "box").holds is None
    assert grasped(view, HAND, "box").why == "box is not seen"
    glimpse = seen(world, [top(world)])
    assert on_table(glimpse, "box").why == "box was seen for a moment only"


def test_an_object_in_the_hand_is_grasped_and_the_scene_has_it_there(world: World) -> None:
    at = world.at(world.start[None], [HAND]).position[0, 0]
    view = seen(world, [at] * 8)
    assert grasped(view, HAND, "box").holds
    assert free(view, HAND).holds is False
    task = task_of(world.scene)
    assert carrier(view, "box", set()) == HAND
    atoms = atoms_now(view, task, {parse_atom("on_table(box)")})
    assert parse_atom(f"grasped({HAND}, box)") in atoms
    assert parse_atom("on_table(box)") not in atoms
    scene = scene_now(world.scene, view, set(), atoms)
    held = World(scene)
    from lgp.kinematics.modes import ModeSequence

    modes = ModeSequence(held, ())
    pose = modes.pose("box", 0, held.at(held.start[None], modes.frames), np.zeros(0))
    np.testing.assert_allclose(pose.position[0], at, atol=1e-9)
    np.testing.assert_allclose(pose.rotation[0], np.eye(3), atol=1e-9)


def test_start_and_end_predicates_are_those_of_the_domain(world: World) -> None:
    task = task_of(world.scene)
    action = task.action(f"grasp({HAND}, box)")
    assert {str(one) for one in start_of(task, action)} == {f"free({HAND})", "on_table(box)"}
    assert [str(one) for one in end_of(task, action)] == [f"grasped({HAND}, box)"]
    verdicts = check(end_of(task, action), seen(world, [top(world)] * 8), task, task.initial)
    assert "away from human.right_hand" in first_failing(verdicts)


def test_the_scene_that_is_seen_is_the_scene_that_was(world: World) -> None:
    box = replace(world.scene.things["box"], at=(0.05, -0.04, 33.0))
    scene = read_scene(
        world.scene.values, "box", {"objects.box": {**world.scene.values["objects"]["box"], "at": [0.05, -0.04, 33.0]}}
    )
    assert scene.things["box"] == box
    from lgp.execution.simulation import SimulatedRobots, SimulatedWorld

    there = world.with_scene(scene)
    simulation = SimulatedWorld(there, SimulatedRobots(there, there.start), there.start)
    for number in range(1, 9):
        simulation.step(0.05 * number)
    task = task_of(scene)
    again = scene_now(scene, simulation.view, set(), task.holding(task.initial))
    np.testing.assert_allclose(again.things["box"].at, box.at, atol=1e-9)
