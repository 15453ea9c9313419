"""The gantry with a tray on its bridge, which slides along x: what stands on the tray goes where the bridge goes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lgp.plan_record import Plan
from tests.support.gantry import GRIP, HEIGHT, START, TABLES, TAKE, made_plan, scene_values, through

TRAY = {"frame": "gantry.bridge", "position": [0.0, 1.0], "size": [0.3, 0.4], "height": HEIGHT, "yaw": 90}
ABOARD = (0.0, 1.0, GRIP, 0.0)
"""The grip point in the middle of the box on the tray, with the bridge at 0."""
DRIVEN = 0.7
"""[m] How far the bridge goes with the box on it."""


def tray_values(folder: Path, **changes: Any) -> dict[str, Any]:
    """Return the scene of the gantry with the tray; changes replace whole tables of it."""
    return scene_values(folder, **({"tables": {**TABLES, "tray": TRAY}} | changes))


def aboard_and_back(folder: Path, again: float = DRIVEN, **changes: Any) -> Plan:
    """Return a plan that puts the box on the tray, drives on, and takes it from there at x = `again` [m]."""
    values = tray_values(folder, **changes)
    over, away = (0.0, 0.0, GRIP + 0.2, 0.0), (DRIVEN, 1.0, GRIP + 0.2, 0.0)
    path = [
        through(START, TAKE, each=(10,)),
        through(TAKE, over, (*ABOARD[:2], GRIP + 0.2, 0.0), ABOARD, each=(3, 4, 3)),
        through(ABOARD, (*ABOARD[:2], GRIP + 0.2, 0.0), away, (again, 1.0, GRIP, 0.0), each=(3, 4, 3)),
    ]
    actions = ["grasp(1, gantry.hand, box)", "place(2, gantry.hand, box, table.tray)", "grasp(3, gantry.hand, box)"]
    return made_plan(values, actions, np.concatenate(path), np.array(START))
