"""Hands that have let go and are still there when another one comes, or moves off: plans made by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lgp.audit.audit import audit_plan
from lgp.audit.faults import Fault
from lgp.plan_record import Plan
from tests.support.gantry import BOX, GRIP, SLICES, TABLES, made_plan, scene_values, through

Array = NDArray[np.float64]
ROD = {
    **BOX,
    "size": [0.60, 0.06, 0.08],
    "slide": 0.25,
    "grips": {"robot_hand": {"at": [0.0, 0.0, 0.0], "slide": 0.25}},
}
JOINTS = tuple(f"{robot}.{joint}" for robot in ("left", "right") for joint in ("x", "y", "z", "tilt"))
"""Two gantries at one place; the left one takes a rod at x = -0.2, the right one at x = 0.2."""
UP = GRIP + 0.3


def two(folder: Path, **changes: Any) -> dict[str, Any]:
    values = scene_values(folder, objects={"box": ROD}, **changes)
    gantry = values["robots"]["gantry"]
    values["robots"] = {"left": gantry, "right": gantry}
    values["initial"] = ["on_table(box)", "free(left.hand)", "free(right.hand)"]
    values["tables"] = {**TABLES, "a": {**TABLES["a"], "size": [0.7, 0.4]}}
    return values


def side_by_side(left: Array, right: Array) -> Array:
    return np.concatenate([left, right], axis=1)


def stays(place: tuple[float, ...], slices: int) -> Array:
    return np.tile(place, (slices, 1)).astype(float)


def of_kind(plan: Plan, kind: str) -> list[Fault]:
    return [fault for fault in audit_plan(plan).faults if fault.kind == kind]


@pytest.mark.parametrize(("waits", "faults"), [(1, 1), (2, 1), (3, 0)])
def test_a_giver_is_away_before_the_taker_moves_off(tmp_path: Path, waits: int, faults: int) -> None:
    """The giver rises by 4 cm a slice from the middle of a rod 8 cm high: it is 8 cm above it after three slices."""
    take, meet, beside = (-0.2, 0.0, GRIP, 0.0), (-0.2, 0.0, UP, 0.0), (0.2, 0.0, UP, 0.0)
    left = np.concatenate([through((-0.2, 0.0, UP, 0.0), take, meet, each=(SLICES, SLICES)),
                           through(meet, (-0.2, 0.0, UP + 0.4, 0.0), each=(SLICES,))])  # fmt: skip
    off = [stays(beside, waits), through(beside, (0.2, 1.0, UP, 0.0), each=(SLICES - waits,))]
    right = np.concatenate([stays((0.2, 0.0, UP + 0.3, 0.0), SLICES),
                            through((0.2, 0.0, UP + 0.3, 0.0), beside, each=(SLICES,)), *off])  # fmt: skip
    actions = ["grasp(1, left.hand, box)", "handover(2, left.hand, box, right.hand)", "release(3, right.hand, box)"]
    start = np.array([-0.2, 0.0, UP, 0.0, 0.2, 0.0, UP + 0.3, 0.0])
    values = two(tmp_path, goal=["grasped(right.hand, box)"])
    found = of_kind(made_plan(values, actions, side_by_side(left, right), start, JOINTS), "withdrawal")
    assert len(found) == faults
    for fault in found:
        assert fault.what.startswith("right.hand moves off with box while left.hand is ")
        assert 4.0 < fault.time < 4.0 + 0.2 * (waits + 1)
        assert fault.amount == pytest.approx(max(0.2 * (fault.time - 4.0), 0.04) - 0.04, abs=5e-3)


@pytest.mark.parametrize(("later", "faults"), [(0, 1), (1, 1), (3, 0)])
def test_who_put_a_thing_down_is_away_before_another_hand_comes(tmp_path: Path, later: int, faults: int) -> None:
    """The other hand comes down some slices after the rod is put: 30 cm above it at first, 20 cm after two slices."""
    take, over = (-0.2, 0.0, GRIP, 0.0), (-0.2, 0.0, UP, 0.0)
    left = np.concatenate([through(over, take, over, each=(SLICES, 5)), through(over, take, each=(5,)),
                           through(take, (-0.2, 0.0, GRIP + 0.2, 0.0), each=(5,)),
                           stays((-0.2, 0.0, GRIP + 0.2, 0.0), 5)])  # fmt: skip
    high, down = (0.2, 0.0, GRIP + 0.29, 0.0), (0.2, 0.0, GRIP, 0.0)
    waits = [stays(high, later)] if later else []
    right = np.concatenate([stays(high, 2 * SLICES), *waits, through(high, down, each=(3,)),
                            stays(down, SLICES - 3 - later)])  # fmt: skip
    actions = ["grasp(1, left.hand, box)", "place(2, left.hand, box, table.a)", "grasp(3, right.hand, box)"]
    start = np.array([*over, *high])
    values = two(tmp_path, goal=["grasped(right.hand, box)"])
    found = of_kind(made_plan(values, actions, side_by_side(left, right), start, JOINTS), "withdrawal")
    assert len(found) == faults
    for fault in found:
        assert fault.what.startswith("right.hand is ")
        assert "from box while left.hand, which put it down, is not yet 6 cm away" in fault.what
        assert fault.amount < 0.2
