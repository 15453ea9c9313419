"""Delete-relaxation heuristics: bounds and reasons."""

from __future__ import annotations

from collections import deque

from lgp.logic.heuristic import relaxed_plan, why_unreachable
from lgp.logic.task import Task
from tests.support.lgp_tasks import INITIAL, screwdriver


def shortest(task: Task) -> int | None:
    """Breadth-first search: the true number of actions to the goal."""
    seen, queue = {task.initial}, deque([(task.initial, 0)])
    while queue:
        state, steps = queue.popleft()
        if task.is_goal(state):
            return steps
        for _, after in task.successors(state):
            if after not in seen:
                seen.add(after)
                queue.append((after, steps + 1))
    return None


def test_relaxed_plan_bounds_the_length() -> None:
    task = screwdriver()
    seen, queue = {task.initial}, [task.initial]
    while queue:
        state = queue.pop()
        plan = relaxed_plan(task, state)
        true = shortest(Task(task.domain, task.objects, task.atoms, task.actions, state, task.goal))
        assert plan is not None
        assert true is not None
        assert plan.layers <= true
        assert plan.layers <= len(plan.actions)
        for _, after in task.successors(state):
            if after not in seen:
                seen.add(after)
                queue.append(after)
    assert len(seen) > 10


def test_unreachable_goals_say_why() -> None:
    task = screwdriver(initial=[atom for atom in INITIAL if "human" not in atom])
    assert relaxed_plan(task, task.initial) is None
    why = why_unreachable(task)
    assert "grasped(human.right_hand, screwdriver) needs grasp, whose precondition free(human.right_hand)" in why
    assert why_unreachable(screwdriver()) == ""
    lost = screwdriver(initial=[atom for atom in INITIAL if "on_table" not in atom])
    assert "on_table(screwdriver)" in why_unreachable(lost)
