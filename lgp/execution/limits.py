"""Joint limits of a robot motion: positions and velocities of its URDF, against the motion sampled densely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lgp.execution.segment import Segment
from lgp.world.model import World

STEP = 0.01
"""[s] Between samples that are checked."""
MARGIN = 1e-3
"""[rad, m] A spline may swing over a position limit by as much; controllers of robots clip there."""


@dataclass(frozen=True)
class Violation:
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


def robot_columns(world: World) -> NDArray[np.intp]:
    """Return the columns of q that belong to robots."""
    return np.concatenate([np.zeros(0, np.intp), *map(world.columns, world.scene.robots)])


def violations(world: World, segment: Segment, columns: NDArray[np.intp]) -> list[Violation]:
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
            found.append(Violation(name, "position", float(times[worst]), value, float(low if value < low else high)))
        worst = int(np.abs(speed[:, column]).argmax())
        value, limit = float(speed[worst, column]), float(speed_limit[column])
        if limit > 0.0 and abs(value) > limit:
            found.append(Violation(name, "velocity", float(times[worst]), value, limit))
    return found


def slowed(world: World, segment: Segment, columns: NDArray[np.intp]) -> tuple[Segment, float]:
    """Return a motion slowed down until all velocities keep their limits, and by how much (1.0: not at all)."""
    ratios = [abs(one.value) / one.limit for one in violations(world, segment, columns) if one.kind == "velocity"]
    factor = max([1.0, *(1.001 * ratio for ratio in ratios)])
    return (
        (segment, 1.0)
        if factor == 1.0
        else (
            Segment(segment.knots, segment.seconds, segment.stretch * factor),
            factor,
        )
    )
