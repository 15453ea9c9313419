"""Who reaches what: every hand against every table over its range of heights, by inverse kinematics from many starts.

A spot on a table counts as reached if the hand gets its grasping point there within a millimetre, inside the joint
limits, tilted by no more than the scene allows - for a robot - and with the legs long enough - for the human.
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
"""[m] A spot nearer than this is reached."""


@dataclass(frozen=True)
class Reachability:
    """The map of a scene.

    Attributes:
        data: one row per hand, table, height and spot: `hand table height x y reached miss`, metres.
    """

    data: pd.DataFrame

    def shares(self) -> pd.DataFrame:
        """Return the share of spots reached: one row per hand and table, one column per height."""
        return self.data.pivot_table(index=["hand", "table"], columns="height", values="reached", aggfunc="mean")

    def any_reached(self) -> pd.DataFrame:
        """Return whether a hand reaches any spot of a table: one row per hand and table, one column per height."""
        return self.data.pivot_table(index=["hand", "table"], columns="height", values="reached", aggfunc="max")


def reachability(
    world: World,
    heights: Sequence[float] = tuple(np.linspace(0.6, 1.6, 11).round(3)),
    spots: int = 3,
    starts: int = 6,
    seed: int = 0,
) -> Reachability:
    """Return which hand reaches which table.

    Args:
        world: the world.
        heights: [m] of the tables whose height is a range; a table of given height keeps it.
        spots: per side of a top, from edge to edge.
        starts: of the inverse kinematics: the first configuration, then random ones.
        seed: of the random starts.

    Example:
        >>> reachability(World(load_scene("screwdriver"))).any_reached()       # doctest: +SKIP
    """
    import pandas as pd

    targets = _targets(world, heights, spots)
    thickness = max((thing.size[2] / 2.0 for thing in world.scene.objects.values()), default=0.0)
    points = targets[["x", "y", "height"]].to_numpy() + np.array([0.0, 0.0, thickness])
    parts = []
    for hand in world.scene.hands.values():
        miss = reach(world, hand, points, starts, np.random.default_rng(seed))
        parts.append(targets.assign(hand=hand.full, miss=miss, reached=miss < CLOSE))
    return Reachability(pd.concat(parts, ignore_index=True))


def reach(world: World, hand: Hand, points: Array, starts: int, rng: np.random.Generator) -> Array:
    """Return how far [m] a hand stays from (n, 3) points at its best, tilt and legs counted alike."""
    columns = world.columns(hand.agent)
    lower, upper = world.lower[columns], world.upper[columns]
    posture = PostureMap(world) if hand.agent == "human" else None

    best = np.full(len(points), np.inf)
    for attempt in range(starts):
        open_ = np.flatnonzero(best > CLOSE)
        if not len(open_):
            break

        def residuals(x: Array, which: Indices, wanted: Array = points[open_]) -> tuple[Array, Array]:
            return _residuals(world, hand, posture, columns, x, wanted[which])

        start = np.tile(world.initial_configuration[columns], (len(open_), 1))
        if attempt:
            start = rng.uniform(lower, upper, start.shape)
        _, left = least_squares(residuals, start, lower, upper, tolerance=CLOSE / 2.0)
        best[open_] = np.minimum(best[open_], left)
    return best


def transport_reachability(
    world: World, thing: str, heights: Sequence[float], spots: int = 3, starts: int = 6
) -> pd.DataFrame:
    """Return where each robot hand can put an object that it picks up from where it lies at first.

    More than reach: the hand keeps its hold, and the object lies flat at both ends, so the hand is tilted alike.

    Returns:
        One row per hand, table, height and spot as in `Reachability.data`, tables of given height left out.
    """
    import pandas as pd

    item = world.scene.objects[thing]
    targets = _targets(world, heights, spots)
    targets = targets[targets["table"].map(lambda name: world.scene.tables[name].heights).map(lambda h: h[1] > h[0])]
    lift = np.array([0.0, 0.0, item.size[2] / 2.0])
    points = targets[["x", "y", "height"]].to_numpy() + lift
    parts = []
    for hand in world.scene.hands.values():
        if hand.agent == "human":
            continue
        holder = fixed_on(world.scene.tables[item.on], item)
        source = holder.pose(world.at(world.initial_configuration[None], []), np.zeros(0)).position[0]
        miss = _carry(world, hand, source, points, starts)
        parts.append(targets.assign(hand=hand.full, miss=miss, reached=miss < CLOSE))
    return pd.concat(parts, ignore_index=True)


def _carry(world: World, hand: Hand, source: Array, points: Array, starts: int) -> Array:
    """Return the miss [m] of (n, 3) points for a hand that comes from the (3,) source without turning its hold."""
    columns = world.columns(hand.agent)
    k = len(columns)
    lower, upper = np.tile(world.lower[columns], 2), np.tile(world.upper[columns], 2)
    rng = np.random.default_rng(0)

    def upright(place: FramePlacement) -> features.Feature:
        """The vertical as the hand sees it."""
        inverse = np.swapaxes(place.rotation, 1, 2)
        turns = np.cross(np.array([0.0, 0.0, 1.0])[None, :, None], place.jacobian[:, 3:], axis=1)
        return features.Feature(inverse[:, :, 2], inverse @ turns)

    def ends(x: Array, wanted: Array) -> tuple[Array, Array]:
        first, by_first = _residuals(world, hand, None, columns, x[:, :k], np.broadcast_to(source, wanted.shape))
        last, by_last = _residuals(world, hand, None, columns, x[:, k:], wanted)
        up = [upright(_place(world, hand, columns, part)) for part in (x[:, :k], x[:, k:])]
        value = np.concatenate([first, last, up[0].value - up[1].value], axis=1)
        m = first.shape[1]
        jacobian = np.zeros((len(x), value.shape[1], 2 * k))
        jacobian[:, :m, :k], jacobian[:, m : 2 * m, k:] = by_first, by_last
        jacobian[:, 2 * m :, :k] = up[0].jacobian[:, :, columns]
        jacobian[:, 2 * m :, k:] = -up[1].jacobian[:, :, columns]
        return value, jacobian

    best = np.full(len(points), np.inf)
    for attempt in range(starts):
        open_ = np.flatnonzero(best > CLOSE)
        if not len(open_):
            break
        start = np.tile(world.initial_configuration[columns], (len(open_), 2))
        if attempt:
            start = rng.uniform(lower, upper, start.shape)

        def residuals(x: Array, which: Indices, wanted: Array = points[open_]) -> tuple[Array, Array]:
            return ends(x, wanted[which])

        _, left = least_squares(residuals, start, lower, upper, tolerance=CLOSE / 2.0)
        best[open_] = np.minimum(best[open_], left)
    return best


def _place(world: World, hand: Hand, columns: Indices, x: Array) -> FramePlacement:
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
        legs = _beyond(features.Feature(*posture.reach(q)))
        values.append(legs.value)
        jacobians.append(legs.jacobian)
    return np.concatenate(values, axis=1), np.concatenate(jacobians, axis=1)


def _beyond(inequality: features.Feature) -> features.Feature:
    """Return the violated part of values that should be <= 0."""
    violated = inequality.value > 0.0
    return features.Feature(
        np.where(violated, inequality.value, 0.0), np.where(violated[:, :, None], inequality.jacobian, 0.0)
    )


def _targets(world: World, heights: Sequence[float], spots: int) -> pd.DataFrame:
    import pandas as pd

    rows = []
    side = np.linspace(-1.0, 1.0, spots)
    for name, table in world.scene.tables.items():
        yaw = np.radians(table.yaw)
        margin = min((min(thing.size[:2]) / 2.0 for thing in world.scene.objects.values()), default=0.0)
        for height in heights if table.heights[1] > table.heights[0] else [table.height]:
            for u in side * (table.size[0] / 2.0 - margin):
                for v in side * (table.size[1] / 2.0 - margin):
                    x = table.position[0] + np.cos(yaw) * u - np.sin(yaw) * v
                    y = table.position[1] + np.sin(yaw) * u + np.cos(yaw) * v
                    rows.append({"table": name, "height": float(height), "x": x, "y": y})
    return pd.DataFrame(rows)
