"""Constraints of kinematic switches: poses of objects, their footing, tilt of hands, alignment of parts and screws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from lgp.kinematics.attachments import ScrewConstraint
from lgp.kinematics.features import Feature, nearness
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import Kinematics, World
from lgp.path.contact_batch import ContactBatch, ContactValues
from lgp.path.phases import Phases
from lgp.scene.footing import LEAST_SHARE, footprint, shared_area
from reba.arrays import Array, Indices

Blocks = list[tuple[int, Indices]]
POSE_UNITS: Final = ("m", "m", "m", "rad", "rad", "rad")
SPARE_SHARE: Final = 0.01
"""Of its footprint, that an object has on its table beyond the least share: a controller is not exact."""


@dataclass(frozen=True)
class ConstraintInfo:
    """What one row is about: its kind, its unit, the number of a switch or knot, and the name of a hand or object.

    Kinds of switches: "pose_continuity", "tool", "joint", "tilt", "hands", "footing", and "action" of what an action
    brings itself; of knots: "rest", "sole", "leg", "collision", "speed". A tilt is a difference of cosines without
    unit.
    """

    kind: str
    unit: str
    number: int
    name: str


@dataclass(frozen=True)
class SwitchValues:
    """Values (B, m) and Jacobian blocks (B, rows, columns) of the rows of all switches at B points, in order; and the
    kinematics and contacts that their curvature needs."""

    equality: list[Array]
    inequality: list[Array]
    eq_blocks: list[Array]
    in_blocks: list[Array]
    kinematics: Kinematics
    contacts: ContactValues | None


class ModeConstraints:
    """The rows of some switches; unknowns are configurations (P, nq), knot after knot, then the variables z.

    Args:
        modes: attachments of the sequence.
        at: number of each enforced switch -> place of its slice among the knots.
        tail: where z starts among the unknowns.
        joints: number of a switch -> columns of q that its own constraints depend on.

    Attributes:
        eq, ineq: (rows, columns) of each block.
        eq_rows, in_rows: what each row is about.
    """

    def __init__(self, world: World, phases: Phases, modes: ModeSequence, at: dict[int, int], tail: int,
                 joints: Mapping[int, Indices]) -> None:  # fmt: skip
        self._more = joints
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
        for number in self._put_down:
            own = modes.attachment(phases.switches[number].object_name, number + 1).variables
            self.ineq.append((1, tail + np.arange(own.start, own.stop)))
            self.in_rows.append(ConstraintInfo("footing", "m", number, phases.switches[number].object_name))
        self._places = np.array(list(at.values()), np.intp)
        self._frames = tuple(dict.fromkeys(name for number in at for name in self._frames_of(number)))
        self._contacts = [number for number in self._own if number not in self._screws]
        self._batch = ContactBatch(world, modes, self._contacts, list(at)) if self._contacts else None
        self._joints = np.unique(np.concatenate([np.zeros(0, np.intp), *self._limbs.values()]))
        self._curved = {
            number: np.concatenate([np.searchsorted(self._joints, self._limbs[number]), len(self._joints) + own])
            for number, own in self._own.items()
        }

    def limb(self, number: int) -> Indices:
        """Return the columns of q that move what meets in a switch, and what its own constraints are about."""
        support = [self.world.support(name) for name in self.modes.acting(number)]
        return np.union1d(np.flatnonzero(np.max(support, axis=0)), self._more[number])

    @cached_property
    def _tilted(self) -> list[int]:
        switches, hands = self.phases.switches, self.world.scene.hands
        return [n for n in self.at if switches[n].action.works_at_table and hands[switches[n].hand].tilt < 180.0]

    @property
    def _given(self) -> list[int]:
        """The handovers: both hands are at one object."""
        return [number for number in self.at if self.phases.switches[number].giver]

    @cached_property
    def _put_down(self) -> list[int]:
        return [number for number in self.at if self.phases.switches[number].action.attaches_to == "table"]

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
        self.eq_rows += [ConstraintInfo("tool", unit, number, switch.hand) for unit in ("m", "m", "m", "rad", "rad")]
        self.eq.append((len(rows), self._columns(number, screw.variables)))
        self.eq_rows += [ConstraintInfo("joint", POSE_UNITS[row], number, switch.other) for row in rows]

    def evaluate(self, q: Array, z: Array) -> SwitchValues:
        """Return all rows at B configurations (B, P, nq) and variables (B, nz)."""
        kinematics = self.world.at(q[:, self._places].reshape(-1, q.shape[2]), self._frames)
        contacts = None if self._batch is None else self._batch.evaluate(kinematics, z)
        values = SwitchValues([], [], [], [], kinematics, contacts)
        for number in self._own:
            if contacts is not None and number not in self._screws:
                at = self._contacts.index(number)
                values.equality.append(contacts.value[:, at])
                values.eq_blocks.append(contacts.jacobian[:, at][:, :, self._block(number)])
                continue
            own = self._kinematics(kinematics, number)
            features_of = [self._screw(number, own.rows(slice(b, b + 1)), z[b]) for b in range(len(z))]
            for parts in zip(*features_of, strict=True):
                values.equality.append(np.concatenate([part.value for part in parts]))
                jacobian = np.concatenate([part.jacobian for part in parts])
                values.eq_blocks.append(jacobian[:, :, self._block(number)])
        if self._tilted:
            self._add_tilts(kinematics, values, len(q))
        for number in self._given:
            own = self._kinematics(kinematics, number)
            taker, giver = (own.placement(hand) for hand in self.phases.switches[number].hands)
            near = nearness(taker, giver, self.world.scene.hand_clearance)
            values.inequality.append(near.value)
            values.in_blocks.append(near.jacobian[:, :, self._limbs[number]])
        for number in self._put_down:
            value, slope = self._footing(number, z)
            values.inequality.append(value[:, None])
            values.in_blocks.append(slope[:, None])
        return values

    def _footing(self, number: int, z: Array) -> tuple[Array, Array]:
        """Return how much (B,) of its footprint an object lacks on its table, per side of a square as large [m], and
        the derivatives (B, 3) by its place."""
        switch, scene = self.phases.switches[number], self.world.scene
        half = footprint(scene.objects[switch.object_name])
        own = self.modes.attachment(switch.object_name, number + 1).variables
        area, slope = shared_area(np.array(scene.tables[switch.table].size) / 2.0, half, z[:, own])
        side = 2.0 * float(np.sqrt(half.prod()))
        return (LEAST_SHARE + SPARE_SHARE) * side - area / side, -slope / side

    def _add_tilts(self, kinematics: Kinematics, values: SwitchValues, count: int) -> None:
        """Add the tilt of every hand that works on a table, as `features.tilt` has it, at once."""
        order, hands = list(self.at), [self.phases.switches[number].hand for number in self._tilted]
        places = [order.index(number) for number in self._tilted]
        frames = [kinematics.index[hand] for hand in hands]
        shape = (count, len(order), -1)
        axis = kinematics.rotation[..., 2].reshape(*shape, 3)[:, places, frames]
        spin = kinematics.spatial[:, 3:5].reshape(*shape, self.world.nq)[:, places]
        # Up along the hand's own axis z: that of a hand that points down is -1.
        slopes = spin[:, :, 0] * axis[:, :, 1, None] - spin[:, :, 1] * axis[:, :, 0, None]
        for at, (number, hand) in enumerate(zip(self._tilted, hands, strict=True)):
            limit = np.cos(np.radians(self.world.scene.hands[hand].tilt))
            values.inequality.append(limit + axis[:, at, 2:])
            limb = self._limbs[number]
            values.in_blocks.append((slopes[:, at, limb] * self.world.support(hand)[limb])[:, None])

    def _kinematics(self, kinematics: Kinematics, number: int) -> Kinematics:
        """Return the kinematics of B points in one switch."""
        return kinematics.rows(slice(list(self.at).index(number), None, len(self.at)))

    def _frames_of(self, number: int) -> tuple[str, ...]:
        """Return the hands that take part, and what moves that has the objects."""
        switch = self.phases.switches[number]
        have = [self.modes.attachment(part, number) for part in (switch.object_name, switch.other) if part]
        parents = sorted(one.parent for one in have if one.base is None)
        return tuple(dict.fromkeys([*self.modes.acting(number), *parents]))

    def _screw(self, number: int, kinematics: Kinematics, z: Array) -> list[Feature]:
        screw, rows = self._screws[number], list(self._joined[number])
        joint = screw.assembly_error(kinematics, z)
        return [screw.tool_error(kinematics, z), Feature(joint.value[:, rows], joint.jacobian[:, rows])]

    def _block(self, number: int) -> Indices:
        """Return the columns of a block among configuration and variables."""
        return np.concatenate([self._limbs[number], self.world.nq + self._own[number]])

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

    def equality_hessians(self, values: SwitchValues, z: Array, y: Array) -> list[Array]:
        """Return sum_i y_i d2 row_i (B, m, m) by the unknowns of each block in `hessian_columns`.

        `values` are those of `evaluate` at z (B, nz), y (B, m_e) the multipliers of all equalities.
        """
        starts, start = {}, 0
        for number in self._own:
            starts[number] = start
            start += 5 + len(self._joined[number]) if number in self._screws else 6
        curvature = np.zeros(0)
        if self._batch is not None and values.contacts is not None:
            weights = np.stack([y[:, starts[number] : starts[number] + 6] for number in self._contacts], axis=1)
            curvature = self._batch.curvature(values.contacts, weights, self._joints)
        hessians = []
        for number in self._own:
            if number not in self._screws:
                columns = self._curved[number]
                hessians.append(curvature[:, self._contacts.index(number)][:, columns[:, None], columns])
                continue
            limb = np.flatnonzero(self.world.support(self.phases.switches[number].hand))
            own, screw = self._kinematics(values.kinematics, number), self._screws[number]
            weights = y[:, starts[number] : starts[number] + 5]
            each = [screw.curvature(own.rows(slice(b, b + 1)), z[b], weights[b])[0] for b in range(len(z))]
            hessians.append(np.stack(each)[:, limb[:, None], limb])
        return hessians
