"""How much of an object is on the table that it rests on: the area that two rectangles share, and its derivatives."""

from __future__ import annotations

from typing import Final

import numpy as np

from lgp.scene.model import SceneObject, Table
from reba.arrays import Array

LEAST_SHARE: Final = 0.5
"""Share of the footprint of an object that is on the table at least, beside its middle (a choice)."""
FLUSH: Final = 1e-9
"""[m] Sides that are as near as this to each other count as one."""


def footprint(item: SceneObject, up: str = "z") -> Array:
    """Return the half sides (2,) [m] of the footprint of an object that stands with an axis upwards, at yaw 0.

    >>> from lgp.scene.scene_file import load_scene
    >>> footprint(load_scene("screwdriver").objects["screwdriver"]).tolist()
    [0.11, 0.015]
    """
    sides = {"x": (2, 1), "y": (0, 2), "z": (0, 1)}[up]
    return np.array([item.size[side] / 2.0 for side in sides])


def first_share(table: Table, item: SceneObject) -> float:
    """Return the share of the footprint of an object that is on its table initially."""
    x, y, yaw = item.at
    half = footprint(item, item.up)
    area, _ = shared_area(np.array(table.size) / 2.0, half, np.array([[x, y, np.radians(yaw)]]))
    return float(area[0] / (4.0 * half.prod()))


def shared_area(table: Array, half: Array, places: Array) -> tuple[Array, Array]:
    """Return the area of a footprint that is on a table (n,) [m2], and its derivatives (n, 3) by x, y and yaw.

    Args:
        table: half sides (2,) [m] of the top.
        half: half sides (2,) [m] of the footprint.
        places: (n, 3) its middle x, y [m] relative to that of the top, which it is above, and its yaw [rad].

    Example:
        >>> shared_area(np.array([1.0, 1.0]), np.array([0.2, 0.1]), np.array([[1.0, 0.0, 0.0]]))[0].round(3).tolist()
        [0.04]
    """
    middle, yaw = places[:, None, :2], places[:, 2]
    turn = np.stack([np.cos(yaw), -np.sin(yaw), np.sin(yaw), np.cos(yaw)], axis=1).reshape(-1, 2, 2)
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    feet = middle + (corners * half) @ np.swapaxes(turn, 1, 2)
    tops = np.broadcast_to(corners * table, feet.shape)
    own, top = _clipped(feet, table + FLUSH), _clipped((tops - middle) @ turn, half - FLUSH)
    # By Green's theorem: the sides of both that are inside of the other are the border of what they share.
    area = _swept(feet, own) + _swept(tops, top)
    sides = np.roll(feet, -1, axis=1) - feet
    length = own[..., 1] - own[..., 0]
    outward = length[..., None] * np.stack([sides[..., 1], -sides[..., 0]], axis=2)
    arm = feet + own.mean(axis=2)[..., None] * sides - middle
    spin = arm[..., 0] * outward[..., 1] - arm[..., 1] * outward[..., 0]
    return area, np.concatenate([outward.sum(axis=1), spin.sum(axis=1)[:, None]], axis=1)


def _clipped(corners: Array, half: Array) -> Array:
    """Return from where to where (n, 4, 2) the sides of rectangles (n, 4, 2) are inside of a box around 0."""
    sides = np.roll(corners, -1, axis=1) - corners
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-half - corners) / sides, (half - corners) / sides
    parallel = sides == 0.0
    inside = np.abs(corners) <= half
    enter = np.where(parallel, np.where(inside, 0.0, 1.0), np.minimum(one, other))
    leave = np.where(parallel, np.where(inside, 1.0, 0.0), np.maximum(one, other))
    begin = np.clip(enter.max(axis=2), 0.0, 1.0)
    return np.stack([begin, np.clip(leave.min(axis=2), begin, 1.0)], axis=2)


def _swept(corners: Array, shares: Array) -> Array:
    """Return the area (n,) that parts of the sides of rectangles (n, 4, 2) span with the origin."""
    sides = np.roll(corners, -1, axis=1) - corners
    cross = corners[..., 0] * sides[..., 1] - corners[..., 1] * sides[..., 0]
    return np.asarray(0.5 * (cross * (shares[..., 1] - shares[..., 0])).sum(axis=1))
