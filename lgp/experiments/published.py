"""Published results of both experiments: Tables II and III and heights (screwdriver), action sequences (toolbox).

Source: Busch, Toussaint & Lopes, Planning Ergonomic Sequences of Actions in Human-Robot Interaction, ICRA 2018,
section III. Figures 5 to 7 print no numbers; only the order of their means is used.
"""

from __future__ import annotations

from typing import Final

SOURCE: Final = (
    "Busch, Toussaint & Lopes, Planning Ergonomic Sequences of Actions in Human-Robot Interaction, ICRA 2018, "
    "section III"
)
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
"""Initial posture -> condition -> table -> share of 100 runs that chose it [%]: Table II (rest), III (random)."""
RUNS: Final = 100
"""Runs of the paper from each initial posture."""
TABLE_NUMBER: Final = {"rest": "Table II", "random": "Table III"}
"""Initial posture -> table of the paper with its choices."""
CHOSEN_HEIGHT: Final[dict[str, dict[str, tuple[float, float]]]] = {
    "rest": {"non-ergonomic": (1.08, 0.22), "ergonomic": (0.95, 0.15)},
    "random": {"non-ergonomic": (1.02, 0.20)},
}
"""Initial posture -> condition -> mean and standard deviation of the chosen table's height [m]."""
DRAWN_HEIGHT: Final = (1.10, 0.30)
"""Mean and standard deviation of the drawn heights of all three tables [m]."""
EXPECTED_ORDER: Final = ("ergonomic", "re-optimized", "non-ergonomic")
"""Conditions by their mean REBA score at the grasp, lowest first, from both initial postures (Figs. 5 and 6)."""
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
"""Condition -> action sequence of the toolbox experiment. Of the ergonomic sequence the paper prints the first four
actions and states that the rest is equal. The last action names the parts in another order than the goal and the
operator of the paper, by which it is `screw(8, human.right_hand, toolbox/handle, toolbox/side.left)`."""
