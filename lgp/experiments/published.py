"""What the paper reports of its experiments: the screwdriver's Tables II and III and heights, the toolbox's sequences.

Source: Busch, Toussaint & Lopes, Planning Ergonomic Sequences of Actions in Human-Robot Interaction, ICRA 2018,
section III. Figures 5 to 7 print no numbers, so none are given here.
"""

from __future__ import annotations

from typing import Final

SOURCE: Final = (
    "Busch, Toussaint & Lopes, Planning Ergonomic Sequences of Actions in Human-Robot Interaction, ICRA 2018, "
    "section III"
)
RUNS: Final = 100
"""Runs behind every percentage."""
CHOICE_PERCENT: Final[dict[str, dict[str, dict[str, int]]]] = {
    "rest": {
        "non-ergonomic": {"left": 89, "center": 7, "right": 4},
        "ergonomic": {"left": 26, "center": 40, "right": 34},
    },
    "random": {
        "non-ergonomic": {"left": 66, "center": 23, "right": 11},
        "ergonomic": {"left": 26, "center": 40, "right": 34},
    },
}
"""Start -> condition -> table -> share of runs that chose it [%]: Table II (rest), Table III (random)."""
TABLE_NUMBER: Final = {"rest": "Table II", "random": "Table III"}
"""Where the choices of a start are printed."""
CHOSEN_HEIGHT: Final[dict[str, dict[str, tuple[float, float]]]] = {
    "rest": {"non-ergonomic": (1.08, 0.22), "ergonomic": (0.95, 0.15)},
    "random": {"non-ergonomic": (1.02, 0.20)},
}
"""Start -> condition -> mean and standard deviation of the chosen table's height [m]."""
DRAWN_HEIGHT: Final = (1.10, 0.30)
"""Mean and standard deviation of the heights of all three tables [m]."""
EXPECTED_ORDER: Final = ("ergonomic", "re-optimized", "non-ergonomic")
"""Conditions by their mean REBA score at the grasp, lowest first, with both starts (Figs. 5 and 6)."""
TOOLBOX_SOURCE: Final = (
    "Busch, Toussaint & Lopes, Planning Ergonomic Sequences of Actions in Human-Robot Interaction, ICRA 2018, "
    "section IV, with its names baxterL, baxterR, handR and tableC written as they are called here"
)
TOOLBOX_SEQUENCES: Final[dict[str, tuple[str, ...]]] = {
    "non-ergonomic": (
        "grasp(1, baxter.left, toolbox/handle)",
        "handover(2, baxter.left, toolbox/handle, human.right_hand)",
        "grasp(3, baxter.left, toolbox/side.left)",
        "place(4, human.right_hand, toolbox/handle, table.center)",
        "handover(5, baxter.left, toolbox/side.left, human.right_hand)",
        "place(6, human.right_hand, toolbox/side.left, table.center)",
        "hold(7, baxter.right, toolbox/handle)",
        "screw(8, human.right_hand, toolbox/side.left, toolbox/handle)",
    ),
    "ergonomic": (
        "grasp(1, baxter.left, toolbox/handle)",
        "handover(2, baxter.left, toolbox/handle, human.right_hand)",
        "place(3, human.right_hand, toolbox/handle, table.center)",
        "grasp(4, baxter.left, toolbox/side.left)",
        "handover(5, baxter.left, toolbox/side.left, human.right_hand)",
        "place(6, human.right_hand, toolbox/side.left, table.center)",
        "hold(7, baxter.right, toolbox/handle)",
        "screw(8, human.right_hand, toolbox/side.left, toolbox/handle)",
    ),
}
"""Condition -> sequence of the toolbox experiment. Of the ergonomic one the paper prints the first four actions and
says that the rest is alike. Its last line names the parts in another order than its goal and its operator do, which
hold and screw the first part: `screw(8, human.right_hand, toolbox/handle, toolbox/side.left)` is meant."""
