"""The partial order of a sequence, and the phases that it allows."""

from __future__ import annotations

import pytest

from lgp.errors import LogicError
from lgp.logic.task import Action
from lgp.path.partial_order import depends, earliest_phases, joined_phases, one_at_a_time, same_phase
from lgp.path.phases import Phases
from lgp.planner import parse_sequence, task_of
from lgp.scene.scene_file import load_scene
from tests.support.paths import ROOT
from tests.support.says import says

SCENE = load_scene(ROOT / "examples" / "scenes" / "fetch_while_screwing.toml")
TASK = task_of(SCENE)
SCREW, CAP = "screw(human.right_hand, rail, clamp)", "screw(human.right_hand, block, cap)"
FETCH = ("grasp(panda.hand, part)", "place(panda.hand, part, table.tray)")
TAKE = "grasp(human.right_hand, part)"
LINES = (SCREW, CAP, *FETCH, TAKE)


def actions(*lines: str) -> tuple[Action, ...]:
    return tuple(TASK.action(line) for line in lines)


def test_what_an_action_depends_on() -> None:
    screw, cap, grasp, place, take = actions(*LINES)
    assert depends(cap, screw), "one person"
    assert depends(place, grasp), "by its atoms"
    assert depends(take, place), "the part is on a table only then"
    assert not depends(grasp, screw)
    assert not depends(place, cap)
    assert depends(take, take)


def test_each_action_is_in_the_first_phase_that_it_can_end() -> None:
    assert earliest_phases(actions(*LINES)) == ((0, 2), (1, 3), (4,))
    # The order of the sequence decides nothing where none is needed.
    assert earliest_phases(actions(*FETCH, SCREW, CAP, TAKE)) == ((0, 2), (1, 3), (4,))
    assert earliest_phases(actions(*FETCH, TAKE)) == ((0,), (1,), (2,)), "nothing is independent"


def test_actions_are_kept_apart() -> None:
    every = range(len(LINES))
    assert earliest_phases(actions(*LINES), every) == ((0,), (1,), (2,), (3,), (4,))
    assert earliest_phases(actions(*LINES), set(every) - {2}) == ((0, 2), (1,), (3,), (4,))
    assert earliest_phases(actions(*LINES), {3}) == ((0, 2), (1,), (3,), (4,))


def test_every_order_of_a_phase_leads_to_the_goal() -> None:
    skeleton = joined_phases(actions(*LINES), ((0, 2), (1, 3), (4,)))
    assert [action.together for action in skeleton] == [False, True, False, True, False]
    assert one_at_a_time(skeleton) == actions(SCREW, FETCH[0], CAP, FETCH[1], TAKE)
    for order in ((0, 1, 2, 3, 4), (1, 0, 3, 2, 4)):
        state = TASK.initial
        for number in order:
            assert skeleton[number].applies(state)
            state = skeleton[number].apply(state)
        assert TASK.is_goal(state)


def test_phases_of_actions_at_the_same_time() -> None:
    skeleton = joined_phases(actions(*LINES), ((0, 2), (1, 3), (4,)))
    phases = Phases.of(SCENE, skeleton, slices=4)
    assert (phases.count, phases.total) == (3, 12)
    assert phases.phase_of.tolist() == [0, 0, 1, 1, 2]
    assert phases.switched.tolist() == [0, 2, 4]
    assert phases.ends.tolist() == [3, 7, 11]
    assert phases.keyframes.tolist() == [3, 3, 7, 7, 11]
    assert phases.label(3) == "place(2, panda.hand, part, table.tray)"
    assert phases.title(0) == "phase 1, screw(1, human.right_hand, rail, clamp) and grasp(1, panda.hand, part)"


def test_numbers_of_a_given_sequence_say_what_is_at_the_same_time() -> None:
    lines = [line.replace("(", f"({number}, ") for line, number in zip(LINES, (1, 2, 2, 3, 4), strict=True)]
    skeleton = parse_sequence(TASK, lines)
    assert [action.together for action in skeleton] == [False, False, True, False, False]
    assert same_phase(skeleton[:3]) == skeleton[1:3]
    assert not any(action.together for action in parse_sequence(TASK, LINES)), "no numbers"


@pytest.mark.parametrize("numbers", [(1, 1, 2, 3, 4), (1, 2, 3, 3, 4), (1, 2, 3, 4, 4)])
def test_what_depends_on_each_other_is_not_at_the_same_time(numbers: tuple[int, ...]) -> None:
    lines = [line.replace("(", f"({number}, ") for line, number in zip(LINES, numbers, strict=True)]
    with pytest.raises(LogicError) as error:
        parse_sequence(TASK, lines)
    says(error, "have the same number and cannot be at the same time", "give each a number of its own")
