"""Two gantry robots, each with a box and tables of its own, that have nothing to do with each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.support.gantry import BOX, HEIGHT, scene_values

LEFT = ("grasp(left.hand, box)", "place(left.hand, box, table.b)")
RIGHT = ("grasp(right.hand, crate)", "place(right.hand, crate, table.d)")


def two_gantries(folder: Path, apart: float = 1.5, **changes: Any) -> dict[str, Any]:
    """Return a scene of two gantries in one place, whose tables are so far apart [m] in y; a second costs 5."""
    values = scene_values(folder)
    gantry = values["robots"]["gantry"]
    side = {"size": [0.4, 0.4], "height": HEIGHT}
    return (
        values
        | {
            "initial": ["on_table(box)", "on_table(crate)", "free(left.hand)", "free(right.hand)"],
            "goal": ["placed(box, table.b)", "placed(crate, table.d)"],
            "cost": {"time_weight": 5.0},
            "concurrent": True,
            "robots": {
                "left": gantry | {"joints": {"z": 1.3}},
                "right": gantry | {"position": [0.0, apart, 0.0], "joints": {"z": 1.3}},
            },
            "tables": {
                "a": side | {"position": [0.0, 0.0]},
                "b": side | {"position": [1.0, 0.0]},
                "c": side | {"position": [0.0, apart]},
                "d": side | {"position": [1.0, apart]},
            },
            "objects": {"box": BOX, "crate": BOX | {"on": "table.c"}},
        }
        | changes
    )
