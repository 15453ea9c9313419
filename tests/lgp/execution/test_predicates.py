"""Predicates in the tracked world: their meaning, and those of an action."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.execution.predicates import check, end_of, first_failing, free, grasped, on_table, placed, start_of
from lgp.kinematics.world import World
from lgp.planner import task_of
from tests.support.tracked_box import HAND, box_world, table_top, tracked_box


@pytest.fixture(scope="module")
def world() -> World:
    return box_world()


def test_an_object_at_rest_on_a_table_is_placed(world: World) -> None:
    view = tracked_box(world, [table_top(world)] * 8)
    assert on_table(view, "box").holds
    assert placed(view, "box", "table.near").holds
    assert free(view, HAND).holds
    assert grasped(view, HAND, "box").holds is False


def test_an_object_that_moves_or_hovers_or_is_off_the_table_is_not_placed(world: World) -> None:
    moving = tracked_box(world, [table_top(world) + np.array([0.01 * k, 0, 0]) for k in range(8)])
    hovering = tracked_box(world, [table_top(world) + np.array([0, 0, 0.05])] * 8)
    beside = tracked_box(world, [table_top(world) + np.array([1.0, 0, 0])] * 8)
    assert [on_table(view, "box").holds for view in (moving, hovering, beside)] == [False] * 3


def test_an_object_that_is_lost_is_neither_here_nor_there(world: World) -> None:
    view = tracked_box(world, [table_top(world)] * 8, age=1.0)
    assert view.seen("box") is None
    assert on_table(view, "box").holds is None
    assert grasped(view, HAND, "box").why == "box is not seen"
    glimpse = tracked_box(world, [table_top(world)])
    assert on_table(glimpse, "box").why == "box was seen for a moment only"


def test_start_and_end_predicates_are_those_of_the_domain(world: World) -> None:
    task = task_of(world.scene)
    action = task.action(f"grasp({HAND}, box)")
    assert {str(one) for one in start_of(task, action)} == {f"free({HAND})", "on_table(box)"}
    assert [str(one) for one in end_of(task, action)] == [f"grasped({HAND}, box)"]
    verdicts = check(end_of(task, action), tracked_box(world, [table_top(world)] * 8), task, task.initial)
    assert "away from human.right_hand" in first_failing(verdicts)
