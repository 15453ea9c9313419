"""The remaining actions of a plan, and the reasons why there is no new one."""

from __future__ import annotations

import numpy as np

from lgp.execution.fixed_path import FixedPathBounds
from lgp.execution.replan import first_reasons, remaining_actions
from lgp.execution.retarget import Planner
from lgp.planner import task_of
from tests.support.execution_plans import small_plan
from tests.support.lgp_worlds import needs_robots

pytestmark = needs_robots


def test_what_is_left_is_tried_first_with_what_must_be_done_again() -> None:
    planner = Planner(small_plan())
    world = planner.motion.world
    bounds = FixedPathBounds(world, slices=planner.motion.phases.slices)
    task = task_of(world.scene)
    # The screwdriver lies where it was at first: it was dropped on the way.
    assert remaining_actions(planner.motion, task, 1, bounds) == planner.actions
    path, variables = bounds.planned_motions[planner.actions]
    np.testing.assert_array_equal(path, planner.motion.path)
    np.testing.assert_array_equal(variables, planner.motion.variables)


def test_reasons_are_told_once_and_the_first_of_them_only() -> None:
    reason = "; ".join(f"phase {n}, grasp({n}, baxter.left, box): baxter.left is {n // 2} m away" for n in range(2, 12))
    assert (
        first_reasons(reason) == "baxter.left is 1 m away; baxter.left is 2 m away; baxter.left is 3 m away; and 2 more"
    )
