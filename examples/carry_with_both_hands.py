"""Two actions of your own for two hands: both palms are on a crate as one grasp, all the way until it is put down.

Their PDDL actions are in scenes/two_hands.pddl. On the command line the same file is

    lgp --extension carry_with_both_hands.py plan scenes/two_hands.toml -o plan
"""

from pathlib import Path

import numpy as np

import lgp
from lgp.kinematics import features


def second_palm(at):
    """Where the second palm belongs: at the grip of the first one, mirrored at the middle of the object."""
    grip = at.scene.objects[at.arguments["object"]].grip(at.scene.hands[at.arguments["hand"]].kind)
    mirrored = np.array(grip.at) * (1.0 - 2.0 * np.abs(grip.along))
    return features.relative_position(at["object"], at["second"]) - mirrored


def faces(role):
    """The palm in a role faces the middle of the object, within 30 degrees."""
    return lambda at: features.outside_cone(at[role], at["object"], 30.0)


FACING = tuple(
    lgp.ActionConstraint(f"the palm of the {role} hand faces the object", faces(role), unit="", along=False)
    for role in ("hand", "second")
)
lgp.register_action(
    "lift",
    lgp.ActionKind(
        ("hand", "object", "second"),
        attaches_to="hand",
        constraints=(lgp.ActionConstraint("the second palm is on the object", second_palm, equal=True), *FACING),
        sentences=lgp.Sentences(
            "{robot} lifts {object}{from} with both hands.", "Lift {object}{from} with both hands.",
            "lifts {object}", "lift {object}",
        ),
    ),
)  # fmt: skip
lgp.register_action(
    "put",
    lgp.ActionKind(
        ("hand", "object", "second", "table"),
        attaches_to="table",
        given_by="hand",
        verb="puts down",
        # All along the phase that this action ends, the object is carried.
        constraints=(
            lgp.ActionConstraint("the second palm stays on the object", second_palm, equal=True, along=True),
            lgp.ActionConstraint("the palm still faces the object", faces("second"), unit="", along=True),
        ),
        sentences=lgp.Sentences(
            "{robot} puts {object} on {table} with both hands.", "Put {object} on {table} with both hands.",
            "puts down {object}", "put down {object}",
        ),
    ),
)  # fmt: skip

if __name__ == "__main__":
    plan = lgp.plan(Path(__file__).parent / "scenes" / "two_hands.toml")
    assert plan.feasible, plan.reason
    print(*plan.actions, sep="\n")
    hands = lgp.Motion(plan).frames(["human.left_hand", "human.right_hand"])
    apart = np.linalg.norm(np.subtract(*(hand.position for hand in hands.values())), axis=1)
    half = len(plan.path) // 2
    print(f"carried, the palms are {apart[half:].min():.4f} to {apart[half:].max():.4f} m apart")
    print(f"REBA: mean {plan.summary()['reba']['mean']:.1f}")
    print("faults of the audit:", [fault["what"] for fault in plan.audit["faults"]])
