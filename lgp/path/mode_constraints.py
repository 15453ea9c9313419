"""Constraints of kinematic switches: pose continuity of objects, tilt of hands, alignment of parts and screws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.kinematics import features
from lgp.kinematics.attachments import Attachment, Pose, ScrewConstraint
from lgp.kinematics.features import Feature, skew
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import Kinematics, World
from lgp.path.phases import Phases
from reba.arrays import Array, Indices

Blocks = list[tuple[int, Indices]]
POSE_UNITS: Final = ("m", "m", "m", "rad", "rad", "rad")


@dataclass(frozen=True)
class ConstraintInfo:
    """What one row is about: its kind, its unit, the number of a switch or knot, and the name of a hand or object.

    Kinds of switches: "pose_continuity", "screw", "joint", "tilt", "hands"; of knots: "rest", "sole", "leg",
    "collision". A tilt is a difference of cosines, which has no unit.
    """

    kind: str
    unit: str
    number: int
    name: str


@dataclass(frozen=True)
class SwitchValues:
    """Values and Jacobian blocks of the rows of all switches, in order; and the kinematics of each switch."""

    equality: list[Array]
    inequality: list[Array]
    eq_blocks: list[Array]
    in_blocks: list[Array]
    kinematics: dict[int, Kinematics]


class ModeConstraints:
    """The rows of some switches; unknowns are configurations (P, nq), knot after knot, then the variables z.

    Args:
        modes: attachments of the sequence.
        at: number of each enforced switch -> place of its slice among the knots.
        tail: where z starts among the unknowns.

    Attributes:
        eq, ineq: (rows, columns) of each block.
        eq_rows, in_rows: what each row is about.
    """

    def __init__(self, world: World, phases: Phases, modes: ModeSequence, at: dict[int, int], tail: int) -> None:
        self.world, self.phases, self.modes, self.at, self.tail = world, phases, modes, at, tail
        self.eq: Blocks = []
        self.ineq: Blocks = []
        self.eq_rows: list[ConstraintInfo] = []
        self.in_rows: list[ConstraintInfo] = []
        self._limbs = {number: self.limb(number) for number in at}
        self._own: dict[int, Indices] = {}
        self._screws: dict[int, ScrewConstraint] = {}
        self._joined: dict[int, tuple[int, ...]] = {}
        for number in at:
            if self.modes.contact(number) is not None:
                self._add_contact(number)
            elif phases.switches[number].action.screws:
                self._add_screw(number)
        for number in self._tilted:
            self.ineq.append((1, self._columns(number)))
            self.in_rows.append(ConstraintInfo("tilt", "", number, phases.switches[number].hand))
        for number in self._given:
            self.ineq.append((1, self._columns(number)))
            self.in_rows.append(ConstraintInfo("hands", "m", number, " and ".join(phases.switches[number].hands)))

    def limb(self, number: int) -> Indices:
        """Return the columns of q that move the hands of a switch."""
        support = [self.world.support(hand) for hand in self.phases.switches[number].hands]
        return np.flatnonzero(np.max(support, axis=0))

    @property
    def _tilted(self) -> list[int]:
        switches, hands = self.phases.switches, self.world.scene.hands
        return [n for n in self.at if switches[n].action.works_at_table and hands[switches[n].hand].tilt < 180.0]

    @property
    def _given(self) -> list[int]:
        """The handovers: both hands are at one object."""
        return [number for number in self.at if self.phases.switches[number].giver]

    def _columns(self, number: int, own: Indices | None = None) -> Indices:
        """Return the unknowns of the limbs of a switch, and given variables."""
        limbs = self.at[number] * self.world.nq + self._limbs[number]
        return limbs if own is None else np.concatenate([limbs, self.tail + own])

    def _add_contact(self, number: int) -> None:
        sides = self.modes.contact(number) or ()
        own = np.unique(np.concatenate([np.arange(side.variables.start, side.variables.stop) for side in sides]))
        self._own[number] = own.astype(np.intp)
        self.eq.append((6, self._columns(number, self._own[number])))
        name = self.phases.switches[number].object_name
        self.eq_rows += [ConstraintInfo("pose_continuity", unit, number, name) for unit in POSE_UNITS]

    def _add_screw(self, number: int) -> None:
        switch, screw = self.phases.switches[number], self.modes.screw_constraint(number)
        self._screws[number], self._own[number] = screw, screw.variables
        rows = screw.rows(self.world.at(self.world.initial_configuration[None], self.modes.frames))
        self._joined[number] = rows
        self.eq.append((5, self._columns(number, screw.variables)))
        self.eq_rows += [ConstraintInfo("screw", unit, number, switch.hand) for unit in ("m", "m", "m", "rad", "rad")]
        self.eq.append((len(rows), self._columns(number, screw.variables)))
        self.eq_rows += [ConstraintInfo("joint", POSE_UNITS[row], number, switch.other) for row in rows]

    def evaluate(self, q: Array, z: Array) -> SwitchValues:
        """Return all rows at configurations (P, nq) and variables (nz,)."""
        kinematics = {number: self._kinematics(number, q) for number in self.at}
        values = SwitchValues([], [], [], [], kinematics)
        for number in self._own:
            for feature in self._equalities(number, kinematics[number], z):
                values.equality.append(feature.value[0])
                values.eq_blocks.append(self._block(number, feature))
        for number in self._tilted:
            hand = self.phases.switches[number].hand
            tilt = features.tilt(kinematics[number].placement(hand), self.world.scene.hands[hand].tilt)
            values.inequality.append(tilt.value[0])
            values.in_blocks.append(tilt.jacobian[0][:, self._limbs[number]])
        for number in self._given:
            taker, giver = (kinematics[number].placement(hand) for hand in self.phases.switches[number].hands)
            near = features.nearness(taker, giver, self.world.scene.hand_clearance)
            values.inequality.append(near.value[0])
            values.in_blocks.append(near.jacobian[0][:, self._limbs[number]])
        return values

    def _kinematics(self, number: int, q: Array) -> Kinematics:
        at = self.at[number]
        return self.world.at(q[at : at + 1], self._frames(number))

    def _frames(self, number: int) -> tuple[str, ...]:
        """Return the hands that take part, and those that the objects are attached to."""
        switch = self.phases.switches[number]
        parents = {self.modes.attachment(part, number).parent for part in (switch.object_name, switch.other) if part}
        return tuple(
            dict.fromkeys([*switch.hands, *(name for name in sorted(parents) if name in self.world.scene.hands)])
        )

    def _equalities(self, number: int, kinematics: Kinematics, z: Array) -> list[Feature]:
        if number not in self._screws:
            return [self.modes.pose_continuity(number, kinematics, z)]
        screw, rows = self._screws[number], list(self._joined[number])
        joint = screw.assembly_error(kinematics, z)
        return [screw.tool_error(kinematics, z), Feature(joint.value[:, rows], joint.jacobian[:, rows])]

    def _block(self, number: int, feature: Feature) -> Array:
        columns = np.concatenate([self._limbs[number], self.world.nq + self._own[number]])
        return np.asarray(feature.jacobian[0][:, columns])

    def hessian_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `equality_hessians`: limbs and variables, of a screw its limb."""
        columns = []
        for number in self.at:
            if number in self._screws:
                limb = np.flatnonzero(self.world.support(self.phases.switches[number].hand))
                columns.append(self.at[number] * self.world.nq + limb)
            elif number in self._own:
                columns.append(self._columns(number, self._own[number]))
        return columns

    def equality_hessians(self, kinematics: dict[int, Kinematics], z: Array, y: Array) -> list[Array]:
        """Return sum_i y_i d2 row_i (m, m) by the unknowns of each block in `hessian_columns`.

        `kinematics` are those that `evaluate` returned for each switch, y the multipliers of `eq_rows`, z is (nz,).
        """
        hessians, start = [], 0
        for number, own in self._own.items():
            contact = self.modes.contact(number)
            if contact is not None:
                weights = y[start : start + 6]
                hessians.append(contact_curvature(contact, self._limbs[number], own, kinematics[number], z, weights))
                start += 6
                continue
            limb = np.flatnonzero(self.world.support(self.phases.switches[number].hand))
            hessian = self._screws[number].curvature(kinematics[number], z, y[start : start + 5])[0]
            hessians.append(hessian[np.ix_(limb, limb)])
            start += 5 + len(self._joined[number])
        return hessians


STEP: Final = 1e-6
"""[m, rad] Of the forward differences that give the second derivatives by a grip."""


def contact_curvature(
    sides: tuple[Attachment, Attachment], limbs: Indices, own: Indices, kinematics: Kinematics, z: Array, y: Array
) -> Array:
    """Return sum_i y_i d2 row_i (m, m) of a contact by the joints of its limbs, then its variables.

    Args:
        sides: attachment of the object after the switch, and before.
        limbs, own: columns of q, places in z (nz,).
        kinematics: of the slice of the switch (n = 1).
        y: (6,) weights of the rows: difference of positions, rotation vector in the frame of the first pose.
    """
    poses = [side.pose(kinematics, z[side.variables]) for side in sides]
    world = np.concatenate([y[:3], poses[0].rotation[0] @ y[3:]])
    hessian, turns = np.zeros((len(limbs) + len(own),) * 2), []
    for side, pose, sign in zip(sides, poses, (1.0, -1.0), strict=True):
        places = len(limbs) + np.searchsorted(own, np.arange(side.variables.start, side.variables.stop))
        moved = np.flatnonzero(np.any(pose.by_q[0][:, limbs] != 0.0, axis=0))
        turn = np.zeros((3, len(hessian)))
        turn[:, moved], turn[:, places] = pose.by_q[0, 3:][:, limbs[moved]], pose.by_variables[0, 3:]
        turns.append(turn)
        if len(moved):
            every = np.concatenate([moved, places])
            hessian[np.ix_(every, every)] += _attached_pose_hessian(
                side, pose, limbs[moved], kinematics, z, sign * world
            )
    mixed = -0.5 * (skew(world[3:]) @ turns[1]).T @ turns[0]
    return np.asarray(hessian + mixed + mixed.T)


def _attached_pose_hessian(
    attachment: Attachment, pose: Pose, limb: Indices, kinematics: Kinematics, z: Array, weights: Array
) -> Array:
    """Return the weighted second derivative (m, m) of the pose of an attached object by its limb and grip."""
    jacobian = np.concatenate([pose.by_q[:, :, limb], pose.by_variables], axis=2)
    hessian = features.position_curvature(jacobian, weights[None, :3])[0]
    angular = jacobian[0, 3:]
    twist = np.triu((skew(weights[3:]) @ angular).T @ angular, 1)
    hessian += 0.5 * (twist + twist.T)
    # The grip is a rotation vector itself: its components are no consecutive rotations.
    if attachment.slopes is not None:
        grip = z[attachment.variables]
        moved = attachment.slopes(kinematics, grip + STEP * np.eye(len(grip)))
        by_grip = weights @ (moved - pose.by_variables) / STEP
        hessian[len(limb) :, len(limb) :] = 0.5 * (by_grip + by_grip.T)
    return np.asarray(hessian)
