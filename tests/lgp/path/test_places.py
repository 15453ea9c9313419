"""Places of objects that actions move."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lgp.planner import task_of
from lgp.scene.scene_file import load_scene
from tests.support.lgp_worlds import needs_robots


@needs_robots
@pytest.mark.parametrize("scene", ["screwdriver", "screwdriver_panda"])
def test_what_is_taken_away_is_placed_nowhere_and_what_is_put_elsewhere_is_there_alone(scene: str) -> None:
    task = task_of(load_scene(scene))
    hand = next(a.arguments[0] for a in task.actions if a.name == "place" and not a.arguments[0].startswith("human"))
    state, seen = task.initial, []
    for text in (
        f"grasp({hand}, screwdriver)",
        f"place({hand}, screwdriver, table.left)",
        f"grasp({hand}, screwdriver)",
        f"place({hand}, screwdriver, table.center)",
    ):
        action = task.action(text)
        assert action.applies(state)
        state = action.apply(state)
        seen.append([str(atom) for atom in task.holding(state) if atom.predicate == "placed"])
    assert seen == [[], ["placed(screwdriver, table.left)"], [], ["placed(screwdriver, table.center)"]]


def test_a_thing_cannot_be_in_a_hand_and_on_a_table_in_the_end() -> None:
    scene = load_scene("screwdriver")
    goal = (*scene.goal, "placed(screwdriver, table.left)")
    assert scene.goal == ("grasped(human.right_hand, screwdriver)",)
    task = task_of(replace(scene, goal=goal))
    states, new = {task.initial}, [task.initial]
    while new:
        new = [after for state in new for _, after in task.successors(state) if after not in states]
        states.update(new)
    assert len(states) > 1
    assert not any(map(task.is_goal, states))
