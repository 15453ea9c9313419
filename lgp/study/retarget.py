"""Retargeting of a planned human motion to another stature: working hands keep their positions.

The body is scaled; in every slice the configuration of the plan is then corrected by the smallest joint displacement
that brings both hands to their target positions (damped least squares, `lgp.kinematics.ik`). The target of a working
hand is its planned position; a hand at rest moves with the body. The plan itself is unchanged - robot, timing,
positions of objects - as in a study in which all participants follow the same plan.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from lgp.errors import LgpError
from lgp.kinematics.ik import least_squares
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from lgp.plan_record import Plan
from reba.arrays import Array, Indices
from reba.posture.columns import SIDES

WORKING: Final = 0.15
"""Distance of a hand from its rest position from which on it is fully working [m]; smooth transition below."""
STEP: Final = 0.2
"""Pelvis displacement with the same cost as 1 rad of a joint [m]: people lean and reach before they crouch or step."""


@dataclass(frozen=True)
class RetargetedMotion:
    """Planned motion of a person of some stature, without motion variability.

    Attributes:
        time: (T,) [s], increasing from 0.
        phase: (T,) number of the action.
        posture: (T, 22) angles [deg] in the order of `reba.COLUMNS`.
        carried: (T,) mass in the hands [kg].
        miss: largest distance of a hand from its target position [m].
    """

    time: Array
    phase: Indices
    posture: Array
    carried: Array
    miss: float = 0.0


class Retarget:
    """Retargeting of the first person of a plan to other statures; errors name the plan as `name`.

    Attributes:
        planned: motion of the person of the plan.
        stature: of that person [m].

    Raises:
        LgpError: the plan is infeasible or has no human.
    """

    def __init__(self, plan: Plan, name: str = "the plan") -> None:
        if not plan.feasible:
            raise LgpError(f"{name}: the plan is infeasible ({plan.reason}); give a feasible one")
        person = plan.scene.human
        if person is None or not len(plan.posture):
            raise LgpError(f"{name}: the plan has no human; give one with a human")
        self.planned = RetargetedMotion(plan.time - plan.time[0], plan.phase, plan.posture, plan.carried)
        self.scene, self.human = replace(plan.scene, robots={}, humans={person.name: person}), person
        self.stature = self.human.stature
        world = World(self.scene)
        index = {joint: column for column, joint in enumerate(plan.joints)}
        columns = [index[joint] for joint in world.joints]
        self.path = plan.path[:, columns]
        self.hands, _ = hand_positions(world, self.path)
        rest, _ = hand_positions(world, plan.start[None, columns])
        away = np.linalg.norm((self.hands - rest).reshape(-1, 2, 3), axis=2) / WORKING
        share = np.clip(away, 0.0, 1.0)
        self._motions: dict[float, RetargetedMotion] = {self.stature: self.planned}
        self.working: Array = np.repeat(share**2 * (3.0 - 2.0 * share), 3, axis=1)

    def motion(self, stature: float) -> RetargetedMotion:
        """Motion of a person of this stature [m]; each stature is computed once.

        Raises:
            SceneError: the stature is outside the range of adults.
        """
        if stature not in self._motions:
            self._motions[stature] = self._retarget(stature)
        return self._motions[stature]

    def _retarget(self, stature: float) -> RetargetedMotion:
        world = World(replace(self.scene, humans={self.human.name: replace(self.human, stature=stature)}))
        own, _ = hand_positions(world, self.path)
        targets = own + self.working * (self.hands - own)
        slides = [f"{self.human.name}.pelvis_{axis}" for axis in "xyz"]
        unit = np.array([STEP if joint in slides else 1.0 for joint in world.joints])

        def residuals(scaled: Array, which: Indices) -> tuple[Array, Array]:
            positions, jacobian = hand_positions(world, scaled * unit)
            return positions - targets[which], jacobian * unit

        configuration, miss = least_squares(residuals, self.path / unit, world.lower / unit, world.upper / unit)
        return replace(self.planned, posture=PostureMap(world).angles(configuration * unit), miss=float(miss.max()))


def hand_positions(world: World, q: Array) -> tuple[Array, Array]:
    """Positions of both hands of the first person (T, 6) [m] and their Jacobian (T, 6, nq)."""
    names = [f"{next(iter(world.scene.humans))}.{side}_hand" for side in SIDES]
    kinematics = world.at(q, names)
    places = [kinematics.placement(name) for name in names]
    return (
        np.concatenate([place.position for place in places], axis=1),
        np.concatenate([place.jacobian[:, :3] for place in places], axis=1),
    )
