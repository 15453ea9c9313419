"""Kinematic switches and modes of a sequence of actions, after logic-geometric programming (Toussaint 2015).

Action k ends phase k, both counted from 0, with a kinematic switch. A mode is what every object is attached to during
one phase: a hand or a table. Records of `lgp.kinematics.actions` say what each action does to the modes; the pose of
the object stays continuous in every switch. The pose of an object relative to a hand or table is a few variables,
shared by all slices until its next switch; z (nz,) holds the variables of the complete sequence. An object's pose
depends on the configuration of its own slice and on the variables of its own attachment, so constraints stay local.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.actions import ROLES, ActionKind, kind_of, registered_actions
from lgp.kinematics.attachments import Attachment, Pose, ScrewConstraint, fixed_in, fixed_on, held, placed
from lgp.kinematics.features import Feature, pose_difference
from lgp.kinematics.world import Kinematics, World
from lgp.logic.task import parse_atom
from reba.arrays import Array
from reba.errors import did_you_mean


@dataclass(frozen=True)
class KinematicSwitch:
    """One action, of a registered kind, as geometry.

    Attributes:
        hand: that acts; the one that takes the object in a handover.
        table: on which the object is placed.
        giver: hand that hands it over.
        other: object that it is screwed to.
        second: another hand that takes part.
        more: further (role, name).

    >>> KinematicSwitch("place", "baxter.left", "screwdriver", "table.left").action.attaches_to
    'table'
    """

    kind: str
    hand: str
    object_name: str
    table: str = ""
    giver: str = ""
    other: str = ""
    second: str = ""
    more: tuple[tuple[str, str], ...] = ()

    @staticmethod
    def of(name: str, roles: Sequence[str], arguments: Sequence[str]) -> KinematicSwitch:
        """Return the switch of an action whose arguments have these roles, in their order."""
        given = dict(zip(roles, arguments, strict=True))
        more = tuple((role, given.pop(role)) for role in roles if role not in ROLES)
        return KinematicSwitch(name, object_name=given.pop("object"), more=more, **given)

    @property
    def action(self) -> ActionKind:
        """The geometry of its kind; WorldError where none is registered."""
        kind = kind_of(self.kind)
        if kind is None:
            raise WorldError(f"unknown kind of action {self.kind!r}, expected one of {', '.join(registered_actions())}")
        return kind

    @property
    def arguments(self) -> dict[str, str]:
        """Role -> name, of all that are given."""
        known = {role: getattr(self, "object_name" if role == "object" else role) for role in ROLES}
        return {role: name for role, name in known.items() if name} | dict(self.more)

    @property
    def hands(self) -> tuple[str, ...]:
        """The hands that take part."""
        return tuple(dict.fromkeys(name for name in (self.hand, self.giver, self.second) if name))


def jaw_opening(modes: ModeSequence, hand: str, phase: int, width: float) -> float:
    """Return how far the jaws of a hand are open in a phase, 0 to 1 of their width [m].

    They are open unless the hand has an object or holds one in place; then they are as far apart as its smallest side.
    """
    objects = modes.world.scene.objects
    has = [name for name in objects if modes.attachment(name, phase).parent == hand]
    has += [
        modes.switches[k].object_name for one, k, last in modes.holding_intervals if one == hand and k < phase <= last
    ]
    has += [name for one, name, last in modes.held_at_first if one == hand and phase <= last]
    if not has or width <= 0.0:
        return 1.0
    return min(min(objects[has[0]].size) / width, 1.0)


class ModeSequence:
    """The attachment of every object in every phase of a sequence of switches, one switch per phase.

    Attributes:
        names: of the variables z, (nz,): `2.screwdriver.yaw` is set by switch 2; `lower` and `upper` are their bounds.
        held_at_first: hands that hold an object still from the initial state on: (hand, object, switch until they act).

    Raises:
        WorldError: a hand, object or table is unknown, an object is placed or handed over by a hand that does not have
            it, or objects without an assembly are screwed together.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> modes = ModeSequence(world, [KinematicSwitch("grasp", "human.right_hand", "screwdriver")])
        >>> [modes.attachment("screwdriver", phase).parent for phase in (0, 1)]
        ['table.start', 'human.right_hand']
    """

    def __init__(self, world: World, switches: Sequence[KinematicSwitch]) -> None:
        self.world, self.switches = world, tuple(switches)
        scene = world.scene
        self._attachments: dict[str, list[Attachment]] = {
            name: [fixed_in(scene.hands[item.hand], item) if item.hand else fixed_on(scene.tables[item.on], item)]
            for name, item in scene.objects.items()
        }
        self._contacts: list[Attachment | None] = []
        size = 0
        for number, switch in enumerate(self.switches):
            self._check(number, switch)
            contact = self._contact(switch, size)
            self._contacts.append(contact)
            size += 0 if contact is None else contact.size
            for name, attachments in self._attachments.items():
                moves = contact is not None and name == switch.object_name and switch.action.attaches_to
                attachments.append(contact if moves and contact is not None else attachments[-1])
        contacts = [(number, contact) for number, contact in enumerate(self._contacts) if contact is not None]
        self.lower = np.concatenate([np.zeros(0), *(contact.lower for _, contact in contacts)])
        self.upper = np.concatenate([np.zeros(0), *(contact.upper for _, contact in contacts)])
        self.names = tuple(
            f"{number}.{self.switches[number].object_name}.{name}"
            for number, contact in contacts
            for name in contact.names
        )
        holding = (atom.arguments for atom in map(parse_atom, scene.initial) if atom.predicate == "holding")
        self.held_at_first = tuple((hand, name, self._next_act(hand, 0)) for hand, name in holding)

    @property
    def size(self) -> int:
        """Number of variables nz."""
        return len(self.lower)

    @property
    def frames(self) -> tuple[str, ...]:
        """Frames whose placements the poses need: hands that take part, and what moves that has an object."""
        have = [one.parent for each in self._attachments.values() for one in each if one.base is None]
        return tuple(dict.fromkeys([*(hand for switch in self.switches for hand in switch.hands), *have]))

    def acting(self, number: int) -> tuple[str, ...]:
        """Return the frames that meet in a switch: hands that take part, and carried tables that its objects are on."""
        switch, carried = self.switches[number], self.world.scene.carried_tables
        parts = [part for part in (switch.object_name, switch.other) if part]
        on = [self.attachment(part, phase).parent for part in parts for phase in (number, number + 1)]
        return tuple(dict.fromkeys([*switch.hands, *(name for name in (*on, switch.table) if name in carried)]))

    @property
    def holding_intervals(self) -> tuple[tuple[str, int, int], ...]:
        """Hands that hold an object still: (hand, switch from which, switch until which it does not move)."""
        return tuple(
            (switch.hand, number, self._next_act(switch.hand, number + 1))
            for number, switch in enumerate(self.switches)
            if switch.action.holds_still
        )

    @property
    def second_intervals(self) -> tuple[tuple[str, int, int], ...]:
        """Second hands that stay at an object that another one took: (hand, switch from which, its next switch)."""
        return tuple(
            (switch.second, number, self._next_act(switch.second, number + 1))
            for number, switch in enumerate(self.switches)
            if switch.second and switch.action.attaches_to == "hand"
        )

    def _next_act(self, hand: str, first: int) -> int:
        """Return the first switch from a number on in which a hand takes part, the last one if there is none."""
        last = len(self.switches) - 1
        return next((k for k in range(first, last + 1) if hand in self.switches[k].hands), last)

    def attachment(self, object_name: str, phase: int) -> Attachment:
        """Return the attachment of an object in a phase, 0 to K; phase K is after the last of K actions."""
        if object_name not in self._attachments:
            raise WorldError(f"no object {object_name!r}{did_you_mean(object_name, self._attachments)}")
        if not 0 <= phase <= len(self.switches):
            raise WorldError(f"phase is {phase}, expected 0 to {len(self.switches)}")
        return self._attachments[object_name][phase]

    def contact(self, number: int) -> tuple[Attachment, Attachment] | None:
        """Return the two attachments that give the object of a switch one pose, the new one first; None without."""
        new = self._contacts[number]
        return None if new is None else (new, self.attachment(self.switches[number].object_name, number))

    def pose(self, object_name: str, phase: int, kinematics: Kinematics, z: Array) -> Pose:
        """Return the pose of an object in n slices of a phase (0 to K), with Jacobians by q and by its own variables.

        The kinematics must have `frames`; z are all variables (nz,).
        """
        attachment = self.attachment(object_name, phase)
        return attachment.pose(kinematics, z[attachment.variables])

    def pose_continuity(self, number: int, kinematics: Kinematics, z: Array) -> Feature:
        """Return the difference of the poses of an object after and before a switch, (n, 6) [m, rad], by (q, z).

        It is zero in a feasible switch. The switch must have a `contact`.

        Args:
            kinematics: of the slice in which it happens (n = 1), or of n candidates for it.
            z: (nz,).
        """
        sides = self.contact(number)
        if sides is None:
            raise WorldError(
                f"action {number} ({self.switches[number].kind}) attaches no object; give the number of one that does"
            )
        poses = [side.pose(kinematics, z[side.variables]).with_all_variables(self.size) for side in sides]
        return pose_difference(*poses)

    def screw_constraint(self, number: int) -> ScrewConstraint:
        """Return the geometry of the screw of switch `number`."""
        switch = self.switches[number]
        if not switch.action.screws:
            raise WorldError(f"action {number + 1} ({switch.kind}) is no screw; give the number of a screw")
        parts = {switch.object_name, switch.other}
        assembly = next(assembly for assembly in self.world.scene.assemblies if set(assembly.parts) == parts)
        first, second = (self.attachment(part, number) for part in assembly.parts)
        return ScrewConstraint(assembly, self.world.scene.hands[switch.hand], first, second, self.size)

    def guess(self, keyframes: Array) -> Array:
        """Return variables (nz,) with continuous poses at the keyframes (K, nq), as far as their bounds allow.

        Keyframe k is the configuration at the end of phase k.
        """
        z = np.clip(np.zeros(self.size), self.lower, self.upper)
        kinematics = self.world.at(keyframes, self.frames)
        for number in range(len(self.switches)):
            sides = self.contact(number)
            if sides is not None:
                after, before = sides
                pose = before.pose(kinematics, z[before.variables])
                z[after.variables] = after.fit(kinematics, pose.rotation[number], pose.position[number], number)
        return z

    def _contact(self, switch: KinematicSwitch, first_variable: int) -> Attachment | None:
        """Return the hand or table that touches the object of a switch from then on; None if no contact is new."""
        scene = self.world.scene
        item = scene.objects[switch.object_name]
        if switch.action.contact == "hand":
            return held(scene.hands[switch.hand], item, first_variable)
        return placed(scene.tables[switch.table], item, first_variable) if switch.action.contact == "table" else None

    def _check(self, number: int, switch: KinematicSwitch) -> None:
        scene = self.world.scene
        if kind_of(switch.kind) is None:
            known_kinds = ", ".join(registered_actions())
            raise WorldError(f"action {number + 1}: unknown kind {switch.kind!r}, expected one of {known_kinds}")
        objects = dict.fromkeys(("object", "other"), scene.objects)
        anything = {**scene.hands, **scene.objects, **scene.tables}
        hands = dict.fromkeys(("hand", "giver", "second"), scene.hands)
        for role in switch.action.roles:
            known = {"table": scene.tables, **objects, **hands}.get(role, anything)
            name = switch.arguments.get(role, "")
            if name not in known:
                hint = did_you_mean(name, known) or f"; known are {', '.join(known)}"
                what = "object" if role in objects else role
                raise WorldError(f"action {number + 1} ({switch.kind}): unknown {what} {name!r}{hint}")
        action, parent = switch.action, self._attachments[switch.object_name][number].parent
        giver = switch.arguments[action.given_by] if action.given_by else parent
        if parent != giver:
            raise WorldError(
                f"action {number + 1}: {giver} {action.verb} {switch.object_name}, attached to {parent}; grasp it first"
            )
        parts = {switch.object_name, switch.other}
        if action.screws and parts not in [set(assembly.parts) for assembly in scene.assemblies]:
            raise WorldError(
                f"action {number + 1}: {switch.object_name} and {switch.other} have no assembly; "
                "add one to the scene's [[joints]]"
            )
