"""Reactions of the executive to faults: retarget, replan, wait, repeat, fail."""

from __future__ import annotations

from pathlib import Path

import pytest

import lgp
from lgp.execution.executive import Settings
from lgp.execution.session import ExecutionRun, RunOptions
from lgp.execution.worker import EXACT
from tests.support.execution_plans import kinds, saved, went
from tests.support.lgp_worlds import needs_robots

pytestmark = [pytest.mark.slow, needs_robots]
QUICK = Settings(patience=1.5, reminder=0.5, search=3.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return saved(tmp_path)


def test_a_moved_object_moves_one_motion_and_the_rest_goes_on(folder: Path) -> None:
    summary, events = went(folder, "moved@1")
    assert summary["state"] == "finished"
    assert summary["stops"]["moved"] == 1
    assert summary["replanned"] == 0
    assert kinds(events)[:5] == ["started", "fault", "moved", "retargeted", "started"]
    assert "screwdriver is 0.10" in next(event for event in events if event.kind == "retargeted").details["why"]


def test_an_object_put_out_of_reach_makes_a_new_plan(folder: Path) -> None:
    summary, events = went(folder, "away@3", settings=Settings(search=600.0))
    assert summary["state"] == "finished"
    assert summary["replanned"] == 1
    assert [event.plan for event in events if event.kind in ("told", "started")] == [0, 0, 0, 1, 1, 1]
    again = lgp.Plan.load(folder / "replans" / "1")
    assert again.feasible
    assert summary["actions"][-3:] == list(again.actions)


def test_a_search_that_runs_out_of_time_ends_the_run_and_says_why(folder: Path) -> None:
    summary, _ = went(folder, "away@3", settings=Settings(search=0.0))
    assert summary["state"] == "failed"
    assert "none was found in 0 s, and the motion cannot be retargeted" in summary["why"]


def test_a_dropped_object_is_waited_for_and_fetched_again(folder: Path) -> None:
    summary, events = went(folder, "dropped@2")
    assert summary["state"] == "finished"
    assert summary["stops"]["dropped"] == summary["replanned"] == 1
    waits = [event.text for event in events if event.kind == "waiting"]
    assert any("put it back on a table" in text for text in waits)


def test_an_object_that_nobody_picks_up_ends_the_run(folder: Path) -> None:
    from dataclasses import replace

    summary, _ = went(folder, "dropped@2", behaviour=replace(EXACT, help=1e9), settings=QUICK)
    assert summary["state"] == "failed"
    assert "put it back on a table" in summary["why"]


@pytest.mark.parametrize("action", [1, 2])
def test_a_lost_object_stops_the_robot_until_it_is_seen(folder: Path, action: int) -> None:
    summary, events = went(folder, f"lost@{action}:1.5")
    assert summary["state"] == "finished"
    assert summary["stops"]["lost"] == 1
    assert summary["replanned"] == 0
    lost = next(event for event in events if event.kind == "lost")
    again = next(event for event in events if event.kind == "started" and event.time > lost.time)
    assert 1.0 < again.time - lost.time < 3.0


def test_an_object_that_stays_lost_ends_the_run(folder: Path) -> None:
    summary, _ = went(folder, "lost@1:100", settings=QUICK)
    assert summary["state"] == "failed"
    assert "screwdriver is not seen" in summary["why"]


@pytest.mark.parametrize(("fault", "why"), [("stuck@1", "baxter.right is open"), ("stuck@3", "away from human")])
def test_an_action_that_never_ends_is_tried_once_more_and_given_up(folder: Path, fault: str, why: str) -> None:
    summary, events = went(folder, fault, settings=QUICK)
    assert summary["state"] == "failed"
    assert "was not finished in time" in summary["why"]
    assert why in summary["why"]
    assert summary["stops"]["timeout"] == 1
    assert kinds(events).count("late") == 2


def test_a_motion_too_fast_is_slowed_down_or_refused(folder: Path) -> None:
    session = ExecutionRun(folder, RunOptions(speed=0.0, compare=False, behaviour=EXACT))
    session.planner.motion.world.model.velocityLimit *= 0.3
    assert session.go()["slowed"] >= 1
    session = ExecutionRun(folder, RunOptions(speed=0.0, behaviour=EXACT, settings=Settings(slow_down=False)))
    session.planner.motion.world.model.velocityLimit *= 0.3
    summary = session.go()
    assert summary["state"] == "failed"
    assert "velocity" in summary["why"]
