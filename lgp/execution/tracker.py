"""The simulated tracker: true poses with noise, objects that are lost for a while."""

from __future__ import annotations

import numpy as np

from lgp.execution.observation import Observation, Sighting
from lgp.execution.simulation import SimulatedWorld
from lgp.world.rotations import exponential


class SimulatedTracker:
    """Observations of a simulated world.

    Args:
        simulation: what is tracked.
        rng: of the noise.
        noise: standard deviation of each coordinate [m].
        turn: standard deviation about each axis [rad].

    Attributes:
        lost: object -> time until which it is not seen [s].
    """

    def __init__(
        self, simulation: SimulatedWorld, rng: np.random.Generator, noise: float = 0.001, turn: float = 0.003
    ) -> None:
        self.simulation, self.rng = simulation, rng
        self.noise, self.turn = noise, turn
        self.lost: dict[str, float] = {}
        self._seen: dict[str, Sighting] = {}

    def observe(self) -> Observation:
        """Return the present moment; an object that is lost keeps its last sighting."""
        truth = self.simulation
        for name in truth.things:
            pose = truth.pose(name)
            shift = self.rng.normal(0.0, self.noise, 3)
            turn = exponential(self.rng.normal(0.0, self.turn, 3))
            if truth.time >= self.lost.get(name, 0.0):
                self._seen[name] = Sighting(pose.rotation @ turn, pose.position + shift, truth.time)
        return Observation(truth.time, truth.q.copy(), dict(self._seen), frozenset(truth.robots.closed))
