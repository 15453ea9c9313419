"""A scene of two people who hand a rod to each other, for tests of `lgp`."""

from __future__ import annotations

import copy
from typing import Any

from tests.support.paths import ROOT

DOMAIN = str(ROOT / "examples" / "scenes" / "hand_over.pddl")
TWO_PEOPLE: dict[str, Any] = {
    "domain": DOMAIN,
    "initial": ["on_table(rod)", "free(anna.right_hand)", "free(bert.left_hand)"],
    "goal": ["placed(rod, table.bert)", "free(bert.left_hand)"],
    "depth": 3,
    "humans": {
        "anna": {"stature": 1.62, "sex": "female", "hands": ["right_hand"], "locked": ["middle_cervical_*", "left_*"]},
        "bert": {
            "stature": 1.85,
            "position": [1.3, 0.0],
            "yaw": 180,
            "hands": ["left_hand"],
            "locked": ["middle_cervical_*", "right_*"],
        },
    },
    "tables": {
        "anna": {"position": [0.45, -0.60], "size": [0.40, 0.40], "height": 0.90},
        "bert": {"position": [0.85, 0.60], "size": [0.40, 0.40], "height": 1.00},
    },
    "objects": {"rod": {"size": [0.36, 0.06, 0.06], "mass": 1.5, "on": "table.anna", "slide": 0.14}},
}


def two_people(**changes: Any) -> dict[str, Any]:
    """Return the values of the scene with other values at the top."""
    return copy.deepcopy(TWO_PEOPLE) | changes
