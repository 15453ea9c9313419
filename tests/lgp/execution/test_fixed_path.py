"""Path problems with given values: hands that hold, arms that move as planned."""

from __future__ import annotations

import numpy as np

from lgp.execution.fixed_path import SLACK, FixedPathBounds, planned_course
from lgp.planner import task_of
from tests.support.lgp_worlds import needs_robots, screwdriver_world

pytestmark = needs_robots


def test_a_hand_that_holds_is_free_after_its_next_action() -> None:
    world = screwdriver_world()
    task = task_of(world.scene)
    names = ("grasp(human.right_hand, screwdriver)", "place(human.right_hand, screwdriver, table.center)",
             "grasp(baxter.right, screwdriver)", "place(baxter.right, screwdriver, table.left)")  # fmt: skip
    bounds = FixedPathBounds(world, slices=2, holding=["baxter.right"])
    problem = bounds.problem("path", bounds.phases(tuple(map(task.action, names))))
    arm = np.flatnonzero(world.support("baxter.right"))
    room = (problem.upper - problem.lower)[: 8 * world.nq].reshape(8, -1)[:, arm].max(axis=1)
    np.testing.assert_allclose(room[:6], 2 * SLACK)
    assert (room[6:] > 0.1).all()


def test_an_arm_without_a_part_moves_as_planned_as_a_whole_or_not_at_all() -> None:
    world = screwdriver_world()
    planned = world.initial_configuration + np.linspace(0.0, 0.1, 4)[:, None]
    left, right = (set(np.flatnonzero(world.support(f"baxter.{side}"))) for side in ("left", "right"))
    assert left | right <= set(planned_course(world, planned[0], planned, []).columns)
    off = planned[0].copy()
    off[min(right)] += 0.1
    course = planned_course(world, off, planned, [])
    assert left <= set(course.columns)
    assert not right & set(course.columns)
    np.testing.assert_array_equal(course.values, planned[1:, course.columns])
    assert not left & set(planned_course(world, off, planned, ["baxter.left"]).columns)
    assert not set(world.columns("human")) & set(course.columns)
