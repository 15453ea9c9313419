"""The constraints of a sequence on some kept slices: values, Jacobians, curvature, and what each row is about.

Equalities: no object jumps at a switch, screws go in where parts are joined, the limbs that take part rest there, hands
that hold stand still, planted soles stay. Inequalities: a hand that works on a table is not tilted too far, no leg is
stretched beyond its length, bodies stay apart. Joint limits and borders of table tops are bounds of the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from lgp.kinematics import features
from lgp.kinematics.features import Feature
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.posture import PELVIS, PostureMap
from lgp.kinematics.world import Kinematics, World
from lgp.path.collision_constraints import CollisionRows
from lgp.path.hessian import RowBlocks
from lgp.path.mode_constraints import Blocks, ConstraintInfo, ModeConstraints
from lgp.path.phases import Phases
from lgp.scene.body_measures import lengths
from reba.arrays import Array, Indices


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
        modes: ModeSequence,
        kept: Indices,
        enforced: tuple[int, ...],
        apart: CollisionRows | None = None,
    ) -> None:
        self.world, self.phases, self.modes = world, phases, modes
        self.enforced = enforced
        self.size = len(kept) * world.nq + modes.size
        place = {int(slice_): at for at, slice_ in enumerate(kept)}
        at = {number: place[int(phases.keys[number])] for number in enforced}
        self._switches = ModeConstraints(world, phases, modes, at, len(kept) * world.nq)
        equal, self.tied = equal_joint_constraints(
            world, phases, modes, {number: self.limb(number) for number in enforced}, kept
        )
        self._rests = [
            (place[first] * world.nq + joints, place[second] * world.nq + joints)
            for (first, second), joints in equal.items()
        ]
        self._soles = tuple(world.planted)
        human = world.scene.human
        self._legs = LegReachConstraint(world) if human is not None and human.legs == "solved" else None
        self._apart = apart
        self._lay_out(len(kept))

    def limb(self, number: int) -> Indices:
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
                ConstraintInfo("rest", "rad", int(joint) // nq, self.world.joints[int(joint) % nq]) for joint in first
            ]
        for sole in self._soles:
            columns = np.flatnonzero(self.world.support(sole))
            eq += [(6, at * nq + columns) for at in range(kept)]
            self.eq_rows += [
                ConstraintInfo("sole", unit, at, sole) for at in range(kept) for unit in ["m"] * 3 + ["rad"] * 3
            ]
        if self._legs is not None:
            self._first_leg = len(self.in_rows)
            ineq += [(1, at * nq + self._legs.columns) for at in range(kept)]
            self.in_rows += [ConstraintInfo("leg", "m", at, "straighter") for at in range(kept)]
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
            there: Feature = features.pose(kinematics.placement(sole), *self.world.planted[sole])
            equality.append(there.value.ravel())
            blocks.append(there.jacobian[:, :, np.flatnonzero(self.world.support(sole))])

    def curved(self) -> list[Indices]:
        """Return the unknowns of each block of `bends`, then of `press`."""
        nq, tail = self.world.nq, self.size - self.modes.size
        found = self._switches.curved()
        if self._legs is not None:
            found.append(np.arange(tail // nq)[:, None] * nq + self._legs.columns)
        return found

    def bending(self) -> list[Indices]:
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


Pair = tuple[int, int]


def equal_joint_constraints(
    world: World, phases: Phases, modes: ModeSequence, limbs: dict[int, Indices], kept: Indices
) -> tuple[dict[Pair, Indices], dict[Pair, Indices]]:
    """Return pairs of slices (first, second) -> joints that are equal in both: pairs of kept slices, and others.

    In every other pair the first slice is kept and the second is not.

    Args:
        world: the kinematics.
        phases: the sequence.
        modes: its attachments.
        limbs: switch whose rows are kept -> joints that rest after it.
        kept: (P,) slices that are unknowns, rising.
    """
    known = {int(slice_) for slice_ in kept}
    horizon = int(kept[-1]) + 1
    joints: dict[Pair, set[int]] = {}
    for number, limb in limbs.items():
        key = int(phases.keys[number])
        if key + 1 < horizon:
            joints.setdefault((key, key + 1), set()).update(limb.tolist())
    for hand, number, end in modes.holding_intervals:
        if number not in limbs:
            continue
        standing = np.flatnonzero(world.support(hand)).tolist()
        first = int(phases.keys[number])
        for second in range(first + 1, min(int(phases.keys[end]) + 1, horizon)):
            joints.setdefault((first, second), set()).update(standing)
            first = second if second in known else first
    found: tuple[dict[Pair, Indices], dict[Pair, Indices]] = {}, {}
    for pair in sorted(joints):
        found[pair[1] not in known][pair] = np.array(sorted(joints[pair]), dtype=np.intp)
    return found


BLEND = 1e-4
"""[m] eps: both legs count where they differ by less; 0.07 mm of reach are given away."""


class LegReachConstraint:
    """The row of a human whose legs are solved for.

    Attributes:
        columns: columns of q that it depends on, (p,): those of the pelvis that move.

    Example:
        >>> value, slope = Legs(world).evaluate(world.initial_configuration[None])            # doctest: +SKIP
    """

    def __init__(self, world: World) -> None:
        self.posture = PostureMap(world)
        moving = [(world.column[f"human.{name}"], name) for name in PELVIS if f"human.{name}" in world.column]
        self.columns = np.array(sorted(column for column, _ in moving), dtype=np.intp)
        self._names = [name for _, name in sorted(moving)]
        self._own = np.searchsorted(self.posture.columns, self.columns)
        measures = lengths(self.posture.body.stature, self.posture.body.sex)
        self._longest = measures["thigh"] + measures["shank"]
        self._out = measures["half_hips"] * np.array([-1.0, 1.0])
        self._yaw = world.column.get("human.pelvis_yaw")

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return by how much [m] the legs are too short (n,), not above 0 where both reach, and its slope (n, p)."""
        beyond, slopes, shares = self._sides(q)
        longer = beyond.max(axis=1)
        value = longer + BLEND * np.log(np.exp((beyond - longer[:, None]) / BLEND).sum(axis=1))
        return value, np.einsum("ns,nsp->np", shares, slopes)

    def curvature(self, q: Array) -> Array:
        """Return the convex part of the second derivative (n, p, p)."""
        _, slopes, shares = self._sides(q)
        apart = slopes[:, 0] - slopes[:, 1]
        bend = (shares.prod(axis=1) / BLEND)[:, None, None] * apart[:, :, None] * apart[:, None, :]
        return bend

    def _sides(self, q: Array) -> tuple[Array, Array, Array]:
        """Return how far each leg is stretched too far (n, 2), the slopes (n, 2, p), and its share in the maximum."""
        beyond, by_human = self.posture.leg_shortfall(q)
        weights = np.exp((beyond - beyond.max(axis=1, keepdims=True)) / BLEND)
        return beyond, by_human[:, :, self._own], weights / weights.sum(axis=1, keepdims=True)

    def _moved(self, yaw: Array, out: float) -> Array:
        """Return how a hip moves by the columns, (n, 3, p)."""
        moved = np.zeros((len(yaw), 3, len(self._names)))
        for at, name in enumerate(self._names):
            if name in PELVIS[:3]:
                moved[:, PELVIS.index(name), at] = 1.0
            elif name == "pelvis_yaw":
                moved[:, 0, at], moved[:, 1, at] = out * np.cos(yaw), out * np.sin(yaw)
        return moved
