"""Plans made by hand, each with one fault whose depth and time are known."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.audit.audit import audit_plan
from lgp.audit.faults import Audit, Fault
from lgp.errors import LgpError
from lgp.plan_record import Plan
from tests.support.gantry import (
    BALL,
    BELOW,
    BOX,
    GRIP,
    HEIGHT,
    LIFTED,
    PUT,
    START,
    TABLES,
    TAKE,
    carried,
    made_plan,
    scene_values,
    through,
)
from tests.support.paths import ROOT
from tests.support.says import says

TAKEN = ["grasp(1, gantry.hand, box)"]


def only(audit: Audit, kind: str) -> Fault:
    """Return the one fault of a kind, and see that there is no other."""
    assert [fault.kind for fault in audit.faults] == [kind], audit.faults
    return audit.faults[0]


def test_a_clean_plan_is_clean(tmp_path: Path) -> None:
    audit = audit_plan(carried(tmp_path))
    assert audit.clean
    assert audit.faults == ()
    assert audit.contacts == ()
    assert audit.unaudited == ()
    assert audit.samples == 201
    assert audit.hands.value is None  # one hand
    # The box is carried 1 m in 4 slices of 0.2 s; between equal steps the interpolation has their speed.
    assert audit.speed.of == ("gantry.x",)
    assert audit.speed.value is not None
    assert 0.31 <= audit.speed.value <= 0.47


def test_the_plan_is_not_changed_and_the_audit_is_plain_data(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    before = plan.path.copy()
    summary = audit_plan(plan).summary()
    assert (plan.path == before).all()
    assert summary["deepest"] == []
    assert summary["hands"] is None
    assert summary["clean"] is True


@pytest.mark.parametrize("slice_", [2, 7])
def test_an_arm_in_a_table(tmp_path: Path, slice_: int) -> None:
    values = scene_values(tmp_path, tables=TABLES | {"c": {"position": [0, 1], "size": [1, 1], "height": 0.8}})
    path = through((0, 1, 1.2, 0), (0, 1, 1.2, 0), (0, 0, 1.2, 0), TAKE, each=(8, 1, 1))
    path[slice_, 2] = HEIGHT + BALL - 0.030  # the jaws hang below
    audit = audit_plan(made_plan(values, TAKEN, path, np.array([0, 1, 1.2, 0])))
    tool = next(one for one in audit.contacts if one.pair[0] == "gantry.tool")
    assert tool.pair_class == "robot/table"
    assert tool.pair[1] == "table.c"
    # As soon as the ball is as deep as the top is thick, it is clear sooner below than above.
    assert tool.depth == pytest.approx(0.030, abs=2e-4)
    assert tool.time == pytest.approx(0.2 * (slice_ + 1), abs=0.021)
    assert audit.faults[0].kind == "contact"


def test_an_object_through_the_edge_of_a_table(tmp_path: Path) -> None:
    edge = {"edge": {"position": [0.5, 0.0], "size": [0.1, 1.0], "height": HEIGHT + 0.24, "thickness": 0.1}}
    audit = audit_plan(carried(tmp_path, tables=TABLES | edge))
    box = next(one for one in audit.contacts if one.pair_class == "object/table")
    assert set(box.pair) == {"box", "table.edge"}
    # The bottom of the box passes 0.2 m above where it stood.
    assert box.depth == pytest.approx(0.04, abs=1e-6)
    assert 2.6 < box.time < 3.4


def test_the_part_of_the_table_that_it_is_put_on_is_a_body_too(tmp_path: Path) -> None:
    # Through the side of the top: lowered beside it, then pushed in.
    low = (0.6, 0.0, GRIP - 0.05, 0.0)
    path = np.concatenate([through(START, TAKE, each=(10,)), through(TAKE, LIFTED, (0.6, 0, GRIP + 0.2, 0), low, PUT,
                                                                     each=(3, 3, 2, 2))])  # fmt: skip
    values = scene_values(tmp_path, goal=["placed(box, table.b)"])
    plan = made_plan(values, [*TAKEN, "place(2, gantry.hand, box, table.b)"], path, np.array(START))
    box = next(one for one in audit_plan(plan).contacts if set(one.pair) == {"box", "table.b"})
    assert box.depth > 0.01


def test_the_window_of_a_switch_forgives_a_touch_only(tmp_path: Path) -> None:
    for dip, clean in ((0.002, True), (0.004, False)):
        plan = carried(tmp_path)
        path = plan.path.copy()
        path[-5:, 2] = GRIP  # it is at rest before, and 2 mm up until the window, so that only the dip is below
        path[-3:-1, 2] += 0.002, -dip  # two slices, 0.4 s, and one before it stands
        audit = audit_plan(replace(plan, path=path))
        boxes = [one for one in audit.contacts if set(one.pair) == {"box", "table.b"} and one.depth > 1e-9]
        assert (boxes == []) == clean
        assert all(one.depth == pytest.approx(dip, abs=5e-4) for one in boxes)


def test_a_joint_that_is_too_fast(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    late = replace(plan, time=plan.time / 4.0)  # 1 m in 0.2 s
    fault = only(audit_plan(late), "speed")
    assert fault.what.startswith("gantry.x moves at ")
    assert fault.what.endswith("of 4 m/s")
    assert fault.amount > 1.25
    assert 0.6 < fault.time < 0.9


def test_a_joint_beyond_its_limits(tmp_path: Path) -> None:
    plan = carried(tmp_path, over=(1.0, 0.0, 3.02, 0.0))
    kinds = {fault.kind for fault in audit_plan(plan).faults}
    assert "limit" in kinds
    fault = next(fault for fault in audit_plan(plan).faults if fault.kind == "limit")
    assert fault.amount == pytest.approx(0.02, abs=2e-4)  # a little more between slices
    assert "gantry.z is at 3.02 m" in fault.what


@pytest.mark.parametrize(
    "goal", ["grasped(gantry.hand, box)", "placed(box, table.a)", "on_table(box)", "free(gantry.hand)"]
)
def test_a_goal_that_does_not_hold(tmp_path: Path, goal: str) -> None:
    plan = carried(tmp_path)
    held = replace(plan, actions=plan.actions[:1], phase=plan.phase[:10], path=plan.path[:10], time=plan.time[:10])
    one = plan if goal.startswith(("grasped", "placed")) else held
    changed = replace(one, scene=replace(one.scene, goal=(goal,)))
    fault = only(audit_plan(changed), "goal")
    assert fault.what == f"the goal {goal} does not hold"
    assert fault.time == one.time[-1]


def test_an_object_tilted_on_a_table(tmp_path: Path) -> None:
    angle = np.radians(5.0)
    # The lower edge of the box still meets the top: it is 0.03 sin + 0.04 cos below the middle.
    lowest = 0.03 * np.sin(angle) + 0.04 * np.cos(angle)
    put = (1.0, -BELOW * np.sin(angle), HEIGHT + lowest + BELOW * np.cos(angle), angle)
    audit = audit_plan(carried(tmp_path, put=put))
    fault = only(audit, "attachment")
    assert "box is put down tilted by 5.0 deg" in fault.what
    assert fault.amount == pytest.approx(5.0)
    assert fault.time == pytest.approx(4.0)


@pytest.mark.parametrize(("dip", "word"), [(0.002, "low"), (-0.002, "high"), (-0.02, "high")])
def test_an_object_put_down_too_high_or_low(tmp_path: Path, dip: float, word: str) -> None:
    audit = audit_plan(carried(tmp_path, put=(1.0, 0.0, GRIP - dip, 0.0)))
    fault = only(audit, "attachment")
    assert f"{abs(1000 * dip):.1f} mm too {word} on table.b" in fault.what
    assert fault.amount == pytest.approx(abs(dip))


def test_an_object_with_its_middle_beside_the_top(tmp_path: Path) -> None:
    audit = audit_plan(carried(tmp_path, put=(1.21, 0.0, GRIP, 0.0), over=(1.21, 0.0, GRIP + 0.2, 0.0)))
    assert {fault.kind for fault in audit.faults} == {"resting"}
    assert audit.faults[0].what == "box on table.b has its middle 10.0 mm beside the top"
    assert audit.faults[1].what == "box on table.b has 40 % of its footprint on the top"


def test_an_object_on_a_corner(tmp_path: Path) -> None:
    put, over = (1.19, 0.19, GRIP, 0.0), (1.19, 0.19, GRIP + 0.2, 0.0)
    fault = only(audit_plan(carried(tmp_path, put=put, over=over)), "resting")
    assert fault.amount == pytest.approx(0.6 * (0.03 + 0.01) / 0.06)  # the middle is on, 40 % are


def test_a_hand_beside_the_grip_that_it_takes(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    plan.path[:10, 1] += np.linspace(0.0, 0.005, 10)
    fault = next(fault for fault in audit_plan(plan).faults if fault.kind == "attachment")
    assert "gantry.hand is 5.0 mm beside the grip of box" in fault.what
    assert fault.time == pytest.approx(2.0)


def test_a_hand_that_is_tilted_or_turned_from_the_grip(tmp_path: Path) -> None:
    values = scene_values(tmp_path)
    values["robots"]["gantry"]["hands"]["hand"] |= {"tilt": 10, "freedom": "axis"}
    angle = np.radians(20.0)
    take = (0.0, -BELOW * np.sin(angle), HEIGHT + 0.04 + BELOW * np.cos(angle), angle)
    plan = made_plan(values, TAKEN, through(START, take, each=(10,)), np.array(START))
    texts = [fault.what for fault in audit_plan(plan).faults if fault.kind == "attachment"]
    assert texts == [
        "grasp(1, gantry.hand, box): gantry.hand is turned 20.0 deg from the grip of box",
        "grasp(1, gantry.hand, box): gantry.hand is tilted 10.0 deg too far",
    ]


def test_actions_that_contradict_who_has_what(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    placed = replace(plan, actions=("release(1, gantry.hand, box)", plan.actions[1]))
    assert any(
        "place(2, gantry.hand, box, table.b): table.a has box" in fault.what for fault in audit_plan(placed).faults
    )


def test_an_unknown_action_is_a_fault(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    audit = audit_plan(replace(plan, actions=(plan.actions[0], "weld(2, gantry.hand, box)")))
    assert "weld(2, gantry.hand, box): an action that the audit does not know" in audit.faults[0].what
    assert audit.faults[0].kind == "unknown"


def test_what_it_cannot_look_at_is_named(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    scene = replace(plan.scene, goal=("painted(box)", "placed(box, table.b)"))
    audit = audit_plan(replace(plan, scene=scene))
    assert audit.unaudited == ("painted(box) of the goal: it has no meaning in space that the audit knows",)


def test_plans_that_are_no_whole_ones_are_refused(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    with pytest.raises(LgpError) as caught:
        audit_plan(replace(plan, phase=np.zeros(20, np.intp)))
    says(caught.value, "1 phases", "2 actions")
    with pytest.raises(LgpError) as caught:
        audit_plan(replace(plan, time=plan.time[::-1]))
    says(caught.value, "does not increase")
    with pytest.raises(LgpError) as caught:
        audit_plan(replace(plan, actions=(plan.actions[0], "place(2, gantry.hand, box, table.z)")))
    says(caught.value, "table.z")
    with pytest.raises(LgpError) as caught:
        audit_plan(replace(plan, path=np.where(plan.path > 0.9, np.nan, plan.path)))
    says(caught.value, "not finite")
    with pytest.raises(LgpError) as caught:
        audit_plan(replace(plan, joints=(*plan.joints[:3], "crane.tilt")))
    says(caught.value, "crane.tilt")


@pytest.mark.parametrize("seed", range(12))
def test_a_shift_of_a_clean_path_is_found_where_it_is(tmp_path: Path, seed: int) -> None:
    """The ball slides 1 cm above a long table; one slice is shifted down by some centimetres."""
    rng = np.random.default_rng(seed)
    table = {"long": {"position": [0.5, 1.0], "size": [3.0, 0.5], "height": 0.9}}
    top = 0.9 + BELOW + 0.03 + 0.01  # the jaws reach 3 cm below the grip point
    values = scene_values(tmp_path, tables=TABLES | table)
    path = through((-0.9, 1.0, top, 0), (1.9, 1.0, top, 0), (1.9, 0.0, top, 0), TAKE, each=(20, 5, 5))
    actions = ["release(1, gantry.hand, box)", "release(2, gantry.hand, box)", "grasp(3, gantry.hand, box)"]
    plan = made_plan(values, actions, path, np.array([-0.9, 1.0, top, 0]))
    assert audit_plan(plan).clean
    at, shift = int(rng.integers(1, 18)), float(rng.uniform(0.015, 0.03))
    path = path.copy()
    path[at, 2] -= shift
    audit = audit_plan(replace(plan, path=path))
    contact = audit.contacts[0]
    assert contact.pair_class == "robot/table"
    assert contact.pair[1] == "table.long"
    assert contact.depth == pytest.approx(shift - 0.01, abs=1e-5)
    assert contact.time == pytest.approx(plan.time[at], abs=1e-9)


def test_two_objects_in_one_place(tmp_path: Path) -> None:
    objects = {"box": BOX, "other": {**BOX, "at": [0.08, 0.0, 0.0]}}
    audit = audit_plan(carried(tmp_path, objects=objects))
    pair = next(one for one in audit.contacts if one.pair_class == "object/object")
    assert pair.depth == pytest.approx(0.02, abs=1e-6)
    assert pair.time == 0.0


def test_the_start_alone_is_looked_at_without_actions(tmp_path: Path) -> None:
    values = scene_values(tmp_path, goal=["placed(box, table.a)"])
    plan = made_plan(values, [], np.zeros((0, 4)), np.array([0.0, 0.0, HEIGHT + BALL - 0.01, 0.0]))
    audit = audit_plan(plan)
    assert audit.samples == 1
    assert audit.speed.value is None
    assert next(one for one in audit.contacts if one.pair == ("gantry.tool", "box")).time == 0.0


def test_it_imports_nothing_that_plans() -> None:
    forbidden = ("lgp.collision", "lgp.path", "lgp.sqp", "lgp.search", "lgp.planner",
                 "lgp.kinematics.modes", "lgp.kinematics.attachments", "lgp.kinematics.world")  # fmt: skip
    for file in sorted((ROOT / "lgp" / "audit").glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert not (node.module or "").startswith(forbidden), f"{file.name} imports {node.module}"


def test_a_plan_is_saved_with_its_audit_and_older_ones_load(tmp_path: Path) -> None:
    plan = carried(tmp_path)
    plan = replace(plan, audit=audit_plan(plan).summary(), costs={}, residuals={})
    plan.save(tmp_path / "plan")
    again = Plan.load(tmp_path / "plan")
    assert again.audit == plan.audit
    assert again.summary()["audit"]["samples"] == 201
    assert audit_plan(again).summary() == plan.audit
    file = tmp_path / "plan" / "plan.json"
    text = file.read_text()
    file.write_text(text.replace('"audit"', '"audited"'))
    assert Plan.load(tmp_path / "plan").audit == {}
    assert lgp.audit_plan(Plan.load(tmp_path / "plan")).clean
