"""The constraints that actions bring themselves (`ActionConstraint`), at the knots of a path problem.

One that holds at the end of an action is a block of rows in the slice of the switch, one that holds along it a block in
every knot of its phase. Which joints and variables a block depends on is found by asking the constraint once. Second
derivatives are forward differences of its Jacobian: of an equation in a switch all of them count, as for other rows of
switches, of others the convex part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lgp.errors import LgpError, WorldError
from lgp.extensions import ask
from lgp.kinematics.actions import ActionConstraint
from lgp.kinematics.features import Feature, FullPose, rotation_about_z
from lgp.kinematics.modes import ModeSequence
from lgp.path.mode_constraints import Blocks, ConstraintInfo
from lgp.path.phases import Phases
from lgp.scene.model import Scene
from reba.arrays import Array, Indices

STEP = 1e-6
"""[m, rad] Of the forward differences that give second derivatives."""


@dataclass
class PlannedMoment:
    """An action in n configurations (n, nq) of the phase that it ends, with Jacobians by (q, z): an `ActionMoment`.

    Attributes:
        number: of the action in its sequence.
        switched: number of actions before its phase.
        frames: that are known to be asked for; computed at once.
        asked: names that were asked for.
    """

    modes: ModeSequence
    number: int
    switched: int
    q: Array
    z: Array
    frames: tuple[str, ...] = ()
    asked: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._kinematics = self.modes.world.at(self.q, self.frames)

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.modes.world.scene

    @property
    def arguments(self) -> Mapping[str, str]:
        """Role -> name."""
        return self.modes.switches[self.number].arguments

    def __getitem__(self, role: str) -> FullPose:
        """Return the placements of the argument in a role."""
        if role not in self.arguments:
            known = ", ".join(self.arguments)
            raise WorldError(f"{self.modes.switches[self.number].kind} has no role {role!r}, expected one of {known}")
        return self.place(self.arguments[role])

    def place(self, name: str) -> FullPose:
        """Return the placements of a hand, an object, a table or a frame."""
        self.asked.append(name)
        count, size = len(self.q), self.modes.size
        if name in self.scene.tables and name not in self.scene.carried_tables:
            table = self.scene.tables[name]
            top = np.broadcast_to(rotation_about_z(np.radians(table.yaw)), (count, 3, 3))
            middle = np.broadcast_to(np.array([*table.position, table.height]), (count, 3))
            return FullPose(top, middle, np.zeros((count, 6, self.q.shape[1] + size)))
        if name in self.scene.objects:
            attachment = self.modes.attachment(name, self.switched)
            if attachment.base is None:
                self._need(attachment.parent)
            pose = attachment.pose(self._kinematics, self.z[attachment.variables])
            return pose.with_all_variables(size)
        self._need(name)
        place = self._kinematics.placement(name)
        jacobian = np.concatenate([place.jacobian, np.zeros((count, 6, size))], axis=2)
        return FullPose(place.rotation, place.position, jacobian)

    def _need(self, frame: str) -> None:
        if frame not in self._kinematics.index:
            self._kinematics = self.modes.world.at(self.q, [*self._kinematics.index, frame])

    @property
    def computed(self) -> tuple[str, ...]:
        """The frames that were computed."""
        return tuple(self._kinematics.index)


@dataclass(frozen=True)
class _Block:
    """One constraint of one switch.

    Attributes:
        switched: number of actions before the phase of the switch.
        places: (k,) knots at which it holds.
        frames: that it asks for.
        rows: m.
        joints, variables: (p,) columns of q and (v,) of z that it depends on.
        asked: names that it asked for.
    """

    number: int
    switched: int
    constraint: ActionConstraint
    places: Indices
    frames: tuple[str, ...]
    rows: int
    joints: Indices
    variables: Indices
    asked: frozenset[str]

    @property
    def curved(self) -> bool:
        """Whether all of its curvature counts: that of an equation in a switch."""
        return self.constraint.equal and not self.constraint.along

    def evaluate(self, modes: ModeSequence, q: Array, z: Array) -> Feature:
        """Return its values (n, m) and Jacobian (n, m, p + v) in n configurations."""
        moment = PlannedMoment(modes, self.number, self.switched, q, z, self.frames)
        feature = _asked(modes, self.number, self.constraint, moment)
        if not self.asked.issuperset(moment.asked):
            raise _wrong(modes, self.number, self.constraint, "asks for other frames than at first", "the same ones")
        _check_finite(modes, self.number, self.constraint, feature)
        nq = q.shape[1]
        return Feature(feature.value, feature.jacobian[:, :, np.concatenate([self.joints, nq + self.variables])])

    def curvature(self, modes: ModeSequence, q: Array, z: Array, weights: Array) -> Array:
        """Return sum_i weights_i d2 row_i (n, p + v, p + v) for weights (n, m)."""
        count, own = len(q), len(self.joints)
        moved = np.repeat(q[None], own + 1, axis=0)
        moved[np.arange(own), :, self.joints] += STEP
        slopes = self.evaluate(modes, moved.reshape(-1, q.shape[1]), z).jacobian
        slopes = slopes.reshape(own + 1, count, self.rows, -1)
        by_variable = []
        for variable in self.variables:
            other = z.copy()
            other[variable] += STEP
            by_variable.append(self.evaluate(modes, q, other).jacobian)
        every = np.concatenate([slopes[:own], np.reshape(by_variable, (-1, *slopes.shape[1:]))])
        hessian = np.einsum("nm,snmc->nsc", weights, (every - slopes[own]) / STEP)
        return np.asarray(0.5 * (hessian + np.swapaxes(hessian, 1, 2)))


def _asked(modes: ModeSequence, number: int, constraint: ActionConstraint, moment: PlannedMoment) -> Feature:
    what = f"action {modes.switches[number].kind!r}: its constraint {constraint.says!r}"
    feature: Feature = ask(what, constraint.feature, moment)
    return feature


def _check_finite(modes: ModeSequence, number: int, constraint: ActionConstraint, feature: Feature) -> None:
    for what, numbers in (("value", feature.value), ("Jacobian", feature.jacobian)):
        if not np.isfinite(numbers).all():
            bad = numbers[~np.isfinite(numbers)][0]
            raise _wrong(modes, number, constraint, f"has {bad} in its {what}", "finite numbers")


def _wrong(modes: ModeSequence, number: int, constraint: ActionConstraint, given: str, expected: str) -> LgpError:
    kind = modes.switches[number].kind
    return LgpError(f"action {kind!r}: its constraint {constraint.says!r} {given}, expected {expected}; correct it")


class ActionConstraints:
    """The rows of the constraints of some switches; unknowns as in `lgp.path.constraints`.

    Args:
        knots: (P,) slices that are unknowns.
        enforced: numbers of the switches.

    Attributes:
        eq, ineq: (rows, columns) of each block; the first ones of `eq` have curvature.
        eq_rows, in_rows: what each row is about.
    """

    def __init__(self, phases: Phases, modes: ModeSequence, knots: Indices, enforced: tuple[int, ...]) -> None:
        self.modes, self.tail = modes, len(knots) * modes.world.nq
        blocks = [
            _block(modes, number, before, one, self._places(phases, knots, number, one.along))
            for number in enforced
            for before in (int(phases.switched[phases.phase_of[number]]),)
            for one in phases.switches[number].action.constraints
        ]
        self._equal = sorted((one for one in blocks if one.constraint.equal), key=lambda one: not one.curved)
        self._below = [one for one in blocks if not one.constraint.equal]
        self._convex = [one for one in (*self._equal, *self._below) if not one.curved]
        self.eq, self.ineq = (
            [(one.rows, self._columns(one, at)) for one in part for at in one.places]
            for part in (self._equal, self._below)
        )
        self.eq_rows, self.in_rows = (
            [
                ConstraintInfo("action", one.constraint.unit, one.number, one.constraint.says)
                for one in part
                for _ in range(len(one.places) * one.rows)
            ]
            for part in (self._equal, self._below)
        )

    @staticmethod
    def _places(phases: Phases, knots: Indices, number: int, along: bool) -> Indices:
        last = int(phases.keyframes[number])
        first = last - phases.slices + 1 if along else last
        return np.flatnonzero((knots >= first) & (knots <= last))

    def _columns(self, block: _Block, at: int) -> Indices:
        return np.concatenate([at * self.modes.world.nq + block.joints, self.tail + block.variables])

    def joints(self, number: int) -> Indices:
        """Return the columns of q that the constraints of a switch depend on."""
        own = [one.joints for one in (*self._equal, *self._below) if one.number == number]
        return np.unique(np.concatenate([np.zeros(0, np.intp), *own]))

    def curved(self) -> Blocks:
        """Return the blocks of equalities with curvature."""
        return self.eq[: sum(one.curved for one in self._equal)]

    def evaluate(self, q: Array, z: Array) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
        """Return values (B, m) and Jacobian blocks (B, rows, columns) at B configurations (B, P, nq) and z (B, nz).

        Equalities, their blocks, inequalities, their blocks.
        """
        values: tuple[list[Array], list[Array], list[Array], list[Array]] = ([], [], [], [])
        for part, value, blocks in ((self._equal, *values[:2]), (self._below, *values[2:])):
            for one in part:
                each = [one.evaluate(self.modes, q[b, one.places], z[b]) for b in range(len(q))]
                value.append(np.stack([feature.value.ravel() for feature in each]))
                blocks += list(np.swapaxes([feature.jacobian for feature in each], 0, 1))
        return values

    def curved_hessians(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return sum_i y_i d2 row_i (B, m, m) of each curved block at B points, y (B, m_e) of its equalities first."""
        hessians, start = [], 0
        for one in self._equal:
            if one.curved:
                weights = y[:, start : start + one.rows]
                each = [one.curvature(self.modes, q[b, one.places], z[b], weights[b, None]) for b in range(len(q))]
                hessians.append(np.concatenate(each))
            start += one.rows * len(one.places)
        return hessians

    def convex_columns(self) -> list[Indices]:
        """Return the unknowns (k, p) of each block of `convex_hessians`."""
        return [np.array([self._columns(one, at) for at in one.places]) for one in self._convex]

    def convex_hessians(self, q: Array, z: Array, y_eq: Array, y_in: Array) -> list[Array]:
        """Return the convex part of sum_i y_i d2 row_i (k, p, p) of all other blocks at (P, nq), in their knots."""
        hessians = []
        for part, y in ((self._equal, y_eq), (self._below, y_in)):
            start = 0
            for one in part:
                size = one.rows * len(one.places)
                if not one.curved:
                    weights = y[start : start + size].reshape(len(one.places), one.rows)
                    width = len(one.joints) + len(one.variables)
                    hessian = np.zeros((len(one.places), width, width))
                    active = np.flatnonzero(weights.any(axis=1))
                    if len(active):
                        at = one.places[active]
                        values, vectors = np.linalg.eigh(one.curvature(self.modes, q[at], z, weights[active]))
                        hessian[active] = (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, 1, 2)
                    hessians.append(hessian)
                start += size
        return hessians


def _block(modes: ModeSequence, number: int, switched: int, constraint: ActionConstraint, places: Indices) -> _Block:
    """Return a constraint of a switch with what it depends on, found by asking it in two configurations."""
    world = modes.world
    middle = np.clip(np.zeros(modes.size), modes.lower, modes.upper)
    moment = PlannedMoment(modes, number, switched, np.tile(world.initial_configuration, (2, 1)), middle)
    feature = _asked(modes, number, constraint, moment)
    if not isinstance(feature, Feature):
        raise _wrong(modes, number, constraint, f"returns a {type(feature).__name__}", "a Feature")
    rows = feature.value.shape[1] if feature.value.ndim == 2 else 0
    expected = ((2, rows), (2, rows, world.nq + modes.size))
    if not rows or (feature.value.shape, feature.jacobian.shape) != expected:
        shapes = f"has values {feature.value.shape} and a Jacobian {feature.jacobian.shape} in 2 configurations"
        raise _wrong(modes, number, constraint, shapes, f"(2, m) and (2, m, {world.nq + modes.size})")
    _check_finite(modes, number, constraint, feature)
    support = [world.support(frame) for frame in moment.computed]
    objects = [name for name in moment.asked if name in world.scene.objects]
    held = [modes.attachment(name, switched).variables for name in objects]
    variables = [np.arange(part.start, part.stop) for part in held]
    return _Block(
        number,
        switched,
        constraint,
        places,
        moment.computed,
        rows,
        np.flatnonzero(np.max([np.zeros(world.nq), *support], axis=0)),
        np.unique(np.concatenate([np.zeros(0, np.intp), *variables])).astype(np.intp),
        frozenset(moment.asked),
    )
