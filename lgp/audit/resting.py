"""Objects on tables: where they stand at first, how they are put down, and whether they would stay there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from lgp.audit.faults import LEVEL, TOUCHING
from lgp.audit.joint_tree import about
from lgp.scene.model import SceneObject, Table
from reba.arrays import Array

ON_TOP: Final = 0.5
"""Least share of the footprint of an object that is on the table."""
UPWARDS: Final = {"x": (np.array([0.0, 1.0, 0.0]), -90.0), "y": (np.array([1.0, 0.0, 0.0]), 90.0),
                  "z": (np.array([0.0, 0.0, 1.0]), 0.0)}  # fmt: skip
"""The turn (axis, angle [deg]) of an object that stands with an axis upwards."""


def rest_pose(table: Table, item: SceneObject) -> tuple[Array, Array]:
    """Return where an object rests at first: rotation (3, 3) and position (3,) [m]."""
    x, y, yaw = item.at
    axis, angle = UPWARDS[item.up]
    top, own = _upright(table.yaw), _upright(yaw) @ about(axis, np.radians([angle]))[0]
    height = item.size["xyz".index(item.up)] / 2.0
    return top @ own, np.array([*table.position, table.height]) + top @ np.array([x, y, height])


def _upright(yaw: float) -> Array:
    return np.asarray(about(np.array([0.0, 0.0, 1.0]), np.radians([yaw]))[0])


def put_down_errors(table: Table, item: SceneObject, rotation: Array, position: Array) -> Iterator[tuple[str, float]]:
    """Yield what is wrong with an object that is put down, and how much [m, deg]: too high or low, tilted."""
    tilt = float(np.degrees(np.arccos(np.clip(rotation[2, 2], -1.0, 1.0))))
    if tilt > LEVEL:
        yield f"tilted by {tilt:.1f} deg", tilt
    lowest = float(position[2] - np.abs(rotation[2]) @ np.array(item.size) / 2.0)
    high = lowest - table.height
    if abs(high) > TOUCHING:
        yield f"{1000 * abs(high):.1f} mm too {'high' if high > 0.0 else 'low'} on {table.full}", abs(high)


def resting_errors(table: Table, item: SceneObject, rotation: Array, position: Array) -> Iterator[tuple[str, float]]:
    """Yield why an object would not stay: its middle beside the top [m], or less than half of its footprint on it."""
    top = _upright(table.yaw)[:2, :2]
    half = np.array(table.size) / 2.0
    middle = top.T @ (position[:2] - np.array(table.position))
    beside = float((np.abs(middle) - half).max())
    if beside > 0.0:
        yield f"has its middle {1000 * beside:.1f} mm beside the top", beside
    share = _share_on(half, middle + _footprint(item, rotation) @ top)
    if share < ON_TOP - 1e-6:
        yield f"has {100 * share:.0f} % of its footprint on the top", share


def _footprint(item: SceneObject, rotation: Array) -> Array:
    """Return the corners (4, 2) [m] of the lower side of an object around its middle, in order."""
    down = int(np.argmax(np.abs(rotation[2])))
    a, b = (rotation[:2, axis] * item.size[axis] / 2.0 for axis in range(3) if axis != down)
    return np.array([a + b, a - b, -a - b, -a + b])


def _share_on(half: Array, corners: Array) -> float:
    """Return the share of the area of a polygon (n, 2) inside of a rectangle of half sides (2,)."""
    whole, inside = _area(corners), list(corners)
    for axis in range(2):
        for sign in (1.0, -1.0):
            kept = []
            for one, other in zip(inside, inside[1:] + inside[:1], strict=True):
                a, b = (half[axis] - sign * point[axis] for point in (one, other))
                if a >= 0.0:
                    kept.append(one)
                if (a >= 0.0) != (b >= 0.0):
                    kept.append(one + (other - one) * a / (a - b))
            inside = kept
    return _area(np.array(inside)) / whole if inside and whole > 0.0 else 0.0


def _area(corners: Array) -> float:
    x, y = corners.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2.0
