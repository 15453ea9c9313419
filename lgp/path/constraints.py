"""The constraints of a sequence at some knots: values, Jacobians, curvature, and what each row is about.

Equalities: pose continuity of objects at switches, screws at their place in joined parts, limbs at rest at their
switches, holding hands and planted soles at rest. Inequalities: tilt of hands that work on tables, leg reach, and what
becomes active in a path: distances of bodies, limits of joints and leg reach between slices. Actions may bring both.
Joint limits and borders of table tops are bounds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from lgp.collision.contacts import draw_back_slices
from lgp.kinematics import features
from lgp.kinematics.features import Feature
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.planar_joints import BASE
from lgp.kinematics.world import World
from lgp.path.action_constraints import ActionConstraints
from lgp.path.active_constraints import ActiveConstraints
from lgp.path.hessian import RowBlocks
from lgp.path.leg_reach import LegReachConstraint
from lgp.path.mode_constraints import Blocks, ConstraintInfo, ModeConstraints, SwitchValues
from lgp.path.phases import Phases
from lgp.scene.mobile_base import standing_from
from reba.arrays import Array, Indices


@dataclass(frozen=True)
class Values:
    """Values (m,) and Jacobian blocks of all rows, in their order; of B points (B, m) and (B, rows, columns).

    Without the Jacobian blocks of the active rows, which few of the points need that a line search tries.
    """

    equality: Array
    inequality: Array
    eq_blocks: list[Array]
    in_blocks: list[Array]
    switches: SwitchValues


class Constraints:
    """The rows of some switches and knots; unknowns are the configurations (P, nq) and the variables z (nz,).

    Args:
        modes: attachments of the sequence.
        knots: (P,) slices that are unknowns.
        enforced: numbers of the switches whose rows are enforced; their slices must be knots.
        active: of a path on all slices; they must not change afterwards.

    Attributes:
        always: number of inequalities before the active ones, which come last.
    """

    def __init__(
        self,
        world: World,
        phases: Phases,
        modes: ModeSequence,
        knots: Indices,
        enforced: tuple[int, ...],
        active: ActiveConstraints | None = None,
    ) -> None:
        self.world, self.phases, self.modes = world, phases, modes
        self.enforced = enforced
        self.size = len(knots) * world.nq + modes.size
        place = {int(slice_): at for at, slice_ in enumerate(knots)}
        at = {number: place[int(phases.keyframes[number])] for number in enforced}
        self._own = ActionConstraints(phases, modes, knots, enforced)
        joints = {number: self._own.joints(number) for number in enforced}
        self._switches = ModeConstraints(world, phases, modes, at, len(knots) * world.nq, joints)
        equal, self.equal_eliminated = equal_joint_constraints(
            world, phases, modes, {number: self.limb(number) for number in enforced}, knots
        )
        self._rests = [
            (place[first] * world.nq + joints, place[second] * world.nq + joints)
            for (first, second), joints in equal.items()
        ]
        self._soles = tuple(world.planted)
        people = world.scene.humans.values()
        self._legs = tuple(LegReachConstraint(world, person) for person in people if person.legs == "solved")
        self.active = active
        self._set_rows(len(knots))

    def limb(self, number: int) -> Indices:
        """Return the columns of q that move the hands of a switch, and what its own constraints are about."""
        return self._switches.limb(number)

    def _set_rows(self, knots: int) -> None:
        """Set the columns and the meaning of every row."""
        world, nq = self.world, self.world.nq
        eq: Blocks = [*self._switches.eq, *self._own.eq]
        ineq: Blocks = [*self._switches.ineq, *self._own.ineq]
        self.eq_rows = [*self._switches.eq_rows, *self._own.eq_rows]
        self.in_rows = [*self._switches.in_rows, *self._own.in_rows]
        for first, second in self._rests:
            eq += [(1, np.array(pair)) for pair in zip(first, second, strict=True)]
            self.eq_rows += [
                ConstraintInfo("rest", world.units[name].si, int(joint) // nq, name)
                for joint in first
                for name in [world.joints[int(joint) % nq]]
            ]
        for sole in self._soles:
            columns = np.flatnonzero(self.world.support(sole))
            eq += [(6, at * nq + columns) for at in range(knots)]
            self.eq_rows += [
                ConstraintInfo("sole", unit, at, sole) for at in range(knots) for unit in ["m"] * 3 + ["rad"] * 3
            ]
        self._first_leg = len(self.in_rows)
        for legs in self._legs:
            ineq += [(1, at * nq + legs.columns) for at in range(knots)]
            self.in_rows += [ConstraintInfo("leg", "m", at, legs.person) for at in range(knots)]
        self.always = len(self.in_rows)
        if self.active is not None:
            ineq += self.active.blocks(knots * nq)
            self.in_rows += self.active.names()
        self.row_blocks = self._eq, self._in = RowBlocks(eq, self.size), RowBlocks(ineq, self.size)

    def evaluate(self, q: Array, z: Array) -> Values:
        """Return all rows at configurations (P, nq) and variables (nz,)."""
        values = self.evaluate_many(q[None], z[None])
        equality, inequality = values.equality[0], values.inequality[0]
        eq_blocks, in_blocks = ([block[0] for block in blocks] for blocks in (values.eq_blocks, values.in_blocks))
        if self.active is not None:
            inequality = np.concatenate([inequality, self.active.evaluate(q, z)])
        return Values(equality, inequality, eq_blocks, in_blocks, values.switches)

    def evaluate_many(self, q: Array, z: Array) -> Values:
        """Return all rows but the active ones at B configurations (B, P, nq) and variables (B, nz)."""
        count = len(q)
        flat, switches = q.reshape(count, -1), self._switches.evaluate(q, z)
        own = self._own.evaluate(q, z)
        equality = [np.zeros((count, 0)), *switches.equality, *own[0]]
        inequality = [np.zeros((count, 0)), *switches.inequality, *own[2]]
        eq_blocks, in_blocks = [*switches.eq_blocks, *own[1]], [*switches.in_blocks, *own[3]]
        for first, second in self._rests:
            equality.append(flat[:, second] - flat[:, first])
            eq_blocks.append(np.tile([-1.0, 1.0], (count, len(first))))
        self._add_soles(q, equality, eq_blocks)
        for legs in self._legs:
            excess, gradient = legs.evaluate(q.reshape(-1, q.shape[2]))
            inequality.append(excess.reshape(count, -1))
            in_blocks.append(gradient.reshape(count, -1))
        return Values(
            np.concatenate(equality, axis=1), np.concatenate(inequality, axis=1), eq_blocks, in_blocks, switches
        )

    def jacobians(self, values: Values, q: Array, z: Array) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """Return the two sparse Jacobians of rows evaluated at (q, z); the next call reuses them."""
        active = [] if self.active is None else self.active.gradients(q, z)
        return self._eq.fill(values.eq_blocks), self._in.fill([*values.in_blocks, *active])

    def residuals(self, q: Array, z: Array) -> dict[str, float]:
        """Return the largest violations: equality, inequality, and all of them by unit (metres, radians)."""
        values = self.evaluate(q, z)
        largest = {"equality": float(np.abs(values.equality).max(initial=0.0))}
        largest["inequality"] = float(values.inequality.max(initial=0.0))
        rows = [*self.eq_rows, *self.in_rows]
        violations = np.concatenate([np.abs(values.equality), np.maximum(values.inequality, 0.0)])
        for name, unit in (("metres", "m"), ("radians", "rad")):
            largest[name] = float(violations[[row.unit == unit for row in rows]].max(initial=0.0))
        return largest

    def _add_soles(self, q: Array, equality: list[Array], blocks: list[Array]) -> None:
        if not self._soles:
            return
        kinematics = self.world.at(q.reshape(-1, q.shape[2]), self._soles)
        for sole in self._soles:
            pose: Feature = features.pose(kinematics.placement(sole), *self.world.planted[sole])
            equality.append(pose.value.reshape(len(q), -1))
            blocks.append(pose.jacobian[:, :, np.flatnonzero(self.world.support(sole))].reshape(len(q), -1))

    def hessian_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `equality_hessians`, `inequality_hessians` and `action_hessians`."""
        nq, tail = self.world.nq, self.size - self.modes.size
        columns = self.switch_columns()
        columns += [np.arange(tail // nq)[:, None] * nq + legs.columns for legs in self._legs]
        if self.active is not None:
            columns += self.active.hessian_columns()
        return columns + self._own.convex_columns()

    def switch_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `switch_hessians`."""
        return [*self._switches.hessian_columns(), *(columns for _, columns in self._own.curved())]

    def switch_hessians(self, values: Values, q: Array, z: Array, y: Array) -> list[Array]:
        """Return sum_i y_i d2 row_i (B, m, m) of each switch at B points, for values of `evaluate_many` at (q, z)."""
        own = self._own.curved_hessians(q, z, y[:, len(self._switches.eq_rows) :])
        return self._switches.equality_hessians(values.switches, z, y) + own

    def action_hessians(self, q: Array, z: Array, y_eq: Array, y_in: Array) -> list[Array]:
        """Return the convex part of sum_i y_i d2 row_i (k, p, p) of what else actions bring themselves."""
        first = len(self._switches.eq_rows), len(self._switches.in_rows)
        return self._own.convex_hessians(q, z, y_eq[first[0] :], y_in[first[1] :])

    def leg_hessians(self, q: Array, y: Array) -> list[tuple[Indices, Array]]:
        """Return the unknowns of leg reach in each knot and its curvature (B, p, p) at B points (B, P, nq)."""
        count, knots, nq = q.shape
        blocks = []
        for legs, multipliers in zip(self._legs, self._leg_rows(y, knots), strict=True):
            curvature = legs.curvature(q.reshape(-1, nq)).reshape(count, knots, -1) * multipliers[..., None]
            size = len(legs.columns)
            blocks += [(at * nq + legs.columns, curvature[:, at].reshape(-1, size, size)) for at in range(knots)]
        return blocks

    def _leg_rows(self, y: Array, knots: int) -> list[Array]:
        """Return the part (..., P) of inequalities or multipliers (..., m) that is the leg reach of each person."""
        first = self._first_leg
        return [y[..., first + at * knots : first + (at + 1) * knots] for at in range(len(self._legs))]

    def curved_equalities(self) -> list[Indices]:
        """Return the unknowns of each block of equalities with curvature: the first blocks of the equalities."""
        return [columns for _, columns in (*self._switches.eq, *self._own.curved())]

    def inequality_hessians(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return the convex part of sum_i y_i d2 row_i (n, p, p) of leg reach, then of active rows."""
        hessians = [
            multipliers[:, None, None] * legs.curvature(q)
            for legs, multipliers in zip(self._legs, self._leg_rows(y, len(q)), strict=True)
        ]
        if self.active is not None:
            hessians += self.active.hessian(q, z, y[len(y) - len(self.active) :])
        return hessians

    def equality_hessians(self, values: Values, q: Array, z: Array, y: Array) -> list[Array]:
        """Return sum_i y_i d2 row_i (m, m) of each switch by its unknowns in `hessian_columns`, values at (q, z)."""
        return [block[0] for block in self.switch_hessians(values, q[None], z[None], y[None])]


Pair = tuple[int, int]


def equal_joint_constraints(
    world: World, phases: Phases, modes: ModeSequence, limbs: dict[int, Indices], knots: Indices
) -> tuple[dict[Pair, Indices], dict[Pair, Indices]]:
    """Return pairs of slices (first, second) -> joints that are equal in both: pairs of knots, and others.

    In every other pair the first slice is a knot and the second is not.

    Args:
        limbs: enforced switch -> joints that rest after it.
        knots: (P,) slices that are unknowns, rising.
    """
    unknown = {int(slice_) for slice_ in knots}
    horizon = int(knots[-1]) + 1
    joints: dict[Pair, set[int]] = {}
    for number, limb in limbs.items():
        keyframe = int(phases.keyframes[number])
        if keyframe + 1 < horizon:
            joints.setdefault((keyframe, keyframe + 1), set()).update(limb.tolist())
    for number in limbs:
        if modes.switches[number].giver:
            # Who took an object stays where it is until the one who gave it has drawn back.
            taker = np.flatnonzero(world.support(modes.switches[number].hand)).tolist()
            first = int(phases.keyframes[number])
            last = first + draw_back_slices(phases.seconds, phases.slices)
            _stand(joints, taker, range(first, min(last + 1, horizon)), unknown)
    for _, number, end in modes.holding_intervals:
        if number not in limbs:
            continue
        standing = np.flatnonzero(np.max([world.support(name) for name in modes.acting(number)], axis=0)).tolist()
        first = int(phases.keyframes[number])
        _stand(joints, standing, range(first, min(int(phases.keyframes[end]) + 1, horizon)), unknown)
    for place in _standing_places(world):
        for end in phases.ends.tolist():
            if end in unknown:
                first = end - phases.slices + 1 + standing_from(phases.slices)
                _stand(joints, place, range(end, first - 1, -1), unknown)
    between: dict[Pair, Indices] = {}
    eliminated: dict[Pair, Indices] = {}
    for pair in sorted(joints):
        (between if pair[1] in unknown else eliminated)[pair] = np.array(sorted(joints[pair]), dtype=np.intp)
    return between, eliminated


def _standing_places(world: World) -> Iterator[list[int]]:
    """Yield the columns of the place of each person who may step."""
    for name, person in world.scene.humans.items():
        if person.step is not None:
            parts = (world.column.get(f"{name}.{BASE}_{part}") for part in ("x", "y", "yaw"))
            yield [column for column in parts if column is not None]


def _stand(joints: dict[Pair, set[int]], standing: list[int], slices: range, unknown: set[int]) -> None:
    """Let some joints be equal in slices, each in the next one or where that is eliminated the one after it.

    The first of the slices, which may fall, is a knot.
    """
    first = slices.start
    for second in slices[1:]:
        pair = (min(first, second), max(first, second)) if second in unknown else (first, second)
        joints.setdefault(pair, set()).update(standing)
        first = second if second in unknown else first
