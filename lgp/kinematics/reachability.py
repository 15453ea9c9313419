"""Reachability maps: every hand against every table over its range of heights, by multi-start inverse kinematics.

A spot on a table is reached if the grasping point of the hand gets there within 1 mm, inside joint limits and the
scene's limit of tilt; for the human also with both soles in place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lgp.kinematics import features
from lgp.kinematics.attachments import fixed_on
from lgp.kinematics.ik import least_squares
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import FramePlacement, World
from lgp.scene.model import Hand
from reba.arrays import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

CLOSE = 1e-3
"""[m] A spot within this distance is reached; far below the slack of a grasp."""


@dataclass(frozen=True)
class Reachability:
    """The reachability map of a scene: a row of `data` for each hand, table, height and spot.

    Its columns are `hand table height x y reached miss` [m].
    """

    data: pd.DataFrame

    def shares(self) -> pd.DataFrame:
        """Return the share of reached spots (0 to 1): one row per hand and table, one column per height."""
        return self.data.pivot_table(index=["hand", "table"], columns="height", values="reached", aggfunc="mean")

    def any_reached(self) -> pd.DataFrame:
        """Return whether any spot of a table is reached: one row per hand and table, one column per height."""
        return self.data.pivot_table(index=["hand", "table"], columns="height", values="reached", aggfunc="max")


def reachability(
    world: World,
    heights: Sequence[float] = tuple(np.linspace(0.6, 1.6, 11).round(3)),
    spots: int = 3,
    attempts: int = 6,
    seed: int = 0,
) -> Reachability:
    """Return the reachability map of all hands and tables.

    Args:
        heights: [m] of the tables whose height is a range; a table with a fixed height keeps it.
        spots: per side of a top, from edge to edge.
        attempts: of the inverse kinematics: from the initial configuration, then from random ones.
    """
    import pandas as pd

    targets = _targets(world, heights, spots)
    half_height = max((item.size[2] / 2.0 for item in world.scene.objects.values()), default=0.0)
    points = targets[["x", "y", "height"]].to_numpy() + np.array([0.0, 0.0, half_height])
    parts = []
    for hand in world.scene.hands.values():
        miss = reach(world, hand, points, attempts, np.random.default_rng(seed))
        parts.append(targets.assign(hand=hand.full, miss=miss, reached=miss < CLOSE))
    return Reachability(pd.concat(parts, ignore_index=True))


def reach(world: World, hand: Hand, points: Array, attempts: int, rng: np.random.Generator) -> Array:
    """Return the smallest residual (n,) of a hand at points (n, 3): position [m], excess tilt and leg length alike."""
    columns = world.columns(hand.agent)
    lower, upper = world.lower[columns], world.upper[columns]
    posture = PostureMap(world, world.scene.humans[hand.agent]) if hand.human else None

    best = np.full(len(points), np.inf)
    for attempt in range(attempts):
        unreached = np.flatnonzero(best > CLOSE)
        if not len(unreached):
            break

        def residuals(x: Array, which: Indices, wanted: Array = points[unreached]) -> tuple[Array, Array]:
            return _residuals(world, hand, posture, columns, x, wanted[which])

        initial = np.tile(world.initial_configuration[columns], (len(unreached), 1))
        if attempt:
            initial = rng.uniform(lower, upper, initial.shape)
        _, residual = least_squares(residuals, initial, lower, upper, tolerance=CLOSE / 2.0)
        best[unreached] = np.minimum(best[unreached], residual)
    return best


def transport_reachability(
    world: World, object_name: str, heights: Sequence[float], spots: int = 3, attempts: int = 6
) -> pd.DataFrame:
    """Return where each robot hand can place an object that it grasps at its initial position.

    The rows are those of `Reachability.data` without tables of fixed height. Stricter than reach: the grasp does not
    change and the object lies flat at both ends, so the hand has the same tilt at both.
    """
    import pandas as pd

    item = world.scene.objects[object_name]
    targets = _targets(world, heights, spots)
    targets = targets[targets["table"].map(lambda name: world.scene.tables[name].heights).map(lambda h: h[1] > h[0])]
    lift = np.array([0.0, 0.0, item.size[2] / 2.0])
    points = targets[["x", "y", "height"]].to_numpy() + lift
    parts = []
    for hand in world.scene.hands.values():
        if hand.human:
            continue
        attachment = fixed_on(world.scene.tables[item.on], item)
        at = world.at(world.initial_configuration[None], world.scene.carried_tables)
        source = attachment.pose(at, np.zeros(0)).position[0]
        miss = _transport(world, hand, source, points, attempts)
        parts.append(targets.assign(hand=hand.full, miss=miss, reached=miss < CLOSE))
    return pd.concat(parts, ignore_index=True)


def _transport(world: World, hand: Hand, source: Array, points: Array, attempts: int) -> Array:
    """Return the residual (n,) [m] of points (n, 3) for a hand that grasps at the source (3,) and keeps its grasp."""
    columns = world.columns(hand.agent)
    k = len(columns)
    lower, upper = np.tile(world.lower[columns], 2), np.tile(world.upper[columns], 2)
    rng = np.random.default_rng(0)

    def upright(place: FramePlacement) -> features.Feature:
        """The vertical in the axes of the hand."""
        inverse = np.swapaxes(place.rotation, 1, 2)
        slopes = np.cross(np.array([0.0, 0.0, 1.0])[None, :, None], place.jacobian[:, 3:], axis=1)
        return features.Feature(inverse[:, :, 2], inverse @ slopes)

    def ends(x: Array, wanted: Array) -> tuple[Array, Array]:
        first, by_first = _residuals(world, hand, None, columns, x[:, :k], np.broadcast_to(source, wanted.shape))
        last, by_last = _residuals(world, hand, None, columns, x[:, k:], wanted)
        up = [upright(_placement(world, hand, columns, part)) for part in (x[:, :k], x[:, k:])]
        value = np.concatenate([first, last, up[0].value - up[1].value], axis=1)
        m = first.shape[1]
        jacobian = np.zeros((len(x), value.shape[1], 2 * k))
        jacobian[:, :m, :k], jacobian[:, m : 2 * m, k:] = by_first, by_last
        jacobian[:, 2 * m :, :k] = up[0].jacobian[:, :, columns]
        jacobian[:, 2 * m :, k:] = -up[1].jacobian[:, :, columns]
        return value, jacobian

    best = np.full(len(points), np.inf)
    for attempt in range(attempts):
        unreached = np.flatnonzero(best > CLOSE)
        if not len(unreached):
            break
        initial = np.tile(world.initial_configuration[columns], (len(unreached), 2))
        if attempt:
            initial = rng.uniform(lower, upper, initial.shape)

        def residuals(x: Array, which: Indices, wanted: Array = points[unreached]) -> tuple[Array, Array]:
            return ends(x, wanted[which])

        _, residual = least_squares(residuals, initial, lower, upper, tolerance=CLOSE / 2.0)
        best[unreached] = np.minimum(best[unreached], residual)
    return best


def _placement(world: World, hand: Hand, columns: Indices, x: Array) -> FramePlacement:
    q = np.tile(world.initial_configuration, (len(x), 1))
    q[:, columns] = x
    return world.at(q, [hand.full]).placement(hand.full)


def _residuals(
    world: World, hand: Hand, posture: PostureMap | None, columns: Indices, x: Array, points: Array
) -> tuple[Array, Array]:
    q = np.tile(world.initial_configuration, (len(x), 1))
    q[:, columns] = x
    soles = list(world.planted) if posture is not None else []
    kinematics = world.at(q, [hand.full, *soles])
    place = kinematics.placement(hand.full)
    parts = [features.position(place, points)]
    if hand.tilt < 180.0:
        parts.append(_beyond(features.tilt(place, hand.tilt)))
    parts += [features.pose(kinematics.placement(sole), *world.planted[sole]) for sole in soles]
    values = [part.value for part in parts]
    jacobians = [part.jacobian[:, :, columns] for part in parts]
    if posture is not None and posture.body.legs == "solved":
        legs = _beyond(features.Feature(*posture.leg_shortfall(q)))
        values.append(legs.value)
        jacobians.append(legs.jacobian)
    return np.concatenate(values, axis=1), np.concatenate(jacobians, axis=1)


def _beyond(inequality: features.Feature) -> features.Feature:
    """Return max(value, 0) of an inequality value <= 0, with its Jacobian."""
    violated = inequality.value > 0.0
    return features.Feature(
        np.where(violated, inequality.value, 0.0), np.where(violated[:, :, None], inequality.jacobian, 0.0)
    )


def _targets(world: World, heights: Sequence[float], spots: int) -> pd.DataFrame:
    """Return the spots of all tables and heights: `table height x y` [m]."""
    import pandas as pd

    rows = []
    side = np.linspace(-1.0, 1.0, spots)
    margin = min((min(item.size[:2]) / 2.0 for item in world.scene.objects.values()), default=0.0)
    for name, table in world.scene.tables.items():
        if table.frame:
            continue  # where it is depends on the robot that carries it
        yaw = np.radians(table.yaw)
        for height in heights if table.heights[1] > table.heights[0] else [table.height]:
            for u in side * (table.size[0] / 2.0 - margin):
                for v in side * (table.size[1] / 2.0 - margin):
                    x = table.position[0] + np.cos(yaw) * u - np.sin(yaw) * v
                    y = table.position[1] + np.sin(yaw) * u + np.cos(yaw) * v
                    rows.append({"table": name, "height": float(height), "x": x, "y": y})
    return pd.DataFrame(rows)
