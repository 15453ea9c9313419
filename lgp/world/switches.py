"""Kinematic switches: to what each object is attached in each phase, and its pose through the kinematic tree.

Action k ends phase k (counted from 0): a grasp attaches an object to a hand, a place to a table, without a jump of its
pose. How it lies in the hand or on the table is a few variables, shared by all slices of that stretch; `z` holds them
for the whole sequence. A pose depends on the configuration of its own slice and on the variables of its own stretch, so
constraints stay local.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lgp.errors import WorldError, did_you_mean
from lgp.world.features import Feature, pose_difference
from lgp.world.holders import Holder, Pose, fixed_on, held, placed
from lgp.world.model import Kinematics, World

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Switch:
    """One action as geometry: `hand` grasps `thing`, or places it on `table`.

    >>> Switch("place", "baxter.left", "screwdriver", "table.left").table
    'table.left'
    """

    kind: str
    hand: str
    thing: str
    table: str = ""


class Modes:
    """The attachments of every object over a sequence of switches.

    Attributes:
        world: whose hands, tables and objects they are.
        switches: one per phase.
        lower, upper: bounds of z, (nz,).
        names: of the variables, (nz,).

    Raises:
        WorldError: a hand, object or table is unknown, or an object is placed by a hand that does not hold it.

    Example:
        >>> modes = Modes(world, [Switch("grasp", "baxter.right", "screwdriver")])      # doctest: +SKIP
        >>> modes.pose("screwdriver", 1, world.at(q, modes.frames), modes.first)        # doctest: +SKIP
    """

    def __init__(self, world: World, switches: Sequence[Switch]) -> None:
        self.world, self.switches = world, tuple(switches)
        scene = world.scene
        self._held_by: dict[str, list[Holder]] = {
            name: [fixed_on(scene.tables[thing.on], thing)] for name, thing in scene.things.items()
        }
        size = 0
        for number, switch in enumerate(self.switches):
            self._check(number, switch)
            for name, holders in self._held_by.items():
                holders.append(holders[-1] if name != switch.thing else self._next(switch, size))
            size += self._held_by[switch.thing][-1].size
        new = [self._held_by[switch.thing][number + 1] for number, switch in enumerate(self.switches)]
        self.lower = np.concatenate([np.zeros(0), *(holder.lower for holder in new)])
        self.upper = np.concatenate([np.zeros(0), *(holder.upper for holder in new)])
        self.names = tuple(
            f"{number}.{switch.thing}.{name}"
            for number, (switch, holder) in enumerate(zip(self.switches, new, strict=True))
            for name in holder.names
        )

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.lower)

    @property
    def frames(self) -> tuple[str, ...]:
        """Frames whose placements the poses need: the hands that take part."""
        return tuple(dict.fromkeys(switch.hand for switch in self.switches))

    def holder(self, thing: str, phase: int) -> Holder:
        """Return what holds an object during a phase; phase K is after the last of K actions.

        Raises:
            WorldError: there is no such object or phase.
        """
        if thing not in self._held_by:
            raise WorldError(f"no object {thing!r}{did_you_mean(thing, self._held_by)}")
        if not 0 <= phase <= len(self.switches):
            raise WorldError(f"phase {phase} is outside 0 to {len(self.switches)}")
        return self._held_by[thing][phase]

    def pose(self, thing: str, phase: int, kinematics: Kinematics, z: Array) -> Pose:
        """Return the pose of an object in n slices of a phase, with Jacobians by q and by the variables of its holder.

        Args:
            thing: name of the object.
            phase: 0 to K.
            kinematics: of n slices, holding `frames`.
            z: (nz,) all variables.
        """
        holder = self.holder(thing, phase)
        return holder.pose(kinematics, z[holder.variables])

    def jump(self, number: int, kinematics: Kinematics, z: Array) -> Feature:
        """Return by how much the object of a switch would jump, (n, 6) [m, rad], and its Jacobian by (q, z).

        Args:
            number: of the switch.
            kinematics: of the slice in which it happens (n = 1), or of n candidates for it.
            z: (nz,).
        """
        thing = self.switches[number].thing
        sides = [
            self.holder(thing, number + after).pose(kinematics, z[self.holder(thing, number + after).variables])
            for after in (1, 0)
        ]
        return pose_difference(*(side.spread(self.size) for side in sides))

    def guess(self, keys: Array) -> Array:
        """Return variables (nz,) that fit key configurations: no jump as far as each stretch has the freedom for it.

        Args:
            keys: (K, nq), the configuration at the end of each phase.
        """
        z = np.clip(np.zeros(self.size), self.lower, self.upper)
        kinematics = self.world.at(keys, self.frames)
        for number, switch in enumerate(self.switches):
            before = self.holder(switch.thing, number).pose(kinematics, z[self.holder(switch.thing, number).variables])
            after = self.holder(switch.thing, number + 1)
            z[after.variables] = after.fit(kinematics, before.rotation[number], before.position[number], number)
        return z

    def _next(self, switch: Switch, start: int) -> Holder:
        scene = self.world.scene
        thing = scene.things[switch.thing]
        if switch.kind == "grasp":
            return held(scene.hands[switch.hand], thing, start)
        return placed(scene.tables[switch.table], thing, start)

    def _check(self, number: int, switch: Switch) -> None:
        scene = self.world.scene
        wanted = {"grasp": ("hand", "thing"), "place": ("hand", "thing", "table")}
        if switch.kind not in wanted:
            raise WorldError(f"action {number}: unknown kind {switch.kind!r}, expected grasp or place")
        for field in wanted[switch.kind]:
            known = {"hand": scene.hands, "thing": scene.things, "table": scene.tables}[field]
            name = getattr(switch, field)
            if name not in known:
                hint = did_you_mean(name, known) or f"; known are {', '.join(known)}"
                raise WorldError(f"action {number} ({switch.kind}): unknown {field} {name!r}{hint}")
        holder = self._held_by[switch.thing][number]
        if switch.kind == "place" and holder.by != switch.hand:
            raise WorldError(
                f"action {number}: {switch.hand} places {switch.thing}, which is held by {holder.by}; grasp it first"
            )
