"""The motion of one agent of a plan over time, between slices as the plan interpolates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lgp.errors import LgpError
from lgp.kinematics.interpolation import interpolate, interpolation_speed
from reba.arrays import Array

if TYPE_CHECKING:
    import pandas as pd

MOST_MOMENTS = 10_000_000
"""Moments of a trajectory; a choice."""


@dataclass(frozen=True, eq=False)
class AgentTrajectory:
    """The motion of one agent.

    Attributes:
        agent: its name.
        joints: names of the k joints, those of its URDF without the joints that are locked or follow others; of a
            person those of the body model.
        time: (n,) [s], from 0.
        position: (n, k) [rad], [m] of slides.
        velocity: (n, k) [rad/s, m/s], 0 at both ends.
    """

    agent: str
    joints: tuple[str, ...]
    time: Array
    position: Array
    velocity: Array

    def frame(self) -> pd.DataFrame:
        """Return a table: `time`, the positions by joint, and the velocities as `JOINT_velocity`."""
        import pandas as pd

        velocities = dict(zip((f"{name}_velocity" for name in self.joints), self.velocity.T, strict=True))
        return pd.DataFrame({"time": self.time} | dict(zip(self.joints, self.position.T, strict=True)) | velocities)


def configurations_at(knots: Array, clock: Array, moments: Array) -> tuple[Array, Array]:
    """Return the configurations (n, nq) and velocities (n, nq) at moments (n,) [s] of knots (T, nq) at `clock` (T,)."""
    if len(knots) < 2:
        return np.repeat(knots, len(moments), axis=0), np.zeros((len(moments), knots.shape[1]))
    before = np.clip(np.searchsorted(clock, moments, side="right") - 1, 0, len(clock) - 2)
    step = clock[before + 1] - clock[before]
    share = np.clip((moments - clock[before]) / step, 0.0, 1.0)
    return interpolate(knots, before, share), interpolation_speed(knots, before, share) / step[:, None]


def moments_of(clock: Array, step: float | None) -> Array:
    """Return the moments (n,) [s] of a clock (T,): its own, or every `step` from 0 to the end, both included.

    Raises:
        LgpError: the step is so small that there are too many.
    """
    if step is None:
        return clock
    count = int(np.ceil(clock[-1] / step - 1e-9))
    if count > MOST_MOMENTS:
        raise LgpError(f"step is {step:g} s, which gives {count} moments, expected up to {MOST_MOMENTS}; give more")
    return np.append(np.arange(count) * step, clock[-1])
