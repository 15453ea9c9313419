"""A measured posture as a configuration of the planner's body, soles on the floor.

The posture table says neither how the trunk's inclination is shared between hips and spine, nor where the pelvis is
above the feet, nor how an upper arm is turned about its own axis. The shares are those of least motion relative to the
joint ranges, the pelvis is where the centre of mass is above the feet, and the upper arm is not turned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.kinematics.ik import least_squares
from lgp.kinematics.leg_ik import rest_posture
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from lgp.scene.model import Hand, Human, Scene
from lgp.workplace.balance import Balance
from reba.arrays import Array, Indices
from reba.posture.columns import BEST, COLUMNS, SIDES

REST_WEIGHT: Final = 0.03
"""Weight of a joint's distance from rest, over its range, beside that of an angle [rad]."""
BALANCE_WEIGHT: Final = 0.5
"""Weight of the distance [m] of the centre of mass from the middle of the feet beside that of an angle [rad]."""
WIDER: Final = {"human.pelvis_z": 0.35, "human.pelvis_x": 0.15, "human.pelvis_y": 0.15}
"""[m] How far measured postures may exceed the planner's limits of the pelvis: people squat on their toes."""
WIDER_JOINTS: Final = np.radians(25.0)
"""[rad] The same for joints, whose ranges differ between people."""
STARTS: Final = 6
"""Starts of a fit: rest, then random ones from a fixed seed."""


def person(stature: float, sex: str) -> World:
    """Return the kinematics of one person who stands at the origin and faces x.

    Raises:
        SceneError: unknown sex, or stature out of range.

    Example:
        >>> person(1.75, "male").nq
        29
    """
    rest_posture(stature, sex)  # refuses what is out of range before a model is built
    hands = tuple(
        Hand("human", f"{side}_hand", f"{side}_hand", 0.0, "human_hand", 180.0, "free", human=True) for side in SIDES
    )
    human = Human("human", (0.0, 0.0, 0.0), 0.0, hands, (), {}, stature, sex, "solved")
    return World(Scene("person", "", "", (), (), 1.0, 1, {human.name: human}, {}, {}, {}))


@dataclass(frozen=True)
class BodyFit:
    """A configuration of the body for a measured posture.

    Attributes:
        q: (nq,) [rad, m].
        angles: (22,) [deg] of the body; `away` (22,) how far they are from the measured ones, NaN = not measured.
    """

    q: Array
    angles: Array
    away: Array


def fit_body(world: World, measured: Array, balance: Balance, *, standing: bool = True) -> BodyFit:
    """Return the configuration whose posture angles are nearest to the measured ones.

    Args:
        measured: (22,) [deg]; NaN = not measured, which is taken as neutral.
        balance: of the person with the load.
        standing: whether the feet bear the body; a seat does otherwise.

    Example:
        >>> import reba
        >>> world = person(1.75, "male")
        >>> posture = reba.angle_table({"trunk_flexion": 40.0, "lower_arm_flexion": 60.0})[0]
        >>> fit = fit_body(world, posture, Balance(world, 0.0, ()))
        >>> bool(np.nanmax(np.abs(fit.away)) < 1.0)
        True
    """
    wanted = np.where(np.isnan(measured), [BEST[name] for name in COLUMNS], measured)
    posture, rest = PostureMap(world), world.initial_configuration
    span = world.upper - world.lower
    lower, upper = wide_limits(world)

    def residuals(q: Array, _: Indices) -> tuple[Array, Array]:
        angles, slopes = posture.evaluate(q)
        spread = np.zeros((len(q), slopes.shape[1], world.nq))
        spread[:, :, posture.columns] = slopes
        away = np.radians(np.remainder(angles - wanted + 180.0, 360.0) - 180.0)
        near = REST_WEIGHT * (q - rest) / span
        parts = [away, near]
        jacobians = [np.radians(spread), np.broadcast_to(np.diag(REST_WEIGHT / span), (len(q), world.nq, world.nq))]
        if standing:
            centre, moved = balance.evaluate(world.at(q, balance.frames))
            parts.append(BALANCE_WEIGHT * (centre - (balance.lower + balance.upper) / 2.0))
            jacobians.append(BALANCE_WEIGHT * moved)
        return np.concatenate(parts, axis=1), np.concatenate(jacobians, axis=1)

    rng = np.random.default_rng(0)
    starts = np.tile(rest, (STARTS, 1))
    starts[1:] += rng.uniform(0.1, 0.6, (STARTS - 1, 1)) * (rng.uniform(lower, upper, (STARTS - 1, world.nq)) - rest)
    solved, _ = least_squares(residuals, starts, lower, upper, tolerance=0.0)
    errors = np.sum(residuals(solved, np.arange(STARTS))[0] ** 2, axis=1)
    q = solved[int(np.argmin(errors))]
    angles = posture.angles(q[None])[0]
    return BodyFit(q, angles, np.where(np.isnan(measured), np.nan, np.remainder(angles - measured + 180, 360) - 180))


def wide_limits(world: World) -> tuple[Array, Array]:
    """Return limits (nq,), (nq,) within which measured postures are looked for."""
    wider = np.array([WIDER.get(name, WIDER_JOINTS) for name in world.joints])
    lower, upper = world.lower - wider, world.upper + wider
    upper[world.column["human.pelvis_z"]] = world.upper[world.column["human.pelvis_z"]]
    for side in SIDES:
        # An elbow that is stretched beyond straight, and a forearm that turns more than half a turn, are other poses.
        at = world.column[f"human.{side}_elbow_Z"]
        lower[at] = world.lower[at]
    return lower, upper
