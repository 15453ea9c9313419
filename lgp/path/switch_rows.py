"""The rows of switches: no object jumps, hands are not tilted too far, screws go in straight where parts are joined."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from lgp.path.phases import Phases
from lgp.world import features
from lgp.world.fastening import Fastening
from lgp.world.features import Feature
from lgp.world.holders import Holder, Pose
from lgp.world.model import Kinematics, World
from lgp.world.switches import Modes

Array = NDArray[np.float64]
Slices = NDArray[np.intp]
Blocks = list[tuple[int, Slices]]

AT_TABLES: Final = ("grasp", "place", "hold")
"""Kinds of switches in which a hand works on a table, so that its tilt counts."""

STEP: Final = 1e-6
"""[m, rad] Of the differences that give the second derivatives by a grip."""

POSE_UNITS: Final = ("m", "m", "m", "rad", "rad", "rad")


@dataclass(frozen=True)
class Row:
    """What one row is about: its kind, its unit, the number of a switch or slice, and who or what.

    Kinds: "jump", "screw", "joint", "rest" (of switches), "sole"; "tilt" (of switches), "leg". A tilt is a
    difference of cosines, which has no unit.
    """

    kind: str
    unit: str
    number: int
    name: str


@dataclass(frozen=True)
class SwitchValues:
    """Values of the rows of all switches, and the blocks of their Jacobians, in order."""

    equality: list[Array]
    inequality: list[Array]
    eq_blocks: list[Array]
    in_blocks: list[Array]


class SwitchRows:
    """The rows of some switches; unknowns are kept configurations (P, nq), one after the other, then z.

    Args:
        world: the kinematics.
        phases: the sequence.
        modes: its attachments.
        at: number of each switch whose rows are kept -> place of its slice among the kept ones.
        tail: where z starts among the unknowns.

    Attributes:
        eq, ineq: (rows, columns) of each block.
        eq_rows, in_rows: what each row is about.
    """

    def __init__(self, world: World, phases: Phases, modes: Modes, at: dict[int, int], tail: int) -> None:
        self.world, self.phases, self.modes, self.at, self.tail = world, phases, modes, at, tail
        self.eq: Blocks = []
        self.ineq: Blocks = []
        self.eq_rows: list[Row] = []
        self.in_rows: list[Row] = []
        self._limbs = {number: self.limb(number) for number in at}
        self._own: dict[int, Slices] = {}
        self._screws: dict[int, Fastening] = {}
        self._joined: dict[int, tuple[int, ...]] = {}
        for number in at:
            if self.modes.contact(number) is not None:
                self._lay_contact(number)
            elif phases.switches[number].kind == "screw":
                self._lay_screw(number)
        for number in self._tilted:
            self.ineq.append((1, self._columns(number)))
            self.in_rows.append(Row("tilt", "", number, phases.switches[number].hand))

    def limb(self, number: int) -> Slices:
        """Return the columns of q that move the hands of a switch."""
        support = [self.world.support(hand) for hand in self.phases.switches[number].hands]
        return np.flatnonzero(np.max(support, axis=0))

    @property
    def _tilted(self) -> list[int]:
        switches, hands = self.phases.switches, self.world.scene.hands
        return [n for n in self.at if switches[n].kind in AT_TABLES and hands[switches[n].hand].tilt < 180.0]

    def _columns(self, number: int, own: Slices | None = None) -> Slices:
        """Return the unknowns of the limbs of a switch, and given variables."""
        limbs = self.at[number] * self.world.nq + self._limbs[number]
        return limbs if own is None else np.concatenate([limbs, self.tail + own])

    def _lay_contact(self, number: int) -> None:
        sides = self.modes.contact(number) or ()
        own = np.unique(np.concatenate([np.arange(side.variables.start, side.variables.stop) for side in sides]))
        self._own[number] = own.astype(np.intp)
        self.eq.append((6, self._columns(number, self._own[number])))
        thing = self.phases.switches[number].thing
        self.eq_rows += [Row("jump", unit, number, thing) for unit in POSE_UNITS]

    def _lay_screw(self, number: int) -> None:
        switch, screw = self.phases.switches[number], self.modes.fastening(number)
        self._screws[number], self._own[number] = screw, screw.variables
        kept = screw.rows(self.world.at(self.world.start[None], self.modes.frames))
        self._joined[number] = kept
        self.eq.append((5, self._columns(number, screw.variables)))
        self.eq_rows += [Row("screw", unit, number, switch.hand) for unit in ("m", "m", "m", "rad", "rad")]
        self.eq.append((len(kept), self._columns(number, screw.variables)))
        self.eq_rows += [Row("joint", POSE_UNITS[row], number, switch.other) for row in kept]

    def evaluate(self, q: Array, z: Array) -> SwitchValues:
        """Return all rows at configurations (P, nq) and variables (nz,)."""
        found = SwitchValues([], [], [], [])
        kinematics = {number: self._kinematics(number, q) for number in self.at}
        for number in self._own:
            for feature in self._equalities(number, kinematics[number], z):
                found.equality.append(feature.value[0])
                found.eq_blocks.append(self._block(number, feature))
        for number in self._tilted:
            hand = self.phases.switches[number].hand
            tilt = features.tilt(kinematics[number].place(hand), self.world.scene.hands[hand].tilt)
            found.inequality.append(tilt.value[0])
            found.in_blocks.append(tilt.jacobian[0][:, self._limbs[number]])
        return found

    def _kinematics(self, number: int, q: Array) -> Kinematics:
        at = self.at[number]
        return self.world.at(q[at : at + 1], self._frames(number))

    def _frames(self, number: int) -> tuple[str, ...]:
        """Return the hands that take part, and those that hold what takes part."""
        switch = self.phases.switches[number]
        holders = {self.modes.holder(part, number).by for part in (switch.thing, switch.other) if part}
        return tuple(dict.fromkeys([*switch.hands, *(by for by in sorted(holders) if by in self.world.scene.hands)]))

    def _equalities(self, number: int, kinematics: Kinematics, z: Array) -> list[Feature]:
        if number not in self._screws:
            return [self.modes.jump(number, kinematics, z)]
        screw, rows = self._screws[number], list(self._joined[number])
        apart = screw.apart(kinematics, z)
        return [screw.reach(kinematics, z), Feature(apart.value[:, rows], apart.jacobian[:, rows])]

    def _block(self, number: int, feature: Feature) -> Array:
        columns = np.concatenate([self._limbs[number], self.world.nq + self._own[number]])
        return np.asarray(feature.jacobian[0][:, columns])

    def curved(self) -> list[Slices]:
        """Return the unknowns of each block that `bends` gives: a hand's limb at a switch, and how it holds."""
        found = []
        for number, at in self.at.items():
            for hand, _, holder in self._bent(number):
                grip = holder.variables if holder is not None else slice(0, 0)
                limb = np.flatnonzero(self.world.support(hand))
                found.append(np.concatenate([at * self.world.nq + limb, self.tail + np.arange(grip.start, grip.stop)]))
        return found

    def _bent(self, number: int) -> list[tuple[str, float, Holder | None]]:
        """Return hand, sign in the rows, and holder of each curved part of a switch; no holder for a screw."""
        if number in self._screws:
            return [(self.phases.switches[number].hand, 1.0, None)]
        signed = zip((1.0, -1.0), self.modes.contact(number) or (), strict=False)
        return [(holder.by, sign, holder) for sign, holder in signed if holder.by in self.world.scene.hands]

    def bends(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return sum_i y_i d2 row_i by the unknowns of each block in `curved`, (m, m); y are those of `eq_rows`.

        Near a met constraint the rotation vector of a chain has the mixed second derivative (omega_a x omega_b) / 2.
        How the hand holds the object acts like joints after the last one.
        """
        found, start = [], 0
        for number in self.at:
            parts = self._bent(number)
            if not parts:
                continue
            kinematics = self._kinematics(number, q)
            for hand, sign, holder in parts:
                limb = np.flatnonzero(self.world.support(hand))
                if holder is None:
                    bend = self._screws[number].curvature(kinematics, z, y[start : start + 5])[0]
                    found.append(bend[np.ix_(limb, limb)])
                else:
                    found.append(_held_bend(holder, limb, kinematics, z, sign * y[start : start + 6]))
            start += 6 if number not in self._screws else 5 + len(self._joined[number])
        return found


def _held_bend(holder: Holder, limb: Slices, kinematics: Kinematics, z: Array, weights: Array) -> Array:
    """Return the weighted second derivative (m, m) of the pose of a held object by its limb and grip."""
    held = holder.pose(kinematics, z[holder.variables])
    jacobian = np.concatenate([held.by_q[:, :, limb], held.by_variables], axis=2)
    turn = held.rotation[0] @ weights[3:]
    bend = features.position_curvature(jacobian, weights[None, :3])[0]
    angular = jacobian[0, 3:]
    twist = np.triu(np.cross(turn[:, None], angular, axis=0).T @ angular, 1)
    bend += 0.5 * (twist + twist.T)
    # The grip is a rotation vector itself: its parts do not come one after the other.
    bend[len(limb) :, len(limb) :] = _grip_bend(holder, kinematics, z, np.concatenate([weights[:3], turn]), held)
    return np.asarray(bend)


def _grip_bend(holder: Holder, kinematics: Kinematics, z: Array, weights: Array, held: Pose) -> Array:
    """Return the weighted second derivative (m, m) of the pose of a held object by its grip, by differences."""
    grip = z[holder.variables]
    slopes = np.empty((len(grip), len(grip)))
    for part in range(len(grip)):
        moved = grip.copy()
        moved[part] += STEP
        slopes[part] = weights @ (holder.pose(kinematics, moved).by_variables[0] - held.by_variables[0]) / STEP
    return 0.5 * (slopes + slopes.T)
