"""The constraints of a sequence on some kept slices: values, Jacobians, curvature, and what each row is about.

Equalities: no object jumps at a switch, the limb that takes part rests there, planted soles stay. Inequalities: a hand
that works on a table is not tilted too far, no leg is stretched beyond its length. Joint limits and the borders of the
table tops are bounds of the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from lgp.path.blocks import RowBlocks
from lgp.path.phases import Phases
from lgp.world import features
from lgp.world.features import Feature
from lgp.world.model import World
from lgp.world.posture import PELVIS, PostureMap
from lgp.world.switches import Modes

Array = NDArray[np.float64]
Slices = NDArray[np.intp]


@dataclass(frozen=True)
class Row:
    """What one row is about: kind "jump", "rest", "sole", "tilt" or "leg", its unit, and the switch or slice.

    A tilt is a difference of cosines, which has no unit.
    """

    kind: str
    unit: str
    number: int
    name: str


@dataclass(frozen=True)
class Values:
    """Values of all rows, and the blocks of their Jacobians in the order of the rows."""

    equality: Array
    inequality: Array
    eq_blocks: list[Array]
    in_blocks: list[Array]


class Constraints:
    """The rows of some switches and slices; unknowns are the kept configurations (P, nq) and the variables z.

    Args:
        world: the kinematics.
        phases: the sequence.
        modes: its attachments.
        kept: (P,) slices that are unknowns.
        enforced: numbers of the switches whose rows are kept; their slices must be.
    """

    def __init__(self, world: World, phases: Phases, modes: Modes, kept: Slices, enforced: tuple[int, ...]) -> None:
        self.world, self.phases, self.modes = world, phases, modes
        self.enforced = enforced
        self.size = len(kept) * world.nq + modes.size
        self._place = {int(slice_): at for at, slice_ in enumerate(kept)}
        self._at = [self._place[int(phases.keys[number])] for number in enforced]
        self._limbs = [self.limb(number) for number in range(phases.count)]
        self._tilted = [
            (number, at)
            for number, at in zip(enforced, self._at, strict=True)
            if world.scene.hands[phases.switches[number].hand].tilt < 180.0
        ]
        self._soles = tuple(world.planted)
        human = world.scene.human
        self._legs = PostureMap(world) if human is not None and human.legs == "solved" else None
        self._lay_out(len(kept))

    def limb(self, number: int) -> Slices:
        """Return the columns of q that move the hand of a switch."""
        return np.flatnonzero(self.world.support(self.phases.switches[number].hand))

    def _lay_out(self, kept: int) -> None:
        """Work out the columns and the meaning of every row."""
        nq, tail = self.world.nq, kept * self.world.nq
        eq: list[tuple[int, Slices]] = []
        ineq: list[tuple[int, Slices]] = []
        self.eq_rows: list[Row] = []
        self.in_rows: list[Row] = []
        self._z = []
        for number, at in zip(self.enforced, self._at, strict=True):
            switch = self.phases.switches[number]
            held = [self.modes.holder(switch.thing, number + after).variables for after in (0, 1)]
            own = np.unique(np.concatenate([np.arange(part.start, part.stop) for part in held])).astype(np.intp)
            self._z.append(own)
            eq.append((6, np.concatenate([at * nq + self._limbs[number], tail + own])))
            units = ["m"] * 3 + ["rad"] * 3
            self.eq_rows += [Row("jump", unit, number, switch.thing) for unit in units]
        self._rests = self._rest_rows(eq)
        for sole in self._soles:
            columns = np.flatnonzero(self.world.support(sole))
            eq += [(6, at * nq + columns) for at in range(kept)]
            self.eq_rows += [Row("sole", unit, at, sole) for at in range(kept) for unit in ["m"] * 3 + ["rad"] * 3]
        for number, at in self._tilted:
            ineq.append((1, at * nq + self._limbs[number]))
            self.in_rows.append(Row("tilt", "", number, self.phases.switches[number].hand))
        if self._legs is not None:
            self._pelvis = np.array(
                [self.world.column[f"human.{n}"] for n in PELVIS if f"human.{n}" in self.world.column]
            )
            self._pelvis.sort()
            ineq += [(2, at * nq + self._pelvis) for at in range(kept)]
            self.in_rows += [Row("leg", "m", at, side) for at in range(kept) for side in ("left", "right")]
        self._eq, self._in = RowBlocks(eq, self.size), RowBlocks(ineq, self.size)

    def _rest_rows(self, eq: list[tuple[int, Slices]]) -> list[tuple[Slices, Slices]]:
        """Add one row a joint where a switch is followed by a kept slice; return (first, second) unknowns."""
        nq, found = self.world.nq, []
        for number, at in zip(self.enforced, self._at, strict=True):
            after = self._place.get(int(self.phases.keys[number]) + 1)
            if after is None:
                continue
            first, second = at * nq + self._limbs[number], after * nq + self._limbs[number]
            eq += [(1, np.array(pair)) for pair in zip(first, second, strict=True)]
            self.eq_rows += [Row("rest", "rad", number, self.world.joints[joint]) for joint in self._limbs[number]]
            found.append((first, second))
        return found

    def evaluate(self, q: Array, z: Array) -> Values:
        """Return all rows at configurations (P, nq) and variables (nz,)."""
        equality, inequality = [np.zeros(0)], [np.zeros(0)]
        eq_blocks: list[Array] = []
        in_blocks: list[Array] = []
        flat, nq = q.ravel(), self.world.nq
        tilted = dict(self._tilted)
        for number, at, own in zip(self.enforced, self._at, self._z, strict=True):
            hand = self.phases.switches[number].hand
            kinematics = self.world.at(q[at : at + 1], [hand])
            jump = self.modes.jump(number, kinematics, z)
            equality.append(jump.value[0])
            eq_blocks.append(jump.jacobian[0][:, np.concatenate([self._limbs[number], nq + own])])
            if number in tilted:
                tilt = features.tilt(kinematics.place(hand), self.world.scene.hands[hand].tilt)
                inequality.append(tilt.value[0])
                in_blocks.append(tilt.jacobian[0][:, self._limbs[number]])
        for first, second in self._rests:
            equality.append(flat[second] - flat[first])
            eq_blocks.append(np.tile([-1.0, 1.0], len(first)))
        self._add_soles(q, equality, eq_blocks)
        if self._legs is not None:
            beyond, by_human = self._legs.reach(q)
            inequality.append(beyond.ravel())
            in_blocks.append(by_human[:, :, np.searchsorted(self._legs.columns, self._pelvis)])
        return Values(np.concatenate(equality), np.concatenate(inequality), eq_blocks, in_blocks)

    def jacobians(self, values: Values) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """Return the two sparse Jacobians of evaluated rows; the next call reuses them."""
        return self._eq.fill(values.eq_blocks), self._in.fill(values.in_blocks)

    def residuals(self, q: Array, z: Array) -> dict[str, float]:
        """Return the largest violations: equality, inequality, and all of them by unit (metres, radians)."""
        values = self.evaluate(q, z)
        found = {"equality": float(np.abs(values.equality).max(initial=0.0))}
        found["inequality"] = float(values.inequality.max(initial=0.0))
        rows = [*self.eq_rows, *self.in_rows]
        broken = np.concatenate([np.abs(values.equality), np.maximum(values.inequality, 0.0)])
        for name, unit in (("metres", "m"), ("radians", "rad")):
            found[name] = float(broken[[row.unit == unit for row in rows]].max(initial=0.0))
        return found

    def _add_soles(self, q: Array, equality: list[Array], blocks: list[Array]) -> None:
        if not self._soles:
            return
        kinematics = self.world.at(q, self._soles)
        for sole in self._soles:
            there: Feature = features.pose(kinematics.place(sole), *self.world.planted[sole])
            equality.append(there.value.ravel())
            blocks.append(there.jacobian[:, :, np.flatnonzero(self.world.support(sole))])

    def curved(self) -> list[Slices]:
        """Return the unknowns of each block that `curvature` gives: the limb at each switch, how the hand holds."""
        nq, tail = self.world.nq, self.size - self.modes.size
        found = []
        for number, at in zip(self.enforced, self._at, strict=True):
            grip = self._grip(number)
            found.append(np.concatenate([at * nq + self._limbs[number], tail + np.arange(grip.start, grip.stop)]))
        return found

    def _grip(self, number: int) -> slice:
        """Return the variables that say how the hand of a switch holds the object."""
        switch = self.phases.switches[number]
        return self.modes.holder(switch.thing, number + (switch.kind == "grasp")).variables

    def curvature(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return the convex part of each of `bends`: its negative eigenvalues are left out."""
        blocks = []
        for bend in self.bends(q, z, y):
            values, vectors = np.linalg.eigh(bend)
            blocks.append((vectors * np.maximum(values, 0.0)) @ vectors.T)
        return blocks

    def bends(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return for each switch sum_i y_i d2 row_i by the unknowns of `curved`, (m, m).

        Near a met constraint the rotation vector of a chain has the mixed second derivative (omega_a x omega_b) / 2.
        How the hand holds the object acts like joints after the last one.
        """
        found = []
        for order, (number, at) in enumerate(zip(self.enforced, self._at, strict=True)):
            switch = self.phases.switches[number]
            weights = y[6 * order : 6 * order + 6] * (1.0 if switch.kind == "grasp" else -1.0)
            kinematics = self.world.at(q[at : at + 1], [switch.hand])
            holder = self.modes.holder(switch.thing, number + (switch.kind == "grasp"))
            held = holder.pose(kinematics, z[holder.variables])
            limb = len(self._limbs[number])
            jacobian = np.concatenate([held.by_q[:, :, self._limbs[number]], held.by_variables], axis=2)
            turn = held.rotation[0] @ weights[3:]
            bend = features.position_curvature(jacobian, weights[None, :3])[0]
            angular = jacobian[0, 3:]
            twist = np.triu(np.cross(turn[:, None], angular, axis=0).T @ angular, 1)
            # The grip is a rotation vector itself: its parts do not come one after the other.
            twist[limb:, limb:] = 0.0
            bend += 0.5 * (twist + twist.T)
            found.append(bend)
        return found
