"""Bodies of one agent that are never checked against each other, because they are joined.

Bodies with no third one between them in the tree of joints are joined: they meet at their joint. Of a person they are
only where they touch or nearly do as it stands, as thighs; an upper arm and the trunk do not. Bodies of one limb of
the person are joined as well, as the table of the human body says, and the jaws of one hand, which close as far as the
audit takes them. And so are bodies of a robot that are in each other in `DRAWN` of all positions of the joints between
them: what its URDF draws there is no measure of distance (collision checkers leave such pairs out for the same reason,
the MoveIt setup assistant those that always meet).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import combinations
from typing import Final

import numpy as np

from lgp.audit.agents import AgentModel
from lgp.audit.joint_tree import attached, place, values_of
from lgp.audit.penetration import boxes_meet, clearance, penetration
from lgp.audit.robot_file import RobotFile
from lgp.audit.shapes import Body
from reba.arrays import Array

DRAWN: Final = 0.5
"""Share of the positions of the joints between in which bodies of a robot meet that are drawn into each other."""
STANDING: Final = 0.02
"""[m] Distance below which bodies of a person that stands touch as it moves: thighs are 7 mm from each other."""
POSITIONS: Final = 50
"""Random positions of the joints that decide it."""
FEW: Final = 3
"""Most joints between such bodies."""


def neighbours(model: AgentModel, bodies: Sequence[Body], jaws: set[str]) -> set[tuple[int, int]]:
    """Return pairs of numbers of bodies of one agent that are joined; `jaws` are the joints that move its jaws."""
    carrying = {body.joint for body in bodies}
    chains = [model.chain(body.joint) for body in bodies]
    closing = {n for n, joint in enumerate(model.joints, 1) if {joint.name, (joint.follows or ("",))[0]} & jaws}
    jaw = [bool(closing & set(chain)) for chain in chains]
    joined = set() if model.file is None else set(drawn_into_each_other(model.file))
    for one, other in combinations(range(len(bodies)), 2):
        between = set(_between(chains[one], chains[other])) & carrying
        same_limb = bodies[one].limb == bodies[other].limb != ""
        same_jaws = jaw[one] and jaw[other] and bool(bodies[one].hands & bodies[other].hands)
        next_to = not between - {bodies[one].joint, bodies[other].joint}
        if same_limb or same_jaws or (next_to and (model.file is not None or _meet_standing(model, one, other))):
            joined.add((one, other))
    return joined


def _meet_standing(model: AgentModel, one: int, other: int) -> bool:
    """Return whether two bodies of a person are as good as in each other where all joints are at 0."""
    frames = place(model.joints, np.eye(3), np.zeros(3), {joint.name: np.zeros(1) for joint in model.joints}, 1)
    (first, second), poses = zip(*(model.parts[number] for number in (one, other)), strict=True)
    rotation, position = attached(*frames, list(poses))
    at = first.shape, rotation[0, 0], position[0, 0], second.shape, rotation[1, 0], position[1, 0]
    return clearance(*at) < STANDING


def _between(chain: list[int], other: list[int]) -> Iterator[int]:
    """Yield the frames from the end of one chain to the end of another, both included."""
    common = next(joint for joint in chain if joint in other)
    yield from chain[: chain.index(common) + 1]
    yield from other[: other.index(common)]


@cache
def drawn_into_each_other(file: RobotFile) -> frozenset[tuple[int, int]]:
    """Return the pairs of bodies of a robot, few joints apart, that meet wherever most of these joints stand."""
    bodies = [Body(link, "", "", frame.on, shape) for link, frame, shape in file.parts]
    pairs = np.array([pair for pair in combinations(range(len(bodies)), 2) if _few_joints(file, bodies, *pair)])
    if not len(pairs):
        return frozenset()
    rng = np.random.default_rng(0)
    values: dict[str, Array] = {}
    for joint in file.joints:
        values[joint.name] = rng.uniform(max(joint.lower, -np.pi), min(joint.upper, np.pi), POSITIONS)
    values = values_of(file.joints, {name: values[name] for name in values if not _follows(file, name)}, {})
    values = {name: np.broadcast_to(value, POSITIONS) for name, value in values.items()}
    frames = place(file.joints, np.eye(3), np.zeros(3), values, POSITIONS)
    rotation, position = attached(*frames, [frame for _, frame, _ in file.parts])
    drawn = set()
    near = boxes_meet(bodies, rotation, position, pairs)
    for number in np.flatnonzero(near.mean(axis=0) >= DRAWN):
        one, other = pairs[number].tolist()
        meets = [
            penetration(bodies[one].shape, rotation[one, at], position[one, at],
                        bodies[other].shape, rotation[other, at], position[other, at]) > 0.0
            for at in range(POSITIONS)
        ]  # fmt: skip
        if np.mean(meets) >= DRAWN:
            drawn.add((one, other))
    return frozenset(drawn)


def _follows(file: RobotFile, name: str) -> bool:
    return next(joint for joint in file.joints if joint.name == name).follows is not None


def _few_joints(file: RobotFile, bodies: Sequence[Body], one: int, other: int) -> bool:
    chains = file.chain(bodies[one].joint), file.chain(bodies[other].joint)
    return 2 < len(list(_between(*chains))) <= FEW + 1
