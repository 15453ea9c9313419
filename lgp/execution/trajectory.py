"""Motions over time: the slices of one phase as a smooth function that begins and ends at rest, and a brake.

Nobody knows how long the wait between two actions is, so every motion slows down at its end. The path through the
slices is a cubic spline; progress along it has a constant rate with a ramp at either end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.kinematics.world import World
from reba.arrays import Array, Indices

RAMP = 0.3
"""[s] Time in which a motion gets up to its speed and slows down again, half of it added to its duration each time."""
BRAKE = 0.25
"""[s] Time in which a motion that is broken off comes to rest."""


class JointTrajectory:
    """The motion of one phase.

    Args:
        knots: (S + 1, n) configurations, the first one where it starts.
        seconds: that the phase takes at constant rate.
        stretch: by how much it is slowed down.

    >>> segment = Segment(np.array([[0.0], [1.0], [2.0]]), 1.0)
    >>> segment.duration, float(segment.at(0.65)[0].round(9)), float(segment.velocity(0.0)[0])
    (1.3, 1.0, 0.0)
    """

    def __init__(self, knots: Array, seconds: float, stretch: float = 1.0) -> None:
        from scipy.interpolate import CubicSpline

        self.knots, self.seconds, self.stretch = np.asarray(knots, dtype=float), seconds, stretch
        bend = "natural" if len(self.knots) > 2 else "clamped"
        self._spline = CubicSpline(np.linspace(0.0, seconds, len(self.knots)), self.knots, bc_type=bend)
        self._ramp = min(RAMP, seconds)

    @property
    def duration(self) -> float:
        """Time that it takes [s]."""
        return (self.seconds + self._ramp) * self.stretch

    def at(self, time: float) -> Array:
        """Return the configuration (n,) at a time since its start [s]; it stays where it ends."""
        return np.asarray(self._spline(self._progress(time)[0]))

    def velocity(self, time: float) -> Array:
        """Return the velocity (n,) at a time since its start."""
        progress, rate, _ = self._progress(time)
        return np.asarray(self._spline(progress, 1) * rate)

    def acceleration(self, time: float) -> Array:
        """Return the acceleration (n,) at a time since its start."""
        progress, rate, change = self._progress(time)
        return np.asarray(self._spline(progress, 2) * rate**2 + self._spline(progress, 1) * change)

    def _progress(self, time: float) -> tuple[float, float, float]:
        """Return progress [s] along the path, its rate and the change of the rate [1/s]."""
        t = min(max(time / self.stretch, 0.0), self.seconds + self._ramp)
        left = self.seconds + self._ramp - t
        if t < self._ramp:
            found = t * t / (2.0 * self._ramp), t / self._ramp, 1.0 / self._ramp
        elif left < self._ramp:
            found = self.seconds - left * left / (2.0 * self._ramp), left / self._ramp, -1.0 / self._ramp
        else:
            found = t - self._ramp / 2.0, 1.0, 0.0
        return found[0], found[1] / self.stretch, found[2] / self.stretch**2


@dataclass(frozen=True)
class Brake:
    """Coming to rest from a velocity (n,) at a configuration (n,)."""

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
"""[s] Between samples that are checked."""
MARGIN = 1e-3
"""[rad, m] A spline may swing over a position limit by as much; controllers of robots clip there."""


@dataclass(frozen=True)
class LimitViolation:
    """A limit that a motion does not keep.

    Attributes:
        joint: `agent.joint`.
        kind: "position" or "velocity".
        time: since the motion began, where it is worst [s].
        value, limit: [rad, m] or per second.
    """

    joint: str
    kind: str
    time: float
    value: float
    limit: float

    def __str__(self) -> str:
        unit = "rad" if self.kind == "position" else "rad/s"
        return f"{self.joint}: {self.kind} {self.value:.3f} {unit} at {self.time:.2f} s, limit {self.limit:.3f}"


def robot_columns(world: World) -> Indices:
    """Return the columns of q that belong to robots."""
    return np.concatenate([np.zeros(0, np.intp), *map(world.columns, world.scene.robots)])


def violations(world: World, segment: JointTrajectory, columns: Indices) -> list[LimitViolation]:
    """Return the worst violation of each joint and kind; none if the motion can be executed.

    Args:
        world: whose limits.
        segment: the motion.
        columns: of the joints that are checked.
    """
    times = np.arange(0.0, segment.duration + STEP, STEP)
    speed_limit = np.asarray(world.model.velocityLimit, dtype=float)
    q = np.array([segment.at(t) for t in times])
    speed = np.array([segment.velocity(t) for t in times])
    found = []
    for column in columns:
        name = world.joints[column]
        low, high = world.lower[column], world.upper[column]
        beyond = np.maximum(low - q[:, column], q[:, column] - high)
        worst = int(beyond.argmax())
        if beyond[worst] > MARGIN:
            value = float(q[worst, column])
            found.append(
                LimitViolation(name, "position", float(times[worst]), value, float(low if value < low else high))
            )
        worst = int(np.abs(speed[:, column]).argmax())
        value, limit = float(speed[worst, column]), float(speed_limit[column])
        if limit > 0.0 and abs(value) > limit:
            found.append(LimitViolation(name, "velocity", float(times[worst]), value, limit))
    return found


def time_scaled(world: World, segment: JointTrajectory, columns: Indices) -> tuple[JointTrajectory, float]:
    """Return a motion slowed down until all velocities keep their limits, and by how much (1.0: not at all)."""
    ratios = [abs(one.value) / one.limit for one in violations(world, segment, columns) if one.kind == "velocity"]
    factor = max([1.0, *(1.001 * ratio for ratio in ratios)])
    return (
        (segment, 1.0)
        if factor == 1.0
        else (
            JointTrajectory(segment.knots, segment.seconds, segment.stretch * factor),
            factor,
        )
    )
