"""Motions of agents as the plan interpolates: times, positions, velocities."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from lgp.errors import LgpError
from tests.support.gantry import SECONDS, carried
from tests.support.says import says


def test_the_moments_are_those_of_the_plan_or_in_equal_steps(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    motion = plan.trajectory("gantry")
    assert motion.joints == ("x", "y", "z", "tilt")
    np.testing.assert_array_equal(motion.time, [0.0, *plan.time])
    np.testing.assert_allclose(motion.position, [plan.start, *plan.path], atol=1e-12)
    dense = plan.trajectory("gantry", step=0.03)
    np.testing.assert_allclose(np.diff(dense.time)[:-1], 0.03)
    assert dense.time[-1] == 2 * SECONDS
    np.testing.assert_allclose(dense.position[-1], plan.path[-1])


def test_positions_and_velocities_are_those_of_a_cubic_with_mean_slopes(
    tmp_path: Path,
) -> None:
    plan = carried(tmp_path)
    dense = plan.trajectory("gantry", step=0.017)
    tau = plan.time[0]
    knots = np.array([plan.start, plan.start, *plan.path, plan.path[-1]])
    steps = np.diff(knots, axis=0, prepend=knots[:1], append=knots[-1:]) / tau
    slopes = np.where((steps[:-1] == 0.0) | (steps[1:] == 0.0), 0.0, (steps[:-1] + steps[1:]) / 2.0)
    spline = CubicHermiteSpline(np.arange(len(knots)) * tau - tau, knots, slopes)
    np.testing.assert_allclose(dense.position, spline(dense.time), atol=1e-12)
    np.testing.assert_allclose(dense.velocity, spline(dense.time, 1), atol=1e-9)
    assert not dense.velocity[[0, -1]].any()


def test_a_trajectory_is_a_table_too(tmp_path: Path) -> None:
    motion = carried(tmp_path).trajectory("gantry", step=0.5)
    table = motion.frame()
    assert list(table.columns[:3]) == ["time", "x", "y"]
    np.testing.assert_array_equal(table["z_velocity"], motion.velocity[:, 2])


def test_a_plan_without_actions_stands_still(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    still = replace(plan, actions=(), time=plan.time[:0], phase=plan.phase[:0], path=plan.path[:0])
    for step in (None, 0.1):
        motion = still.trajectory("gantry", step=step)
        assert motion.position.shape[1] == 4
        assert not motion.velocity.any()


def test_wrong_agents_and_plans_without_motion_are_refused(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    with pytest.raises(LgpError) as error:
        plan.trajectory("gantri")
    says(error, "no agent 'gantri'", "did you mean 'gantry'")
    with pytest.raises(LgpError) as error:
        replace(plan, feasible=False, reason="too far").trajectory("gantry")
    says(error, "infeasible (too far)")
    with pytest.raises(LgpError) as error:
        plan.trajectory("gantry", step=1e-9)
    says(error, "step is 1e-09 s", "expected up to")
    with pytest.raises(LgpError) as error:
        plan.trajectory("gantry", step=0)  # type: ignore[arg-type]
    says(error, "step", "above 0")
