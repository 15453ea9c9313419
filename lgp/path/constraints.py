"""The constraints of a sequence on some kept slices: values, Jacobians, curvature, and what each row is about.

Equalities: no object jumps at a switch, screws go in where parts are joined, the limbs that take part rest there, hands
that hold stand still, planted soles stay. Inequalities: a hand that works on a table is not tilted too far, no leg is
stretched beyond its length, bodies stay apart. Joint limits and borders of table tops are bounds of the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from lgp.path.blocks import RowBlocks
from lgp.path.collision_rows import CollisionRows
from lgp.path.legs import Legs
from lgp.path.phases import Phases
from lgp.path.switch_rows import Blocks, Row, SwitchRows
from lgp.path.ties import ties
from lgp.world import features
from lgp.world.features import Feature
from lgp.world.model import Kinematics, World
from lgp.world.switches import Modes

Array = NDArray[np.float64]
Slices = NDArray[np.intp]


@dataclass(frozen=True)
class Values:
    """Values of all rows, and the blocks of their Jacobians in the order of the rows; and the slice of each switch."""

    equality: Array
    inequality: Array
    eq_blocks: list[Array]
    in_blocks: list[Array]
    kinematics: dict[int, Kinematics]


class Constraints:
    """The rows of some switches and slices; unknowns are the kept configurations (P, nq) and the variables z.

    Args:
        world: the kinematics.
        phases: the sequence.
        modes: its attachments.
        kept: (P,) slices that are unknowns.
        enforced: numbers of the switches whose rows are kept; their slices must be.
        apart: rows that keep bodies apart, where all slices are kept; they must not change afterwards.
    """

    def __init__(
        self,
        world: World,
        phases: Phases,
        modes: Modes,
        kept: Slices,
        enforced: tuple[int, ...],
        apart: CollisionRows | None = None,
    ) -> None:
        self.world, self.phases, self.modes = world, phases, modes
        self.enforced = enforced
        self.size = len(kept) * world.nq + modes.size
        place = {int(slice_): at for at, slice_ in enumerate(kept)}
        at = {number: place[int(phases.keys[number])] for number in enforced}
        self._switches = SwitchRows(world, phases, modes, at, len(kept) * world.nq)
        equal, self.tied = ties(world, phases, modes, {number: self.limb(number) for number in enforced}, kept)
        self._rests = [
            (place[first] * world.nq + joints, place[second] * world.nq + joints)
            for (first, second), joints in equal.items()
        ]
        self._soles = tuple(world.planted)
        human = world.scene.human
        self._legs = Legs(world) if human is not None and human.legs == "solved" else None
        self._apart = apart
        self._lay_out(len(kept))

    def limb(self, number: int) -> Slices:
        """Return the columns of q that move the hands of a switch."""
        return self._switches.limb(number)

    def _lay_out(self, kept: int) -> None:
        """Work out the columns and the meaning of every row."""
        nq = self.world.nq
        eq: Blocks = [*self._switches.eq]
        ineq: Blocks = [*self._switches.ineq]
        self.eq_rows = [*self._switches.eq_rows]
        self.in_rows = [*self._switches.in_rows]
        for first, second in self._rests:
            eq += [(1, np.array(pair)) for pair in zip(first, second, strict=True)]
            self.eq_rows += [
                Row("rest", "rad", int(joint) // nq, self.world.joints[int(joint) % nq]) for joint in first
            ]
        for sole in self._soles:
            columns = np.flatnonzero(self.world.support(sole))
            eq += [(6, at * nq + columns) for at in range(kept)]
            self.eq_rows += [Row("sole", unit, at, sole) for at in range(kept) for unit in ["m"] * 3 + ["rad"] * 3]
        if self._legs is not None:
            self._first_leg = len(self.in_rows)
            ineq += [(1, at * nq + self._legs.columns) for at in range(kept)]
            self.in_rows += [Row("leg", "m", at, "straighter") for at in range(kept)]
        if self._apart is not None:
            ineq += self._apart.blocks(kept * nq)
            self.in_rows += self._apart.names()
        self._eq, self._in = RowBlocks(eq, self.size), RowBlocks(ineq, self.size)

    def evaluate(self, q: Array, z: Array) -> Values:
        """Return all rows at configurations (P, nq) and variables (nz,)."""
        flat, found = q.ravel(), self._switches.evaluate(q, z)
        equality, inequality = [np.zeros(0), *found.equality], [np.zeros(0), *found.inequality]
        eq_blocks, in_blocks = found.eq_blocks, found.in_blocks
        for first, second in self._rests:
            equality.append(flat[second] - flat[first])
            eq_blocks.append(np.tile([-1.0, 1.0], len(first)))
        self._add_soles(q, equality, eq_blocks)
        if self._legs is not None:
            beyond, slopes = self._legs.evaluate(q)
            inequality.append(beyond)
            in_blocks.append(slopes)
        if self._apart is not None:
            value, blocks = self._apart.evaluate(q, z)
            inequality.append(value)
            in_blocks += blocks
        return Values(np.concatenate(equality), np.concatenate(inequality), eq_blocks, in_blocks, found.kinematics)

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
        """Return the unknowns of each block of `bends`, then of `press`."""
        nq, tail = self.world.nq, self.size - self.modes.size
        found = self._switches.curved()
        if self._legs is not None:
            found.append(np.arange(tail // nq)[:, None] * nq + self._legs.columns)
        return found

    def bending(self) -> list[Slices]:
        """Return the unknowns of each block of rows that `bends` is about: the first blocks of the equalities."""
        return [columns for _, columns in self._switches.eq]

    def press(self, q: Array, y: Array) -> list[Array]:
        """Return the convex part of sum_i y_i d2 row_i (P, p, p) of the legs, [] where no legs are solved."""
        if self._legs is None:
            return []
        pressed = y[self._first_leg : self._first_leg + len(q)]
        return [pressed[:, None, None] * self._legs.curvature(q)]

    def bends(self, values: Values, z: Array, y: Array) -> list[Array]:
        """Return for each hand at a switch sum_i y_i d2 row_i by its unknowns in `curved`, (m, m), at some values."""
        return self._switches.bends(values.kinematics, z, y)
