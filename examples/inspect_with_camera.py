"""An action of your own: a camera in a robot's hand looks at a part from a good distance, without touching it.

The action is a PDDL action (scenes/inspection.pddl) and the record below. On the command line the same file is

    lgp --extension inspect_with_camera.py plan scenes/inspection.toml -o plan
"""

from pathlib import Path

import lgp
from lgp.kinematics import features

CONE, NEAREST, FARTHEST = 12.0, 0.28, 0.36  # half angle [deg]; distances [m] at which the lens is sharp


def in_view(at):
    """The part is inside the cone around the camera's axis, z of the hand."""
    return features.outside_cone(at["hand"], at["object"], CONE)


def sharp(at):
    """Not nearer than `NEAREST` and not farther than `FARTHEST`: two values, each at most 0."""
    distance = features.distance(at["hand"], at["object"])
    return features.stack(-distance + NEAREST, distance - FARTHEST)


def from_above(at):
    """The camera looks down by 45 degrees at least: its axis and straight down differ by 45 degrees at most."""
    return features.tilt(at["hand"], 45.0)


lgp.register_action(
    "inspect",
    lgp.ActionKind(
        ("hand", "object"),  # of the arguments of the PDDL action, in their order
        constraints=(
            lgp.ActionConstraint("the part is in view", in_view, unit=""),
            lgp.ActionConstraint("the part is in focus", sharp),
            lgp.ActionConstraint("the camera looks down", from_above, unit=""),
        ),
        sentences=lgp.Sentences(
            robot="{robot}{arm} looks at {object}.",
            human="Look at {object} through the camera in your {hand}.",
            robot_short="inspects {object}",
            human_short="inspect {object}",
        ),
    ),
)

if __name__ == "__main__":
    plan = lgp.plan(Path(__file__).parent / "scenes" / "inspection.toml")
    assert plan.feasible, plan.reason
    print(*plan.actions, sep="\n")
    print("cost:", {name: round(value, 2) for name, value in plan.costs.items()})
    camera = lgp.Motion(plan).frames(["cart.hand"])["cart.hand"]
    for number, name in enumerate(["gear", "shaft"] if "gear" in plan.actions[0] else ["shaft", "gear"]):
        row = (number + 1) * len(plan.path) // 2
        away = lgp.Motion(plan).object_poses(name).position[row] - camera.position[row]
        print(f"{name}: seen from {(away @ away) ** 0.5:.2f} m")
    print("faults of the audit:", [fault["what"] for fault in plan.audit["faults"]])
