"""A scene that is mirrored, turned, listed in another order or planned by another route has the same optimum."""

from __future__ import annotations

import copy
from functools import cache
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.plan_record import Plan
from lgp.scene.scene_file import read_scene

pytestmark = pytest.mark.slow
SAME = {False: 1e-4, True: 1e-3}
"""Share by which costs agree, without collisions and with: at edges of distances the solver stops a little earlier or
later."""
SCENE: dict[str, Any] = {
    "domain": "screwdriver",
    "initial": ["on_table(box)", "on_table(can)", "free(human.right_hand)", "free(human.left_hand)"],
    "goal": ["placed(box, table.far)"],
    "depth": 2,
    "human": {"hands": ["left_hand", "right_hand"], "position": [0.1, -0.3], "yaw": 40.0},
    "tables": {
        "near": {"position": [0.5, 0.1], "yaw": 20.0, "size": [0.6, 0.4], "height": 0.8},
        "far": {"position": [0.2, 0.5], "yaw": 95.0, "size": [0.4, 0.5], "height": 1.1},
    },
    "objects": {
        "box": {"size": [0.3, 0.1, 0.2], "mass": 2.0, "on": "table.near", "at": [0.05, -0.1, 30.0], "slide": 0.1},
        "can": {"size": [0.1, 0.1, 0.2], "mass": 0.5, "on": "table.near", "at": [-0.15, 0.1, 0.0]},
    },
}
TURN = 137.0
"""[deg]"""


@cache
def _plan(which: str, collisions: bool = False) -> Plan:
    return lgp.plan(read_scene(SCENES[which](copy.deepcopy(SCENE))), collisions=collisions)


def _as_it_is(values: dict[str, Any]) -> dict[str, Any]:
    return values


def _mirrored(values: dict[str, Any]) -> dict[str, Any]:
    """The other side of the plane through x and z: left is right."""
    for body in (values["human"], *values["tables"].values()):
        x, y = body["position"]
        body["position"], body["yaw"] = [x, -y], -body["yaw"]
    for thing in values["objects"].values():
        x, y, yaw = thing["at"]
        thing["at"] = [x, -y, -yaw]
    return values


def _turned(values: dict[str, Any]) -> dict[str, Any]:
    """About the vertical."""
    cosine, sine = np.cos(np.radians(TURN)), np.sin(np.radians(TURN))
    for body in (values["human"], *values["tables"].values()):
        x, y = body["position"]
        body["position"], body["yaw"] = [cosine * x - sine * y, sine * x + cosine * y], body["yaw"] + TURN
    return values


def _reordered(values: dict[str, Any]) -> dict[str, Any]:
    for key in ("tables", "objects"):
        values[key] = dict(reversed(values[key].items()))
    values["initial"] = values["initial"][::-1]
    values["human"]["hands"] = values["human"]["hands"][::-1]
    return values


SCENES = {"as it is": _as_it_is, "mirrored": _mirrored, "turned": _turned, "in another order": _reordered}


def _other_side(action: str) -> str:
    return action.replace("left_hand", "?").replace("right_hand", "left_hand").replace("?", "right_hand")


@pytest.mark.parametrize("collisions", [False, True])
@pytest.mark.parametrize("change", [name for name in SCENES if name != "as it is"])
def test_the_same_scene_has_the_same_plan(change: str, collisions: bool) -> None:
    first, other = _plan("as it is", collisions), _plan(change, collisions)
    expected = tuple(map(_other_side, first.actions)) if change == "mirrored" else first.actions
    assert other.actions == expected
    assert other.status == first.status == "optimal"
    assert other.costs["total"] == pytest.approx(first.costs["total"], rel=SAME[collisions])


def test_given_or_searched_the_motion_is_the_same() -> None:
    searched = _plan("as it is")
    given = lgp.plan(read_scene(SCENE), sequence=searched.actions, collisions=False)
    assert given.costs["total"] == pytest.approx(searched.costs["total"], rel=SAME[False])


def test_a_plan_says_how_many_starts_agree() -> None:
    starts = _plan("as it is").starts
    assert 1 <= starts["agreed"] <= starts["of"]
