"""Predicates in the tracked world: their meaning, and those of an action."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.execution.predicates import (
    RECOGNISERS,
    TRUE,
    Predicate,
    check,
    end_of,
    evaluate_predicate,
    first_failing,
    free,
    grasped,
    on_table,
    placed,
    start_of,
)
from lgp.execution.tracking import TrackedWorld
from lgp.kinematics.world import World
from lgp.logic.task import Atom
from lgp.planner import task_of
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY
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


def _box_between_both_hands(height: float = 0.0, on_a_table: bool = False) -> TrackedWorld:
    """Return the tracked world with a box between the hands of a person, moved up by a height [m] or on a table."""
    values = HUMAN_ONLY | {"human": {"hands": ["left_hand", "right_hand"], "position": [-3, 0]}, "initial": []}
    world = World(read_scene(values))
    left, right = world.at(world.initial_configuration[None], ["human.left_hand", "human.right_hand"]).position[0]
    size = [0.3, float(np.linalg.norm(left - right)), 0.2]
    values = values | {"objects": {"box": values["objects"]["box"] | {"size": size}}}
    if on_a_table:
        middle = (left + right) / 2.0
        table = {"position": middle[:2].tolist(), "size": [0.4, 0.4], "height": float(middle[2]) - 0.1}
        values = values | {"tables": {"near": table}}
    world = World(read_scene(values))
    return tracked_box(world, [(left + right) / 2.0 + np.array([0.0, 0.0, height])] * 8)


def test_a_hand_that_helps_to_carry_is_as_the_plan_has_it() -> None:
    view = _box_between_both_hands()
    for hand in ("human.left_hand", HAND):
        atom = Atom("free", (hand,))
        assert grasped(view, hand, "box").holds
        assert evaluate_predicate(view, atom, {atom}).holds, "it may be in the other one"
        assert evaluate_predicate(view, atom, set()).holds is False
        assert Predicate(atom, wanted=False).check(view, set()).holds
        assert evaluate_predicate(_box_between_both_hands(0.5), atom, set()).holds, "the box is not at the hand"
    standing = _box_between_both_hands(on_a_table=True)
    assert standing.table_under("box")
    assert not evaluate_predicate(standing, atom, set()).holds, "it has taken the box, which still stands there"


def test_what_must_not_hold_is_said_in_words(world: World) -> None:
    view = tracked_box(world, [table_top(world)] * 8)
    said = {predicate: TRUE[predicate] for predicate in RECOGNISERS}
    why = Predicate(Atom("on_table", ("box",)), wanted=False).check(view, set()).why
    assert why == said["on_table"].format("box") == "box lies on a table"
    assert Predicate(Atom("free", (HAND,)), wanted=False).check(view, {Atom("free", (HAND,))}).why == f"{HAND} is free"
