"""Two actions of your own that hold along the way: a full jug is carried upright, then tilted above a cup.

Their PDDL actions are in scenes/pouring.pddl. On the command line the same file is

    lgp --extension pour.py plan scenes/pouring.toml -o plan
"""

from pathlib import Path

import numpy as np

import lgp
from lgp.kinematics import features

UP = np.array([0.0, 0.0, 1.0])
BESIDE = 0.02  # [m] Spout from the middle of the cup, to each side.
LOWEST, HIGHEST = 0.03, 0.26  # [m] Spout above the rim: an upright jug needs its own height.


def upright(at):
    """The jug is tilted by 8 degrees at most to each side: the level parts of its axis are small, and it points up."""
    axis, most = features.axis(at["object"], 2), np.sin(np.radians(8.0))
    return features.stack(axis[[0, 1]] - most, -axis[[0, 1]] - most, -axis[[2]])


def spout_over_cup(at):
    """The spout is above the opening of the cup: six values, each at most 0."""
    jug, cup = (at.scene.objects[at.arguments[role]].size for role in ("object", "other"))
    spout = features.offset(at["object"], (0.0, jug[1] / 2, jug[2] / 2))
    rim = features.offset(at["other"], (0.0, 0.0, cup[2] / 2))
    away = features.difference(spout, rim)
    least, most = np.array([-BESIDE, -BESIDE, LOWEST]), np.array([BESIDE, BESIDE, HIGHEST])
    return features.stack(away - most, -away + least)


def tilted(at):
    """The side of the spout is 70 degrees or more below level: the jug runs empty."""
    return features.along(at["object"], 1, UP) + np.sin(np.radians(70.0))


ROLES = ("hand", "object", "other")
OVER = lgp.ActionConstraint("the spout is above the cup", spout_over_cup)
ALL_THE_WAY = lgp.ActionConstraint("the spout stays above the cup", spout_over_cup, along=True)
lgp.register_action(
    "bring",
    lgp.ActionKind(
        ROLES,
        constraints=(OVER, lgp.ActionConstraint("the jug stays upright", upright, unit="", along=True)),
        sentences=lgp.Sentences(
            "{robot}{arm} brings {object} to {other}.", "Bring {object} to {other} with your {hand}.",
            "brings {object}", "bring {object}",
        ),
    ),
)  # fmt: skip
lgp.register_action(
    "pour",
    lgp.ActionKind(
        ROLES,
        constraints=(ALL_THE_WAY, lgp.ActionConstraint("the jug is tilted", tilted, unit="")),
        sentences=lgp.Sentences(
            "{robot}{arm} pours {object} into {other}.", "Pour {object} into {other} with your {hand}.",
            "pours {object}", "pour {object}",
        ),
    ),
)  # fmt: skip

if __name__ == "__main__":
    plan = lgp.plan(Path(__file__).parent / "scenes" / "pouring.toml")
    assert plan.feasible, plan.reason
    print(*plan.actions, sep="\n")
    tilt = np.degrees(np.arccos(lgp.Motion(plan).object_poses("jug").rotation[:, 2, 2].clip(-1, 1)))
    each = len(plan.path) // 4
    for number, action in enumerate(plan.actions):
        print(f"{action}: tilt up to {tilt[number * each + 1 : (number + 1) * each + 1].max():.0f} degrees")
    print("faults of the audit:", [fault["what"] for fault in plan.audit["faults"]])
