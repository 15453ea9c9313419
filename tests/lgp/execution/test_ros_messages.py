"""ROS 2 messages of the log, against the serialiser of another package."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.execution.ros_messages import DEFINITIONS, TRAJECTORY, encode, quaternion, trajectory_message
from lgp.execution.trajectory import JointTrajectory
from lgp.kinematics.features import exponential


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
