"""Motions over time: the slices of one phase as a smooth trajectory from rest to rest, and a brake.

The wait between two actions is unknown, so every motion ends at rest. The path through the slices is that of the plan,
as it interpolates; its path parameter has a trapezoidal rate: constant, with a linear ramp at either end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.kinematics.interpolation import interpolate, interpolation_acceleration, interpolation_speed
from lgp.kinematics.world import World
from lgp.scene.joint_units import TURN, JointUnit
from reba.arrays import Array, Indices

RAMP = 0.3
"""[s] Duration of each ramp of the rate; the two ramps together prolong a motion by as much."""
BRAKE = 0.25
"""[s] Time in which an interrupted motion comes to rest."""


class JointTrajectory:
    """The motion of one phase, from rest to rest.

    Args:
        knots: (S + 1, n) configurations, the initial one first [rad, m].
        seconds: duration at constant rate.
        scale: factor of its duration, 1 or more, see `time_scaled`.
        beside: configurations (n,) one slice before the first knot and after the last, where the path goes on; at rest
            by default.

    >>> trajectory = JointTrajectory(np.array([[0.0], [1.0], [2.0]]), 1.0)
    >>> trajectory.duration, float(trajectory.at(0.65)[0].round(9)), float(trajectory.velocity(0.0)[0])
    (1.3, 1.0, 0.0)
    """

    def __init__(
        self, knots: Array, seconds: float, scale: float = 1.0, beside: tuple[Array, Array] | None = None
    ) -> None:
        self.knots, self.seconds, self.scale = np.asarray(knots, dtype=float), seconds, scale
        self.beside = (self.knots[0], self.knots[-1]) if beside is None else beside
        self._step = seconds / (len(self.knots) - 1)
        self._path = np.concatenate([self.beside[0][None], self.knots, self.beside[1][None]])
        self._ramp = min(RAMP, seconds)

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return (self.seconds + self._ramp) * self.scale

    def at(self, time: float) -> Array:
        """Return the configuration (n,) at a time since its start [s]; the last one after its end."""
        return interpolate(self._path, *self._place(self._progress(time)[0]))[0]

    def velocity(self, time: float) -> Array:
        """Return the velocity (n,) at a time since its start."""
        progress, rate, _ = self._progress(time)
        return np.asarray(interpolation_speed(self._path, *self._place(progress))[0] * (rate / self._step))

    def acceleration(self, time: float) -> Array:
        """Return the acceleration (n,) at a time since its start."""
        progress, rate, change = self._progress(time)
        place = self._place(progress)
        curvature = interpolation_acceleration(self._path, *place)[0] * (rate / self._step) ** 2
        return np.asarray(curvature + interpolation_speed(self._path, *place)[0] * (change / self._step))

    def _place(self, progress: float) -> tuple[Indices, Array]:
        """Return the knot before a path parameter [s] and its share of the way to the next one."""
        steps = progress / self._step
        before = min(int(steps), len(self.knots) - 2)
        return np.array([before + 1]), np.array([steps - before])

    def _progress(self, time: float) -> tuple[float, float, float]:
        """Return the path parameter [s], its rate [-] and the change of the rate [1/s]."""
        t = min(max(time / self.scale, 0.0), self.seconds + self._ramp)
        left = self.seconds + self._ramp - t
        if t < self._ramp:
            progress, rate, change = t * t / (2.0 * self._ramp), t / self._ramp, 1.0 / self._ramp
        elif left < self._ramp:
            progress = self.seconds - left * left / (2.0 * self._ramp)
            rate, change = left / self._ramp, -1.0 / self._ramp
        else:
            progress, rate, change = t - self._ramp / 2.0, 1.0, 0.0
        return progress, rate / self.scale, change / self.scale**2


@dataclass(frozen=True)
class Brake:
    """Deceleration to rest at a constant rate, from a velocity (n,) at a configuration (n,)."""

    start: Array
    speed: Array
    duration: float = BRAKE

    def at(self, time: float) -> Array:
        """Return the configuration (n,) at a time since its start [s]."""
        t = min(max(time, 0.0), self.duration)
        return self.start + self.speed * (t - t * t / (2.0 * self.duration))

    def velocity(self, time: float) -> Array:
        """Return the velocity (n,) at a time since its start."""
        return self.speed * max(1.0 - max(time, 0.0) / self.duration, 0.0)

    def acceleration(self, time: float) -> Array:
        """Return the acceleration (n,) at a time since its start."""
        return -self.speed / self.duration if time < self.duration else np.zeros_like(self.speed)


Move = JointTrajectory | Brake
STEP = 0.01
"""[s] Time between samples at which limits are checked."""
MARGIN = 1e-3
"""[rad, m] Excess of a position limit that is allowed; robot controllers clip it."""


@dataclass(frozen=True)
class LimitViolation:
    """A joint limit that a motion exceeds.

    Attributes:
        joint: `agent.joint`.
        kind: "position" or "velocity".
        time: of the largest excess, since the start of the motion [s].
        value, limit: [rad, m] or per second.
        unit: of the joint.
    """

    joint: str
    kind: str
    time: float
    value: float
    limit: float
    unit: JointUnit = TURN

    def __str__(self) -> str:
        unit = self.unit.si if self.kind == "position" else f"{self.unit.si}/s"
        return f"{self.joint}: {self.kind} {self.value:.3f} {unit} at {self.time:.2f} s, limit {self.limit:.3f}"


def robot_columns(world: World) -> Indices:
    """Return the columns of q that belong to robots."""
    return np.concatenate([np.zeros(0, np.intp), *map(world.columns, world.scene.robots)])


def violations(world: World, trajectory: JointTrajectory, columns: Indices) -> list[LimitViolation]:
    """Return the largest violation of each joint in `columns` of q and of each kind."""
    # At the same places of the path however it is slowed down.
    times = np.linspace(0.0, trajectory.duration, max(round(trajectory.duration / trajectory.scale / STEP), 1) + 1)
    speed_limit = world.speed_limit
    q = np.array([trajectory.at(t) for t in times])
    speed = np.array([trajectory.velocity(t) for t in times])
    violated = []
    for column in columns:
        name = world.joints[column]
        unit = world.units[name]
        low, high = world.lower[column], world.upper[column]
        beyond = np.maximum(low - q[:, column], q[:, column] - high)
        worst = int(beyond.argmax())
        if beyond[worst] > MARGIN:
            value = float(q[worst, column])
            limit = float(low if value < low else high)
            violated.append(LimitViolation(name, "position", float(times[worst]), value, limit, unit))
        worst = int(np.abs(speed[:, column]).argmax())
        value, limit = float(speed[worst, column]), float(speed_limit[column])
        if abs(value) > limit:
            violated.append(LimitViolation(name, "velocity", float(times[worst]), value, limit, unit))
    return violated


def time_scaled(world: World, trajectory: JointTrajectory, columns: Indices) -> tuple[JointTrajectory, float]:
    """Return a motion slowed down to the velocity limits, and the factor of its duration (1.0: unchanged)."""
    ratios = [abs(one.value) / one.limit for one in violations(world, trajectory, columns) if one.kind == "velocity"]
    factor = max([1.0, *(1.001 * ratio for ratio in ratios)])
    if factor == 1.0:
        return trajectory, 1.0
    scale = trajectory.scale * factor
    return JointTrajectory(trajectory.knots, trajectory.seconds, scale, trajectory.beside), factor
