"""Motions from rest to rest, brakes, and the limits of the robots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.execution.trajectory import Brake, JointTrajectory, time_scaled, violations
from tests.support.lgp_worlds import needs_robots, screwdriver_world


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
    knots = np.tile(world.initial_configuration, (5, 1))
    knots[:, at] += np.linspace(0.0, 1.2, 5)
    fast = JointTrajectory(knots, 0.5)
    (broken,) = violations(world, fast, columns)
    assert (broken.joint, broken.kind, broken.limit) == ("baxter.left_s1", "velocity", 1.5)
    assert abs(broken.value) > 1.5
    slow, factor = time_scaled(world, fast, columns)
    assert factor == pytest.approx(1.001 * abs(broken.value) / 1.5)
    assert violations(world, slow, columns) == []
    knots[:, at] = np.linspace(world.initial_configuration[at], world.upper[at] + 0.2, 5)
    assert violations(world, JointTrajectory(knots, 9.0), columns)[0].kind == "position"
