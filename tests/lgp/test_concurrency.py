"""Plans whose independent actions happen at the same time: planned both ways, audited, run, drawn and written."""

from __future__ import annotations

import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.concurrency import with_concurrent_actions
from lgp.console import show_plan
from lgp.errors import LgpError
from lgp.execution.retarget import Planner
from lgp.kinematics.world import World
from lgp.path.bounds import PathBounds
from lgp.planner import at_the_same_time, parse_sequence, plan_within, task_of, with_time_left
from lgp.scene.scene_file import read_scene
from lgp.search.records import Budget, Skeleton
from lgp.search.time_limit import TimeIsUp
from reba.terminal import Console
from tests.support.paths import ROOT
from tests.support.says import says
from tests.support.two_gantries import LEFT, RIGHT, two_gantries

pytestmark = pytest.mark.slow
TOGETHER = (
    "grasp(1, left.hand, box)",
    "grasp(1, right.hand, crate)",
    "place(2, left.hand, box, table.b)",
    "place(2, right.hand, crate, table.d)",
)
ALONE = (
    "grasp(1, left.hand, box)",
    "place(2, left.hand, box, table.b)",
    "grasp(3, right.hand, crate)",
    "place(4, right.hand, crate, table.d)",
)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> lgp.Plan:
    values = two_gantries(tmp_path_factory.mktemp("both"))
    return lgp.plan(read_scene(values), cost=None, sequence=[*LEFT, *RIGHT])


def test_independent_actions_share_phases(both: lgp.Plan) -> None:
    assert both.actions == TOGETHER
    assert both.phase_of == (0, 0, 1, 1)
    assert both.durations == (2.0, 2.0)
    assert both.status == "concurrent"
    assert both.audit["faults"] == []
    said = both.summary()["concurrent"]
    assert (said["kept"], said["reason"], said["tried"]) == (True, "", 1)
    one, other = said["one_at_a_time"], said["at_the_same_time"]
    assert (tuple(one["actions"]), tuple(other["actions"])) == (ALONE, TOGETHER)
    assert (one["seconds"], other["seconds"]) == (8.0, 4.0)
    assert other["cost"] == both.costs["total"] < one["cost"]


def test_both_objects_are_where_they_should_be(both: lgp.Plan) -> None:
    motion = lgp.Motion(both)
    for name, y in (("box", 0.0), ("crate", 1.5)):
        place = motion.object_poses(name).position
        np.testing.assert_allclose(place[10], place[0], atol=1e-9)
        assert np.abs(place[-1] - [1.0, y, place[0, 2]])[:2].max() < 0.21
        assert np.ptp(place[10:, 0]) > 0.5, "each is carried in the second phase"


def test_it_is_the_same_plan_given_by_its_numbers(both: lgp.Plan) -> None:
    again = lgp.plan(replace(both.scene, concurrent=False), cost=None, sequence=both.actions)
    assert again.actions == TOGETHER
    assert again.concurrent == {}
    assert again.costs["total"] == pytest.approx(both.costs["total"], rel=1e-3)


def test_without_the_option_actions_come_one_after_another(tmp_path: Path) -> None:
    values = two_gantries(tmp_path)
    del values["concurrent"]
    plan = lgp.plan(read_scene(values), cost=None, collisions=False, sequence=[*LEFT, *RIGHT])
    assert (plan.actions, plan.concurrent, plan.status) == (ALONE, {}, "given")


@pytest.mark.parametrize("change", [{"costs": {"total": 99.0}}, {"feasible": False, "reason": "no path"}])
def test_what_is_not_better_is_not_kept(both: lgp.Plan, change: dict[str, Any]) -> None:
    task = task_of(both.scene)
    skeleton = parse_sequence(task, [*LEFT, *RIGHT])
    alone = replace(both, actions=ALONE, time=2.0 * both.time, status="given", concurrent={})
    asked: list[Skeleton] = []

    def follow(actions: Skeleton) -> lgp.Plan:
        asked.append(actions)
        return replace(both, **change)

    plan = with_concurrent_actions(alone, skeleton, follow)
    assert (plan.actions, plan.status) == (ALONE, "given")
    said = plan.concurrent
    assert (said["kept"], said["tried"]) == (False, len(asked))
    assert said["reason"] == (
        "no path" if "reason" in change else f"it costs 99, not less than {both.costs['total']:.4g}"
    )
    # All at once, then the first action of the second robot alone; its next one is the last without it.
    phases = [[action.together for action in actions] for actions in asked]
    assert phases == [[False, True, False, True], [False, True, False, False]]


def test_what_time_leaves_no_room_for_is_dropped(both: lgp.Plan) -> None:
    skeleton = parse_sequence(task_of(both.scene), [*LEFT, *RIGHT])
    alone = replace(both, actions=ALONE, time=2.0 * both.time, status="given", concurrent={})

    def late(actions: Skeleton) -> lgp.Plan:
        raise TimeIsUp

    plan = with_concurrent_actions(alone, skeleton, late)
    assert plan.actions == ALONE
    assert plan.concurrent["reason"] == "the time limit was reached, allow more"
    assert (plan.concurrent["kept"], plan.concurrent["at_the_same_time"]) == (False, None)


def test_a_search_leaves_time_for_concurrent_actions(both: lgp.Plan) -> None:
    limit = Budget(seconds=10.0)
    left = with_time_left(limit, both.scene)
    assert (left.improving, left.seconds) == (pytest.approx(6.0), 10.0), "without a plan there is nothing else to do"
    assert with_time_left(limit, replace(both.scene, concurrent=False)) == limit
    task, bounds = task_of(both.scene), PathBounds(World(both.scene), collisions=False)
    alone = plan_within(bounds, task, parse_sequence(task, [*LEFT, *RIGHT]))
    bounds.forget_paths()
    assert at_the_same_time(bounds, task, alone, 0.0).concurrent["reason"].endswith("allow more")


def test_a_sequence_without_independent_actions_says_so(both: lgp.Plan) -> None:
    skeleton = parse_sequence(task_of(replace(both.scene, goal=("placed(box, table.b)",))), LEFT)
    plan = with_concurrent_actions(both, skeleton, pytest.fail)
    assert plan.concurrent["reason"] == "every action depends on the one before it"
    assert plan.concurrent["at_the_same_time"] is None


def test_hands_that_have_no_room_beside_each_other_take_turns(tmp_path: Path) -> None:
    """Both put their boxes beside each other on one small table: the second one waits until the first has left."""
    values = two_gantries(tmp_path, apart=0.6)
    values["tables"]["b"] = {"position": [1.0, 0.3], "size": [0.2, 0.2], "height": 0.8}
    values["goal"] = ["placed(box, table.b)", "placed(crate, table.b)", "free(left.hand)", "free(right.hand)"]
    plan = lgp.plan(read_scene(values), cost=None, sequence=[*LEFT, RIGHT[0], "place(right.hand, crate, table.b)"])
    assert plan.feasible
    said = plan.concurrent
    assert "cannot reach the place of" in said["reason"], "all at once does not go"
    assert "keep their distance" in said["reason"]
    # Both grasp at the same time, then one places after the other.
    assert (said["kept"], plan.phase_of) == (True, (0, 0, 1, 2))
    assert len(plan.audit["faults"]) == 0


def test_a_free_duration_is_one_of_each_phase(tmp_path: Path) -> None:
    scene = read_scene(two_gantries(tmp_path, durations="free"))
    plan = lgp.plan(scene, cost=None, collisions=False, sequence=[*LEFT, *RIGHT])
    assert plan.actions == TOGETHER
    assert len(plan.durations) == 2
    assert plan.durations != (2.0, 2.0)


def test_the_audit_finds_an_agent_in_two_actions_at_once(both: lgp.Plan) -> None:
    swapped = (*TOGETHER[:3], "place(2, left.hand, crate, table.d)")
    faults = [fault.what for fault in lgp.audit_plan(replace(both, actions=swapped)).faults]
    expected = (
        "place(2, left.hand, crate, table.d): left takes part in place(2, left.hand, box, table.b) at the same time"
    )
    assert expected in faults
    with pytest.raises(LgpError) as error:
        lgp.audit_plan(replace(both, actions=ALONE))
    says(error, "the plan has 2 phases, expected one for each number of its 4 actions; plan again")


def test_a_saved_plan_is_read_again_with_a_temporal_plan_beside_it(both: lgp.Plan, tmp_path: Path) -> None:
    both.save(tmp_path / "plan")
    loaded = lgp.Plan.load(tmp_path / "plan")
    assert (loaded.actions, loaded.concurrent, loaded.durations) == (both.actions, both.concurrent, both.durations)
    lines = (tmp_path / "plan" / "plan.txt").read_text().splitlines()
    assert lines[0].startswith("; lgp ")
    assert lines[2:] == [
        "0.000: (grasp left.hand box) [2.000]",
        "0.000: (grasp right.hand crate) [2.000]",
        "2.000: (place left.hand box table.b) [2.000]",
        "2.000: (place right.hand crate table.d) [2.000]",
    ]


def test_it_is_run_and_its_trajectories_are_written(both: lgp.Plan, tmp_path: Path) -> None:
    both.save(tmp_path / "plan")
    events: list[str] = []
    summary = lgp.run_plan(tmp_path / "plan", on_event=lambda event: events.append(f"{event.kind} {event.text}"))
    assert summary["state"] == "finished", summary["why"]
    assert tuple(summary["actions"]) == TOGETHER
    assert summary["replanned"] == 0
    assert sum(event.startswith("started") for event in events) == 2, "one motion for both robots"
    told = lgp.write_trajectories(both, tmp_path / "both.mcap")
    assert [row["label"] for row in told["actions"]] == [" and ".join(TOGETHER[:2]), " and ".join(TOGETHER[2:])]
    moved = both.trajectory("right")
    assert moved.time[-1] == 4.0


def test_a_disturbance_makes_a_new_plan(both: lgp.Plan, tmp_path: Path) -> None:
    planner = Planner(both, None)
    assert list(planner.step(0)) == list(planner.step(1)) == [0, 1]
    assert planner.planned(1).trajectory.knots.shape == (11, 8)
    again = lgp.replan(both, 2.5)
    assert [action.partition("(")[0] for action in again.actions] == ["place", "place"]
    assert again.phase_of == (0, 0), "what is left happens at the same time again"


def test_the_page_has_one_step_for_each_phase(both: lgp.Plan, tmp_path: Path) -> None:
    index = lgp.write_page(both, tmp_path / "page", pictures=False)
    text = index.read_text()
    assert "in 2 steps" in text
    assert "4 actions in 4 seconds" in text
    assert text.count('class="together"') == 2
    script = (index.parent / "assets" / "plan.js").read_text()
    data = json.loads(script.removeprefix("window.PLAN = ").rstrip().removesuffix(";"))
    assert data["phases"] == [0, 0, 1, 1]
    assert len(data["view"]["ends"]) == len(data["actions"]) == 2
    assert data["actions"][0]["text"] == (
        "The robot left picks up the box from the a table. "
        "At the same time, the robot right picks up the crate from the c table."
    )


def test_the_terminal_says_both_costs(both: lgp.Plan) -> None:
    text = io.StringIO()
    show_plan(Console(file=text, width=200), both.summary())
    assert re.search(
        r"concurrent actions: one at a time cost [\d.]+ in 8.0 s, at the same time [\d.]+ in 4.0 s\n", text.getvalue()
    )
    assert "; no other plan with concurrent actions was made" in text.getvalue()


def test_a_robot_fetches_the_next_part_while_the_person_screws(tmp_path: Path) -> None:
    scene = lgp.load_scene(ROOT / "examples" / "scenes" / "fetch_while_screwing.toml")
    screws = ["screw(human.right_hand, rail, clamp)", "screw(human.right_hand, block, cap)"]
    fetch = ["grasp(panda.hand, part)", "place(panda.hand, part, table.tray)", "grasp(human.right_hand, part)"]
    plan = lgp.plan(scene, sequence=[*screws, *fetch])
    assert plan.phase_of == (0, 0, 1, 1, 2)
    assert plan.audit["faults"] == []
    said = plan.concurrent
    assert said["kept"]
    assert said["at_the_same_time"]["seconds"] == 9.0 < said["one_at_a_time"]["seconds"] == 15.0
    assert said["at_the_same_time"]["cost"] < 0.95 * said["one_at_a_time"]["cost"]
    plan.save(tmp_path / "plan")
    text = lgp.write_page(lgp.Plan.load(tmp_path / "plan"), tmp_path / "page", pictures=False).read_text()
    assert "At the same time, the robot picks up the part from the stock table." in text
    summary = lgp.run_plan(tmp_path / "plan")
    assert summary["state"] == "finished", summary["why"]
    assert tuple(summary["actions"]) == plan.actions
