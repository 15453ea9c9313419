"""What a path through known keyframes may cost: no bound, but cheap and on the same scale; it orders the search.

Each limb passes the keyframes of its own actions with the least acceleration and is free in between, so that an arm
that waits is not drawn back to rest; the ergonomic cost is that of this motion.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lgp.kinematics.cost_terms import CostTerms
from lgp.kinematics.world import World
from lgp.path.costs import CondensedQuadratic, Weights, acceleration_quadratic, eliminate_slices
from lgp.path.ergonomics import Ergonomics
from lgp.path.phases import Phases
from reba.arrays import Array, Flags


class CostEstimate:
    """Costs of paths of a scene, estimated from keyframes.

    Args:
        ergonomics: the ergonomic cost, None to leave it out.
        initial_configuration: (nq,) [rad, m].
    """

    def __init__(
        self, world: World, ergonomics: Ergonomics | None, weights: Weights, initial_configuration: Array
    ) -> None:
        self.world, self.ergonomics, self.weights = world, ergonomics, weights
        self.initial_configuration = initial_configuration
        self.terms = CostTerms(world)

    def of(self, phases: Phases, keyframes: Array) -> float:
        """Return the estimated cost of a path through keyframes (K, nq) that stops at the end."""
        away = keyframes - self.initial_configuration
        path = np.zeros((phases.total, self.world.nq))
        acceleration = 0.0
        for acts in np.unique(self._acts(phases), axis=1).T:
            if not acts.any():
                continue
            columns = np.flatnonzero((self._acts(phases) == acts[:, None]).all(axis=0))
            condensed = _through(phases.slices, phases.tau, tuple(acts.tolist()))
            own = away[np.ix_(acts, columns)]
            acceleration += float(np.vdot(own, condensed.cost @ own))
            path[:, columns] = condensed.expand @ own
        cost = self.weights.acceleration * acceleration + self.weights.time * phases.tau * phases.total
        if self.ergonomics is not None:
            loads = phases.loads()
            scores = self.ergonomics.value(path + self.initial_configuration, loads) + self.ergonomics.payload(loads)
            cost += self.weights.ergonomics * phases.tau * float(scores.sum())
        if self.terms:
            cost += phases.tau * float(self.terms.value(path + self.initial_configuration).sum())
        return cost + phases.action_cost

    def _acts(self, phases: Phases) -> Flags:
        """Return (K, nq) which joints move a hand that takes part in which switch."""
        return np.array([np.any([self.world.support(hand) for hand in s.hands], axis=0) for s in phases.switches])


@lru_cache(maxsize=1024)
def _through(slices: int, tau: float, acts: tuple[bool, ...]) -> CondensedQuadratic:
    """Return the acceleration cost on the keyframes in which a joint acts; it rests in the slice after each."""
    total = slices * len(acts)
    knots = (np.flatnonzero(acts) + 1) * slices - 1
    rests = [(int(knot), int(knot) + 1) for knot in knots if knot + 1 < total]
    return eliminate_slices(acceleration_quadratic(total, tau, stop=True), knots, rests)
