"""Postures of least ergonomic cost whose hands are at given places, many at once, for `lgp.sqp.many`.

Unknowns are the joints of the body (nq,) and the displacement (3,) of the surface from where the hands are; the latter
has equal bounds in each problem. Hands keep their place on the surface, and with measured wrists their direction within
`TURN`; the soles stay where they are, the legs are long enough, and the centre of mass is above the feet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.kinematics.features import cross
from lgp.kinematics.ik import least_squares
from lgp.kinematics.world import Kinematics, World
from lgp.path.ergonomics import Ergonomics
from lgp.sqp.many import ManyModels, solve_many
from lgp.workplace.balance import Balance
from reba.arrays import Array, Flags, Indices

TURN: Final = 30.0
"""[deg] How far a hand may turn from its measured orientation: things are taken a little differently elsewhere."""
KEPT: Final = 0.2
"""Cost [REBA points] of a joint that moves over its whole range: of equal postures the nearest is taken."""
PULL: Final = 2.0
"""Cost [REBA points] of an angle `SCALE` beyond a class that a posture is drawn into."""
SCALE: Final = 10.0
"""[deg]"""
TOLERANCE: Final = 2e-3
"""[m] Distance of a hand from its place, and of the centre of mass from the feet, that counts as none."""
DECREASE: Final = 1e-2
"""Predicted decrease of a cost, relative to it, at which a posture is good enough: scores are whole points."""
ITERATIONS: Final = 20


@dataclass(frozen=True)
class Aim:
    """Classes that postures are drawn into: lowest and highest angle (22,) [deg], infinite where there is none."""

    low: Array
    high: Array


@dataclass(frozen=True)
class Hold:
    """What is held.

    Attributes:
        hands: names of the hands whose places are held.
        places: (h, 3) [m] of these hands with the surface unmoved.
        rotations: (h, 3, 3) of them.
        turns: (h,) whether a hand keeps its orientation within `TURN`.
        seated: whether a seat holds the pelvis.
        kept: (nq,) joints that stay: their angles were not measured.
        sinks: how far the pelvis may sink [m].
        q: (nq,) the measured posture.
    """

    hands: tuple[str, ...]
    places: Array
    rotations: Array
    turns: Flags
    seated: bool
    kept: Flags
    sinks: float
    q: Array


class HeldHands:
    """The problems of one person who holds something; `aim` draws the postures into classes, None into none."""

    def __init__(self, ergonomics: Ergonomics, balance: Balance, hold: Hold, aim: Aim | None = None) -> None:
        self.world: World = ergonomics.world
        self.ergonomics, self.balance, self.hold, self.aim = ergonomics, balance, hold, aim
        world = self.world
        self.frames = tuple(f"human.{hand}" for hand in hold.hands)
        # A measured posture beyond the limits shows that the person can take it.
        self._low, self._high = np.minimum(world.lower, hold.q), np.maximum(world.upper, hold.q)
        stays = hold.kept.copy()
        if hold.seated:
            stays |= np.array(
                [name.startswith("human.pelvis_") and name != "human.pelvis_tilt" for name in world.joints]
            )
        self._low, self._high = np.where(stays, hold.q, self._low), np.where(stays, hold.q, self._high)
        height = world.column["human.pelvis_z"]
        self._low[height] = max(self._low[height], hold.q[height] - hold.sinks)
        span = np.maximum(world.upper - world.lower, 1e-9)
        self._kept = KEPT / span**2
        self.lower = self.upper = np.zeros((0, world.nq + 3))

    def rest(self) -> Array:
        """Return the posture at rest (nq,), with what stays as measured."""
        return np.clip(self.world.initial_configuration, self._low, self._high)

    def cost(self, q: Array) -> Array:
        """Return the ergonomic cost of postures (B, nq), with that of the distance from the measured one."""
        return np.asarray(self.ergonomics.value(q, np.zeros(len(q))) + 0.5 * (q - self.hold.q) ** 2 @ self._kept)

    def _missed(self, q: Array, moved: Array) -> tuple[Array, Array]:
        """Return by how much postures (B, nq) miss what is held, in all its rows, and the Jacobian (B, rows, nq)."""
        kinematics = self._kinematics(q)
        eq, eq_jac = self._places(kinematics, moved)
        ineq, in_jac = self._limits(kinematics, q)
        beyond = np.maximum(ineq, 0.0)
        jacobian = np.concatenate([eq_jac, in_jac * (beyond > 0.0)[:, :, None]], axis=1)
        return np.concatenate([eq, beyond], axis=1), jacobian[:, :, : self.world.nq]

    def solve(self, starts: Array, moved: Array) -> Array:
        """Return postures (B, nq) of low cost from starts (B, nq) for surfaces that moved by (B, 3) [m].

        Where the iterations end before the hands are in place, `project` brings them there.
        """
        count = len(starts)
        self.lower = np.concatenate([np.tile(self._low, (count, 1)), moved], axis=1)
        self.upper = np.concatenate([np.tile(self._high, (count, 1)), moved], axis=1)
        x = np.concatenate([starts, moved], axis=1)
        # Problems of different places are not compared: none is given up for its cost.
        solved = solve_many(self, x, violation=TOLERANCE, decrease=DECREASE, iterations=ITERATIONS, cost_ratio=1e9)
        return np.ascontiguousarray(solved.x[:, :-3])

    def project(self, starts: Array, moved: Array) -> tuple[Array, Flags]:
        """Return the postures (B, nq) near starts that hold what is held, and whether they do."""

        def residuals(q: Array, rows: Indices) -> tuple[Array, Array]:
            return self._missed(q, moved[rows])

        solved, miss = least_squares(residuals, starts, self._low, self._high, tolerance=TOLERANCE / 4)
        return solved, miss <= TOLERANCE

    def evaluate(self, x: Array) -> tuple[Array, Array, Array]:
        """Return costs (B,), equalities and inequalities at x (B, nq + 3)."""
        q = np.ascontiguousarray(x[:, :-3])
        kinematics = self._kinematics(q)
        cost = self.cost(q)
        if self.aim is not None:
            excess = self._excess(self.ergonomics.posture.evaluate(q, smooth=True)[0])
            cost = cost + 0.5 * PULL * np.einsum("bi,bi->b", excess, excess)
        return cost, self._places(kinematics, x[:, -3:])[0], self._limits(kinematics, q)[0]

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> ManyModels:
        """Return the convex models at x (B, nq + 3); the rows are taken as straight."""
        q, nq = np.ascontiguousarray(x[:, :-3]), self.world.nq
        kinematics = self._kinematics(q)
        _, slope, parts = self.ergonomics.quadratic_model(q, np.zeros(len(q)))
        gradient, hessian = np.zeros((len(q), nq + 3)), np.zeros((len(q), nq + 3, nq + 3))
        gradient[:, :nq] = (q - self.hold.q) * self._kept
        np.einsum("bii->bi", hessian)[:, :nq] = self._kept
        # Of parameters that do not move.
        np.einsum("bii->bi", hessian)[:, nq:] = 1.0
        columns = self.ergonomics.columns
        gradient[:, columns] += slope
        for part, block in zip(self.ergonomics.parts, parts, strict=True):
            own = columns[part]
            hessian[:, own[:, None], own] += block
        if self.aim is not None:
            self._add_aim(q, gradient, hessian)
        eq, eq_jac = self._places(kinematics, x[:, -3:])
        ineq, in_jac = self._limits(kinematics, q)
        return ManyModels(hessian, gradient, eq, eq_jac, ineq, in_jac)

    def _kinematics(self, q: Array) -> Kinematics:
        return self.world.at(q, (*self.frames, *self.balance.frames))

    def _excess(self, angles: Array) -> Array:
        """Return how far angles (n, 22) are beyond the classes that they are drawn into, over `SCALE`."""
        assert self.aim is not None
        return (angles - np.clip(angles, self.aim.low, self.aim.high)) / SCALE

    def _add_aim(self, q: Array, gradient: Array, hessian: Array) -> None:
        posture = self.ergonomics.posture
        angles, slopes = posture.evaluate(q, smooth=True)
        excess = self._excess(angles)
        beyond = slopes * ((excess != 0.0) / SCALE)[:, :, None]
        columns: Indices = posture.columns
        gradient[:, columns] += PULL * np.einsum("bi,bij->bj", excess, beyond)
        hessian[:, columns[:, None], columns] += PULL * (np.swapaxes(beyond, 1, 2) @ beyond)

    def _places(self, kinematics: Kinematics, moved: Array) -> tuple[Array, Array]:
        """Return the distances of the hands from their places (B, 3 h) [m] and the Jacobian."""
        nq, count = self.world.nq, len(moved)
        value, jacobian = np.zeros((count, 3 * len(self.frames))), np.zeros((count, 3 * len(self.frames), nq + 3))
        for at, frame in enumerate(self.frames):
            rows, place = slice(3 * at, 3 * at + 3), kinematics.placement(frame)
            value[:, rows] = place.position - self.hold.places[at] - moved
            jacobian[:, rows, :nq] = place.jacobian[:, :3]
            jacobian[:, rows, nq:] = -np.eye(3)
        return value, jacobian

    def _limits(self, kinematics: Kinematics, q: Array) -> tuple[Array, Array]:
        """Return what must be <= 0: turns of hands, missing leg length, the centre of mass beyond the feet."""
        nq = self.world.nq
        values, jacobians = [], []
        for at in np.flatnonzero(self.hold.turns):
            place, target = kinematics.placement(self.frames[at]), self.hold.rotations[at]
            # The trace of the relative rotation is 1 + 2 cos(angle).
            trace = np.einsum("bij,ij->b", place.rotation, target)
            lever = sum(cross(place.rotation[:, :, k : k + 1], np.tile(target[:, k], (len(q), 1))) for k in range(3))
            values.append((1.0 + 2.0 * np.cos(np.radians(TURN)) - trace)[:, None])
            jacobians.append(-np.einsum("bi,bij->bj", np.asarray(lever)[:, :, 0], place.jacobian[:, 3:])[:, None])
        if not self.hold.seated:
            short, by_human = self.ergonomics.posture.leg_shortfall(q)
            slope = np.zeros((len(q), 2, nq))
            slope[:, :, self.ergonomics.posture.columns] = by_human
            beyond, moved = self.balance.beyond(kinematics)
            values += [short, beyond]
            jacobians += [slope, moved]
        if not values:
            return np.zeros((len(q), 0)), np.zeros((len(q), 0, nq + 3))
        return np.concatenate(values, axis=1), np.pad(np.concatenate(jacobians, axis=1), ((0, 0), (0, 0), (0, 3)))
