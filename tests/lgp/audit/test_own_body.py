"""Bodies of a person against each other: arms against the trunk, and thighs that are as close as a person's are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lgp.audit.audit import audit_plan
from tests.support.gantry import made_plan, scene_values


def standing(folder: Path) -> dict[str, Any]:
    """Return the scene of the gantry with a person on the other side of the room."""
    human = {"stature": 1.75, "position": [0.0, 2.0], "hands": ["right_hand"], "joints": {"right_elbow_Z": 0}}
    return scene_values(folder, human=human)


@pytest.mark.parametrize(("degrees", "depths"), [(0.0, {}), (-30.0, {"abdomen": 0.1058, "trunk": 0.0721})])
@pytest.mark.parametrize("side", ["left", "right"])
def test_an_upper_arm_in_the_own_body(tmp_path: Path, side: str, degrees: float, depths: dict[str, float]) -> None:
    """Capsules of 5 and 14 cm; the shoulder is 22.6 cm from the middle, and the elbow 8.4 cm once it turned."""
    values = standing(tmp_path)
    path = np.full((10, 1), np.radians(degrees))
    plan = made_plan(values, ["release(1, gantry.hand, box)"], path, path[0], [f"human.{side}_shoulder_X"])
    own = {one.pair: one.depth for one in audit_plan(plan).contacts if one.pair_class == "person with itself"}
    arm = f"human.{side}_upper_arm"
    found = {next(name for name in pair if name != arm): depth for pair, depth in own.items() if arm in pair}
    assert found == {f"human.{name}": pytest.approx(depth, abs=2e-4) for name, depth in depths.items()}


def test_thighs_that_touch_are_no_fault(tmp_path: Path) -> None:
    """They are 7 mm from each other as the person stands, and in each other as the pelvis turns."""
    values = standing(tmp_path)
    turned = np.array([0.12, -0.10, 0.5, 0.16])
    path = np.tile(turned, (10, 1))
    joints = [f"human.pelvis_{name}" for name in ("y", "z", "yaw", "tilt")]
    plan = made_plan(values, ["release(1, gantry.hand, box)"], path, turned, joints)
    assert [one for one in audit_plan(plan).contacts if one.pair_class == "person with itself"] == []
