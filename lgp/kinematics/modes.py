"""Kinematic switches: to what each object is attached in each phase, and its pose through the kinematic tree.

Action k ends phase k (counted from 0). A grasp attaches an object to a hand, a handover to another hand, a place to a
table, always without a jump of its pose. A hold brings a hand onto an object that stays on its table; that hand stands
still until its next action. A screw needs two objects that stand as their joint says and a hand with a tool on the
screw. How an object lies in a hand or on a table is a few variables, shared by all slices of that stretch; `z` holds
them for the whole sequence. A pose depends on the configuration of its own slice and on the variables of its own
stretch, so constraints stay local.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.attachments import Attachment, Pose, ScrewConstraint, fixed_in, fixed_on, held, placed
from lgp.kinematics.features import Feature, pose_difference
from lgp.kinematics.world import Kinematics, World
from lgp.logic.task import parse_atom
from reba.arrays import Array
from reba.errors import did_you_mean

ROLES: Final[dict[str, tuple[str, ...]]] = {
    "grasp": ("hand", "object_name"),
    "place": ("hand", "object_name", "table"),
    "handover": ("giver", "object_name", "hand"),
    "hold": ("hand", "object_name"),
    "screw": ("hand", "object_name", "other"),
    "release": ("hand", "object_name"),
}
"""What the arguments of each kind of action are, in the order of the paper."""
TAKES: Final = ("grasp", "handover")
"""Kinds after which the hand has the object."""


@dataclass(frozen=True)
class KinematicSwitch:
    """One action as geometry.

    Attributes:
        kind: one of `ROLES`.
        hand: that acts; the one that takes the object in a handover.
        object_name: the object.
        table: on which it is placed.
        giver: hand that hands it over.
        other: object that it is screwed to.

    >>> Switch("place", "baxter.left", "screwdriver", "table.left").table
    'table.left'
    """

    kind: str
    hand: str
    object_name: str
    table: str = ""
    giver: str = ""
    other: str = ""

    @property
    def hands(self) -> tuple[str, ...]:
        """The hands that take part."""
        return (self.hand, self.giver) if self.giver else (self.hand,)


class ModeSequence:
    """The attachments of every object over a sequence of switches.

    Attributes:
        world: whose hands, tables and objects they are.
        switches: one per phase.
        lower, upper: bounds of z, (nz,).
        names: of the variables, (nz,).
        held_at_first: hands that hold an object from the initial state on: (hand, object, switch until they act).

    Raises:
        WorldError: a hand, object or table is unknown, an object is placed or handed over by a hand that does not hold
            it, or objects without a joint are screwed together.

    Example:
        >>> modes = Modes(world, [Switch("grasp", "baxter.right", "screwdriver")])      # doctest: +SKIP
        >>> modes.pose("screwdriver", 1, world.at(q, modes.frames), modes.first)        # doctest: +SKIP
    """

    def __init__(self, world: World, switches: Sequence[KinematicSwitch]) -> None:
        self.world, self.switches = world, tuple(switches)
        scene = world.scene
        self._held_by: dict[str, list[Attachment]] = {
            name: [fixed_in(scene.hands[thing.hand], thing) if thing.hand else fixed_on(scene.tables[thing.on], thing)]
            for name, thing in scene.objects.items()
        }
        self._new: list[Attachment | None] = []
        size = 0
        for number, switch in enumerate(self.switches):
            self._check(number, switch)
            new = self._next(switch, size)
            self._new.append(new)
            size += 0 if new is None else new.size
            for name, holders in self._held_by.items():
                moves = name == switch.object_name and new is not None and switch.kind != "hold"
                holders.append(new if moves and new is not None else holders[-1])
        chosen = [(number, holder) for number, holder in enumerate(self._new) if holder is not None]
        self.lower = np.concatenate([np.zeros(0), *(holder.lower for _, holder in chosen)])
        self.upper = np.concatenate([np.zeros(0), *(holder.upper for _, holder in chosen)])
        self.names = tuple(
            f"{number}.{self.switches[number].object_name}.{name}" for number, holder in chosen for name in holder.names
        )
        self.held_at_first = tuple(
            (hand, thing, self._next_act(hand, 0))
            for hand, thing in (
                atom.arguments for atom in map(parse_atom, scene.initial) if atom.predicate == "holding"
            )
        )

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.lower)

    @property
    def frames(self) -> tuple[str, ...]:
        """Frames whose placements the poses need: the hands that take part or hold something at first."""
        first = [thing.hand for thing in self.world.scene.objects.values() if thing.hand]
        return tuple(dict.fromkeys([*(hand for switch in self.switches for hand in switch.hands), *first]))

    @property
    def holding_intervals(self) -> tuple[tuple[str, int, int], ...]:
        """Hands that stand still: (hand, switch with which they hold, switch until which they stay)."""
        return tuple(
            (switch.hand, number, self._next_act(switch.hand, number + 1))
            for number, switch in enumerate(self.switches)
            if switch.kind == "hold"
        )

    def _next_act(self, hand: str, first: int) -> int:
        """Return the first switch from a number on in which a hand takes part, the last one if there is none."""
        last = len(self.switches) - 1
        return next((k for k in range(first, last + 1) if hand in self.switches[k].hands), last)

    def attachment(self, thing: str, phase: int) -> Attachment:
        """Return what holds an object during a phase; phase K is after the last of K actions.

        Raises:
            WorldError: there is no such object or phase.
        """
        if thing not in self._held_by:
            raise WorldError(f"no object {thing!r}{did_you_mean(thing, self._held_by)}")
        if not 0 <= phase <= len(self.switches):
            raise WorldError(f"phase {phase} is outside 0 to {len(self.switches)}")
        return self._held_by[thing][phase]

    def contact(self, number: int) -> tuple[Attachment, Attachment] | None:
        """Return the two holders that have the object of a switch at one pose, the new one first; None if none does."""
        new = self._new[number]
        return None if new is None else (new, self.attachment(self.switches[number].object_name, number))

    def pose(self, thing: str, phase: int, kinematics: Kinematics, z: Array) -> Pose:
        """Return the pose of an object in n slices of a phase, with Jacobians by q and by the variables of its holder.

        Args:
            thing: name of the object.
            phase: 0 to K.
            kinematics: of n slices, holding `frames`.
            z: (nz,) all variables.
        """
        holder = self.attachment(thing, phase)
        return holder.pose(kinematics, z[holder.variables])

    def pose_continuity(self, number: int, kinematics: Kinematics, z: Array) -> Feature:
        """Return by how much the object of a switch would jump, (n, 6) [m, rad], and its Jacobian by (q, z).

        Args:
            number: of a switch with a `contact`.
            kinematics: of the slice in which it happens (n = 1), or of n candidates for it.
            z: (nz,).

        Raises:
            WorldError: nothing changes hands in this switch.
        """
        sides = self.contact(number)
        if sides is None:
            raise WorldError(f"action {number} ({self.switches[number].kind}): no object changes hands")
        poses = [side.pose(kinematics, z[side.variables]).with_all_variables(self.size) for side in sides]
        return pose_difference(*poses)

    def screw_constraint(self, number: int) -> ScrewConstraint:
        """Return the geometry of a screw.

        Raises:
            WorldError: the switch is no screw.
        """
        switch = self.switches[number]
        if switch.kind != "screw":
            raise WorldError(f"action {number} ({switch.kind}): no screw")
        parts = tuple(sorted((switch.object_name, switch.other)))
        joint = next(joint for joint in self.world.scene.assemblies if tuple(sorted(joint.parts)) == parts)
        first, second = (self.attachment(part, number) for part in joint.parts)
        return ScrewConstraint(joint, self.world.scene.hands[switch.hand], first, second, self.size)

    def guess(self, keys: Array) -> Array:
        """Return variables (nz,) that fit key configurations: no jump as far as each stretch has the freedom for it.

        Args:
            keys: (K, nq), the configuration at the end of each phase.
        """
        z = np.clip(np.zeros(self.size), self.lower, self.upper)
        kinematics = self.world.at(keys, self.frames)
        for number in range(len(self.switches)):
            sides = self.contact(number)
            if sides is not None:
                after, before = sides
                pose = before.pose(kinematics, z[before.variables])
                z[after.variables] = after.fit(kinematics, pose.rotation[number], pose.position[number], number)
        return z

    def _next(self, switch: KinematicSwitch, start: int) -> Attachment | None:
        """Return what has the object of a switch from then on, or as well from then on; None if nothing new does."""
        scene = self.world.scene
        thing = scene.objects[switch.object_name]
        if switch.kind in (*TAKES, "hold"):
            return held(scene.hands[switch.hand], thing, start)
        return placed(scene.tables[switch.table], thing, start) if switch.kind == "place" else None

    def _check(self, number: int, switch: KinematicSwitch) -> None:
        scene = self.world.scene
        if switch.kind not in ROLES:
            raise WorldError(f"action {number}: unknown kind {switch.kind!r}, expected one of {', '.join(ROLES)}")
        for field in ROLES[switch.kind]:
            objects = dict.fromkeys(("object_name", "other"), scene.objects)
            known = {"table": scene.tables, **objects}.get(field, scene.hands)
            name = getattr(switch, field)
            if name not in known:
                hint = did_you_mean(name, known) or f"; known are {', '.join(known)}"
                what = "object" if field in objects else field
                raise WorldError(f"action {number} ({switch.kind}): unknown {what} {name!r}{hint}")
        holder = self._held_by[switch.object_name][number]
        gives = {"place": switch.hand, "handover": switch.giver}.get(switch.kind, holder.parent)
        if holder.parent != gives:
            verb = "places" if switch.kind == "place" else "hands over"
            raise WorldError(
                f"action {number}: {gives} {verb} {switch.object_name}, held by {holder.parent}; grasp it first"
            )
        parts = {switch.object_name, switch.other}
        if switch.kind == "screw" and parts not in [set(joint.parts) for joint in scene.assemblies]:
            raise WorldError(
                f"action {number}: {' and '.join(sorted(parts))} have no joint; add one to the scene's [[joints]]"
            )
