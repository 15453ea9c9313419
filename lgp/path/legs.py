"""One row a slice that keeps both legs long enough: a smooth maximum of how far each is stretched too far.

Upright legs are nearly parallel, so their two rows nearly repeat each other, and a solver cannot tell which one carries
the body. The smooth maximum eps * log(exp(l / eps) + exp(r / eps)) is above both and has one slope and a bounded
curvature; it is stricter than the two by at most eps * log 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lgp.world.human import lengths
from lgp.world.model import World
from lgp.world.posture import PELVIS, PostureMap

Array = NDArray[np.float64]

BLEND = 1e-4
"""[m] eps: both legs count where they differ by less; 0.07 mm of reach are given away."""


class Legs:
    """The row of a human whose legs are solved for.

    Attributes:
        columns: columns of q that it depends on, (p,): those of the pelvis that move.

    Example:
        >>> value, slope = Legs(world).evaluate(world.start[None])            # doctest: +SKIP
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
        beyond, by_human = self.posture.reach(q)
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
